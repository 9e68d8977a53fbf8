//! Polynomials: evaluation, change of variable, weighted least squares.
//!
//! Coefficients are lowest order first, everywhere.

/// The polynomial at `x` (Horner, fused).
pub fn evaluate(coefficients: &[f64], x: f64) -> f64 {
    coefficients
        .iter()
        .rev()
        .fold(0.0, |sum, c| f64::mul_add(sum, x, *c))
}

/// The coefficients in p of a polynomial in x, where x = `a` + `b` p.
///
/// Taylor shift by repeated synthetic division with fused operations. Nothing large is formed
/// that later cancels as long as |a| is not large, that is, as long as the new origin lies near
/// the range in which x is of order 1.
pub fn substitute(coefficients: &[f64], a: f64, b: f64) -> Vec<f64> {
    let mut c = coefficients.to_vec();
    for first in 0..c.len() {
        for k in (first..c.len().saturating_sub(1)).rev() {
            c[k] = f64::mul_add(a, c[k + 1], c[k]);
        }
    }
    let mut power = 1.0;
    for value in &mut c {
        *value *= power;
        power *= b;
    }
    c
}

/// 1, x, .., x^order.
pub fn powers(x: f64, order: usize) -> Vec<f64> {
    let mut row = vec![0.0; order + 1];
    fill_powers(x, &mut row);
    row
}

/// The same for as many powers as `row` has places.
pub fn fill_powers(x: f64, row: &mut [f64]) {
    let mut power = 1.0;
    for place in row {
        *place = power;
        power *= x;
    }
}

/// A weighted least-squares problem in powers of x, factored: the solutions of all orders.
#[derive(Debug, Clone, PartialEq)]
pub struct LeastSquares {
    /// Column k of the triangular factor, k + 1 values.
    r: Vec<Vec<f64>>,
    /// The right-hand side in the orthonormal basis.
    z: Vec<f64>,
}

impl LeastSquares {
    /// Factors the problem for orders up to `order`: columns w^(1/2) x^k, made orthonormal by Householder's reflections,
    /// some rows at a time below the triangle of those before (Golub and Van Loan, Matrix Computations, section 5.2,
    /// sequential QR), so that the memory does not grow with the rows.
    ///
    /// x should lie within [-1, 1]; up to order 8 its powers are then well conditioned, below
    /// 1e4. `weights` below 0 count as 0. All slices have one length. Columns that the points with
    /// weight do not determine end the factorisation: see [`LeastSquares::order`].
    pub fn new(x: &[f64], y: &[f64], weights: &[f64], order: usize) -> Self {
        /// Rows that are taken at once: their columns fit into the first cache (convention).
        const ROWS: usize = 256;
        let powers = order + 1;
        // Row j of the triangle with the right-hand side behind it, and the columns of the rows at hand.
        let mut triangle = vec![vec![0.0; powers + 1]; powers];
        let mut columns = vec![Vec::with_capacity(ROWS); powers + 1];
        for ((x, y), w) in x.chunks(ROWS).zip(y.chunks(ROWS)).zip(weights.chunks(ROWS)) {
            let root: Vec<f64> = w.iter().map(|w| w.max(0.0).sqrt()).collect();
            let scaled = |values: &[f64], by: &[f64]| -> Vec<f64> {
                values.iter().zip(by).map(|(a, b)| a * b).collect()
            };
            columns[powers] = scaled(y, &root);
            let mut next = root;
            for column in &mut columns[..powers] {
                *column = next;
                next = scaled(column, x);
            }
            for (k, row) in triangle.iter_mut().enumerate() {
                reflect(row, &mut columns, k);
            }
        }
        let mut out = LeastSquares {
            r: Vec::with_capacity(powers),
            z: Vec::with_capacity(powers),
        };
        for k in 0..powers {
            let r: Vec<f64> = triangle[..=k].iter().map(|row| row[k]).collect();
            if r[k].abs() <= 1e-9 * dot(&r, &r).sqrt() || r[k].is_nan() {
                break;
            }
            out.r.push(r);
            out.z.push(triangle[k][powers]);
        }
        out
    }

    /// The largest order that is determined; 0 if nothing is.
    pub fn order(&self) -> usize {
        self.r.len().saturating_sub(1)
    }

    /// The coefficients of order `order`, or of the largest order below it that is determined:
    /// then there are fewer than `order + 1`. Never empty; a single 0 if no point has weight.
    pub fn coefficients(&self, order: usize) -> Vec<f64> {
        let terms = self.r.len().min(order + 1);
        let mut c = self.z[..terms].to_vec();
        for k in (0..terms).rev() {
            c[k] /= self.r[k][k];
            let value = c[k];
            for (j, r) in self.r[k][..k].iter().enumerate() {
                c[j] -= r * value;
            }
        }
        if c.is_empty() {
            c.push(0.0);
        }
        c
    }
}

/// The reflection that takes column `k` of some rows into row `k` of the triangle, for the columns from it on.
fn reflect(row: &mut [f64], columns: &mut [Vec<f64>], k: usize) {
    let Some((first, rest)) = columns[k..].split_first_mut() else {
        return;
    };
    let below = dot(first, first);
    if below == 0.0 {
        return;
    }
    let norm = row[k].hypot(below.sqrt());
    let pivot = if row[k] > 0.0 { -norm } else { norm };
    // The reflection's vector is (head, first).
    let head = row[k] - pivot;
    let scale = 2.0 / (head * head + below);
    for (value, column) in row[k + 1..].iter_mut().zip(rest) {
        let part = scale * (head * *value + dot(first, column));
        *value -= part * head;
        for (c, v) in column.iter_mut().zip(first.iter()) {
            *c -= part * v;
        }
    }
    row[k] = pivot;
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// The coefficients of one order: [`LeastSquares::new`] and [`LeastSquares::coefficients`].
pub fn least_squares(x: &[f64], y: &[f64], weights: &[f64], order: usize) -> Vec<f64> {
    LeastSquares::new(x, y, weights, order).coefficients(order)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn an_exact_polynomial_comes_back() {
        let truth = [1.0, -2.0, 0.5, 0.25, -3.0, 0.125, 0.7, -0.4, 2.0];
        let x: Vec<f64> = (0..200).map(|k| f64::from(k) / 99.5 - 1.0).collect();
        let y: Vec<f64> = x.iter().map(|x| evaluate(&truth, *x)).collect();
        let w: Vec<f64> = (0..200).map(|k| 1.0 + f64::from(k % 3)).collect();
        let found = least_squares(&x, &y, &w, 8);
        for (a, b) in found.iter().zip(&truth) {
            assert!((a - b).abs() < 1e-10, "{found:?}");
        }
    }

    /// The first rows alone, a long dwell, determine one coefficient.
    #[test]
    fn rows_at_one_place_before_all_others_lose_nothing() {
        let truth = [0.7, -1.5, 0.25, 2.0];
        let dwell = std::iter::repeat_n(0.3, 700);
        let x: Vec<f64> = dwell
            .chain((0..900).map(|k| f64::from(k) / 449.5 - 1.0))
            .collect();
        let y: Vec<f64> = x.iter().map(|x| evaluate(&truth, *x)).collect();
        let found = least_squares(&x, &y, &vec![1.0; x.len()], 3);
        assert_eq!(found.len(), 4);
        for (a, b) in found.iter().zip(&truth) {
            assert!((a - b).abs() < 1e-12, "{found:?}");
        }
    }

    #[test]
    fn an_order_that_is_not_determined_is_lowered() {
        let x = [-1.0, -1.0, 1.0, 1.0, 0.3];
        let y = [0.0, 2.0, 3.0, 5.0, 100.0];
        let found = least_squares(&x, &y, &[1.0, 1.0, 1.0, 1.0, 0.0], 5);
        assert_eq!(found.len(), 2);
        assert!((found[0] - 2.5).abs() < 1e-12 && (found[1] - 1.5).abs() < 1e-12);
        assert_eq!(least_squares(&[], &[], &[], 3), [0.0]);
        let mean = least_squares(&[0.5; 3], &[1.0, 2.0, 6.0], &[1.0; 3], 3);
        assert!(mean.len() == 1 && (mean[0] - 3.0).abs() < 1e-14, "{mean:?}");
    }

    proptest! {
        #[test]
        fn a_change_of_variable_keeps_the_values(
            c in prop::collection::vec(-10.0f64..10.0, 1..10),
            a in -1.5f64..1.5,
            b in -2.0f64..2.0,
            p in -1.0f64..1.0,
        ) {
            let moved = substitute(&c, a, b);
            let x = a + b * p;
            let size: f64 = c.iter().enumerate()
                .map(|(k, c)| c.abs() * (a.abs() + (b * p).abs()).powi(k as i32)).sum();
            let difference = evaluate(&moved, p) - evaluate(&c, x);
            prop_assert!(difference.abs() <= 1e-13 * size.max(1e-3), "{difference} of {size}");
        }
    }
}
