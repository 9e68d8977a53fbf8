//! Runs and prices designs, each once: a function of the lengths alone, whatever the order or the threads.

use super::figures::{Figures, added, whole};
use super::journal::Journal;
use super::measure::{Output, run, run_together};
use super::merit::Scale;
use super::progress::{Progress, Step};
use super::scenario::{Extent, Plan};
use super::space::{Lengths, Space};
use crate::circuit::engine::ArithmeticKind;
use crate::circuit::ensemble::{groups, share_a_closed_loop};
use crate::cost::price::Objective;
use crate::cost::{self, Cost};
use crate::design::Design;
use crate::error::Result;
use crate::parallel::in_parallel;
use std::collections::{BTreeMap, BTreeSet};
use std::sync::atomic::{AtomicUsize, Ordering};

/// What a run of a design gave: `None` = there is no such design, or it cannot run.
pub type Trial = Option<Figures>;

/// The seed of a plan's noise follows from the design's, so that verification has another one.
const SEARCH_SEED: u64 = 0x5745_4152_4348;
/// Of the verification.
pub const VERIFY_SEED: u64 = 0x5645_5249_4659;

/// Runs designs of a space over one plan.
pub struct Bench<'a> {
    /// The design as given.
    pub given: &'a Design,
    /// What varies.
    pub space: &'a Space,
    /// What is run.
    pub plan: Plan,
    /// The given design without quantisation.
    pub twin: Output,
    /// Its figures.
    pub whole: Figures,
    /// What is to be small.
    pub objectives: Vec<Objective>,
    threads: usize,
    trials: BTreeMap<Lengths, Trial>,
    costs: BTreeMap<Lengths, Option<Vec<Cost>>>,
    /// Lengths that somebody asked for, in this run or before it was killed.
    asked: BTreeSet<Lengths>,
    journal: Option<Journal>,
    /// How many will be asked for, and whether they may be fewer.
    expected: (usize, bool),
    /// Of those that were, so many were not known.
    new: usize,
    said: &'a (dyn Fn(Progress) + Sync),
}

impl<'a> Bench<'a> {
    /// A bench for the search.
    ///
    /// # Errors
    /// A phase loop that cannot lock.
    pub fn new(
        given: &'a Design,
        space: &'a Space,
        threads: usize,
        said: &'a (dyn Fn(Progress) + Sync),
    ) -> Result<Self> {
        let seed = given.thermal_run.seed ^ SEARCH_SEED;
        let plan = Plan::new(given, Extent::SEARCH, seed)?;
        let twin = run(given, ArithmeticKind::Float, &plan)?;
        let objectives = given.study.targets.iter();
        Ok(Bench {
            given,
            space,
            whole: whole(&plan, &twin),
            plan,
            twin,
            objectives: objectives.filter_map(|t| Objective::of_name(t)).collect(),
            threads,
            trials: BTreeMap::new(),
            costs: BTreeMap::new(),
            asked: BTreeSet::new(),
            journal: None,
            expected: (0, true),
            new: 0,
            said,
        })
    }

    /// Takes trials from a journal, and writes new ones into it.
    pub fn with_journal(mut self, journal: Journal, known: BTreeMap<Lengths, Trial>) -> Self {
        self.trials.extend(known);
        self.journal = Some(journal);
        self
    }

    /// Trials that are known from elsewhere.
    pub fn know(&mut self, known: BTreeMap<Lengths, Trial>) {
        self.trials.extend(known);
    }

    /// How many designs will be asked for, `at_most` or just so many.
    pub fn expect(&mut self, designs: usize, at_most: bool) {
        self.expected = (designs, at_most);
    }

    /// Runs those of a batch that have not run.
    ///
    /// # Errors
    /// A journal that cannot be written.
    pub fn run(&mut self, batch: &[Lengths]) -> Result<()> {
        self.asked.extend(batch.iter().cloned());
        let wanted: BTreeSet<&Lengths> = batch.iter().collect();
        let new: Vec<Lengths> = wanted
            .into_iter()
            .filter(|l| !self.trials.contains_key(*l))
            .cloned()
            .collect();
        let (known, before_batch) = (self.asked.len() - new.len(), self.new);
        // A batch is what a kill can lose.
        for part in new.chunks(64 * self.threads.max(1)) {
            let before = known + self.new - before_batch;
            let said = |done: usize| {
                (self.said)(Progress {
                    step: Step::Searching,
                    done: before + done,
                    new: self.new + done,
                    of: self.expected.0.max(self.asked.len()),
                    at_most: self.expected.1,
                });
            };
            let trials = self.trials_of(part, &said);
            self.new += part.len();
            if let Some(journal) = &mut self.journal {
                journal.append(part, &trials)?;
            }
            self.trials.extend(part.iter().cloned().zip(trials));
        }
        Ok(())
    }

    /// Designs that share their closed loop run together. `said` is told how many are done.
    fn trials_of(&self, part: &[Lengths], said: &(dyn Fn(usize) + Sync)) -> Vec<Trial> {
        let designs = in_parallel(part, self.threads, &|_| {}, |lengths| {
            let design = self.space.design(self.given, lengths).ok()?;
            Some(design.without_stops())
        });
        let alike = |a: &Option<Design>, b: &Option<Design>| match (a, b) {
            (Some(a), Some(b)) => share_a_closed_loop(&a.circuit, &b.circuit),
            _ => false,
        };
        let groups = groups(&designs, alike);
        let done = AtomicUsize::new(0);
        let trials = in_parallel(&groups, self.threads, &|_| {}, |group| {
            let members = group.iter().filter_map(|k| designs.get(*k)?.as_ref());
            let trials = self.trials_together(&members.collect::<Vec<_>>());
            said(done.fetch_add(group.len(), Ordering::Relaxed) + group.len());
            trials
        });
        let mut all = vec![None; part.len()];
        for (group, trials) in groups.iter().zip(trials) {
            for (k, trial) in group.iter().zip(trials) {
                if let Some(to) = all.get_mut(*k) {
                    *to = trial;
                }
            }
        }
        all
    }

    fn trials_together(&self, designs: &[&Design]) -> Vec<Trial> {
        match run_together(designs, ArithmeticKind::Fixed, &self.plan) {
            Ok(outputs) => {
                let figures = |output| Some(added(&self.plan, output, &self.twin));
                outputs.iter().map(figures).collect()
            }
            // Which of them it was is seen when each runs alone.
            Err(_) if designs.len() > 1 => {
                let alone = |design: &&Design| self.trials_together(&[*design]);
                designs.iter().flat_map(alone).collect()
            }
            Err(_) => vec![None],
        }
    }

    /// The figures of a design that has run.
    pub fn figures(&self, lengths: &[u32]) -> Option<&Figures> {
        self.trials.get(lengths)?.as_ref()
    }

    /// The merit of a design that has run; infinite if there is none.
    pub fn merit(&self, scale: &Scale, lengths: &[u32]) -> f64 {
        let merit = self.figures(lengths).map(|f| scale.merit(f));
        merit.filter(|m| m.is_finite()).unwrap_or(f64::INFINITY)
    }

    /// Prices those of a batch that have no price.
    pub fn price(&mut self, batch: &[Lengths]) {
        let wanted: BTreeSet<&Lengths> = batch.iter().collect();
        let new: Vec<Lengths> = wanted
            .into_iter()
            .filter(|l| !self.costs.contains_key(*l))
            .cloned()
            .collect();
        let costs = in_parallel(&new, self.threads, &|_| {}, |lengths| {
            let design = self.space.design(self.given, lengths).ok()?;
            let of = |o: &Objective| cost::of_design(&design, o.target);
            Some(self.objectives.iter().map(of).collect::<Vec<Cost>>())
        });
        self.costs.extend(new.into_iter().zip(costs));
    }

    /// What a priced design costs, by objective.
    pub fn costs(&self, lengths: &[u32]) -> Option<&[Cost]> {
        self.costs.get(lengths)?.as_deref()
    }

    /// The one number of an objective for a priced design; infinite if there is no such design.
    pub fn cost(&self, objective: usize, lengths: &[u32]) -> f64 {
        let weights = self.objectives.get(objective).map(|o| o.weights);
        let cost = self.costs(lengths).and_then(|c| c.get(objective));
        match (weights, cost) {
            (Some(weights), Some(cost)) => cost.price(&weights),
            _ => f64::INFINITY,
        }
    }

    /// Designs that have been priced.
    pub fn considered(&self) -> usize {
        self.costs
            .keys()
            .chain(&self.asked)
            .collect::<BTreeSet<_>>()
            .len()
    }

    /// Designs that the search asked to run and that can.
    pub fn simulated(&self) -> usize {
        let asked = self.asked.iter();
        asked.filter(|l| self.figures(l).is_some()).count()
    }

    /// Every design that was asked for and has run.
    pub fn all(&self) -> Vec<Lengths> {
        let asked = self.asked.iter();
        asked
            .filter(|l| self.figures(l).is_some())
            .cloned()
            .collect()
    }

    /// Threads of the bench.
    pub fn threads(&self) -> usize {
        self.threads
    }
}
