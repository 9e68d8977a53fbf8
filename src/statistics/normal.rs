//! The normal distribution.

use crate::statistics::tail::erfc_parts;
use std::f64::consts::{PI, SQRT_2};

/// Density at z standard deviations.
pub fn density(z: f64) -> f64 {
    (-0.5 * z * z).exp() / (2.0 * PI).sqrt()
}

/// Probability below z standard deviations (relative error below 1.2e-7 of the smaller tail).
pub fn below(z: f64) -> f64 {
    let x = z.abs() / SQRT_2;
    let (t, exponent) = erfc_parts(x);
    let tail = 0.5 * t * (exponent - x * x).exp();
    if z > 0.0 { 1.0 - tail } else { tail }
}

/// Mean of max(z + n, 0) for standard normal n.
pub fn excess(z: f64) -> f64 {
    density(z) + z * below(z)
}

/// The median; `None` of nothing. Reorders `values`.
pub fn median(values: &mut [f64]) -> Option<f64> {
    let middle = values.len() / 2;
    if values.is_empty() {
        return None;
    }
    let (_, m, _) = values.select_nth_unstable_by(middle, f64::total_cmp);
    Some(*m)
}
