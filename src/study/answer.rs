//! What a study answers: which point to take, what a bit more or less of a word does there, and which requirement
//! cannot be met because of which word.

use super::figures::Figures;
use super::job::{Reporting, Request};
use super::outcome::{Chosen, Point, Required, Step};
use super::space::Lengths;
use crate::cost;
use crate::design::{LimitName, Limits};
use crate::parallel::in_parallel;
use std::collections::BTreeMap;

/// The answers.
pub(super) struct Answers {
    pub(super) chosen: Vec<Chosen>,
    pub(super) required: Vec<Required>,
}

/// Answers from the reported points.
pub(super) fn answers(
    work: &Reporting,
    points: &[(Lengths, Point)],
    given: &Point,
    request: &Request,
    bandwidth_hz: f64,
) -> Answers {
    let limits = &request.limits;
    let required = required(work, points, limits, bandwidth_hz);
    let mut chosen = Vec::new();
    for target in &work.design.study.targets {
        let cost = |p: &Point| p.price.get(target).copied().unwrap_or(f64::INFINITY);
        let mut able: Vec<&(Lengths, Point)> = points
            .iter()
            .filter(|(_, p)| meets(p, target, limits, bandwidth_hz))
            .filter(|(_, p)| !limits.is_empty() || p.as_good_as_given)
            .collect();
        able.sort_by(|a, b| {
            cost(&a.1)
                .total_cmp(&cost(&b.1))
                .then_with(|| a.0.cmp(&b.0))
        });
        let first = able.first();
        let reason = match first {
            Some((_, p)) => {
                let part = 100.0 * cost(p) / cost(given).max(f64::MIN_POSITIVE);
                let what = if limits.is_empty() {
                    "no figure of the data sheet more than one percent worse than the given design's"
                } else {
                    "everything that is required"
                };
                format!("the cheapest point with {what}: {part:.1} % of the given design's cost")
            }
            None => why_not(&required, limits),
        };
        chosen.push(Chosen {
            target: target.clone(),
            point: first.map(|(_, p)| p.number),
            reason,
            sensitivity: first.map_or(Vec::new(), |(l, _)| sensitivity(work, l)),
        });
    }
    Answers { chosen, required }
}

/// True if a point is within every limit.
fn meets(p: &Point, target: &str, limits: &Limits, bandwidth_hz: f64) -> bool {
    limits.iter().all(|limit| {
        let cost = p.cost.get(target);
        match limit.name {
            LimitName::Bandwidth => bandwidth_hz >= limit.value,
            LimitName::RomBytes => cost.is_some_and(|c| c.rom_bytes as f64 <= limit.value),
            LimitName::CyclesPerRow => cost.is_some_and(|c| c.cycles_per_row as f64 <= limit.value),
            LimitName::Bias => p.bias_error_dps.abs() <= limit.value,
            LimitName::Drift => p.drift_residual_dps <= limit.value,
            LimitName::Noise => p.noise_dps_rthz <= limit.value,
            LimitName::Arw => p.arw_deg_rth <= limit.value,
            LimitName::ScaleFactor => p.scale_factor_ppm.abs() <= limit.value,
            LimitName::Spur => p.spur_dps <= limit.value,
        }
    })
}

fn figure(f: &Figures, name: LimitName) -> Option<f64> {
    match name {
        LimitName::Bias => Some(f.bias_dps.abs()),
        LimitName::Drift => Some(f.drift_dps),
        LimitName::Noise => Some(f.noise_dps_rthz),
        LimitName::Arw => Some(f.arw_deg_rth),
        LimitName::ScaleFactor => Some(f.scale_factor_ppm.abs()),
        LimitName::Spur => Some(f.spur_dps),
        _ => None,
    }
}

/// Each limit with the best that any design has.
fn required(
    work: &Reporting,
    points: &[(Lengths, Point)],
    limits: &Limits,
    bandwidth_hz: f64,
) -> Vec<Required> {
    let mut out = Vec::new();
    for limit in limits.iter() {
        let (best, limited_by) = match limit.name {
            LimitName::Bandwidth => (bandwidth_hz, Some("circuit.decimator.ratio")),
            LimitName::RomBytes | LimitName::CyclesPerRow => {
                let costs = points.iter().flat_map(|(_, p)| p.cost.values());
                let of = |c: &cost::Cost| match limit.name {
                    LimitName::RomBytes => c.rom_bytes as f64,
                    _ => c.cycles_per_row as f64,
                };
                (costs.map(of).fold(f64::INFINITY, f64::min), None)
            }
            name => finest(work, name),
        };
        let met = if limit.name.is_least() {
            best >= limit.value
        } else {
            best <= limit.value
        };
        out.push(Required {
            name: limit.name.name(),
            limit: limit.value,
            best,
            can_be_met: met,
            limited_by: limited_by.filter(|_| !met),
        });
    }
    out
}

/// The least value of a figure over all designs that ran, and the word that makes most of it there: that of which
/// one bit less raises it the most.
fn finest(work: &Reporting, name: LimitName) -> (f64, Option<&'static str>) {
    let mut best: Option<(f64, Lengths)> = None;
    for lengths in work.bench.all() {
        let value = work.bench.figures(&lengths).and_then(|f| figure(f, name));
        if let Some(value) = value
            && best.as_ref().is_none_or(|(b, _)| value < *b)
        {
            best = Some((value, lengths));
        }
    }
    let Some((value, lengths)) = best else {
        return (f64::INFINITY, None);
    };
    let mut most: Option<(f64, &'static str)> = None;
    for step in steps(work, &lengths, &[-1]) {
        let rise = step.figures.and_then(|f| figure(&f, name)).unwrap_or(0.0);
        if most.as_ref().is_none_or(|(m, _)| rise > *m) {
            most = Some((rise, step.name));
        }
    }
    (value, most.map(|(_, name)| name))
}

fn why_not(required: &[Required], limits: &Limits) -> String {
    let mut missed = required.iter().filter(|r| !r.can_be_met).peekable();
    if limits.is_empty() {
        return "no point of the front is as good as the given design".to_owned();
    }
    if missed.peek().is_none() {
        return "each requirement can be met by itself, and no design of the front meets all of them at once".to_owned();
    }
    let said: Vec<String> = missed
        .map(|r| {
            let word = r
                .limited_by
                .map_or(String::new(), |w| format!(", limited by `{w}`"));
            format!(
                "{} cannot be met: {:.3e} is required, {:.3e} the best{word}",
                r.name, r.limit, r.best
            )
        })
        .collect();
    said.join("; ")
}

/// One bit more and one bit less of each word.
fn sensitivity(work: &Reporting, lengths: &[u32]) -> Vec<Step> {
    steps(work, lengths, &[-1, 1])
}

fn steps(work: &Reporting, lengths: &[u32], by: &[i32]) -> Vec<Step> {
    let count = work.space.variables.len();
    let moves: Vec<(usize, i32)> = (0..count)
        .flat_map(|k| by.iter().map(move |b| (k, *b)))
        .collect();
    in_parallel(&moves, work.bench.threads(), &|_| {}, |(k, by)| {
        let name = work.space.variables[*k].key();
        let length = lengths[*k].saturating_add_signed(*by);
        let mut to = lengths.to_vec();
        to[*k] = length;
        let design = work.space.design(work.design, &to).ok();
        let figures = design.as_ref().and_then(|d| {
            let verified = work.verifier.figures(&d.without_stops());
            verified.ok()
        });
        let mut price = BTreeMap::new();
        if let Some(design) = &design {
            for (target, o) in work.design.study.targets.iter().zip(&work.bench.objectives) {
                let cost = cost::of_design(design, o.target);
                price.insert(target.clone(), cost.price(&o.weights));
            }
        }
        Step {
            name,
            by: *by,
            length,
            merit: figures.map(|f| work.scale.merit(&f)),
            figures,
            price,
        }
    })
}
