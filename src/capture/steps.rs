//! Where the quantiser's steps are, for a channel whose noise was added after rounding, or is too small to hide them.

use super::around::{TABLES, generous};
use super::candidates::{Variant, base_ridge};
use super::columns::{COS, Model, SAW, SIN, WAVE};
use super::gram::{Combo, Detail, Gram, Summed, solve, spread};
use super::input::Capture;
use super::search::combos_of;
use super::signal::LEAST_SAW;

/// Training rows from which the steps' places are found, at most (about).
const ROWS: usize = 100_000;
/// Share of the smoothed wave of the quantiser's error from which on it shows, codes: what 0.3 codes of noise leave of it.
const LEAST_WAVE: f64 = 0.05;
/// Variance that hides the steps: what leaves [`LEAST_WAVE`].
const HIDING: f64 = 0.09;

/// Whether the quantiser's error shows undithered in a channel: the place of the steps then matters. Where a random
/// instant moves the signal by what hides them, they are left at its peaks alone, where few rows say nothing of the
/// rest.
pub fn is_sharp(coefficients: &[Vec<f64>; 2], model: &Model) -> bool {
    (0..2).any(|channel| {
        let Some(c) = coefficients.get(channel) else {
            return false;
        };
        let at = |k: usize| c.get(k).copied().unwrap_or(0.0);
        let [sin, cos] = model.declared[channel];
        let slope = model.tone.angle() * (sin + at(SIN)).hypot(cos + at(COS));
        let late = 0.5 * model.variance.jitter[channel] * slope * slope;
        model.variance.base[channel] < 16.0
            && late < HIDING
            && (at(SAW).abs() > LEAST_SAW || at(WAVE).abs() > LEAST_WAVE)
    })
}

/// Finds where the codes are before anything is chosen, where the quantiser's error shows undithered: of
/// descriptions of growing freedom, each with the steps at its own signal, the one that gains most.
pub fn find_steps(capture: &Capture, model: &mut Model, base: &[Combo]) {
    if !is_sharp(&model.neutral, model) && !is_sharp(&model.coefficients, model) {
        return;
    }
    let all = generous(base, model);
    let stride = capture.training_rows().div_ceil(ROWS).max(1);
    let ridge = base_ridge(base);
    let mut best: Option<(f64, [Vec<f64>; 2])> = None;
    for count in [base.len(), all.len().saturating_sub(TABLES), all.len()] {
        let combos: Vec<&Combo> = all.iter().take(count).collect();
        let summed = Summed::of(&combos, stride);
        let mut ridge = ridge.clone();
        ridge.resize(combos.len(), 0.0);
        let mut trial = model.clone();
        trial.neutral.clone_from(&model.coefficients);
        let mut gain = 0.0;
        for _ in 0..4 {
            let gram = Gram::over(capture, &trial, &summed);
            let solved = solve(gram.all(), &combos, &ridge, Detail::All);
            trial.neutral = spread(&combos, &solved);
            gain = solved.gain - 2.0 * solved.rank as f64;
        }
        if best.as_ref().is_none_or(|b| gain > b.0) {
            best = Some((gain, trial.neutral));
        }
    }
    if let Some((_, neutral)) = best {
        model.neutral = neutral;
    }
}

/// Fits a set again until the quantiser's steps are where its own signal puts them.
pub fn settle(
    capture: &Capture,
    model: &mut Model,
    base: &[Combo],
    nuisance: &[(Combo, f64)],
    variants: &[Variant],
    set: &[usize],
) {
    for _ in 0..2 {
        let (combos, ridge) = combos_of(base, nuisance, variants, set);
        let gram = Gram::over(capture, model, &Summed::of(&combos, 1));
        let solved = solve(gram.all(), &combos, &ridge, Detail::All);
        model.coefficients = spread(&combos, &solved);
        model.neutral.clone_from(&model.coefficients);
    }
}

#[cfg(test)]
mod tests {
    use super::super::synthetic::{Made, model};
    use super::*;

    #[test]
    fn steps_are_hidden_where_a_random_instant_moves_the_signal_by_a_code() {
        let made = Made::CLEAN;
        let (_, mut model) = model(&made.capture(), &made);
        let mut coefficients = model.coefficients.clone();
        // Of the drive alone, as a tone of no amplitude is not moved.
        coefficients[0][SAW] = 1.0;
        assert!(is_sharp(&coefficients, &model));
        // Half a code rms of 200 codes.
        model.variance.jitter = [2.0 * (0.5 / (200.0 * model.tone.angle())).powi(2); 2];
        assert!(!is_sharp(&coefficients, &model));
    }
}
