//! What a study answers: which point to take, what a bit more or less of a word does there, and which requirement
//! cannot be met because of which word.

use super::bench::Bench;
use super::certainty::Bounds;
use super::figures::Figures;
use super::merit::Scale;
use super::outcome::{Chosen, Point, Required, Step};
use super::reporting::{Checked, RESOLUTION, Reporting};
use super::retune;
use super::search::{self, FINEST_MERIT};
use super::space::Lengths;
use crate::cost::{self, Cost};
use crate::design::word::Word;
use crate::design::{Design, LimitName, Limits};
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
    fn of(&self, bias: bool) -> impl Iterator<Item = &Checked> {
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
fn costs_hold(cost: &Cost, is_fabric: bool, limits: &Limits) -> bool {
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

fn target<'w>(work: &'w Reporting, objective: usize) -> &'w str {
    work.design.study.targets.get(objective).map_or("", |t| t)
}

/// Answers from the reported points.
pub(super) fn answers(
    work: &Reporting,
    seen: &Seen,
    points: &[(Lengths, Point)],
    given: &Point,
    best: &[Option<Lengths>],
) -> Answers {
    let limits = work.limits;
    let required = required(work, seen);
    let mut chosen = Vec::new();
    let mut notes = Vec::new();
    for (objective, lengths) in best.iter().enumerate() {
        let target = target(work, objective);
        let cost = |p: &Point| p.price.get(target).copied().unwrap_or(f64::INFINITY);
        let point = points.iter().find(|(l, _)| Some(l) == lengths.as_ref());
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
            None => why_not(work, seen, &required, objective),
        };
        chosen.push(Chosen {
            target: target.to_owned(),
            point: point.map(|(_, p)| p.number),
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

/// Each limit with the best that is shown of any design, and the word in the way.
fn required(work: &Reporting, seen: &Seen) -> Vec<Required> {
    let mut out = Vec::new();
    for limit in work.limits.iter() {
        let (best, lengths) = match limit.name {
            LimitName::Bandwidth => (work.bandwidth_hz, None),
            LimitName::RomBytes | LimitName::CyclesPerRow => smallest(work, limit.name),
            name => finest(seen, name),
        };
        let met = if limit.name.is_least() {
            best >= limit.value
        } else {
            best <= limit.value
        };
        let word = lengths.filter(|_| !met).and_then(|l| match limit.name {
            LimitName::RomBytes | LimitName::CyclesPerRow => dearest(work, limit.name, &l, best),
            name => coarsest(work, &l, &|b| b.most(name)),
        });
        out.push(Required {
            name: limit.name.name(),
            limit: limit.value,
            best,
            can_be_met: met,
            limited_by: match limit.name {
                LimitName::Bandwidth if !met => Some("circuit.decimator.ratio"),
                _ => word.map(|w| w.name),
            },
            length: word.map(|w| w.length),
            at_end_of_range: word.is_some_and(|w| w.at_end),
            varied: word.is_some_and(|w| w.varied),
        });
    }
    out
}

/// A word that is in the way, as it is in the best design.
#[derive(Debug, Clone, Copy)]
struct InTheWay {
    name: &'static str,
    length: u32,
    /// It cannot go further in the study's range.
    at_end: bool,
    /// The study varies it.
    varied: bool,
}

impl InTheWay {
    /// The word as it is in `design`, where it would have to go up, or else down.
    fn new(work: &Reporting, design: &Design, word: Word, up: bool) -> Self {
        let length = word.length(design).unwrap_or(0);
        let given = i64::from(word.length(work.design).unwrap_or(0));
        let variables = work.space.variables.iter();
        let mut own = variables.filter(|v| v.words.contains(&word)).map(|v| {
            // Of tied words the ends move with the first.
            let end = if up { v.high } else { v.low };
            i64::from(end) - i64::from(v.given) + given
        });
        let end = own.next_back();
        InTheWay {
            name: word.key(),
            length,
            at_end: end.is_some_and(|end| {
                if up {
                    i64::from(length) >= end
                } else {
                    i64::from(length) <= end
                }
            }),
            varied: end.is_some(),
        }
    }

    fn text(&self) -> String {
        let where_it_is = match (self.varied, self.at_end) {
            (false, _) => ", which this study does not vary",
            (true, true) => ", the end of its range",
            (true, false) => "",
        };
        format!(
            ", limited by `{}` with {}{where_it_is}",
            self.name, self.length
        )
    }
}

/// The least that a figure is shown to be at most, and of which design.
fn finest(seen: &Seen, name: LimitName) -> (f64, Option<Lengths>) {
    let all = seen.of(name == LimitName::Bias);
    let most = all.filter_map(|c| Some((c.bounds.most(name)?, &c.lengths)));
    most.min_by(|a, b| a.0.total_cmp(&b.0).then_with(|| a.1.cmp(b.1)))
        .map_or((f64::MAX, None), |(most, l)| (most, Some(l.clone())))
}

/// The design that ran with the least of a value.
fn least(work: &Reporting, of: &dyn Fn(&Lengths) -> Option<f64>) -> Option<(f64, Lengths)> {
    let all = work.bench.all().into_iter();
    let valued = all.filter_map(|l| Some((of(&l).filter(|v| v.is_finite())?, l)));
    valued.min_by(|a, b| a.0.total_cmp(&b.0).then_with(|| a.1.cmp(&b.1)))
}

/// A design with one word, of all that it has and not only of those that vary, a bit longer (`1`) or shorter (`-1`).
fn with_one(design: &Design, by: i32) -> Vec<(Word, Design)> {
    let words = Word::ALL.into_iter();
    let of = |w: Word| {
        let length = w.length(design)?.checked_add_signed(by)?;
        let other = retune::with_lengths(design, &[(w, length)]).ok()?;
        Some((w, other))
    };
    words.filter_map(of).collect()
}

/// The word that keeps a bound of a design from being less: that of which one bit more lowers it the most; or where
/// none lowers it by more than a merit is certain to, that of which one bit less raises it the most.
fn coarsest(
    work: &Reporting,
    lengths: &[u32],
    of: &(dyn Fn(&Bounds) -> Option<f64> + Sync),
) -> Option<InTheWay> {
    let design = work.space.design(work.design, lengths).ok()?;
    let value = |d: &Design| {
        let verified = work.verifier.verify(&d.without_stops()).ok()?;
        of(&work.bounds(&verified))
    };
    let own = value(&design)?;
    let both = [1, -1].map(|by| {
        let others = with_one(&design, by);
        let values = in_parallel(&others, work.bench.threads(), &|_| {}, |(_, d)| value(d));
        let words = others.iter().map(|(w, _)| *w);
        let valued = words.zip(values).filter_map(|(w, v)| Some((v?, w)));
        valued.collect::<Vec<(f64, Word)>>()
    });
    let lowest = both[0].iter().min_by(|a, b| a.0.total_cmp(&b.0));
    if let Some((value, word)) = lowest
        && *value < own * (1.0 - RESOLUTION)
    {
        return Some(InTheWay::new(work, &design, *word, true));
    }
    let (_, word) = both[1].iter().max_by(|a, b| a.0.total_cmp(&b.0))?;
    Some(InTheWay::new(work, &design, *word, true))
}

/// The least bytes or cycles of a design that is good for anything, and of which.
fn smallest(work: &Reporting, name: LimitName) -> (f64, Option<Lengths>) {
    let worst = search::worst_merit(work.bench, work.searched);
    let value = |l: &Lengths| {
        let good = work.bench.merit(work.searched, l) <= worst;
        least_cost(work, name, work.bench.costs(l).filter(|_| good)?)
    };
    least(work, &value).map_or((f64::MAX, None), |(value, l)| (value, Some(l)))
}

/// The least of a cost over the targets.
fn least_cost(work: &Reporting, name: LimitName, costs: &[Cost]) -> Option<f64> {
    let of = |(o, c): (usize, &Cost)| cost_of(c, target(work, o) == "fpga", name);
    costs.iter().enumerate().filter_map(of).reduce(f64::min)
}

/// The word of which one bit less saves the most of a design's bytes or cycles, `value`.
fn dearest(work: &Reporting, name: LimitName, lengths: &[u32], value: f64) -> Option<InTheWay> {
    let design = work.space.design(work.design, lengths).ok()?;
    let costs = |d: &Design| {
        let objectives = work.bench.objectives.iter();
        let costs: Vec<Cost> = objectives.map(|b| cost::of_design(d, b.target)).collect();
        least_cost(work, name, &costs).unwrap_or(f64::MAX)
    };
    let others = with_one(&design, -1).into_iter();
    let saving = others
        .map(|(w, d)| (costs(&d), w))
        .filter(|(c, _)| *c < value);
    let (_, word) = saving.min_by(|a, b| a.0.total_cmp(&b.0))?;
    Some(InTheWay::new(work, &design, word, false))
}

/// Why no design holds what is asked.
fn why_not(work: &Reporting, seen: &Seen, required: &[Required], objective: usize) -> String {
    if work.limits.is_empty() {
        return "no point of the front is as good as the given design".to_owned();
    }
    let missed: Vec<&Required> = required.iter().filter(|r| !r.can_be_met).collect();
    if missed.is_empty() {
        return nearest(work, seen, objective);
    }
    let said: Vec<String> = missed
        .iter()
        .map(|r| {
            let word = match (r.limited_by, r.length) {
                (Some(name), Some(length)) => InTheWay {
                    name,
                    length,
                    at_end: r.at_end_of_range,
                    varied: r.varied,
                }
                .text(),
                (Some(name), None) => format!(", limited by `{name}`"),
                (None, _) => String::new(),
            };
            format!(
                "{} cannot be met: {} is required, {} is the best that is shown of any design{word}",
                r.name,
                number(r.limit, 3),
                number(r.best, 3)
            )
        })
        .collect();
    said.join("; ")
}

/// What keeps the nearest design from holding all limits, each of which some design holds.
fn nearest(work: &Reporting, seen: &Seen, objective: usize) -> String {
    let each = "each requirement can be met by itself, and no design that was verified is shown to meet all of them at once";
    let is_fabric = target(work, objective) == "fpga";
    let able = seen.of(work.limits.get(LimitName::Bias).is_some());
    let able = able.filter(|c| {
        let cost = work.bench.costs(&c.lengths).and_then(|c| c.get(objective));
        cost.is_some_and(|c| costs_hold(c, is_fabric, work.limits))
    });
    let misses = able.filter_map(|c| {
        let limits = work.limits.iter();
        let parts = limits.filter_map(|l| Some((c.bounds.most(l.name)? / l.value, l.name)));
        let (part, name) = parts.max_by(|a, b| a.0.total_cmp(&b.0))?;
        Some((part, name, &c.lengths))
    });
    let Some((part, name, lengths)) =
        misses.min_by(|a, b| a.0.total_cmp(&b.0).then_with(|| a.2.cmp(b.2)))
    else {
        return each.to_owned();
    };
    let word = coarsest(work, lengths, &|b| b.most(name)).map_or(String::new(), |w| w.text());
    format!(
        "{each}: the nearest has {part:.3} times the limit of {}{word}",
        name.name()
    )
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
