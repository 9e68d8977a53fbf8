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
    /// tau^2 of each channel, samples squared; not below 0.
    pub jitter: [f64; 2],
    /// Standard deviations of them.
    pub std: [f64; 2],
    /// One instant for both channels.
    pub is_common: bool,
    /// Gain in log-likelihood, what its form costs beyond a common one taken off.
    pub gain: f64,
}

/// Instants that are random: of both channels by the same deviation, of one channel, of each by its own. Of a form, the column
/// of each channel's slope squared.
const FORMS: [[Option<usize>; 2]; 4] = [
    [Some(0), Some(0)],
    [Some(0), None],
    [None, Some(0)],
    [Some(0), Some(1)],
];
/// What one channel's alone gives away, nats: both converters mostly have one clock.
const ALONE: f64 = 2.0;

/// Mean square of the residual at a phase of a channel, and what it is made of.
struct Point {
    channel: usize,
    value: f64,
    variance: f64,
    slope2: f64,
    wave: f64,
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

    /// Weighted least squares of r^2 on 1, slope^2 and, with little noise, the quantiser's wave, in the form of
    /// `FORMS` that gains most; `column` is what a free value costs.
    pub fn fit(&self, variances: [f64; 2], column: f64) -> Option<Found> {
        let points = self.points(variances);
        let with_wave = variances.iter().any(|v| *v < 0.5);
        let costs = [0.0, ALONE, ALONE, ALONE + column];
        let found = FORMS.iter().zip(costs).filter_map(|(form, cost)| {
            let found = fit_form(&points, form, with_wave)?;
            Some(Found {
                gain: found.gain - cost,
                ..found
            })
        });
        found.max_by(|a, b| a.gain.total_cmp(&b.gain))
    }

    fn points(&self, variances: [f64; 2]) -> Vec<Point> {
        let mut points = Vec::new();
        for (channel, bins) in self.bins.iter().enumerate() {
            for [n, r, r2, r4, slope2, wave] in bins {
                if *n < 8.0 {
                    continue;
                }
                let (mean, square) = (r / n, r2 / n);
                let value = (square - mean * mean) * n / (n - 1.0);
                let spread = (r4 / n - square * square).max(2.0 * value * value / 3.0);
                let prior = 2.0 * variances[channel] * variances[channel];
                points.push(Point {
                    channel,
                    value,
                    // Few rows do not tell their own spread.
                    variance: (spread * n + 30.0 * prior) / (n + 30.0) / n,
                    slope2: slope2 / n,
                    wave: wave / n,
                });
            }
        }
        points
    }

    /// Mean squares of the channels' noise without the jitter, given it. A mean square is known to a share of itself:
    /// weights one over the square of what is expected of it, or, where the slope is steep, a jitter that is a few per
    /// cent off would be most of what is left.
    pub fn base(&self, jitter: [f64; 2]) -> [f64; 2] {
        [0, 1].map(|c: usize| {
            let jitter = jitter[c];
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
    pub fn likelihood(&self, base: [f64; 2], jitter: [f64; 2]) -> f64 {
        let mut sum = 0.0;
        for ((bins, base), jitter) in self.bins.iter().zip(base).zip(jitter) {
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

/// Least squares with the slopes squared in one or two columns.
fn fit_form(points: &[Point], form: &[Option<usize>; 2], with_wave: bool) -> Option<Found> {
    let slopes = form.iter().flatten().max()? + 1;
    let of = |p: &Point, column: usize| form[p.channel] == Some(column);
    let scales: Vec<f64> = (0..slopes)
        .map(|k| {
            points
                .iter()
                .filter(|p| of(p, k))
                .map(|p| p.slope2)
                .fold(0.0, f64::max)
        })
        .collect();
    if scales.iter().any(|s| *s <= 0.0) || points.len() < 24 {
        return None;
    }
    let row = |p: &Point| {
        let own = |c: usize| f64::from(u8::from(p.channel == c));
        let wave = |c: usize| if with_wave { own(c) * p.wave } else { 0.0 };
        let slope = |k: usize| if of(p, k) { p.slope2 / scales[k] } else { 0.0 };
        let fixed = [own(0), own(1), wave(0), wave(1)];
        nalgebra::DVector::from_iterator(
            4 + slopes,
            fixed.into_iter().chain((0..slopes).map(slope)),
        )
    };
    let mut sums = nalgebra::DMatrix::<f64>::identity(4 + slopes, 4 + slopes) * 1e-12;
    let mut right = nalgebra::DVector::<f64>::zeros(4 + slopes);
    for p in points {
        let row = row(p);
        right.axpy(p.value / p.variance, &row, 1.0);
        sums.ger(1.0 / p.variance, &row, &row, 1.0);
    }
    // Without the wave its two columns are empty: a prior holds them at 0.
    for k in 2..4 {
        sums[(k, k)] += 1e-9 * (sums[(0, 0)] + sums[(1, 1)]);
    }
    let inverse = sums.try_inverse()?;
    let solved = &inverse * right;
    let misfit = |p: &Point| (p.value - row(p).dot(&solved)).powi(2) / p.variance;
    let degrees = points.len() as f64 - 4.0 - slopes as f64;
    let excess = (points.iter().map(misfit).sum::<f64>() / degrees).max(1.0);
    let covariance = inverse.view((4, 4), (slopes, slopes)) * excess;
    let values = solved.rows(4, slopes).map(|v| v.max(0.0));
    let weighed = covariance.clone().try_inverse()? * &values;
    let mut found = Found {
        jitter: [0.0; 2],
        std: [0.0; 2],
        is_common: form[0] == form[1],
        gain: 0.5 * values.dot(&weighed),
    };
    for (channel, column) in form.iter().enumerate() {
        if let Some(k) = *column {
            found.jitter[channel] = values[k] / scales[k];
            found.std[channel] = covariance[(k, k)].sqrt() / scales[k];
        }
    }
    Some(found)
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
        let base = squares.base([0.94 * lost / angle.powi(2); 2])[0];
        // Noise, rounding, and what the bend of the tone at its peaks makes of the random instant.
        let exact = 0.4f64.powi(2) + 1.0 / 12.0 + 0.5 * (lost * AMPLITUDE).powi(2);
        assert!((base / exact - 1.0).abs() < 0.15, "{base} {exact}");
    }

    #[test]
    fn an_instant_is_random_in_the_channels_in_which_it_is() {
        let fit = |jitter: [f64; 2]| {
            let mut points = Vec::new();
            for (channel, jitter) in jitter.into_iter().enumerate() {
                for k in 0..BINS {
                    let slope2 = 90.0 * (TAU * k as f64 / BINS as f64).cos().powi(2);
                    let value = 0.5 + jitter * slope2;
                    let ripple = 1.0 + 0.02 * (2.4 * k as f64).sin();
                    let variance = 2.0 * value * value / 300.0;
                    points.push(Point {
                        channel,
                        value: value * ripple,
                        variance,
                        slope2,
                        wave: 0.0,
                    });
                }
            }
            let found = FORMS
                .iter()
                .map(|form| fit_form(&points, form, false).unwrap());
            found.map(|f| (f.gain, f.jitter)).collect::<Vec<_>>()
        };
        // Of the drive alone: that form gains as much as one of each, and more than a common one.
        let [common, drive, sense, own] = fit([0.01, 0.0]).try_into().unwrap();
        assert!(drive.0 > common.0 + 20.0 && drive.0 > sense.0 + 100.0 && own.0 < drive.0 + 1.0);
        assert!(
            (drive.1[0] / 0.01 - 1.0).abs() < 0.05 && drive.1[1] == 0.0,
            "{drive:?}"
        );
        // Of both by one clock.
        let [common, drive, _, own] = fit([0.01, 0.01]).try_into().unwrap();
        assert!(
            common.0 > drive.0 + 20.0 && own.0 < common.0 + 1.0,
            "{common:?} {own:?}"
        );
        // Each its own.
        let [common, _, _, own] = fit([0.04, 0.005]).try_into().unwrap();
        assert!(own.0 > common.0 + 20.0);
        assert!((own.1[1] / 0.005 - 1.0).abs() < 0.1, "{own:?}");
    }
}
