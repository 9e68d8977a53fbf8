//! One budget for the compensation: what each step may add to the bias, in deg/s and in output LSB.

use super::coefficients::variable;
use crate::compensation::certainty::Certainty;
use crate::design::{Compensation, CompensationInput, Design};
use crate::numeric::format::pow2;
use crate::thermal::BaselineFit;
use serde::Serialize;

/// One contribution.
#[derive(Debug, Clone, PartialEq, Serialize, schemars::JsonSchema)]
pub struct Line {
    /// What it is.
    pub what: String,
    /// deg/s.
    pub dps: f64,
    /// In LSB of the output.
    pub output_lsb: f64,
    /// `bound` = never more; `estimate` = one standard deviation or rms.
    pub kind: &'static str,
}

/// All contributions.
#[derive(Debug, Clone, PartialEq, Serialize, schemars::JsonSchema)]
pub struct Budget {
    /// Estimates first, then bounds.
    pub lines: Vec<Line>,
    /// Sum of the bounds, deg/s: how far the firmware may be from the fitted polynomial.
    pub bound_dps: f64,
    /// The held-out rms, deg/s, which contains what the uncertainty of the fitted curve adds.
    pub estimate_dps: f64,
}

/// The budget of a design whose coefficients have been rounded.
pub fn budget(design: &Design, fit: &BaselineFit, certainty: &Certainty) -> Budget {
    let Some(c) = &design.compensation else {
        return Budget {
            lines: Vec::new(),
            bound_dps: 0.0,
            estimate_dps: 0.0,
        };
    };
    let output_lsb = c.output.format.lsb();
    let line = |what: &str, dps: f64, kind| Line {
        what: what.to_owned(),
        dps,
        output_lsb: dps / output_lsb,
        kind,
    };
    let (coefficients, evaluation) = match c.form {
        None => (
            "coefficients: rounding to their format",
            "evaluation: rounding of each Horner step",
        ),
        Some(_) => (
            "the form's data against the polynomial",
            "evaluation: rounding inside the form",
        ),
    };
    let lines = vec![
        line(
            "calibration: uncertainty of the fitted curve",
            fit.std_max_dps(),
            "estimate",
        ),
        line("fit: held-out rms", fit.heldout_rms_dps, "estimate"),
        line(
            "thermometer: half a step of its word",
            thermometer_half_step_dps(design, c, fit),
            "bound",
        ),
        line(coefficients, certainty.bounds.coefficients_dps, "bound"),
        line(evaluation, certainty.bounds.evaluation_dps, "bound"),
        line(
            "output: rounding of bias and of rate",
            2.0 * certainty.bounds.output_dps,
            "bound",
        ),
    ];
    let bounds = lines.iter().filter(|l| l.kind == "bound");
    Budget {
        bound_dps: bounds.map(|l| l.dps).sum(),
        estimate_dps: fit.heldout_rms_dps,
        lines,
    }
}

/// How far half a step of the thermometer's word moves the fit where it is steepest, deg/s.
pub fn thermometer_half_step_dps(design: &Design, c: &Compensation, fit: &BaselineFit) -> f64 {
    let (_, scale) = variable(&design.circuit, c);
    let input_step = match &c.input {
        CompensationInput::Phase => 2.0 * pow2(-(design.circuit.cordic.angle_bits as i32)),
        CompensationInput::TuningWord(t) => pow2(-(t.scale_bits as i32)),
        CompensationInput::Channel(channel) => pow2(-(channel.scale_bits as i32)),
    };
    let slope = (0..=100)
        .map(|k| fit.centre + fit.half_span * (f64::from(k) / 50.0 - 1.0))
        .map(|t| fit.slope_dps(t).abs())
        .fold(0.0, f64::max);
    slope * scale * input_step / 2.0
}
