//! `nco_spur`: lines at frequencies that follow from the tuning word.
//!
//! An oscillator that addresses its table with the upper P bits of the phase has lines at
//! (1 + k 2^P) times its frequency (Nicholas and Samueli 1987), of which all are in the difference of
//! the tone at the truncated phase and the tone itself. A single line at such a place, or a pair at
//! equal distances from the tone, is a spur too.

use super::candidates::{Effect, Known, Variant};
use super::columns::{COS, Model, SIN, TRUNCATED};
use super::gram::Combo;
use super::mains;
use super::tone::{Tone, fold};
use super::truncation::Truncation;
use crate::verdict::Step;
use std::f64::consts::PI;

/// Address bits that an oscillator may have.
pub const ADDRESS_BITS: std::ops::RangeInclusive<u32> = 3..=16;
/// Names the parameters that are sine, cosine and amplitude of a tone at truncated phases, which is the whole tone.
const TRUNCATED_TONE: &str = "truncated_tone";
/// What the search among the address bits and their two roundings costs: the logarithm of their number.
const WAYS_COST: f64 = 3.3;
/// What the search among the places costs.
const PLACES_COST: f64 = 5.0;
/// Orders k of single lines.
const ORDERS: [i64; 8] = [-1, 1, -2, 2, -3, 3, -4, 4];

/// Places of truncation spurs, turns a sample; none for a word that loses nothing.
pub fn places(tone: &Tone) -> Vec<f64> {
    let Some(word) = tone.word else {
        return Vec::new();
    };
    let truncates = |p: &u32| u64::from(word) % (1u64 << (32 - p)) != 0;
    ADDRESS_BITS
        .filter(truncates)
        .flat_map(|p| places_of(tone, p))
        .collect()
}

/// Places of the spurs of one number of address bits.
pub fn places_of(tone: &Tone, bits: u32) -> Vec<f64> {
    let word = i64::from(tone.word.unwrap_or(0));
    let steps = ORDERS.map(|k| (1 + k * (1i64 << bits.min(31))) * word);
    steps
        .map(|s| fold(s.rem_euclid(1i64 << 32) as f64 / 4_294_967_296.0))
        .to_vec()
}

/// Whether a frequency (turns a sample) is such a place, by its resolution; what is near the tone is none.
pub fn is_place(tone: &Tone, turns: f64, resolution: f64) -> bool {
    let apart = |place: &f64| (place - tone.folded()).abs();
    places(tone)
        .iter()
        .any(|p| (p - turns).abs() < 0.3 * resolution && apart(p) > 2.0 * resolution)
}

/// Whether line i is at such a place, or has a partner at the same distance from the tone. Mains itself,
/// and places within a resolution of the tone, are none.
pub fn is_spur(known: &Known, model: &Model, i: usize, rows: usize) -> bool {
    let resolution = 1.0 / rows as f64;
    let Some(turns) = model.lines.get(i).copied() else {
        return false;
    };
    if mains::is_mains(known, turns, 0.3 * resolution) {
        return false;
    }
    let tone = model.tone.folded();
    let at = is_place(&model.tone, turns, resolution);
    let mirrored = fold(2.0 * tone - turns);
    let others = model.lines.iter().enumerate().filter(|(k, _)| *k != i);
    let pair = others
        .into_iter()
        .any(|(_, t)| (t - mirrored).abs() < 0.5 * resolution);
    at || pair
}

/// The number of errors that a truncated phase has, and half the step between them, rad.
fn errors(tone: &Tone, truncation: Truncation) -> (f64, f64) {
    let word = tone.word.unwrap_or(1);
    let lost = (32 - truncation.bits.min(32)).saturating_sub(word.trailing_zeros());
    let count = f64::powi(2.0, lost as i32);
    (count, PI / truncation.steps() / count)
}

/// What truncation makes of the tone itself, beyond 1: sin(p - d) is (1 + a) sin p + b cos p in the mean over the
/// error d of the phase, which is 0 and all multiples of the phase's own step below that of the address, less half an
/// address step where that is added before truncation.
fn of_the_tone(tone: &Tone, truncation: Truncation) -> [f64; 2] {
    let (count, half) = errors(tone, truncation);
    // Sum of exp(-i d): a geometric series, by its closed form.
    let size = (count * half).sin() / (count * half.sin());
    let middle = (count - 1.0) * half - truncation.added() * count * 2.0 * half;
    [size * middle.cos() - 1.0, -size * middle.sin()]
}

/// Amplitude of the largest line that truncation makes of a tone, relative to the exact tone: order k of the sawtooth
/// of phase errors d has the mean of exp(-i d (1 + k 2^P)), a geometric series, and k = -1 is the largest; 2^-P where
/// the phase has many more bits than the address (Nicholas and Samueli 1987).
fn largest_line(tone: &Tone, truncation: Truncation) -> f64 {
    let (count, half) = errors(tone, truncation);
    ((count * half).sin() / (count * (PI / count - half).sin())).abs()
}

/// Adds to a step that has a truncated tone which oscillator that is (`address_bits`; `address_rounding_half_up`: 1 if
/// half an address step is added before truncation, 0 if none) and by channel the largest line it makes, codes.
pub fn describe(step: &mut Step, tone: &Tone, truncation: Truncation) {
    let relative = largest_line(tone, truncation);
    let mut is_truncated = false;
    for channel in ["drive", "sense"] {
        let whole = format!("{channel}_{TRUNCATED_TONE}_amplitude_codes");
        let Some(amplitude) = step.parameters.get(&whole).copied() else {
            continue;
        };
        let std = step.parameter_std.get(&whole).copied().unwrap_or(0.0);
        let name = format!("{channel}_largest_spur_codes");
        step.parameters.insert(name.clone(), amplitude * relative);
        step.parameter_std.insert(name, std * relative);
        is_truncated = true;
    }
    if is_truncated {
        let half_up = f64::from(u8::from(truncation.half_up));
        let bits = f64::from(truncation.bits);
        let counts = [
            ("address_bits", bits),
            ("address_rounding_half_up", half_up),
        ];
        step.parameters
            .extend(counts.map(|(name, value)| (name.to_owned(), value)));
    }
}

/// The truncated tone with or without what truncation does to the tone itself, or lines at the places of spurs.
pub fn variants(known: &Known, model: &Model, rows: usize) -> Vec<Variant> {
    let mut out = Vec::new();
    if let Some(truncation) = model.truncation {
        let [along, across] = of_the_tone(&model.tone, truncation);
        for channels in [&[0usize][..], &[1], &[0, 1]] {
            for with_tone in [true, false] {
                let mut combos = Vec::new();
                for channel in channels {
                    let name = if *channel == 0 { "drive" } else { "sense" };
                    let [along, across] = match with_tone {
                        true => [0.0; 2],
                        false => [along, across],
                    };
                    let parts = [
                        ("sin", [(SIN, -along), (COS, -across)]),
                        ("cos", [(COS, -along), (SIN, across)]),
                    ];
                    for (k, (part, tone)) in parts.into_iter().enumerate() {
                        let name = format!("{name}_{TRUNCATED_TONE}_{part}_codes");
                        let mut parts = vec![(*channel, TRUNCATED + k, 1.0)];
                        let tone = tone.into_iter().filter(|p| p.1 != 0.0);
                        parts.extend(tone.map(|(column, factor)| (*channel, column, factor)));
                        combos.push(Combo::new(&name, 1.0, &parts));
                    }
                }
                out.push(Variant::new(Effect::Spur, combos, WAYS_COST));
            }
        }
    }
    let own: Vec<usize> = (0..model.lines.len())
        .filter(|i| is_spur(known, model, *i, rows))
        .collect();
    // A hundred places instead of all frequencies.
    out.extend(mains::groups(model, &own, Effect::Spur, &|_| PLACES_COST));
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::TAU;

    #[test]
    fn the_largest_line_is_that_of_the_spectrum() {
        let word = 5 << 22;
        let tone = Tone {
            word: Some(word),
            turns: f64::from(word) / 4_294_967_296.0,
            offset_turns: 0.0,
        };
        for (bits, half_up) in [(3, false), (7, true), (9, false), (9, true)] {
            let truncation = Truncation { bits, half_up };
            let read: Vec<f64> = (0..1024)
                .map(|row| (TAU * truncation.phase(tone.phase(row))).sin())
                .collect();
            let amplitude = |bin: usize| {
                let sum = |wave: fn(f64) -> f64| -> f64 {
                    let at = |row: usize| TAU * (bin * row % 1024) as f64 / 1024.0;
                    let terms = read.iter().enumerate();
                    terms.map(|(row, v)| v * wave(at(row))).sum::<f64>() / 512.0
                };
                sum(f64::sin).hypot(sum(f64::cos))
            };
            let lines = (1..512).filter(|bin| *bin != 5).map(amplitude);
            let largest = lines.fold(0.0, f64::max);
            let found = largest_line(&tone, truncation);
            assert!((found - largest).abs() < 1e-9, "{bits}: {found} {largest}");
        }
    }

    #[test]
    fn the_mean_of_a_truncated_tone_is_that_over_all_phases() {
        // The phase is a multiple of 2^-10 turn, its address one of 2^-7.
        let word = 5 << 22;
        let tone = Tone {
            word: Some(word),
            turns: f64::from(word) / 4_294_967_296.0,
            offset_turns: 0.0,
        };
        for half_up in [false, true] {
            let truncation = Truncation { bits: 7, half_up };
            let mut mean = [0.0; 2];
            for row in 0..1024 {
                let phase = tone.phase(row);
                let (sin, cos) = (TAU * phase).sin_cos();
                let read = (TAU * truncation.phase(phase)).sin();
                mean[0] += read * sin / 512.0;
                mean[1] += read * cos / 512.0;
            }
            let [along, across] = of_the_tone(&tone, truncation);
            let off = (mean[0] - 1.0 - along).abs() + (mean[1] - across).abs();
            assert!(off < 1e-12, "{half_up}: {mean:?} {along} {across}");
        }
    }
}
