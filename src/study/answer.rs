//! What a study answers: which point to take, and what a bit more or less of a word does there. Where there is none,
//! `unmet` says why.

use super::bench::Bench;
use super::figures::Figures;
use super::merit::Scale;
use super::outcome::{Chosen, Point, Required, Step};
use super::reporting::{Checked, Reporting};
use super::search::FINEST_MERIT;
use super::space::Lengths;
use super::unmet::{Near, required, why_not};
use crate::cost::{self, Cost};
use crate::design::{LimitName, Limits};
use crate::parallel::in_parallel;
use crate::text::number;
use std::collections::BTreeMap;

/// The designs that were verified.
pub(super) struct Seen {
    /// Those that may be reported.
    pub(super) good: BTreeMap<Lengths, Checked>,
    /// Those that nothing but their start from power-on keeps from it.
    pub(super) late: Vec<Checked>,
}

impl Seen {
    /// Those that say what a limit on the bias can be, which includes the start, or on the rest.
    pub(super) fn of(&self, bias: bool) -> impl Iterator<Item = &Checked> {
        let late = self.late.iter().filter(move |_| bias);
        self.good.values().chain(late)
    }
}

/// The answers.
pub(super) struct Answers {
    pub(super) chosen: Vec<Chosen>,
    pub(super) required: Vec<Required>,
    pub(super) notes: Vec<String>,
}

/// So many designs are looked at beside the fronts for bytes and cycles that are required.
const BESIDE: usize = 16;

/// True if one of the figures that words make worse is required.
fn requires_a_figure(limits: &Limits) -> bool {
    !Scale::of_limits(limits).is_empty()
}

/// Designs that may hold bytes or cycles that are required and that a front, which weighs the one price alone, need
/// not have: for each target the cheapest with every figure in its limit, or the finest where no figure is limited.
pub(super) fn beside_the_fronts(bench: &Bench, scale: &Scale, limits: &Limits) -> Vec<Lengths> {
    let costly = |name: LimitName| limits.get(name).is_some();
    if !costly(LimitName::RomBytes) && !costly(LimitName::CyclesPerRow) {
        return Vec::new();
    }
    let by_price = requires_a_figure(limits);
    let mut out = Vec::new();
    for objective in 0..bench.objectives.len() {
        let is_fabric = bench
            .given
            .study
            .targets
            .get(objective)
            .is_some_and(|t| t == "fpga");
        let mut able: Vec<(f64, Lengths)> = bench
            .all()
            .into_iter()
            .filter(|l| {
                let cost = bench.costs(l).and_then(|c| c.get(objective));
                cost.is_some_and(|c| costs_hold(c, is_fabric, limits))
            })
            .map(|l| (bench.merit(scale, &l), bench.cost(objective, &l), l))
            .filter(|(merit, _, _)| *merit <= 1.0 || !by_price)
            .map(|(merit, cost, l)| (if by_price { cost } else { merit }, l))
            .collect();
        able.sort_by(|a, b| a.0.total_cmp(&b.0).then_with(|| a.1.cmp(&b.1)));
        out.extend(able.into_iter().take(BESIDE).map(|(_, l)| l));
    }
    out
}

/// For each target the cheapest verified design that holds what is asked; where only bytes or cycles are required,
/// the finest.
pub(super) fn chosen(work: &Reporting, good: &BTreeMap<Lengths, Checked>) -> Vec<Option<Lengths>> {
    let finest = !work.limits.is_empty() && !requires_a_figure(work.limits);
    let of = |objective: usize| {
        let able = good.values().filter(|c| holds(work, c, objective));
        let keys = able.map(|c| {
            let merit = work.scale.merit(&c.verified.figures).max(FINEST_MERIT);
            let first = if finest { merit } else { 0.0 };
            (first, work.bench.cost(objective, &c.lengths), &c.lengths)
        });
        let best = keys.min_by(|a, b| {
            a.0.total_cmp(&b.0)
                .then(a.1.total_cmp(&b.1))
                .then_with(|| a.2.cmp(b.2))
        });
        best.map(|(_, _, lengths)| lengths.clone())
    };
    (0..work.bench.objectives.len()).map(of).collect()
}

/// True if a verified design holds what is asked on a target.
pub(super) fn holds(work: &Reporting, c: &Checked, objective: usize) -> bool {
    let cost = work.bench.costs(&c.lengths).and_then(|c| c.get(objective));
    let is_fabric = target(work, objective) == "fpga";
    // Without requirements there is none on the cost.
    let has_cost = cost.map_or(work.limits.is_empty(), |c| {
        costs_hold(c, is_fabric, work.limits)
    });
    figures_hold(work, c) && has_cost
}

/// True if a verified design's figures are shown to hold what is asked: every requirement with the whole of its interval,
/// or without requirements the given design's figures.
pub(super) fn figures_hold(work: &Reporting, c: &Checked) -> bool {
    if work.limits.is_empty() {
        return work
            .instrument
            .holds(&c.verified.figures, &c.bounds, work.own);
    }
    work.limits
        .iter()
        .all(|limit| match c.bounds.most(limit.name) {
            Some(most) => most <= limit.value,
            None => limit.name != LimitName::Bandwidth || work.bandwidth_hz >= limit.value,
        })
}

/// True if bytes and cycles are within their limits. An FPGA has no cycles of a processor.
pub(super) fn costs_hold(cost: &Cost, is_fabric: bool, limits: &Limits) -> bool {
    limits.iter().all(|limit| {
        let value = cost_of(cost, is_fabric, limit.name);
        value.is_none_or(|value| value <= limit.value)
    })
}

/// What a limit on a cost limits; `None` of figures, and of the cycles of an FPGA.
pub fn cost_of(cost: &Cost, is_fabric: bool, name: LimitName) -> Option<f64> {
    match name {
        LimitName::RomBytes if is_fabric => Some(cost.fabric.rom_bits as f64 / 8.0),
        LimitName::RomBytes => Some(cost.rom_bytes as f64),
        LimitName::CyclesPerRow if !is_fabric => Some(cost.cycles_per_row as f64),
        _ => None,
    }
}

pub(super) fn target<'w>(work: &'w Reporting, objective: usize) -> &'w str {
    work.design.study.targets.get(objective).map_or("", |t| t)
}

/// Answers from the reported points.
pub(super) fn answers(
    work: &Reporting,
    seen: &Seen,
    points: &[(Lengths, Point)],
    given: &Point,
    best: &[Option<Lengths>],
    near: &[Option<Near>],
) -> Answers {
    let limits = work.limits;
    let required = required(work, seen);
    let mut chosen = Vec::new();
    let mut notes = Vec::new();
    for (objective, lengths) in best.iter().enumerate() {
        let target = target(work, objective);
        let cost = |p: &Point| p.price.get(target).copied().unwrap_or(f64::INFINITY);
        let point = points.iter().find(|(l, _)| Some(l) == lengths.as_ref());
        let nearest = near.get(objective).and_then(Option::as_ref);
        notes.extend(point.and_then(|(l, p)| {
            let worse = unlimited(work, &seen.good.get(l)?.verified.figures)?;
            let number = p.number;
            Some(format!(
                "{target}: point {number} makes figures that you set no limit for more than one percent worse than with the given design: \
                 {worse}"
            ))
        }));
        let reason = match point {
            Some((_, p)) => {
                let part = 100.0 * cost(p) / cost(given).max(f64::MIN_POSITIVE);
                let what = if limits.is_empty() {
                    "the cheapest point that is shown to have no figure of the data sheet more than one percent worse than the given design's"
                } else if requires_a_figure(limits) {
                    "the cheapest point that is shown to hold everything that is required"
                } else {
                    "the finest point with everything that is required"
                };
                format!("{what}: {part:.1} % of the given design's cost")
            }
            None => why_not(work, &required, nearest, objective),
        };
        chosen.push(Chosen {
            target: target.to_owned(),
            point: point.map(|(_, p)| p.number),
            nearest: nearest.map(|near| near.number),
            reason,
            sensitivity: point.map_or(Vec::new(), |(l, _)| sensitivity(work, l)),
        });
    }
    Answers {
        chosen,
        required,
        notes,
    }
}

/// Where limits are asked for: the figures that have none and by which the data sheet gets worse, with the given design's.
fn unlimited(work: &Reporting, figures: &Figures) -> Option<String> {
    if work.limits.is_empty() {
        return None;
    }
    let limits = work.scale.limits().into_iter();
    let worse = limits
        .zip(work.instrument.limits())
        .filter_map(|((name, limit), (_, usual))| {
            let usual = usual?;
            let (own, given) = (figures.of(name)?.abs(), work.own.of(name)?.abs());
            let text = || {
                let [own, given, usual] = [own, given, usual].map(|v| number(v, 3));
                let name = name.name();
                format!("{name} {own} (given {given}; limit it with `{name}<={usual}`)")
            };
            (limit.is_none() && own > usual).then(text)
        });
    let worse: Vec<String> = worse.collect();
    (!worse.is_empty()).then(|| worse.join(", "))
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
