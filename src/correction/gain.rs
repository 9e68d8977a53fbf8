//! A gain as a word, and the exact casts around it.

use super::formats::Formats;
use crate::numeric::arithmetic::Arithmetic;
use crate::numeric::cast::{Cast, Label, Target};
use crate::numeric::format::{Rounding, pow2};

/// Fraction bits that a gain has beyond those of the sum.
pub(super) const GAIN_BITS: i32 = 2;

/// A cast to so many fraction bits, to nearest, that never limits: proved ranges give the width.
pub(super) fn exact(label: &'static str, from: i32, to: i32) -> Cast {
    let target = Target::signed(127, to);
    Cast::new(Label::of(label), from, 0, target, Rounding::HalfUp, None)
}

/// The integer nearest to `value` in LSBs of 2^-`fraction_bits`.
pub(super) fn raw(value: f64, fraction_bits: i32) -> i128 {
    (value * pow2(fraction_bits)).round() as i128
}

/// A constant times a word, in the sum's unit.
#[derive(Debug, Clone)]
pub struct Gain {
    raw: i128,
    fraction_bits: i32,
    pub(super) out: Cast,
}

impl Gain {
    /// `value` times a word with `word_bits` fraction bits.
    pub(super) fn new(value: f64, word_bits: i32, formats: &Formats) -> Self {
        let sum = formats.sum_fraction_bits;
        let fraction_bits = sum + GAIN_BITS;
        Gain {
            raw: raw(value, fraction_bits),
            fraction_bits,
            out: exact("correction.gain", fraction_bits + word_bits, sum),
        }
    }

    /// The product, rounded once.
    #[inline(always)]
    pub fn times<A: Arithmetic>(&self, ar: &A, word: A::Word) -> A::Word {
        let product = ar.mul(ar.constant(self.raw, self.fraction_bits), word);
        ar.cast(product, &self.out, &[word])
    }
}
