//! The words of a correction, chosen from its plan and from the noise of a reading.
//!
//! Every share below is a fraction of the noise, so that all together stay far below it: an error of
//! a tenth of the noise, independent of it, raises the rms by 0.5 percent.

use super::plan::{Plan, Term};
pub use crate::design::correction::NOISE_PER_FULL_SCALE;
use crate::error::{InputError, Result};
use crate::numeric::format::{Format, pow2};

/// One LSB of the rate is at most this share of the noise.
const RATE_SHARE: f64 = 1.0 / 16.0;
/// One LSB of the sum, and what the state of a lag or decay may be off by.
const SUM_SHARE: f64 = 1.0 / 64.0;
/// The rms of what an input's LSB does to the rate.
const INPUT_SHARE: f64 = 1.0 / 40.0;
/// Fraction bits of an input: 16-bit words at least.
const INPUT_BITS: (i32, i32) = (15, 23);
/// Fraction bits of the sum: beyond them products no longer fit into 64 bits.
const SUM_BITS: (i32, i32) = (8, 30);
/// Most fraction bits of a product of inputs.
pub(super) const PRODUCT_BITS: i32 = 30;
/// The words of a correction.
#[derive(Debug, Clone, PartialEq)]
pub struct Formats {
    /// The noise of a reading that they were chosen for, deg/s rms.
    pub noise_dps: f64,
    /// Of each input: Q1.f, value x.
    pub inputs: Vec<Format>,
    /// Of the rate, in and out, deg/s.
    pub rate: Format,
    /// Fraction bits of the sum of the terms, deg/s; its width follows from proved ranges.
    pub sum_fraction_bits: i32,
}

impl Formats {
    /// Chooses the words for readings with the noise `noise_dps` (rms, deg/s).
    ///
    /// # Errors
    /// A noise that is not positive, or so small beside the full scale that the rate needs more than
    /// 32 bits.
    pub fn choose(plan: &Plan, noise_dps: f64) -> Result<Self> {
        // What comes in has the bias on it.
        let largest = plan.full_scale_dps + largest_bias_dps(plan);
        let exponent = largest.log2().ceil() as i32;
        let fraction_bits = bits_for(noise_dps * RATE_SHARE).max(0);
        let width = exponent + 1 + fraction_bits;
        if !(noise_dps > 0.0 && noise_dps.is_finite()) || width > 32 {
            return Err(InputError::new(format!(
                "a noise of {noise_dps} deg/s at a full scale of {} deg/s needs a rate word of more than 32 bits",
                plan.full_scale_dps
            ))
            .help("give the noise of a reading, or a full scale that fits it")
            .into());
        }
        // A full scale below half a deg/s would leave no integer bit for the sign.
        let integer_bits = (exponent + 1).max(1) as u32;
        let of_input = |k: usize| {
            let rms_of_lsb = slope_dps(plan, k) / 12f64.sqrt();
            let wanted = bits_for(noise_dps * INPUT_SHARE / rms_of_lsb.max(f64::MIN_POSITIVE));
            Format::q(1, wanted.clamp(INPUT_BITS.0, INPUT_BITS.1) as u32)
        };
        Ok(Formats {
            noise_dps,
            inputs: (0..plan.inputs.len()).map(of_input).collect(),
            rate: Format::q(integer_bits, fraction_bits as u32),
            sum_fraction_bits: bits_for(noise_dps * SUM_SHARE)
                .clamp(SUM_BITS.0, SUM_BITS.1)
                .max(fraction_bits),
        })
    }

    /// The words for the default noise, [`NOISE_PER_FULL_SCALE`].
    ///
    /// # Errors
    /// As [`Formats::choose`].
    pub fn auto(plan: &Plan) -> Result<Self> {
        Formats::choose(plan, plan.full_scale_dps * NOISE_PER_FULL_SCALE)
    }

    /// The rate word's full scale is 2^this, deg/s.
    pub fn rate_exponent(&self) -> i32 {
        self.rate.integer_bits as i32 - 1
    }

    /// One LSB of the sum, deg/s.
    pub fn sum_lsb_dps(&self) -> f64 {
        pow2(-self.sum_fraction_bits)
    }

    /// Fraction bits of an input.
    pub(super) fn input_bits(&self, input: usize) -> i32 {
        let format = self.inputs.get(input);
        format.map_or(INPUT_BITS.0, |f| f.fraction_bits as i32)
    }
}

/// The fewest fraction bits with an LSB of at most `lsb`.
pub(super) fn bits_for(lsb: f64) -> i32 {
    (-lsb.log2()).ceil().clamp(-60.0, 60.0) as i32
}

/// How far an input moves the rate at most, deg/s per unit of x.
pub(super) fn slope_dps(plan: &Plan, input: usize) -> f64 {
    let full_scale = plan.full_scale_dps;
    let of_term = |term: &Term| match term {
        Term::Product { gain_dps, factors } => {
            let powers = factors.iter().filter(|(k, _)| *k == input);
            gain_dps.abs() * powers.map(|(_, p)| f64::from(*p)).sum::<f64>()
        }
        Term::Lag { gain_dps, .. } => gain_dps.abs() * 2.0,
        // c(y) follows the input more slowly, but y is rounded to its word once more.
        Term::LagOfCurve {
            gain_dps, values, ..
        }
        | Term::CurveOfLag {
            gain_dps, values, ..
        } => gain_dps.abs() * 2.0 * steepest(values),
        Term::Slope {
            gain_dps_s, rows, ..
        } => 2.0 * slope_gain_dps(plan, *gain_dps_s, *rows).abs(),
        Term::Curve { values_dps, .. } => steepest(values_dps),
        Term::ScaleBy { s1, s2, .. } => (s1.abs() + 2.0 * s2.abs()) * full_scale,
        _ => 0.0,
    };
    let terms = plan.terms.iter();
    terms
        .filter(|t| t.inputs().contains(&input))
        .map(of_term)
        .sum()
}

/// The gain of a slope on the difference of two inputs, deg/s.
pub(super) fn slope_gain_dps(plan: &Plan, gain_dps_s: f64, rows: u32) -> f64 {
    gain_dps_s / (f64::from(rows) * plan.period_s)
}

/// The largest slope of a curve per unit of x.
pub(super) fn steepest(values: &[f64]) -> f64 {
    let intervals = values.len().saturating_sub(1) as f64;
    let rises = values.windows(2).map(|w| match w {
        [a, b] => (b - a).abs(),
        _ => 0.0,
    });
    rises.fold(0.0, f64::max) * intervals / 2.0
}

/// The largest magnitude of a curve.
pub(super) fn largest(values: &[f64]) -> f64 {
    values.iter().fold(0.0, |m, v| m.max(v.abs()))
}

/// The largest sum of the terms on the bias, deg/s.
pub(super) fn largest_bias_dps(plan: &Plan) -> f64 {
    let of = |term: &Term| match term {
        Term::Product { gain_dps, .. } | Term::Decay { gain_dps, .. } => gain_dps.abs(),
        Term::Step { gain_dps, .. } => gain_dps.abs(),
        Term::Lag { gain_dps, .. } => 2.0 * gain_dps.abs(),
        Term::LagOfCurve {
            gain_dps, values, ..
        }
        | Term::CurveOfLag {
            gain_dps, values, ..
        } => 2.0 * gain_dps.abs() * largest(values),
        Term::Slope {
            gain_dps_s, rows, ..
        } => 2.0 * slope_gain_dps(plan, *gain_dps_s, *rows).abs(),
        Term::Curve { values_dps, .. } => largest(values_dps),
        Term::ScaleBy { .. } | Term::Cubic { .. } | Term::Even { .. } => 0.0,
    };
    plan.terms.iter().map(of).sum()
}
