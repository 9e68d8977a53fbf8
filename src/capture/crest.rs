//! How likely the codes at a crest of the tone are, with a level that they do not pass and without one.
//!
//! A level that is less than a code inside of the crest shows in no mean by phase, as the quantiser itself is flat for
//! half a code there. It shows in how often each code appears: the fitted tone with its noise says how often, row by
//! row, and with a level the codes beyond it are rarer. The same likelihood tells where a level is, and how well the
//! codes know it: where all readings beyond it are one code, no better than within that code.
//!
//! What is smooth in the code (a bend, a gain error) is an offset of all rows within a few codes of the crest, with a
//! small slope: both are free, and so is the noise, with a level and without one.

use super::code_chances::{Cell, Chances, Limiter, Noise, cells, width};
use super::code_counts::repeats;
use super::columns::{Model, Rows, chunks};
use super::input::{Capture, Part};
use super::signal;

/// Codes inside the crest, beside four deviations of the noise, of which the rows are looked at.
const INSIDE: f64 = 2.0;
/// Deviations of the offset (codes), of the slope and of the noise's logarithm at the crest, against what all rows tell:
/// a bend that is too small to be seen in all rows moves the crest by no more.
const LOOSE: [f64; 3] = [0.1, 0.01, 0.05];
/// Times that the steps of a fit are halved.
const HALVINGS: usize = 7;
/// Places of a level that are tried first, codes inside the crest.
const DEPTHS: [f64; 6] = [0.1, 0.2, 0.35, 0.6, 1.0, 1.6];
/// Places of a level in its distribution, each side.
const PLACES: i32 = 75;
/// Nats below the likeliest place at which a level's distribution ends.
const UNLIKELY: f64 = 40.0;

/// A side of a channel.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Side {
    /// 0 the drive's, 1 the sense channel.
    pub channel: usize,
    /// 1 upper, -1 lower.
    pub sign: f64,
}

/// A level and how well the codes know it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Level {
    /// Codes.
    pub codes: f64,
    /// Its standard deviation, codes.
    pub std: f64,
    /// What is limited.
    pub limiter: Limiter,
    /// Gain in log-likelihood over no level, offset, slope and noise at the crest free in both.
    pub gain: f64,
    /// The same of the held-out rows, with what the training rows tell.
    pub heldout_gain: f64,
}

/// What the rows near a crest count.
pub struct Crest {
    cells: Vec<Cell>,
    /// Outermost signal, codes.
    top: f64,
    noise: Noise,
    sign: f64,
}

/// The free parameters.
#[derive(Debug, Clone, Copy)]
struct Free {
    /// Offset (codes), slope, logarithm of the noise over that of all rows.
    crest: [f64; 3],
    /// Level, codes.
    level: f64,
}

impl Crest {
    /// Of the training (or held-out) rows of a channel on one side, from a level (or the crest itself) inward; `None`
    /// without rows.
    pub fn of(
        capture: &Capture,
        model: &Model,
        side: Side,
        level: Option<f64>,
        held: bool,
    ) -> Option<Self> {
        let Side { channel, sign } = side;
        let sigma = model.variance.base[channel].max(1.0 / 12.0).sqrt();
        let mut rows = signals(capture, model, side, held);
        let free = rows.iter().filter(|row| row.is_free);
        let free = free.map(|row| (row.signal, row.code));
        let noise = Noise::of(free, sigma, signal::is_undithered(&model.neutral[channel]));
        let top = rows.iter().map(|r| r.signal);
        let top = top.fold(f64::NEG_INFINITY, f64::max);
        let reach = reach(sigma);
        let edge = level.map_or(top, |l| sign * l);
        rows.retain(|r| r.signal > edge - reach);
        let repeats = repeats(capture, model, channel, sigma);
        let width = width(sigma);
        // Far beyond a level all rows are alike.
        let placed = |row: &Row| (row.signal.min(edge + reach) - edge, row.code);
        let mut cells = cells(rows.iter().map(placed), width);
        for cell in &mut cells {
            cell.signal += edge;
            cell.count /= repeats;
        }
        (!cells.is_empty()).then_some(Crest {
            cells,
            top,
            noise,
            sign,
        })
    }

    /// Log-likelihood of the rows and of the parameters.
    fn likelihood(&self, free: &Free, limiter: Option<Limiter>) -> f64 {
        let [offset, slope, louder] = free.crest;
        let noise = Noise {
            sigma: self.noise.sigma * louder.exp(),
            ..self.noise
        };
        let limit = limiter.map(|l| (l, free.level));
        let moved = |signal: f64| signal + offset + slope * (signal - self.top);
        Chances::of(&noise, limit).likelihood(&self.cells, moved) - prior(free)
    }

    /// The likeliest parameters, by steps along each that halve.
    fn fit(&self, start: Free, limiter: Option<Limiter>) -> (Free, f64) {
        let mut steps = [0.1, 0.01, 0.05, 0.2];
        let mut best = (start, self.likelihood(&start, limiter));
        let count = if limiter.is_some() { 4 } else { 3 };
        for _ in 0..HALVINGS {
            for _ in 0..6 {
                let before = best.1;
                for (k, step) in steps.iter().enumerate().take(count) {
                    for by in [*step, -step] {
                        let mut free = best.0;
                        match free.crest.get_mut(k) {
                            Some(v) => *v += by,
                            None => free.level += by,
                        }
                        let value = self.likelihood(&free, limiter);
                        if value > best.1 {
                            best = (free, value);
                        }
                    }
                }
                if best.1 < before + 0.01 {
                    break;
                }
            }
            steps.iter_mut().for_each(|s| *s *= 0.5);
        }
        best
    }

    /// The likeliest parameters without a level.
    fn free_of_limits(&self) -> (Free, f64) {
        let start = Free {
            crest: [0.0; 3],
            level: f64::INFINITY,
        };
        self.fit(start, None)
    }

    /// The level that makes the codes at the crest likeliest, and what it gains.
    pub fn level(&self) -> Option<Level> {
        let (plain, without) = self.free_of_limits();
        let mut best: Option<(Free, f64, Limiter)> = None;
        for limiter in [Limiter::Front, Limiter::Whole] {
            let places = DEPTHS.iter().map(|depth| {
                let free = Free {
                    level: self.top - depth,
                    ..plain
                };
                (free, self.likelihood(&free, Some(limiter)))
            });
            let (start, value) = places.max_by(|a, b| a.1.total_cmp(&b.1))?;
            // What gains nothing beside the parameters without a level gains little with its own.
            if value < without + 1.0 {
                continue;
            }
            let (free, value) = self.fit(start, Some(limiter));
            if best.is_none_or(|b| value > b.1) {
                best = Some((free, value, limiter));
            }
        }
        let (free, value, limiter) = best?;
        Some(Level {
            gain: value - without,
            ..self.placed(free, limiter)
        })
    }

    /// Where a level is that is near a known one, and what it gains, in `held` too.
    pub fn near(&self, level: f64, held: Option<&Crest>) -> Level {
        let start = Free {
            crest: [0.0; 3],
            level: self.sign * level,
        };
        let fitted = |limiter: Limiter| (limiter, self.fit(start, Some(limiter)));
        let [front, whole] = [Limiter::Front, Limiter::Whole].map(fitted);
        let is_front = front.1.1 >= whole.1.1;
        let (limiter, (free, value)) = if is_front { front } else { whole };
        let (plain, without) = self.free_of_limits();
        let heldout = |held: &Crest| {
            let without = held.likelihood(&plain, None) + prior(&plain);
            held.likelihood(&free, Some(limiter)) + prior(&free) - without
        };
        Level {
            gain: value - without,
            heldout_gain: held.map_or(0.0, heldout),
            ..self.placed(free, limiter)
        }
    }

    /// Mean and deviation of a level over its places near the likeliest, each as likely before: a level within a code
    /// that all rows beyond it have is anywhere in it.
    fn placed(&self, free: Free, limiter: Limiter) -> Level {
        let reach = 1.5 + 0.5 * self.noise.sigma;
        let step = reach / f64::from(PLACES);
        let places = (-PLACES..=PLACES).map(|k| {
            let level = free.level + f64::from(k) * step;
            (
                level,
                self.likelihood(&Free { level, ..free }, Some(limiter)),
            )
        });
        let places: Vec<(f64, f64)> = places.collect();
        let highest = places.iter().map(|p| p.1).fold(f64::NEG_INFINITY, f64::max);
        let (mut sum, mut first, mut second) = (0.0, 0.0, 0.0);
        for (level, value) in &places {
            let weight = (value - highest).max(-UNLIKELY).exp();
            let apart = level - free.level;
            sum += weight;
            first += weight * apart;
            second += weight * apart * apart;
        }
        let mean = first / sum;
        let variance = (second / sum - mean * mean).max(0.0);
        Level {
            codes: self.sign * (free.level + mean),
            // Within a cell of the signal, and between two places, nothing is known better.
            std: variance.sqrt().max(0.5 * step),
            limiter,
            gain: 0.0,
            heldout_gain: 0.0,
        }
    }
}

/// What the parameters of a crest cost.
fn prior(free: &Free) -> f64 {
    let loose = free.crest.iter().zip(LOOSE);
    loose.map(|(v, s)| 0.5 * (v / s).powi(2)).sum()
}

/// Codes inside a level or a crest of which the rows are looked at.
pub(super) fn reach(sigma: f64) -> f64 {
    INSIDE + 4.0 * sigma
}

/// A row near a crest, positive outward, codes.
struct Row {
    signal: f64,
    code: f64,
    /// Whether no limit touches it.
    is_free: bool,
}

/// Whether a missing code is near a signal.
fn is_moved(model: &Model, channel: usize, signal: f64) -> bool {
    let near = 1.0 + 3.0 * model.variance.base[channel].sqrt();
    model.missing[channel].any_in(signal - near, signal + near)
}

/// The training or the held-out rows of a side.
fn signals(capture: &Capture, model: &Model, side: Side, held: bool) -> Vec<Row> {
    let Side { channel, sign } = side;
    let mut out = Vec::new();
    let mut rows = Rows::new();
    let wanted = |part: Part| (part == Part::HeldOut) == held;
    for segment in capture.segments.iter().filter(|s| wanted(s.part)) {
        for chunk in chunks(segment.rows.clone()) {
            let (start, n) = (chunk.start, chunk.len());
            rows.fill(capture, model, chunk);
            let used = (0..n).filter(|i| !capture.is_left_out(start + i));
            out.extend(used.map(|i| Row {
                signal: sign * rows.signal[channel][i],
                code: sign * rows.code(channel, i),
                is_free: rows.weight[channel][i] > 0.0
                    && !is_moved(model, channel, rows.signal[channel][i]),
            }));
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::super::clipping::{Limits, at_the_crests, placed};
    use super::super::synthetic::{AMPLITUDE, Made, model};
    use super::*;

    const NONE: [Limits; 2] = [Limits::NONE; 2];

    /// The levels that are found at the crests of a capture.
    fn found(made: &Made) -> Vec<(Side, Level)> {
        let capture = made.capture();
        let (_, model) = model(&capture, made);
        at_the_crests(&capture, &model, NONE)
    }

    #[test]
    fn a_level_less_than_a_code_inside_of_the_crest_shows_in_the_codes() {
        for (noise, limit, code) in [(0.3, 199.9, 200.0), (0.2, 200.1, 200.0)] {
            let made = Made {
                rows: 60_000,
                noise,
                limit,
                ..Made::CLEAN
            };
            let [(side, level)] = found(&made)[..] else {
                panic!("{noise} {limit}");
            };
            assert_eq!((side.channel, side.sign), (0, 1.0));
            // Noise is limited too: all that is beyond has one code, and the level is anywhere in it.
            assert!((level.codes - code).abs() < 0.1, "{level:?}");
            assert!((level.std - 12f64.sqrt().recip()).abs() < 0.03, "{level:?}");
        }
    }

    #[test]
    fn no_level_is_found_where_none_is() {
        for noise in [0.1, 0.15, 0.3, 0.6, 1.2] {
            for after in [false, true] {
                for word in [Made::CLEAN.word, 1 << 24, 3 << 20] {
                    let made = Made {
                        noise,
                        after,
                        word,
                        ..Made::CLEAN
                    };
                    assert_eq!(found(&made), [], "{noise} {after} {word:x}");
                }
            }
        }
    }

    #[test]
    fn a_level_is_as_sure_as_the_codes_make_it() {
        // Half a code of noise behind the limit: its mean is known to some hundredths.
        let made = Made {
            noise: 0.5,
            ..Made::CLEAN
        };
        let mut capture = made.capture();
        let (_, mut model) = model(&capture, &made);
        let noise = crate::plant::noise::Noise::new(11, 0);
        for (row, code) in capture.codes[0].iter_mut().enumerate() {
            let turns = model.tone.phase(row);
            let signal = -AMPLITUDE * (std::f64::consts::TAU * turns).cos();
            *code = (signal.min(190.3) + 0.5 * noise.gaussian_pair(row as u64).0).round() as i32;
        }
        model.limits[0].high = 191.0;
        let found = placed(&capture, &model, 0);
        assert!(found.limits.is_front && found.heldout_gain > 10.0);
        let std = found.stds[1];
        assert!(std > 0.005 && std < 0.05, "{std}");
        assert!((found.limits.high - 190.3).abs() < 4.0 * std, "{found:?}");
    }
}
