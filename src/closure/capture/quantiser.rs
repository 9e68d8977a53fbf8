//! The quantiser's own error where no noise makes it white: where its steps are, and what must not be believed.

use super::around::{TABLES, generous, spread};
use super::candidates::{Variant, base_ridge};
use super::columns::{Model, SAW};
use super::gram::{Combo, Detail, Gram, solve};
use super::input::Capture;
use super::search::Search;

/// Least amplitude of a line and least rms of an effect that are believed where no noise dithers the
/// quantiser, codes: its pattern makes as much.
pub const LEAST_LINE_CODES: f64 = 0.12;
const LEAST_RMS_CODES: f64 = 0.08;
/// The same where a coherent tone repeats within so few rows that its pattern is a few numbers: the rms of
/// the quantiser's error itself.
const LEAST_RMS_COHERENT_CODES: f64 = 0.3;
const COHERENT_ROWS: f64 = 1024.0;

/// Whether the quantiser's error shows undithered in a channel: the place of the steps then matters.
pub fn is_sharp(coefficients: &[Vec<f64>; 2], model: &Model) -> bool {
    coefficients
        .iter()
        .zip(model.variance.base)
        .any(|(c, v)| v < 16.0 && c.get(SAW).copied().unwrap_or(0.0).abs() > 0.3)
}

/// Finds where the codes are before anything is chosen, where the quantiser's error shows undithered: of
/// descriptions of growing freedom, each with the steps at its own signal, the one that gains most.
pub fn find_steps(capture: &Capture, model: &mut Model, base: &[Combo]) {
    if !is_sharp(&model.neutral, model) && !is_sharp(&model.coefficients, model) {
        return;
    }
    let all = generous(base, model);
    let ridge = base_ridge(base);
    let mut best: Option<(f64, [Vec<f64>; 2])> = None;
    for count in [base.len(), all.len().saturating_sub(TABLES), all.len()] {
        let combos: Vec<&Combo> = all.iter().take(count).collect();
        let mut ridge = ridge.clone();
        ridge.resize(combos.len(), 0.0);
        let mut trial = model.clone();
        trial.neutral.clone_from(&model.coefficients);
        let mut gain = 0.0;
        for _ in 0..4 {
            let gram = Gram::of(capture, &trial);
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

/// Whether a channel has too little noise, or noise after rounding, to make the quantiser's error white.
pub fn is_undithered(model: &Model, channel: usize) -> bool {
    let saw = |c: &[f64]| c.get(SAW).copied().unwrap_or(0.0).abs();
    let base = model.variance.base[channel];
    let steps = saw(&model.coefficients[channel]).max(saw(&model.neutral[channel]));
    base < 0.35 || (base < 16.0 && steps > 0.3)
}

/// Takes effects out of a set that move no undithered channel by more than the quantiser's own pattern.
pub fn drop_tiny(capture: &Capture, model: &Model, search: &Search, set: &mut Vec<usize>) {
    let rows = capture.training_rows() as f64;
    let believed = match model.tone.period_rows() <= COHERENT_ROWS {
        true => LEAST_RMS_COHERENT_CODES,
        false => LEAST_RMS_CODES,
    };
    loop {
        let energies = search.energies(set);
        let is_tiny = |energy: &[f64; 2]| {
            (0..2).all(|c| {
                let rms = (energy[c] * model.variance.base[c] / rows).sqrt();
                let least = if is_undithered(model, c) {
                    believed
                } else {
                    0.0
                };
                rms <= least
            })
        };
        let Some(at) = energies.iter().position(is_tiny) else {
            return;
        };
        set.remove(at);
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
        let gram = Gram::of(capture, model);
        let search = Search::new(gram.all(), base, nuisance, variants);
        let (combos, solved) = search.solution(set);
        model.coefficients = spread(&combos, &solved);
        model.neutral.clone_from(&model.coefficients);
    }
}
