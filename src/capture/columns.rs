//! The columns of the linear model, and their values row by row.
//!
//! What an effect adds to a channel's code is, near the declared model, a sum of columns: functions
//! of the oscillator's phase (constant, harmonics), of the signal itself (powers, piecewise linear),
//! lines at other frequencies, what phase truncation makes of the tone. All that is nonlinear
//! (frequencies, levels of clipping, truncation) is in [`Model`] and is fixed while coefficients are fitted.

use super::input::Capture;
use super::signal;
pub use super::signal::{
    ALL, CHUNK, COS, EXACT, HARMONICS, HAT, HATS, LINE, LINES, Model, ONE, OTHER, POWER, POWERS,
    SAW, SEGMENT, SEGMENTS, SIN, TRUNCATED, Variance, WAVE, WAVES, chunks, harmonic, line,
};
use crate::numeric::turn;
use crate::statistics::normal;
use std::f64::consts::{PI, TAU};
use std::ops::Range;

/// Some rows of all columns.
#[derive(Debug, Clone)]
pub struct Rows {
    /// First row and the one after the last.
    pub rows: Range<usize>,
    /// By channel and column; the hat functions and the segments are not among them.
    pub dense: [Vec<Vec<f64>>; 2],
    /// By channel: the first of two hat functions that are not zero, and the second's value.
    pub hats: [Vec<(usize, f64)>; 2],
    /// By channel: the segment that is 1.
    pub segments: [Vec<usize>; 2],
    code: [Vec<f64>; 2],
    /// Code less declared tone (and the mean shift by missing codes).
    pub target: [Vec<f64>; 2],
    /// The signal before the quantiser.
    pub signal: [Vec<f64>; 2],
    /// Its slope, codes a sample.
    pub slope: [Vec<f64>; 2],
    /// One over the variance; 0 where the channel is limited or the row is left out.
    pub weight: [Vec<f64>; 2],
}

impl Rows {
    /// Room for a chunk.
    pub fn new() -> Self {
        let zeros = || vec![0.0; CHUNK];
        let pair = || [zeros(), zeros()];
        let dense = || vec![zeros(); HAT];
        Rows {
            rows: 0..0,
            dense: [dense(), dense()],
            hats: [vec![(0, 0.0); CHUNK], vec![(0, 0.0); CHUNK]],
            segments: [vec![0; CHUNK], vec![0; CHUNK]],
            code: pair(),
            target: pair(),
            signal: pair(),
            slope: pair(),
            weight: pair(),
        }
    }

    /// What the coefficients make of row `i` (within the chunk) of a channel, beyond the declared tone.
    pub fn value(&self, channel: usize, i: usize, coefficients: &[f64]) -> f64 {
        let dense = self.dense[channel].iter().zip(coefficients);
        let sum: f64 = dense
            .map(|(c, b)| if *b == 0.0 { 0.0 } else { b * c[i] })
            .sum();
        let (at, part) = self.hats[channel][i];
        let own = |k: usize| coefficients.get(k).copied().unwrap_or(0.0);
        let segment = own(SEGMENT + self.segments[channel][i]);
        sum + own(HAT + at) * (1.0 - part) + own(HAT + at + 1) * part + segment
    }

    /// The code less all that the model makes of row `i`, limits and missing codes among it.
    pub fn error(&self, model: &Model, channel: usize, i: usize) -> f64 {
        let limits = model.limits[channel];
        let signal = self.signal[channel][i];
        let undithered = signal::is_undithered(&model.neutral[channel]);
        let passes = undithered || limits.is_front;
        if passes && limits.any() && !(limits.low..limits.high).contains(&signal) {
            // Noise is added to the level or to its code, and nothing of it is limited.
            let level = signal.clamp(limits.low, limits.high);
            return self.code[channel][i] - signal::mean_code(level, &model.neutral[channel]);
        }
        let value = self.value(channel, i, &model.coefficients[channel]);
        let shift = match undithered {
            true => 0.0,
            false => limits.shift(signal, model.variance.base[channel].sqrt()),
        };
        self.target[channel][i] - value - shift
    }

    /// The code itself.
    pub fn code(&self, channel: usize, i: usize) -> f64 {
        self.code[channel][i]
    }

    /// Computes rows `rows` (at most [`CHUNK`]).
    pub fn fill(&mut self, capture: &Capture, model: &Model, rows: Range<usize>) {
        self.rows = rows.clone();
        for channel in 0..2 {
            self.tones(model, channel, rows.clone());
            self.lines(model, channel, rows.clone());
            self.signals(capture, model, channel, rows.clone());
        }
        self.coupled(model);
    }

    fn tones(&mut self, model: &Model, channel: usize, rows: Range<usize>) {
        if channel == 1 {
            // Same phases: copied.
            let [drive, sense] = &mut self.dense;
            for k in 0..=2 * HARMONICS {
                sense[k].copy_from_slice(&drive[k]);
            }
            for k in TRUNCATED..TRUNCATED + 2 {
                sense[k].copy_from_slice(&drive[k]);
            }
            return;
        }
        let dense = &mut self.dense[0];
        for (i, row) in rows.enumerate() {
            let (sin, cos) = model.phases.at(row);
            dense[ONE][i] = 1.0;
            let (mut s, mut c) = (sin, cos);
            for k in 1..=HARMONICS {
                let (at_sin, at_cos) = harmonic(k);
                dense[at_sin][i] = s;
                dense[at_cos][i] = c;
                (s, c) = (s * cos + c * sin, c * cos - s * sin);
            }
            if let Some(truncation) = model.truncation {
                let (ts, tc) = (TAU * truncation.phase(model.tone.phase(row))).sin_cos();
                dense[TRUNCATED][i] = ts - sin;
                dense[TRUNCATED + 1][i] = tc - cos;
            }
        }
    }

    fn lines(&mut self, model: &Model, channel: usize, rows: Range<usize>) {
        if channel == 1 {
            let [drive, sense] = &mut self.dense;
            for k in LINE..LINE + 2 * model.lines.len() {
                sense[k].copy_from_slice(&drive[k]);
            }
            return;
        }
        for (k, turns) in model.lines.iter().enumerate() {
            let (at_sin, at_cos) = line(k);
            let (mut s, mut c) = (TAU * (turns * rows.start as f64).fract()).sin_cos();
            let (ds, dc) = (TAU * turns).sin_cos();
            for i in 0..rows.len() {
                self.dense[0][at_sin][i] = s;
                self.dense[0][at_cos][i] = c;
                (s, c) = (s * dc + c * ds, c * dc - s * ds);
            }
        }
    }

    /// The signal without and with the bend, and the columns that are functions of it.
    fn signals(&mut self, capture: &Capture, model: &Model, channel: usize, rows: Range<usize>) {
        let coefficients = &model.coefficients[channel];
        let [sin, cos] = model.declared[channel];
        let at = |k: usize| coefficients.get(k).copied().unwrap_or(0.0);
        let straight = terms(coefficients, POWER);
        let neutral = &model.neutral[channel];
        let neutral_terms = terms(neutral, SAW);
        let neutral_at = |k: usize| neutral.get(k).copied().unwrap_or(0.0);
        // Noise of one code leaves nothing of the wave.
        let with_wave = model.variance.base[channel] < 1.0;
        let bent = (POWER..SAW).chain(HAT..ALL).any(|k| at(k) != 0.0);
        let (sin_all, cos_all) = (sin + at(SIN), cos + at(COS));
        let angle = model.tone.angle();
        let base = model.variance.base[channel].max(1e-12);
        let scale = (HATS - 1) as f64 / (2.0 * model.span_codes);
        for (i, row) in rows.enumerate() {
            let dense = &mut self.dense[channel];
            let declared = sin * dense[SIN][i] + cos * dense[COS][i];
            // The bend is a function of the tone, truncated if it is: a line or a harmonic in it is of second order.
            let tone = declared + at(ONE) + at(SIN) * dense[SIN][i] + at(COS) * dense[COS][i];
            let tone = match model.truncation {
                Some(_) => {
                    let (sin, cos) = (dense[TRUNCATED][i], dense[TRUNCATED + 1][i]);
                    let moved = at(TRUNCATED) * sin + at(TRUNCATED + 1) * cos;
                    dense[EXACT][i] = -moved / model.span_codes;
                    tone + moved
                }
                None => tone,
            };
            let added: f64 = straight.iter().map(|(k, b)| b * dense[*k][i]).sum();
            let x = declared + added;
            let u = tone / model.span_codes;
            let mut power = 1.0;
            for k in 0..POWERS {
                power *= u;
                dense[POWER + k][i] = power;
            }
            let place = ((tone + model.span_codes) * scale).clamp(0.0, (HATS - 1) as f64 - 1e-9);
            self.hats[channel][i] = (place as usize, place - (place as usize) as f64);
            let segment = SEGMENT + model.segment(tone);
            self.segments[channel][i] = segment - SEGMENT;
            let bend: f64 = if bent {
                let (k, part) = self.hats[channel][i];
                let powers: f64 = (POWER..SAW).map(|k| at(k) * dense[k][i]).sum();
                powers + at(HAT + k) * (1.0 - part) + at(HAT + k + 1) * part + at(segment)
            } else {
                0.0
            };
            let signal = x + bend;
            let (k, part) = self.hats[channel][i];
            let there: f64 = neutral_terms.iter().map(|(k, b)| b * dense[*k][i]).sum();
            let hats = neutral_at(HAT + k) * (1.0 - part) + neutral_at(HAT + k + 1) * part;
            let there = declared + there + hats + neutral_at(segment);
            let slope = angle * (sin_all * dense[COS][i] - cos_all * dense[SIN][i]);
            let late = model.variance.jitter[channel] * slope * slope;
            let rest = floor(there + 0.5) - there;
            // The random instant smoothes the steps where the signal is steep.
            dense[SAW][i] = if late > 0.0 {
                smoothed(rest, late)
            } else {
                rest
            };
            let (wave, turn) = match with_wave {
                true => turn::sin_cos(phase_of(there)),
                false => (0.0, 0.0),
            };
            // sin(2 a) and sin(3 a).
            let waves = [wave, 2.0 * wave * turn, wave * (4.0 * turn * turn - 1.0)];
            let mut left = 1.0;
            for (k, wave) in waves.into_iter().enumerate() {
                if late > 0.0 {
                    left = (-2.0 * (PI * (k + 1) as f64).powi(2) * late).exp();
                }
                dense[WAVE + k][i] = wave * left;
            }
            dense[OTHER][i] = 0.0;
            let code = f64::from(capture.codes[channel].get(row).copied().unwrap_or(0));
            self.code[channel][i] = code;
            self.signal[channel][i] = signal;
            self.slope[channel][i] = slope;
            self.target[channel][i] =
                code - declared - model.missing[channel].shift(signal, base.sqrt());
            let variance = base + late;
            let free = model.limits[channel].is_free(signal, base.sqrt());
            let free = free && !capture.is_left_out(row);
            self.weight[channel][i] = if free { 1.0 / variance } else { 0.0 };
        }
    }

    /// The drive's residual as a column of the sense channel.
    fn coupled(&mut self, model: &Model) {
        let own = |k: usize| model.coefficients[0].get(k).copied().unwrap_or(0.0);
        let own: Vec<(usize, f64)> = (SAW..OTHER).map(|k| (k, own(k))).collect();
        for i in 0..self.rows.len() {
            let quantised: f64 = own.iter().map(|(k, b)| b * self.dense[0][*k][i]).sum();
            let rest = self.code[0][i] - self.signal[0][i] - quantised;
            self.dense[1][OTHER][i] = if self.weight[0][i] > 0.0 { rest } else { 0.0 };
        }
    }
}

/// The columns below `end` and those of lines and truncation, with coefficients that are not 0.
fn terms(coefficients: &[f64], end: usize) -> Vec<(usize, f64)> {
    (ONE..end)
        .chain(LINE..HAT)
        .filter_map(|k| Some((k, *coefficients.get(k)?)))
        .filter(|(_, b)| *b != 0.0)
        .collect()
}

/// The mean of round(x + n) - x for Gaussian n of this variance, from round(x) - x: the two nearest steps, and beyond
/// 0.3 codes of noise the first wave, as all others are below 2e-4 codes.
fn smoothed(rest: f64, variance: f64) -> f64 {
    if variance > 0.09 {
        return (TAU * rest).sin() * (-2.0 * PI * PI * variance).exp() / PI;
    }
    let sigma = variance.sqrt();
    rest + normal::below((-rest - 0.5) / sigma) - normal::below((rest - 0.5) / sigma)
}

/// The largest whole number that is not above x, for codes (below 2^62): without a call, as there is one a row.
#[inline]
fn floor(x: f64) -> f64 {
    let whole = x as i64 as f64;
    if whole > x { whole - 1.0 } else { whole }
}

/// The part of x after the point, turns, as a phase in 2^-64 turn (to 2^-62), for codes.
#[inline]
fn phase_of(x: f64) -> u64 {
    let part = x - x as i64 as f64;
    ((part * 4_611_686_018_427_387_904.0) as i64 as u64) << 2
}

impl Default for Rows {
    fn default() -> Self {
        Self::new()
    }
}

#[cfg(test)]
mod tests {
    use super::super::signal::Truncation;
    use super::super::synthetic::{AMPLITUDE, Made, model};
    use super::*;

    #[test]
    fn smoothed_steps_are_the_mean_over_the_noise() {
        for sigma in [0.02, 0.1, 0.29, 0.31, 0.6] {
            for x in [-0.49, -0.3, 0.01, 0.2, 0.45] {
                // Midpoint sum over +-8 standard deviations.
                let steps = 40_000;
                let mean: f64 = (0..steps)
                    .map(|k| {
                        let z = 16.0 * (f64::from(k) + 0.5) / f64::from(steps) - 8.0;
                        let weight = normal::density(z) * 16.0 / f64::from(steps);
                        weight * ((x + sigma * z + 0.5).floor() - x)
                    })
                    .sum();
                let found = smoothed((x + 0.5f64).floor() - x, sigma * sigma);
                assert!((found - mean).abs() < 2e-3, "{sigma} {x}: {found} {mean}");
            }
        }
    }

    #[test]
    fn a_random_instant_smoothes_the_steps_where_the_signal_is_steep() {
        let capture = Made::CLEAN.capture();
        let square = |jitter: f64| -> f64 {
            let (_, model) = model(
                &capture,
                &Made {
                    jitter,
                    ..Made::CLEAN
                },
            );
            let mut rows = Rows::new();
            rows.fill(&capture, &model, 0..CHUNK);
            rows.dense[0][SAW].iter().map(|v| v * v).sum()
        };
        assert!(square(0.05) < 0.4 * square(0.0));
    }

    #[test]
    fn without_dither_a_limited_code_is_its_level_and_noise() {
        let made = Made {
            noise: 0.0,
            after: true,
            limit: 195.0,
            ..Made::CLEAN
        };
        let capture = made.capture();
        let (_, mut model) = model(&capture, &made);
        model.variance.base = [0.3; 2];
        model.limits[0].high = 195.0;
        for coefficients in [&mut model.coefficients[0], &mut model.neutral[0]] {
            coefficients[SAW] = 1.0;
        }
        let mut rows = Rows::new();
        for chunk in chunks(0..2000) {
            let n = chunk.len();
            rows.fill(&capture, &model, chunk);
            for i in 0..n {
                let error = rows.error(&model, 0, i);
                assert!(error.abs() < 1e-6, "{} {error}", rows.code(0, i));
            }
        }
    }

    #[test]
    fn a_bend_follows_the_truncated_tone() {
        let made = Made {
            bits: Some(4),
            ..Made::CLEAN
        };
        let capture = made.capture();
        let (_, mut model) = model(&capture, &made);
        model.coefficients[0][TRUNCATED + 1] = -AMPLITUDE;
        for (half_up, added) in [(false, 0.0), (true, 0.5)] {
            model.truncation = Some(Truncation { bits: 4, half_up });
            let mut rows = Rows::new();
            rows.fill(&capture, &model, 0..CHUNK);
            for row in 0..CHUNK {
                let phase = (model.tone.phase(row) * 16.0 + added).floor() / 16.0;
                let u = -AMPLITUDE * (TAU * phase).cos() / model.span_codes;
                let power = rows.dense[0][POWER][row];
                assert!((power - u).abs() < 1e-9, "{row}: {power} {u}");
            }
        }
    }
}
