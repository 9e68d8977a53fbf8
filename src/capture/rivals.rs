//! What else would explain the codes, and the evidence on every candidate.

use super::candidates::{Effect, Known, Variant};
use super::fit::Fitted;
use super::input::{Capture, GROUPS};
use super::search::Search;
use super::{mains, spur};
use crate::statistics::tail::chi_square_surprise;
use crate::verdict::{Evidence, Fate, Step};

/// A rival within this of the objective is as good.
const ALIKE: f64 = 5.0;
/// Minus the logarithm of the probability with which a half-sample calls for an effect: one per cent.
const HALF_SURPRISE: f64 = 4.6;

/// Share of the halves of the training rows in which a member of a set is called for.
pub fn selection_frequency(fitted: &Fitted, fewer: &[usize], member: usize) -> f64 {
    let mut chosen = 0.0;
    let mut tried = 0.0;
    let columns = fitted.variants.get(member).map_or(1, |v| v.combos.len());
    for a in 0..GROUPS {
        for b in 0..a {
            let sums = fitted.gram.half(&[a, b]);
            let mut search = Search::new(&sums, &fitted.base, &fitted.nuisance, &fitted.variants);
            let mut all = fewer.to_vec();
            all.push(member);
            let gain = search.gain(&all) - search.gain(fewer);
            tried += 1.0;
            if chi_square_surprise(columns, 2.0 * gain.max(0.0)) > HALF_SURPRISE {
                chosen += 1.0;
            }
        }
    }
    chosen / f64::max(tried, 1.0)
}

/// Effects that do as well in the place of a member, at most four.
pub fn alike(
    capture: &Capture,
    known: &Known,
    fitted: &Fitted,
    search: &mut Search,
    set: &[usize],
    member: usize,
) -> Vec<String> {
    let mut out: Vec<Effect> = search
        .rivals(set, member)
        .into_iter()
        .filter(|(_, less)| *less > -ALIKE)
        .map(|(effect, _)| effect)
        .collect();
    let variant = fitted.variants.get(member);
    // A line is told from another kind of line by its place alone.
    let rows = capture.rows();
    let own: Vec<usize> = (0..fitted.model.lines.len())
        .filter(|i| variant.is_some_and(|v| uses_line(v, *i)))
        .collect();
    let is_power = |i: &usize| {
        let turns = fitted.model.lines.get(*i).copied().unwrap_or(0.0);
        mains::is_mains(known, turns, 0.5 / rows as f64)
    };
    match variant.map(|v| v.effect) {
        Some(Effect::Mains) if !own.iter().any(is_power) => out.push(Effect::Spur),
        Some(Effect::Spur) if own.len() == 1 => out.push(Effect::Mains),
        _ => {}
    }
    out.dedup();
    out.truncate(4);
    out.into_iter().map(|e| e.id().to_owned()).collect()
}

/// Whether a variant has the columns of line i.
pub fn uses_line(variant: &Variant, i: usize) -> bool {
    let (sin, _) = super::columns::line(i);
    let uses = |c: &super::gram::Combo| c.parts.iter().any(|p| p.1 == sin);
    variant.combos.iter().any(uses)
}

/// One entry for each effect of the contract.
pub fn evidence(
    capture: &Capture,
    known: &Known,
    fitted: &Fitted,
    search: &mut Search,
    steps: &[Step],
    taken: &[Effect],
) -> Vec<Evidence> {
    let alike: Vec<&String> = steps
        .iter()
        .flat_map(|s| &s.indistinguishable_from)
        .collect();
    Effect::ALL
        .into_iter()
        .map(|effect| {
            let (gain, p_value) = single(fitted, search, effect);
            let missing = lacks(capture, known, effect);
            let fate = if taken.contains(&effect) {
                Fate::Taken
            } else if alike.iter().any(|a| *a == effect.id()) {
                Fate::Confounded
            } else if missing.is_some() && effect != Effect::Mains {
                Fate::NoChannel
            } else if effect == Effect::Spur && spur::places(&fitted.model.tone).is_empty() {
                Fate::NotExcited
            } else {
                Fate::Rejected
            };
            let remark = match (fate, missing) {
                (Fate::Taken, Some(m)) => format!("it is a cause; {m}"),
                (Fate::Taken, None) => "it is a cause".to_owned(),
                (Fate::Confounded, _) => "it explains the codes as well as a cause".to_owned(),
                (_, Some(m)) => m,
                (Fate::NotExcited, _) => {
                    "the tuning word is a multiple of every truncation: no spur arises".to_owned()
                }
                _ => "the codes do not call for it".to_owned(),
            };
            Evidence {
                effect: effect.id().to_owned(),
                fate,
                p_value,
                gain,
                remark,
            }
        })
        .collect()
}

/// Gain and chance of an effect's best variant before any step.
fn single(fitted: &Fitted, search: &mut Search, effect: Effect) -> (Option<f64>, Option<f64>) {
    match effect {
        Effect::Clipping => {
            let gain = fitted.clipping;
            return (gain, gain.map(|g| (-g).exp().min(1.0)));
        }
        Effect::MissingCodes => {
            let gain = fitted.missing.as_ref().map(|m| m.gain);
            return (gain, gain.map(|g| (-g).exp()));
        }
        Effect::Jitter => {
            let gain = fitted.jitter.map(|j| j.gain);
            let p = gain.map(|g| (3.0 - chi_square_surprise(1, 2.0 * g)).exp().min(1.0));
            return (gain, p);
        }
        _ => {}
    }
    let none = search.gain(&[]);
    let tried = (fitted.variants.len() as f64).ln();
    let mut best: Option<(f64, f64, f64)> = None;
    for (k, v) in fitted
        .variants
        .iter()
        .enumerate()
        .filter(|(_, v)| v.effect == effect)
    {
        let gain = search.gain(&[k]) - none;
        let columns = v.combos.len();
        let surprise = chi_square_surprise(columns, 2.0 * gain.max(0.0));
        let p = (tried + v.further.max(0.0) - surprise).exp().min(1.0);
        if best.is_none_or(|b| gain - v.cost > b.0) {
            best = Some((gain - v.cost, gain, p));
        }
    }
    (best.map(|b| b.1), best.map(|b| b.2))
}

/// What the capture does not say and the effect needs.
fn lacks(capture: &Capture, known: &Known, effect: Effect) -> Option<String> {
    let meta = &capture.meta;
    let keys = |wanted: &[(&str, bool)]| {
        let absent: Vec<&str> = wanted
            .iter()
            .filter(|(_, there)| !there)
            .map(|(k, _)| *k)
            .collect();
        (!absent.is_empty()).then(|| format!("the capture does not say {}", absent.join(", ")))
    };
    let rate = [
        ("rate_dps", meta.rate_dps.is_some()),
        ("sense_codes_per_dps", meta.sense_codes_per_dps.is_some()),
        ("sense_phase_rad", meta.sense_phase_rad.is_some()),
    ];
    match effect {
        Effect::Gain if known.in_phase.is_none() => {
            keys(&[("drive_amplitude_codes", known.amplitude)])
        }
        Effect::Latency => keys(&[
            ("ftw", known.phase),
            ("drive_amplitude_codes", known.amplitude),
        ]),
        Effect::Feedthrough => keys(&rate),
        Effect::Spur => keys(&[("ftw", known.phase)]),
        Effect::Mains => keys(&[("fs_hz", known.fs_hz.is_some())]),
        _ => None,
    }
}
