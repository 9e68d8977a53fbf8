//! Polynomials: evaluation, change of variable, weighted least squares.
//!
//! Coefficients are lowest order first, everywhere.

use nalgebra::DMatrix;

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
    let mut row = Vec::with_capacity(order + 1);
    let mut power = 1.0;
    for _ in 0..=order {
        row.push(power);
        power *= x;
    }
    row
}

/// The matrix with rows 1, x, .., x^order.
pub fn vandermonde(x: &[f64], order: usize) -> DMatrix<f64> {
    let mut m = DMatrix::from_element(x.len(), order + 1, 1.0);
    for k in 1..=order {
        for (i, x) in x.iter().enumerate() {
            m[(i, k)] = m[(i, k - 1)] * x;
        }
    }
    m
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
    /// Factors the problem for orders up to `order`: columns w^(1/2) x^k, made orthonormal by
    /// Gram-Schmidt, twice (as accurate as Householder's reflections, and nested in the order).
    ///
    /// x should lie within [-1, 1]; up to order 8 its powers are then well conditioned, below
    /// 1e4. `weights` below 0 count as 0. All slices have one length. Columns that the points with
    /// weight do not determine end the factorisation: see [`LeastSquares::order`].
    pub fn new(x: &[f64], y: &[f64], weights: &[f64], order: usize) -> Self {
        let mut next: Vec<f64> = weights.iter().map(|w| w.max(0.0).sqrt()).collect();
        let rhs: Vec<f64> = y.iter().zip(&next).map(|(y, w)| y * w).collect();
        let mut basis: Vec<Vec<f64>> = Vec::with_capacity(order + 1);
        let mut out = LeastSquares {
            r: Vec::with_capacity(order + 1),
            z: Vec::with_capacity(order + 1),
        };
        for _ in 0..=order {
            let mut column = next.clone();
            let before = dot(&column, &column).sqrt();
            let mut r = vec![0.0; basis.len() + 1];
            for _ in 0..2 {
                for (q, r) in basis.iter().zip(&mut r) {
                    let part = dot(q, &column);
                    *r += part;
                    for (c, q) in column.iter_mut().zip(q) {
                        *c -= part * q;
                    }
                }
            }
            let norm = dot(&column, &column).sqrt();
            if norm <= 1e-9 * before || norm.is_nan() {
                break;
            }
            for c in &mut column {
                *c /= norm;
            }
            if let Some(last) = r.last_mut() {
                *last = norm;
            }
            out.z.push(dot(&column, &rhs));
            out.r.push(r);
            basis.push(column);
            for (n, x) in next.iter_mut().zip(x) {
                *n *= x;
            }
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
