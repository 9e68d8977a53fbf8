//! What whitened columns explain of whitened signals beside a declared model, from products alone.
//!
//! Let Q be an orthonormal basis of the declared regressors, y a signal without them (Q'y = 0) and X the columns of a
//! candidate. With Z = Q'X the matrix G = X'X - Z'Z holds the products of what X has beyond the declared model, and
//! X'y is the same with that and without: y's sum of squares falls by (X'y)' G^-1 (X'y) (Frisch & Waugh 1933; Lovell
//! 1963). Nothing is projected, so that a dictionary of a thousand columns passes through the cache once.

use super::linear::{Basis, Factor, dot, dots};
use std::ops::Range;

/// A column of which no more than this share (of its square) is beyond the declared model and the columns before it lies in
/// their span: it is not excited. Rounding leaves 1e-15 of the square.
pub const SURVIVAL: f64 = 1e-8;

/// A declared model and signals without it, for any number of columns.
pub struct Partial<'a> {
    /// The directions of the declared model, then the signals.
    against: Vec<&'a [f64]>,
    rank: usize,
}

impl<'a> Partial<'a> {
    /// For signals from which the declared model has been projected off.
    pub fn new(declared: &'a Basis, signals: &'a [Vec<f64>]) -> Self {
        let all = declared.q.iter().chain(signals);
        Partial {
            against: all.map(Vec::as_slice).collect(),
            rank: declared.rank(),
        }
    }

    /// The products of whitened columns, of one candidate or of several.
    pub fn products<'c>(&self, columns: &'c [Vec<f64>]) -> Products<'c> {
        Products {
            columns,
            all: dots(columns, &self.against),
            width: self.against.len(),
            rank: self.rank,
        }
    }
}

/// Columns and their products with a declared model's directions and with signals.
pub struct Products<'c> {
    columns: &'c [Vec<f64>],
    /// [column * width + direction or signal].
    all: Vec<f64>,
    width: usize,
    rank: usize,
}

impl Products<'_> {
    /// A column's products with the directions, and with the signals.
    fn of(&self, column: usize) -> (&[f64], &[f64]) {
        let row = &self.all[column * self.width..(column + 1) * self.width];
        row.split_at(self.rank)
    }

    /// Product of two columns, and of what they have beyond the declared model.
    fn pair(&self, a: usize, b: usize) -> (f64, f64) {
        let whole = dot(&self.columns[a], &self.columns[b]);
        let declared = self.of(a).0.iter().zip(self.of(b).0);
        (whole, whole - declared.map(|(a, b)| a * b).sum::<f64>())
    }

    /// Adds what the columns of a candidate explain of each signal's sum of squares; returns how many of them are excited.
    pub fn explained(&self, candidate: Range<usize>, squares: &mut [f64]) -> usize {
        let mut factor = Factor::default();
        // Of each column that is in, the signals' coordinates along it.
        let mut along: Vec<Vec<f64>> = Vec::with_capacity(candidate.len());
        for column in candidate {
            let (whole, beyond) = self.pair(column, column);
            if !factor.push(column, beyond, SURVIVAL * whole, |other| {
                self.pair(column, other).1
            }) {
                continue;
            }
            let products = self.of(column).1.iter().enumerate();
            let own =
                products.map(|(s, product)| factor.along(*product, along.iter().map(|a| a[s])));
            let own: Vec<f64> = own.collect();
            for (square, z) in squares.iter_mut().zip(&own) {
                *square += z * z;
            }
            along.push(own);
        }
        along.len()
    }

    /// Sum of squares of the first signal, given as `square`, less the sum of a candidate's columns as they are, coefficient
    /// 1, that have anything beyond the declared model.
    pub fn without_whole(&self, candidate: Range<usize>, square: f64) -> f64 {
        let excited = candidate.filter(|c| {
            let (whole, beyond) = self.pair(*c, *c);
            beyond > SURVIVAL * whole
        });
        let excited: Vec<usize> = excited.collect();
        let mut out = square;
        for (k, a) in excited.iter().enumerate() {
            out -= 2.0 * self.of(*a).1.first().copied().unwrap_or(0.0);
            out += self.pair(*a, *a).1;
            out += excited[..k]
                .iter()
                .map(|b| 2.0 * self.pair(*a, *b).1)
                .sum::<f64>();
        }
        out
    }
}

#[cfg(test)]
mod tests {
    use super::super::random::Stream;
    use super::*;

    const ROWS: usize = 300;

    fn normals(stream: u64) -> Vec<f64> {
        Stream::new(21, stream).normals(ROWS)
    }

    /// Sum of squares that some columns leave of a signal, by projection.
    fn left(columns: &[Vec<f64>], signal: &[f64]) -> f64 {
        let mut rest = signal.to_vec();
        Basis::new(columns).project_off(&mut rest);
        dot(&rest, &rest)
    }

    #[test]
    fn sums_of_squares_are_those_of_projections() {
        let declared: Vec<Vec<f64>> = (0..3).map(normals).collect();
        let basis = Basis::new(&declared);
        let signals = (3..6).map(|k| {
            let mut signal = normals(k);
            basis.project_off(&mut signal);
            signal
        });
        let signals: Vec<Vec<f64>> = signals.collect();
        let mut columns: Vec<Vec<f64>> = (6..9).map(normals).collect();
        for (v, d) in columns[1].iter_mut().zip(&declared[0]) {
            *v = 1e-3 * *v + d;
        }
        // Of the declared model, and of the columns before it.
        columns.push(declared[1].clone());
        let sum = columns[0].iter().zip(&columns[2]).map(|(a, b)| a - 2.0 * b);
        columns.push(sum.collect());
        let partial = Partial::new(&basis, &signals);
        let products = partial.products(&columns);
        for (range, excited) in [(0..1, 1), (1..2, 1), (0..3, 3), (3..4, 0), (0..5, 3)] {
            let mut squares = vec![0.0; signals.len()];
            assert_eq!(products.explained(range.clone(), &mut squares), excited);
            let all = [&declared[..], &columns[range.clone()]].concat();
            for (signal, square) in signals.iter().zip(squares) {
                let due = left(&declared, signal) - left(&all, signal);
                assert!((square - due).abs() < 1e-8 * ROWS as f64, "{range:?}");
            }
        }
    }

    #[test]
    fn a_whole_column_leaves_the_difference() {
        let declared: Vec<Vec<f64>> = (0..2).map(normals).collect();
        let basis = Basis::new(&declared);
        let mut signal = normals(4);
        let columns = [normals(5), normals(6), declared[1].clone()];
        basis.project_off(&mut signal);
        let signals = [signal.clone()];
        let partial = Partial::new(&basis, &signals);
        let found = partial
            .products(&columns)
            .without_whole(0..3, dot(&signal, &signal));
        for column in &columns {
            for (s, c) in signal.iter_mut().zip(column) {
                *s -= c;
            }
        }
        assert!((found - left(&declared, &signal)).abs() < 1e-9 * found);
    }
}
