//! `harmonic_distortion`: harmonics 2 to 5 of the tone, of any amplitude and phase, before the ADCs.
//!
//! A memoryless front end bends the tone as a converter does: a polynomial of low order in the
//! signal is offered here too, so that it is named as what cannot be told from nonlinearity.

use super::candidates::{Effect, Known, Variant};
use super::columns::{HARMONICS, Model, POWER, harmonic};
use super::gram::Combo;
use super::tone::{Tone, fold};

/// Highest order that tells by itself that a line is the tone's own: so few places are hardly met by chance.
pub const TELLING: usize = 40;
/// Highest order of which a line is looked for: beyond it a bend of some ten codes has none above a code of noise.
const HIGHEST: usize = 128;

/// The order of the lowest harmonic beyond those that are fitted that has this frequency (turns a sample, to `within`),
/// folded by the sample rate.
pub fn order(tone: &Tone, turns: f64, within: f64) -> Option<usize> {
    let is_at = |k: &usize| (fold(*k as f64 * tone.turns) - turns).abs() < within;
    (HARMONICS + 1..=HIGHEST).find(is_at)
}

/// Harmonics of some channels.
pub fn columns(orders: &[usize], channels: &[usize]) -> Vec<Combo> {
    let mut out = Vec::new();
    for channel in channels {
        let name = if *channel == 0 { "drive" } else { "sense" };
        for k in orders {
            let (sin, cos) = harmonic(*k);
            out.push(Combo::one(&format!("{name}_h{k}_sin_codes"), *channel, sin));
            out.push(Combo::one(&format!("{name}_h{k}_cos_codes"), *channel, cos));
        }
    }
    out
}

/// Sets of harmonics of the drive, of sense, of both; polynomials of both.
pub fn variants(known: &Known, model: &Model) -> Vec<Variant> {
    let mut out = Vec::new();
    for channels in [&[0usize][..], &[1], &[0, 1]] {
        for orders in [
            &[2usize][..],
            &[3],
            &[4],
            &[5],
            &[2, 3],
            &[2, 4],
            &[3, 5],
            &[2, 3, 4],
            &[2, 3, 4, 5],
        ] {
            let combos = columns(orders, channels);
            out.push(Variant::new(Effect::Harmonics, combos, 0.0));
        }
    }
    let power = |k: usize| {
        let parts = [(0, POWER + k - 1, 1.0), (1, POWER + k - 1, 1.0)];
        let unit = (known.full_scale_codes / model.span_codes).powi(k as i32);
        Combo::new(&format!("order{k}_at_full_scale_codes"), unit, &parts)
    };
    for orders in [&[2usize][..], &[3], &[2, 3]] {
        let combos = orders.iter().map(|k| power(*k)).collect();
        out.push(Variant::new(Effect::Harmonics, combos, 1.5));
    }
    out
}

#[cfg(test)]
mod tests {
    use super::super::synthetic_rows::{codes, judged, meta, names};

    /// A tone of 12 bits that bends over `width` codes into a limit at 0.99 of its amplitude, at one side or at both.
    fn soft(width: f64, both: bool) -> [Vec<i32>; 2] {
        // Row phases that never come back; harmonics from the eleventh on are folded.
        let limit = |x: f64| {
            let over = x - (1485.0 - width);
            match over > 0.0 {
                true => x - over + width * (over / width).tanh(),
                false => x,
            }
        };
        codes(11, 193_280_571, |channel, _, x| match channel {
            0 if both => -limit(-limit(x)),
            0 => -limit(-x),
            _ => x,
        })
    }

    #[test]
    fn folded_harmonics_of_a_bend_are_no_pickup_and_no_spur() {
        for (width, both) in [(15.0, false), (15.0, true), (30.0, true), (60.0, true)] {
            let found = judged(soft(width, both), meta(193_280_571)).2;
            let names = names(&found);
            let lines = ["nco_spur", "mains_pickup"];
            assert!(
                !names.iter().any(|n| lines.contains(n)),
                "{width} {names:?}"
            );
            assert!(!names.is_empty() || found.structure.left, "{width}");
        }
    }
}
