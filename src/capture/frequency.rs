//! Whether the drive's tone is where the tuning word says.

use super::input::Capture;
use super::tone::{Tone, strongest};
use crate::error::{InputError, Result};
use std::f64::consts::TAU;

/// Share of the codes' variance from which on nothing else can be the tone.
const MOST_OF_IT: f64 = 0.5;
/// How much larger another line's amplitude is, to be the tone.
const LARGER: f64 = 2.0;
/// Power of a line over that of noise in one bin below which there is none: noise makes it once in a million captures.
const LEAST_POWER: f64 = 14.0;

/// Blocks over which the tone's phase is followed, at most.
const BLOCKS: usize = 16;
/// The same, at least: with fewer a course is always nearly straight.
const LEAST_BLOCKS: usize = 6;
/// Periods of a block, at least: with fewer its phase depends on where it begins.
const LEAST_PERIODS_OF_A_BLOCK: f64 = 4.0;
/// Drift of the phase over the capture from which on the word is wrong, turns: less is a few per cent of the tone.
const LEAST_DRIFT: f64 = 0.01;
/// The same over what its course has beside a straight line: random walks of the phase stay below half of it.
const STRAIGHT: f64 = 10.0;

/// Refuses a tuning word at which the drive has no tone; without a word the tone is what was found.
///
/// # Errors
/// With the place of `ftw`: no tone at all, one at another frequency, or one whose phase runs away from the word's.
pub fn checked(capture: &Capture, tone: &Tone) -> Result<()> {
    if tone.word.is_none() {
        return Ok(());
    }
    let rows = capture.used_rows() as f64;
    let mean = capture.used_codes(0).map(f64::from).sum::<f64>() / rows;
    let squares = capture.used_codes(0).map(|c| (f64::from(c) - mean).powi(2));
    let variance = (squares.sum::<f64>() / rows).max(1e-12);
    let at = |turns: f64| amplitude(capture, mean, turns);
    let here = at(tone.turns);
    if 0.5 * here * here > MOST_OF_IT * variance {
        return match drift(capture, mean, tone) {
            Some(turns) => Err(drifting(capture, tone, turns)),
            None => Ok(()),
        };
    }
    let other = strongest(capture).map(|t| (t.turns, at(t.turns)));
    let told = |turns: f64| match capture.meta.fs_hz {
        Some(fs) => format!("{} Hz", turns * fs),
        None => format!("{turns} turns a sample"),
    };
    let power = |a: f64| 0.25 * a * a * rows / variance;
    let message = match other {
        Some((turns, size)) if size > LARGER * here && power(size) > LEAST_POWER + rows.ln() => {
            format!(
                "`ftw` puts the drive's tone at {}, and the drive codes have it at {}",
                told(tone.folded()),
                told(turns)
            )
        }
        _ if power(here) < LEAST_POWER => {
            format!(
                "the drive codes have no tone at {}, where `ftw` puts it",
                told(tone.folded())
            )
        }
        _ => return Ok(()),
    };
    let error = InputError::new(message).help(
        "give the oscillator's tuning word, frequency over sample rate times 2^32, or take the line away: the tone is \
         then looked for",
    );
    Err(capture.places.put("ftw", error).into())
}

fn drifting(capture: &Capture, tone: &Tone, turns: f64) -> crate::error::Error {
    let share = turns / (tone.turns * capture.rows() as f64);
    let error = InputError::new(format!(
        "the phase of the drive codes runs away from that of `ftw` by {turns:+.3} turn over the capture: the tone is \
         off by {:+.4} % of its frequency",
        100.0 * share
    ))
    .help(
        "give the oscillator's tuning word, frequency over sample rate times 2^32, or take the line away: the tone is \
         then looked for",
    );
    capture.places.put("ftw", error).into()
}

/// Turns that the phase of the drive codes gains on the word's over the capture, where its course is a straight line.
fn drift(capture: &Capture, mean: f64, tone: &Tone) -> Option<f64> {
    let rows = capture.rows();
    let periods = tone.folded() * rows as f64;
    let count = BLOCKS.min((periods / LEAST_PERIODS_OF_A_BLOCK) as usize);
    if count < LEAST_BLOCKS {
        return None;
    }
    let mut sums = vec![[0.0; 2]; count];
    for (row, code) in capture.codes[0].iter().enumerate() {
        if !capture.is_left_out(row)
            && let Some(sum) = sums.get_mut(row * count / rows)
        {
            let (sin, cos) = (TAU * tone.phase(row)).sin_cos();
            sum[0] += (f64::from(*code) - mean) * sin;
            sum[1] += (f64::from(*code) - mean) * cos;
        }
    }
    // From block to block the phase moves by less than half a turn: the tone is near the word's frequency.
    let mut phases: Vec<f64> = sums.iter().map(|[s, c]| c.atan2(*s) / TAU).collect();
    for k in 1..count {
        phases[k] -= (phases[k] - phases[k - 1]).round();
    }
    let middle = 0.5 * (count as f64 - 1.0);
    let level = phases.iter().sum::<f64>() / count as f64;
    let at = |k: usize| k as f64 - middle;
    let square: f64 = (0..count).map(|k| at(k).powi(2)).sum();
    let slope = phases
        .iter()
        .enumerate()
        .map(|(k, p)| at(k) * p)
        .sum::<f64>()
        / square;
    let rest = phases.iter().enumerate();
    let rest = rest
        .map(|(k, p)| (p - level - slope * at(k)).powi(2))
        .sum::<f64>();
    let turns = slope * count as f64;
    let apart = (rest / (count - 2) as f64).sqrt();
    (turns.abs() > LEAST_DRIFT && turns.abs() > STRAIGHT * apart).then_some(turns)
}

/// Amplitude of a line in the drive codes, of which `mean` is taken off.
fn amplitude(capture: &Capture, mean: f64, turns: f64) -> f64 {
    let (mut sin_sum, mut cos_sum, mut rows) = (0.0, 0.0, 0.0);
    for (row, code) in capture.codes[0].iter().enumerate() {
        if !capture.is_left_out(row) {
            let (sin, cos) = (TAU * (turns * row as f64).fract()).sin_cos();
            sin_sum += (f64::from(*code) - mean) * sin;
            cos_sum += (f64::from(*code) - mean) * cos;
            rows += 1.0;
        }
    }
    2.0 * sin_sum.hypot(cos_sum) / f64::max(rows, 1.0)
}
