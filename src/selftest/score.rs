//! From marks to the result: rates by size, the least size that is found, false alarms, what does not hold.

use super::outcome::{BySize, Clean, EffectScore, FalseAlarms, Minimum};
use super::scene::Scene;
use super::statistics;
use super::trial::{Colour, Mark};
use super::{Case, Request, SIZES};
use crate::text::number;
use std::collections::BTreeMap;

/// The size that has to be found, in half of the records at least.
const LARGE: f64 = 10.0;

/// False alarms that are promised, and the probability below which more of them are no chance.
const PROMISED: f64 = 0.01;
const CHANCE: f64 = 0.05;

/// How each effect is found, from the marks effect by effect, size by size.
pub(super) fn scores(
    scenes: &[Scene],
    cases: &[Case],
    marks: &[Mark],
    request: &Request,
) -> Vec<EffectScore> {
    let per_effect = (SIZES.len() * request.records).max(1);
    let chunks = marks.chunks(per_effect);
    let pairs = cases.iter().zip(chunks);
    pairs
        .map(|(case, marks)| {
            let by_size: Vec<BySize> = SIZES
                .iter()
                .zip(marks.chunks(request.records.max(1)))
                .map(|(size, marks)| by_size(*size, marks))
                .collect();
            let counts: Vec<(f64, usize, usize)> = by_size
                .iter()
                .map(|s| (s.times_noise, s.records, s.detected))
                .collect();
            let own: Vec<(f64, f64)> = by_size
                .iter()
                .filter_map(|s| Some((s.times_noise, s.in_own_unit?)))
                .collect();
            let limit = statistics::detected_from(&counts);
            let mut remark = case.remark.clone();
            if remark.is_empty() && counts.iter().all(|c| c.1 == 0) {
                remark = "the experiment does not show it beyond the polynomial".to_owned();
            }
            EffectScore {
                effect: case.kind.id(),
                experiment: scenes
                    .get(case.scene)
                    .map_or(String::new(), |s| s.name.to_owned()),
                remark,
                own_unit: scenes
                    .get(case.scene)
                    .map_or(String::new(), |s| case.kind.knob(s)),
                minimum_detectable: limit.and_then(|l| Minimum::of(l, &own)),
                wrong_names: counted(marks),
                by_size,
            }
        })
        .collect()
}

fn by_size(times_noise: f64, marks: &[Mark]) -> BySize {
    let mut out = BySize {
        times_noise,
        in_own_unit: None,
        records: 0,
        detected: 0,
        only_listed: 0,
        wrong: 0,
    };
    let mut logarithms = 0.0;
    for mark in marks {
        let Mark::Closed {
            is_named,
            is_listed,
            wrong,
            size,
        } = mark
        else {
            continue;
        };
        out.records += 1;
        out.detected += usize::from(*is_named || *is_listed);
        out.only_listed += usize::from(*is_listed && !is_named);
        out.wrong += usize::from(!wrong.is_empty());
        logarithms += size.ln();
    }
    if out.records > 0 {
        out.in_own_unit = Some((logarithms / out.records as f64).exp());
    }
    out
}

/// Wrong names with how often they came, the most frequent first.
pub(super) fn counted(marks: &[Mark]) -> Vec<(String, usize)> {
    let mut counts: BTreeMap<&String, usize> = BTreeMap::new();
    for mark in marks {
        if let Mark::Closed { wrong, .. } = mark {
            for name in wrong {
                *counts.entry(name).or_default() += 1;
            }
        }
    }
    let mut out: Vec<(String, usize)> = counts.into_iter().map(|(n, c)| (n.clone(), c)).collect();
    out.sort_by_key(|b| std::cmp::Reverse(b.1));
    out
}

/// Names where nothing was planted.
pub(super) fn alarms(marks: &[Mark], request: &Request) -> FalseAlarms {
    let is_alarm = |m: &&Mark| matches!(m, Mark::Closed { wrong, .. } if !wrong.is_empty());
    let is_closed = |m: &&Mark| matches!(m, Mark::Closed { .. });
    let by_noise: Vec<Clean> = Colour::ALL
        .iter()
        .zip(marks.chunks(request.clean.max(1)))
        .map(|(colour, marks)| Clean {
            noise: colour.name().to_owned(),
            records: marks.iter().filter(is_closed).count(),
            alarms: marks.iter().filter(is_alarm).count(),
        })
        .collect();
    let records = by_noise.iter().map(|c| c.records).sum();
    let alarms = by_noise.iter().map(|c| c.alarms).sum();
    FalseAlarms {
        records,
        alarms,
        upper_limit_95: statistics::upper_limit_95(alarms, records),
        by_noise,
        names: counted(marks),
    }
}

/// What does not hold.
pub(super) fn failures(effects: &[EffectScore], alarms: &FalseAlarms) -> Vec<String> {
    let mut out = Vec::new();
    for e in effects {
        for s in e
            .by_size
            .iter()
            .filter(|s| s.times_noise >= LARGE && s.records > 0)
        {
            if 2 * s.detected < s.records {
                out.push(format!(
                    "{} of {} times the noise is found in {} of {} records",
                    e.effect, s.times_noise, s.detected, s.records
                ));
            }
        }
    }
    let chance = statistics::binomial_at_least(alarms.alarms, alarms.records, PROMISED);
    if chance < CHANCE {
        out.push(format!(
            "{} of {} records without an effect get a name: more than the promised 1 in 100 (probability {chance})",
            alarms.alarms, alarms.records
        , chance = number(chance, 2)));
    }
    out
}
