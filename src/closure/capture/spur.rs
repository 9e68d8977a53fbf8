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
use std::f64::consts::TAU;

/// Address bits that an oscillator may have.
pub const ADDRESS_BITS: std::ops::RangeInclusive<u32> = 3..=16;
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
    let at = places(&model.tone)
        .iter()
        .any(|p| (p - turns).abs() < 0.3 * resolution && (p - tone).abs() > 2.0 * resolution);
    let mirrored = fold(2.0 * tone - turns);
    let others = model.lines.iter().enumerate().filter(|(k, _)| *k != i);
    let pair = others
        .into_iter()
        .any(|(_, t)| (t - mirrored).abs() < 0.5 * resolution);
    at || pair
}

/// What truncation makes of the tone itself, beyond 1: sin(p - d) is (1 + a) sin p + b cos p in the mean over the
/// error d of the phase, which is 0 and all multiples of the phase's own step below that of the address, less half an
/// address step where that is added before truncation.
fn of_the_tone(tone: &Tone, truncation: Truncation) -> [f64; 2] {
    let bits = truncation.bits;
    let word = tone.word.unwrap_or(1);
    let lost = (32 - bits.min(32)).saturating_sub(word.trailing_zeros());
    let count = f64::powi(2.0, lost as i32);
    let step = TAU / f64::powi(2.0, bits as i32) / count;
    // Sum of exp(-i d): a geometric series, by its closed form.
    let half = 0.5 * step;
    let size = (count * half).sin() / (count * half.sin());
    let middle = (count - 1.0) * half - truncation.added() * count * step;
    [size * middle.cos() - 1.0, -size * middle.sin()]
}

/// The truncated tone with or without what truncation does to the tone itself, or lines at the places of spurs.
pub fn variants(known: &Known, model: &Model, rows: usize) -> Vec<Variant> {
    let mut out = Vec::new();
    if let Some(truncation) = model.truncation {
        let bits = truncation.bits;
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
                        let name = format!("{name}_{part}_of_{bits}_bit_address_codes");
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
