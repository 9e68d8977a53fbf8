//! Dot products, orthonormal bases, products of tall matrices; all in a fixed order of operations,
//! so that the bits do not depend on the processor.

use nalgebra::{DMatrix, DVector};
use pulp::{Arch, Simd, WithSimd};

/// A pivot that falls below this share of the column's norm is rounding: the column lies in the
/// span of those before it.
pub const DEPENDENT: f64 = 1e-8;

/// Partial sums of a product of columns: enough that no sum waits for the one before.
const SUMS: usize = 16;

/// Sum of products, in interleaved partial sums.
pub fn dot(a: &[f64], b: &[f64]) -> f64 {
    Arch::new().dispatch(Dot { a, b })
}

struct Dot<'a> {
    a: &'a [f64],
    b: &'a [f64],
}

impl WithSimd for Dot<'_> {
    type Output = f64;

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) -> f64 {
        product(self.a, self.b)
    }
}

#[inline(always)]
fn product(a: &[f64], b: &[f64]) -> f64 {
    let mut sums = [0.0; SUMS];
    let (many_a, many_b) = (a.chunks_exact(SUMS), b.chunks_exact(SUMS));
    let mut rest = 0.0;
    for (a, b) in many_a.remainder().iter().zip(many_b.remainder()) {
        rest += a * b;
    }
    for (a, b) in many_a.zip(many_b) {
        for ((s, a), b) in sums.iter_mut().zip(a).zip(b) {
            *s += a * b;
        }
    }
    let mut width = SUMS / 2;
    while width > 0 {
        for k in 0..width {
            sums[k] += sums[k + width];
        }
        width /= 2;
    }
    sums[0] + rest
}

/// y += factor x.
pub fn add_scaled(y: &mut [f64], factor: f64, x: &[f64]) {
    for (y, x) in y.iter_mut().zip(x) {
        *y += factor * x;
    }
}

/// Takes orthonormal columns out of another, twice; adds what was taken to `taken`.
struct Projection<'a> {
    q: &'a [Vec<f64>],
    column: &'a mut [f64],
    taken: &'a mut [f64],
}

impl WithSimd for Projection<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        for _ in 0..2 {
            for (q, t) in self.q.iter().zip(self.taken.iter_mut()) {
                let part = product(q, self.column);
                *t += part;
                for (y, x) in self.column.iter_mut().zip(q) {
                    *y -= part * x;
                }
            }
        }
    }
}

/// An orthonormal basis of some columns, with the triangular factor: C = Q R.
///
/// Gram-Schmidt, twice (as accurate as Householder's reflections). Columns in the span of earlier
/// ones ([`DEPENDENT`]) are left out.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Basis {
    /// The orthonormal columns.
    pub q: Vec<Vec<f64>>,
    /// Column k of R, of the kept columns: k + 1 values.
    pub r: Vec<Vec<f64>>,
    /// Which of the given columns were kept, by index.
    pub kept: Vec<usize>,
    /// How many were given.
    pub given: usize,
}

impl Basis {
    /// The basis of `columns` (all of one length).
    pub fn new(columns: &[Vec<f64>]) -> Self {
        let mut out = Basis::default();
        for column in columns {
            out.push(column);
        }
        out
    }

    /// Adds one column; false if it lies in the span.
    pub fn push(&mut self, column: &[f64]) -> bool {
        let mut rest = column.to_vec();
        let before = dot(column, column).sqrt();
        let mut r = self.project_off(&mut rest);
        let norm = dot(&rest, &rest).sqrt();
        self.given += 1;
        if norm <= DEPENDENT * before || !norm.is_finite() {
            return false;
        }
        for v in &mut rest {
            *v /= norm;
        }
        r.push(norm);
        self.r.push(r);
        self.q.push(rest);
        self.kept.push(self.given - 1);
        true
    }

    /// Takes the span out of a column, twice; returns what was taken, in coordinates of Q.
    pub fn project_off(&self, column: &mut [f64]) -> Vec<f64> {
        let mut taken = vec![0.0; self.q.len()];
        Arch::new().dispatch(Projection {
            q: &self.q,
            column,
            taken: &mut taken,
        });
        taken
    }

    /// Number of independent columns.
    pub fn rank(&self) -> usize {
        self.q.len()
    }

    /// ln det(C' C) of the kept columns.
    pub fn log_det_gram(&self) -> f64 {
        let diagonal = self.r.iter().filter_map(|r| r.last());
        diagonal.map(|d| 2.0 * d.ln()).sum()
    }

    /// The coefficients of all given columns for coordinates `z` of Q; 0 for those left out.
    pub fn solve(&self, z: &[f64]) -> Vec<f64> {
        let mut c: Vec<f64> = z.to_vec();
        c.resize(self.rank(), 0.0);
        for k in (0..self.rank()).rev() {
            let column = &self.r[k];
            let value = c[k] / column[k];
            c[k] = value;
            for (c, r) in c.iter_mut().zip(&column[..k]) {
                *c -= r * value;
            }
        }
        let mut out = vec![0.0; self.given];
        for (index, value) in self.kept.iter().zip(c) {
            out[*index] = value;
        }
        out
    }

    /// (C' C)^-1 over all given columns; rows and columns of those left out are 0.
    pub fn inverse_gram(&self) -> DMatrix<f64> {
        let mut out = DMatrix::zeros(self.given, self.given);
        for k in 0..self.rank() {
            let mut unit = vec![0.0; self.rank()];
            unit[k] = 1.0;
            let column = self.solve(&unit);
            for i in 0..self.given {
                for j in 0..self.given {
                    out[(i, j)] += column[i] * column[j];
                }
            }
        }
        out
    }
}

/// A pivot that falls below this share of the column's square is the rounding of products of columns.
const ROUNDED: f64 = 1e-12;

/// Cholesky's factor of the products of columns, column by column.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Factor {
    /// The columns that are in.
    kept: Vec<usize>,
    /// Row k of the factor: k + 1 values.
    rows: Vec<Vec<f64>>,
}

impl Factor {
    /// Adds a column of a sum of squares (`square`, beyond whatever all columns are taken beyond) and products with the earlier ones.
    /// False where no more than `least` of its square is beyond those: then it stays out.
    pub fn push(
        &mut self,
        column: usize,
        square: f64,
        least: f64,
        product: impl Fn(usize) -> f64,
    ) -> bool {
        let mut pivot = square;
        let mut row: Vec<f64> = Vec::with_capacity(self.kept.len() + 1);
        for (earlier, of_earlier) in self.kept.iter().zip(&self.rows) {
            let known: f64 = row.iter().zip(of_earlier).map(|(a, b)| a * b).sum();
            let entry = (product(*earlier) - known) / of_earlier[row.len()];
            pivot -= entry * entry;
            row.push(entry);
        }
        let stays = pivot > least && pivot.is_finite();
        if stays {
            row.push(pivot.sqrt());
            self.rows.push(row);
            self.kept.push(column);
        }
        stays
    }

    /// The coordinate of something along the last column, given its product with that column and its earlier coordinates.
    pub fn along(&self, product: f64, earlier: impl Iterator<Item = f64>) -> f64 {
        let Some((diagonal, row)) = self.rows.last().and_then(|row| row.split_last()) else {
            return 0.0;
        };
        let known: f64 = row.iter().zip(earlier).map(|(r, z)| r * z).sum();
        (product - known) / diagonal
    }

    /// The coefficients of `count` columns for coordinates along those that are in; 0 for the others.
    pub fn solve(&self, coordinates: &[f64], count: usize) -> Vec<f64> {
        let mut out = vec![0.0; count];
        for k in (0..self.kept.len()).rev() {
            let later = (k + 1..self.kept.len()).map(|j| self.rows[j][k] * out[self.kept[j]]);
            out[self.kept[k]] = (coordinates[k] - later.sum::<f64>()) / self.rows[k][k];
        }
        out
    }
}

/// Least squares from products alone: `gram` holds those of the columns, `with` those with what is to be explained. Columns in the
/// span of earlier ones get 0. Only half the digits of [`Basis`] are left.
pub fn normal(gram: &DMatrix<f64>, with: &DVector<f64>) -> Vec<f64> {
    let mut factor = Factor::default();
    let mut coordinates: Vec<f64> = Vec::new();
    for k in 0..gram.nrows() {
        let square = gram[(k, k)];
        if factor.push(k, square, ROUNDED * square, |j| gram[(k, j)]) {
            coordinates.push(factor.along(with[k], coordinates.iter().copied()));
        }
    }
    factor.solve(&coordinates, gram.nrows())
}

/// All dot products of the columns of `a` with those of `b`: entry [i * b.len() + j].
pub fn dots<A: AsRef<[f64]>, B: AsRef<[f64]>>(a: &[A], b: &[B]) -> Vec<f64> {
    Arch::new().dispatch(Dots { a, b })
}

struct Dots<'a, A, B> {
    a: &'a [A],
    b: &'a [B],
}

impl<A: AsRef<[f64]>, B: AsRef<[f64]>> WithSimd for Dots<'_, A, B> {
    type Output = Vec<f64>;

    /// Blocked, so that both stay in the cache.
    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) -> Vec<f64> {
        const BLOCK: usize = 1024;
        let (a, b) = (self.a, self.b);
        let mut out = vec![0.0; a.len() * b.len()];
        let n = a.first().map_or(0, |a| a.as_ref().len());
        for start in (0..n).step_by(BLOCK) {
            let block = start..(start + BLOCK).min(n);
            for (i, a4) in a.chunks(4).enumerate() {
                for (j, b2) in b.chunks(2).enumerate() {
                    if let ([a0, a1, a2, a3], [b0, b1]) = (a4, b2) {
                        let a = [a0, a1, a2, a3].map(|c| &c.as_ref()[block.clone()]);
                        let sums = tile(a, [b0, b1].map(|c| &c.as_ref()[block.clone()]));
                        for (k, row) in sums.iter().enumerate() {
                            for (l, s) in row.iter().enumerate() {
                                out[(4 * i + k) * b.len() + 2 * j + l] += s;
                            }
                        }
                    } else {
                        for (k, a) in a4.iter().enumerate() {
                            for (l, c) in b2.iter().enumerate() {
                                let (a, c) = (a.as_ref(), c.as_ref());
                                out[(4 * i + k) * b.len() + 2 * j + l] +=
                                    product(&a[block.clone()], &c[block.clone()]);
                            }
                        }
                    }
                }
            }
        }
        out
    }
}

/// Rows that a tile's sums take side by side.
const ROWS: usize = 4;

/// Four columns against two.
#[inline(always)]
fn tile(a: [&[f64]; 4], b: [&[f64]; 2]) -> [[f64; 2]; 4] {
    let mut sums = [[[0.0f64; ROWS]; 2]; 4];
    let (a, rest_a) = parted(a);
    let (b, rest_b) = parted(b);
    let n = b[0].len();
    let (a, b) = (a.map(|c| &c[..n]), b.map(|c| &c[..n]));
    for i in 0..n {
        let right = [b[0][i], b[1][i]];
        for (sums, a) in sums.iter_mut().zip(&a) {
            let left = a[i];
            for (s, r) in sums.iter_mut().zip(&right) {
                for k in 0..ROWS {
                    s[k] += left[k] * r[k];
                }
            }
        }
    }
    let mut out = [[0.0; 2]; 4];
    for ((out, sums), a) in out.iter_mut().zip(&sums).zip(&rest_a) {
        for ((o, s), b) in out.iter_mut().zip(sums).zip(&rest_b) {
            *o = (s[0] + s[1]) + (s[2] + s[3]);
            for (a, b) in a.iter().zip(*b) {
                *o += a * b;
            }
        }
    }
    out
}

/// Columns as chunks of [`ROWS`] rows, and their last rows.
#[inline(always)]
fn parted<const N: usize>(columns: [&[f64]; N]) -> ([&[[f64; ROWS]]; N], [&[f64]; N]) {
    let parts = columns.map(|c| c.as_chunks::<ROWS>());
    (parts.map(|p| p.0), parts.map(|p| p.1))
}

#[cfg(test)]
mod tests {
    use super::super::random::Stream;
    use super::*;

    #[test]
    fn products_and_bases_are_those_of_plain_loops() {
        let columns: Vec<Vec<f64>> = (0..11).map(|k| Stream::new(7, k).normals(1301)).collect();
        let all = dots(&columns, &columns[..5]);
        for (i, a) in columns.iter().enumerate() {
            for (j, b) in columns[..5].iter().enumerate() {
                let plain: f64 = a.iter().zip(b).map(|(a, b)| a * b).sum();
                assert!((all[i * 5 + j] - plain).abs() < 1e-10, "{i} {j}");
            }
        }
        let mut three = columns[..3].to_vec();
        three.push(
            three[0]
                .iter()
                .zip(&three[1])
                .map(|(a, b)| a - 2.0 * b)
                .collect(),
        );
        three.push(columns[4].clone());
        let basis = Basis::new(&three);
        assert_eq!(basis.kept, [0, 1, 2, 4]);
        let target: Vec<f64> = (0..1301)
            .map(|i| 3.0 * three[0][i] - three[2][i] + 0.5 * three[4][i])
            .collect();
        let z: Vec<f64> = basis.q.iter().map(|q| dot(q, &target)).collect();
        let c = basis.solve(&z);
        let gram = DMatrix::from_row_slice(5, 5, &dots(&three, &three));
        let with = DVector::from_vec(dots(&three, &[&target]));
        let by_products = normal(&gram, &with);
        for ((c, d), want) in c.iter().zip(by_products).zip([3.0, 0.0, -1.0, 0.0, 0.5]) {
            assert!((c - want).abs() < 1e-12, "{c}");
            assert!((d - want).abs() < 1e-10, "{d}");
        }
    }
}
