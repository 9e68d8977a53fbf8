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

/// Slopes of wanders that a slow line must stand out of: the variance of mode j is w + h / j^slope. From 1/f noise to
/// a random walk (2), and somewhat steeper, as few modes may show it.
const SLOPES: [f64; 4] = [1.0, 1.5, 2.0, 2.5];

/// Variances of modes beside which a line is looked for, of all slopes and strengths; the first without any wander.
fn wanders(modes: usize, white: f64) -> Vec<Vec<f64>> {
    let mut out = vec![vec![white; modes]];
    for slope in SLOPES {
        let fall: Vec<f64> = (1..=modes).map(|j| (j as f64).powf(-slope)).collect();
        for k in 0..STEPS {
            let slow = white * f64::powf(10.0, -1.0 + 0.15 * f64::from(k));
            out.push(fall.iter().map(|f| white + slow * f).collect());
        }
    }
    out
}

/// Log-likelihood of modes of these variances.
fn likelihood_of(modes: &[f64], variances: &[f64]) -> f64 {
    let term = |(z, v): (&f64, &f64)| -0.5 * (v.ln() + z * z / v);
    modes.iter().zip(variances).map(term).sum()
}

/// The likeliest of some wanders and its log-likelihood.
fn likeliest<'a>(modes: &[f64], wanders: &'a [Vec<f64>]) -> (&'a [f64], f64) {
    let mut best: (&[f64], f64) = (&[], f64::NEG_INFINITY);
    for variances in wanders {
        let likelihood = likelihood_of(modes, variances);
        if likelihood > best.1 {
            best = (variances, likelihood);
        }
    }
    best
}

/// Strengths that are looked at, 0.15 decades apart from a tenth of the white noise up.
const STEPS: i32 = 64;

/// The strength to be expected of a wander, the modes given: none at all is as likely as some, and of
/// that every order of magnitude from a tenth of the white noise up as likely as the others. The likeliest strength
/// instead would be as large as the white noise in every third capture without a wander.
fn expected_strength(modes: &[f64], white: f64) -> f64 {
    let none = likelihood(modes, white, 0.0);
    let steps: Vec<(f64, f64)> = (0..STEPS)
        .map(|k| {
            let slow = white * f64::powf(10.0, -1.0 + 0.15 * f64::from(k));
            let prior = f64::from(STEPS).ln();
            (slow, likelihood(modes, white, slow) - none - prior)
        })
        .collect();
    // Relative to the likeliest: a strong wander is likelier than none by more than a number holds.
    let most = steps.iter().map(|s| s.1).fold(0.0, f64::max);
    let (mut sum, mut all) = (0.0, (-most).exp());
    for (slow, likelihood) in steps {
        let odds = (likelihood - most).exp();
        sum += odds * slow;
        all += odds;
    }
    sum / all
}

/// Variance of the mean coefficient from a wander. A 1/f noise that began a hundred records ago has 4 h in
/// mode 0.
pub fn of_mean(series: &Series, column: usize) -> f64 {
    let (Some(values), Some(white)) = (series.values.get(column), series.white.get(column)) else {
        return 0.0;
    };
    4.0 * expected_strength(&modes(values), *white) / values.len() as f64
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

/// What slow sinusoids of these `turns` a sample gain together in the constant's series of both channels, the wander
/// fitted with and without them, whatever its slope: a wander and a few periods of a line look alike, and the steeper
/// it is, the more of them.
pub fn slow_line_gain(series: &[Option<Series>; 2], rows: usize, turns: &[f64]) -> f64 {
    let mut sum = 0.0;
    for series in series.iter().flatten() {
        let [values, ..] = &series.values;
        let [white, ..] = series.white;
        let plain = modes(values);
        let n = values.len();
        let wave = |turns: f64, quarter: f64| -> Vec<f64> {
            let at = |m: usize| (m as f64 + 0.5) / n as f64 * rows as f64;
            let wave = (0..n).map(|m| (TAU * turns * at(m) + quarter).sin());
            modes(&wave.collect::<Vec<f64>>())
        };
        let waves: Vec<Vec<f64>> = turns
            .iter()
            .flat_map(|t| [wave(*t, 0.0), wave(*t, PI / 2.0)])
            .collect();
        let wanders = wanders(plain.len(), white);
        let (mut used, before) = likeliest(&plain, &wanders);
        let mut after = before;
        for _ in 0..3 {
            let rest = without(&plain, &waves, used);
            (used, after) = likeliest(&rest, &wanders);
        }
        sum += after - before;
    }
    sum
}

/// The modes, of these variances, less their weighted projection on others.
fn without(modes: &[f64], others: &[Vec<f64>], variances: &[f64]) -> Vec<f64> {
    let dot = |x: &[f64], y: &[f64]| -> f64 {
        let products = x.iter().zip(y).zip(variances);
        products.map(|((x, y), v)| x * y / v).sum()
    };
    let less = |from: &mut [f64], other: &[f64], size: f64| {
        let share = dot(from, other) / size;
        from.iter_mut()
            .zip(other)
            .for_each(|(f, o)| *f -= share * o);
    };
    let mut done: Vec<(Vec<f64>, f64)> = Vec::new();
    let mut out = modes.to_vec();
    for other in others {
        let mut own = other.clone();
        let whole = dot(&own, &own);
        for (earlier, size) in &done {
            less(&mut own, earlier, *size);
        }
        let size = dot(&own, &own);
        if size > 1e-9 * whole {
            less(&mut out, &own, size);
            done.push((own, size));
        }
    }
    out
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
        let grid: Vec<f64> = (0..STEPS)
            .map(|k| f64::powf(10.0, -1.0 + 0.15 * f64::from(k)))
            .collect();
        let mean = grid.iter().sum::<f64>() / f64::from(STEPS);
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
    fn a_wander_as_strong_as_any_is_expected_at_its_strength() {
        let strengths: Vec<f64> = (0..20)
            .map(|s| expected_strength(&drawn(s, 1e6), 1.0))
            .collect();
        let mean = strengths.iter().sum::<f64>() / 20.0;
        assert!((0.7e6..1.5e6).contains(&mean), "{mean}");
    }

    #[test]
    fn a_strong_wander_is_expected_at_its_strength() {
        let strengths: Vec<f64> = (0..40)
            .map(|s| expected_strength(&drawn(s, 30.0), 1.0))
            .collect();
        let mean = strengths.iter().sum::<f64>() / 40.0;
        assert!((20.0..45.0).contains(&mean), "{mean}");
    }

    /// The constant's series of 64 blocks of 100 rows: white noise of variance 1, and sinusoids (turns a row, amplitude).
    fn slow(lines: &[(f64, f64)]) -> [Option<Series>; 2] {
        let noise = Noise::new(5, 3);
        let value = |m: usize| {
            let row = 100.0 * (m as f64 + 0.5);
            let lines = lines.iter().map(|(t, a)| a * (TAU * t * row + 0.4).sin());
            noise.gaussian_pair(m as u64).0 + lines.sum::<f64>()
        };
        let series = Series {
            values: [(0..64).map(value).collect(), Vec::new(), Vec::new()],
            white: [1.0; 3],
        };
        [Some(series), None]
    }

    #[test]
    fn a_slow_line_with_an_overtone_gains_as_one() {
        let rows = 6400;
        let (first, third) = (1.55 / 6400.0, 4.65 / 6400.0);
        let series = slow(&[(first, 2.4), (third, 1.0)]);
        let alone = slow_line_gain(&series, rows, &[first]);
        let both = slow_line_gain(&series, rows, &[first, third]);
        assert!(both > alone + 10.0, "{alone} {both}");
        let none = slow_line_gain(&slow(&[]), rows, &[first, third]);
        assert!(none < 8.0, "{none}");
    }

    #[test]
    fn a_random_walk_is_no_slow_line() {
        // 1.5 and 4.5 cycles in the record: 8 free numbers in both channels.
        let line = [1.5 / 6400.0, 4.5 / 6400.0];
        for stream in 0..12 {
            let noise = Noise::new(3, stream);
            let walk = |at: u64| -> Option<Series> {
                let mut sum = 0.0;
                let value = |m: u64| {
                    let (white, step) = noise.gaussian_pair(64 * at + m);
                    sum += 3.0 * step;
                    sum + white
                };
                Some(Series {
                    values: [(0..64).map(value).collect(), Vec::new(), Vec::new()],
                    white: [1.0; 3],
                })
            };
            let gain = slow_line_gain(&[walk(0), walk(1)], 6400, &line);
            assert!(gain < 17.0, "{stream} {gain}");
        }
    }

    #[test]
    fn what_is_projected_out_is_not_left() {
        let waves: Vec<Vec<f64>> = [[1.0, 0.5, 0.2, 0.1], [0.9, 0.7, 0.1, -0.3]]
            .map(Vec::from)
            .to_vec();
        let sum: Vec<f64> = (0..4)
            .map(|k| 3.0 * waves[0][k] - 2.0 * waves[1][k])
            .collect();
        let rest = without(&sum, &waves, &[6.0, 3.5, 2.7, 2.25]);
        assert!(rest.iter().all(|r| r.abs() < 1e-9), "{rest:?}");
    }
}
