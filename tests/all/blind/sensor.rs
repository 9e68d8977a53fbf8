//! Noise like a real sensor's: spectrum, lines, spikes and level steps estimated from a series, and made anew by seed.
//!
//! All sizes are relative to the short-term noise (rms of the first differences over the square root of 2), all
//! frequencies in cycles a row: a record takes up a sensor's noise row by row, whatever its period.

use super::dice::Dice;
use super::linear::{least_squares, rms};
use crate::rng::Rng;
use rustfft::FftPlanner;
use rustfft::num_complex::Complex;
use std::f64::consts::TAU;

/// What a series is like, without the series.
#[derive(Clone, Debug, PartialEq)]
pub struct SensorNoise {
    pub name: String,
    /// (cycles a row, power relative to the mean over all frequencies), rising in frequency; constant beyond its ends.
    pub density: Vec<(f64, f64)>,
    /// (cycles a row, amplitude).
    pub lines: Vec<(f64, f64)>,
    /// Share of rows, and typical size.
    pub spikes: (f64, f64),
    /// Level steps a row, and typical size.
    pub steps: (f64, f64),
}

/// Noise of a record's rows.
pub struct Made {
    pub values: Vec<f64>,
    pub spike: Vec<bool>,
}

/// Median of the finite values; 0 for none.
pub fn median(v: &[f64]) -> f64 {
    let mut sorted: Vec<f64> = v.iter().copied().filter(|x| x.is_finite()).collect();
    sorted.sort_by(f64::total_cmp);
    sorted.get(sorted.len() / 2).copied().unwrap_or(0.0)
}

/// Standard deviation by the median of the absolute values (zero mean assumed).
fn spread(v: &[f64]) -> f64 {
    1.4826 * median(&v.iter().map(|x| x.abs()).collect::<Vec<_>>())
}

/// Spectrum of `v` under a Hann window: power a bin for bins 1 to n/2 - 1, mean 1 for unit white noise.
fn periodogram(v: &[f64]) -> Vec<f64> {
    let n = v.len();
    let mean = v.iter().sum::<f64>() / n as f64;
    let window: Vec<f64> = (0..n)
        .map(|k| 0.5 - 0.5 * (TAU * (k as f64 + 0.5) / n as f64).cos())
        .collect();
    let power: f64 = window.iter().map(|w| w * w).sum();
    let mut x: Vec<Complex<f64>> = v
        .iter()
        .zip(&window)
        .map(|(v, w)| Complex::new((v - mean) * w, 0.0))
        .collect();
    FftPlanner::new().plan_fft_forward(n).process(&mut x);
    x[1..n / 2].iter().map(|c| c.norm_sqr() / power).collect()
}

/// Means of the periodogram over bands that grow by 40 % (at least two bins).
fn bands(power: &[f64], n: usize) -> Vec<(f64, f64)> {
    let (mut out, mut first) = (Vec::new(), 0);
    while first < power.len() {
        let last = ((first + 1) * 7 / 5).clamp(first + 2, power.len().max(first + 2));
        let these = &power[first..last.min(power.len())];
        let middle = (first + 1) as f64 + 0.5 * (these.len() - 1) as f64;
        let mean = these.iter().sum::<f64>() / these.len() as f64;
        out.push((middle / n as f64, mean));
        first = last;
    }
    out
}

impl SensorNoise {
    /// Estimates the noise of `series` (any unit), from which a polynomial of `degree` in `temperature` is taken first.
    /// None for fewer than 100 rows or a series that stands still.
    pub fn estimate(name: &str, series: &[f64], temperature: &[f64], degree: i32) -> Option<Self> {
        let n = series.len();
        if n < 100 {
            return None;
        }
        let u = super::linear::centred(temperature);
        let columns: Vec<Vec<f64>> = (0..=degree)
            .map(|d| u.iter().map(|x| x.powi(d)).collect())
            .collect();
        let k = least_squares(&columns, series);
        let mut left: Vec<f64> = (0..n)
            .map(|row| series[row] - columns.iter().zip(&k).map(|(c, k)| c[row] * k).sum::<f64>())
            .collect();
        let around = |v: &[f64], row: usize, wide: usize| {
            median(&v[row.saturating_sub(wide)..(row + wide + 1).min(v.len())])
        };
        let high: Vec<f64> = (0..n).map(|k| left[k] - around(&left, k, 2)).collect();
        let limit = 7.0 * spread(&high).max(0.3 * rms(&high));
        let hit: Vec<usize> = (0..n).filter(|k| high[*k].abs() > limit).collect();
        let spike_size = median(&hit.iter().map(|k| high[*k].abs()).collect::<Vec<_>>());
        hit.iter().for_each(|k| left[*k] -= high[*k]);
        let steps = take_steps(&mut left);
        let mut power = periodogram(&left);
        let lines = take_lines(&mut power, n);
        let density = bands(&power, n);
        let unit = short_term(&density);
        if unit <= 0.0 || !unit.is_finite() {
            return None;
        }
        let mean_step = median(&steps.iter().map(|s| s.abs()).collect::<Vec<_>>());
        Some(Self {
            name: name.to_owned(),
            density: density
                .iter()
                .map(|(f, p)| (*f, p / (unit * unit)))
                .collect(),
            lines: lines.iter().map(|(f, a)| (*f, a / unit)).collect(),
            spikes: (hit.len() as f64 / n as f64, spike_size / unit),
            steps: (steps.len() as f64 / n as f64, mean_step / unit),
        })
    }

    /// The family that stands in where no series is at hand: white with 1/f^a (a 0.8 to 1.6) below a corner at 0.01 to
    /// 0.2 cycles a row, up to two lines, now and then spikes and steps.
    pub fn stand_in(rng: &mut Rng) -> Self {
        let (corner, slope) = (rng.spread(0.01, 0.2), rng.between(0.8, 1.6));
        let density: Vec<(f64, f64)> = (0..25)
            .map(|k| 0.001 * 500f64.powf(f64::from(k) / 24.0))
            .map(|f| (f, 1.0 + (corner / f).powf(slope)))
            .collect();
        let unit = short_term(&density);
        let lines = (0..rng.range(0, 2)).map(|_| (rng.between(0.03, 0.47), rng.spread(0.3, 1.5)));
        Self {
            name: "stand_in".to_owned(),
            lines: lines.collect(),
            density: density
                .iter()
                .map(|(f, p)| (*f, p / (unit * unit)))
                .collect(),
            spikes: (if rng.odds(0.3) { 0.005 } else { 0.0 }, 12.0),
            steps: (if rng.odds(0.2) { 0.004 } else { 0.0 }, 2.0),
        }
    }

    /// Power at `f` cycles a row: straight between its points in logarithms.
    fn power(&self, f: f64) -> f64 {
        let d = &self.density;
        let after = d.partition_point(|p| p.0 < f);
        if after == 0 {
            return d[0].1;
        }
        if after == d.len() {
            return d[after - 1].1;
        }
        let ((f0, p0), (f1, p1)) = (d[after - 1], d[after]);
        let x = (f / f0).ln() / (f1 / f0).ln();
        (p0.max(1e-12).ln() * (1.0 - x) + p1.max(1e-12).ln() * x).exp()
    }

    /// `n` rows at short-term noise `sigma`: Gaussian with the spectrum (random phases and sizes over twice the length),
    /// lines at random phases with frequencies up to 5 % off, spikes and steps by chance.
    pub fn make(&self, n: usize, sigma: f64, rng: &mut Rng) -> Made {
        let all = (2 * n).next_power_of_two();
        let mut x = vec![Complex::new(0.0, 0.0); all];
        for k in 1..all / 2 {
            let size = (0.5 * self.power(k as f64 / all as f64) * all as f64).sqrt();
            x[k] = Complex::new(size * rng.gauss(), size * rng.gauss());
            x[all - k] = x[k].conj();
        }
        FftPlanner::new().plan_fft_inverse(all).process(&mut x);
        let mut values: Vec<f64> = x[..n].iter().map(|c| c.re / all as f64).collect();
        for (f, amplitude) in &self.lines {
            let (f, lead) = ((f * rng.between(0.95, 1.05)).min(0.49), rng.unit());
            (0..n).for_each(|k| values[k] += amplitude * (TAU * (f * k as f64 + lead)).sin());
        }
        let mut level = 0.0;
        let mut spike = vec![false; n];
        for k in 0..n {
            if rng.odds(self.steps.0) {
                level += rng.sign() * self.steps.1 * rng.between(0.7, 1.5);
            }
            values[k] += level;
            if rng.odds(self.spikes.0) {
                spike[k] = true;
                values[k] += rng.sign() * self.spikes.1 * rng.between(0.8, 2.0);
            }
        }
        values.iter_mut().for_each(|v| *v *= sigma);
        Made { values, spike }
    }

    /// The t statistic that an informed fit has for a contribution (orthogonal to the declared model) in this noise:
    /// its spectrum over the noise's.
    pub fn significance(&self, contribution: &[f64], sigma: f64) -> f64 {
        let n = contribution.len();
        let mut x: Vec<Complex<f64>> = contribution
            .iter()
            .map(|c| Complex::new(c / sigma, 0.0))
            .collect();
        FftPlanner::new().plan_fft_forward(n).process(&mut x);
        let weigh = |(k, c): (usize, &Complex<f64>)| {
            let f = k.min(n - k).max(1) as f64 / n as f64;
            c.norm_sqr() / (n as f64 * self.power(f))
        };
        x.iter().enumerate().map(weigh).sum::<f64>().sqrt()
    }
}

/// rms of first differences over the square root of 2 for a density over 0 to 1/2 cycles a row.
fn short_term(density: &[(f64, f64)]) -> f64 {
    let (mut sum, mut width) = (0.0, 0.0);
    for (k, (f, p)) in density.iter().enumerate() {
        let low = if k == 0 {
            0.0
        } else {
            0.5 * (density[k - 1].0 + f)
        };
        let high = density.get(k + 1).map_or(0.5, |next| 0.5 * (next.0 + f));
        sum += p * (1.0 - (TAU * f).cos()) * (high - low);
        width += high - low;
    }
    (sum / width).sqrt()
}

/// Takes level steps out of a series: where medians of eight rows before and after differ by six times what they usually do.
fn take_steps(left: &mut [f64]) -> Vec<f64> {
    const WIDE: usize = 8;
    let n = left.len();
    let change: Vec<f64> = (0..n)
        .map(|k| {
            if k < WIDE || k + WIDE > n {
                0.0
            } else {
                median(&left[k..k + WIDE]) - median(&left[k - WIDE..k])
            }
        })
        .collect();
    let limit = 6.0 * spread(&change);
    let mut out = Vec::new();
    let mut k = 0;
    while k < n {
        if change[k].abs() > limit && limit > 0.0 {
            let end = (k + WIDE).min(n);
            let at = (k..end)
                .max_by(|a, b| change[*a].abs().total_cmp(&change[*b].abs()))
                .unwrap_or(k);
            out.push(change[at]);
            left[at..].iter_mut().for_each(|v| *v -= change[at]);
            k = at + WIDE;
        }
        k += 1;
    }
    out
}

/// Takes lines out of a periodogram: bins with fifteen times the median of the two dozen around them.
fn take_lines(power: &mut [f64], n: usize) -> Vec<(f64, f64)> {
    let mut out = Vec::new();
    for _ in 0..6 {
        let around = |k: usize| median(&power[k.saturating_sub(12)..(k + 13).min(power.len())]);
        let over = |k: &usize| power[*k] / around(*k).max(1e-300);
        let candidates = (4..power.len()).filter(|k| over(k) > 15.0);
        let Some(k) = candidates.max_by(|a, b| over(a).total_cmp(&over(b))) else {
            break;
        };
        // A sine of amplitude a gives n a^2 / 6 in its bin under a Hann window.
        out.push((
            (k + 1) as f64 / n as f64,
            (6.0 * power[k] / n as f64).sqrt(),
        ));
        // The median of an exponential distribution is ln 2 times its mean.
        let floor = around(k) / 2f64.ln();
        (k.saturating_sub(2)..(k + 3).min(power.len())).for_each(|j| power[j] = floor);
    }
    out
}
