//! Lattices: reduction, and enumeration of the points in a ball.
//!
//! A. K. Lenstra, H. W. Lenstra, L. Lovasz, "Factoring polynomials with rational coefficients", Mathematische
//! Annalen 261 (1982); L. Babai, "On Lovasz' lattice reduction and the nearest lattice point problem",
//! Combinatorica 6 (1986); C. P. Schnorr, M. Euchner, "Lattice basis reduction: improved practical
//! algorithms and solving subset sum problems", Mathematical Programming 66 (1994).

use super::wide::{Wide, dot};

/// Lovasz' parameter.
const DELTA: f64 = 0.99;
/// Swaps at most; the reduction of what this crate makes takes some thousands.
const MOST_STEPS: usize = 200_000;

/// Says of (number of free coordinates, point, what is left of the squared limit) whether nothing below
/// is wanted, and what the answer cost in nodes.
pub type Exclude<'a> = dyn FnMut(usize, &[i64], f64) -> (bool, u64) + 'a;

/// A basis of a lattice with the integer matrix that makes it from the original one.
#[derive(Debug, Clone)]
pub struct Reduced {
    /// Basis vectors.
    pub vectors: Vec<Vec<Wide>>,
    /// `vectors[k] = sum over i of transform[k][i] original[i]`; its determinant is +-1, for it is
    /// made by exact integer steps.
    pub transform: Vec<Vec<i128>>,
}

/// The unit matrix: the transform of an original basis.
pub fn identity(n: usize) -> Vec<Vec<i128>> {
    (0..n)
        .map(|k| (0..n).map(|i| i128::from(i == k)).collect())
        .collect()
}

/// Reduces the basis `transform * original`. None if integers or 106 bits do not suffice: the vectors are
/// dependent for all that can be seen.
///
/// Orthogonalisation is by modified Gram-Schmidt in double-double; vectors are made anew from the exact
/// transform until a whole pass changes nothing.
pub fn reduce(original: &[Vec<Wide>], mut transform: Vec<Vec<i128>>) -> Option<Reduced> {
    loop {
        let mut pass = Pass {
            vectors: combine(original, &transform),
            transform,
            orthogonal: Vec::new(),
            squares: Vec::new(),
            mu: Vec::new(),
            changed: false,
        };
        pass.run()?;
        if !pass.changed {
            return Some(Reduced {
                vectors: pass.vectors,
                transform: pass.transform,
            });
        }
        transform = pass.transform;
    }
}

/// Integer combinations of vectors.
pub fn combine(original: &[Vec<Wide>], transform: &[Vec<i128>]) -> Vec<Vec<Wide>> {
    let length = original.first().map_or(0, Vec::len);
    transform
        .iter()
        .map(|row| {
            let mut sum = vec![Wide::ZERO; length];
            for (&factor, vector) in row.iter().zip(original) {
                if factor != 0 {
                    let factor = Wide::from_integer(factor);
                    for (s, v) in sum.iter_mut().zip(vector) {
                        *s += factor * *v;
                    }
                }
            }
            sum
        })
        .collect()
}

struct Pass {
    vectors: Vec<Vec<Wide>>,
    transform: Vec<Vec<i128>>,
    /// Gram-Schmidt vectors of the first ones.
    orthogonal: Vec<Vec<Wide>>,
    squares: Vec<f64>,
    mu: Vec<Vec<Wide>>,
    changed: bool,
}

impl Pass {
    fn run(&mut self) -> Option<()> {
        let n = self.vectors.len();
        let mut k = 0;
        for _ in 0..MOST_STEPS {
            if k >= n {
                return Some(());
            }
            self.orthogonal.truncate(k);
            self.squares.truncate(k);
            self.mu.truncate(k);
            self.size_reduce(k)?;
            let lovasz = k == 0 || {
                let mu = self.mu[k][k - 1].hi;
                self.squares[k] >= (DELTA - mu * mu) * self.squares[k - 1]
            };
            if lovasz {
                k += 1;
            } else {
                self.vectors.swap(k, k - 1);
                self.transform.swap(k, k - 1);
                self.changed = true;
                k -= 1;
            }
        }
        None
    }

    /// Orthogonalises vector k and takes whole multiples of the earlier ones from it until none is left.
    fn size_reduce(&mut self, k: usize) -> Option<()> {
        for _ in 0..60 {
            let (rest, mut mu) = self.orthogonalise(k);
            let mut again = false;
            for j in (0..k).rev() {
                if mu[j].hi.abs() <= 0.501 {
                    continue;
                }
                let q = mu[j].round()?;
                if q == 0 {
                    continue;
                }
                again = true;
                let factor = Wide::from_integer(q);
                for (to, from) in mu.iter_mut().zip(&self.mu[j]) {
                    *to -= factor * *from;
                }
                self.subtract(k, j, q)?;
            }
            if !again {
                let square = dot(&rest, &rest).hi;
                if !(square > 0.0 && square.is_finite()) {
                    return None;
                }
                self.orthogonal.push(rest);
                self.squares.push(square);
                self.mu.push(mu);
                return Some(());
            }
            self.changed = true;
        }
        None
    }

    fn orthogonalise(&self, k: usize) -> (Vec<Wide>, Vec<Wide>) {
        let mut rest = self.vectors[k].clone();
        let mut mu = Vec::with_capacity(k);
        for (direction, &square) in self.orthogonal.iter().zip(&self.squares) {
            let factor = dot(&rest, direction) / Wide::from(square);
            for (r, d) in rest.iter_mut().zip(direction) {
                let v = factor * *d;
                *r -= v;
            }
            mu.push(factor);
        }
        (rest, mu)
    }

    /// Vector k minus q times vector j, in numbers and in integers.
    fn subtract(&mut self, k: usize, j: usize, q: i128) -> Option<()> {
        let factor = Wide::from_integer(q);
        for i in 0..self.vectors[k].len() {
            let v = factor * self.vectors[j][i];
            self.vectors[k][i] -= v;
        }
        for i in 0..self.transform[k].len() {
            let product = q.checked_mul(self.transform[j][i])?;
            self.transform[k][i] = self.transform[k][i].checked_sub(product)?;
        }
        Some(())
    }
}

/// |offset - sum of z_k b_k|^2 as a function of the integers z, triangularised.
#[derive(Debug, Clone)]
pub struct Ball {
    /// Upper triangle: `triangle[k][j]` for j >= k.
    triangle: Vec<Vec<f64>>,
    /// The offset in the same coordinates.
    centre: Vec<f64>,
    /// Square of what no real z takes away.
    pub rest: f64,
}

impl Ball {
    /// From basis vectors and the offset, all of one length.
    pub fn new(vectors: &[Vec<f64>], offset: &[f64]) -> Ball {
        let n = vectors.len();
        let mut work = vectors.to_vec();
        let mut rest = offset.to_vec();
        let mut triangle = vec![vec![0.0; n]; n];
        let mut centre = vec![0.0; n];
        let inner = |a: &[f64], b: &[f64]| -> f64 { a.iter().zip(b).map(|(x, y)| x * y).sum() };
        // Twice is enough (Giraud, Langou 2002): the second pass removes what rounding left.
        for k in 0..n {
            let (done, open) = work.split_at_mut(k);
            let vector = &mut open[0];
            for _ in 0..2 {
                for (j, direction) in done.iter().enumerate() {
                    let factor = inner(vector, direction);
                    triangle[j][k] += factor;
                    for (v, d) in vector.iter_mut().zip(direction) {
                        *v -= factor * d;
                    }
                }
            }
            let length = inner(vector, vector).sqrt().max(f64::MIN_POSITIVE);
            vector.iter_mut().for_each(|v| *v /= length);
            triangle[k][k] = length;
            for _ in 0..2 {
                let factor = inner(&rest, vector);
                centre[k] += factor;
                for (r, v) in rest.iter_mut().zip(vector.iter()) {
                    *r -= factor * v;
                }
            }
        }
        Ball {
            triangle,
            centre,
            rest: inner(&rest, &rest),
        }
    }

    /// Length of basis vector k beyond the span of the earlier ones.
    pub fn side(&self, k: usize) -> f64 {
        self.triangle[k][k]
    }

    fn middle(&self, k: usize, z: &[i64]) -> f64 {
        let row = &self.triangle[k];
        let mut sum = self.centre[k];
        for j in k + 1..z.len() {
            sum -= row[j] * z[j] as f64;
        }
        sum / row[k]
    }

    /// Babai's nearest plane: a lattice point near the offset.
    pub fn nearest_plane(&self) -> Vec<i64> {
        let mut z = vec![0; self.centre.len()];
        for k in (0..z.len()).rev() {
            z[k] = self.middle(k, &z).round() as i64;
        }
        z
    }

    /// Visits every integer point whose squared distance is at most `limit`, near ones first in each
    /// coordinate. `exclude` is asked at every node above the last coordinate. `leaf` gets the point and returns the limit from then on and what the look cost, in
    /// nodes. The result is the number of nodes, and whether all were visited before `most_nodes` were spent.
    pub fn visit(
        &self,
        mut limit: f64,
        most_nodes: u64,
        exclude: &mut Exclude,
        leaf: &mut dyn FnMut(&[i64]) -> (f64, u64),
    ) -> (u64, bool) {
        let n = self.centre.len();
        if n == 0 {
            return (0, true);
        }
        let mut z = vec![0i64; n];
        let mut step = vec![1i64; n];
        let mut middle = vec![0.0; n];
        let mut distance = vec![0.0; n + 1];
        distance[n] = self.rest;
        let mut k = n - 1;
        let mut nodes = 0;
        let mut enter = true;
        loop {
            if enter {
                middle[k] = self.middle(k, &z);
                if middle[k].abs() > 9e15 {
                    return (nodes, false); // beyond exact integers: a basis that is not reduced
                }
                z[k] = middle[k].round() as i64;
                step[k] = if middle[k] >= z[k] as f64 { 1 } else { -1 };
            }
            if nodes >= most_nodes {
                return (nodes, false);
            }
            nodes += 1;
            let away = self.triangle[k][k] * (z[k] as f64 - middle[k]);
            let d = distance[k + 1] + away * away;
            enter = false;
            if d <= limit {
                if k > 0 {
                    let (excluded, cost) = exclude(k, &z, limit - d);
                    nodes += cost;
                    if excluded {
                        z[k] += step[k];
                        step[k] = outward(step[k]);
                        continue;
                    }
                    distance[k] = d;
                    k -= 1;
                    enter = true;
                    continue;
                }
                let (next, cost) = leaf(&z);
                limit = next;
                nodes += cost;
            } else {
                k += 1;
                if k == n {
                    return (nodes, true);
                }
            }
            // The next one outward, alternating sides.
            z[k] += step[k];
            step[k] = outward(step[k]);
        }
    }
}

/// The step after this one: alternating sides, one longer each time.
fn outward(step: i64) -> i64 {
    if step > 0 { -step - 1 } else { -step + 1 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn wide(m: &[Vec<f64>]) -> Vec<Vec<Wide>> {
        m.iter()
            .map(|r| r.iter().map(|&v| Wide::from(v)).collect())
            .collect()
    }

    fn determinant(m: &[Vec<i128>]) -> i128 {
        let minor = |a: usize, b: usize| m[1][a] * m[2][b] - m[1][b] * m[2][a];
        m[0][0] * minor(1, 2) - m[0][1] * minor(0, 2) + m[0][2] * minor(0, 1)
    }

    /// An integer relation is the shortest vector.
    #[test]
    fn reduction_finds_the_relation_of_the_golden_ratio() {
        let phi = (1.0 + 5f64.sqrt()) / 2.0;
        // phi^2 - phi - 1 = 0.
        let rows: Vec<Vec<f64>> = (0..3)
            .map(|k| {
                let mut row = vec![0.0; 4];
                row[k] = 1.0;
                row[3] = 1e9 * phi.powi(k as i32);
                row
            })
            .collect();
        let found = reduce(&wide(&rows), identity(3)).unwrap();
        let first = &found.transform[0];
        assert!(first == &[1, 1, -1] || first == &[-1, -1, 1], "{first:?}");
        assert_eq!(determinant(&found.transform).abs(), 1);
    }

    #[test]
    fn dependent_vectors_are_refused() {
        let rows = vec![vec![1.0, 2.0], vec![2.0, 4.0]];
        assert!(reduce(&wide(&rows), identity(2)).is_none());
    }

    proptest! {
        /// Every point in the ball is visited once, and no other.
        #[test]
        fn enumeration_is_complete(
            entries in prop::collection::vec(-0.6..0.6f64, 9),
            offset in prop::collection::vec(-2.0..2.0f64, 3),
            radius in 0.3..1.5f64,
        ) {
            let mut rows: Vec<Vec<f64>> = entries.chunks(3).map(<[f64]>::to_vec).collect();
            for (k, row) in rows.iter_mut().enumerate() { row[k] += 2.0; }
            // Diagonally dominant by at least 1.4 - 2 * 0.6: a point in the ball has no coordinate beyond (2 + sqrt(1.5)) / 0.2 = 16.2.
            let mut brute = Vec::new();
            for a in -17..=17i64 { for b in -17..=17i64 { for c in -17..=17i64 {
                let d: f64 = (0..3).map(|i| {
                    let v = offset[i] - a as f64 * rows[0][i] - b as f64 * rows[1][i] - c as f64 * rows[2][i];
                    v * v
                }).sum();
                if d <= radius { brute.push(vec![a, b, c]); }
            }}}
            let ball = Ball::new(&rows, &offset);
            let mut found = Vec::new();
            let (_, complete) = ball.visit(radius, 1_000_000, &mut |_, _, _| (false, 0), &mut |z| { found.push(z.to_vec()); (radius, 0) });
            found.sort();
            prop_assert!(complete);
            prop_assert_eq!(found, brute);
        }
    }
}
