//! Dead zone around rate zero.
//!
//! A reading is a mean over a row. Where the rate moves within it, a part of the row may be inside the zone and the rest outside:
//! each shape is there once for readings of a rate that stands still and once for means over one that moves.

use super::rate::{rate_alone, top};
use super::within_rows::Within;
use super::{
    Bias, Candidate, Estimate, Missing, Parameter, Point, Reported, Sheet, entry, from_log, map,
    spaced,
};
use crate::statistics::stats;
use crate::thermal::channels::Channels;
use crate::thermal::search::declared_by;

/// Dead zone around rate zero.
pub(super) struct Deadband;

/// Whether what is beyond the zone comes through less the zone.
fn subtracts(point: &Point) -> bool {
    point.form % 2 == 1
}

/// Whether readings are means over a rate that moves.
fn is_mean(point: &Point) -> bool {
    point.form >= 2
}

/// Whether it changes with the half width between two readings as well.
fn is_smooth(point: &Point) -> bool {
    subtracts(point) || is_mean(point)
}

/// Most edges of a dead band that are tried, and how many to each side of one that is near.
const MOST_EDGES: usize = 300;
const NEAREST_EDGES: usize = 20;

/// Magnitudes of rates, in order, each once, without 0.
fn magnitudes(rates: impl Iterator<Item = f64>) -> Vec<f64> {
    let mut sizes: Vec<f64> = rates.map(f64::abs).filter(|s| *s > 0.0).collect();
    sizes.sort_by(f64::total_cmp);
    sizes.dedup();
    sizes
}

/// Those of the rows that are seen.
fn seen_magnitudes(c: &Channels, seen: &[bool]) -> Vec<f64> {
    let rate = c.column("rate_dps").unwrap_or(&[]);
    magnitudes(rate.iter().zip(seen).filter(|(_, s)| **s).map(|(r, _)| *r))
}

/// A rate is within a half width that is equal to it, whatever logarithms do.
const ROUNDING: f64 = 1e-9;

/// Logarithms of half widths, one between any two neighbouring magnitudes.
fn between(sizes: &[f64]) -> Vec<f64> {
    sizes
        .windows(2)
        .map(|w| 0.5 * (w[0].ln() + w[1].ln()))
        .collect()
}

const DEADBAND: Sheet = Sheet {
    id: "output_deadband",
    physics: "below a threshold the loop does not answer to rate; beyond it the full rate, or what \
              is above the threshold, comes through",
    equation: "-rate where |rate| <= d; beyond it 0, or -d sign(rate); or means of that over rows in which \
               the rate moves",
    parameters: &[Parameter {
        name: "half_width_dps",
        plausible: (1e-3, 10.0),
    }],
    compensable: false,
    confounders: &["scale_factor_nonlinearity"],
    experiment: "a slow sweep of the table through rate zero in both directions",
    reference: "IEEE Std 1431 (threshold, dead zone)",
};

impl Candidate for Deadband {
    fn sheet(&self) -> &Sheet {
        &DEADBAND
    }

    fn equation(&self, _c: &Channels, point: &Point) -> String {
        let beyond = if subtracts(point) {
            "-d sign(rate)"
        } else {
            "0"
        };
        let law = format!("-rate where |rate| <= d, beyond it {beyond}");
        match is_mean(point) {
            true => format!("{law}, averaged over each row, in which the rate moves"),
            false => law,
        }
    }

    fn channels(&self, c: &Channels) -> Result<Vec<String>, Missing> {
        rate_alone(c)
    }

    fn points(&self, c: &Channels) -> Vec<Point> {
        // Half widths between neighbouring magnitudes that were applied.
        let sizes = magnitudes(c.column("rate_dps").unwrap_or(&[]).iter().copied());
        let least = sizes.first().copied().unwrap_or(0.0).max(1e-4 * top(c));
        // Of what the declared bias leaves: its own course would pass for noise that hides a small zone.
        let (_, rest) = declared_by(&c.u, &c.error_dps);
        let small = 0.3 * stats::difference_noise(&rest);
        let mut out = Vec::new();
        let forms = if Within::moves(c) { 4 } else { 2 };
        for form in 0..forms {
            // What subtracts shows at every rate, however small it is; what jumps only at rates within the zone.
            let from = if form == 0 {
                1.001 * least
            } else {
                (1e-3 * top(c)).min(least).min(small).max(1e-6 * top(c))
            };
            let to = 0.9 * top(c);
            let widths = spaced(from, to, ((to / from).ln() / 0.3).ceil().max(24.0) as usize);
            out.extend(widths.into_iter().map(|d| Point::at(form, &[d.ln()])));
        }
        out
    }

    fn columns(&self, c: &Channels, _bias: &Bias, point: &Point) -> Vec<Vec<f64>> {
        let d = point.theta[0].exp();
        let beyond = if subtracts(point) { -d } else { 0.0 };
        let missing = |o: f64| match o.abs() <= d {
            true => -o,
            false => beyond * o.signum(),
        };
        if is_mean(point) {
            // What is missing, summed up from rate 0.
            let sum = |o: f64| {
                let within = o.abs().min(d);
                -0.5 * within * within + beyond * (o.abs() - within)
            };
            return vec![Within::of(c).means(missing, sum)];
        }
        vec![map(c.column("rate_dps").unwrap_or(&[]), missing)]
    }

    fn fine(&self, c: &Channels, _point: &Point, seen: &[bool]) -> Vec<Point> {
        // What jumps at its edge changes where a rate comes within: between two magnitudes, all are alike.
        let sizes = seen_magnitudes(c, seen);
        let edges = between(&sizes);
        let every = edges.len().div_ceil(MOST_EDGES).max(1);
        let jumps = edges.iter().step_by(every).map(|d| Point::at(0, &[*d]));
        let smooth = self.points(c).into_iter().filter(is_smooth);
        jumps.chain(smooth).collect()
    }

    fn stairs(&self, c: &Channels, point: &Point) -> (Vec<Vec<Point>>, Vec<Point>) {
        if is_smooth(point) {
            return (Vec::new(), Vec::new());
        }
        let edges = between(&magnitudes(
            c.column("rate_dps").unwrap_or(&[]).iter().copied(),
        ));
        let own = edges.partition_point(|d| *d < point.theta[0]);
        let near = own.saturating_sub(NEAREST_EDGES)..edges.len().min(own + NEAREST_EDGES);
        let along = edges[near].iter().map(|d| Point::at(0, &[*d]));
        (vec![along.collect()], Vec::new())
    }

    fn open(&self, c: &Channels, point: &Point, seen: &[bool]) -> Vec<Point> {
        let sizes = seen_magnitudes(c, seen);
        let within = sizes.partition_point(|s| s.ln() <= point.theta[0]);
        let widest = sizes[..within].last().filter(|_| !is_smooth(point));
        let least = widest.map(|s| Point::at(0, &[s.ln() + ROUNDING]));
        least.into_iter().collect()
    }

    fn spacing(&self, _c: &Channels, _point: &Point) -> Vec<f64> {
        vec![0.25]
    }

    fn is_whole(&self) -> bool {
        true
    }

    fn report(&self, _c: &Channels, e: &Estimate) -> Reported {
        [
            from_log("half_width_dps", e, 0),
            entry("subtracts", f64::from(u8::from(subtracts(&e.point))), 0.0),
        ]
        .into_iter()
        .collect()
    }
}

#[cfg(test)]
#[path = "deadband_tests.rs"]
mod tests;
