//! Dot products, orthonormal bases, products of tall matrices; all in a fixed order of operations,
//! so that the bits do not depend on the processor.

use nalgebra::DMatrix;

/// A pivot that falls below this share of the column's norm is rounding: the column lies in the
/// span of those before it.
pub const DEPENDENT: f64 = 1e-8;

/// Sum of products, in four interleaved partial sums.
pub fn dot(a: &[f64], b: &[f64]) -> f64 {
    let mut sums = [0.0; 4];
    let (a4, b4) = (a.chunks_exact(4), b.chunks_exact(4));
    let rest: f64 = a4
        .remainder()
        .iter()
        .zip(b4.remainder())
        .map(|(a, b)| a * b)
        .sum();
    for (a, b) in a4.zip(b4) {
        for ((s, a), b) in sums.iter_mut().zip(a).zip(b) {
            *s += a * b;
        }
    }
    (sums[0] + sums[1]) + (sums[2] + sums[3]) + rest
}

/// y += factor x.
pub fn add_scaled(y: &mut [f64], factor: f64, x: &[f64]) {
    for (y, x) in y.iter_mut().zip(x) {
        *y += factor * x;
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
        for _ in 0..2 {
            for (q, t) in self.q.iter().zip(&mut taken) {
                let part = dot(q, column);
                *t += part;
                add_scaled(column, -part, q);
            }
        }
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

/// All dot products of the columns of `a` with those of `b`: entry [i * b.len() + j]. Blocked, so
/// that both stay in the cache.
pub fn dots(a: &[Vec<f64>], b: &[Vec<f64>]) -> Vec<f64> {
    const BLOCK: usize = 1024;
    let mut out = vec![0.0; a.len() * b.len()];
    let n = a.first().map_or(0, Vec::len);
    for start in (0..n).step_by(BLOCK) {
        let end = (start + BLOCK).min(n);
        for (i, a4) in a.chunks(4).enumerate() {
            for (j, b2) in b.chunks(2).enumerate() {
                if let ([a0, a1, a2, a3], [b0, b1]) = (a4, b2) {
                    let a = [a0, a1, a2, a3].map(|c| &c[start..end]);
                    let sums = tile(a, [&b0[start..end], &b1[start..end]]);
                    for (k, row) in sums.iter().enumerate() {
                        for (l, s) in row.iter().enumerate() {
                            out[(4 * i + k) * b.len() + 2 * j + l] += s;
                        }
                    }
                } else {
                    for (k, a) in a4.iter().enumerate() {
                        for (l, c) in b2.iter().enumerate() {
                            out[(4 * i + k) * b.len() + 2 * j + l] +=
                                dot(&a[start..end], &c[start..end]);
                        }
                    }
                }
            }
        }
    }
    out
}

/// Four columns against two.
fn tile(a: [&[f64]; 4], b: [&[f64]; 2]) -> [[f64; 2]; 4] {
    let n = b[0].len();
    let mut sums = [[[0.0f64; 2]; 2]; 4];
    let a = a.map(|c| &c[..n]);
    let b = b.map(|c| &c[..n]);
    let even = n / 2 * 2;
    let mut i = 0;
    while i < even {
        let right = [[b[0][i], b[0][i + 1]], [b[1][i], b[1][i + 1]]];
        for (sums, a) in sums.iter_mut().zip(&a) {
            let left = [a[i], a[i + 1]];
            for (s, r) in sums.iter_mut().zip(&right) {
                s[0] += left[0] * r[0];
                s[1] += left[1] * r[1];
            }
        }
        i += 2;
    }
    let mut out = [[0.0; 2]; 4];
    for ((out, sums), a) in out.iter_mut().zip(&sums).zip(&a) {
        for ((o, s), b) in out.iter_mut().zip(sums).zip(&b) {
            *o = s[0] + s[1];
            if even < n {
                *o += a[even] * b[even];
            }
        }
    }
    out
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
        for (c, want) in c.iter().zip([3.0, 0.0, -1.0, 0.0, 0.5]) {
            assert!((c - want).abs() < 1e-12, "{c}");
        }
    }
}
