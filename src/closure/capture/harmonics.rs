//! `harmonic_distortion`: harmonics 2 to 5 of the tone, of any amplitude and phase, before the ADCs.
//!
//! A memoryless front end bends the tone as a converter does: a polynomial of low order in the
//! signal is offered here too, so that it is named as what cannot be told from nonlinearity.

use super::candidates::{Effect, Known, Variant};
use super::columns::{Model, POWER, harmonic};
use super::gram::Combo;

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
