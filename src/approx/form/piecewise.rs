//! Piecewise polynomials of degree 1 to 4 in each segment's own variable delta in [-1, 1).
//!
//! With the segment's coefficients a_0 .. a_n (one table an order, all on 2^-F) and `cast_i` to F fraction
//! bits (half up; no limits needed):
//! t = a_n; t = cast_i(t delta + a_k) for k = n-1 .. 1; y = cast_o(+-(t delta + a_0)).

use super::split::{Split, signed};
use super::{Codes, Number, Piece};
use crate::numeric::arithmetic::{Arithmetic, Table};
use crate::numeric::cast::{Cast, Label, Target};
use crate::numeric::format::{Format, Quantizer, Rounding, pow2};

/// The highest degree of a segment.
pub const HIGHEST_DEGREE: usize = 4;
const NAMES: [&str; HIGHEST_DEGREE + 1] = ["a0", "a1", "a2", "a3", "a4"];

/// Segments with coefficients.
#[derive(Debug, Clone)]
pub struct Piecewise {
    /// The input's codes.
    pub codes: Codes,
    /// The output's format.
    pub output: Format,
    /// The segments.
    pub split: Split,
    /// F: fraction bits of every coefficient.
    pub fraction_bits: u32,
    /// One table an order, lowest first.
    pub tables: Vec<Table>,
    align: Cast,
    steps: Vec<Cast>,
    last: Cast,
}

impl Piecewise {
    /// Compiles the evaluation. `coefficients[i]` are segment i's, lowest order first, 2 to 5 of
    /// them.
    pub fn new(
        split: Split,
        output: Format,
        fraction_bits: u32,
        coefficients: &[Vec<i64>],
    ) -> Self {
        let orders = coefficients
            .first()
            .map_or(2, Vec::len)
            .clamp(2, HIGHEST_DEGREE + 1);
        let local = split.bits.max(1) as i32 - 1;
        let f = fraction_bits as i32;
        let align = |from| {
            let target = Target::signed(127, f + local);
            Cast::new(Label::of("align"), from, 0, target, Rounding::Floor, None)
        };
        let inner = |_| {
            let target = Target::signed(127, f);
            Cast::new(
                Label::of("step"),
                f + local,
                0,
                target,
                Rounding::HalfUp,
                None,
            )
        };
        let tables = (0..orders).map(|k| Table {
            name: NAMES[k],
            note: format!("Coefficient of delta^{k} by segment, in 2^-{fraction_bits}"),
            entries: coefficients
                .iter()
                .map(|c| c.get(k).copied().unwrap_or(0))
                .collect(),
            fraction_bits: f,
        });
        let q = Quantizer::default_of(output);
        Piecewise {
            codes: split.codes,
            output,
            fraction_bits,
            tables: tables.collect(),
            align: align(f),
            steps: (2..orders).map(inner).collect(),
            last: Cast::to(Label::of("output"), f + local, 0, q),
            split,
        }
    }

    /// The degree.
    pub fn degree(&self) -> usize {
        self.tables.len() - 1
    }

    pub(super) fn output_cast(&self) -> &Cast {
        &self.last
    }

    pub(super) fn casts_mut(&mut self) -> Vec<&mut Cast> {
        let mut casts = self.split.casts_mut();
        casts.push(&mut self.align);
        casts.extend(self.steps.iter_mut());
        casts.push(&mut self.last);
        casts
    }

    /// The output for an input word.
    #[inline(always)]
    pub fn evaluate<A: Arithmetic>(&self, ar: &A, input: A::Word) -> A::Word {
        let place = self.split.place(ar, input);
        let local = self.split.bits.max(1) as i32 - 1;
        let delta = match place.offset {
            Some(d) => ar.read_as(d, -local),
            None => ar.constant(0, local),
        };
        let mut orders = self.tables.iter().rev();
        let mut t = match orders.next() {
            Some(table) => ar.lookup(place.segment, table),
            None => ar.constant(0, self.fraction_bits as i32),
        };
        let mut steps = self.steps.iter();
        let mut sum = t;
        for table in orders {
            let a = ar.lookup(place.segment, table);
            let a = ar.cast(a, &self.align, &[a]);
            sum = ar.add(ar.mul(t, delta), a);
            if let Some(cast) = steps.next() {
                t = ar.cast(sum, cast, &[sum]);
            }
        }
        let sum = signed(ar, &place, sum);
        ar.cast(sum, &self.last, &[sum])
    }

    pub(super) fn pieces(&self) -> Vec<Piece> {
        let fraction_bits = self.fraction_bits as i32;
        let half = if self.split.bits > 1 {
            pow2(-fraction_bits - 1)
        } else {
            0.0
        };
        // |delta| is at most 1: each step's half LSB counts once.
        let bound = half * self.steps.len() as f64;
        self.split.pieces(|i| {
            let number = |t: &Table| Number {
                raw: i128::from(t.entries[i]),
                fraction_bits,
            };
            (self.tables.iter().map(number).collect(), bound)
        })
    }
}
