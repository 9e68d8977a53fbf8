//! `adc_clipping`: the code does not pass a level, on one side or on both.
//!
//! Three signs: rows whose phase puts the tone above a level all have the same mean (a flat top), or, where
//! noise is limited with the signal, the outermost code is far more frequent than those next to it; or, within a code of
//! the crest, codes are rarer than the tone and its noise make them ([`super::crest`]).
//! What is limited is left out of all other fits.

use super::code_chances::Limiter;
use super::columns::{COS, HAT, Model, Rows, SAW, SEGMENT, SIN, chunks};
use super::crest::{Crest, Level, Side, reach};
use super::flat_top::{Inside, Profile};
use super::input::{Capture, Part};
use super::instant::Instant;
pub use super::signal::Limits;

/// What a search for limits found in one channel.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Found {
    /// The levels.
    pub limits: Limits,
    /// Gain in log-likelihood from the outermost codes' frequencies alone.
    pub pile_gain: f64,
    /// Limited training rows.
    pub rows: usize,
}

/// Rounds of the fit by phase.
const ROUNDS: usize = 12;

/// Looks for limits in the training rows of a channel. `model` gives the phases and the noise.
pub fn find(capture: &Capture, model: &Model, channel: usize) -> Option<Found> {
    let sigma = model.variance.base[channel].sqrt().max(0.05);
    let profile = Profile::of(capture, model, channel);
    let mut limits = profile.first_guess()?;
    let mut inside = Inside::default();
    for _ in 0..ROUNDS {
        inside = profile.fit(limits, 3.0 * sigma)?;
        limits = profile.levels(&inside.tone, limits, 3.0 * sigma);
    }
    let tone = inside.tone;
    let (mut flat, rows) = profile.significant(&inside, limits, sigma);
    let (piled, mut pile_gain) = pile(capture, channel, sigma);
    let (cut, cut_gain) = cut(capture, model, channel, &tone);
    pile_gain = pile_gain.max(cut_gain);
    for other in [piled, cut] {
        if !flat.high.is_finite() {
            flat.high = other.high;
        }
        if !flat.low.is_finite() {
            flat.low = other.low;
        }
    }
    // Where noise is limited too, the outermost code is the level itself.
    flat.any().then_some(Found {
        limits: flat,
        pile_gain,
        rows,
    })
}

/// Noise (with the rounding's own) up to which a level less than a code inside of the crest shows, codes.
const LOUDEST: f64 = 1.5;
/// Gain from which on the levels of several crests count together, each less what it costs.
const LEAST_CREST: f64 = 6.0;
/// What the search for a level at a crest costs.
const CREST_COST: f64 = 4.0;
/// Gain less costs that all crests together have to make.
const LEAST_CRESTS: f64 = 11.0;
/// Share of the noise that random instants may add where the tone is steepest.
const LATE: f64 = 0.1;

/// The levels that the codes at the crests tell on sides without one, if they gain enough together.
pub fn at_the_crests(capture: &Capture, model: &Model, limits: [Limits; 2]) -> Vec<(Side, Level)> {
    let mut out = Vec::new();
    for (channel, limits) in limits.iter().enumerate() {
        if is_unsteady(capture, model, channel) {
            continue;
        }
        for (sign, there) in [(1.0, limits.high), (-1.0, limits.low)] {
            if there.is_finite() || is_missing(capture, model, channel, sign) {
                continue;
            }
            let side = Side { channel, sign };
            let crest = Crest::of(capture, model, side, None, false);
            if let Some(level) = crest.and_then(|c| c.level()) {
                out.push((side, level));
            }
        }
    }
    out.retain(|(_, level)| level.gain > LEAST_CREST);
    let gain: f64 = out.iter().map(|(_, level)| level.gain - CREST_COST).sum();
    if gain < LEAST_CRESTS {
        out.clear();
    }
    out
}

/// Whether a code near the outermost is missing: its rows go to others, as those beyond a level do.
fn is_missing(capture: &Capture, model: &Model, channel: usize, sign: f64) -> bool {
    let outward = training(capture, channel).map(|(_, code)| sign * f64::from(code));
    let last = outward.fold(f64::NEG_INFINITY, f64::max);
    let first = last - 2.0 * reach(model.variance.base[channel].sqrt());
    let [low, high] = if sign > 0.0 {
        [first, last]
    } else {
        [-last, -first]
    };
    model.missing[channel].any_in(low - 1.0, high + 1.0)
}

/// Whether the codes at a crest tell no level that is less than a code inside of it: noise hides it, random instants
/// spread the rows that tell the noise more than those at the crest, or a bend passes less of the noise there.
fn is_unsteady(capture: &Capture, model: &Model, channel: usize) -> bool {
    let noise = model.variance.base[channel];
    let instant = Instant::of(model, channel);
    let codes = capture.used_codes(channel).map(i32::unsigned_abs);
    let peak = f64::from(codes.max().unwrap_or(0));
    let late = (instant.spread * peak).powi(2);
    let bends = (SIN + 2..SAW).chain(HAT..SEGMENT);
    let mut bends = bends.filter_map(|k| model.coefficients[channel].get(k));
    noise.sqrt() > LOUDEST || late + instant.bent > LATE * noise || bends.any(|b| *b != 0.0)
}

/// Limits where the codes about them are likeliest.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Placed {
    /// The levels.
    pub limits: Limits,
    /// Their standard deviations (lower, upper), codes.
    pub stds: [f64; 2],
    /// What they gain in the held-out rows by the codes' frequencies.
    pub heldout_gain: f64,
}

impl Placed {
    /// No limit.
    pub const NONE: Placed = Placed {
        limits: Limits::NONE,
        stds: [0.0; 2],
        heldout_gain: 0.0,
    };
}

/// The levels of a channel where the codes about them are likeliest.
pub fn placed(capture: &Capture, model: &Model, channel: usize) -> Placed {
    let mut out = Placed {
        limits: model.limits[channel],
        stds: [0.0; 2],
        heldout_gain: 0.0,
    };
    let mut fronts = 0;
    let sides = [(-1.0, out.limits.low), (1.0, out.limits.high)];
    for ((sign, level), std) in sides.into_iter().zip(&mut out.stds) {
        let side = Side { channel, sign };
        let crest = |held: bool| {
            let near = level.is_finite().then_some(level);
            near.and_then(|level| Crest::of(capture, model, side, Some(level), held))
        };
        let Some(found) = crest(false).map(|c| c.near(level, crest(true).as_ref())) else {
            continue;
        };
        *std = found.std;
        fronts += usize::from(found.limiter == Limiter::Front);
        out.heldout_gain += found.heldout_gain;
        match sign > 0.0 {
            true => out.limits.high = found.codes,
            false => out.limits.low = found.codes,
        }
    }
    out.limits.is_front = fronts > 0;
    out
}

/// Noise from which on rows are looked for beyond the outermost code, codes.
const LEAST_NOISE: f64 = 0.1;
/// Rows that have to be missed there: chance makes none of them in one of three million captures.
const LEAST_CUT: f64 = 15.0;

/// The outermost codes, where noise should have put rows beyond them and there are none: noise is limited
/// with the signal. Four fifths of the noise, and a quarter of a code less than both the tone and the model (whose
/// bend may stand for the limit) give, have to suffice.
fn cut(capture: &Capture, model: &Model, channel: usize, tone: &[f64; 3]) -> (Limits, f64) {
    let mut out = (Limits::NONE, 0.0);
    let codes = || training(capture, channel).map(|(_, c)| c);
    let (Some(high), Some(low)) = (codes().max(), codes().min()) else {
        return out;
    };
    let instant = Instant::of(model, channel);
    let noise = (model.variance.base[channel] - instant.bent - 1.0 / 12.0)
        .max(0.0)
        .sqrt();
    if 0.8 * noise < LEAST_NOISE {
        return out;
    }
    let sides = [(f64::from(high), 1.0), (f64::from(low), -1.0)];
    let near = near(capture, model, channel, tone, sides, 6.0 * noise);
    for ((level, sign), points) in sides.into_iter().zip(near) {
        // Jitter and the noise at the peaks are hardly told from each other there.
        let noise = match instant.spread > 0.0 {
            true => noise.min(inner_noise(&points, 2.0 * noise)),
            false => noise,
        };
        let noise = 0.8 * noise;
        if noise < LEAST_NOISE {
            continue;
        }
        let expected: f64 = points
            .iter()
            .map(|p| instant.beyond(p.under, p.tone, noise))
            .sum();
        if expected > LEAST_CUT {
            out.1 += expected;
            match sign > 0.0 {
                true => out.0.high = level,
                false => out.0.low = level,
            }
        }
    }
    out
}

/// A training row near an outermost code, codes.
struct Near {
    /// By how much tone and model are inside of the code, the larger of both.
    under: f64,
    /// By how much the row's own code is.
    code: f64,
    /// The tone, positive outward, and its slope, codes a radian.
    tone: [f64; 2],
}

/// The training rows near each of two outermost codes (and the sign of its side), up to `reach` inside of it.
fn near(
    capture: &Capture,
    model: &Model,
    channel: usize,
    tone: &[f64; 3],
    sides: [(f64, f64); 2],
    reach: f64,
) -> [Vec<Near>; 2] {
    let mut out = [Vec::new(), Vec::new()];
    let angle = model.tone.angle();
    let own = |k: usize| {
        let at = model.coefficients[channel].get(k).copied();
        at.unwrap_or(0.0) + model.declared[channel][k - SIN]
    };
    let mut rows = Rows::new();
    for segment in capture.segments.iter().filter(|s| s.part != Part::HeldOut) {
        for chunk in chunks(segment.rows.clone()) {
            let (start, n) = (chunk.start, chunk.len());
            rows.fill(capture, model, chunk);
            for i in (0..n).filter(|i| !capture.is_left_out(start + i)) {
                let at = |k: usize| rows.dense[channel][k][i];
                let tone = tone[0] + tone[1] * at(SIN) + tone[2] * at(COS);
                let signal = rows.signal[channel][i];
                for ((level, sign), out) in sides.iter().zip(&mut out) {
                    let inside = |value: f64| sign * (level - value);
                    let under = inside(tone).max(inside(signal));
                    if under < reach {
                        let part = own(SIN) * at(SIN) + own(COS) * at(COS);
                        let slope = rows.slope[channel][i] / if angle == 0.0 { 1.0 } else { angle };
                        out.push(Near {
                            under,
                            code: inside(rows.code(channel, i)),
                            tone: [sign * part, sign * slope],
                        });
                    }
                }
            }
        }
    }
    out
}

/// Codes further inside than the signal from which on their spread is known.
const LEAST_INNER: usize = 50;

/// The noise of rows less than `depth` inside an outermost code, from the codes that are further inside than the
/// signal, as no limit touches these: their mean square about the signal is the variance, with the rounding's.
/// 0 where they are few.
fn inner_noise(points: &[Near], depth: f64) -> f64 {
    let inner = points
        .iter()
        .filter(|p| p.under < depth && p.code > p.under);
    let squares: Vec<f64> = inner.map(|p| (p.code - p.under).powi(2)).collect();
    if squares.len() < LEAST_INNER {
        return 0.0;
    }
    let mean = squares.iter().sum::<f64>() / squares.len() as f64;
    (mean - 1.0 / 12.0).max(0.0).sqrt()
}

/// Row and code of the training rows.
pub(super) fn training(
    capture: &Capture,
    channel: usize,
) -> impl Iterator<Item = (usize, i32)> + '_ {
    let train = capture.segments.iter().filter(|s| s.part != Part::HeldOut);
    let rows = train.flat_map(|s| s.rows.clone());
    let rows = rows.filter(|row| !capture.is_left_out(*row));
    rows.filter_map(move |row| Some((row, *capture.codes[channel].get(row)?)))
}

/// An outermost code that is at least three times as frequent as each of the three next to it. Without
/// limiting it is at most 2.4 times: the flat of a sine; with a little noise, less than once.
fn pile(capture: &Capture, channel: usize, sigma: f64) -> (Limits, f64) {
    let mut out = Limits::NONE;
    let mut gain = 0.0;
    // Without dither few phases of a coherent tone hit a few codes each.
    if sigma < 0.4 {
        return (out, gain);
    }
    let codes: Vec<i32> = training(capture, channel).map(|(_, c)| c).collect();
    let (Some(high), Some(low)) = (codes.iter().max(), codes.iter().min()) else {
        return (out, gain);
    };
    for (outermost, step) in [(*high, -1), (*low, 1)] {
        let count = |code: i32| codes.iter().filter(|c| **c == code).count() as f64;
        let here = count(outermost);
        let next = (1..=3)
            .map(|k| count(outermost + k * step))
            .fold(0.0, f64::max);
        // Expected not more than the largest of its neighbours, and one.
        let expected = next + 1.0;
        let more = here * (here / expected).ln() - (here - expected);
        if here >= 3.0 * expected && more > 15.0 {
            gain += more;
            if step < 0 {
                out.high = f64::from(outermost);
            } else {
                out.low = f64::from(outermost);
            }
        }
    }
    (out, gain)
}

#[cfg(test)]
mod tests {
    use super::super::synthetic::{AMPLITUDE, Made, model};
    use super::super::truncation::Truncation;
    use super::*;

    /// The limits that the missing rows beyond the outermost drive codes tell.
    fn cut_of(made: &Made) -> (Limits, f64) {
        let capture = made.capture();
        let (_, model) = model(&capture, made);
        cut(&capture, &model, 0, &[0.0, 0.0, -AMPLITUDE])
    }

    #[test]
    fn noise_that_stops_at_a_code_is_cut() {
        let limit = 200.0;
        let found = cut_of(&Made {
            limit,
            ..Made::CLEAN
        });
        assert_eq!((found.0.high, found.0.low), (limit, f64::NEG_INFINITY));
        assert!(found.1 > LEAST_CUT, "{}", found.1);
    }

    #[test]
    fn a_table_that_no_step_has_does_not_move_the_tone() {
        let made = Made {
            noise: 0.3,
            limit: 195.0,
            ..Made::CLEAN
        };
        let capture = made.capture();
        let (_, mut model) = model(&capture, &made);
        model.truncation = Some(Truncation {
            bits: 4,
            half_up: false,
        });
        let found = find(&capture, &model, 0).map_or(Limits::NONE, |f| f.limits);
        assert!((found.high - 195.0).abs() < 0.1, "{found:?}");
    }

    #[test]
    fn whole_noise_is_not_cut_with_or_without_jitter() {
        for jitter in [0.0, 0.05] {
            let found = cut_of(&Made {
                jitter,
                ..Made::CLEAN
            });
            assert_eq!(found, (Limits::NONE, 0.0), "{jitter}");
        }
    }

    #[test]
    fn beside_jitter_the_codes_inside_the_peak_tell_the_noise() {
        let limit = 200.0;
        let made = Made {
            limit,
            jitter: 0.05,
            ..Made::CLEAN
        };
        assert_eq!(cut_of(&made).0.high, limit);
        // A model that takes the noise for three times what it is would miss rows that never were.
        let capture = Made {
            jitter: 0.05,
            ..Made::CLEAN
        }
        .capture();
        let loud = Made {
            jitter: 0.05,
            noise: 3.0,
            ..Made::CLEAN
        };
        let (_, loud) = model(&capture, &loud);
        let tone = [0.0, 0.0, -AMPLITUDE];
        assert_eq!(cut(&capture, &loud, 0, &tone).0, Limits::NONE);
    }

    #[test]
    fn a_random_instant_that_bends_the_peaks_cuts_nothing() {
        // Of a slow tone: the codes spread by some codes to the inside of the peaks, by the noise to the outside.
        for (jitter, noise) in [(2.0, 0.3), (0.6, 0.4), (4.0, 1.0)] {
            let made = Made {
                rows: 80_000,
                word: 0x0200_5679,
                noise,
                jitter,
                ..Made::CLEAN
            };
            let capture = made.capture();
            let (_, mut model) = model(&capture, &made);
            let lost = jitter * jitter * model.tone.angle().powi(2);
            // As the fit finds them: the mean tone, and the peaks' spread in the noise.
            let left = (-0.5 * lost).exp();
            model.variance.jitter = [(1.0 - left * left) / model.tone.angle().powi(2); 2];
            model.variance.base[0] += 0.5 * (AMPLITUDE * (1.0 - left * left)).powi(2);
            model.declared[0][1] *= left;
            let tone = [0.0, 0.0, -AMPLITUDE * left];
            let found = cut(&capture, &model, 0, &tone);
            assert_eq!(found, (Limits::NONE, 0.0), "{jitter}");
        }
    }
}
