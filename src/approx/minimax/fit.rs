//! Polynomials through measured data: weighted least squares with its covariance. The minimax fit of the same
//! data is [`super::minimax`] over [`Samples::measured`].

use super::basis::{Basis, Chebyshev};
use super::exchange;
use super::samples::Samples;
use super::wide::{Wide, dot};
use crate::error::{InputError, Result};

/// A weighted least-squares polynomial.
#[derive(Debug, Clone)]
pub struct PointFit {
    /// One a monomial, ascending exponents.
    pub coefficients: Vec<Wide>,
    /// Covariance of the coefficients, rows as the coefficients, for independent errors with the
    /// given standard deviations (not scaled by the residuals).
    pub covariance: Vec<Vec<f64>>,
    /// Sum of squared residuals in standard deviations.
    pub chi_square: f64,
    /// Points minus coefficients.
    pub degrees_of_freedom: usize,
    /// Largest residual in standard deviations.
    pub largest_residual: f64,
}

impl PointFit {
    /// Standard deviation of the polynomial's value at `x` from the covariance.
    pub fn sigma_at(&self, basis: &Basis, x: f64) -> f64 {
        let row: Vec<f64> = basis
            .monomials_at(Wide::from(x))
            .iter()
            .map(|v| v.hi)
            .collect();
        let mut sum = 0.0;
        for (a, line) in row.iter().zip(&self.covariance) {
            for (b, c) in row.iter().zip(line) {
                sum += a * b * c;
            }
        }
        sum.max(0.0).sqrt()
    }
}

/// Fits `y` at `x` with standard deviations `sigma` (same unit as `y`): normal equations in Chebyshev
/// functions with some 32 digits, so that squaring the condition costs nothing.
///
/// Refused: lengths that differ, numbers that are not finite, sigma <= 0, no more different places than
/// coefficients.
pub fn fit_points(x: &[f64], y: &[f64], sigma: &[f64], basis: &Basis) -> Result<PointFit> {
    let samples = Samples::measured(basis, x, y, sigma)?;
    let functions = Chebyshev::new(basis, samples.low, samples.high);
    let n = basis.len();
    let mut normal = vec![vec![Wide::ZERO; n]; n];
    let mut right = vec![Wide::ZERO; n];
    for p in &samples.points {
        let row = functions.at(p.x);
        let weight = Wide::product(p.weight, p.weight);
        for i in 0..n {
            let v = row[i] * weight;
            right[i] += v * p.value;
            for j in 0..n {
                normal[i][j] += v * row[j];
            }
        }
    }
    let singular = || InputError::new("the points do not determine the polynomial");
    let solution = exchange::solve(normal.clone(), right).ok_or_else(singular)?;
    // T N^-1 T^t, T the map to monomials.
    let map = |k: usize| -> Vec<Wide> {
        let mut unit = vec![Wide::ZERO; n];
        unit[k] = Wide::ONE;
        functions.to_monomials(&unit)
    };
    let columns: Vec<Vec<Wide>> = (0..n).map(map).collect();
    let mut covariance = Vec::with_capacity(n);
    for i in 0..n {
        let row: Vec<Wide> = columns.iter().map(|c| c[i]).collect();
        let half = exchange::solve(normal.clone(), row).ok_or_else(singular)?;
        let entry = |j: usize| {
            let other: Vec<Wide> = columns.iter().map(|c| c[j]).collect();
            dot(&half, &other).hi
        };
        covariance.push((0..n).map(entry).collect());
    }
    let coefficients = functions.to_monomials(&solution);
    let residuals = samples.errors(&coefficients);
    Ok(PointFit {
        coefficients,
        covariance,
        chi_square: residuals.iter().map(|r| r * r).sum(),
        degrees_of_freedom: residuals.len().saturating_sub(n),
        largest_residual: residuals.iter().fold(0.0, |m, r| m.max(r.abs())),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::approx::minimax::{Monomials, minimax};

    /// A line through three points, by hand: x = -1, 0, 1, y = 0, 1, 5, sigma 1, 1, 1:
    /// intercept 2, slope 5/2, variances 1/3 and 1/2.
    #[test]
    fn a_line_by_hand() {
        let basis = Basis::new(Monomials::All, 1).unwrap();
        let fit = fit_points(&[-1.0, 0.0, 1.0], &[0.0, 1.0, 5.0], &[1.0; 3], &basis).unwrap();
        assert!((fit.coefficients[0].hi - 2.0).abs() < 1e-14);
        assert!((fit.coefficients[1].hi - 2.5).abs() < 1e-14);
        assert!((fit.covariance[0][0] - 1.0 / 3.0).abs() < 1e-14);
        assert!((fit.covariance[1][1] - 0.5).abs() < 1e-14);
        assert!(fit.covariance[0][1].abs() < 1e-14);
        assert!((fit.chi_square - 1.5).abs() < 1e-13);
        assert!((fit.sigma_at(&basis, 2.0) - (1.0f64 / 3.0 + 2.0).sqrt()).abs() < 1e-14);
    }

    /// Weights count: a point with a tenth of the deviation counts a hundred times.
    #[test]
    fn weights_and_minimax_of_points() {
        let basis = Basis::new(Monomials::All, 0).unwrap();
        let fit = fit_points(&[0.0, 1.0], &[0.0, 1.0], &[0.1, 1.0], &basis).unwrap();
        assert!((fit.coefficients[0].hi - 1.0 / 101.0).abs() < 1e-15);
        let samples =
            Samples::measured(&basis, &[0.0, 0.5, 1.0], &[0.0, 0.7, 1.0], &[1.0; 3]).unwrap();
        let best = minimax(&samples).unwrap();
        assert!((best.coefficients[0].hi - 0.5).abs() < 1e-15 && best.converged);
    }

    #[test]
    fn nonsense_is_refused() {
        let basis = Basis::new(Monomials::Odd, 3).unwrap();
        let y = [1.0; 4];
        assert!(fit_points(&[-2.0, -1.0, 1.0, 2.0], &y, &y, &basis).is_err());
        assert!(fit_points(&[1.0, 2.0, 3.0], &y, &y, &basis).is_err());
        assert!(fit_points(&[1.0, 2.0, 3.0, f64::NAN], &y, &y, &basis).is_err());
        assert!(fit_points(&[1.0, 2.0, 3.0, 4.0], &y, &[0.0; 4], &basis).is_err());
    }
}
