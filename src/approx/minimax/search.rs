//! Coefficients chosen with the evaluation that will run in the loop.
//!
//! The best coefficients for real arithmetic need not be the best for a datapath that rounds after every
//! step: its rounding errors are fixed functions of the coefficients, and among the many integer
//! polynomials near the optimum some have favourable ones. So the candidates of the lattice
//! ([`super::coefficients`]), in order of their ideal error, are run through the bit-accurate datapath, and the
//! best of them are improved by steps of their coefficients and along short lattice vectors.
//!
//! If E(c) is the ideal error over the codes, T(c) the whole one and B a bound of what rounding adds, then
//! T(c) >= E(c) - B: once every c with E(c) <= T_best + B has been looked at, T_best is the optimum. These are
//! often too many; what the output's codes allow ([`super::proof`]) leaves few.

use super::coefficients::{Best, Budget, Enumeration};
use super::problem::{Candidate, Problem};
use super::proof::{self, SLABS_EACH, Slabs};
use crate::error::Result;
use std::collections::HashSet;

/// The fixed-point evaluation of a polynomial over all its input codes. Errors are in the problem's own
/// weight.
pub trait Datapath {
    /// Largest error of the result over all codes; None as soon as it is known to exceed `limit`,
    /// and for coefficients that the datapath cannot take.
    fn max_error(&self, raw: &[i128], limit: f64) -> Option<f64>;

    /// The same over a small subset of the codes (those where earlier candidates were worst, first).
    fn sample_error(&self, raw: &[i128], limit: f64) -> Option<f64>;

    /// Bound of |datapath - polynomial in real arithmetic| over all codes, output rounding included.
    fn evaluation_bound(&self, raw: &[i128]) -> f64;

    /// About `count` slabs of the polynomials whose total error is at most `limit`, given that the
    /// evaluation without the output's rounding adds at most what it adds to `raw`, and a twentieth. By default nothing
    /// is known.
    fn slabs(&self, _raw: &[i128], _limit: f64, _count: usize) -> Slabs {
        Slabs::Some(Vec::new())
    }
}

/// How much may be spent. Steps, not seconds: the same result on every machine.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Effort {
    /// Lattice points that are run through the datapath.
    pub candidates: usize,
    /// Calls of [`Datapath::sample_error`] before no further round of the proof is begun.
    pub evaluations: u64,
    /// Of each enumeration.
    pub budget: Budget,
    /// Pairs of lattice vectors are steps too, more choices are starting points, and the local search starts again
    /// from what it found.
    pub thorough: bool,
}

impl Default for Effort {
    fn default() -> Self {
        Effort {
            candidates: 6000,
            evaluations: 8_000,
            budget: Budget { nodes: 1_000_000 },
            thorough: true,
        }
    }
}

/// One choice of coefficients with both errors.
#[derive(Debug, Clone, PartialEq)]
pub struct Judged {
    /// How it was found.
    pub name: &'static str,
    /// One a monomial, ascending exponents.
    pub raw: Vec<i128>,
    /// Largest error in real arithmetic.
    pub ideal_error: f64,
    /// Largest error of the datapath over all codes; infinite if the datapath cannot take them.
    pub total_error: f64,
}

/// The result of a search.
#[derive(Debug, Clone, PartialEq)]
pub struct Found {
    /// One a monomial, ascending exponents.
    pub raw: Vec<i128>,
    /// Their values.
    pub values: Vec<f64>,
    /// Largest error in real arithmetic.
    pub ideal_error: f64,
    /// Largest error of the datapath over all codes.
    pub total_error: f64,
    /// True if no coefficients in these formats can have a total error below [`Found::least`], given that
    /// [`Datapath::evaluation_bound`] is nowhere above the largest value met.
    /// Needs a problem on codes ([`super::Samples::on_codes`]).
    pub proved: bool,
    /// The least total error that was met.
    pub least: f64,
    /// The coefficients that were met with a total error within [`NEAR`] of the least, with it.
    pub near: Vec<(Candidate, f64)>,
    /// The lattice points that were run, by their ideal error over the problem's points.
    pub listed: Vec<Candidate>,
    /// Every choice with an ideal error below this was looked at.
    pub complete_below: f64,
    /// Coefficients looked at, by the sample at least.
    pub evaluations: u64,
    /// "rounded" (minimax coefficients), "babai" (the lattice heuristic), "ideal" (optimum in
    /// real arithmetic), in this order.
    pub baselines: Vec<Judged>,
    /// The optimum in real arithmetic.
    pub best: Best,
}

/// Total errors within this part of the smallest count as equal; then the ideal error decides.
pub const NEAR: f64 = 0.005;
/// Total errors within this part of the smallest make a starting point of a thorough search.
const START_NEAR: f64 = 0.02;
/// Starting points of the local search.
const STARTS: usize = 24;
/// Rounds of the proof, each with the least total error that the one before it found.
const PROOF_ROUNDS: usize = 6;
/// Choices in the slabs that are run.
const MOST_IN_SLABS: usize = 4000;
/// What is less than the least total error.
const STRICTLY: f64 = 1.0 - 1e-9;
/// Choices near the least total error that are kept whatever their ideal error.
const MOST_NEAR: usize = 64;

/// Searches the coefficients whose whole evaluation has the smallest largest error.
///
/// Errors: as [`Problem::best`]; if the datapath can take none of the coefficients met, the total error of the
/// result is infinite.
pub fn search(problem: &Problem, datapath: &dyn Datapath, effort: Effort) -> Result<Found> {
    let best = problem.best(effort.budget)?;
    search_from(problem, best, datapath, effort)
}

/// The same from ideal coefficients that are known, such as those for the whole interval instead of its codes.
///
/// # Errors
/// As [`search`].
pub fn search_from(
    problem: &Problem,
    best: Best,
    datapath: &dyn Datapath,
    effort: Effort,
) -> Result<Found> {
    let mut run = Run::new(problem, datapath, effort);
    let ideal = Candidate {
        raw: best.raw.clone(),
        error: best.error,
        rms: 0.0,
    };
    let mut baselines = Vec::new();
    for (name, candidate) in [
        ("rounded", &best.rounded),
        ("babai", &best.babai),
        ("ideal", &ideal),
    ] {
        baselines.push(Judged {
            name,
            raw: candidate.raw.clone(),
            ideal_error: candidate.error,
            total_error: run.judge_in_full(candidate),
        });
    }
    let listed = candidates(&run, &best, effort)?;
    let mut all = true;
    for candidate in &listed.candidates {
        all &= run.judge(candidate);
    }
    let steps = steps(problem, &best, effort.thorough);
    loop {
        let before = run.total;
        for start in run.pool(STARTS) {
            run.walk(start, &steps);
        }
        if !effort.thorough || run.total >= before {
            break;
        }
    }
    let needed = run.total + run.largest_bound;
    let complete = all && !problem.samples.is_continuous() && listed.complete_below >= needed;
    let proved = complete || !problem.samples.is_continuous() && run.prove(effort.budget);
    let chosen = run.chosen(&baselines).unwrap_or((ideal, f64::INFINITY));
    Ok(Found {
        values: problem
            .values(&chosen.0.raw)
            .iter()
            .map(|v| v.to_f64())
            .collect(),
        ideal_error: problem.exact_error(&chosen.0.raw).max(chosen.0.error),
        raw: chosen.0.raw,
        total_error: chosen.1,
        proved,
        least: run.total,
        near: run.near.clone(),
        listed: listed.candidates,
        complete_below: if all { listed.complete_below } else { 0.0 },
        evaluations: run.evaluations,
        baselines,
        best,
    })
}

/// Lattice points up to the ideal error beyond which none can win, or as many as may be tried. The limit
/// grows in steps, for a large ball holds far more points than are wanted.
fn candidates(run: &Run, best: &Best, effort: Effort) -> Result<Enumeration> {
    // A little more, for the bound may grow with the coefficients to come.
    let most = (run.total + run.largest_bound) * (1.0 + NEAR);
    let most = if most.is_finite() {
        most
    } else {
        2.0 * best.error
    };
    let mut limit = 1.2 * best.error.max(f64::MIN_POSITIVE);
    loop {
        let at = limit.min(most.max(best.error));
        let listed = run
            .problem
            .enumerate(at, effort.candidates, effort.budget)?;
        let enough = listed.candidates.len() >= effort.candidates;
        if enough || at >= most || listed.complete_below == 0.0 {
            return Ok(listed);
        }
        limit *= 1.3;
    }
}

/// Steps of the local search: one and two units of a coefficient, pairs of units, short lattice vectors.
fn steps(problem: &Problem, best: &Best, pairs: bool) -> Vec<Vec<i128>> {
    let n = problem.formats.len();
    let mut steps: Vec<Vec<i128>> = Vec::new();
    let unit = |pairs: &[(usize, i64)]| {
        let mut step = vec![0; n];
        for &(k, by) in pairs {
            step[k] += i128::from(by);
        }
        step
    };
    for k in 0..n {
        for by in [1, -1, 2, -2] {
            steps.push(unit(&[(k, by)]));
        }
    }
    let lattice = problem
        .frame(&best.raw, best.error, None)
        .map(|f| f.transform);
    let lattice = lattice.unwrap_or_default();
    for vector in &lattice {
        steps.push(vector.iter().map(|v| v.saturating_neg()).collect());
        steps.push(vector.clone());
    }
    // Two of them at once: along a plateau of the ideal error (a value at an end that no coefficients better) the way to a
    // smaller total error is seldom one vector.
    for (k, first) in lattice.iter().enumerate().filter(|_| pairs) {
        for second in lattice.iter().skip(k + 1) {
            for (a, b) in [(1, 1), (1, -1), (-1, 1), (-1, -1)] {
                let both = first.iter().zip(second);
                let sum =
                    both.map(|(x, y)| x.saturating_mul(a).saturating_add(y.saturating_mul(b)));
                steps.push(sum.collect());
            }
        }
    }
    for pairs in super::coefficients::moves(n) {
        if pairs.len() == 2 {
            steps.push(unit(&pairs));
        }
    }
    steps
}

struct Run<'p> {
    problem: &'p Problem<'p, 'p>,
    datapath: &'p dyn Datapath,
    most_evaluations: u64,
    evaluations: u64,
    /// Least total error so far.
    total: f64,
    largest_bound: f64,
    /// All with a total error near the least one, with it.
    near: Vec<(Candidate, f64)>,
    /// Those from which the local search may start.
    starts: Vec<(Candidate, f64)>,
    start_near: f64,
    seen: HashSet<Vec<i128>>,
}

impl<'p> Run<'p> {
    fn new(problem: &'p Problem, datapath: &'p dyn Datapath, effort: Effort) -> Self {
        Run {
            problem,
            datapath,
            most_evaluations: effort.evaluations,
            evaluations: 0,
            total: f64::INFINITY,
            largest_bound: 0.0,
            near: Vec::new(),
            starts: Vec::new(),
            start_near: if effort.thorough { START_NEAR } else { NEAR },
            seen: HashSet::new(),
        }
    }

    /// The total error whatever it is.
    fn judge_in_full(&mut self, candidate: &Candidate) -> f64 {
        let total = self.datapath.max_error(&candidate.raw, f64::INFINITY);
        let total = total.unwrap_or(f64::INFINITY);
        let bound = self.datapath.evaluation_bound(&candidate.raw);
        self.largest_bound = self.largest_bound.max(bound);
        self.evaluations += 1;
        if self.seen.insert(candidate.raw.clone()) && total.is_finite() {
            self.note(candidate, total);
        }
        total
    }

    /// Looks at a candidate; false if the budget is spent.
    fn judge(&mut self, candidate: &Candidate) -> bool {
        if self.evaluations >= self.most_evaluations {
            return false;
        }
        if !self.seen.insert(candidate.raw.clone()) {
            return true;
        }
        let bound = self.datapath.evaluation_bound(&candidate.raw);
        self.largest_bound = self.largest_bound.max(bound);
        // A total error that is only near the least one helps if the ideal error is smaller.
        let least = self
            .near
            .iter()
            .fold(f64::INFINITY, |m, (c, _)| m.min(c.error));
        let wanted = candidate.error < least || self.near.len() < MOST_NEAR;
        let part = if wanted { NEAR } else { -1e-12 };
        let few = self.start_near > NEAR && self.starts.len() < STARTS;
        let part = if few { self.start_near } else { part };
        let limit = self.total * (1.0 + part);
        if candidate.error > limit + bound {
            return true; // its total error cannot be near the least one
        }
        self.evaluations += 1;
        let total = self
            .datapath
            .sample_error(&candidate.raw, limit)
            .and_then(|_| self.datapath.max_error(&candidate.raw, limit));
        if let Some(total) = total.filter(|&t| t <= limit) {
            self.note(candidate, total);
        }
        true
    }

    fn note(&mut self, candidate: &Candidate, total: f64) {
        self.total = self.total.min(total);
        self.near.push((candidate.clone(), total));
        let limit = self.total * (1.0 + NEAR);
        self.near.retain(|(_, t)| *t <= limit);
        self.starts.push((candidate.clone(), total));
        let limit = self.total * (1.0 + self.start_near);
        self.starts.retain(|(_, t)| *t <= limit);
    }

    /// The best ones, by total error.
    fn pool(&self, most: usize) -> Vec<Candidate> {
        let mut pool = self.starts.clone();
        pool.sort_by(|a, b| {
            let by_error = a.1.total_cmp(&b.1).then(a.0.error.total_cmp(&b.0.error));
            by_error.then_with(|| a.0.raw.cmp(&b.0.raw))
        });
        pool.truncate(most);
        pool.into_iter().map(|(c, _)| c).collect()
    }

    /// Steps from `start` while the least total error falls.
    fn walk(&mut self, start: Candidate, steps: &[Vec<i128>]) {
        let mut here = start;
        loop {
            let before = self.total;
            for step in steps {
                let raw: Vec<i128> = here
                    .raw
                    .iter()
                    .zip(step)
                    .map(|(r, s)| r.saturating_add(*s))
                    .collect();
                if !self.problem.admits(&raw) || self.seen.contains(&raw) {
                    continue;
                }
                let candidate = self.problem.candidate(raw);
                if !self.judge(&candidate) {
                    return;
                }
            }
            match self.pool(1).pop() {
                Some(next) if self.total < before => here = next,
                _ => return,
            }
        }
    }

    /// True if what the output's codes allow leaves nothing better, which is then known to be all.
    fn prove(&mut self, budget: Budget) -> bool {
        let most = self.most_evaluations;
        for _ in 0..PROOF_ROUNDS {
            if self.evaluations > most {
                return false;
            }
            let before = self.total;
            let Some(widest) = self.near.first().map(|(c, _)| c.raw.clone()) else {
                return false;
            };
            let count = SLABS_EACH * self.problem.formats.len();
            let slabs = match self.datapath.slabs(&widest, before * STRICTLY, count) {
                Slabs::Impossible => return true,
                Slabs::Some(slabs) => slabs,
            };
            let Some((found, all)) = proof::within(self.problem, slabs, MOST_IN_SLABS, budget)
            else {
                return false;
            };
            self.most_evaluations = self.evaluations + found.len() as u64;
            for candidate in found {
                let candidate = self.problem.candidate(candidate.raw);
                self.judge(&candidate);
            }
            if all {
                return true;
            }
            if self.total >= before {
                return false;
            }
        }
        false
    }

    /// Of those near the least total error the one with the least ideal error; but not one that loses
    /// to a baseline which the least total error beats.
    fn chosen(&self, baselines: &[Judged]) -> Option<(Candidate, f64)> {
        let to_beat = baselines
            .iter()
            .fold(f64::INFINITY, |m, b| m.min(b.total_error));
        self.near
            .iter()
            .filter(|(_, t)| *t < to_beat || *t <= self.total)
            .min_by(|a, b| {
                let by_error = a.0.error.total_cmp(&b.0.error).then(a.1.total_cmp(&b.1));
                by_error.then_with(|| a.0.raw.cmp(&b.0.raw))
            })
            .cloned()
    }
}

#[cfg(test)]
#[path = "search_tests.rs"]
mod tests;
