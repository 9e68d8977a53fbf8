//! From the decimator's output to deg/s.

use crate::design::Design;
use crate::numeric::format::pow2;

/// What sense I is to be multiplied with, deg/s: twice the sense channel's full scale, since a product
/// with a carrier of the same frequency halves the amplitude, over the decimator's gain (R M)^N / 2^G.
pub fn nominal_full_scale_dps(design: &Design) -> f64 {
    let decimator = &design.circuit.decimator;
    let span = f64::from(decimator.ratio * decimator.differential_delay);
    let gain = span.powi(decimator.stages as i32) * pow2(-(decimator.gain_bits() as i32));
    2.0 * design.thermal_run.sense_full_scale_dps / gain
}

/// The power of two nearest to `value`, by ratio.
pub fn power_of_two_near(value: f64) -> f64 {
    pow2(value.log2().round() as i32)
}

/// Sense I in deg/s is its value times this: the compensation's full scale, or the power of two
/// nearest to what gyro and decimator make of a deg/s.
pub fn full_scale_dps(design: &Design) -> f64 {
    let own = design.compensation.as_ref().map(|c| c.rate_full_scale_dps);
    own.unwrap_or_else(|| power_of_two_near(nominal_full_scale_dps(design)))
}
