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
/// Times that the noise is fitted with the weights that it gives.
const BASE_TURNS: usize = 5;

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

    /// Mean squares of the channels' noise without the jitter, given it. A mean square is known to a share of itself:
    /// weights one over the square of what is expected of it, or, where the slope is steep, a jitter that is a few per
    /// cent off would be most of what is left.
    pub fn base(&self, jitter: f64) -> [f64; 2] {
        [0, 1].map(|c: usize| {
            let mut base = 0.0;
            for turn in 0..BASE_TURNS {
                let (mut n, mut sum) = (0.0, 0.0);
                for [count, r, r2, _, slope2, _] in self.bins[c].iter().filter(|b| b[0] > 1.0) {
                    let late = jitter * slope2 / count;
                    let expected = match turn {
                        0 => r2 / count + late,
                        _ => base + late,
                    };
                    let weight = expected.max(0.01).powi(-2);
                    n += weight * count;
                    sum += weight * (r2 - r * r / count - jitter * slope2);
                }
                base = if n > 0.0 { (sum / n).max(0.0) } else { 0.0 };
            }
            base
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

#[cfg(test)]
mod tests {
    use super::super::columns::{COS, SIN};
    use super::super::synthetic::{AMPLITUDE, Made, model};
    use super::*;

    #[test]
    fn the_noise_beside_a_strong_jitter_is_that_of_the_peaks() {
        let made = Made {
            rows: 40_000,
            word: 0x0200_5679,
            noise: 0.4,
            jitter: 2.0,
            ..Made::CLEAN
        };
        let capture = made.capture();
        let (_, model) = model(&capture, &made);
        let angle = model.tone.angle();
        let lost = 1.0 - (-(made.jitter * angle).powi(2)).exp();
        let residual = |channel: usize, left: f64| -> Vec<f64> {
            let at = |k: usize| model.declared[channel][k - SIN] + model.coefficients[channel][k];
            let tone = |row: usize| {
                let (sin, cos) = model.phases.at(row);
                left * (at(SIN) * sin + at(COS) * cos)
            };
            let codes = capture.codes[channel].iter().enumerate();
            codes.map(|(row, c)| f64::from(*c) - tone(row)).collect()
        };
        let [drive, sense] = [residual(0, (1.0 - lost).sqrt()), residual(1, 1.0)];
        let squares = Squares::of(&capture, &model, [&drive, &sense], false);
        // A jitter some per cent too small, as the rows leave it open.
        let base = squares.base(0.94 * lost / angle.powi(2))[0];
        // Noise, rounding, and what the bend of the tone at its peaks makes of the random instant.
        let exact = 0.4f64.powi(2) + 1.0 / 12.0 + 0.5 * (lost * AMPLITUDE).powi(2);
        assert!((base / exact - 1.0).abs() < 0.15, "{base} {exact}");
    }
}
