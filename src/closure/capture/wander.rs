//! Slow noise of constant and tone: what a 1/f wander of the amplitude or of the offset leaves in their
//! means, so that it is not taken for an offset, a gain error or a latency.
//!
//! The residual is demodulated in blocks; of each series the cosine transform's modes j >= 1 have the
//! variance w + h / j, w by the white noise, h fitted. The mean itself, mode 0, is not looked at.

use super::columns::{COS, HARMONICS, ONE, SIN, harmonic};
use super::gram::Combo;
use super::spectrum::Spectrum;
use super::tone::{Phases, Tone};
use std::f64::consts::{PI, TAU};

/// Blocks at most; at least [`LEAST_BLOCKS`], or nothing is said.
const BLOCKS: usize = 64;
const LEAST_BLOCKS: usize = 8;

/// Block series of one channel: constant, sine, cosine.
#[derive(Debug, Clone)]
pub struct Series {
    /// By column ([`ONE`], [`SIN`], [`COS`]): the blocks' coefficients.
    pub values: [Vec<f64>; 3],
    /// Their white variances.
    pub white: [f64; 3],
}

/// Demodulates a residual (zero where rows are left out). `None`: too short for blocks.
pub fn series(residual: &[f64], variance: f64, tone: &Tone, phases: &Phases) -> Option<Series> {
    let rows = residual.len();
    let periods = (tone.folded() * rows as f64) as usize;
    let blocks = BLOCKS.min(periods / 2).min(rows / 32);
    if blocks < LEAST_BLOCKS {
        return None;
    }
    let mut values = [vec![0.0; blocks], vec![0.0; blocks], vec![0.0; blocks]];
    let mut counts = vec![0.0; blocks];
    for (row, r) in residual.iter().enumerate() {
        let block = row * blocks / rows;
        let (sin, cos) = phases.at(row);
        counts[block] += 1.0;
        values[0][block] += r;
        values[1][block] += 2.0 * r * sin;
        values[2][block] += 2.0 * r * cos;
    }
    for series in &mut values {
        for (v, n) in series.iter_mut().zip(&counts) {
            *v /= f64::max(*n, 1.0);
        }
    }
    let per_block = variance * blocks as f64 / rows as f64;
    Some(Series {
        values,
        white: [per_block, 2.0 * per_block, 2.0 * per_block],
    })
}

/// Orthonormal cosine transform (type II), modes 1 to n - 1.
pub fn modes(values: &[f64]) -> Vec<f64> {
    let n = values.len();
    (1..n)
        .map(|j| {
            let term =
                |(m, v): (usize, &f64)| v * (PI * j as f64 * (m as f64 + 0.5) / n as f64).cos();
            let sum: f64 = values.iter().enumerate().map(term).sum();
            sum * (2.0 / n as f64).sqrt()
        })
        .collect()
}

/// Log-likelihood of modes with white variance w and 1/f strength h.
fn likelihood(modes: &[f64], white: f64, slow: f64) -> f64 {
    let term = |(k, z): (usize, &f64)| {
        let v = white + slow / (k + 1) as f64;
        -0.5 * (v.ln() + z * z / v)
    };
    modes.iter().enumerate().map(term).sum()
}

/// The likeliest strength, and how much likelier it is than none.
pub fn strength(modes: &[f64], white: f64) -> (f64, f64) {
    let none = likelihood(modes, white, 0.0);
    let mut best = (0.0, 0.0);
    for k in 0..64 {
        let slow = white * f64::powf(10.0, -1.0 + 0.15 * f64::from(k));
        let gain = likelihood(modes, white, slow) - none;
        if gain > best.1 {
            best = (slow, gain);
        }
    }
    best
}

/// Gain from which on a wander is seen: less than one in a thousand in white noise (half of chi-square with one
/// degree of freedom, as the strength is not below 0).
const SEEN: f64 = 4.8;

/// The strength to be expected of a wander that is not seen, the modes given: none at all is as likely as some, and of
/// that every order of magnitude from a tenth of the white noise up as likely as the others. The likeliest strength
/// instead would be as large as the white noise in every third capture without a wander.
fn expected_strength(modes: &[f64], white: f64) -> f64 {
    let none = likelihood(modes, white, 0.0);
    const STEPS: i32 = 27;
    let (mut sum, mut all) = (0.0, 1.0);
    for k in 0..STEPS {
        let slow = white * f64::powf(10.0, -1.0 + 0.15 * f64::from(k));
        let odds = (likelihood(modes, white, slow) - none).exp() / f64::from(STEPS);
        sum += odds * slow;
        all += odds;
    }
    sum / all
}

/// Variance of the mean coefficient from a wander. A 1/f noise that began a hundred records ago has 4 h in
/// mode 0; a wander that is seen gets four times that, as few modes tell its strength.
pub fn of_mean(series: &Series, column: usize) -> f64 {
    let (Some(values), Some(white)) = (series.values.get(column), series.white.get(column)) else {
        return 0.0;
    };
    let modes = modes(values);
    let variance = match strength(&modes, *white) {
        (slow, gain) if gain > SEEN => 16.0 * slow,
        _ => 4.0 * expected_strength(&modes, *white),
    };
    variance / values.len() as f64
}

/// Columns with prior variances that stand for the wander of both channels' means.
pub fn nuisance(series: &[Option<Series>; 2]) -> Vec<(Combo, f64)> {
    let mut out = Vec::new();
    for (channel, series) in series.iter().enumerate() {
        let Some(series) = series else { continue };
        for column in [ONE, SIN, COS] {
            let variance = of_mean(series, column);
            if variance > 0.0 {
                out.push((Combo::one("wander", channel, column), variance));
            }
        }
    }
    out
}

/// The same of the harmonics, which lie in the skirts that noise of the amplitude has around the tone: what
/// the spectrum has there beyond the white noise, four times, as its level is known to a factor.
pub fn of_harmonics(
    spectrum: &Spectrum,
    tone: &Tone,
    variances: [f64; 2],
    rows: usize,
) -> Vec<(Combo, f64)> {
    let mut out = Vec::new();
    for (channel, variance) in variances.iter().enumerate() {
        for k in 2..=HARMONICS {
            let excess = spectrum.excess(channel, k as f64 * tone.turns, tone, *variance) - 1.0;
            if excess > 0.05 {
                let of_mean = 4.0 * excess * 2.0 * variance / rows as f64;
                let (sin, cos) = harmonic(k);
                out.push((Combo::one("wander", channel, sin), of_mean));
                out.push((Combo::one("wander", channel, cos), of_mean));
            }
        }
    }
    out
}

/// What a slow sinusoid of `turns` a sample gains in the constant's series of both channels, the wander
/// fitted with and without it: a wander and a part of a period look alike.
pub fn slow_line_gain(series: &[Option<Series>; 2], rows: usize, turns: f64) -> f64 {
    let mut sum = 0.0;
    for series in series.iter().flatten() {
        let [values, ..] = &series.values;
        let [white, ..] = series.white;
        let plain = modes(values);
        let n = values.len();
        let wave = |quarter: f64| -> Vec<f64> {
            let at = |m: usize| (m as f64 + 0.5) / n as f64 * rows as f64;
            let wave = (0..n).map(|m| (TAU * turns * at(m) + quarter).sin());
            modes(&wave.collect::<Vec<f64>>())
        };
        let (sin, cos) = (wave(0.0), wave(PI / 2.0));
        let (slow, before) = strength(&plain, white);
        let mut rest = plain.clone();
        let (mut after, mut used) = (before, slow);
        for _ in 0..3 {
            rest = without(&plain, &sin, &cos, white, used);
            (used, after) = strength(&rest, white);
        }
        let base = likelihood(&plain, white, 0.0) + before;
        sum += likelihood(&rest, white, 0.0) + after - base;
    }
    sum
}

/// The modes less their weighted projection on two others.
fn without(modes: &[f64], a: &[f64], b: &[f64], white: f64, slow: f64) -> Vec<f64> {
    let weight = |k: usize| 1.0 / (white + slow / (k + 1) as f64);
    let dot = |x: &[f64], y: &[f64]| -> f64 {
        x.iter()
            .zip(y)
            .enumerate()
            .map(|(k, (x, y))| weight(k) * x * y)
            .sum()
    };
    let (aa, ab, bb) = (dot(a, a), dot(a, b), dot(b, b));
    let (ay, by) = (dot(a, modes), dot(b, modes));
    let determinant = aa * bb - ab * ab;
    if determinant <= 1e-9 * aa * bb {
        return modes.to_vec();
    }
    let (p, q) = (
        (bb * ay - ab * by) / determinant,
        (aa * by - ab * ay) / determinant,
    );
    modes
        .iter()
        .zip(a.iter().zip(b))
        .map(|(m, (a, b))| m - p * a - q * b)
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plant::noise::Noise;

    /// Modes of a wander of strength `slow` beside white noise of variance 1.
    fn drawn(stream: u64, slow: f64) -> Vec<f64> {
        let noise = Noise::new(11, stream);
        let mode = |k: u64| (1.0 + slow / (k + 1) as f64).sqrt() * noise.gaussian_pair(k).0;
        (0..63).map(mode).collect()
    }

    #[test]
    fn without_modes_no_wander_is_as_likely_as_some() {
        let grid: Vec<f64> = (0..27)
            .map(|k| f64::powf(10.0, -1.0 + 0.15 * f64::from(k)))
            .collect();
        let mean = grid.iter().sum::<f64>() / 27.0;
        let expected = expected_strength(&[], 2.0);
        assert!((expected / mean - 1.0).abs() < 1e-12, "{expected} {mean}");
    }

    #[test]
    fn white_modes_leave_less_than_their_noise() {
        let strengths: Vec<f64> = (0..40)
            .map(|s| expected_strength(&drawn(s, 0.0), 1.0))
            .collect();
        let mean = strengths.iter().sum::<f64>() / 40.0;
        assert!(mean > 0.0 && mean < 0.6, "{mean}");
    }

    #[test]
    fn a_strong_wander_is_expected_at_its_strength() {
        let strengths: Vec<f64> = (0..40)
            .map(|s| expected_strength(&drawn(s, 30.0), 1.0))
            .collect();
        let mean = strengths.iter().sum::<f64>() / 40.0;
        assert!((20.0..45.0).contains(&mean), "{mean}");
    }
}
