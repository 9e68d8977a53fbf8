//! From the fronts of a search to what is reported: every point verified, numbered, with its file and its answers.

use super::answer::{self, Seen};
use super::bench::Bench;
use super::budget;
use super::certainty::{Bounds, Confidence, largest};
use super::design_text;
use super::figures::Figures;
use super::front::{Point as Candidate, front, resolved};
use super::late::{Late, late_starts};
use super::merit::Scale;
use super::outcome::{
    Conditions, Done, Parameter, Point, Quarter, QuarterWord, Study, Sweep, Swept, WordLengths,
};
use super::progress::{Progress, Step};
use super::quarter::{SHARE, Tried};
use super::search;
use super::space::{Lengths, Space};
use super::unmet::{self, Near};
use super::verify::{Verified, Verifier};
use crate::design::{Design, Limits};
use crate::error::{InputError, Result};
use crate::parallel::in_parallel;
use crate::text::counted;
use std::collections::BTreeMap;

/// Points of a front whose merits differ by less are one point with alternatives: the merit of a point is certain
/// to about this, with the rows that a verification runs.
pub const RESOLUTION: f64 = 0.03;

/// The folder of the points' designs, below that of the results.
pub const DESIGNS: &str = "designs";

/// What is at hand when the search is over.
pub(super) struct Reporting<'a> {
    pub(super) design: &'a Design,
    pub(super) space: &'a Space,
    pub(super) bench: &'a Bench<'a>,
    pub(super) verifier: &'a Verifier<'a>,
    /// What a merit of 1 is.
    pub(super) scale: &'a Scale,
    /// The same for what the search has run.
    pub(super) searched: &'a Scale,
    /// What a merit of 1 is by the instrument's own figures.
    pub(super) instrument: &'a Scale,
    /// What the given design adds.
    pub(super) own: &'a Figures,
    /// What is required.
    pub(super) limits: &'a Limits,
    pub(super) bandwidth_hz: f64,
    /// Of the intervals of all verified points.
    pub(super) confidence: Confidence,
    pub(super) said: &'a (dyn Fn(Progress) + Sync),
}

/// Why a point is dropped of which a word can overflow: an error of its own, whatever its figures are.
const OVERFLOWS: &str = "a word can overflow that in the given design cannot";

/// What stands in the result as it is.
pub(super) struct Method<'a> {
    pub(super) method: &'static str,
    pub(super) limits_from: &'static str,
    pub(super) command: &'a str,
    /// What was tried for a quarter less, by target.
    pub(super) tried: Vec<Option<Tried>>,
}

/// A point with all that is known of it.
pub(super) struct Checked {
    pub(super) lengths: Lengths,
    point: Design,
    text: String,
    pub(super) verified: Verified,
    pub(super) bounds: Bounds,
}

impl Reporting<'_> {
    pub(super) fn report(&self, wanted: &[Lengths], how: &Method) -> Result<Done> {
        let given = self.space.given();
        let mut notes = Vec::new();
        let (seen, dropped) = self.verified(wanted, &mut notes);
        let good = &seen.good;
        let Some(reference) = good.get(&given) else {
            let why = notes.join("; ");
            return Err(InputError::new(format!("the given design cannot be run: {why}")).into());
        };
        let base = self.point(reference);
        let chosen = answer::chosen(self, good);
        let mut points = Vec::new();
        for (lengths, (targets, alternatives)) in self.fronts(good, &chosen) {
            if let Some(c) = good.get(&lengths) {
                let mut point = self.point(c);
                point.targets = targets;
                point.alternatives = alternatives;
                points.push((lengths, c, point));
            }
        }
        points.sort_by(|a, b| b.2.merit.total_cmp(&a.2.merit).then_with(|| a.0.cmp(&b.0)));
        let on_front = points.len();
        let nearest = unmet::nearest(self, &seen, &chosen);
        for c in nearest.iter().flatten() {
            if c.lengths != given && points.iter().all(|(l, ..)| *l != c.lengths) {
                points.push((c.lengths.clone(), *c, self.point(c)));
            }
        }
        let digits = points.len().to_string().len();
        let mut files = Vec::new();
        for (k, (_, c, point)) in points.iter_mut().enumerate() {
            point.number = k + 1;
            let name = format!("{DESIGNS}/point-{:0digits$}.toml", k + 1);
            files.push((name.clone(), c.text.clone()));
            point.design = Some(name);
        }
        let numbered: Vec<(Lengths, Point)> = points
            .iter()
            .map(|(l, _, p)| (l.clone(), p.clone()))
            .collect();
        let near = nearest.into_iter();
        let near: Vec<Option<Near>> = near.map(|c| c.map(|c| Near::among(c, &numbered))).collect();
        (self.said)(Progress {
            step: Step::Answering,
            done: 0,
            new: 0,
            of: 0,
            at_most: false,
        });
        let answers = answer::answers(self, &seen, &numbered, &base, &chosen, &near);
        let all = numbered.iter().map(|(_, p)| p.clone());
        let (front, nearest) = (all.clone().take(on_front), all.skip(on_front));
        notes.extend(answers.notes);
        let threads = self.bench.threads();
        let mut chosen_budgets = BTreeMap::new();
        for (target, lengths) in self.design.study.targets.iter().zip(&chosen) {
            if let Some(c) = lengths.as_ref().and_then(|l| good.get(l)) {
                let budget = budget::budget(&c.point, self.verifier, threads)?;
                chosen_budgets.insert(target.clone(), budget);
            }
        }
        let plan = &self.bench.plan;
        let ratio = self.design.circuit.decimator.ratio;
        let study = Study {
            schema: "gyrogen.study/1",
            version: env!("CARGO_PKG_VERSION"),
            design_sha256: self.design.source.sha256.clone(),
            command: how.command.to_owned(),
            parameters: self.space.variables.iter().map(parameter).collect(),
            reference: base,
            front: front.collect(),
            nearest: nearest.collect(),
            chosen: answers.chosen,
            required: answers.required,
            limits: *self.scale,
            limits_from: how.limits_from,
            instrument: self.bench.whole,
            bandwidth_hz: self.bandwidth_hz,
            method: how.method,
            space: self.space.size() as f64,
            confidence: self.confidence,
            quarter_less: self.quarter_less(how, &chosen, &numbered),
            designs_considered: self.bench.considered(),
            designs_simulated: self.bench.simulated(),
            points_dropped: dropped,
            sweeps: self.sweeps(),
            budget: budget::budget(self.design, self.verifier, threads)?,
            chosen_budgets,
            conditions: Conditions {
                temperatures: [
                    super::scenario::Extent::SEARCH.temperatures,
                    super::scenario::Extent::VERIFY.temperatures,
                ],
                full_rate_dps: plan.full_rate_dps,
                detuned_hz: plan.detuned.as_ref().map(|_| plan.detuned_hz),
                samples: [plan.samples(ratio), self.verifier.plan.samples(ratio)],
            },
            notes,
        };
        Ok(Done { study, files })
    }

    /// The designs as their verification finds them, and how many it drops. Each reason is noted once.
    fn verified(&self, wanted: &[Lengths], notes: &mut Vec<String>) -> (Seen, usize) {
        let given = self.space.given();
        let said = |done: usize| {
            (self.said)(Progress {
                step: Step::Verifying,
                done,
                new: done,
                of: wanted.len(),
                at_most: false,
            });
        };
        let checked = in_parallel(wanted, self.bench.threads(), &said, |l| self.check(l));
        let mut seen = Seen {
            good: BTreeMap::new(),
            late: Vec::new(),
        };
        let mut reasons: BTreeMap<String, u64> = BTreeMap::new();
        let mut late: Vec<Late> = Vec::new();
        for (lengths, checked) in wanted.iter().zip(checked) {
            let is_given = *lengths == given;
            match checked.map(|c| (self.late(&c), c)) {
                Ok((_, c)) if !c.verified.overflows.is_empty() && !is_given => {
                    *reasons.entry(OVERFLOWS.to_owned()).or_default() += 1;
                }
                Ok((Some(one), c)) if !is_given => {
                    late.push(one);
                    seen.late.push(c);
                }
                Ok((one, c)) => {
                    notes.extend(one.and_then(|one| late_starts("the given design", &[one])));
                    seen.good.insert(lengths.clone(), c);
                }
                Err(why) => *reasons.entry(why).or_default() += 1,
            }
        }
        let told =
            |(why, count): (&String, &u64)| format!("{} dropped: {why}", counted(*count, "point"));
        notes.extend(reasons.iter().map(told));
        let count = late.len() as u64;
        notes.extend(late_starts(
            &format!("{} dropped", counted(count, "point")),
            &late,
        ));
        let dropped = reasons.values().sum::<u64>() + count;
        (seen, dropped as usize)
    }

    /// The fronts of the verified designs, with what was chosen: by lengths the targets and the alternatives.
    fn fronts(
        &self,
        good: &BTreeMap<Lengths, Checked>,
        chosen: &[Option<Lengths>],
    ) -> BTreeMap<Lengths, (Vec<String>, Vec<WordLengths>)> {
        let given = self.space.given();
        let merit = |c: &Checked| self.scale.merit(&c.verified.figures);
        let own = good.get(&given).map_or(0.0, merit);
        let worst = search::worst_merit(self.bench, self.searched).max(own);
        let mut reported: BTreeMap<Lengths, (Vec<String>, Vec<WordLengths>)> = BTreeMap::new();
        for (objective, target) in self.design.study.targets.iter().enumerate() {
            let candidates = good.iter().map(|(lengths, c)| Candidate {
                lengths: lengths.clone(),
                cost: self.bench.cost(objective, lengths),
                merit: merit(c).max(search::FINEST_MERIT),
            });
            let points = front(candidates.collect(), &given, worst);
            // A point that holds what is asked is no alternative of one that does not.
            let holds = |l: &Lengths| {
                good.get(l)
                    .is_some_and(|c| answer::holds(self, c, objective))
            };
            let apart = |a: &Candidate, b: &Candidate| holds(&a.lengths) != holds(&b.lengths);
            for (leader, others) in resolved(points, RESOLUTION, &apart) {
                let entry = reported.entry(leader.lengths).or_default();
                entry.0.push(target.clone());
                let others = others.iter().map(|p| self.named(&p.lengths));
                entry.1.extend(others);
            }
        }
        for lengths in chosen.iter().flatten() {
            reported.entry(lengths.clone()).or_default();
        }
        reported
    }

    /// For each target a design that costs a quarter less and is as good, or what shows that there is none.
    fn quarter_less(
        &self,
        how: &Method,
        chosen: &[Option<Lengths>],
        points: &[(Lengths, Point)],
    ) -> Vec<Quarter> {
        if !self.limits.is_empty() {
            return Vec::new();
        }
        let mut out = Vec::new();
        for (objective, target) in self.design.study.targets.iter().enumerate() {
            let unit = self.bench.cost(objective, &self.space.given());
            let is_cheap = |l: &&Lengths| self.bench.cost(objective, l) <= SHARE * unit;
            let found = chosen
                .get(objective)
                .and_then(Option::as_ref)
                .filter(is_cheap);
            let point = points.iter().find(|(l, _)| Some(l) == found);
            let variables = &self.space.variables;
            let word = |k: usize, lengths: &[u32]| QuarterWord {
                name: variables[k].key(),
                lengths: lengths.to_vec(),
            };
            let tried = how.tried.get(objective).and_then(Option::as_ref);
            let whole = how.method == "exhaustive";
            let words: Vec<QuarterWord> = match tried {
                Some(t) => t.words.iter().map(|(k, l)| word(*k, l)).collect(),
                None if whole => {
                    let all = variables.iter().enumerate();
                    all.map(|(k, v)| word(k, &(v.low..=v.high).collect::<Vec<_>>()))
                        .collect()
                }
                None => Vec::new(),
            };
            let best = tried.and_then(|t| t.best.as_ref());
            let figures = best.and_then(|(_, l)| self.bench.figures(l));
            out.push(Quarter {
                target: target.clone(),
                share: SHARE,
                point: point.map(|(_, p)| p.number),
                proved_none: point.is_none() && (whole || tried.is_some()),
                words,
                others: tried.map_or(WordLengths::new(), |t| {
                    let mut others = self.named(&t.others);
                    for (k, _) in &t.words {
                        others.remove(variables[*k].key());
                    }
                    others
                }),
                designs: tried.map_or(if whole { self.bench.considered() } else { 0 }, |t| {
                    t.designs
                }),
                cheap_enough: tried.map(|t| t.cheap),
                best_merit: best.map(|(merit, _)| *merit),
                best_limited_by: figures.map(|f| self.searched.worst(f)),
            });
        }
        out
    }

    fn check(&self, lengths: &Lengths) -> std::result::Result<Checked, String> {
        let point = self.space.design(self.design, lengths)?;
        let text = design_text::text(self.design, &point)?;
        let verified = self.verifier.verify(&point.without_stops());
        let verified = verified.map_err(|e| e.to_string())?;
        Ok(Checked {
            lengths: lengths.clone(),
            point,
            text,
            bounds: self.bounds(&verified),
            verified,
        })
    }

    /// A start from power-on that is not shown to end where the settled circuit is: the point cannot be reported.
    ///
    /// A start is an error of the bias: the whole of its interval, deg/s, has to be within the limit of the bias, deg/s,
    /// times the point's merit where that is above 1. A point says that its figures are within merit times their limits,
    /// and that has to be so after a start too.
    pub(super) fn late(&self, c: &Checked) -> Option<Late> {
        let limit_dps = self.scale.bias_dps.or(self.instrument.bias_dps)?;
        let claimed = self.scale.merit(&c.verified.figures).max(1.0);
        let start_dps = largest(c.bounds.startup_error_dps?);
        (start_dps > limit_dps * claimed).then_some(Late {
            start_dps,
            limit_dps,
        })
    }

    /// Of a verified design.
    pub(super) fn bounds(&self, v: &Verified) -> Bounds {
        Bounds::new(&v.figures, &v.errors, v.startup_dps, &self.confidence)
    }

    pub(super) fn named(&self, lengths: &[u32]) -> WordLengths {
        let variables = self.space.variables.iter().zip(lengths);
        variables
            .flat_map(|(v, length)| {
                let by = i64::from(*length) - i64::from(v.given);
                let own = move |w: &crate::design::word::Word| {
                    let given = w.length(self.design).map_or(0, i64::from);
                    (w.key(), (given + by) as u32)
                };
                v.words.iter().map(own).collect::<Vec<_>>()
            })
            .collect()
    }

    pub(super) fn prices(&self, lengths: &[u32]) -> BTreeMap<String, f64> {
        let targets = self.design.study.targets.iter().enumerate();
        targets
            .map(|(o, t)| (t.clone(), self.bench.cost(o, lengths)))
            .filter(|(_, price)| price.is_finite())
            .collect()
    }

    fn point(&self, c: &Checked) -> Point {
        let f = &c.verified.figures;
        let price = self.prices(&c.lengths);
        let base = self.prices(&self.space.given());
        let relative = price
            .iter()
            .filter_map(|(t, p)| Some((t.clone(), p / base.get(t)?)));
        let costs = self.bench.costs(&c.lengths).unwrap_or_default();
        let targets = self.design.study.targets.iter().cloned();
        let changes = design_text::changes(self.design, &c.point).into_iter();
        Point {
            number: 0,
            design: None,
            targets: Vec::new(),
            word_lengths: self.named(&c.lengths),
            cost: targets.zip(costs.iter().copied()).collect(),
            price_of_given: relative.collect(),
            price,
            bias_error_dps: f.bias_dps,
            drift_residual_dps: f.drift_dps,
            noise_dps_rthz: f.noise_dps_rthz,
            arw_deg_rth: f.arw_deg_rth,
            scale_factor_ppm: f.scale_factor_ppm,
            spur_dps: f.spur_dps,
            spur_hz: f.spur_hz,
            spur_detuned: f.spur_detuned,
            spur_floor_dps: f.spur_floor_dps,
            merit: self.scale.merit(f),
            limited_by: self.scale.worst(f),
            parts: self.scale.parts(f).into_iter().collect(),
            bounds: c.bounds,
            as_good_as_given: self.instrument.holds(f, &c.bounds, self.own),
            shown: answer::figures_hold(self, c),
            verified: true,
            startup_error_dps: c.verified.startup_dps.map(|[value, _]| value),
            changes: changes
                .map(|(k, v)| (k, v.to_string().trim().to_owned()))
                .collect(),
            alternatives: Vec::new(),
        }
    }

    fn sweeps(&self) -> Vec<Sweep> {
        let given = self.space.given();
        let base = self.bench.merit(self.searched, &given);
        let mut out = Vec::new();
        for (k, v) in self.space.variables.iter().enumerate() {
            let at = |length: u32| {
                let mut lengths = given.clone();
                lengths[k] = length;
                lengths
            };
            let merit = |length: u32| self.bench.merit(self.searched, &at(length));
            // Of the certainty of a merit: less is no change.
            let worse = |length: &u32| merit(*length) > base * (1.0 + RESOLUTION);
            let better = |length: &u32| merit(*length) < merit(*length - 1) * (1.0 - RESOLUTION);
            let curve = (v.low..=v.high).map(|length| {
                let lengths = at(length);
                let figures = self.bench.figures(&lengths).copied();
                Swept {
                    length,
                    figures,
                    merit: figures.map(|f| self.searched.merit(&f)),
                    price: self.prices(&lengths),
                }
            });
            out.push(Sweep {
                name: v.key(),
                first_that_hurts: (v.low..v.given).rev().find(worse),
                last_that_helps: (v.given + 1..=v.high).rev().find(better),
                curve: curve.collect(),
            });
        }
        out
    }
}

fn parameter(v: &super::space::Variable) -> Parameter {
    Parameter {
        name: v.key(),
        tied: v.words.iter().skip(1).map(|w| w.key()).collect(),
        unit: v.words.first().map_or("bits", |w| w.counts()),
        low: v.low,
        high: v.high,
        given: v.given,
    }
}
