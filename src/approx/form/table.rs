//! Lookup tables: plain, linear, quadratic.
//!
//! i is the segment's number, d the distance from its middle, s the logarithm of its length (see [`super::split`]);
//! entries T are on 2^-F:
//!
//! | kind | result |
//! |---|---|
//! | plain | cast_o(+-T\[i\]) |
//! | linear | cast_o(+-(T\[i\] + (T\[i+1\] - T\[i\]) r 2^-s)), r = d + 2^(s-1): two entries and one multiplication; neighbours share a node, so that the result is continuous and the table half as long as one of values and slopes (that is the piecewise polynomial of degree 1) |
//! | quadratic | a, b, c = T\[2i\], T\[2i+1\], T\[2i+2\]; delta = d 2^-(s-1); t = cast_F((a - 2b + c) delta); cast_o(+-(b + ((c - a) + t) delta / 2)): the parabola through three nodes |

use super::split::{Split, floor, signed};
use super::{Codes, Number, Piece};
use crate::numeric::arithmetic::{Arithmetic, Table as Entries};
use crate::numeric::cast::{Cast, Label, Target};
use crate::numeric::format::{Format, Quantizer, Rounding, pow2};

/// How a table is read.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// The entry.
    Plain,
    /// Between two entries.
    Linear,
    /// Through three entries.
    Quadratic,
}

impl Kind {
    /// Number of entries for so many segments.
    pub fn entries(self, segments: usize) -> usize {
        match self {
            Kind::Plain => segments,
            Kind::Linear => segments + 1,
            Kind::Quadratic => 2 * segments + 1,
        }
    }
}

/// A table with its addressing.
#[derive(Debug, Clone)]
pub struct Table {
    /// The input's codes.
    pub codes: Codes,
    /// The output's format.
    pub output: Format,
    /// The segments.
    pub split: Split,
    /// How it is read.
    pub kind: Kind,
    /// The entries.
    pub entries: Entries,
    align: Cast,
    double: Cast,
    inner: Cast,
    last: Cast,
}

impl Table {
    /// Compiles the evaluation; `entries` as many as [`Kind::entries`] says, on 2^-`fraction_bits`.
    pub fn new(
        split: Split,
        kind: Kind,
        output: Format,
        fraction_bits: u32,
        entries: Vec<i64>,
    ) -> Self {
        let f = fraction_bits as i32;
        let s = split.bits as i32;
        let exact = |label, from, to| {
            let target = Target::signed(127, to);
            Cast::new(Label::of(label), from, 0, target, Rounding::Floor, None)
        };
        let from = match kind {
            Kind::Plain => f,
            Kind::Linear => f + s,
            Kind::Quadratic => f + s.max(1),
        };
        let target = Target::signed(127, f);
        Table {
            codes: split.codes,
            output,
            kind,
            entries: Entries {
                name: "table",
                note: format!("The function's entries, in 2^-{fraction_bits}"),
                entries: entries.into(),
                fraction_bits: f,
            },
            align: exact("align", f, from),
            double: {
                let target = Target::signed(127, 0);
                Cast::new(Label::of("node"), 0, 1, target, Rounding::Floor, None)
            },
            inner: Cast::new(
                Label::of("curvature"),
                f + s.max(1) - 1,
                0,
                target,
                Rounding::HalfUp,
                None,
            ),
            last: Cast::to(Label::of("output"), from, 0, Quantizer::default_of(output)),
            split,
        }
    }

    pub(super) fn output_cast(&self) -> &Cast {
        &self.last
    }

    pub(super) fn casts_mut(&mut self) -> Vec<&mut Cast> {
        let mut casts = self.split.casts_mut();
        casts.extend([
            &mut self.align,
            &mut self.double,
            &mut self.inner,
            &mut self.last,
        ]);
        casts
    }

    /// The output for an input word.
    #[inline(always)]
    pub fn evaluate<A: Arithmetic>(&self, ar: &A, input: A::Word) -> A::Word {
        let place = self.split.place(ar, input);
        let entry = |address| ar.lookup(address, &self.entries);
        let next = |address, k| ar.add(address, ar.constant(k, 0));
        let sum = match (self.kind, place.offset) {
            (Kind::Plain, _) => entry(place.segment),
            (Kind::Linear, None) => entry(place.segment),
            (Kind::Linear, Some(d)) => {
                let bits = self.split.bits as i32;
                let r = ar.add(d, ar.constant(1i128 << (bits - 1), 0));
                let r = ar.read_as(r, -bits);
                let (a, b) = (entry(place.segment), entry(next(place.segment, 1)));
                let start = ar.cast(a, &self.align, &[a]);
                ar.add(start, ar.mul(ar.sub(b, a), r))
            }
            (Kind::Quadratic, offset) => {
                let local = self.split.bits.max(1) as i32 - 1;
                let delta = match offset {
                    Some(d) => ar.read_as(d, -local),
                    None => ar.constant(0, local),
                };
                let first = ar.cast(place.segment, &self.double, &[place.segment]);
                let (a, b, c) = (entry(first), entry(next(first, 1)), entry(next(first, 2)));
                let bend = ar.sub(ar.add(a, c), ar.add(b, b));
                let bend = ar.mul(bend, delta);
                let t = ar.cast(bend, &self.inner, &[bend]);
                let slope = ar.mul(ar.add(ar.sub(c, a), t), delta);
                // Half of it: one fraction bit more.
                ar.add(ar.cast(b, &self.align, &[b]), ar.read_as(slope, -1))
            }
        };
        let sum = signed(ar, &place, sum);
        ar.cast(sum, &self.last, &[sum])
    }

    pub(super) fn pieces(&self) -> Vec<Piece> {
        let f = self.entries.fraction_bits;
        let at = |k: usize| i128::from(self.entries.entries[k]);
        let number = |raw, fraction_bits| Number { raw, fraction_bits };
        let single = self.split.bits == 0;
        self.split.pieces(|i| match self.kind {
            Kind::Plain => (vec![number(at(i), f)], 0.0),
            // The middle of a single code is half a code above it: constant.
            Kind::Linear if single => (vec![number(at(i), f)], 0.0),
            Kind::Quadratic if single => (vec![number(at(2 * i + 1), f)], 0.0),
            Kind::Linear => {
                let (a, b) = (at(i), at(i + 1));
                (vec![number(a + b, f + 1), number(b - a, f + 1)], 0.0)
            }
            Kind::Quadratic => {
                let (a, b, c) = (at(2 * i), at(2 * i + 1), at(2 * i + 2));
                let bend = number(a - 2 * b + c, f + 1);
                // The rounding of t, half of it.
                let bound = if self.split.bits > 1 {
                    pow2(-f - 2)
                } else {
                    0.0
                };
                (vec![number(b, f), number(c - a, f + 1), bend], bound)
            }
        })
    }
}

/// Bipartite tables (Das Sarma and Matula, ARITH 1995) with the symmetry of Schulte and Stine (IEEE Trans.
/// Computers 48, 1999): one table of values, one of corrections that half the low bits address.
///
/// With w below 2^(k0 + k1 + k2): i01 = floor(w / 2^k2), i0 = floor(w / 2^(k1 + k2)),
/// d = (w mod 2^k2) - 2^(k2-1), j = d where d >= 0, else -1 - d;
/// y = cast_o(+-(V\[i01\] +- C\[i0 2^(k2-1) + j\])), the inner sign that of d.
#[derive(Debug, Clone)]
pub struct Bipartite {
    /// The input's codes.
    pub codes: Codes,
    /// The output's format.
    pub output: Format,
    /// Segments of 2^k2 codes.
    pub split: Split,
    /// k1.
    pub middle_bits: u32,
    /// V.
    pub values: Entries,
    /// C.
    pub corrections: Entries,
    block: Cast,
    stretch: Cast,
    last: Cast,
}

impl Bipartite {
    /// Compiles the evaluation. The split is uniform with segments of at least two codes; `values` has an
    /// entry for each segment, `corrections` 2^(k2-1) for each 2^k1 segments.
    pub fn new(
        split: Split,
        middle_bits: u32,
        output: Format,
        fraction_bits: u32,
        [values, corrections]: [Vec<i64>; 2],
    ) -> Self {
        let f = fraction_bits as i32;
        let table = |name, what: &str, entries: Vec<i64>| Entries {
            name,
            note: format!("{what}, in 2^-{fraction_bits}"),
            entries: entries.into(),
            fraction_bits: f,
        };
        let stretch = Target::signed(127, 0);
        let by = split.bits as i32 - 1;
        Bipartite {
            codes: split.codes,
            output,
            middle_bits,
            values: table("values", "Values by segment", values),
            corrections: table("corrections", "Corrections inside a segment", corrections),
            block: floor("block", middle_bits as i32),
            stretch: Cast::new(Label::of("row"), 0, by, stretch, Rounding::Floor, None),
            last: Cast::to(Label::of("output"), f, 0, Quantizer::default_of(output)),
            split,
        }
    }

    pub(super) fn output_cast(&self) -> &Cast {
        &self.last
    }

    pub(super) fn casts_mut(&mut self) -> Vec<&mut Cast> {
        let mut casts = self.split.casts_mut();
        casts.extend([&mut self.block, &mut self.stretch, &mut self.last]);
        casts
    }

    /// The output for an input word.
    #[inline(always)]
    pub fn evaluate<A: Arithmetic>(&self, ar: &A, input: A::Word) -> A::Word {
        let place = self.split.place(ar, input);
        let value = ar.lookup(place.segment, &self.values);
        let sum = match place.offset {
            None => value,
            Some(d) => {
                let below = ar.is_negative(d);
                let mirrored = ar.sub(ar.constant(-1, 0), d);
                let half = 1i128 << (self.split.bits - 1);
                let j = ar.within(ar.select(below, mirrored, d), 0, half - 1);
                let i0 = match self.middle_bits {
                    0 => place.segment,
                    bits => {
                        let scaled = ar.read_as(place.segment, -(bits as i32));
                        ar.cast(scaled, &self.block, &[scaled])
                    }
                };
                let row = ar.cast(i0, &self.stretch, &[i0]);
                let correction = ar.lookup(ar.add(row, j), &self.corrections);
                let correction = ar.select(below, ar.neg(correction), correction);
                ar.add(value, correction)
            }
        };
        let sum = signed(ar, &place, sum);
        ar.cast(sum, &self.last, &[sum])
    }

    /// The sum of the two entries at a code w.
    fn entry(&self, w: i128) -> i128 {
        let bits = self.split.bits;
        let segment = (w >> bits) as usize;
        let half = 1i128 << (bits - 1);
        let d = (w & ((1i128 << bits) - 1)) - half;
        let j = if d < 0 { -1 - d } else { d };
        let row = (segment >> self.middle_bits) * half as usize;
        let correction = i128::from(self.corrections.entries[row + j as usize]);
        i128::from(self.values.entries[segment]) + if d < 0 { -correction } else { correction }
    }

    /// A constant for each code.
    pub(super) fn pieces(&self) -> Vec<Piece> {
        let codes = self.codes;
        let one = |code: i128| {
            let (w, negate) = match self.split.symmetry {
                Some(s) => ((code - s.about_raw).abs(), s.odd && code < s.about_raw),
                None => (code - codes.low, false),
            };
            let raw = self.entry(w);
            Piece {
                low: code,
                high: code,
                centre: Number {
                    raw: code,
                    fraction_bits: codes.format.fraction_bits as i32,
                },
                terms: vec![Number {
                    raw: if negate { -raw } else { raw },
                    fraction_bits: self.values.fraction_bits,
                }],
                evaluation_bound: 0.0,
            }
        };
        (codes.low..=codes.high).map(one).collect()
    }
}
