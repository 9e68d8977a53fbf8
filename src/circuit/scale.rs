//! From the ADC's codes to the decimator's output, and from there to deg/s.

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

/// What an amplitude at an ADC (LSB) is, for a magnitude of 1: a product with the carrier
/// halves it, and the decimator's gain is (R M)^N / 2^G.
pub fn amplitude_lsb_per_magnitude(design: &Design) -> f64 {
    let circuit = &design.circuit;
    let decimator = &circuit.decimator;
    let span = f64::from(decimator.ratio * decimator.differential_delay);
    let gain = span.powi(decimator.stages as i32) * pow2(-(decimator.gain_bits() as i32));
    let table = circuit.nco.table;
    let carrier = (pow2(table.bits() as i32 - 1) - 1.0) * table.lsb();
    2.0 / (carrier * gain) / circuit.adc.format.lsb()
}

/// What one LSB of the sense ADC's input is at the output, deg/s.
pub fn sense_lsb_dps(design: &Design) -> f64 {
    full_scale_dps(design) / amplitude_lsb_per_magnitude(design)
}
