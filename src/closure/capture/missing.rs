//! `adc_missing_codes`: codes that never appear though they should; their inputs go to a neighbour.
//!
//! The histogram decides, not the mean. What a code should count is taken as the least that the tone with
//! its noise makes of it and of three codes to each side, so that an offset or a bend of a few codes,
//! or a coherent tone that hits few codes, makes no code look missing. Codes in an even spacing count
//! together: each may be expected too seldom to be missed alone.

use super::columns::{Model, Rows, chunks};
use super::input::{Capture, Part};
use super::{normal, steps};

/// Missing codes of one channel.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Missing {
    /// The codes, ascending.
    pub codes: Vec<i32>,
    /// -1: their inputs get the code below, 1: the one above.
    pub toward: f64,
}

impl Missing {
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
        for code in self.codes.iter().skip(first) {
            let distance = f64::from(*code) - signal;
            if distance > reach {
                break;
            }
            sum += if sigma > 2.0 {
                normal::density(distance / sigma) / sigma
            } else {
                normal::below((distance + 0.5) / sigma) - normal::below((distance - 0.5) / sigma)
            };
        }
        self.toward * sum
    }
}

/// A set of missing codes and how surely it is one.
#[derive(Debug, Clone, PartialEq)]
pub struct Found {
    /// By channel.
    pub missing: [Missing; 2],
    /// Gain in log-likelihood, the search taken off.
    pub gain: f64,
    /// Spacing and residue, where it is even.
    pub spacing: Option<(i64, i64)>,
    /// Rows that the codes should have had.
    pub expected_rows: f64,
}

/// Least gain of a set: one in ten thousand captures.
const LEAST_GAIN: f64 = 12.0;
/// Largest spacing.
const SPACING: i64 = 8192;
/// Codes to each side that share an expectation.
const SIDE: usize = 3;
/// Codes on each side whose counts bound an expectation.
const NEAR: usize = 24;
/// Widest range of codes that is looked at.
const WIDEST: i64 = 1 << 20;

/// What a channel's codes count, and should at least count.
struct Histogram {
    first: i64,
    counts: Vec<f64>,
    expected: Vec<f64>,
}

impl Histogram {
    fn of(capture: &Capture, model: &Model, channel: usize) -> Option<Self> {
        let low = capture.used_codes(channel).min()?;
        let high = capture.used_codes(channel).max()?;
        let range = i64::from(high) - i64::from(low);
        if !(8..WIDEST).contains(&range) {
            return None;
        }
        let sigma2 = model.variance.base[channel] - 1.0 / 12.0;
        let sigma = sigma2.max(0.0025).sqrt();
        let pad = (4.0 * sigma).min(1e5) as i64 + 4;
        let first = i64::from(low) - pad;
        let size = (range + 2 * pad + 1) as usize;
        let (mut counts, mut means) = (vec![0.0; size], vec![0.0; size]);
        let mut rows = Rows::new();
        let add = |to: &mut Vec<f64>, code: f64, share: f64| {
            if let Some(v) = to.get_mut((code as i64 - first).max(0) as usize) {
                *v += share;
            }
        };
        for segment in capture.segments.iter().filter(|s| s.part != Part::HeldOut) {
            for chunk in chunks(segment.rows.clone()) {
                let (start, n) = (chunk.start, chunk.len());
                rows.fill(capture, model, chunk);
                for i in (0..n).filter(|i| !capture.is_left_out(start + i)) {
                    let signal = rows.signal[channel][i];
                    add(&mut counts, rows.code(channel, i), 1.0);
                    if sigma >= 1.5 {
                        add(&mut means, (signal + 0.5).floor(), 1.0);
                        continue;
                    }
                    let middle = (signal + 0.5).floor();
                    let reach = (4.0 * sigma).ceil();
                    let mut code = middle - reach;
                    let mut below = normal::below((code - 0.5 - signal) / sigma);
                    while code <= middle + reach {
                        let up_to = normal::below((code + 0.5 - signal) / sigma);
                        add(&mut means, code, up_to - below);
                        below = up_to;
                        code += 1.0;
                    }
                }
            }
        }
        if sigma >= 1.5 {
            means = smoothed(&means, sigma);
        }
        let expected = (0..size)
            .map(|k| {
                let near = means.get(k.saturating_sub(SIDE)..(k + SIDE + 1).min(size));
                let least = near
                    .unwrap_or_default()
                    .iter()
                    .copied()
                    .fold(f64::INFINITY, f64::min);
                least.min(around(&counts, k))
            })
            .collect();
        let repeats = repeats(capture, model, channel);
        let per_phase = |cells: Vec<f64>| cells.into_iter().map(|n| n / repeats).collect();
        Some(Histogram {
            first,
            counts: per_phase(counts),
            expected: per_phase(expected),
        })
    }

    /// The codes inside the range, without a margin at the ends: index, count, expectation.
    fn inside(&self, limits: super::clipping::Limits) -> Vec<(i64, f64, f64)> {
        let occupied = |(k, n): (usize, &f64)| (*n > 0.0).then_some(k);
        let mut all = self.counts.iter().enumerate();
        let low = all.clone().find_map(occupied).unwrap_or(0) + 2;
        let high = all
            .rfind(|(_, n)| **n > 0.0)
            .map_or(0, |(k, _)| k)
            .saturating_sub(2);
        (low..high.max(low))
            .filter_map(|k| {
                let code = self.first + k as i64;
                let free = limits.is_free(code as f64, 1.0);
                free.then_some((code, *self.counts.get(k)?, *self.expected.get(k)?))
            })
            .collect()
    }
}

/// Training rows that fall on the same phase and so on the same code, where noise was added after rounding: they
/// count once, as all of them miss a code if the tone is a little off.
fn repeats(capture: &Capture, model: &Model, channel: usize) -> f64 {
    if !steps::is_undithered(&model.neutral[channel]) {
        return 1.0;
    }
    let Some(word) = model.tone.word else {
        return 1.0;
    };
    let bits = 32 - word.trailing_zeros().min(31);
    let bits = model.truncation.unwrap_or(32).min(bits);
    (capture.training_rows() as f64 / f64::powi(2.0, bits as i32)).max(1.0)
}

/// The smaller of the mean counts of the codes below and above `k`, its neighbours left out: where a
/// coherent tone or what the model lacks leaves gaps, nothing is expected.
fn around(counts: &[f64], k: usize) -> f64 {
    let mean = |from: usize, to: usize| {
        let cells = counts.get(from..to.min(counts.len())).unwrap_or_default();
        cells.iter().sum::<f64>() / NEAR as f64
    };
    let below = mean(k.saturating_sub(NEAR + 1), k.saturating_sub(1));
    below.min(mean(k + 2, k + 2 + NEAR))
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

/// What is gained by `count` instead of `expected` rows.
fn poisson_gain(count: f64, expected: f64) -> f64 {
    if count >= expected {
        return 0.0;
    }
    let log = if count > 0.0 {
        count * (count / expected).ln()
    } else {
        0.0
    };
    expected - count + log
}

/// Looks for missing codes in the training rows: in an even spacing in both channels or one, or code by
/// code.
pub fn find(capture: &Capture, model: &Model) -> Option<Found> {
    let histograms: Vec<Option<Vec<(i64, f64, f64)>>> = (0..2)
        .map(|c| Histogram::of(capture, model, c).map(|h| h.inside(model.limits[c])))
        .collect();
    let cells = |c: usize| {
        histograms
            .get(c)
            .and_then(Option::as_deref)
            .unwrap_or_default()
    };
    let mut best: Option<(f64, Vec<usize>, i64, i64)> = None;
    for channels in [vec![0, 1], vec![0], vec![1]] {
        if let Some((gain, spacing, residue)) =
            spaced(&channels.iter().map(|c| cells(*c)).collect::<Vec<_>>())
            && best.as_ref().is_none_or(|b| gain > b.0)
        {
            best = Some((gain, channels, spacing, residue));
        }
    }
    let single = singles([cells(0), cells(1)]);
    let single_gain = single.1;
    let mut missing = [Missing::default(), Missing::default()];
    let (mut gain, mut spacing) = (single_gain, None);
    match best {
        Some((even, channels, step, residue)) if even >= single_gain => {
            (gain, spacing) = (even, Some((step, residue)));
            for c in channels {
                let of = |(code, ..): &(i64, f64, f64)| code.rem_euclid(step) == residue;
                missing[c].codes = cells(c)
                    .iter()
                    .filter(|x| of(x))
                    .map(|x| x.0 as i32)
                    .collect();
            }
        }
        _ => {
            let [drive, sense] = single.0;
            missing[0].codes = drive;
            missing[1].codes = sense;
        }
    }
    if gain < LEAST_GAIN {
        return None;
    }
    let mut expected_rows = 0.0;
    for (c, m) in missing.iter_mut().enumerate() {
        let of = |code: i64| cells(c).binary_search_by_key(&code, |x| x.0).ok();
        let count = |code: i64| of(code).and_then(|k| cells(c).get(k)).map_or(0.0, |x| x.1);
        let side = |step: i64| {
            m.codes
                .iter()
                .map(|k| count(i64::from(*k) + step))
                .sum::<f64>()
        };
        m.toward = if side(1) > side(-1) { 1.0 } else { -1.0 };
        let expected = |k: &i32| {
            of(i64::from(*k))
                .and_then(|k| cells(c).get(k))
                .map_or(0.0, |x| x.2)
        };
        expected_rows += m.codes.iter().map(expected).sum::<f64>();
    }
    Some(Found {
        missing,
        gain,
        spacing,
        expected_rows,
    })
}

/// The best even spacing: gain (the search taken off), spacing, residue.
fn spaced(channels: &[&[(i64, f64, f64)]]) -> Option<(f64, i64, i64)> {
    let total: f64 = channels.iter().flat_map(|c| c.iter()).map(|x| x.2).sum();
    let widest = channels.iter().map(|c| c.len()).max().unwrap_or(0);
    let longest = SPACING.min((total / 20.0) as i64).min(widest as i64 / 3);
    let mut best: Option<(f64, i64, i64)> = None;
    for spacing in 2..=longest {
        for residue in 0..spacing {
            let classes = channels.iter().map(|cells| class(cells, spacing, residue));
            // What appears at all is not missing: most classes end within a few codes.
            let allowed = 0.002 * total / spacing as f64;
            let mut count = 0.0;
            for cell in classes.clone().flatten() {
                count += cell.1;
                if count > allowed {
                    break;
                }
            }
            if count > allowed {
                continue;
            }
            let expected: f64 = classes.flatten().map(|x| x.2).sum();
            let gain = poisson_gain(count, expected) - 2.0 * (spacing as f64).ln() - 2.0;
            if best.is_none_or(|b| gain > b.0) {
                best = Some((gain, spacing, residue));
            }
        }
    }
    best
}

/// The cells (of ascending, contiguous codes) of a residue.
fn class(
    cells: &[(i64, f64, f64)],
    spacing: i64,
    residue: i64,
) -> impl Iterator<Item = &(i64, f64, f64)> + Clone {
    let first = cells.first().map_or(0, |x| x.0);
    let skip = (residue - first).rem_euclid(spacing) as usize;
    cells
        .get(skip..)
        .unwrap_or_default()
        .iter()
        .step_by(spacing.max(1) as usize)
}

/// Codes that are missing each for itself, and their gain together.
fn singles(channels: [&[(i64, f64, f64)]; 2]) -> ([Vec<i32>; 2], f64) {
    let all = channels.iter().map(|c| c.len()).sum::<usize>().max(1) as f64;
    let mut gain = 0.0;
    let codes = channels.map(|cells| {
        let mut codes = Vec::new();
        for (code, count, expected) in cells {
            let own = expected - all.ln();
            if *count == 0.0 && own > 3.0 {
                gain += own;
                codes.push(*code as i32);
            }
        }
        codes
    });
    (codes, gain)
}
