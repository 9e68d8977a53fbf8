//! Effects of the demodulation phase: quadrature that leaks into the rate.

use super::{
    Bias, Candidate, Estimate, Missing, Parameter, Point, Reported, Sheet, entry, gain, heated,
    moving,
};
use crate::correction::Term;
use crate::thermal::channels::Channels;
use crate::thermal::firmware::Words;

/// All of this file.
pub fn all() -> Vec<Box<dyn Candidate>> {
    vec![Box::new(Leakage), Box::new(PhaseDrift)]
}

/// Constant phase error times quadrature.
struct Leakage;

const LEAKAGE: Sheet = Sheet {
    id: "quadrature_leakage",
    physics: "a constant phase error of the demodulator lets part of the quadrature into the rate",
    equation: "Q sin(phase), Q the quadrature",
    parameters: &[Parameter {
        name: "phase_rad",
        plausible: (1e-5, 0.1),
    }],
    compensable: true,
    confounders: &["demod_phase_drift"],
    experiment: "step the quadrature null voltage at constant temperature: the slope of output over \
                 quadrature is the phase error",
    reference: "Ezekwe, ISSCC 2015",
};

impl Candidate for Leakage {
    fn sheet(&self) -> &Sheet {
        &LEAKAGE
    }

    fn channels(&self, c: &Channels) -> Result<Vec<String>, Missing> {
        moving(c, "quad_dps")?;
        Ok(vec!["quad_dps".to_owned()])
    }

    fn points(&self, _c: &Channels) -> Vec<Point> {
        vec![Point::form(0)]
    }

    fn columns(&self, c: &Channels, _bias: &Bias, _point: &Point) -> Vec<Vec<f64>> {
        c.column("quad_dps")
            .map(<[f64]>::to_vec)
            .into_iter()
            .collect()
    }

    fn correction(&self, c: &Channels, e: &Estimate, f: &mut Words) -> Option<Vec<Term>> {
        let columns = self.columns(c, &f.bias.clone(), &e.point);
        f.surface(c, "quad_dps", &columns, &e.beta)
    }

    fn report(&self, _c: &Channels, e: &Estimate) -> Reported {
        [gain("phase_rad", e, 0, 1.0)].into_iter().collect()
    }
}

/// Phase error that drifts with temperature, times quadrature.
struct PhaseDrift;

const PHASE_DRIFT: Sheet = Sheet {
    id: "demod_phase_drift",
    physics: "the demodulator's phase error moves with temperature and lets a varying part of the \
              quadrature into the rate",
    equation: "Q rad_per_k (T - reference), Q the quadrature",
    parameters: &[
        Parameter {
            name: "rad_per_k",
            plausible: (1e-7, 3e-3),
        },
        Parameter {
            name: "reference_degc",
            plausible: ZERO_DEGC,
        },
    ],
    compensable: true,
    confounders: &["quadrature_leakage", "bias_third_order"],
    experiment: "two levels of quadrature at several temperatures",
    reference: "Pileri et al., MEMS 2025",
};

/// Where a phase error that drifts may pass through zero, degC: beyond, the drift is the smaller part of it, and what
/// there is to name is the constant error.
const ZERO_DEGC: (f64, f64) = (-40.0, 125.0);

/// The same in spans of the record's own temperature from its middle, for a thermometer whose degrees are those of
/// a design that may be another gyro's.
const ZERO_SPANS: f64 = 1.5;

/// First guesses of the zero: in half spans from the middle, and where a phase is usually trimmed, degC (300 K,
/// ambient temperatures).
const ZEROS: [f64; 4] = [-1.5, -0.5, 0.5, 1.5];
const TRIMMED_DEGC: [f64; 3] = [26.85, 25.0, 20.0];

/// Least and greatest zero of the phase error, in half spans from the middle.
fn zeros(c: &Channels) -> (f64, f64) {
    let at = |degc: f64| (degc - c.middle_degc) / c.kelvin_per_u;
    let (a, b) = (at(ZERO_DEGC.0), at(ZERO_DEGC.1));
    let own = match c.thermometer.ends_with("_degc") {
        true => 1.0,
        false => 2.0 * ZERO_SPANS,
    };
    (a.min(b).min(-own), a.max(b).max(own))
}

impl Candidate for PhaseDrift {
    fn sheet(&self) -> &Sheet {
        &PHASE_DRIFT
    }

    fn channels(&self, c: &Channels) -> Result<Vec<String>, Missing> {
        let thermometer = heated(c)?;
        if c.column("quad_dps").is_none() {
            return Err(Missing::Channel("quad_dps".to_owned()));
        }
        Ok(vec!["quad_dps".to_owned(), thermometer])
    }

    fn points(&self, c: &Channels) -> Vec<Point> {
        let (low, high) = zeros(c);
        let trimmed = TRIMMED_DEGC.map(|t| (t - c.middle_degc) / c.kelvin_per_u);
        let starts: Vec<f64> = ZEROS.into_iter().chain(trimmed).collect();
        let starts = starts.iter().filter(|z| (low..=high).contains(*z));
        (0..c.heats())
            .flat_map(|heat| starts.clone().map(move |z| Point::at(heat, &[*z])))
            .collect()
    }

    fn columns(&self, c: &Channels, _bias: &Bias, point: &Point) -> Vec<Vec<f64>> {
        let Some(q) = c.column("quad_dps") else {
            return Vec::new();
        };
        let (low, high) = zeros(c);
        let heat = c.heat(point.form);
        let drift = match point.theta.first() {
            Some(zero) if (low..=high).contains(zero) => {
                q.iter().zip(heat).map(|(q, u)| q * (u - zero)).collect()
            }
            _ => vec![0.0; q.len()],
        };
        vec![drift]
    }

    fn spacing(&self, _c: &Channels, point: &Point) -> Vec<f64> {
        vec![0.5; point.theta.len()]
    }

    fn correction(&self, c: &Channels, e: &Estimate, f: &mut Words) -> Option<Vec<Term>> {
        let columns = self.columns(c, &f.bias.clone(), &e.point);
        f.surface(c, "quad_dps", &columns, &e.beta)
    }

    fn report(&self, c: &Channels, e: &Estimate) -> Reported {
        let at = |v: &[f64]| v.first().copied().unwrap_or(0.0);
        let degc = c.middle_degc + c.kelvin_per_u * at(&e.point.theta);
        let std = (c.kelvin_per_u * at(&e.theta_std)).abs();
        [
            gain("rad_per_k", e, 0, 1.0 / c.kelvin_per_u),
            entry("reference_degc", degc, std),
        ]
        .into_iter()
        .collect()
    }
}
