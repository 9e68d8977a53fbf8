//! All of `gyrogen study`: search, verification, answers.

use super::answer;
use super::bench::Bench;
use super::design_text;
use super::front::{Point as Candidate, front, resolved};
use super::journal::Journal;
use super::merit::Scale;
use super::outcome::{Conditions, Parameter, Point, Study, Sweep, Swept, WordLengths};
use super::search::{self, Effort};
use super::space::{Lengths, Space};
use super::verify::{Verified, Verifier};
use super::{budget, overflow, shard};
use crate::design::{Design, Limits};
use crate::error::{InputError, Result};
use crate::parallel::in_parallel;
use std::collections::BTreeMap;
use std::path::Path;

/// What is asked.
#[derive(Debug, Clone)]
pub struct Request<'a> {
    /// `--for`; the design's `[requirements]` without it.
    pub limits: Limits,
    /// Written into the result.
    pub command: &'a str,
    /// Threads; the result does not depend on it.
    pub threads: usize,
    /// Where the journal is kept; `None` = nowhere.
    pub folder: Option<&'a Path>,
    /// Folders of shards whose runs are taken over.
    pub merged: &'a [std::path::PathBuf],
    /// Never search the whole space.
    pub heuristic: bool,
}

/// `study.json` and the design files: name and text.
#[derive(Debug, Clone, PartialEq)]
pub struct Done {
    /// The result.
    pub study: Study,
    /// Name below the folder, text.
    pub files: Vec<(String, String)>,
}

/// Points of a front whose merits differ by less are one point with alternatives: the merit of a point is certain
/// to about this, with the rows that a verification runs.
pub const RESOLUTION: f64 = 0.03;

/// Runs a study. `said` is told how many designs have run.
///
/// # Errors
/// A design that overflows (exit 1); words that it does not have, a phase loop that cannot lock, a journal that
/// cannot be written.
pub fn study(design: &Design, request: &Request, said: &(dyn Fn(usize) + Sync)) -> Result<Done> {
    if design.compensation.is_none() && design.bound.is_some() {
        return Err(
            InputError::new("the compensation's formats are not chosen yet")
                .help("run `gyrogen run` first, and study the design.toml that it writes")
                .into(),
        );
    }
    overflow::refuse(design)?;
    let space = Space::new(design)?;
    let mut bench = Bench::new(design, &space, request.threads, said)?;
    let hash = shard::hash(design, &space);
    if !request.merged.is_empty() {
        bench.know(shard::merged(request.merged, &hash)?);
    }
    if let Some(folder) = request.folder {
        let (journal, known) = Journal::open(folder, &hash)?;
        bench = bench.with_journal(journal, known);
    }
    let bandwidth_hz = super::bandwidth::bandwidth_hz(design);
    let verifier = Verifier::new(design)?;
    let own = verifier.figures(&design.without_stops())?;
    let instrument = Scale::of_instrument(design, &bench.whole, bandwidth_hz).at_least(&own);
    let asked = Scale::of_limits(&request.limits);
    let (scale, limits_from) = if asked.is_empty() {
        (
            instrument,
            "no figure of the data sheet more than one percent worse than the given design's",
        )
    } else {
        (asked, "requirements")
    };
    let exhaustive = !request.heuristic && space.size() <= u128::from(design.study.exhaustive);
    let (fronts, method) = if exhaustive {
        (search::exhaust(&mut bench, &scale)?, "exhaustive")
    } else {
        (search::search(&mut bench, &scale, Effort::STUDY)?, "search")
    };
    let work = Reporting {
        design,
        space: &space,
        bench: &bench,
        verifier: &verifier,
        scale: &scale,
        instrument: &instrument,
    };
    work.report(fronts, request, (method, limits_from, bandwidth_hz))
}

/// Runs a part of a study into a folder.
///
/// # Errors
/// As [`study`].
pub fn part(
    design: &Design,
    part: shard::Part,
    threads: usize,
    folder: &Path,
    said: &(dyn Fn(usize) + Sync),
) -> Result<std::path::PathBuf> {
    overflow::refuse(design)?;
    let space = Space::new(design)?;
    let mut bench = Bench::new(design, &space, threads, said)?;
    shard::run(&mut bench, part, &shard::hash(design, &space), folder)
}

/// What is at hand when the search is over.
pub(super) struct Reporting<'a> {
    pub(super) design: &'a Design,
    pub(super) space: &'a Space,
    pub(super) bench: &'a Bench<'a>,
    pub(super) verifier: &'a Verifier<'a>,
    /// What a merit of 1 is.
    pub(super) scale: &'a Scale,
    /// The same by the instrument's own figures.
    pub(super) instrument: &'a Scale,
}

/// A point with all that is known of it.
struct Checked {
    lengths: Lengths,
    point: Design,
    text: String,
    verified: Verified,
}

impl Reporting<'_> {
    fn report(
        &self,
        fronts: Vec<Vec<Candidate>>,
        request: &Request,
        (method, limits_from, bandwidth_hz): (&'static str, &'static str, f64),
    ) -> Result<Done> {
        let given = self.space.given();
        let mut wanted: Vec<Lengths> = fronts.iter().flatten().map(|p| p.lengths.clone()).collect();
        wanted.push(given.clone());
        wanted.sort();
        wanted.dedup();
        let checked = in_parallel(&wanted, self.bench.threads(), &|_| {}, |l| self.check(l));
        let mut good: BTreeMap<Lengths, Checked> = BTreeMap::new();
        let mut dropped = 0;
        let mut notes = Vec::new();
        for (lengths, checked) in wanted.iter().zip(checked) {
            match checked {
                Ok(c) if self.holds(&c.verified) || *lengths == given => {
                    good.insert(lengths.clone(), c);
                }
                Ok(_) => dropped += 1,
                Err(why) => {
                    dropped += 1;
                    if !notes.contains(&why) {
                        notes.push(why);
                    }
                }
            }
        }
        let Some(reference) = good.get(&given) else {
            let why = notes.join("; ");
            return Err(InputError::new(format!("the given design cannot be run: {why}")).into());
        };
        let own = self.scale.merit(&reference.verified.figures);
        let worst = search::worst_merit(self.bench, self.scale).max(own);
        let mut reported: BTreeMap<Lengths, (Vec<String>, Vec<WordLengths>)> = BTreeMap::new();
        for (objective, target) in self.design.study.targets.iter().enumerate() {
            let candidates = good.iter().map(|(lengths, c)| Candidate {
                lengths: lengths.clone(),
                cost: self.bench.cost(objective, lengths),
                merit: self
                    .scale
                    .merit(&c.verified.figures)
                    .max(search::FINEST_MERIT),
            });
            let points = front(candidates.collect(), &given, worst);
            for (leader, others) in resolved(points, RESOLUTION) {
                let entry = reported.entry(leader.lengths).or_default();
                entry.0.push(target.clone());
                let others = others.iter().map(|p| self.named(&p.lengths));
                entry.1.extend(others);
            }
        }
        let base = self.point(reference);
        let mut points = Vec::new();
        for (lengths, (targets, alternatives)) in reported {
            if let Some(c) = good.get(&lengths) {
                let mut point = self.point(c);
                point.targets = targets;
                point.alternatives = alternatives;
                points.push((lengths, c, point));
            }
        }
        points.sort_by(|a, b| b.2.merit.total_cmp(&a.2.merit).then_with(|| a.0.cmp(&b.0)));
        let digits = points.len().to_string().len();
        let mut files = Vec::new();
        for (k, (_, c, point)) in points.iter_mut().enumerate() {
            point.number = k + 1;
            let name = format!("designs/point-{:0digits$}.toml", k + 1);
            files.push((name.clone(), c.text.clone()));
            point.design = Some(name);
        }
        let numbered: Vec<(Lengths, Point)> = points
            .iter()
            .map(|(l, _, p)| (l.clone(), p.clone()))
            .collect();
        let answers = answer::answers(self, &numbered, &base, request, bandwidth_hz);
        let threads = self.bench.threads();
        let mut chosen_budgets = BTreeMap::new();
        for chosen in &answers.chosen {
            let point = numbered
                .iter()
                .find(|(_, p)| Some(p.number) == chosen.point);
            if let Some(c) = point.and_then(|(l, _)| good.get(l)) {
                let budget = budget::budget(&c.point, self.verifier, threads)?;
                chosen_budgets.insert(chosen.target.clone(), budget);
            }
        }
        let plan = &self.bench.plan;
        let ratio = self.design.circuit.decimator.ratio;
        let study = Study {
            schema: "gyrogen.study/1",
            version: env!("CARGO_PKG_VERSION"),
            design_sha256: self.design.source.sha256.clone(),
            command: request.command.to_owned(),
            parameters: self.space.variables.iter().map(parameter).collect(),
            reference: base,
            front: numbered.into_iter().map(|(_, p)| p).collect(),
            chosen: answers.chosen,
            required: answers.required,
            limits: *self.scale,
            limits_from,
            instrument: self.bench.whole,
            bandwidth_hz,
            method,
            space: self.space.size() as f64,
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

    fn check(&self, lengths: &Lengths) -> std::result::Result<Checked, String> {
        let point = self.space.design(self.design, lengths)?;
        let text = design_text::text(self.design, &point)?;
        let verified = self.verifier.verify(&point.without_stops());
        let verified = verified.map_err(|e| e.to_string())?;
        Ok(Checked {
            lengths: lengths.clone(),
            point,
            text,
            verified,
        })
    }

    /// No overflow that the given design cannot have, and a start that ends where the settled circuit is: within
    /// the limit of the bias, or of what a mean over so few rows is certain to.
    fn holds(&self, v: &Verified) -> bool {
        let noise = v
            .figures
            .noise_dps_rthz
            .max(self.instrument.noise_dps_rthz.unwrap_or(0.0));
        let limit = self.instrument.bias_dps.unwrap_or(f64::INFINITY);
        let allowed = 3.0 * (limit + noise + v.figures.bias_dps.abs());
        v.overflows.is_empty() && v.startup_error_dps.is_none_or(|e| e.abs() <= allowed)
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
            as_good_as_given: self.instrument.merit(f) <= 1.0,
            verified: true,
            startup_error_dps: c.verified.startup_error_dps,
            changes: changes
                .map(|(k, v)| (k, v.to_string().trim().to_owned()))
                .collect(),
            alternatives: Vec::new(),
        }
    }

    fn sweeps(&self) -> Vec<Sweep> {
        let given = self.space.given();
        let base = self.bench.merit(self.scale, &given);
        let mut out = Vec::new();
        for (k, v) in self.space.variables.iter().enumerate() {
            let at = |length: u32| {
                let mut lengths = given.clone();
                lengths[k] = length;
                lengths
            };
            let merit = |length: u32| self.bench.merit(self.scale, &at(length));
            // Of the certainty of a merit: less is no change.
            let worse = |length: &u32| merit(*length) > base * (1.0 + RESOLUTION);
            let better = |length: &u32| merit(*length) < merit(*length - 1) * (1.0 - RESOLUTION);
            let curve = (v.low..=v.high).map(|length| {
                let lengths = at(length);
                let figures = self.bench.figures(&lengths).copied();
                Swept {
                    length,
                    figures,
                    merit: figures.map(|f| self.scale.merit(&f)),
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
