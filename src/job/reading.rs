//! A thermometer's reading in the compensation's words, and the fit at it.

use crate::design::{Compensation, CompensationInput, Design};
use crate::error::Result;
use crate::record::Warning;
use crate::thermal::BaselineFit;

/// The compensation of a design that has been filled in.
pub(super) fn compensation(design: &Design) -> Result<&Compensation> {
    design.compensation.as_ref().ok_or_else(no_compensation)
}

pub(super) fn no_compensation() -> crate::error::Error {
    crate::error::InputError::new("the design has no [compensation]")
        .help("add one, or leave [circuit] out to use the default's")
        .into()
}

/// Raw input of the compensation for a reading of the thermometer, rounded and limited as a driver
/// of the firmware would: phase in rad, or the channel's own unit.
pub(super) fn thermometer_raw(design: &Design, compensation: &Compensation, reading: f64) -> i128 {
    let to_raw =
        |value: f64, low: i128, high: i128| ((value + 0.5).floor() as i128).clamp(low, high);
    match &compensation.input {
        CompensationInput::Phase => {
            let bits = design.circuit.cordic.angle_bits;
            let half = 1i128 << (bits - 1);
            let turns = reading / std::f64::consts::TAU;
            to_raw(
                turns * crate::numeric::format::pow2(bits as i32),
                -half,
                half - 1,
            )
        }
        CompensationInput::TuningWord(_) => {
            let steps = reading / crate::job::coefficients::tuning_step_hz(&design.circuit);
            let half = 1i128 << (design.circuit.nco.phase_bits - 1);
            let given = design.circuit.nco.tuning_word as f64;
            to_raw(steps - given, -half, half - 1)
        }
        CompensationInput::Channel(channel) => {
            let format = channel.format;
            to_raw(reading / format.lsb(), format.min_raw(), format.max_raw())
        }
    }
}

/// A warning that is not about one column.
pub(super) fn warning(code: &'static str, message: String) -> Warning {
    Warning::general(code, message)
}

/// The fit's bias at a reading limited to the calibrated range, deg/s.
pub(super) fn clamped_bias(fit: &BaselineFit, reading: f64) -> f64 {
    fit.bias_dps(reading.clamp(fit.range.0, fit.range.1))
}
