//! How many phase bits the oscillator's table is addressed with, if truncation shows in the codes.

use super::around::LEAST_VARIANCE;
use super::columns::Model;
use super::input::Capture;
use super::spectrum::Spectrum;
use super::spur::ADDRESS_BITS;
use super::tone::fold;
use std::f64::consts::TAU;

/// Least gain in log-likelihood for a number of bits to be looked at.
const LEAST_GAIN: f64 = 8.0;

/// Least surprise of the two strongest lines together.
const LEAST_SURPRISE: f64 = 12.0;

/// The number of address bits whose truncated tone explains most of the residuals (zero where rows are
/// left out; constant and tone already taken off); `None` if none does, or the tuning word is not known.
pub fn best(
    capture: &Capture,
    model: &Model,
    residuals: [&[f64]; 2],
    spectrum: &Spectrum,
) -> Option<u32> {
    let word = model.tone.word?;
    let variances = [0, 1].map(|c: usize| spectrum.variance(c).max(LEAST_VARIANCE));
    let mut best: Option<(f64, u32)> = None;
    for bits in ADDRESS_BITS {
        let modulus = 1u64 << (32 - bits);
        if u64::from(word) % modulus == 0 {
            continue;
        }
        // Lines near the tone or near zero frequency may be noise of the amplitude or of the offset, and
        // a line must stand out of what is around it.
        let place = |k: i64| {
            let steps = (1 + k * (1i64 << bits)) * i64::from(word);
            fold(steps.rem_euclid(1i64 << 32) as f64 / 4_294_967_296.0)
        };
        let near = |k: i64| {
            let apart = (place(k) - model.tone.folded()).abs().min(place(k));
            apart * (capture.rows() as f64) < 12.0
        };
        let seen = |k: i64| spectrum.surprise_at(place(k), &model.tone, [LEAST_VARIANCE; 2]);
        if near(1) || near(-1) || seen(1) + seen(-1) < LEAST_SURPRISE {
            continue;
        }
        let gain = gain(capture, model, residuals, variances, bits);
        if gain > LEAST_GAIN && best.is_none_or(|b| gain > b.0) {
            best = Some((gain, bits));
        }
    }
    best.map(|b| b.1)
}

fn gain(
    capture: &Capture,
    model: &Model,
    residuals: [&[f64]; 2],
    variances: [f64; 2],
    bits: u32,
) -> f64 {
    let steps = f64::powi(2.0, bits as i32);
    // Phase error a turn, 0 .. 2^-bits: its constant half is the tone itself, late.
    let half = 0.5 / steps;
    let mut with = [[0.0; 2]; 2];
    let mut energy = 0.0;
    for row in 0..capture.rows() {
        let phase = model.tone.phase(row);
        let late = (phase * steps).floor() / steps - phase + half;
        let (sin, cos) = model.phases.at(row);
        let small = TAU * late;
        energy += 0.5 * small * small;
        for (with, residual) in with.iter_mut().zip(residuals) {
            let r = residual.get(row).copied().unwrap_or(0.0);
            with[0] += r * small * cos;
            with[1] -= r * small * sin;
        }
    }
    if energy <= 0.0 {
        return 0.0;
    }
    let of = |c: usize| with[c].iter().map(|w| w * w).sum::<f64>() / (2.0 * energy * variances[c]);
    of(0).max(of(1)).max(of(0) + of(1) - 2.0)
}
