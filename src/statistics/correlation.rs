//! The noise of a fit's residuals, its memory, and what it does to the coefficients.
//!
//! Bias residuals are coloured: covariances that assume white noise are too small, often by an
//! order of magnitude. The model here is white noise plus an AR(1) part,
//! cov(r_i, r_j) = w [i = j] + b rho^|i - j|, taken from the residuals' own autocovariance; rows
//! count as evenly spaced. An effect that the polynomial lacks looks like noise with memory and
//! widens the intervals too, as it should.

use nalgebra::{DMatrix, DVector};

/// White noise plus AR(1), by rows.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct NoiseModel {
    /// Variance of the white part, (deg/s)^2.
    pub white: f64,
    /// Variance of the part with memory, (deg/s)^2.
    pub correlated: f64,
    /// Its correlation from one row to the next, 0..1.
    pub rho: f64,
    /// How many independent rows the record is worth.
    pub effective_rows: f64,
}

impl NoiseModel {
    /// From the residuals of a fit with `parameters` coefficients; rows whose weight is below 0.5
    /// (spikes) are skipped.
    ///
    /// b and rho minimise the squared misfit to the autocovariances of lags 1 to n/8 (at most
    /// 200). The part with memory is dropped if it explains no more of them than white
    /// noise would by chance (a chi-square of 9). Both variances are raised for what the fit took
    /// away: by n / (n - parameters), with the effective number of rows for the part with memory.
    pub fn of_residuals(residuals: Vec<f64>, weights: &[f64], parameters: usize) -> Self {
        let is_clean = |i: usize| weights.get(i).is_none_or(|w| *w >= 0.5);
        let mut clean = residuals;
        let rows = clean.iter_mut().enumerate();
        rows.filter(|(i, _)| !is_clean(*i))
            .for_each(|(_, r)| *r = 0.0);
        let all = (0..clean.len()).all(is_clean);
        let autocovariance = |lag: usize| {
            let later = clean.get(lag..).unwrap_or(&[]);
            let sum: f64 = clean.iter().zip(later).map(|(a, b)| a * b).sum();
            let count = match all {
                true => later.len(),
                false => {
                    let pairs = 0..later.len();
                    pairs.filter(|i| is_clean(*i) && is_clean(i + lag)).count()
                }
            } as f64;
            (sum / count.max(1.0), count)
        };
        let (total, n) = autocovariance(0);
        let mut model = NoiseModel {
            white: total * n / (n - parameters as f64).max(1.0),
            correlated: 0.0,
            rho: 0.0,
            effective_rows: n,
        };
        let lags = (clean.len() / 8).clamp(1, 200);
        let c: Vec<f64> = (1..=lags).map(|k| autocovariance(k).0).collect();
        let mut best = (0.0, 0.0, 0.0);
        for step in 1..200 {
            // Memory from less than a row to 200 rows, evenly in 1 / (1 - rho).
            let rho = 1.0 - (200f64).powf(-f64::from(step) / 200.0);
            let (mut cross, mut norm, mut power) = (0.0, 0.0, 1.0);
            for c in &c {
                power *= rho;
                cross += c * power;
                norm += power * power;
            }
            let b = (cross / norm).clamp(0.0, total);
            // The misfit that b takes away; b may have been clipped.
            let gain = b * (2.0 * cross - b * norm);
            if gain > best.0 {
                best = (gain, b, rho);
            }
        }
        let (gain, b, rho) = best;
        if total > 0.0 && gain * n / (total * total) > 9.0 {
            let inflation = 1.0 + 2.0 * (b / total) * rho / (1.0 - rho);
            model.effective_rows = (n / inflation).max(1.0);
            let lost = model.effective_rows / (model.effective_rows - parameters as f64).max(1.0);
            // Half of the effective rows gone to parameters: all that is known is that it is bad.
            model.correlated = b * lost.clamp(1.0, 3.0);
            model.white = (total - b) * n / (n - parameters as f64).max(1.0);
            model.rho = rho;
        }
        model
    }

    /// The variance of the mean of `n` rows in a row, (deg/s)^2.
    pub fn variance_of_mean(&self, n: usize) -> f64 {
        let m = n.max(1) as f64;
        let r = self.rho;
        // sum over i, j of rho^|i-j| in closed form.
        let pairs = if r > 0.0 {
            m * (1.0 + r) / (1.0 - r) - 2.0 * r * (1.0 - r.powf(m)) / (1.0 - r).powi(2)
        } else {
            m
        };
        (self.white * m + self.correlated * pairs) / (m * m)
    }
}

/// A least-squares problem's matrix A, a row a reading, of which a row is made whenever it is needed: as a whole it
/// would be many times the record.
#[derive(Debug, Clone, Copy)]
pub struct Rows<F> {
    /// How many.
    pub count: usize,
    /// Values of a row.
    pub columns: usize,
    /// Fills in a row.
    pub row: F,
}

impl<F: Fn(usize, &mut [f64])> Rows<F> {
    /// Each row with its number and its weight.
    fn each(&self, weights: &[f64], mut take: impl FnMut(usize, f64, &[f64])) {
        let mut row = vec![0.0; self.columns];
        for (i, w) in weights.iter().enumerate().take(self.count) {
            (self.row)(i, &mut row);
            take(i, *w, &row);
        }
    }

    /// A' W A.
    fn normal(&self, weights: &[f64]) -> DMatrix<f64> {
        let mut normal = DMatrix::zeros(self.columns, self.columns);
        self.each(weights, |_, w, row| {
            for (k, a) in row.iter().enumerate() {
                for (j, b) in row.iter().enumerate().take(k + 1) {
                    normal[(k, j)] += w * a * b;
                }
            }
        });
        normal.fill_upper_triangle_with_lower_triangle();
        normal
    }

    /// A' W v.
    fn score(&self, weights: &[f64], v: &[f64]) -> DVector<f64> {
        let mut score = DVector::zeros(self.columns);
        self.each(weights, |i, w, row| {
            let scaled = w * v[i];
            for (sum, a) in score.iter_mut().zip(row) {
                *sum += scaled * a;
            }
        });
        score
    }

    /// A v.
    pub fn times(&self, v: &DVector<f64>) -> Vec<f64> {
        let mut product = Vec::with_capacity(self.count);
        let mut row = vec![0.0; self.columns];
        for i in 0..self.count {
            (self.row)(i, &mut row);
            product.push(row.iter().zip(v.iter()).map(|(a, v)| a * v).sum());
        }
        product
    }

    /// The covariance of weighted least-squares coefficients under `noise`: H (A' W C W A) H with H = (A' W A)^-1,
    /// for the weights W. One row and column a column of A; zero where the weights do not determine the
    /// coefficients.
    pub fn covariance(&self, weights: &[f64], noise: &NoiseModel) -> DMatrix<f64> {
        let size = self.columns;
        let Some(normal) = self.normal(weights).cholesky() else {
            return DMatrix::zeros(size, size);
        };
        let inverse = normal.inverse();
        // With u_i the weighted row i and r_i = rho r_(i-1) + u_i: A' W C W A is the sum over i of
        // w u_i u_i' + b (u_i r_i' + r_i u_i' - u_i u_i').
        let mut middle = DMatrix::zeros(size, size);
        let mut weighted = DVector::zeros(size);
        let mut run = DVector::zeros(size);
        self.each(weights, |_, w, row| {
            for (u, a) in weighted.iter_mut().zip(row) {
                *u = w * a;
            }
            run *= noise.rho;
            run += &weighted;
            middle.ger(noise.white - noise.correlated, &weighted, &weighted, 1.0);
            middle.ger(noise.correlated, &weighted, &run, 1.0);
            middle.ger(noise.correlated, &run, &weighted, 1.0);
        });
        let full = &inverse * middle * &inverse;
        // Rounding leaves it a little asymmetric.
        (&full + full.transpose()) * 0.5
    }

    /// Weighted least squares by the normal equations, for a few well-scaled columns; `None` if the weights do not
    /// determine the coefficients.
    pub fn solve(&self, y: &[f64], weights: &[f64]) -> Option<DVector<f64>> {
        let normal = self.normal(weights);
        let scale = normal.diagonal().max();
        let factor = normal.cholesky()?;
        // Columns that are nearly combinations of others: no answer rather than a wild one.
        let least = factor.l_dirty().diagonal().min();
        if least * least < 1e-10 * scale {
            return None;
        }
        Some(factor.solve(&self.score(weights, y)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::thermal::synthetic::Random;

    #[test]
    fn the_covariance_is_that_of_the_matrices() {
        let noise = NoiseModel {
            white: 2.0,
            correlated: 3.0,
            rho: 0.7,
            effective_rows: 5.0,
        };
        let matrix = DMatrix::from_fn(5, 5, |i, j| {
            let white = if i == j { 2.0 } else { 0.0 };
            white + 3.0 * 0.7f64.powi(i.abs_diff(j) as i32)
        });
        let weights = [1.0, 0.5, 0.0, 2.0, 1.0];
        let row = |i: usize, row: &mut [f64]| {
            row.copy_from_slice(&[1.0, i as f64 - 1.5, ((i * i) as f64).sin()]);
        };
        let rows = Rows {
            count: 5,
            columns: 3,
            row,
        };
        let mut a = DMatrix::zeros(5, 3);
        let mut values = [0.0; 3];
        for i in 0..5 {
            row(i, &mut values);
            (0..3).for_each(|k| a[(i, k)] = values[k]);
        }
        let w = DMatrix::from_diagonal(&DVector::from_row_slice(&weights));
        let inverse = (a.transpose() * &w * &a).try_inverse().unwrap();
        let expected = &inverse * a.transpose() * &w * &matrix * &w * &a * &inverse;
        assert!((rows.covariance(&weights, &noise) - expected).amax() < 1e-12);
        let mean = matrix.mean();
        assert!((noise.variance_of_mean(5) - mean).abs() < 1e-12);
    }

    #[test]
    fn white_noise_and_noise_with_memory_are_told_apart() {
        let mut random = Random::new(1);
        let (mut named, mut rho, mut share) = (0, 0.0, 0.0);
        for _ in 0..100 {
            let white: Vec<f64> = (0..400).map(|_| random.normal()).collect();
            let model = NoiseModel::of_residuals(white, &[], 3);
            named += usize::from(model.correlated > 0.0);
            let coloured = random.coloured(400, 0.8);
            let model = NoiseModel::of_residuals(coloured, &[], 3);
            rho += model.rho / 100.0;
            share += model.correlated / 100.0;
        }
        assert!(
            named <= 10,
            "{named} of 100 white series were given a memory"
        );
        assert!((0.7..0.87).contains(&rho), "{rho}");
        assert!((0.8..1.3).contains(&share), "{share}");
    }
}
