//! A sinusoid in time: its frequency comes from a search of its own ([`crate::thermal::search::tones`]).

use super::{Bias, Candidate, Estimate, Missing, Parameter, Point, Reported, Sheet, entry, map};
use crate::thermal::channels::Channels;
use std::f64::consts::TAU;

/// Aliased mains, a spur.
pub struct Pickup {
    /// Where to start, Hz.
    pub frequency_hz: f64,
    /// Whether there is one already, or too little of it to tell: then this one has no name.
    pub further: bool,
}

/// Ids of a tone with a name and of one without.
pub const NAMED: &str = "periodic_pickup";
pub const FURTHER: &str = "outside:tone";

/// Fewest periods over the record of a tone with a name. What wanders slowly, a channel that was not recorded
/// say, turns two or three times in a record as well; that it comes back a fourth time is a prediction.
const NAMED_PERIODS: f64 = 4.0;

/// Whether a tone comes back often enough in a record for a name.
pub fn returns(c: &Channels, frequency_hz: f64) -> bool {
    frequency_hz * c.span_s() >= NAMED_PERIODS
}

const PICKUP: Sheet = Sheet {
    id: NAMED,
    physics: "mains, a switching supply or a spur of the oscillator beats with the sampling and \
              comes down to a slow sine",
    equation: "a sin(2 pi f t) + b cos(2 pi f t), f modulo the rate of the rows",
    parameters: &[
        Parameter {
            name: "frequency_hz",
            plausible: (1e-5, 1e3),
        },
        Parameter {
            name: "amplitude_dps",
            plausible: (1e-4, 5.0),
        },
        Parameter {
            name: "phase_rad",
            plausible: (-3.15, 3.15),
        },
    ],
    compensable: false,
    confounders: &["temperature_rate", "thermal_lag"],
    experiment: "change the sampling rate by 0.1 %: an alias moves, a cause in the temperature does \
                 not",
    reference: "Torosyan & Willson 2005 (oscillator spurs); general knowledge (aliases)",
};

impl Candidate for Pickup {
    fn sheet(&self) -> &Sheet {
        &PICKUP
    }

    fn id(&self) -> String {
        [NAMED, FURTHER][usize::from(self.further)].to_owned()
    }

    fn named(&self) -> bool {
        !self.further
    }

    fn repeats(&self) -> bool {
        self.further
    }

    fn channels(&self, _c: &Channels) -> Result<Vec<String>, Missing> {
        Ok(vec!["time_s".to_owned()])
    }

    fn points(&self, _c: &Channels) -> Vec<Point> {
        vec![Point::at(0, &[self.frequency_hz])]
    }

    fn columns(&self, c: &Channels, _bias: &Bias, point: &Point) -> Vec<Vec<f64>> {
        let w = TAU * point.theta[0];
        vec![
            map(&c.time_s, |t| (w * t).sin()),
            map(&c.time_s, |t| (w * t).cos()),
        ]
    }

    fn spacing(&self, c: &Channels, _point: &Point) -> Vec<f64> {
        vec![0.25 / c.span_s().max(f64::MIN_POSITIVE)]
    }

    fn surcharge(&self, c: &Channels, _point: &Point) -> f64 {
        // As many frequencies were looked at as there are pairs of rows.
        (0.5 * c.len() as f64).max(1.0).ln()
    }

    fn report(&self, _c: &Channels, e: &Estimate) -> Reported {
        let (a, b) = (e.beta[0], e.beta.get(1).copied().unwrap_or(0.0));
        let std = e.beta_std.iter().fold(0.0f64, |m, s| m.max(*s));
        let size = a.hypot(b);
        let f_std = e.theta_std.first().copied().unwrap_or(0.0);
        [
            entry("frequency_hz", e.point.theta[0], f_std),
            entry("amplitude_dps", size, std),
            entry("phase_rad", b.atan2(a), std / size.max(f64::MIN_POSITIVE)),
        ]
        .into_iter()
        .collect()
    }
}
