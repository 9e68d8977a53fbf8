//! How an input word becomes a segment's number and a place in it.
//!
//! With x the limited input, raw, in LSB:
//!
//! 1. w = x - first code; with a symmetry about the code m, w = |x - m|, and the result of an odd function is
//!    negated where x < m.
//! 2. Uniform segments of 2^s codes: number i = floor(w / 2^s).
//!    Power-of-two segments, w below 2^W: i = 0 for w in [2^(W-1), 2^W), i = 1 for [2^(W-2), 2^(W-1)), and so on; the last
//!    one goes down to 0. Found by normalising: for j = 2^(b-1), .., 2, 1: where w < 2^(W-j), w = w 2^j and
//!    e = e + j; then i = e + 1 - floor(w / 2^(W-1)), and s = W - 1 from here on.
//! 3. d = (w mod 2^s) - 2^(s-1), the distance from the segment's middle in LSB; delta = d / 2^(s-1) is in [-1, 1).

use super::{Codes, Number, Piece};
use crate::numeric::arithmetic::Arithmetic;
use crate::numeric::cast::{Cast, Label, Target};
use crate::numeric::format::Rounding;

/// A symmetry of the function that halves its table.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize, schemars::JsonSchema)]
pub struct Symmetry {
    /// The code about which the function is symmetric, raw.
    pub about_raw: i128,
    /// f(m + t) = -f(m - t); otherwise f(m + t) = f(m - t).
    pub odd: bool,
}

/// How long segments are.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize, schemars::JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Spacing {
    /// All of 2^bits codes.
    Uniform {
        /// s.
        bits: u32,
    },
    /// Each twice as long as the one before it, from the symmetry's code or the first code outward.
    PowerOfTwo {
        /// b: normalising steps; 2^b + 1 segments.
        steps: u32,
    },
}

/// The addressing of a table or a piecewise polynomial.
#[derive(Debug, Clone)]
pub struct Split {
    /// The input's codes.
    pub codes: Codes,
    /// Used, if any.
    pub symmetry: Option<Symmetry>,
    /// Segments.
    pub spacing: Spacing,
    /// s: a segment has 2^s steps of the (normalised) word.
    pub bits: u32,
    /// Number of segments.
    pub count: usize,
    /// The largest w.
    reach: i128,
    /// W: w is below 2^W.
    width: u32,
    shifts: Vec<(i128, Cast)>,
    address: Cast,
}

/// A word split.
pub struct Place<A: Arithmetic> {
    /// The segment's number, without fraction bits.
    pub segment: A::Word,
    /// d, without fraction bits; `None` where a segment is a single code.
    pub offset: Option<A::Word>,
    /// The result is to be negated.
    pub negate: Option<A::Truth>,
    /// w, normalised, without fraction bits.
    pub word: A::Word,
}

/// A cast to an integer by floor, of a word with `from` fraction bits.
pub(super) fn floor(label: &'static str, from: i32) -> Cast {
    let target = Target::signed(127, 0);
    Cast::new(Label::of(label), from, 0, target, Rounding::Floor, None)
}

impl Split {
    /// Compiles the addressing.
    pub fn new(codes: Codes, symmetry: Option<Symmetry>, spacing: Spacing) -> Self {
        let reach = match symmetry {
            Some(s) => (codes.high - s.about_raw).max(s.about_raw - codes.low),
            None => codes.high - codes.low,
        };
        let width = 128 - reach.leading_zeros();
        let (bits, count, steps) = match spacing {
            Spacing::Uniform { bits } => (bits, (reach >> bits) as usize + 1, 0),
            Spacing::PowerOfTwo { steps } => {
                let width = width.max(1);
                (width - 1, (1usize << steps) + 1, steps)
            }
        };
        let shifts = (0..steps).rev().map(|k| {
            let j = 1i32 << k;
            let target = Target::signed(127, 0);
            let cast = Cast::new(Label::of("normalise"), 0, j, target, Rounding::Floor, None);
            (i128::from(j), cast)
        });
        Split {
            codes,
            symmetry,
            spacing,
            bits,
            count,
            reach,
            width,
            shifts: shifts.collect(),
            address: floor("address", bits as i32),
        }
    }

    pub(super) fn casts_mut(&mut self) -> Vec<&mut Cast> {
        let shifts = self.shifts.iter_mut().map(|(_, cast)| cast);
        shifts.chain([&mut self.address]).collect()
    }

    /// Splits the input word.
    #[inline(always)]
    pub fn place<A: Arithmetic>(&self, ar: &A, input: A::Word) -> Place<A> {
        let x = self.codes.limit(ar, input);
        let x = ar.read_as(x, self.codes.format.fraction_bits as i32);
        let from = self.symmetry.map_or(self.codes.low, |s| s.about_raw);
        let from_start = match from {
            0 => x,
            from => ar.sub(x, ar.constant(from, 0)),
        };
        let (mut w, negate) = match self.symmetry {
            Some(symmetry) => {
                let negative = ar.is_negative(from_start);
                let size = ar.select(negative, ar.neg(from_start), from_start);
                // An absolute value.
                let size = ar.within(size, 0, self.reach);
                (size, symmetry.odd.then_some(negative))
            }
            None => (from_start, None),
        };
        let mut skipped = None;
        if let Spacing::PowerOfTwo { .. } = self.spacing {
            let mut e = ar.constant(0, 0);
            for (j, cast) in &self.shifts {
                let limit = ar.constant(1i128 << (self.width as i128 - j).max(0), 0);
                let small = ar.is_negative(ar.sub(w, limit));
                let shifted = ar.cast(w, cast, &[w]);
                w = ar.select(small, shifted, w);
                // Shifted only below 2^(W-j).
                w = ar.within(w, 0, (1i128 << self.width) - 1);
                let (some, none) = (ar.constant(*j, 0), ar.constant(0, 0));
                e = ar.add(e, ar.select(small, some, none));
            }
            skipped = Some(e);
        }
        let top = match self.bits {
            0 => w,
            bits => ar.cast(ar.read_as(w, -(bits as i32)), &self.address, &[w]),
        };
        let segment = match skipped {
            Some(e) => ar.sub(ar.add(e, ar.constant(1, 0)), top),
            None => top,
        };
        // Neither sum nor difference of the two is known to intervals.
        let segment = ar.within(segment, 0, self.count as i128 - 1);
        Place {
            segment,
            offset: (self.bits > 0).then(|| {
                let half = ar.constant(1i128 << (self.bits - 1), 0);
                ar.wrap(ar.sub(w, half), self.bits, 0)
            }),
            negate,
            word: w,
        }
    }

    /// Segment i in codes w: its first, its last, its middle and half its length as raw * 2^-fraction_bits.
    fn segment(&self, i: usize) -> (i128, i128, Number, i32) {
        match self.spacing {
            Spacing::Uniform { bits } => {
                let first = (i as i128) << bits;
                let last = (first + (1i128 << bits) - 1).min(self.reach);
                let middle = Number {
                    raw: 2 * first + (1i128 << bits),
                    fraction_bits: 1,
                };
                (first, last, middle, bits as i32 - 1)
            }
            Spacing::PowerOfTwo { .. } => {
                let lowest = i + 1 == self.count;
                // Normalising by e multiplies by 2^e; the last segment has the e of the one before it.
                let e = if lowest { i as i32 - 1 } else { i as i32 };
                let exponent = self.width as i32 - 1 - e;
                let ceil = |v: i32| if v >= 0 { 1i128 << v } else { 1 };
                let first = if lowest { 0 } else { ceil(exponent) };
                let end = if lowest {
                    ceil(exponent)
                } else {
                    ceil(exponent + 1)
                };
                let middle = Number {
                    raw: if lowest { 1 } else { 3 },
                    fraction_bits: 1 - exponent,
                };
                (first, (end - 1).min(self.reach), middle, exponent - 1)
            }
        }
    }

    /// The real interval [first, last] of segment i on the side of positive w, its middle, and half its
    /// length, all in the input's unit. `None` for a segment without a code.
    pub fn real(&self, i: usize) -> Option<(f64, f64, f64, f64)> {
        let (first, last, middle, half_exponent) = self.segment(i);
        if last < first {
            return None;
        }
        let lsb = self.codes.format.lsb();
        let from = self.symmetry.map_or(self.codes.low, |s| s.about_raw) as f64;
        Some((
            (from + first as f64) * lsb,
            (from + last as f64) * lsb,
            (from + middle.real()) * lsb,
            crate::numeric::format::pow2(half_exponent) * lsb,
        ))
    }

    /// The function over the codes, piece by piece in the order of codes. `terms` gives the polynomial
    /// of a segment in delta and the bound of its evaluation's rounding.
    pub fn pieces(&self, terms: impl Fn(usize) -> (Vec<Number>, f64)) -> Vec<Piece> {
        let mut pieces = Vec::new();
        let input = self.codes.format.fraction_bits as i32;
        let from = self.symmetry.map_or(self.codes.low, |s| s.about_raw);
        for i in 0..self.count {
            let (first, last, middle, half_exponent) = self.segment(i);
            let (terms, evaluation_bound) = terms(i);
            let mut side = |sign: i128| {
                let (a, b) = (from + sign * first, from + sign * last);
                let low = a.min(b).max(self.codes.low);
                let high = a.max(b).min(self.codes.high);
                // Code m itself belongs to the positive side.
                let high = if sign < 0 { high.min(from - 1) } else { high };
                if low > high {
                    return;
                }
                let shift = middle.fraction_bits.max(0);
                let middle_raw = if middle.fraction_bits < 0 {
                    middle.raw << -middle.fraction_bits
                } else {
                    middle.raw
                };
                let odd = sign < 0 && self.symmetry.is_some_and(|s| s.odd);
                let term = |(k, t): (usize, &Number)| {
                    let mirrored = sign < 0 && k % 2 == 1;
                    Number {
                        raw: if mirrored != odd { -t.raw } else { t.raw },
                        // delta = (x - centre) 2^(n - half_exponent)
                        fraction_bits: t.fraction_bits - k as i32 * (input - half_exponent),
                    }
                };
                pieces.push(Piece {
                    low,
                    high,
                    centre: Number {
                        raw: (from << shift) + sign * middle_raw,
                        fraction_bits: input + shift,
                    },
                    terms: terms.iter().enumerate().map(term).collect(),
                    evaluation_bound,
                });
            };
            side(1);
            if self.symmetry.is_some() {
                side(-1);
            }
        }
        pieces.sort_by_key(|p| p.low);
        pieces
    }
}

/// Negates the result where the place says so.
#[inline(always)]
pub(super) fn signed<A: Arithmetic>(ar: &A, place: &Place<A>, y: A::Word) -> A::Word {
    match place.negate {
        Some(negate) => ar.select(negate, ar.neg(y), y),
        None => y,
    }
}
