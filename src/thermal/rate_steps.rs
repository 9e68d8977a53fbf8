//! A rate that was rounded more coarsely than its noise: few digits in a file, or an output word of few bits.
//!
//! Noise of half a step and more makes of rounding another white noise of step / sqrt(12), which averages out (Widrow and
//! Kollar 2008, "Quantization Noise"). Less noise leaves sawteeth, which hardly differ from row to row: no estimate from
//! differences of rows sees them.

use crate::record::{ThermalRecord, Warning};
use crate::statistics::stats;
use crate::text::{constant, number};

/// Values are the same up to this part of the largest: five times the rounding of single precision, 2^-24.
const SAME_SHARE: f64 = 3e-7;

/// The levels that hold so many of the rows show the step: odd rows are among the others (convention).
const USUAL_ROWS_SHARE: f64 = 0.9;

/// Fewest rows for each level, on average (convention).
const ROWS_A_LEVEL: usize = 2;

/// From this noise on, in steps and with what rounding adds to it, rounding is white: noise of 0.41 steps and the rounding's 0.29. What is
/// left of the rounding's course, exp(-2 pi^2 0.41^2) / pi, is 1 % of a step (derived; Widrow and Kollar).
const DITHERS_STEPS: f64 = 0.5;

/// Residuals of less than this part of the rounding are of a course that goes in even steps by itself (convention).
const LEAST_SEEN_SHARE: f64 = 0.25;

/// The steps of a rate.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RateSteps {
    /// One step, deg/s.
    pub step_dps: f64,
}

impl RateSteps {
    /// The steps of the output in `rows`, which leave these residuals, if they are too coarse for its noise.
    pub(super) fn of(
        record: &ThermalRecord,
        rows: &[usize],
        residuals_dps: &[f64],
    ) -> Option<Self> {
        let output = record.column("rate_out_dps")?;
        let output: Vec<f64> = rows
            .iter()
            .filter_map(|i| output.get(*i).copied())
            .collect();
        let step_dps = step_of(output)?;
        let steps = RateSteps { step_dps };
        let is_dithered = stats::difference_noise(residuals_dps) >= DITHERS_STEPS * step_dps;
        let is_seen =
            stats::robust_std(residuals_dps) > LEAST_SEEN_SHARE * steps.rounding_rms_dps();
        (is_seen && !is_dithered).then_some(steps)
    }

    /// What rounding to them makes, deg/s rms.
    pub fn rounding_rms_dps(self) -> f64 {
        self.step_dps / 12f64.sqrt()
    }

    /// What is said of them.
    pub(super) fn warning(self) -> Warning {
        Warning::on(
            "rate_resolution_coarse",
            "rate_out_dps",
            format!(
                "rate_out_dps comes in steps of {} deg/s, more than twice its noise. The rounding alone is {} deg/s rms: it stays in \
                 the residuals, and the noise floor is not taken below it. Export more digits, or read the output with more bits",
                constant(self.step_dps, 4),
                number(self.rounding_rms_dps(), 3)
            ),
        )
    }
}

/// The step of values most of which lie on few even levels. In place: a long record is not copied twice.
fn step_of(mut values: Vec<f64>) -> Option<f64> {
    values.retain(|v| !v.is_nan());
    values.sort_unstable_by(f64::total_cmp);
    let same = SAME_SHARE * values.iter().fold(0.0, |m: f64, v| m.max(v.abs()));
    let mut levels: Vec<(f64, usize)> = Vec::new();
    for v in &values {
        match levels.last_mut() {
            Some((level, rows)) if v - *level <= same => *rows += 1,
            _ => levels.push((*v, 1)),
        }
        if levels.len() * ROWS_A_LEVEL > values.len() {
            return None;
        }
    }
    levels.sort_by_key(|(_, rows)| std::cmp::Reverse(*rows));
    let mut rows = 0;
    let usual = levels.iter().take_while(|(_, held)| {
        let is_usual = (rows as f64) < USUAL_ROWS_SHARE * values.len() as f64;
        rows += held;
        is_usual
    });
    let usual: Vec<f64> = usual.map(|(level, _)| *level).collect();
    let step = stats::even_step(&stats::sorted(&usual))?;
    // Of finer steps than `same` nothing is known.
    (step > 10.0 * same).then_some(step)
}

#[cfg(test)]
#[path = "rate_steps_tests.rs"]
mod tests;
