//! `aperture_jitter`: each sample is taken a random time late, tau rms. The mean does not change (but for
//! a factor 1 - (w tau)^2 / 2 of the tone); the variance is a + tau^2 slope^2.
//!
//! The residual squared is gathered by phase, after its mean at each phase is taken off, so that no bend or
//! latency passes for it. Its spread at each phase gives the weights, whatever the noise's shape.

use super::columns::{Model, Rows, chunks};
use super::input::{Capture, Part};
use std::f64::consts::TAU;

/// Phases.
const BINS: usize = 64;

/// Sums at a phase: rows, r, r^2, r^4, slope^2, cos(2 pi signal).
type Sums = [f64; 6];

/// The residual's squares by phase, of one part of the rows.
#[derive(Debug, Clone)]
pub struct Squares {
    bins: [Vec<Sums>; 2],
}

/// The fit of the variance.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Found {
    /// tau^2, samples squared; not below 0.
    pub jitter: f64,
    /// Standard deviation of it.
    pub std: f64,
    /// Gain in log-likelihood.
    pub gain: f64,
}

impl Squares {
    /// Of residuals (all rows) at the training or the held-out rows.
    pub fn of(capture: &Capture, model: &Model, residuals: [&[f64]; 2], held_out: bool) -> Self {
        let zero = || vec![[0.0; 6]; BINS];
        let mut bins = [zero(), zero()];
        let mut rows = Rows::new();
        let wanted = |p: Part| (p == Part::HeldOut) == held_out;
        for segment in capture.segments.iter().filter(|s| wanted(s.part)) {
            for chunk in chunks(segment.rows.clone()) {
                let start = chunk.start;
                let n = chunk.len();
                rows.fill(capture, model, chunk);
                for (channel, bins) in bins.iter_mut().enumerate() {
                    for i in (0..n).filter(|i| rows.weight[channel][*i] > 0.0) {
                        let phase = model.tone.phase(start + i);
                        let r = residuals[channel].get(start + i).copied().unwrap_or(0.0);
                        let slope = rows.slope[channel][i];
                        let wave = (TAU * rows.signal[channel][i].fract()).cos();
                        let at = (phase * BINS as f64) as usize % BINS;
                        let values = [1.0, r, r * r, r.powi(4), slope * slope, wave];
                        for (sum, v) in bins[at].iter_mut().zip(values) {
                            *sum += v;
                        }
                    }
                }
            }
        }
        Squares { bins }
    }

    /// Weighted least squares of r^2 on 1, slope^2 and, with little noise, the quantiser's wave.
    pub fn fit(&self, variances: [f64; 2]) -> Option<Found> {
        let mut points: Vec<(usize, f64, f64, f64, f64)> = Vec::new();
        for (channel, bins) in self.bins.iter().enumerate() {
            for [n, r, r2, r4, slope2, wave] in bins {
                if *n < 8.0 {
                    continue;
                }
                let (mean, square) = (r / n, r2 / n);
                let value = (square - mean * mean) * n / (n - 1.0);
                let spread = (r4 / n - square * square).max(2.0 * value * value / 3.0);
                let prior = 2.0 * variances[channel] * variances[channel];
                // Few rows do not tell their own spread.
                let variance = (spread * n + 30.0 * prior) / (n + 30.0) / n;
                points.push((channel, value, variance, slope2 / n, wave / n));
            }
        }
        let with_wave = variances.iter().any(|v| *v < 0.5);
        let columns = |p: &(usize, f64, f64, f64, f64)| {
            let own = |c: usize| if p.0 == c { 1.0 } else { 0.0 };
            let wave = |c: usize| if with_wave { own(c) * p.4 } else { 0.0 };
            [own(0), own(1), wave(0), wave(1), p.3]
        };
        let mut sums = nalgebra::SMatrix::<f64, 5, 5>::identity() * 1e-12;
        let mut right = nalgebra::SVector::<f64, 5>::zeros();
        let scale = points.iter().map(|p| p.3).fold(0.0, f64::max);
        if scale <= 0.0 || points.len() < 24 {
            return None;
        }
        let row = |p: &(usize, f64, f64, f64, f64)| {
            let mut row = nalgebra::SVector::<f64, 5>::from(columns(p));
            row[4] /= scale;
            row
        };
        for p in &points {
            sums += row(p) * row(p).transpose() / p.2;
            right += row(p) * (p.1 / p.2);
        }
        // Without the wave its two columns are empty: a prior holds them at 0.
        for k in 2..4 {
            sums[(k, k)] += 1e-9 * (sums[(0, 0)] + sums[(1, 1)]);
        }
        let inverse = sums.try_inverse()?;
        let solved = inverse * right;
        let misfit = |p: &(usize, f64, f64, f64, f64)| (p.1 - row(p).dot(&solved)).powi(2) / p.2;
        let excess = points.iter().map(misfit).sum::<f64>() / (points.len() as f64 - 5.0);
        let std = (inverse[(4, 4)] * excess.max(1.0)).sqrt();
        let z = (solved[4] / std).max(0.0);
        Some(Found {
            jitter: solved[4].max(0.0) / scale,
            std: std / scale,
            gain: 0.5 * z * z,
        })
    }

    /// Mean squares of the channels' noise without the jitter, given it.
    pub fn base(&self, jitter: f64) -> [f64; 2] {
        [0, 1].map(|c: usize| {
            let (mut n, mut sum) = (0.0, 0.0);
            for [count, r, r2, _, slope2, _] in &self.bins[c] {
                if *count > 1.0 {
                    // Where the slope is steep the difference is uncertain.
                    let weight =
                        1.0 / (1.0 + jitter * slope2 / count / 0.01f64.max(r2 / count)).powi(2);
                    n += weight * count;
                    sum += weight * (r2 - r * r / count - jitter * slope2);
                }
            }
            if n > 0.0 { (sum / n).max(0.0) } else { 0.0 }
        })
    }

    /// Log-likelihood of Gaussian noise with these variances.
    pub fn likelihood(&self, base: [f64; 2], jitter: f64) -> f64 {
        let mut sum = 0.0;
        for (bins, base) in self.bins.iter().zip(base) {
            for [n, _, r2, _, slope2, _] in bins {
                if *n > 0.0 {
                    let v = (base + jitter * slope2 / n).max(1e-9);
                    sum -= 0.5 * (n * v.ln() + r2 / v);
                }
            }
        }
        sum
    }
}
