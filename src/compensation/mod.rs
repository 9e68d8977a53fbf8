//! The compensation's bias as firmware evaluates it: exact results on its input words ([`Evaluation`]), its integer
//! coefficients ([`coefficients`]), its proved errors ([`certainty`]), forms that can stand for it ([`alternatives`]).

pub mod alternatives;
pub mod certainty;
pub mod coefficients;
#[cfg(test)]
mod tests;

use crate::circuit::compensation::Bias;
use crate::design::{Circuit, Compensation, CompensationInput, record_columns};
use crate::numeric::arithmetic::Block;
use crate::numeric::fixed::Fixed;
use crate::numeric::format::{Rounding, pow2};
use crate::numeric::trace::Trace;
use crate::numeric::trace::ir::Program;
use std::f64::consts::TAU;

/// A compensation's polynomial as it is evaluated in firmware.
#[derive(Debug, Clone)]
pub struct Evaluation<'a> {
    circuit: &'a Circuit,
    /// The compensation.
    pub compensation: &'a Compensation,
    bias: Bias,
}

impl<'a> Evaluation<'a> {
    /// Of a compensation in its circuit.
    pub fn new(circuit: &'a Circuit, compensation: &'a Compensation) -> Self {
        Evaluation {
            circuit,
            compensation,
            bias: Bias::new(circuit, compensation),
        }
    }

    /// The emitted bias for an input word, deg/s. A saturating word saturates.
    pub fn bias_dps(&self, word: i128) -> f64 {
        let ar = Fixed::<i128, i128>::new();
        let [bias] = Block::<_, 1, 1>::step(&self.bias, &ar, &mut (), [word]);
        bias as f64 * self.compensation.output.format.lsb()
    }

    /// The polynomial's variable at an input word.
    pub fn variable(&self, word: i128) -> f64 {
        let (offset, fraction_bits) = self.compensation.variable_scale(self.circuit);
        (word - offset) as f64 * pow2(-fraction_bits)
    }

    /// The polynomial that the firmware stands for, in the variable, deg/s: the fit, or the coefficients as given.
    pub fn wanted(&self) -> Vec<f64> {
        let c = self.compensation;
        let lsb = c.coefficient_format.lsb();
        match &c.fitted {
            Some(fitted) => fitted.coefficients_dps.clone(),
            None => c.coefficients_raw.iter().map(|v| *v as f64 * lsb).collect(),
        }
    }

    /// The bias as a program, its casts numbered in their order.
    pub fn program(&self) -> Program {
        let mut bias = self.bias.clone();
        for (id, cast) in bias.casts_mut().into_iter().enumerate() {
            cast.id = id;
        }
        let trace = Trace::new();
        trace.record(&bias, &(), [bias.input_range]);
        trace.finish()
    }

    /// True if intervals cannot exclude that a cast of the bias leaves its format.
    pub fn may_saturate(&self) -> bool {
        let program = self.program();
        let casts = self.bias.clone().casts_mut().len();
        (0..casts).any(|id| !program.is_proved_in_range(id))
    }

    /// First and last word of the calibrated range; every word where there is none.
    pub fn calibrated(&self) -> (i128, i128) {
        self.compensation.clamp_raw.unwrap_or(self.words())
    }

    /// First and last word that can come in.
    pub fn words(&self) -> (i128, i128) {
        (self.bias.input_range.low, self.bias.input_range.high)
    }

    /// What an input word stands for, with its unit: rad of the phase, Hz of the tuning word, a channel's own unit.
    pub fn reading(&self, word: i128) -> (f64, &'static str) {
        let word = word as f64;
        match &self.compensation.input {
            CompensationInput::Phase => {
                let turn = pow2(self.circuit.cordic.angle_bits as i32);
                (TAU * word / turn, "rad")
            }
            CompensationInput::TuningWord(_) => {
                let nco = &self.circuit.nco;
                let step_hz = self.circuit.sample_rate_hz * pow2(-(nco.phase_bits as i32));
                ((nco.tuning_word as f64 + word) * step_hz, "Hz")
            }
            CompensationInput::Channel(channel) => (
                word * channel.format.lsb(),
                record_columns::unit_of(&channel.column),
            ),
        }
    }

    /// What the Horner steps' roundings can add for variables up to `p_max`, deg/s: each step's is multiplied by
    /// p in every later step. The steps that add a coefficient are exact.
    pub fn steps_bound_dps(&self, p_max: f64) -> f64 {
        let (c, step) = (self.compensation, self.step_bound_dps());
        (1..c.coefficients_raw.len()).fold(0.0, |e, _| (e * p_max + step) * (1.0 + 1e-12))
    }

    /// What one rounding to the accumulator can add, deg/s.
    pub fn step_bound_dps(&self) -> f64 {
        let accumulator = self.compensation.accumulator;
        one_rounding(accumulator.rounding) * accumulator.format.lsb()
    }

    /// The slope with which the polynomial goes on beyond an end of the calibrated range, deg/s.
    pub fn slope_dps(&self, end: i128) -> f64 {
        let c = self.compensation;
        c.slope_raw(self.circuit, end) as f64 * c.coefficient_format.lsb()
    }

    /// What one rounding to the output can add, deg/s.
    pub fn output_bound_dps(&self) -> f64 {
        let output = self.compensation.output;
        one_rounding(output.rounding) * output.format.lsb()
    }
}

/// The largest error of one rounding, LSB.
pub fn one_rounding(rounding: Rounding) -> f64 {
    match rounding {
        Rounding::HalfUp | Rounding::HalfEven | Rounding::HalfAway => 0.5,
        Rounding::Floor | Rounding::TowardZero | Rounding::Ceil => 1.0,
    }
}
