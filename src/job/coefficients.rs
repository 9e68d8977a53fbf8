//! The fitted polynomial in the firmware's variable and formats, and what the rounding costs.

use super::{compensation, thermometer_raw};
use crate::compensation::coefficients as best_coefficients;
use crate::design::{Circuit, Compensation, CompensationInput, Design, Fitted, Outside};
use crate::error::{InputError, Result};
use crate::numeric::format::{Format, pow2};
use crate::thermal::BaselineFit;

/// Rounded coefficients.
#[derive(Debug, Clone, PartialEq)]
pub struct Rounded {
    /// In the firmware's variable p, before rounding, deg/s.
    pub exact: Vec<f64>,
    /// The range of p.
    pub p_range: (f64, f64),
}

/// The firmware's variable: T = offset + scale * p.
pub fn variable(circuit: &Circuit, c: &Compensation) -> (f64, f64) {
    match &c.input {
        // p counts half turns.
        CompensationInput::Phase => (0.0, std::f64::consts::PI),
        CompensationInput::TuningWord(t) => {
            let step_hz = tuning_step_hz(circuit);
            let zero = (i128::from(circuit.nco.tuning_word) + t.offset_raw) as f64;
            (zero * step_hz, pow2(t.scale_bits as i32) * step_hz)
        }
        CompensationInput::Channel(channel) => {
            let lsb = channel.format.lsb();
            (
                channel.offset_raw as f64 * lsb,
                pow2(channel.scale_bits as i32) * lsb,
            )
        }
    }
}

/// The frequency of one tuning word step, Hz.
pub fn tuning_step_hz(circuit: &Circuit) -> f64 {
    circuit.sample_rate_hz * pow2(-(circuit.nco.phase_bits as i32))
}

/// Puts the fit into the design: coefficients, and the calibrated range as the input's limits.
///
/// # Errors
/// A coefficient that its format cannot hold; a phase beyond half a turn.
pub fn round(design: &mut Design, fit: &BaselineFit) -> Result<Rounded> {
    let c = compensation(design)?;
    let (offset, scale) = variable(&design.circuit, c);
    let p = |t: f64| (t - offset) / scale;
    let p_range = (p(fit.range.0), p(fit.range.1));
    if c.input == CompensationInput::Phase && (p_range.0 < -1.0 || p_range.1 >= 1.0) {
        return Err(InputError::new(format!(
            "phase_rad of the record runs from {:.4} to {:.4} rad, and a phase word holds -pi to pi",
            fit.range.0, fit.range.1
        ))
        .help(
            "divide it by 57.29578 if it is in degrees; if it is in rad, wrap it into [-pi, pi), or move the demodulation \
             phase away from the wrap",
        )
        .into());
    }
    let exact = fit.scaled_to(offset, scale);
    let format = c.coefficient_format;
    let mut raw = Vec::new();
    for (order, value) in exact.iter().enumerate() {
        raw.push(quantise(order, *value, format)?);
    }
    let clamp = (
        thermometer_raw(design, c, fit.range.0),
        thermometer_raw(design, c, fit.range.1),
    );
    let mut chosen = Compensation {
        coefficients_raw: raw.clone(),
        clamp_raw: (clamp.0 < clamp.1).then_some(clamp),
        fitted: Some(Fitted {
            coefficients_dps: exact.clone(),
            std_max_dps: fit.std_max_dps(),
            heldout_rms_dps: fit.heldout_rms_dps,
            loop_rms_dps: fit.sweep_loop.filter(|l| l.significant).map(|l| l.rms_dps),
        }),
        form: None,
        ..c.clone()
    };
    chosen.coefficients_raw = best_coefficients::best(&design.circuit, &chosen, &exact, &raw)?;
    check_slopes(&design.circuit, &chosen)?;
    design.compensation = Some(chosen);
    Ok(Rounded { exact, p_range })
}

/// A slope that goes on beyond the range is a constant in the coefficients' format.
fn check_slopes(circuit: &Circuit, c: &Compensation) -> Result<()> {
    let ends = c.clamp_raw.filter(|_| c.outside == Outside::HoldSlope);
    for word in ends.map_or(Vec::new(), |(low, high)| vec![low, high]) {
        let slope = c.slope_raw(circuit, word);
        if !c.coefficient_format.contains(slope) {
            return Err(InputError::new(format!(
                "`compensation.outside = \"hold_slope\"` needs the fitted slope at input {word}, raw {slope}, which \
                 {} cannot hold",
                c.coefficient_format
            ))
            .help("give `compensation.coefficient_format` more integer bits")
            .into());
        }
    }
    Ok(())
}

/// Nearest, ties up.
fn quantise(order: usize, value: f64, format: Format) -> Result<i128> {
    nearest(value, format).ok_or_else(|| {
        let needed = (value.abs() + 1.0).log2().ceil() as i32 + 1;
        InputError::new(format!(
            "the fitted coefficient of order {order} is {value}, which {format} cannot hold"
        ))
        .help(format!(
            "give `compensation.coefficient_format` at least {needed} integer bits, or fit a lower order"
        ))
        .into()
    })
}

/// The raw word nearest to a value, ties up; `None` if the format does not hold it.
pub(super) fn nearest(value: f64, format: Format) -> Option<i128> {
    let raw = (value / format.lsb() + 0.5).floor();
    (raw.is_finite() && format.contains(raw as i128)).then_some(raw as i128)
}
