//! `nco_spur`: lines at frequencies that follow from the tuning word.
//!
//! An oscillator that addresses its table with the upper P bits of the phase has lines at
//! (1 + k 2^P) times its frequency (Nicholas and Samueli 1987), of which all are in the difference of
//! the tone at the truncated phase and the tone itself. A single line at such a place, or a pair at
//! equal distances from the tone, is a spur too.

use super::candidates::{Effect, Known, Variant};
use super::columns::{Model, TRUNCATED};
use super::gram::Combo;
use super::mains;
use super::tone::{Tone, fold};

/// Address bits that an oscillator may have.
pub const ADDRESS_BITS: std::ops::RangeInclusive<u32> = 3..=16;
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

/// The truncated tone, or lines at the places of spurs.
pub fn variants(known: &Known, model: &Model, rows: usize) -> Vec<Variant> {
    let mut out = Vec::new();
    if let Some(bits) = model.truncation {
        for channels in [&[0usize][..], &[1], &[0, 1]] {
            let mut combos = Vec::new();
            for channel in channels {
                let name = if *channel == 0 { "drive" } else { "sense" };
                for (k, part) in ["sin", "cos"].iter().enumerate() {
                    let name = format!("{name}_{part}_of_{bits}_bit_address_codes");
                    combos.push(Combo::one(&name, *channel, TRUNCATED + k));
                }
            }
            out.push(Variant::new(Effect::Spur, combos, 2.6));
        }
    }
    let own: Vec<usize> = (0..model.lines.len())
        .filter(|i| is_spur(known, model, *i, rows))
        .collect();
    // A hundred places instead of all frequencies.
    out.extend(mains::groups(model, &own, Effect::Spur, &|_| PLACES_COST));
    out
}
