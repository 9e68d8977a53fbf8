//! The rounds of the fit: noise, lines and nonlinear parts around the model, then the set of effects.

use super::around::{Around, LEAST_VARIANCE, add_slow_mains, around, block_series};
use super::candidates::{Effect, Known, PRIOR, Variant, base, base_ridge, per_column, variants};
use super::clipping::{self, Limits, Placed};
use super::code_chances::Limiter;
use super::columns::{ALL, Model, Variance};
use super::gram::{Combo, Detail, Gram, Summed, solve, spread};
use super::input::Capture;
use super::missing::{self, Missing};
use super::own_steps::OwnSteps;
use super::search::Search;
use super::standing::{add_lines, add_spurs};
use super::steps::{find_steps, is_sharp, settle};
use super::tone::{Phases, Tone};
use super::wander::{self, Series};
use super::{feedthrough, jitter, line_places, truncation};
use std::collections::{BTreeMap, BTreeSet};

/// Rounds at most.
const ROUNDS: usize = 6;
/// The same after the first, where the quantiser's steps show: each is dear, and exact.
const SHARP_ROUNDS: usize = 1;
/// Times that the frequencies of the lines are looked for anew, each nearer by the square.
const REFINEMENTS: usize = 3;
/// Gain that jitter has to make: one free parameter.
const JITTER_COST: f64 = 7.0;
/// What the search for levels of clipping costs, and each level that was found.
const LEVELS_COST: f64 = 4.0;
const LEVEL_COST: f64 = 2.0;
/// Log-likelihood that levels have to gain in the held-out rows, where these are no nearer to their means.
const HELDOUT_GAIN: f64 = 1.0;

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
    /// What each of them gains beyond the others, where that was judged with the quantiser's steps at each set's own
    /// signal: sums of products at one signal let its tone pass for the steps' own.
    pub own_gains: BTreeMap<usize, f64>,
    /// Gain less costs of all.
    pub objective: f64,
    /// What clipping gains, if it was taken, the search for its levels taken off.
    pub clipping: Option<f64>,
    /// Where the levels are by the codes' frequencies, by channel.
    pub levels: [Placed; 2],
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
    /// Sine and cosine of both tones as they are in the codes, beside whatever else is there.
    pub free: [[f64; 2]; 2],
}

impl Fitted {
    /// The chosen linear effects.
    fn effects(&self) -> BTreeSet<Effect> {
        let chosen = self.set.iter().filter_map(|k| self.variants.get(*k));
        chosen.map(|v| v.effect).collect()
    }

    /// What the chosen linear effects cost.
    fn costs(&self) -> f64 {
        let chosen = self.set.iter().filter_map(|k| self.variants.get(*k));
        chosen.map(|v| v.cost).sum()
    }
}

/// Whether a fit is likelier than another one, its costs taken off, in the units of its noise.
pub fn is_likelier(capture: &Capture, fit: &Fitted, than: &Fitted) -> bool {
    let chi = |model: &Model| {
        let mut model = model.clone();
        model.variance = fit.model.variance;
        super::errors::judge(capture, &model).train_chi
    };
    0.5 * chi(&fit.model) + fit.costs() < 0.5 * chi(&than.model) + than.costs()
}

/// Sine and cosine of the tones as they are declared, codes.
fn declared_tones(capture: &Capture, known: &Known) -> [[f64; 2]; 2] {
    let amplitude = capture.meta.drive_amplitude_codes.unwrap_or(0.0);
    let sense = known
        .in_phase
        .map_or([0.0; 2], |([s, c], codes)| [s * codes, c * codes]);
    [[0.0, -amplitude], sense]
}

/// What random instants leave of the mean tone: of cos(p + t) with Gaussian t of variance v it is e^(-v/2), and the
/// part of the variance that goes with the slope squared of the mean tone is 1 - e^-v of it.
fn left_by(jitter: f64, tone: &Tone) -> f64 {
    (1.0 - jitter * tone.angle().powi(2)).max(0.0).sqrt()
}

/// The declared model.
pub fn declared(capture: &Capture, known: &Known, tone: Tone) -> Model {
    let codes = [0, 1].into_iter().flat_map(|c| capture.used_codes(c));
    let largest = codes.map(i32::unsigned_abs).max();
    Model {
        tone,
        phases: Phases::of(&tone, capture.rows()),
        neutral: [vec![0.0; ALL], vec![0.0; ALL]],
        declared: declared_tones(capture, known),
        coefficients: [vec![0.0; ALL], vec![0.0; ALL]],
        lines: Vec::new(),
        line_stds: Vec::new(),
        truncation: None,
        limits: [Limits::NONE; 2],
        missing: [Missing::default(), Missing::default()],
        variance: Variance {
            base: [1.0; 2],
            jitter: [0.0; 2],
        },
        span_codes: 1.02 * f64::from(largest.unwrap_or(1).max(1)),
        full_scale_codes: known.full_scale_codes,
    }
}

/// All rounds from a model with its limits and missing codes.
pub fn rounds(capture: &Capture, known: &Known, start: &Model) -> Fitted {
    let mut model = start.clone();
    let base = base(known);
    let combos: Vec<&Combo> = base.iter().collect();
    let first = Gram::over(capture, &model, &Summed::of(&combos, 1));
    let solved = solve(first.all(), &combos, &base_ridge(&base), Detail::All);
    model.coefficients = spread(&combos, &solved);
    model.neutral = model.coefficients.clone();

    begun(capture, known, &base, &mut model, true);
    let seen = placed(capture, &mut model, &base);
    let mut fitted = round(capture, known, &base, model, seen, true).0;
    for further in 1..ROUNDS {
        let mut model = fitted.model.clone();
        if is_sharp(&model.neutral, &model) {
            model.lines.clear();
            model.line_stds.clear();
            // Random instants smooth the steps: those that steps in the wrong place made would be found again.
            model.variance.jitter = [0.0; 2];
            model.declared = declared_tones(capture, known);
        }
        let seen = begun(capture, known, &base, &mut model, false);
        let (next, sharp) = round(capture, known, &base, model, seen, false);
        let same = (further > 1 || !sharp) && is_same(&fitted, &next);
        fitted = next;
        if same || sharp && further >= SHARP_ROUNDS {
            break;
        }
    }
    fitted
}

/// What is known around a model at first, and its noise; slow mains among it, of which the frequency is known: they
/// move all codes, so the quantiser's steps and other lines are found beside them only.
fn begun(
    capture: &Capture,
    known: &Known,
    base: &[Combo],
    model: &mut Model,
    neutral: bool,
) -> Around {
    let mut seen = around(capture, model, base, neutral);
    let series = block_series(model, &seen);
    if add_slow_mains(capture, known, model, &series) {
        seen = around(capture, model, base, neutral);
    }
    model.variance.base = seen.noise;
    seen
}

/// Finds the quantiser's steps and a truncated oscillator; what is known around the model then.
fn placed(capture: &Capture, model: &mut Model, base: &[Combo]) -> Around {
    find_steps(capture, model, base);
    // Again, now that it is known where the codes are.
    let sharp = is_sharp(&model.neutral, model);
    let seen = around(capture, model, base, !sharp);
    let [drive, sense] = &seen.training;
    let spectrum = seen.spectrum(capture);
    let residuals = [drive.as_slice(), sense.as_slice()];
    model.truncation = truncation::best(capture, model, base, residuals, seen.free, &spectrum);
    around(capture, model, base, false)
}

/// One round: lines, jitter, the set of effects; and whether the quantiser's steps show.
fn round(
    capture: &Capture,
    known: &Known,
    base: &[Combo],
    mut model: Model,
    mut seen: Around,
    first: bool,
) -> (Fitted, bool) {
    let sharp = is_sharp(&model.neutral, &model);
    // Lines that misplaced steps make must not be found: first the steps, then, each time anew, the lines.
    let series = match sharp && first {
        true => block_series(&model, &seen),
        false => follow_lines(capture, known, base, &mut model, &mut seen),
    };
    let (mut jitter, mut jitter_taken) = follow_jitter(capture, known, &mut model, &seen);
    if sharp && !first && jitter_taken {
        // The steps were found without its smoothing, and so was it.
        find_steps(capture, &mut model, base);
        seen = around(capture, &mut model, base, false);
        (jitter, jitter_taken) = follow_jitter(capture, known, &mut model, &seen);
    }
    let mut gram = Gram::of(capture, &model);
    let nuisance = slow_noise(capture, &model, &seen, &series);
    let [drive, sense] = &seen.residuals;
    let coupled = feedthrough::is_coupled(capture, &model, [drive, sense]);
    let variants = variants(known, &model, seen.free, capture.rows(), coupled);
    let mut own_gains = BTreeMap::new();
    let (set, objective) = match sharp {
        true => {
            let mut search = OwnSteps::new(capture, &model, base, &nuisance, &variants);
            let (set, own) = search.best();
            let wants_all_rows = search.wants_all_rows();
            let free_lines = search.free_lines();
            own_gains = search.gains(&set, &own);
            model.coefficients = own.coefficients;
            model.neutral.clone_from(&model.coefficients);
            match wants_all_rows {
                true => {
                    // The steps are placed by now: what is small is left to the sums of all rows.
                    gram = Gram::of(capture, &model);
                    Search::new(gram.all(), base, &nuisance, &variants).best_from(set)
                }
                false if free_lines.is_empty() => (set, own.objective),
                false => {
                    gram = Gram::of(capture, &model);
                    let mut search = Search::new(gram.all(), base, &nuisance, &variants);
                    (search.with_lines(set, &free_lines), own.objective)
                }
            }
        }
        false => {
            let mut search = Search::new(gram.all(), base, &nuisance, &variants);
            let (set, objective) = search.best();
            let (combos, solved) = search.solution(&set);
            model.coefficients = spread(&combos, &solved);
            (set, objective)
        }
    };
    model.neutral.clone_from(&model.coefficients);
    if sharp {
        settle(capture, &mut model, base, &nuisance, &variants, &set);
        gram = Gram::of(capture, &model);
    }
    let fitted = Fitted {
        model,
        gram,
        base: base.to_vec(),
        nuisance,
        variants,
        set,
        own_gains,
        objective,
        clipping: None,
        levels: [Placed::NONE; 2],
        missing: None,
        jitter,
        jitter_taken,
        residuals: seen.residuals,
        noise: seen.noise,
        free: seen.free,
    };
    (fitted, sharp)
}

/// Adds lines to the model until no new one stands out, and moves them to where they are; the block series of what is left.
fn follow_lines(
    capture: &Capture,
    known: &Known,
    base: &[Combo],
    model: &mut Model,
    seen: &mut Around,
) -> [Option<Series>; 2] {
    let sharp = is_sharp(&model.neutral, model);
    add_spurs(capture, known, model, base, seen);
    for _ in 0..3 {
        if !add_lines(capture, known, model, seen) {
            break;
        }
        if sharp {
            // A line moves the codes over the quantiser's steps: steps that stay where they were leave its whole error
            // where the tone is steep, as a random instant does.
            find_steps(capture, model, base);
        }
        *seen = around(capture, model, base, false);
    }
    let before = block_series(model, seen);
    if add_slow_mains(capture, known, model, &before) {
        *seen = around(capture, model, base, false);
    }
    for _ in 0..REFINEMENTS {
        if line_places::refine(capture, known, model, seen) {
            break;
        }
        *seen = around(capture, model, base, false);
    }
    block_series(model, seen)
}

/// Sets the model's variance, with jitter where it earns its place; what was found of it, and whether it did.
fn follow_jitter(
    capture: &Capture,
    known: &Known,
    model: &mut Model,
    seen: &Around,
) -> (Option<jitter::Found>, bool) {
    let [drive, sense] = &seen.residuals;
    let squares = jitter::Squares::of(capture, model, [drive, sense], false);
    let column = per_column(capture.training_rows());
    let found = squares.fit(seen.noise, column);
    let taken = found.filter(|f| f.gain > JITTER_COST + column);
    model.variance = Variance {
        base: seen.noise,
        jitter: [0.0; 2],
    };
    if let Some(found) = taken {
        let base = squares.base(found.jitter);
        model.variance = Variance {
            base: base.map(|b| b.max(LEAST_VARIANCE)),
            jitter: found.jitter,
        };
        // The random instant takes a part of the tones themselves.
        model.declared = declared_tones(capture, known);
        for (tone, jitter) in model.declared.iter_mut().zip(found.jitter) {
            let less = left_by(jitter, &model.tone);
            tone.iter_mut().for_each(|part| *part *= less);
        }
    }
    (found, taken.is_some())
}

/// Columns that stand for slow noise of the means and of the harmonics.
fn slow_noise(
    capture: &Capture,
    model: &Model,
    seen: &Around,
    series: &[Option<Series>; 2],
) -> Vec<(Combo, f64)> {
    let mut nuisance = wander::nuisance(series);
    let spectrum = seen.spectrum(capture);
    let rows = capture.training_rows();
    nuisance.extend(wander::of_harmonics(
        &spectrum,
        &model.tone,
        seen.noise,
        rows,
    ));
    nuisance
}

/// Whether a round changed nothing of the choice and little of the tones.
fn is_same(last: &Fitted, next: &Fitted) -> bool {
    let names = |fit: &Fitted| -> Vec<(Effect, usize)> {
        let chosen = fit.set.iter().filter_map(|k| fit.variants.get(*k));
        chosen.map(|v| (v.effect, v.combos.len())).collect()
    };
    names(last) == names(next)
        && last.model.lines.len() == next.model.lines.len()
        && last.jitter_taken == next.jitter_taken
        && (0..2).all(|c| {
            let change = last.noise[c] / next.model.variance.base[c];
            next.jitter_taken || (0.99..1.01).contains(&change)
        })
}

/// The fit with or without limits, with or without missing codes.
/// `alone` is the declared model, its free carriers fitted.
pub fn fit(capture: &Capture, known: &Known, tone: Tone, alone: &Model) -> Fitted {
    let mut start = declared(capture, known, tone);
    let mut plain = rounds(capture, known, &start);
    // First: codes missing near the crest move its mean as a limit would, but have others beyond them, as no limit has.
    let found = missing::find(capture, &plain.model);
    if let Some(found) = &found {
        start.missing = found.missing.clone();
        plain = rounds(capture, known, &start);
        plain.missing = Some(found.clone());
    }
    let best = with_limits(capture, known, &start, plain, alone);
    if best.clipping.is_none() {
        return best;
    }
    // Beside limits the model is another, and so is what it expects of the codes inside of them.
    let again = missing::find(capture, &best.model);
    let codes = |found: &Option<missing::Found>| found.as_ref().map(|f| f.missing.clone());
    if codes(&again) == codes(&found) {
        return Fitted {
            missing: again,
            ..best
        };
    }
    start.limits = best.model.limits;
    start.missing = codes(&again).unwrap_or_default();
    Fitted {
        clipping: best.clipping,
        levels: best.levels,
        missing: again,
        ..rounds(capture, known, &start)
    }
}

/// Takes limits where they explain the codes better than what was found without them, and the held-out rows better
/// than the declared model alone.
fn with_limits(
    capture: &Capture,
    known: &Known,
    start: &Model,
    plain: Fitted,
    alone: &Model,
) -> Fitted {
    let found = [0, 1].map(|c: usize| clipping::find(capture, &plain.model, c));
    let there = found.map(|f| f.map_or(Limits::NONE, |f| f.limits));
    let crests = clipping::at_the_crests(capture, &plain.model, there);
    if found.iter().all(Option::is_none) && crests.is_empty() {
        return plain;
    }
    let mut limited = start.clone();
    let mut sides = 0.0;
    let mut piled = 0.0;
    let mut crest = 0.0;
    for (limits, found) in limited.limits.iter_mut().zip(&found) {
        if let Some(found) = found {
            *limits = found.limits;
            piled += found.pile_gain;
            sides += f64::from(u8::from(found.limits.low.is_finite()));
            sides += f64::from(u8::from(found.limits.high.is_finite()));
        }
    }
    for (side, level) in &crests {
        let limits = &mut limited.limits[side.channel];
        match side.sign > 0.0 {
            true => limits.high = level.codes,
            false => limits.low = level.codes,
        }
        limits.is_front |= level.limiter == Limiter::Front;
        crest += level.gain;
        sides += 1.0;
    }
    limited.variance = plain.model.variance;
    let mut other = rounds(capture, known, &limited);
    // Both in the units of the same noise: half the chi-square of all training rows, and the costs.
    let judged = |model: &Model| {
        let mut model = model.clone();
        model.variance = other.model.variance;
        super::errors::judge(capture, &model)
    };
    let limited = judged(&other.model);
    let chi = 0.5 * (judged(&plain.model).train_chi - limited.train_chi);
    let shows = found.iter().any(Option::is_some);
    // A level that only the codes at a crest tell has to be in both: in their frequencies and in their means.
    let gain = match shows {
        true => chi + piled,
        false => chi.min(crest),
    };
    let gain = gain + plain.costs() - other.costs() - LEVELS_COST - LEVEL_COST * sides;
    let is_nearer = limited.heldout_chi < judged(alone).heldout_chi;
    let placed = [0, 1].map(|channel| clipping::placed(capture, &other.model, channel));
    // A level less than a code inside of the crest shows in the codes' frequencies, and hardly in their means. Where
    // other effects are called for beside it, frequencies alone do not tell which of them are the limit's own.
    let heldout_gain: f64 = placed.iter().map(|p| p.heldout_gain).sum();
    let is_likelier = heldout_gain > HELDOUT_GAIN && other.effects() == plain.effects();
    if gain > PRIOR && (shows && is_nearer || is_likelier) {
        other.clipping = Some(gain);
        other.levels = placed;
        return other;
    }
    plain
}

#[cfg(test)]
#[path = "fit_tests.rs"]
mod tests;
