//! What the noise of the thermometer's readings makes of the output.
//!
//! The bias follows the temperature, the declared model the reading. What a reading errs by comes back in the error,
//! times the slope of the bias, and the fitted slope is too small for it (Fuller 1987, "Measurement error models"): then
//! the declared model leaves a part of the temperature's own course, and any effect of a smooth temperature seems
//! to explain it. Beside what the readings err by, in every fit, it does not. That is no part of the model: nothing is
//! known of the next reading's noise.

use super::declared::{declared_by, powers};
use crate::closure::channels::{Channels, range};
use crate::closure::likelihood::linear::add_scaled;
use crate::closure::smooth::averaged;
use crate::record::stats;

/// Regressors of what the readings err by, in the first and the second power of u; none where a fit of all rows would not
/// see them (a likelihood that rises by less than a half).
pub fn errors_of(c: &Channels) -> Vec<Vec<f64>> {
    let (low, high) = range(&c.u);
    let mean = averaged(&c.time_s, &c.u);
    if high <= low || c.u == mean {
        return Vec::new();
    }
    let (bias, rest) = declared_by(&mean, &c.error_dps);
    let pairs = c.u.iter().zip(&mean);
    let blur: Vec<f64> = pairs.map(|(u, s)| bias.at(*u) - bias.at(*s)).collect();
    let share = stats::rms(&blur) / stats::difference_noise(&rest).max(f64::MIN_POSITIVE);
    if rest.len() as f64 * share.powi(2) <= 1.0 {
        return Vec::new();
    }
    let mut out = powers(&c.u);
    for (column, smooth) in out.iter_mut().zip(powers(&mean)) {
        add_scaled(column, -1.0, &smooth);
    }
    out.split_off(1)
}

#[cfg(test)]
#[path = "reading_tests.rs"]
mod tests;
