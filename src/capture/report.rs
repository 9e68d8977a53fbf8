//! From the fit to `closure.json`: steps in order, judged on held-out rows; evidence; what is left.

use super::candidates::{Effect, Known};
use super::columns::{ALL, Model};
use super::errors::{Judged, judge};
use super::fit::Fitted;
use super::gram::{Combo, Solved, spread};
use super::input::Capture;
use super::reported_steps::{clipping_step, jitter_step, linear_step, missing_step, own_combos};
use super::search::Search;
use super::{bend, firmware, jitter, rivals, structure};
use crate::record::Warning;
use crate::statistics::tail::chi_square_surprise;
use crate::verdict::{Errors, Evidence, FirmwareErrors, Step, Structure};

/// What the report of a capture is made of.
#[derive(Debug, Clone)]
pub struct Findings {
    /// With the declared model alone.
    pub before: Errors,
    /// In order.
    pub steps: Vec<Step>,
    /// With all steps.
    pub after: Errors,
    /// Corrected codes.
    pub firmware: FirmwareErrors,
    /// What is left.
    pub structure: Structure,
    /// All candidates.
    pub evidence: Vec<Evidence>,
    /// Remarks.
    pub warnings: Vec<Warning>,
    /// The noise of both columns together, codes rms.
    pub noise_floor_rms: f64,
    /// Model before and after all steps.
    pub models: [Model; 2],
    /// The bend that a step took, by channel.
    pub bends: [Option<Vec<bend::Point>>; 2],
    /// Frequencies of lines that a step took, turns a sample, with the step's effect.
    pub lines: Vec<(f64, Effect)>,
}

/// Largest p-value of a step.
const LARGEST_P: f64 = 0.001;

/// What the likelihood with the quantiser's steps at each set's own signal is uncertain by, nats: steps that are off by
/// the fit's own uncertainty put some rows, or all of a phase, on the wrong side. Clean captures have shown up to 37.
const ROUGH: f64 = 60.0;

/// A step that is taken in its turn.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Turn {
    Clipping,
    Missing,
    Linear(usize),
    Jitter,
}

/// Judges the fit, `plain` being the one of the declared model alone.
pub fn findings(capture: &Capture, known: &Known, plain: &Model, fitted: &Fitted) -> Findings {
    let mut search = Search::new(
        fitted.gram.all(),
        &fitted.base,
        &fitted.nuisance,
        &fitted.variants,
    );
    let before = judge(capture, plain);
    let model = &with_useful_shifts(capture, &fitted.model);
    let mut warnings = Vec::new();
    let mut set = fitted.set.clone();
    let (order, judged) = loop {
        let order = turns(fitted, &mut search, &set);
        let judged = prefixes(capture, fitted, model, &search, &order);
        let mut last = weighted(capture, plain, fitted);
        let mut failed = unsure(fitted, &mut search, &set);
        for (turn, j) in order.iter().zip(&judged) {
            match turn {
                _ if failed.is_some() => break,
                Turn::Linear(k)
                    if j.heldout_chi >= last
                        && !helps_the_others(capture, fitted, model, &search, (&set, *k)) =>
                {
                    failed = Some(*k);
                }
                Turn::Linear(_) | Turn::Clipping => last = j.heldout_chi,
                _ => {}
            }
        }
        // Weighted by a variance that goes with the slope the held-out rows may be nearer while their error is larger.
        let is_larger = judged
            .last()
            .is_some_and(|j| j.errors.heldout_rms > before.errors.heldout_rms);
        let linear = |turn: &Turn| match turn {
            Turn::Linear(k) => Some(*k),
            _ => None,
        };
        if is_larger {
            failed = failed.or(order.iter().rev().find_map(linear));
        }
        match failed {
            Some(k) => set.retain(|s| *s != k),
            None => break (order, judged),
        }
    };
    let order: Vec<(Turn, Judged)> = order
        .into_iter()
        .zip(judged)
        .filter(|(turn, _)| *turn != Turn::Jitter || jitter_holds(capture, fitted))
        .collect();
    // Noise changes no mean, and a histogram little of it: where they are all, the errors are those of the declared
    // model unless they are smaller.
    let is_mean = order.iter().any(|(turn, j)| match turn {
        Turn::Jitter => false,
        Turn::Missing => j.errors.heldout_rms < before.errors.heldout_rms,
        Turn::Linear(_) | Turn::Clipping => true,
    });
    let (combos, solved) = search.solution(&set);
    let mut steps = Vec::new();
    for (turn, judged) in &order {
        let mut step = match turn {
            Turn::Linear(k) => linear_step(
                capture,
                known,
                fitted,
                &mut search,
                &set,
                *k,
                (&combos, &solved),
            ),
            Turn::Clipping => clipping_step(fitted),
            Turn::Missing => missing_step(fitted),
            Turn::Jitter => {
                warnings.push(Warning::general(
                    "jitter_is_noise",
                    "aperture_jitter is noise: it changes the variance, not the mean, so the error's \
                     rms stays; the cause is judged by the likelihood of the held-out rows",
                ));
                jitter_step(known, fitted)
            }
        };
        step.heldout_rms = match is_mean {
            true => judged.errors.heldout_rms,
            false => before.errors.heldout_rms,
        };
        for name in step.parameters.keys() {
            // Counts, codes and numbers of knots: nothing of them is estimated.
            step.parameter_std.entry(name.clone()).or_insert(0.0);
        }
        steps.push(step);
    }
    let mut last = model.clone();
    last.coefficients = without_nuisance(fitted, &combos, &solved);
    let after = if !is_mean {
        before.errors
    } else {
        judge(capture, &last).errors
    };
    let with_wander = spread(&combos, &solved);
    let structure = structure::left(capture, &last, &with_wander);
    let taken: Vec<Effect> = order
        .iter()
        .filter_map(|(t, _)| effect(fitted, *t))
        .collect();
    let firmware = firmware_errors(
        capture,
        &last,
        fitted,
        &taken,
        (&combos, &solved),
        &after,
        &mut warnings,
    );
    let evidence = rivals::evidence(capture, known, fitted, &mut search, &steps, &taken);
    Findings {
        before: before.errors,
        steps,
        after,
        firmware,
        structure,
        evidence,
        warnings,
        noise_floor_rms: (0.5 * (fitted.noise[0] + fitted.noise[1])).sqrt(),
        bends: bends(fitted, &search, &set, (&combos, &solved)),
        lines: taken_lines(fitted, &set),
        models: [plain.clone(), last],
    }
}

/// Whether the held-out rows are nearer to all members of a set than to all but one. In few held-out rows two effects
/// may cancel (an offset and half a period of the mains): each alone is then farther than none, both are nearer.
fn helps_the_others(
    capture: &Capture,
    fitted: &Fitted,
    last: &Model,
    search: &Search,
    (set, member): (&[usize], usize),
) -> bool {
    let chi = |set: &[usize]| {
        let mut model = last.clone();
        let (combos, solved) = search.solution(set);
        model.coefficients = without_nuisance(fitted, &combos, &solved);
        judge(capture, &model).heldout_chi
    };
    let fewer: Vec<usize> = set.iter().copied().filter(|k| *k != member).collect();
    !fewer.is_empty() && chi(set) < chi(&fewer)
}

/// The member of a set that is least sure, if it is not sure enough.
fn unsure(fitted: &Fitted, search: &mut Search, set: &[usize]) -> Option<usize> {
    let p = |search: &mut Search, k: usize| Some((p_value(fitted, search, set, k)?, k));
    let all: Vec<_> = set.iter().filter_map(|k| p(search, *k)).collect();
    let worst = all.into_iter().max_by(|a, b| a.0.total_cmp(&b.0))?;
    (worst.0 > LARGEST_P).then_some(worst.1)
}

/// The chance that a member of a set gains what it does beyond the others, the search among variants and
/// frequencies counted.
pub(super) fn p_value(
    fitted: &Fitted,
    search: &mut Search,
    set: &[usize],
    member: usize,
) -> Option<f64> {
    let variant = fitted.variants.get(member)?;
    let fewer: Vec<usize> = set.iter().copied().filter(|k| *k != member).collect();
    let sums = search.gain(set) - search.gain(&fewer);
    let own = fitted.own_gains.get(&member);
    let gain = own.map_or(sums, |own| sums.max(own - ROUGH));
    let columns = variant.combos.len();
    let surprise = chi_square_surprise(columns, 2.0 * gain.max(0.0));
    let tried = (fitted.variants.len() as f64).ln() + variant.further.max(0.0);
    Some((tried - surprise).exp().min(1.0))
}

fn effect(fitted: &Fitted, turn: Turn) -> Option<Effect> {
    match turn {
        Turn::Clipping => Some(Effect::Clipping),
        Turn::Missing => Some(Effect::MissingCodes),
        Turn::Jitter => Some(Effect::Jitter),
        Turn::Linear(k) => fitted.variants.get(k).map(|v| v.effect),
    }
}

/// The chi-square of the declared model on held-out rows, in the units of the fit's noise.
fn weighted(capture: &Capture, plain: &Model, fitted: &Fitted) -> f64 {
    let mut model = plain.clone();
    model.variance = fitted.model.variance;
    judge(capture, &model).heldout_chi
}

/// Clipping first (it decides which rows the others see), missing codes, then each time what gains most.
fn turns(fitted: &Fitted, search: &mut Search, set: &[usize]) -> Vec<Turn> {
    let mut out = Vec::new();
    if fitted.clipping.is_some() {
        out.push(Turn::Clipping);
    }
    if fitted.missing.is_some() {
        out.push(Turn::Missing);
    }
    let mut taken: Vec<usize> = Vec::new();
    while taken.len() < set.len() {
        let mut best: Option<(f64, usize)> = None;
        for k in set.iter().filter(|k| !taken.contains(k)) {
            let mut next = taken.clone();
            next.push(*k);
            let gain = search.gain(&next);
            if best.is_none_or(|b| gain > b.0) {
                best = Some((gain, *k));
            }
        }
        let Some((_, k)) = best else { break };
        taken.push(k);
    }
    out.extend(taken.into_iter().map(Turn::Linear));
    if fitted.jitter_taken {
        out.push(Turn::Jitter);
    }
    out
}

/// The model, without what missing codes shift if that does not make the held-out errors smaller: the codes are known
/// by the histogram, and where noise is wide or they are few the mean hardly knows them.
fn with_useful_shifts(capture: &Capture, model: &Model) -> Model {
    let mut without = model.clone();
    without.missing = Default::default();
    let held = |model: &Model| judge(capture, model).errors.heldout_rms;
    if held(model) < held(&without) {
        return model.clone();
    }
    without
}

/// `last` after each turn, judged.
fn prefixes(
    capture: &Capture,
    fitted: &Fitted,
    last: &Model,
    search: &Search,
    order: &[Turn],
) -> Vec<Judged> {
    let mut set = Vec::new();
    let mut model = last.clone();
    model.missing = Default::default();
    order
        .iter()
        .map(|turn| {
            match turn {
                Turn::Linear(k) => set.push(*k),
                Turn::Missing => model.missing = last.missing.clone(),
                _ => {}
            }
            let (combos, solved) = search.solution(&set);
            model.coefficients = without_nuisance(fitted, &combos, &solved);
            judge(capture, &model)
        })
        .collect()
}

/// Coefficients of base and steps: the wander's are no part of the model.
fn without_nuisance(fitted: &Fitted, combos: &[&Combo], solved: &Solved) -> [Vec<f64>; 2] {
    let from = fitted.base.len();
    let wander = from..from + fitted.nuisance.len();
    let mut solved = solved.clone();
    for k in wander {
        if let Some(c) = solved.coefficients.get_mut(k) {
            *c = 0.0;
        }
    }
    spread(combos, &solved)
}

/// Whether jitter makes the held-out rows likelier.
fn jitter_holds(capture: &Capture, fitted: &Fitted) -> bool {
    let [drive, sense] = &fitted.residuals;
    let held = jitter::Squares::of(capture, &fitted.model, [drive, sense], true);
    let variance = fitted.model.variance;
    // Without jitter its mean part is in the base of each channel.
    held.likelihood(variance.base, variance.jitter) > held.likelihood(fitted.noise, [0.0; 2])
}

/// The bend that a member of the set fits, if one does.
fn bends(
    fitted: &Fitted,
    search: &Search,
    set: &[usize],
    solution: (&[&Combo], &Solved),
) -> [Option<Vec<bend::Point>>; 2] {
    let mut out = [None, None];
    for member in set {
        let own = own_combos(fitted, set, *member);
        let curves = bend::curves(search, &fitted.model, set, solution, own);
        for (out, curve) in out.iter_mut().zip(curves) {
            *out = curve.or(out.take());
        }
    }
    out
}

/// The lines of the members of a set.
fn taken_lines(fitted: &Fitted, set: &[usize]) -> Vec<(f64, Effect)> {
    let members = || set.iter().filter_map(|k| fitted.variants.get(*k));
    let of = |(i, turns): (usize, &f64)| {
        let user = members().find(|v| rivals::uses_line(v, i))?;
        Some((*turns, user.effect))
    };
    let lines = fitted.model.lines.iter().enumerate();
    lines.filter_map(of).collect()
}

/// The same error with corrected codes, where arithmetic on code and phase can do it.
fn firmware_errors(
    capture: &Capture,
    last: &Model,
    fitted: &Fitted,
    taken: &[Effect],
    (combos, solved): (&[&Combo], &Solved),
    after: &Errors,
    warnings: &mut Vec<Warning>,
) -> FirmwareErrors {
    let not: Vec<&str> = taken
        .iter()
        .filter(|e| !e.is_compensable())
        .map(|e| e.id())
        .collect();
    if !not.is_empty() {
        warnings.push(Warning::general(
            "not_compensable",
            format!(
                "{} cannot be taken away by arithmetic on codes and phase, so firmware has no figures",
                not.join(", ")
            ),
        ));
        return FirmwareErrors::default();
    }
    let from = fitted.base.len() + fitted.nuisance.len();
    let mut own = solved.clone();
    own.coefficients
        .iter_mut()
        .take(from)
        .for_each(|c| *c = 0.0);
    let effects = if taken.is_empty() {
        [vec![0.0; ALL], vec![0.0; ALL]]
    } else {
        spread(combos, &own)
    };
    let all = &last.coefficients;
    let none = [vec![0.0; ALL], vec![0.0; ALL]];
    let firmware = firmware::corrected(capture, last, all, &effects, &effects);
    if taken.is_empty() {
        return firmware;
    }
    // By the same measure: the quantiser's own error is in the figures before the steps, and not in these.
    let without = firmware::corrected(capture, last, all, &effects, &none);
    let without = without.heldout_rms.unwrap_or(f64::NAN);
    firmware
        .unless_useless(without, after.heldout_rms, "LSB")
        .unwrap_or_else(|told| {
            warnings.push(Warning::general("firmware_useless", told));
            FirmwareErrors::default()
        })
}
