//! The compensation's errors: Horner's slopes and the roundings on the way.

use super::front_noise::with_sign;
use crate::design::{Compensation, Design};
use crate::nodes::node::Node;
use crate::nodes::quantisation::Moments;
use crate::numeric::format::pow2;

/// The polynomial with its casts.
pub(super) struct Horner {
    /// Lowest order first, deg/s.
    coefficients: Vec<f64>,
    clamp: Option<(f64, f64)>,
    accumulator_lsb: f64,
    /// Rounding of the product of each step, LSB.
    steps: Vec<Moments>,
    pub(super) output: Moments,
    output_lsb: f64,
}

impl Horner {
    /// `nodes` begin with the first step's; their signs matter to a rounding toward zero.
    pub(super) fn new(design: &Design, c: &Compensation, nodes: &[Node]) -> Self {
        let p_bits = design.circuit.cordic.angle_bits as i32 - 1;
        let lsb = c.coefficient_format.lsb();
        let (coarse, fine) = (
            c.coefficient_format.fraction_bits as i32,
            c.accumulator.format.fraction_bits as i32,
        );
        let last = if c.coefficients_raw.len() > 1 {
            fine
        } else {
            coarse
        };
        let rounding = c.accumulator.rounding;
        let steps = c.coefficients_raw.len().saturating_sub(1);
        Horner {
            coefficients: c
                .coefficients_raw
                .iter()
                .map(|raw| *raw as f64 * lsb)
                .collect(),
            clamp: c
                .clamp_raw
                .map(|(low, high)| (low as f64 * pow2(-p_bits), high as f64 * pow2(-p_bits))),
            accumulator_lsb: c.accumulator.format.lsb(),
            steps: (0..steps)
                .map(|step| {
                    let above = if step == 0 { coarse - fine } else { 0 };
                    let own = Moments::of_rounding(rounding, p_bits + above);
                    with_sign(own, rounding, nodes.get(2 * step))
                })
                .collect(),
            output: with_sign(
                Moments::of_rounding(
                    c.output.rounding,
                    last - c.output.format.fraction_bits as i32,
                ),
                c.output.rounding,
                nodes.get(2 * steps),
            ),
            output_lsb: c.output.format.lsb(),
        }
    }

    /// The polynomial's variable, half turns.
    pub(super) fn variable(&self, turns: f64) -> f64 {
        2.0 * turns
    }

    fn limited(&self, p: f64) -> (f64, f64) {
        match self.clamp {
            Some((low, _)) if p < low => (low, 0.0),
            Some((_, high)) if p > high => (high, 0.0),
            _ => (p, 1.0),
        }
    }

    /// Rounding of the product of a step, LSB.
    pub(super) fn rounding(&self, step: usize) -> Moments {
        self.steps.get(step).copied().unwrap_or_default()
    }

    /// The polynomial's derivative.
    pub(super) fn slope(&self, p: f64) -> f64 {
        let (p, factor) = self.limited(p);
        let (mut t, mut slope) = (0.0, 0.0);
        for c in self.coefficients.iter().rev() {
            slope = t + p * slope;
            t = c + p * t;
        }
        slope * factor
    }

    /// Mean of the bias's error, given that of p.
    pub(super) fn mean(&self, p: f64, error: f64) -> f64 {
        let slope = self.slope(p);
        let (p, _) = self.limited(p);
        let steps = self.coefficients.len().saturating_sub(1);
        let sum = (0..steps).fold(0.0, |mean, k| p * mean + self.rounding(k).mean);
        slope * error + sum * self.accumulator_lsb + self.output.mean * self.output_lsb
    }

    /// Mean squares of the error after each cast (inner, outer, inner, ...) and of the bias, given that of p.
    pub(super) fn mean_squares(&self, p: f64, error: Moments) -> Vec<f64> {
        let (p, factor) = self.limited(p);
        let mut orders = self.coefficients.iter().rev();
        let mut t = orders.next().copied().unwrap_or(0.0);
        // The error of t is slope * e_p plus roundings: variance, mean.
        let (mut slope, mut variance, mut mean) = (0.0, 0.0, 0.0);
        let lsb = self.accumulator_lsb;
        let mut all = Vec::new();
        for (step, c) in orders.enumerate() {
            slope = t * factor + p * slope;
            let own = self.rounding(step);
            variance = p * p * variance + own.variance() * lsb * lsb;
            mean = p * mean + own.mean * lsb;
            t = c + p * t;
            let off = slope * error.mean + mean;
            let of = slope * slope * error.variance() + variance + off * off;
            all.extend([of, of]);
        }
        variance += self.output.variance() * self.output_lsb * self.output_lsb;
        mean += self.output.mean * self.output_lsb;
        let off = slope * error.mean + mean;
        all.push(slope * slope * error.variance() + variance + off * off);
        all
    }
}
