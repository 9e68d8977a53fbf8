//! A curve through equidistant knots over -1 ..= 1, linear between them.
//!
//! u = (x + 1) (n - 1) / 2, k = floor(u), c = T\[k\] + cast((T\[k+1\] - T\[k\]) (u - k)).

use super::terms::exact;
use crate::numeric::arithmetic::{Arithmetic, Table};
use crate::numeric::cast::{Cast, Label, Target};
use crate::numeric::format::{Rounding, pow2};

/// Names of the tables in emitted code.
const NAMES: [&str; super::plan::MOST_OF_A_KIND] = [
    "curve_1", "curve_2", "curve_3", "curve_4", "curve_5", "curve_6", "curve_7", "curve_8",
];

/// A compiled curve.
#[derive(Debug, Clone)]
pub struct Curve {
    input: usize,
    input_bits: i32,
    intervals: i128,
    table: Table,
    address: Cast,
    blend: Cast,
}

impl Curve {
    /// Number `number` of the plan's curves over an input of a name, its entries and results on 2^-`fraction_bits`.
    pub fn new(
        number: usize,
        (input, name): (usize, &str),
        input_bits: i32,
        values: &[f64],
        fraction_bits: i32,
    ) -> Self {
        let entry = |v: &f64| (v * pow2(fraction_bits)).round() as i64;
        let to_integer = Target::signed(127, 0);
        Curve {
            input,
            input_bits,
            intervals: values.len() as i128 - 1,
            table: Table {
                name: NAMES.get(number).copied().unwrap_or("curve"),
                note: format!(
                    "Knots of a curve over {name} from -1 to 1, in units of 2^-{fraction_bits}"
                ),
                entries: values.iter().map(entry).collect(),
                fraction_bits,
            },
            address: Cast::new(
                Label::of("correction.address"),
                input_bits + 1,
                0,
                to_integer,
                Rounding::Floor,
                None,
            ),
            blend: exact(
                "correction.blend",
                input_bits + 1 + fraction_bits,
                fraction_bits,
            ),
        }
    }

    pub(super) fn casts_mut(&mut self) -> Vec<&mut Cast> {
        vec![&mut self.address, &mut self.blend]
    }

    /// The least and the largest entry, raw.
    pub fn range(&self) -> (i128, i128) {
        let entries = || self.table.entries.iter().map(|v| i128::from(*v));
        (entries().min().unwrap_or(0), entries().max().unwrap_or(0))
    }

    /// Fraction bits of entries and results.
    pub fn fraction_bits(&self) -> i32 {
        self.table.fraction_bits
    }

    /// The input.
    pub fn input(&self) -> usize {
        self.input
    }

    /// c(x).
    #[inline(always)]
    pub fn value<A: Arithmetic>(&self, ar: &A, x: A::Word) -> A::Word {
        let from_start = ar.add(x, ar.constant(1 << self.input_bits, self.input_bits));
        let scaled = ar.mul(from_start, ar.constant(self.intervals, 0));
        let u = ar.read_as(scaled, -1);
        // The fraction of u is cyclic in every arithmetic; a floor is not.
        let bits = self.input_bits + 1;
        let half = ar.constant(1 << (bits - 1), bits);
        let share = ar.add(ar.wrap(ar.sub(u, half), bits as u32, bits), half);
        let k = ar.cast(u, &self.address, &[u]);
        let low = ar.lookup(k, &self.table);
        let high = ar.lookup(ar.add(k, ar.constant(1, 0)), &self.table);
        let rise = ar.mul(ar.sub(high, low), share);
        let sum = ar.add(low, ar.cast(rise, &self.blend, &[rise]));
        // Between two entries: what intervals lose.
        let (least, largest) = self.range();
        ar.within(sum, least, largest)
    }
}
