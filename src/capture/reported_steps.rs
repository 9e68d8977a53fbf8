//! A step of a capture in numbers: parameters with units, their deviations, probability and rivals.

use super::candidates::{Effect, Known};
use super::fit::Fitted;
use super::gram::{Combo, Solved};
use super::input::Capture;
use super::report::p_value;
use super::rivals;
use super::search::Search;
use super::spur;
use crate::statistics::tail::chi_square_surprise;
use crate::verdict::Step;
use std::collections::BTreeMap;

#[allow(clippy::too_many_arguments)]
pub(super) fn linear_step(
    capture: &Capture,
    known: &Known,
    fitted: &Fitted,
    search: &mut Search,
    set: &[usize],
    member: usize,
    (combos, solved): (&[&Combo], &Solved),
) -> Step {
    let Some(variant) = fitted.variants.get(member) else {
        return empty(Effect::Offset);
    };
    let mut step = empty(variant.effect);
    let fewer: Vec<usize> = set.iter().copied().filter(|k| *k != member).collect();
    step.p_value = p_value(fitted, search, set, member).unwrap_or(1.0);
    let own = own_combos(fitted, set, member);
    parameters(&mut step, combos, solved, own);
    let names: Vec<String> = step.parameters.keys().cloned().collect();
    for (i, turns) in fitted.model.lines.iter().enumerate() {
        let prefix = format!("line{}_", i + 1);
        if names.iter().any(|n| n.starts_with(&prefix)) {
            let (name, unit) = match known.fs_hz {
                Some(fs) => (format!("{prefix}frequency_hz"), fs),
                None => (format!("{prefix}frequency_per_sample"), 1.0),
            };
            let std = match fitted.model.line_stds.get(i) {
                Some(std) => *std,
                None => frequency_std(&step, &prefix, capture.rows()),
            };
            step.parameter_std.insert(name.clone(), std * unit);
            step.parameters.insert(name, turns * unit);
        }
    }
    if let Some(truncation) = fitted.model.truncation {
        spur::describe(&mut step, &fitted.model.tone, truncation);
    }
    step.selection_frequency = rivals::selection_frequency(fitted, &fewer, member);
    step.indistinguishable_from = rivals::alike(capture, known, fitted, search, set, member);
    if !step.indistinguishable_from.is_empty() {
        step.separating_experiment = Some(variant.effect.experiment().to_owned());
    }
    step
}

/// Deviation of a line's frequency, cycles per sample, as that of its best known amplitude tells it (the Cramer-Rao
/// bound of one sinusoid in white noise: sqrt(12) / (2 pi rows) of the amplitude's relative one; Rife & Boorstyn 1974).
fn frequency_std(step: &Step, prefix: &str, rows: usize) -> f64 {
    let amplitudes = step
        .parameters
        .iter()
        .filter(|(name, _)| name.starts_with(prefix));
    let relative = amplitudes.filter_map(|(name, v)| {
        let std = step
            .parameter_std
            .get(name)
            .filter(|_| name.contains("amplitude"))?;
        (*v > 0.0).then(|| std / v)
    });
    let least = relative.fold(f64::INFINITY, f64::min);
    let cycles = 12f64.sqrt() / (std::f64::consts::TAU * rows.max(1) as f64);
    if least.is_finite() {
        cycles * least
    } else {
        0.0
    }
}

/// The places of a member's combos in the solution of a set.
pub(super) fn own_combos(fitted: &Fitted, set: &[usize], member: usize) -> std::ops::Range<usize> {
    let count = |k: &usize| fitted.variants.get(*k).map_or(0, |v| v.combos.len());
    let before: usize = set.iter().take_while(|k| **k != member).map(count).sum();
    let start = fitted.base.len() + fitted.nuisance.len() + before;
    start..start + count(&member)
}

/// Values and deviations; of sine and cosine of the same name also the amplitude; of a table its extremes.
fn parameters(step: &mut Step, combos: &[&Combo], solved: &Solved, own: std::ops::Range<usize>) {
    let value = |k: usize| solved.coefficients.get(k).copied().unwrap_or(0.0);
    let deviation = |k: usize| solved.stds.get(k).copied().unwrap_or(0.0);
    let is_line = |k: usize| combos.get(k).is_some_and(|c| c.name.starts_with("line"));
    if own.len() > 12 && !own.clone().all(is_line) {
        let extreme = |sign: f64| own.clone().map(|k| sign * value(k)).fold(0.0, f64::max) * sign;
        let worst = own.clone().map(deviation).fold(0.0, f64::max);
        for (name, v) in [
            ("largest_codes", extreme(1.0)),
            ("smallest_codes", extreme(-1.0)),
        ] {
            step.parameters.insert(name.to_owned(), v);
            step.parameter_std.insert(name.to_owned(), worst);
        }
        step.parameters.insert("knots".to_owned(), own.len() as f64);
        return;
    }
    let mut pairs: BTreeMap<String, [f64; 2]> = BTreeMap::new();
    for k in own {
        let Some(combo) = combos.get(k) else { continue };
        let (v, s) = (value(k) * combo.unit, deviation(k) * combo.unit);
        step.parameters.insert(combo.name.clone(), v);
        step.parameter_std.insert(combo.name.clone(), s);
        for part in ["_sin_", "_cos_"] {
            if combo.name.contains(part) {
                let name = combo.name.replace(part, "_amplitude_");
                let pair = pairs.entry(name).or_default();
                pair[0] += v * v;
                pair[1] = s.max(pair[1]);
            }
        }
    }
    for (name, [square, std]) in pairs {
        step.parameters.insert(name.clone(), square.sqrt());
        step.parameter_std.insert(name, std);
    }
}

fn empty(effect: Effect) -> Step {
    Step {
        effect: effect.id().to_owned(),
        channels: vec!["drive_code".to_owned(), "sense_code".to_owned()],
        parameters: BTreeMap::new(),
        parameter_std: BTreeMap::new(),
        heldout_rms: 0.0,
        p_value: 0.0,
        selection_frequency: 1.0,
        indistinguishable_from: Vec::new(),
        separating_experiment: None,
    }
}

pub(super) fn clipping_step(fitted: &Fitted) -> Step {
    let mut step = empty(Effect::Clipping);
    for (channel, name) in ["drive", "sense"].iter().enumerate() {
        let limits = fitted.levels[channel].limits;
        let [low, high] = fitted.levels[channel].stds;
        for (side, level, std) in [("low", limits.low, low), ("high", limits.high, high)] {
            if level.is_finite() {
                let key = format!("{name}_{side}_codes");
                step.parameters.insert(key.clone(), level);
                step.parameter_std.insert(key, std);
            }
        }
    }
    step.p_value = (-fitted.clipping.unwrap_or(0.0)).exp().min(1.0);
    step
}

pub(super) fn missing_step(fitted: &Fitted) -> Step {
    let mut step = empty(Effect::MissingCodes);
    if let Some(found) = &fitted.missing {
        let count = found.missing.iter().map(|m| m.codes.len()).sum::<usize>();
        step.parameters.insert("count".to_owned(), count as f64);
        step.parameters
            .insert("expected_rows".to_owned(), found.expected_rows);
        if let Some((spacing, first)) = found.spacing {
            step.parameters
                .insert("spacing_codes".to_owned(), spacing as f64);
            step.parameters
                .insert("first_code".to_owned(), first as f64);
        } else if let Some(first) = found.missing.iter().flat_map(|m| &m.codes).min() {
            step.parameters
                .insert("first_code".to_owned(), f64::from(*first));
        }
        step.p_value = (-found.gain).exp().min(1.0);
    }
    step
}

pub(super) fn jitter_step(known: &Known, fitted: &Fitted) -> Step {
    let mut step = empty(Effect::Jitter);
    if let Some(found) = fitted.jitter {
        let (name, unit) = match known.fs_hz {
            Some(fs) => ("jitter_rms_s", 1.0 / fs),
            None => ("jitter_rms_samples", 1.0),
        };
        let of: &[(usize, &str)] = match found.is_common {
            true => &[(0, "")],
            false => &[(0, "drive_"), (1, "sense_")],
        };
        for (channel, prefix) in of.iter().filter(|(c, _)| found.jitter[*c] > 0.0) {
            let samples = found.jitter[*channel].sqrt();
            let std = found.std[*channel] / (2.0 * samples.max(1e-12));
            step.parameters
                .insert(format!("{prefix}{name}"), samples * unit);
            step.parameter_std
                .insert(format!("{prefix}{name}"), std * unit);
        }
        step.p_value = (3.0 - chi_square_surprise(1, 2.0 * found.gain).min(1e6))
            .exp()
            .min(1.0);
    }
    step
}
