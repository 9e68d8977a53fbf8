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

/// Refuses a tuning word at which the drive has no tone; without a word the tone is what was found.
///
/// # Errors
/// With the place of `ftw`: no tone at all, or one at another frequency.
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
        return Ok(());
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
