//! What a study says where no design holds what is required: the best that is shown of each limit, the word in the way,
//! the nearest design, and what to do.

use super::answer::{Seen, cost_of, costs_hold, target};
use super::certainty::Bounds;
use super::outcome::{Point, Required};
use super::reporting::{Checked, RESOLUTION, Reporting};
use super::retune;
use super::search;
use super::space::{LONGER, Lengths};
use crate::cost::{self, Cost};
use crate::design::word::Word;
use crate::design::{Design, Limit, LimitName};
use crate::parallel::in_parallel;
use crate::text::{at_most, number};

/// Each limit with the best that is shown of any design, and the word in the way.
pub(super) fn required(work: &Reporting, seen: &Seen) -> Vec<Required> {
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
        let estimate = lengths.as_ref().and_then(|l| estimate(seen, limit.name, l));
        let word = lengths.filter(|_| !met).and_then(|l| match limit.name {
            LimitName::RomBytes | LimitName::CyclesPerRow => dearest(work, limit.name, &l, best),
            name => coarsest(work, &l, &|b| b.most(name)),
        });
        out.push(Required {
            name: limit.name.name(),
            limit: limit.value,
            best,
            estimate,
            can_be_met: met,
            limited_by: match limit.name {
                LimitName::Bandwidth if !met => Some("circuit.decimator.ratio"),
                _ => word.map(|w| w.name),
            },
            length: word.map(|w| w.length),
            at_end_of_range: word.is_some_and(|w| w.at_end),
            varied: word.is_some_and(|w| w.varied),
            step_helps: word.is_some_and(|w| w.helps),
        });
    }
    out
}

/// A word that is in the way, as it is in the best design.
#[derive(Debug, Clone, Copy)]
struct InTheWay {
    word: Word,
    name: &'static str,
    length: u32,
    /// It would have to go up, or else down.
    up: bool,
    /// It cannot go further in the study's range.
    at_end: bool,
    /// The study varies it.
    varied: bool,
    /// One bit further is better by more than a merit is certain to.
    helps: bool,
}

impl InTheWay {
    /// The word as it is in `design`, where it would have to go up, or else down.
    fn new(work: &Reporting, design: &Design, word: Word, up: bool, helps: bool) -> Self {
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
            word,
            name: word.key(),
            length,
            up,
            at_end: end.is_some_and(|end| {
                if up {
                    i64::from(length) >= end
                } else {
                    i64::from(length) <= end
                }
            }),
            varied: end.is_some(),
            helps,
        }
    }

    /// Which word it is, and where a longer or shorter one may be had.
    fn text(&self, work: &Reporting) -> String {
        let (name, length) = (self.name, self.length);
        let what = format!(", limited by `{name}` with {length}");
        match (self.varied, self.at_end) {
            (false, _) => format!(
                "{what}, which this study does not vary: to have it varied, add it to `words` under `[study]` in the design's file"
            ),
            (true, true) => format!(
                "{what}, the end of the range that was studied{}",
                self.wider(work).map_or(String::new(), |line| format!(
                    ": to study more, write `{line}` under `[study.ranges]` in the design's file (add that table if there is none)"
                ))
            ),
            (true, false) => what,
        }
    }

    /// The line of a design's `[study.ranges]` that lets it go further; `None` where no design may have more.
    fn wider(&self, work: &Reporting) -> Option<String> {
        let mut variables = work.space.variables.iter();
        let v = variables.find(|v| v.words.contains(&self.word))?;
        let (least, most) = v.words.first()?.limits();
        let (low, high) = match self.up {
            true => (v.low, v.high.saturating_add(LONGER).min(most)),
            false => (v.low.saturating_sub(LONGER).max(least), v.high),
        };
        let is_wider = (low, high) != (v.low, v.high);
        is_wider.then(|| format!("\"{}\" = [{low}, {high}]", v.key()))
    }
}

/// The least that a figure is shown to be at most, and of which design.
fn finest(seen: &Seen, name: LimitName) -> (f64, Option<Lengths>) {
    let all = seen.of(name == LimitName::Bias);
    let most = all.filter_map(|c| Some((c.bounds.most(name)?, &c.lengths)));
    most.min_by(|a, b| a.0.total_cmp(&b.0).then_with(|| a.1.cmp(b.1)))
        .map_or((f64::MAX, None), |(most, l)| (most, Some(l.clone())))
}

/// The size of a figure of a verified design without its interval; of the bias with that of the start from power-on.
fn estimate(seen: &Seen, name: LimitName, lengths: &Lengths) -> Option<f64> {
    let c = seen.of(true).find(|c| c.lengths == *lengths)?;
    let own = c.verified.figures.of(name)?.abs();
    let start = c.verified.startup_dps.filter(|_| name == LimitName::Bias);
    Some(start.map_or(own, |[start, _]| own.max(start.abs())))
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
        return Some(InTheWay::new(work, &design, *word, true, true));
    }
    let (_, word) = both[1].iter().max_by(|a, b| a.0.total_cmp(&b.0))?;
    Some(InTheWay::new(work, &design, *word, true, false))
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
    Some(InTheWay::new(work, &design, word, false, true))
}

/// The verified design that comes nearest to what is required on a target, with its row.
pub(super) struct Near<'a> {
    pub(super) checked: &'a Checked,
    /// 0 = the given design.
    pub(super) number: usize,
    /// Its file, beside `study.json`.
    pub(super) design: Option<String>,
}

impl<'a> Near<'a> {
    /// The design among the numbered points, or the given one.
    pub(super) fn among(checked: &'a Checked, points: &[(Lengths, Point)]) -> Self {
        let own = points.iter().find(|(l, _)| *l == checked.lengths);
        Near {
            checked,
            number: own.map_or(0, |(_, p)| p.number),
            design: own.and_then(|(_, p)| p.design.clone()),
        }
    }
}

/// For each target on which nothing is chosen although something is required: the verified design whose worst excess over a
/// limit is the smallest, those first that hold what is required of the cost.
pub(super) fn nearest<'s>(
    work: &Reporting,
    seen: &'s Seen,
    chosen: &[Option<Lengths>],
) -> Vec<Option<&'s Checked>> {
    let of = |(objective, chosen): (usize, &Option<Lengths>)| {
        let is_asked = chosen.is_none() && !work.limits.is_empty();
        let designs = seen.of(work.limits.get(LimitName::Bias).is_some());
        let parts = designs.filter(|_| is_asked).filter_map(|c| {
            let (part, _) = excess(work, c, objective)?;
            Some((!cost_holds(work, c, objective), part, c))
        });
        let least = parts.min_by(|a, b| {
            let first = a.0.cmp(&b.0).then(a.1.total_cmp(&b.1));
            first.then_with(|| a.2.lengths.cmp(&b.2.lengths))
        });
        least.map(|(_, _, c)| c)
    };
    chosen.iter().enumerate().map(of).collect()
}

fn cost_holds(work: &Reporting, c: &Checked, objective: usize) -> bool {
    let costs = work.bench.costs(&c.lengths);
    let cost = costs.and_then(|costs| costs.get(objective));
    let is_fabric = target(work, objective) == "fpga";
    cost.is_some_and(|cost| costs_hold(cost, is_fabric, work.limits))
}

/// What a limit limits of a verified design: the largest that a figure may be, or a cost. `None` of the bandwidth, which is that
/// of every design.
fn value(work: &Reporting, c: &Checked, objective: usize, limit: &Limit) -> Option<f64> {
    let costs = work.bench.costs(&c.lengths);
    let cost = costs.and_then(|costs| costs.get(objective));
    let is_fabric = target(work, objective) == "fpga";
    let of_cost = || cost_of(cost?, is_fabric, limit.name);
    c.bounds.most(limit.name).or_else(of_cost)
}

/// The largest of a design's figures and costs in parts of its limit, and which it is.
fn excess(work: &Reporting, c: &Checked, objective: usize) -> Option<(f64, LimitName)> {
    let limits = work.limits.iter();
    let parts = limits.filter_map(|l| Some((value(work, c, objective, l)? / l.value, l.name)));
    parts.max_by(|a, b| a.0.total_cmp(&b.0))
}

/// The limits that a verified design is shown to hold, as `--for` takes them: those that are required, raised where it misses them.
/// A figure that is raised is so by `margin`; costs and the bandwidth are the same in every study.
fn held(work: &Reporting, c: &Checked, objective: usize, margin: f64) -> String {
    let text = |l: &Limit| {
        let name = l.name.name();
        match value(work, c, objective, l) {
            Some(value) if value > l.value && c.bounds.most(l.name).is_some() && margin > 1.0 => {
                format!("{name}<={}", with_margin(value, margin))
            }
            Some(value) if value > l.value => format!("{name}<={}", at_most(value, 3)),
            None if l.name == LimitName::Bandwidth && work.bandwidth_hz < l.value => {
                format!("{name}>={}", work.bandwidth_hz.floor())
            }
            _ if l.name.is_least() => format!("{name}>={:e}", l.value),
            _ => format!("{name}<={:e}", l.value),
        }
    };
    let all: Vec<String> = work.limits.iter().map(text).collect();
    all.join(" ")
}

/// Why no design holds what is asked, and what to do.
pub(super) fn why_not(
    work: &Reporting,
    required: &[Required],
    near: Option<&Near>,
    objective: usize,
) -> String {
    if work.limits.is_empty() {
        return "no point of the front is as good as the given design".to_owned();
    }
    let missed: Vec<&Required> = required.iter().filter(|r| !r.can_be_met).collect();
    let mut said: Vec<String> = missed.iter().map(|r| in_the_way(work, r)).collect();
    if missed.is_empty() {
        said.push(not_at_once(work, near, objective));
    }
    if let Some(near) = near {
        let named = match &near.design {
            Some(file) => format!("point {} ({file})", near.number),
            None => "the given one".to_owned(),
        };
        said.push(format!(
            "The nearest design is {named}, marked with ! before its number in the table"
        ));
        said.extend(off_the_front(work, near));
        let held = |margin| held(work, near.checked, objective, margin);
        said.push(limits_to_ask_for(
            &held(1.0),
            &held(NEW_STUDY_MARGIN_FACTOR),
        ));
    }
    said.join(". ")
}

/// What a figure's limit is raised by, so that a new study, which measures on noise of its own, is likely to meet it too
/// (convention).
const NEW_STUDY_MARGIN_FACTOR: f64 = 1.1;

/// A figure times a margin, rounded up to two digits.
fn with_margin(value: f64, margin: f64) -> String {
    at_most(value * margin, 2)
}

/// Why the nearest design has no mark of a front, where its error after power-on keeps it off.
fn off_the_front(work: &Reporting, near: &Near) -> Option<String> {
    let late = work.late(near.checked).filter(|_| near.number > 0)?;
    Some(format!(
        "It is on no front because its error after power-on may be as large as {} deg/s, more than the limit of the bias allows",
        at_most(late.start_dps, 3)
    ))
}

/// The limits that a design meets as measured, and those, with a margin, that a new study can be asked for.
fn limits_to_ask_for(held: &str, with_margin: &str) -> String {
    let met = format!("As measured here, it meets `--for \"{held}\"`");
    match held == with_margin {
        true => met,
        false => format!(
            "{met}. A new study measures with other noise. Give it a limit with a margin, such as `--for \"{with_margin}\"`"
        ),
    }
}

/// Is the start from power-on in the figure? `None` of what is known without a run.
fn has_start(r: &Required) -> Option<bool> {
    r.estimate.map(|_| r.name == LimitName::Bias.name())
}

/// A limit that no design holds, with what is in the way.
fn in_the_way(work: &Reporting, r: &Required) -> String {
    let words = || Word::ALL.into_iter();
    let word = r
        .limited_by
        .and_then(|name| words().find(|w| w.key() == name));
    let floor = r.estimate.filter(|_| !r.step_helps).map(floor);
    let why = match (floor, r.limited_by, r.length, word) {
        (Some(floor), ..) => floor,
        (None, Some(name), Some(length), Some(word)) => {
            // Costs have to go down.
            let up = r.estimate.is_some();
            let (at_end, varied, helps) = (r.at_end_of_range, r.varied, r.step_helps);
            let word = InTheWay {
                word,
                name,
                length,
                up,
                at_end,
                varied,
                helps,
            };
            word.text(work)
        }
        (None, Some(name), ..) => format!(", limited by `{name}`"),
        (None, None, ..) => String::new(),
    };
    let shown = match has_start(r) {
        Some(true) => " (the upper end of its interval, with the error after power-on)",
        Some(false) => " (the upper end of its interval)",
        None => "",
    };
    format!(
        "{} cannot be met: {} is required, and {} is the best that is shown of any design{shown}{why}",
        r.name,
        number(r.limit, 3),
        number(r.best, 3)
    )
}

/// What a bound is made of that no longer word lowers.
fn floor(estimate: f64) -> String {
    format!(
        ". No word that is one bit longer lowers that by more than {:.0} %: the word lengths make {} of it, and the rest is how far the \
         noise of the run lets it be known",
        100.0 * RESOLUTION,
        number(estimate, 3)
    )
}

/// What keeps the nearest design from holding all limits, each of which some design holds.
fn not_at_once(work: &Reporting, near: Option<&Near>, objective: usize) -> String {
    let each = "each requirement can be met by itself, and no design that was verified is shown to meet all of them at once";
    let Some((near, (part, name))) =
        near.and_then(|near| Some((near.checked, excess(work, near.checked, objective)?)))
    else {
        return each.to_owned();
    };
    let word = coarsest(work, &near.lengths, &|b| b.most(name));
    format!(
        "{each}: the nearest has {part:.3} times the limit of {}{}",
        name.name(),
        word.map_or(String::new(), |word| word.text(work))
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_limit_for_a_new_study_has_a_margin_and_is_not_promised() {
        assert_eq!(with_margin(2.32e-4, NEW_STUDY_MARGIN_FACTOR), "0.00026");
        assert_eq!(with_margin(0.0123, NEW_STUDY_MARGIN_FACTOR), "0.014");
        let costs = limits_to_ask_for("rom_bytes<=4100", "rom_bytes<=4100");
        assert_eq!(
            costs,
            "As measured here, it meets `--for \"rom_bytes<=4100\"`"
        );
        let figures = limits_to_ask_for("bias_dps<=0.000232", "bias_dps<=0.00026");
        assert!(
            figures.contains("meets `--for \"bias_dps<=0.000232\"`. A new study ")
                && figures.ends_with(" a margin, such as `--for \"bias_dps<=0.00026\"`"),
            "{figures}"
        );
    }
}
