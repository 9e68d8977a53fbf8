//! The words of a form: input codes, numbers with their exponents, what a piece is made of.

use crate::numeric::arithmetic::Arithmetic;
use crate::numeric::format::{Format, pow2};
use crate::numeric::trace::ir::Interval;

/// The input word and the codes of it that lie in the domain. Others are limited to the nearest of them.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Codes {
    /// The input's format.
    pub format: Format,
    /// The first code in the domain, raw.
    pub low: i128,
    /// The last code in the domain, raw.
    pub high: i128,
}

impl Codes {
    /// Number of codes in the domain.
    pub fn count(self) -> u128 {
        (self.high - self.low + 1) as u128
    }

    /// The value of a code; exact for codes of up to 53 bits.
    pub fn real(self, code: i128) -> f64 {
        code as f64 * self.format.lsb()
    }

    /// Every word that can come in.
    pub fn all(self) -> Interval {
        Interval::new(self.format.min_raw(), self.format.max_raw())
    }

    /// The limit that every form begins with.
    #[inline(always)]
    pub fn limit<A: Arithmetic>(self, ar: &A, input: A::Word) -> A::Word {
        ar.limit(input, self.low, self.high, self.format.fraction_bits as i32)
    }
}

/// An exact dyadic number, raw * 2^-fraction_bits.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Number {
    /// The integer.
    pub raw: i128,
    /// Its scale.
    pub fraction_bits: i32,
}

impl Number {
    /// The nearest `f64`.
    pub fn real(self) -> f64 {
        self.raw as f64 * pow2(-self.fraction_bits)
    }
}

/// What a form's data stand for between two codes: an exact polynomial.
#[derive(Debug, Clone, PartialEq)]
pub struct Piece {
    /// First code.
    pub low: i128,
    /// Last code.
    pub high: i128,
    /// The polynomial is one in x - centre, x in the input's unit.
    pub centre: Number,
    /// Coefficients, lowest order first.
    pub terms: Vec<Number>,
    /// The result is at most this far from the polynomial's value before the last rounding's and the
    /// output limits' share, by analysis; in the function's unit.
    pub evaluation_bound: f64,
}

impl Piece {
    /// The polynomial in doubles, for many values.
    pub fn in_doubles(&self) -> Doubles {
        Doubles {
            centre: self.centre.real(),
            terms: self.terms.iter().rev().map(|t| t.real()).collect(),
        }
    }

    /// The polynomial's value at x and a bound on the rounding of this computation.
    pub fn value(&self, x: f64) -> (f64, f64) {
        self.in_doubles().value(x)
    }
}

/// A piece's polynomial in doubles.
#[derive(Debug, Clone, PartialEq)]
pub struct Doubles {
    centre: f64,
    /// Highest order first.
    terms: Vec<f64>,
}

impl Doubles {
    /// The value at x and a bound on the rounding of this computation (Horner's rule; Higham,
    /// Accuracy and Stability of Numerical Algorithms, 2nd ed., eq. 5.3).
    #[inline]
    pub fn value(&self, x: f64) -> (f64, f64) {
        let d = x - self.centre;
        let (mut value, mut size) = (0.0, 0.0);
        for c in &self.terms {
            value = value * d + c;
            size = size * d.abs() + c.abs();
        }
        let operations = 2.0 * self.terms.len() as f64 + 4.0;
        (value, size * operations * f64::EPSILON)
    }
}

/// Integer bits, the sign among them, of a word of `bits` bits in all.
pub(crate) fn integer_bits_of(range: Interval, fraction_bits: i32) -> i32 {
    range.bits() as i32 - fraction_bits
}
