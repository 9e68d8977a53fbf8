//! The normal distribution.

use std::f64::consts::{PI, SQRT_2};

/// Density at z standard deviations.
pub fn density(z: f64) -> f64 {
    (-0.5 * z * z).exp() / (2.0 * PI).sqrt()
}

/// Probability below z standard deviations (relative error below 1.2e-7 of the smaller tail; the
/// rational approximation of Numerical Recipes).
pub fn below(z: f64) -> f64 {
    let x = z.abs() / SQRT_2;
    let t = 1.0 / (1.0 + 0.5 * x);
    let poly = [
        -1.265_512_23,
        1.000_023_68,
        0.374_091_96,
        0.096_784_18,
        -0.186_288_06,
        0.278_868_07,
        -1.135_203_98,
        1.488_515_87,
        -0.822_152_23,
        0.170_872_77,
    ];
    let exponent = poly.iter().rev().fold(0.0, |sum, c| sum * t + c);
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
