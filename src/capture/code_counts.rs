//! How often each code of a channel appears, and how often the tone with its noise should make it appear.
//!
//! The expectation is the integral of the model's code probability over the phases, so that it holds at the crest of
//! the tone too, where the arcsine density rises by more from a code to the next than any mean of neighbours follows.

use super::columns::{Model, Rows, SEGMENT, SEGMENTS, chunks};
use super::input::{Capture, Part};
use super::signal;
use crate::statistics::normal;

/// Codes on each side of a run that are looked at, at most.
const NEAR: usize = 24;
/// Rows that those should have, from which on they tell enough.
const LEAST_AROUND: f64 = 10.0;
/// Rows that there have to be on each side, whatever is expected.
const LEAST_SEEN: f64 = 3.0;
/// A step of the converter's curve that skips (nearly) a whole code, codes.
const SKIP: f64 = 0.7;
/// Share of what is expected up to which a code is absent.
const ABSENT: f64 = 0.02;
/// Widest range of codes that is looked at.
const WIDEST: i64 = 1 << 20;
/// Noise from which on the histogram is smoothed as a whole, codes.
const WIDE: f64 = 1.5;
/// Share of the noise's variance from which on a wander moves the rows of a phase together.
const WANDERS: f64 = 0.1;
/// The same share that the noise's own estimate may be off by.
const OFF: f64 = 0.05;
/// Noise below which rows of one phase have one code, codes.
const NARROW: f64 = 0.3;

/// What the codes of a channel count in the training rows, and should count.
pub struct Counts {
    /// Code of the first cell.
    first: i64,
    /// Rows.
    seen: Vec<f64>,
    /// Rows that the model makes.
    expected: Vec<f64>,
    /// The same half a code higher: rows that it makes between a code and the next.
    between: Vec<f64>,
    /// Cells that may be asked for: inside the outermost codes, free of limits, not skipped by a step of the curve.
    free: Vec<bool>,
}

/// A run of adjacent codes that are absent.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Run {
    /// First code.
    pub first: i64,
    /// Last code.
    pub last: i64,
    /// Rows.
    pub seen: f64,
    /// Rows that there should at least be.
    pub expected: f64,
}

impl Counts {
    /// Of the training rows; `None` where the range of codes is very narrow or wide.
    pub fn of(capture: &Capture, model: &Model, channel: usize) -> Option<Self> {
        let low = capture.used_codes(channel).min()?;
        let high = capture.used_codes(channel).max()?;
        let range = i64::from(high) - i64::from(low);
        if !(8..WIDEST).contains(&range) {
            return None;
        }
        let noise2 = (model.variance.base[channel] - 1.0 / 12.0).max(0.0025);
        // A slow wander spreads the codes as noise does, but keeps the rows of a phase together.
        let wander2 = wander(capture, model, channel);
        let sigma = (noise2 + wander2).sqrt();
        let pad = (4.0 * sigma).min(1e5) as i64 + 4;
        let first = i64::from(low) - pad;
        let size = (range + 2 * pad + 1) as usize;
        let mut out = Counts {
            first,
            seen: vec![0.0; size],
            expected: vec![0.0; size],
            between: vec![0.0; size],
            free: vec![true; size],
        };
        out.count(capture, model, channel, sigma);
        out.exclude(model, channel, [i64::from(low), i64::from(high)]);
        let apart = if wander2 > WANDERS * noise2 {
            0.0
        } else {
            sigma
        };
        let repeats = repeats(capture, model, channel, apart);
        for cells in [&mut out.seen, &mut out.expected, &mut out.between] {
            cells.iter_mut().for_each(|n| *n /= repeats);
        }
        Some(out)
    }

    fn count(&mut self, capture: &Capture, model: &Model, channel: usize, sigma: f64) {
        let first = self.first;
        let add = |to: &mut Vec<f64>, code: f64, share: f64| {
            if let Some(v) = to.get_mut((code as i64 - first).max(0) as usize) {
                *v += share;
            }
        };
        let mut rows = Rows::new();
        for segment in capture.segments.iter().filter(|s| s.part != Part::HeldOut) {
            for chunk in chunks(segment.rows.clone()) {
                let (start, n) = (chunk.start, chunk.len());
                rows.fill(capture, model, chunk);
                for i in (0..n).filter(|i| !capture.is_left_out(start + i)) {
                    let signal = rows.signal[channel][i];
                    add(&mut self.seen, rows.code(channel, i), 1.0);
                    if sigma >= WIDE {
                        add(&mut self.expected, (signal + 0.5).floor(), 1.0);
                        add(&mut self.between, signal.floor(), 1.0);
                        continue;
                    }
                    let reach = (4.0 * sigma).ceil();
                    for (to, half) in [(&mut self.expected, 0.5), (&mut self.between, 0.0)] {
                        let middle = (signal + half).floor();
                        let mut code = middle - reach;
                        let mut below = normal::below((code - half - signal) / sigma);
                        while code <= middle + reach {
                            let up_to = normal::below((code + 1.0 - half - signal) / sigma);
                            add(to, code, up_to - below);
                            below = up_to;
                            code += 1.0;
                        }
                    }
                }
            }
        }
        if sigma >= WIDE {
            self.expected = smoothed(&self.expected, sigma);
            self.between = smoothed(&self.between, sigma);
        }
    }

    /// Marks the cells that say nothing of missing codes. A step of the curve that skips a code is one of the curve:
    /// noise before it makes none of the codes that it skips, the model's noise after it some.
    fn exclude(&mut self, model: &Model, channel: usize, [low, high]: [i64; 2]) {
        let limits = model.limits[channel];
        for (k, free) in self.free.iter_mut().enumerate() {
            let code = self.first + k as i64;
            *free = code > low && code < high && limits.is_free(code as f64, 1.0);
        }
        let coefficients = &model.coefficients[channel];
        let at = |k: usize| coefficients.get(SEGMENT + k).copied().unwrap_or(0.0);
        for k in 1..SEGMENTS {
            let jump = at(k) - at(k - 1);
            if jump < SKIP {
                continue;
            }
            let edge = model.full_scale_codes * (2.0 * k as f64 / SEGMENTS as f64 - 1.0);
            let from = (edge + at(k - 1) - 1.0).floor() as i64 - self.first;
            let to = (edge + at(k) + 1.0).ceil() as i64 - self.first;
            let cells = from.max(0) as usize..(to.max(0) as usize).min(self.free.len());
            if let Some(cells) = self.free.get_mut(cells) {
                cells.fill(false);
            }
        }
    }

    fn place(&self, code: i64) -> usize {
        (code - self.first).max(0) as usize
    }

    fn sum(cells: &[f64], from: usize, to: usize) -> f64 {
        cells
            .get(from..to.min(cells.len()))
            .unwrap_or_default()
            .iter()
            .sum()
    }

    /// Rows of a code.
    pub fn seen(&self, code: i64) -> f64 {
        self.seen.get(self.place(code)).copied().unwrap_or(0.0)
    }

    /// Rows that the model makes of a code.
    pub fn expected(&self, code: i64) -> f64 {
        self.expected.get(self.place(code)).copied().unwrap_or(0.0)
    }

    /// Rows that codes `first` ..= `last` should at least have: the fewest that the model makes of them with its
    /// signal half a code off or not, and no larger a share of them than of the codes to each side is there.
    fn least(&self, first: i64, last: i64) -> f64 {
        let (from, to) = (self.place(first), self.place(last) + 1);
        let least = Self::sum(&self.expected, from, to)
            .min(Self::sum(&self.between, from, to))
            .min(Self::sum(&self.between, from.saturating_sub(1), to - 1));
        if least < 1e-3 {
            return 0.0;
        }
        let enough = LEAST_AROUND.max(0.5 * least);
        let share = |cells: &mut dyn Iterator<Item = usize>| {
            let (mut seen, mut expected) = (0.0, 0.0);
            for k in cells {
                if expected >= enough {
                    break;
                }
                seen += self.seen.get(k).copied().unwrap_or(0.0);
                expected += self.expected.get(k).copied().unwrap_or(0.0);
            }
            // Where the crest is within the run the rows beyond it are those that noise or the run itself put there.
            (seen / f64::max(expected, LEAST_SEEN)).min(1.0)
        };
        let below = share(&mut (from.saturating_sub(NEAR)..from).rev());
        let above = share(&mut (to..to + NEAR));
        least * below.min(above)
    }

    /// The codes that may be asked for: code, rows, rows that there should at least be.
    pub fn cells(&self) -> Vec<(i64, f64, f64)> {
        let cells = self.seen.iter().zip(&self.free).enumerate();
        cells
            .filter(|(_, (_, free))| **free)
            .map(|(k, (seen, _))| {
                let code = self.first + k as i64;
                (code, *seen, self.least(code, code))
            })
            .collect()
    }

    /// All runs of adjacent absent codes.
    pub fn runs(&self) -> Vec<Run> {
        let mut out: Vec<Run> = Vec::new();
        let all = self.seen.iter().zip(&self.expected).zip(&self.free);
        for (k, ((seen, expected), free)) in all.enumerate() {
            if !free || *seen > ABSENT * expected {
                continue;
            }
            let code = self.first + k as i64;
            match out.last_mut().filter(|run| run.last + 1 == code) {
                Some(run) => {
                    run.last = code;
                    run.seen += seen;
                }
                None => out.push(Run {
                    first: code,
                    last: code,
                    seen: *seen,
                    expected: 0.0,
                }),
            }
        }
        for run in &mut out {
            run.expected = self.least(run.first, run.last);
        }
        out
    }
}

/// Variance of the training rows about the model beyond that of the white noise: what a wander leaves, codes squared.
fn wander(capture: &Capture, model: &Model, channel: usize) -> f64 {
    let (mut sum, mut count) = (0.0, 0.0);
    let mut rows = Rows::new();
    for segment in capture.segments.iter().filter(|s| s.part != Part::HeldOut) {
        for chunk in chunks(segment.rows.clone()) {
            let n = chunk.len();
            rows.fill(capture, model, chunk);
            for i in (0..n).filter(|i| rows.weight[channel][*i] > 0.0) {
                let error = rows.error(model, channel, i);
                sum += error * error - 1.0 / rows.weight[channel][i];
                count += 1.0;
            }
        }
    }
    let beyond = sum / f64::max(count, 1.0) - OFF * model.variance.base[channel];
    beyond.max(0.0)
}

/// Training rows that fall on the same phase and so on the same code, where noise was added after rounding or is
/// small: they count once, as all of them miss a code if the tone is a little off.
pub(super) fn repeats(capture: &Capture, model: &Model, channel: usize, sigma: f64) -> f64 {
    if sigma > NARROW && !signal::is_undithered(&model.neutral[channel]) {
        return 1.0;
    }
    let Some(word) = model.tone.word else {
        return 1.0;
    };
    let bits = 32 - word.trailing_zeros().min(31);
    let bits = model.truncation.map_or(32, |t| t.bits).min(bits);
    (capture.training_rows() as f64 / f64::powi(2.0, bits as i32)).max(1.0)
}

/// A histogram under Gaussian noise of `sigma` codes, by four passes of a moving mean.
fn smoothed(means: &[f64], sigma: f64) -> Vec<f64> {
    let half = (((3.0 * sigma * sigma + 1.0).sqrt() - 1.0) / 2.0).round() as usize;
    let mut out = means.to_vec();
    for _ in 0..4 {
        let mut sums = vec![0.0];
        let mut sum = 0.0;
        for v in &out {
            sum += v;
            sums.push(sum);
        }
        let n = out.len();
        for (k, v) in out.iter_mut().enumerate() {
            let (from, to) = (k.saturating_sub(half), (k + half + 1).min(n));
            let width = (2 * half + 1) as f64;
            *v = (sums.get(to).unwrap_or(&sum) - sums.get(from).unwrap_or(&sum)) / width;
        }
    }
    out
}
