//! Effects of the demodulation phase: quadrature that leaks into the rate.

use super::{
    Bias, Candidate, Estimate, Missing, Parameter, Point, Reported, Sheet, gain, heated, moving,
    product,
};
use crate::closure::channels::Channels;
use crate::closure::firmware::Words;
use crate::correction::Term;

/// All of this file.
pub fn all() -> Vec<Box<dyn Candidate>> {
    vec![Box::new(Leakage), Box::new(PhaseDrift)]
}

/// Constant phase error times quadrature.
struct Leakage;

const LEAKAGE: Sheet = Sheet {
    id: "quadrature_leakage",
    physics: "a constant phase error of the demodulator lets part of the quadrature into the rate",
    equation: "Q sin(theta)",
    parameters: &[Parameter {
        name: "phase_error_rad",
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
        [gain("phase_error_rad", e, 0, 1.0)].into_iter().collect()
    }
}

/// Phase error that drifts with temperature, times quadrature.
struct PhaseDrift;

const PHASE_DRIFT: Sheet = Sheet {
    id: "demod_phase_drift",
    physics: "the demodulator's phase error moves with temperature and lets a varying part of the \
              quadrature into the rate",
    equation: "Q theta_1 (T - T_0)",
    parameters: &[
        Parameter {
            name: "phase_slope_rad_per_k",
            plausible: (1e-7, 3e-3),
        },
        Parameter {
            name: "zero_degc",
            plausible: (-40.0, 125.0),
        },
    ],
    compensable: true,
    confounders: &["quadrature_leakage", "bias_third_order"],
    experiment: "two levels of quadrature at several temperatures",
    reference: "Pileri et al., MEMS 2025",
};

/// Temperatures at which the phase is taken to be trimmed, degC: 300 K and the usual ambient ones.
const TRIMMED_DEGC: [f64; 3] = [26.85, 25.0, 20.0];

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
        // The temperature at which the phase is trimmed is an ambient one; else two columns.
        (0..TRIMMED_DEGC.len() + c.heats())
            .map(Point::form)
            .collect()
    }

    fn columns(&self, c: &Channels, _bias: &Bias, point: &Point) -> Vec<Vec<f64>> {
        let Some(q) = c.column("quad_dps") else {
            return Vec::new();
        };
        match TRIMMED_DEGC.get(point.form) {
            Some(trimmed) => {
                let zero = (trimmed - c.middle_degc) / c.kelvin_per_u;
                vec![q.iter().zip(&c.u).map(|(q, u)| q * (u - zero)).collect()]
            }
            None => vec![
                product(q, c.heat(point.form - TRIMMED_DEGC.len())),
                q.to_vec(),
            ],
        }
    }

    fn correction(&self, c: &Channels, e: &Estimate, f: &mut Words) -> Option<Vec<Term>> {
        let columns = self.columns(c, &f.bias.clone(), &e.point);
        f.surface(c, "quad_dps", &columns, &e.beta)
    }

    fn report(&self, c: &Channels, e: &Estimate) -> Reported {
        let mut out: Reported = [gain("phase_slope_rad_per_k", e, 0, 1.0 / c.kelvin_per_u)]
            .into_iter()
            .collect();
        match TRIMMED_DEGC.get(e.point.form) {
            Some(t) => _ = out.insert("zero_degc".to_owned(), (*t, 0.0)),
            None => {
                let (slope, constant) = (e.beta[0], e.beta.get(1).copied().unwrap_or(0.0));
                if slope != 0.0 {
                    let zero = c.middle_degc - c.kelvin_per_u * constant / slope;
                    let std = e.beta_std.get(1).copied().unwrap_or(0.0);
                    let std = (c.kelvin_per_u * std / slope).abs();
                    out.insert("zero_degc".to_owned(), (zero, std));
                }
            }
        }
        out
    }
}
