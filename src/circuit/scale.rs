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

/// What is wrong where the compensation's full scale is not that of gyro and decimator, as where a format was taken for one of
/// half its range; and what mends it. `None`: they agree, or there is no compensation.
pub fn full_scale_is_off(design: &Design) -> Option<(String, String)> {
    let own = design.compensation.as_ref()?.rate_full_scale_dps;
    let nominal = nominal_full_scale_dps(design);
    if (own / nominal - 1.0).abs() <= 0.01 {
        return None;
    }
    let what = format!(
        "compensation.rate_full_scale_dps is {own}, and sense I of the design's own gyro has a full scale of {nominal:.3} deg/s: its \
         rates and drift come out {:.4} times as large",
        own / nominal
    );
    let near = power_of_two_near(nominal);
    let mend = match own == near {
        true => {
            format!("set thermal_run.sense_full_scale_dps so that it is {near}, a power of two")
        }
        false => format!("set compensation.rate_full_scale_dps = {near:?}"),
    };
    Some((what, mend))
}

/// The frequency that the NCO's own tuning word makes, Hz; above half of the rate it is the alias.
pub fn oscillator_hz(design: &Design) -> f64 {
    let nco = &design.circuit.nco;
    let turns = nco.tuning_word as f64 * pow2(-(nco.phase_bits as i32));
    (turns - turns.round()) * design.circuit.sample_rate_hz
}

/// What is wrong where the NCO drives the gyro beside its resonance, and what mends it. `None`: within a thousandth of it.
pub fn excitation_is_off(design: &Design) -> Option<(String, String)> {
    let hz = oscillator_hz(design);
    let drive_hz = design.gyro.drive_frequency_hz;
    if (hz / drive_hz - 1.0).abs() <= 1e-3 {
        return None;
    }
    let what = format!(
        "the NCO runs at {hz:.3} Hz, but the gyro resonates at {drive_hz} Hz. It is driven beside its resonance, so that its \
         amplitude is small and its phase off"
    );
    let mend = "set the NCO's tuning word to the resonance, or use a phase loop".to_owned();
    Some((what, mend))
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
