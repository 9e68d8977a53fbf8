//! The catalogue of candidate effects, one unit each: physics, equation, parameters with units and
//! plausible ranges, the channels it needs, what it is confused with, the experiment that separates
//! them.
//!
//! A candidate gives columns: shapes in time whose multiples, beside the declared model, explain the
//! error. Its non-linear parameters (time constants, thresholds, crossing temperatures) make the
//! shapes; [`Candidate::points`] is where the search for them starts, [`super::search`] ends it.

mod candidate;
pub mod covariate;
mod deadband;
pub mod demodulation;
pub mod drive;
pub mod field;
pub mod heat;
pub mod outside;
mod past;
pub mod rate;
mod saturation;
pub mod step;
pub mod structure;
mod switching;
pub mod time;
pub mod tone;
pub mod user;
mod within_rows;

use super::channels::Channels;
pub(crate) use candidate::UNUSUAL;
pub use candidate::{
    Bias, Candidate, Estimate, MOST_BENT, Missing, Parameter, Point, Reported, Sheet, entry,
    from_log, gain, heated, map, moving, product, spaced,
};

/// Every named candidate of the contract for a record, its auxiliary columns among them.
pub fn catalogue(c: &Channels) -> Vec<Box<dyn Candidate>> {
    let mut out: Vec<Box<dyn Candidate>> = Vec::new();
    out.extend(heat::all());
    out.extend(time::all());
    out.extend(structure::all());
    out.extend(step::all());
    out.extend(drive::all(c));
    out.extend(demodulation::all());
    out.extend(rate::all());
    out.extend(field::all());
    out.extend(covariate::all(c));
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::thermal::synthetic::triangle;
    use std::collections::{BTreeMap, BTreeSet};

    /// A record with every channel that a case of an effect may need, all of which move.
    fn channels() -> Channels {
        const ROWS: u32 = 300;
        let moving = |period: u32, low: f64, step: f64| -> Vec<f64> {
            (0..ROWS)
                .map(|k| low + step * f64::from(k % period))
                .collect()
        };
        let phase: Vec<f64> = triangle(ROWS as usize)
            .iter()
            .map(|t| -1.8 + 0.003 * t)
            .collect();
        let columns = BTreeMap::from([
            ("rate_out_dps".to_owned(), vec![0.0; ROWS as usize]),
            ("phase_rad".to_owned(), phase),
            ("rate_dps".to_owned(), moving(13, -60.0, 10.0)),
            ("agc".to_owned(), moving(7, 0.9, 0.03)),
            ("supply_v".to_owned(), moving(11, 4.5, 0.1)),
            ("accel_g".to_owned(), moving(5, -1.0, 0.5)),
            ("pressure_pa".to_owned(), moving(17, 900.0, 3.0)),
        ]);
        let time_s: Vec<f64> = (0..ROWS).map(f64::from).collect();
        Channels::new(&time_s, &columns, "phase_rad", |t| t).unwrap()
    }

    #[test]
    fn each_case_of_an_effect_has_one_equation_of_its_own() {
        let c = channels();
        // What has cases, and how many are told apart.
        let due = [
            ("warmup_transient", 1),
            ("ageing_drift", 2),
            ("bias_third_order", 2),
            ("mode_crossing", 3),
            ("stress_jump", 4),
            ("damping_bias", 6),
            ("amplitude_phase_coupling", 6),
            ("scale_factor_temperature", 2),
            ("scale_factor_nonlinearity", 2),
            ("scale_factor_asymmetry", 4),
            ("supply_sensitivity", 4),
            ("g_sensitivity", 4),
            ("g_squared_sensitivity", 4),
            ("covariate:pressure_pa", 6),
        ];
        let mut all = catalogue(&c);
        all.extend(outside::all(&c));
        for candidate in &all {
            let mut points = candidate.points(&c);
            let beside: Vec<Point> = points
                .iter()
                .flat_map(|p| candidate.beside(&c, p))
                .collect();
            points.extend(beside);
            let told = points.iter().map(|p| candidate.equation(&c, p));
            let told: BTreeSet<String> = told.collect();
            for equation in &told {
                let several = equation.contains(" or ") || equation.contains("where the law");
                assert!(!several, "{}: {equation}", candidate.id());
            }
            let due = due.iter().find(|(id, _)| *id == candidate.id());
            if let Some((id, cases)) = due {
                assert!(told.len() >= *cases, "{id}: {told:#?}");
            }
        }
        for (id, _) in due {
            assert!(all.iter().any(|k| k.id() == id), "no {id}");
        }
    }
}
