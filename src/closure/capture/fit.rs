//! The rounds of the fit: noise, lines and nonlinear parts around the model, then the set of effects.

use super::around::{add_lines, add_slow_mains, around, spectrum_of, spread};
use super::candidates::{Effect, Known, Variant, base, base_ridge, variants};
use super::clipping::{self, Limits};
use super::columns::{ALL, Model, Variance};
use super::gram::{Combo, Detail, Gram, solve};
use super::input::Capture;
use super::missing::{self, Missing};
use super::quantiser::{drop_tiny, find_steps, is_sharp, settle};
use super::search::Search;
use super::tone::{Phases, Tone};
use super::{feedthrough, jitter, truncation, wander};

/// Least variance of a channel's noise, codes squared: nearly that of an ideal quantiser's error, whose
/// pattern is not white without noise.
pub const LEAST_VARIANCE: f64 = 0.07;
/// Rounds at most.
const ROUNDS: usize = 6;
/// Gain that jitter has to make: one free parameter.
const JITTER_COST: f64 = 9.0;

/// The outcome of the rounds.
pub struct Fitted {
    /// At the chosen effects.
    pub model: Model,
    /// Sums at it.
    pub gram: Gram,
    /// Always in the fit.
    pub base: Vec<Combo>,
    /// Slow noise.
    pub nuisance: Vec<(Combo, f64)>,
    /// All linear candidates.
    pub variants: Vec<Variant>,
    /// The chosen ones.
    pub set: Vec<usize>,
    /// Gain less costs of all.
    pub objective: f64,
    /// What clipping gains, if it was taken.
    pub clipping: Option<f64>,
    /// Missing codes, if taken.
    pub missing: Option<missing::Found>,
    /// Jitter, as fitted.
    pub jitter: Option<jitter::Found>,
    /// Whether it was taken.
    pub jitter_taken: bool,
    /// Residuals of the generous fit, all rows.
    pub residuals: [Vec<f64>; 2],
    /// Noise of both channels, from the spectrum.
    pub noise: [f64; 2],
}

/// The declared model.
pub fn declared(capture: &Capture, known: &Known, tone: Tone) -> Model {
    let amplitude = capture.meta.drive_amplitude_codes.unwrap_or(0.0);
    let sense = known
        .in_phase
        .map_or([0.0; 2], |([s, c], codes)| [s * codes, c * codes]);
    let largest = capture
        .codes
        .iter()
        .flatten()
        .map(|c| c.unsigned_abs())
        .max();
    Model {
        tone,
        phases: Phases::of(&tone, capture.rows()),
        neutral: [vec![0.0; ALL], vec![0.0; ALL]],
        declared: [[0.0, -amplitude], sense],
        coefficients: [vec![0.0; ALL], vec![0.0; ALL]],
        lines: Vec::new(),
        truncation: None,
        limits: [Limits::NONE; 2],
        missing: [Missing::default(), Missing::default()],
        variance: Variance {
            base: [1.0; 2],
            jitter: 0.0,
        },
        span_codes: 1.02 * f64::from(largest.unwrap_or(1).max(1)),
    }
}

/// All rounds from a model with its limits and missing codes.
pub fn rounds(capture: &Capture, known: &Known, start: &Model) -> Fitted {
    let mut model = start.clone();
    let base = base(known);
    let first = Gram::of(capture, &model);
    let combos: Vec<&Combo> = base.iter().collect();
    let solved = solve(first.all(), &combos, &base_ridge(&base), Detail::All);
    model.coefficients = spread(&combos, &solved);
    model.neutral = model.coefficients.clone();
    let mut last: Option<Fitted> = None;
    for round in 0..ROUNDS {
        let mut seen = around(capture, &mut model, &base, round == 0);
        model.variance.base = seen.noise;
        if round == 0 {
            find_steps(capture, &mut model, &base);
            // Again, now that it is known where the codes are.
            let sharp = is_sharp(&model.neutral, &model);
            seen = around(capture, &mut model, &base, !sharp);
            let spectrum = spectrum_of(capture, &seen.training);
            let [drive, sense] = &seen.training;
            model.truncation = truncation::best(capture, &model, [drive, sense], &spectrum);
            seen = around(capture, &mut model, &base, false);
        }
        for _ in 0..3 {
            if !add_lines(capture, &mut model, &seen) {
                break;
            }
            seen = around(capture, &mut model, &base, false);
        }
        let series =
            [0, 1].map(|c: usize| wander::series(&seen.residuals[c], seen.noise[c], &model.tone));
        let lines = model.lines.len();
        add_slow_mains(capture, known, &mut model, &series);
        if model.lines.len() > lines {
            seen = around(capture, &mut model, &base, false);
        }
        let series =
            [0, 1].map(|c: usize| wander::series(&seen.residuals[c], seen.noise[c], &model.tone));
        let squares = jitter::Squares::of(
            capture,
            &model,
            [&seen.residuals[0], &seen.residuals[1]],
            false,
        );
        let found = squares.fit(seen.noise);
        let jitter_taken = found.is_some_and(|f| f.gain > JITTER_COST);
        model.variance = Variance {
            base: seen.noise,
            jitter: 0.0,
        };
        if let Some(found) = found.filter(|_| jitter_taken) {
            let base = squares.base(found.jitter);
            model.variance = Variance {
                base: base.map(|b| b.max(LEAST_VARIANCE)),
                jitter: found.jitter,
            };
            // The random instant takes a part of the tone itself.
            let less = 1.0 - 0.5 * model.tone.angle().powi(2) * found.jitter;
            let amplitude = capture.meta.drive_amplitude_codes.unwrap_or(0.0);
            model.declared[0] = [0.0, -amplitude * less.max(0.0)];
        }
        let gram = Gram::of(capture, &model);
        let mut nuisance = wander::nuisance(&series);
        let spectrum = spectrum_of(capture, &seen.training);
        let rows = capture.training_rows();
        nuisance.extend(wander::of_harmonics(
            &spectrum,
            &model.tone,
            seen.noise,
            rows,
        ));
        let [drive, sense] = &seen.residuals;
        let coupled = feedthrough::is_coupled(capture, &model, [drive, sense]);
        let variants = variants(known, &model, seen.free, capture.rows(), coupled);
        let mut search = Search::new(gram.all(), &base, &nuisance, &variants);
        let (mut set, _) = search.best();
        drop_tiny(capture, &model, &search, &mut set);
        let objective = search.objective(&set);
        let (combos, solved) = search.solution(&set);
        let coefficients = spread(&combos, &solved);
        let sharp = is_sharp(&coefficients, &model);
        let same = (round > 1 || !sharp)
            && last
                .as_ref()
                .is_some_and(|l| is_same(l, &variants, &set, &model, jitter_taken));
        model.neutral.clone_from(&coefficients);
        model.coefficients = coefficients;
        if sharp {
            settle(capture, &mut model, &base, &nuisance, &variants, &set);
        }
        last = Some(Fitted {
            model: model.clone(),
            gram,
            base: base.clone(),
            nuisance,
            variants,
            set,
            objective,
            clipping: None,
            missing: None,
            jitter: found,
            jitter_taken,
            residuals: seen.residuals,
            noise: seen.noise,
        });
        if same {
            break;
        }
    }
    last.unwrap_or_else(|| Fitted {
        gram: first,
        nuisance: Vec::new(),
        variants: Vec::new(),
        set: Vec::new(),
        objective: 0.0,
        clipping: None,
        missing: None,
        jitter: None,
        jitter_taken: false,
        residuals: [Vec::new(), Vec::new()],
        noise: model.variance.base,
        base,
        model,
    })
}

/// Whether a round changed nothing of the choice and little of the tones.
fn is_same(
    last: &Fitted,
    variants: &[Variant],
    set: &[usize],
    model: &Model,
    jitter: bool,
) -> bool {
    let names = |variants: &[Variant], set: &[usize]| -> Vec<(Effect, usize)> {
        let chosen = set.iter().filter_map(|k| variants.get(*k));
        chosen.map(|v| (v.effect, v.combos.len())).collect()
    };
    names(&last.variants, &last.set) == names(variants, set)
        && last.model.lines.len() == model.lines.len()
        && last.jitter_taken == jitter
        && (0..2).all(|c| {
            let change = last.noise[c] / model.variance.base[c];
            jitter || (0.99..1.01).contains(&change)
        })
}

/// The fit with or without limits, with or without missing codes.
pub fn fit(capture: &Capture, known: &Known, tone: Tone) -> Fitted {
    let start = declared(capture, known, tone);
    let plain = rounds(capture, known, &start);
    let mut best = with_limits(capture, known, &start, plain);
    if let Some(found) = missing::find(capture, &best.model) {
        let mut start = start.clone();
        start.limits = best.model.limits;
        start.missing = found.missing.clone();
        let mut again = rounds(capture, known, &start);
        again.clipping = best.clipping;
        again.missing = Some(found);
        best = again;
    }
    best
}

/// Takes limits where they explain the codes better than what was found without them.
fn with_limits(capture: &Capture, known: &Known, start: &Model, plain: Fitted) -> Fitted {
    let found = [0, 1].map(|c: usize| clipping::find(capture, &plain.model, c));
    if found.iter().all(Option::is_none) {
        return plain;
    }
    let mut limited = start.clone();
    let mut sides = 0.0;
    let mut piled = 0.0;
    for (limits, found) in limited.limits.iter_mut().zip(&found) {
        if let Some(found) = found {
            *limits = found.limits;
            piled += found.pile_gain;
            sides += f64::from(u8::from(found.limits.low.is_finite()));
            sides += f64::from(u8::from(found.limits.high.is_finite()));
        }
    }
    limited.variance = plain.model.variance;
    let mut other = rounds(capture, known, &limited);
    // Both in the units of the same noise: half the chi-square of all training rows, and the costs.
    let costs = |fit: &Fitted| -> f64 {
        let chosen = fit.set.iter().filter_map(|k| fit.variants.get(*k));
        chosen.map(|v| v.cost).sum()
    };
    let chi = |fit: &Fitted| {
        let mut model = fit.model.clone();
        model.variance = other.model.variance;
        0.5 * super::errors::judge(capture, &model).train_chi
    };
    let cost = 7.0 + 2.0 * sides + 4.0;
    let gain = chi(&plain) + costs(&plain) - chi(&other) - costs(&other) + piled;
    if gain > cost {
        other.clipping = Some(gain);
        return other;
    }
    plain
}
