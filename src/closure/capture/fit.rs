//! The rounds of the fit: noise, lines and nonlinear parts around the model, then the set of effects.

use super::candidates::{Effect, Known, Variant, base, base_ridge, variants};
use super::clipping::{self, Limits};
use super::columns::{ALL, COS, Model, ONE, Rows, SIN, TRUNCATED, Variance, chunks, harmonic};
use super::gram::{Combo, Detail, Gram, Solved, solve};
use super::input::{Capture, Part};
use super::missing::{self, Missing};
use super::search::Search;
use super::spectrum::{self, Spectrum};
use super::tone::{Phases, Tone};
use super::wander::{self, Series};
use super::{feedthrough, jitter, mains, nonlinearity, truncation};

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

/// Residuals at coefficients, 0 where limited; of all rows, or of the training rows alone.
pub fn residuals(
    capture: &Capture,
    model: &Model,
    coefficients: &[Vec<f64>; 2],
    all: bool,
) -> [Vec<f64>; 2] {
    let n = capture.rows();
    let mut out = [vec![0.0; n], vec![0.0; n]];
    let mut rows = Rows::new();
    let wanted = |p: Part| all || p != Part::HeldOut;
    for segment in capture.segments.iter().filter(|s| wanted(s.part)) {
        for chunk in chunks(segment.rows.clone()) {
            let start = chunk.start;
            let count = chunk.len();
            rows.fill(capture, model, chunk);
            for (channel, out) in out.iter_mut().enumerate() {
                for (i, out) in out.iter_mut().skip(start).take(count).enumerate() {
                    if rows.weight[channel][i] > 0.0 {
                        let value = rows.value(channel, i, &coefficients[channel]);
                        *out = rows.target[channel][i] - value;
                    }
                }
            }
        }
    }
    out
}

/// Coefficients by channel and column out of combos.
pub fn spread(combos: &[&Combo], solved: &Solved) -> [Vec<f64>; 2] {
    let mut out = [vec![0.0; ALL], vec![0.0; ALL]];
    for (combo, value) in combos.iter().zip(&solved.coefficients) {
        for (channel, column, factor) in &combo.parts {
            if let Some(v) = out[*channel].get_mut(*column) {
                *v += factor * value;
            }
        }
    }
    out
}

/// A generous description of all that goes with the phase, and of the lines known so far; tables of both
/// channels come last, [`TABLES`] columns.
fn generous(base: &[Combo], model: &Model) -> Vec<Combo> {
    let mut out = base.to_vec();
    for channel in 0..2 {
        let mut one = |k: usize| out.push(Combo::one("", channel, k));
        [ONE, SIN, COS].into_iter().for_each(&mut one);
        for k in 2..=super::columns::HARMONICS {
            let (sin, cos) = harmonic(k);
            one(sin);
            one(cos);
        }
        for i in 0..model.lines.len() {
            let (sin, cos) = super::columns::line(i);
            one(sin);
            one(cos);
        }
        if model.truncation.is_some() {
            one(TRUNCATED);
            one(TRUNCATED + 1);
        }
    }
    for channel in 0..2 {
        out.extend(nonlinearity::table(model, 4, &[channel]));
    }
    out
}

/// Columns of the tables in a generous description.
const TABLES: usize = 66;

/// What is known of the noise and of the tones, around a model.
struct Around {
    residuals: [Vec<f64>; 2],
    training: [Vec<f64>; 2],
    free: [[f64; 2]; 2],
    noise: [f64; 2],
}

fn around(capture: &Capture, model: &mut Model, base: &[Combo], neutral: bool) -> Around {
    let gram = Gram::of(capture, model);
    let combos = generous(base, model);
    let combos: Vec<&Combo> = combos.iter().collect();
    let mut ridge = base_ridge(base);
    ridge.resize(combos.len(), 0.0);
    let solved = solve(gram.all(), &combos, &ridge, Detail::All);
    let coefficients = spread(&combos, &solved);
    // Tables contain the tone: what it is comes from the fit without them.
    let few = combos.len().saturating_sub(TABLES);
    let (fewer, less) = (combos.get(..few), ridge.get(..few));
    let fewer = fewer.unwrap_or_default();
    let without = solve(gram.all(), fewer, less.unwrap_or_default(), Detail::All);
    let plain = spread(fewer, &without);
    let mut free = model.declared;
    for (free, coefficients) in free.iter_mut().zip(&plain) {
        for (value, column) in free.iter_mut().zip([SIN, COS]) {
            *value += coefficients.get(column).copied().unwrap_or(0.0);
        }
    }
    let residuals = residuals(capture, model, &coefficients, true);
    if neutral {
        // Without the tables, unless they are needed: where the codes are is then known better.
        let needed = solved.gain - without.gain > 2.0 * TABLES as f64;
        model.neutral = if needed { coefficients } else { plain };
    }
    let mut training = residuals.clone();
    for segment in capture.segments.iter().filter(|s| s.part == Part::HeldOut) {
        for channel in &mut training {
            if let Some(rows) = channel.get_mut(segment.rows.clone()) {
                rows.fill(0.0);
            }
        }
    }
    let spectrum = spectrum_of(capture, &training);
    let noise = [0, 1].map(|c: usize| spectrum.variance(c).max(LEAST_VARIANCE));
    Around {
        residuals,
        training,
        free,
        noise,
    }
}

fn spectrum_of(capture: &Capture, training: &[Vec<f64>; 2]) -> Spectrum {
    let [drive, sense] = training;
    Spectrum::of([drive, sense], capture.training_rows())
}

/// Looks for new lines; true if any was added. Besides the strongest, those are taken that are no sidelobe
/// of a stronger one.
fn add_lines(capture: &Capture, model: &mut Model, around: &Around) -> bool {
    let rows = capture.rows() as f64;
    let spectrum = spectrum_of(capture, &around.training);
    let [drive, sense] = &around.training;
    let before = model.lines.len();
    let mut stronger: Vec<spectrum::Line> = Vec::new();
    for line in spectrum.lines(&model.tone, 12, 3.0, [LEAST_VARIANCE; 2]) {
        if model.lines.len() >= super::columns::LINES {
            break;
        }
        // A line that is known is not found again: its rest is the frequency's error.
        let known = model
            .lines
            .iter()
            .any(|t| (t - line.turns).abs() * rows < 1.0);
        let sidelobe = stronger.iter().any(|s| {
            let apart = (s.turns - line.turns) * rows;
            apart.abs() < 8.0 || line.surprise * apart * apart < 4.0 * s.surprise
        });
        if !known && !sidelobe {
            let turns = spectrum::refine([drive, sense], around.noise, line.turns);
            model.lines.push(turns);
            stronger.push(line);
        }
    }
    model.lines.len() > before
}

/// Adds the mains' own frequencies where they are too slow for the spectrum.
fn add_slow_mains(
    capture: &Capture,
    known: &Known,
    model: &mut Model,
    series: &[Option<Series>; 2],
) {
    let Some(fs) = known.fs_hz else { return };
    let rows = capture.rows();
    let mut best: Option<(f64, f64)> = None;
    for hz in mains::MAINS_HZ {
        let turns = hz / fs;
        let periods = turns * rows as f64;
        let is_new = model
            .lines
            .iter()
            .all(|t| (t - turns).abs() * rows as f64 > 0.7);
        if (0.1..4.0).contains(&periods) && is_new {
            let gain = wander::slow_line_gain(series, rows, turns);
            if gain > 15.0 && best.is_none_or(|b| gain > b.0) {
                best = Some((gain, turns));
            }
        }
    }
    if let Some((_, turns)) = best
        && model.lines.len() < super::columns::LINES
    {
        model.lines.push(turns);
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
        let (set, objective) = search.best();
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

/// Whether the quantiser's error shows undithered in a channel: the place of the steps then matters.
fn is_sharp(coefficients: &[Vec<f64>; 2], model: &Model) -> bool {
    coefficients
        .iter()
        .zip(model.variance.base)
        .any(|(c, v)| v < 16.0 && c.get(super::columns::SAW).copied().unwrap_or(0.0).abs() > 0.3)
}

/// Finds where the codes are before anything is chosen, where the quantiser's error shows undithered: of
/// descriptions of growing freedom, each with the steps at its own signal, the one that gains most.
fn find_steps(capture: &Capture, model: &mut Model, base: &[Combo]) {
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

/// Fits a set again until the quantiser's steps are where its own signal puts them.
fn settle(
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
