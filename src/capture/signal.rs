//! The signal of a channel as a sum of columns, and what makes it nonlinear: clipping, missing codes, phase truncation.

use super::tone::{Phases, Tone};
use crate::statistics::normal;
use std::f64::consts::TAU;
use std::ops::Range;

/// Rows that are worked on at once.
pub const CHUNK: usize = 256;

/// Constant 1.
pub const ONE: usize = 0;

/// sin of the phase.
pub const SIN: usize = 1;

/// cos of the phase.
pub const COS: usize = 2;

/// First power of u = signal / span; then u^2 to u^5.
pub const POWER: usize = 11;

/// Highest power.
pub const POWERS: usize = 5;

/// Quantisation error of a code that is rounded before noise is added: round(x) - x.
pub const SAW: usize = 16;

/// sin(2 pi k x), k = 1 and on: what is left of it where noise before rounding smoothes it. Noise of sigma codes
/// leaves exp(-2 (pi k sigma)^2) of wave k (Widrow and Kollar 2008).
pub const WAVE: usize = 17;

/// Waves: with 0.15 codes of noise the fourth is below a thousandth of a code.
pub const WAVES: usize = 3;

/// The drive channel's residual, in the sense channel only.
pub const OTHER: usize = WAVE + WAVES;

/// First line: sine and cosine for each.
pub const LINE: usize = OTHER + 1;

/// Lines at most.
pub const LINES: usize = 6;

/// Sine and cosine of the truncated phase, less those of the phase.
pub const TRUNCATED: usize = LINE + 2 * LINES;

/// The tone at the exact phase less that at the truncated one, over the span: makes a bend's line one of the exact tone.
pub const EXACT: usize = TRUNCATED + 2;

/// First hat function of the signal over -span .. span.
pub const HAT: usize = EXACT + 1;

/// Hat functions.
pub const HATS: usize = 129;

/// First of the equal parts of the converter's range -full scale .. full scale: 1 where the signal is in it.
pub const SEGMENT: usize = HAT + HATS;

/// Parts: those of a first stage of five bits.
pub const SEGMENTS: usize = 32;

/// All columns.
pub const ALL: usize = SEGMENT + SEGMENTS;

/// Highest harmonic.
pub const HARMONICS: usize = 5;

/// Columns of the sine and the cosine of harmonic k, 1 ..= [`HARMONICS`].
pub const fn harmonic(k: usize) -> (usize, usize) {
    (2 * k - 1, 2 * k)
}

/// Columns of line i.
pub const fn line(i: usize) -> (usize, usize) {
    (LINE + 2 * i, LINE + 2 * i + 1)
}

/// Variance of a row: base + jitter^2 slope^2.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Variance {
    /// Of each channel, codes squared.
    pub base: [f64; 2],
    /// Variance of each channel's sampling instant, samples squared.
    pub jitter: [f64; 2],
}

/// All that is not a coefficient, and the coefficients of the last fit (for the signal's value).
#[derive(Debug, Clone)]
pub struct Model {
    /// Phases.
    pub tone: Tone,
    /// Their sines and cosines.
    pub phases: Phases,
    /// Sine and cosine of the declared tones, codes.
    pub declared: [[f64; 2]; 2],
    /// Coefficients of all columns: what is beyond the declared tones.
    pub coefficients: [Vec<f64>; 2],
    /// Coefficients of a fit with every freedom: where the codes are, whatever effect put them there. The
    /// quantiser's error is taken at it, so that it takes no side.
    pub neutral: [Vec<f64>; 2],
    /// Frequencies of the lines, turns a sample.
    pub lines: Vec<f64>,
    /// Their standard deviations, as far as they were looked for.
    pub line_stds: Vec<f64>,
    /// Address of a truncated oscillator.
    pub truncation: Option<Truncation>,
    /// Limits of each channel.
    pub limits: [Limits; 2],
    /// Missing codes of each channel.
    pub missing: [Missing; 2],
    /// Of the noise.
    pub variance: Variance,
    /// What u is relative to: a little more than the largest code of both channels.
    pub span_codes: f64,
    /// 2^(bits-1), codes.
    pub full_scale_codes: f64,
}

impl Model {
    /// The part of the converter's range that a signal is in; the outermost ones go on beyond it.
    pub fn segment(&self, signal: f64) -> usize {
        let place = (0.5 + 0.5 * signal / self.full_scale_codes) * SEGMENTS as f64;
        (place.max(0.0) as usize).min(SEGMENTS - 1)
    }
}

/// The chunks of a stretch of rows.
pub fn chunks(rows: Range<usize>) -> impl Iterator<Item = Range<usize>> {
    let end = rows.end;
    rows.step_by(CHUNK)
        .map(move |start| start..end.min(start + CHUNK))
}

/// The levels of a channel; infinite where there is none.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Limits {
    /// Lower level, codes.
    pub low: f64,
    /// Upper level, codes.
    pub high: f64,
    /// Whether noise is added behind the limit, and nothing of it is limited.
    pub is_front: bool,
}

impl Limits {
    /// No limit.
    pub const NONE: Limits = Limits {
        low: f64::NEG_INFINITY,
        high: f64::INFINITY,
        is_front: false,
    };

    /// Whether there is a limit.
    pub fn any(&self) -> bool {
        self.low.is_finite() || self.high.is_finite()
    }

    /// Whether a signal with this noise is not touched by a limit (beyond one in a thousand rows).
    pub fn is_free(&self, signal: f64, sigma: f64) -> bool {
        signal > self.low + 3.0 * sigma && signal < self.high - 3.0 * sigma
    }

    /// Mean of the limited code less the signal: noise is limited with the signal.
    pub fn shift(&self, signal: f64, sigma: f64) -> f64 {
        if !self.any() || self.is_free(signal, 2.0 * sigma) {
            return 0.0;
        }
        if self.is_front {
            return signal.clamp(self.low, self.high) - signal;
        }
        let sigma = sigma.max(1e-6);
        let over = |level: f64, sign: f64| match level.is_finite() {
            true => sigma * normal::excess(sign * (signal - level) / sigma),
            false => 0.0,
        };
        over(self.low, -1.0) - over(self.high, 1.0)
    }
}

/// Missing codes of one channel.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Missing {
    /// The codes, ascending.
    pub codes: Vec<i32>,
    /// Of each, the code that its inputs get instead, less itself.
    pub moves: Vec<f64>,
}

impl Missing {
    /// Whether a code from `low` to `high` is missing.
    pub fn any_in(&self, low: f64, high: f64) -> bool {
        let first = self.codes.partition_point(|c| f64::from(*c) < low);
        self.codes.get(first).is_some_and(|c| f64::from(*c) <= high)
    }

    /// What it moves the mean code by at a signal with this noise, codes.
    pub fn shift(&self, signal: f64, sigma: f64) -> f64 {
        if self.codes.is_empty() {
            return 0.0;
        }
        // The quantiser's own variance is no part of the noise before it. A little noise is always there; a wide
        // one is looked at in its middle only.
        let sigma = (sigma * sigma - 1.0 / 12.0).max(0.0).sqrt();
        let sigma = sigma.clamp(0.05, 1e4);
        let reach = 4.0 * sigma + 1.0;
        let first = self
            .codes
            .partition_point(|c| f64::from(*c) < signal - reach);
        let mut sum = 0.0;
        for (code, by) in self.codes.iter().zip(&self.moves).skip(first) {
            let distance = f64::from(*code) - signal;
            if distance > reach {
                break;
            }
            sum += by
                * if sigma > 2.0 {
                    normal::density(distance / sigma) / sigma
                } else {
                    normal::below((distance + 0.5) / sigma)
                        - normal::below((distance - 0.5) / sigma)
                };
        }
        sum
    }
}

/// How an oscillator comes from its phase to an address of its table.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Truncation {
    /// Address bits.
    pub bits: u32,
    /// Half an address step is added to the phase before the bits below the address are dropped
    /// (`address_rounding = "half_up"`); nothing is with `"floor"`.
    pub half_up: bool,
}

impl Truncation {
    /// Both roundings of some address bits.
    pub(super) fn both(bits: u32) -> [Truncation; 2] {
        [false, true].map(|half_up| Truncation { bits, half_up })
    }

    /// Addresses a turn.
    pub fn steps(self) -> f64 {
        f64::powi(2.0, self.bits as i32)
    }

    /// What is added before truncation, in address steps.
    pub fn added(self) -> f64 {
        if self.half_up { 0.5 } else { 0.0 }
    }

    /// The phase (turns) of the table's entry that is read at a phase (turns in 0 .. 1); 1 is entry 0 again.
    pub fn phase(self, phase: f64) -> f64 {
        let steps = self.steps();
        (phase * steps + self.added()).floor() / steps
    }
}

/// Share of the quantiser's own error from which on it shows.
pub(super) const LEAST_SAW: f64 = 0.3;

/// Where the quantiser puts a signal, less the signal.
pub(super) fn rest(signal: f64) -> f64 {
    (signal + 0.5).floor() - signal
}

/// Whether a channel's noise was added after rounding, as far as these coefficients tell.
pub fn is_undithered(coefficients: &[f64]) -> bool {
    coefficients.get(SAW).is_some_and(|b| b.abs() > LEAST_SAW)
}

/// The mean code of a constant signal: what of the quantiser's error shows beside the noise.
pub fn mean_code(signal: f64, coefficients: &[f64]) -> f64 {
    let at = |k: usize| coefficients.get(k).copied().unwrap_or(0.0);
    let wave = |k: usize| at(WAVE + k) * (TAU * (k + 1) as f64 * signal).sin();
    signal + at(SAW) * rest(signal) + (0..WAVES).map(wave).sum::<f64>()
}
