//! The cheapest designs for each merit, by real runs.
//!
//! 1. One-word sweeps: every variable over its range, all others as given.
//! 2. From the sums that these make (`Additive`): a ladder of designs from the cheapest to the finest, the
//!    shortest-length corner at its one end. All of them run.
//! 3. Bit removal and exchange: from every point of the front found so far one and two bits less or more of a word,
//!    and pairs of such moves. A move runs unless the sums say that it is far from the front. Again and again, until no front
//!    changes.
//! 4. As long as there are runs left, wider: moves also from points that are so far behind the front, and moves that the
//!    sums put so far behind it. Errors are no function that falls with the length, and the sums miss what cancels.
//!
//! Every step is a batch whose content follows from results alone, so that the number of threads does not matter.

use super::additive::Additive;
use super::bench::Bench;
use super::front::{Point, front};
use super::merit::Scale;
use super::space::Lengths;
use crate::error::Result;
use std::collections::{BTreeMap, BTreeSet};

/// How far a search goes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Effort {
    /// Designs of the ladder for each objective.
    pub ladder: usize,
    /// Runs at most.
    pub runs: usize,
    /// A move runs if its predicted merit is at most so many times the front's at its cost.
    pub slack: f64,
    /// Runs in a round at most.
    pub round: usize,
}

impl Effort {
    /// Of a study.
    pub const STUDY: Effort = Effort {
        ladder: 72,
        runs: 6500,
        slack: 1.15,
        round: 400,
    };
}

/// So much farther behind the front the search looks in each step when nothing nearer is left (convention).
const WIDER: f64 = 1.3;

/// As far as it looks (convention; found to be enough on the spaces of `tests/all/study_spaces.rs`).
const WIDEST: f64 = 8.0;

/// Points with a larger merit than this, and than the given design's, are of no use to anybody.
pub const WORST_MERIT: f64 = 10.0;

/// A smaller merit counts as this: a twentieth of every limit is fine enough for anybody.
pub const FINEST_MERIT: f64 = 0.05;

/// Every variable over its range, the rest as given.
pub fn sweeps(bench: &Bench) -> Vec<Lengths> {
    let given = bench.space.given();
    let mut batch = vec![given.clone()];
    for (k, v) in bench.space.variables.iter().enumerate() {
        for length in v.low..=v.high {
            let mut lengths = given.clone();
            lengths[k] = length;
            batch.push(lengths);
        }
    }
    batch
}

/// The fronts by objective.
///
/// # Errors
/// A journal that cannot be written.
pub fn search(bench: &mut Bench, scale: &Scale, effort: Effort) -> Result<Vec<Vec<Point>>> {
    let swept = sweeps(bench);
    bench.expect(effort.runs, true);
    bench.run(&swept)?;
    bench.price(&swept);
    let given = bench.space.given();
    let worst = worst_merit(bench, scale);
    let sums = Additive::new(bench, scale);
    for objective in 0..bench.objectives.len() {
        let unit = bench.cost(objective, &given);
        let ladder = sums.ladder(objective, effort.ladder, unit);
        bench.run(&ladder)?;
        bench.price(&ladder);
    }
    let mut tried: BTreeSet<Lengths> = bench.all().into_iter().collect();
    let mut wider = 1.0;
    loop {
        let fronts = fronts(bench, scale, worst);
        let mut wanted: BTreeMap<Lengths, f64> = BTreeMap::new();
        for (objective, points) in fronts.iter().enumerate() {
            for point in &near(bench, scale, objective, points, wider) {
                promising(
                    bench,
                    &sums,
                    objective,
                    points,
                    point,
                    [effort.slack * wider, 0.999 * wider],
                    &mut |l, gain| {
                        if !tried.contains(&l) {
                            let best = wanted.entry(l).or_insert(gain);
                            *best = best.min(gain);
                        }
                    },
                );
            }
        }
        let left = effort.runs.saturating_sub(tried.len()).min(effort.round);
        if wanted.is_empty() && left > 0 && wider < WIDEST {
            wider *= WIDER;
            continue;
        }
        let mut batch: Vec<(f64, Lengths)> = wanted.into_iter().map(|(l, g)| (g, l)).collect();
        batch.sort_by(|a, b| a.0.total_cmp(&b.0).then_with(|| a.1.cmp(&b.1)));
        let batch: Vec<Lengths> = batch.into_iter().take(left).map(|(_, l)| l).collect();
        if batch.is_empty() {
            return Ok(fronts);
        }
        tried.extend(batch.iter().cloned());
        bench.run(&batch)?;
        let good: Vec<Lengths> = batch
            .into_iter()
            .filter(|l| bench.merit(scale, l) <= worst)
            .collect();
        bench.price(&good);
    }
}

/// Every design of the space.
///
/// # Errors
/// A journal that cannot be written.
pub fn exhaust(bench: &mut Bench, scale: &Scale) -> Result<Vec<Vec<Point>>> {
    let mut all: Vec<Lengths> = (0..bench.space.size())
        .map(|k| bench.space.nth(k))
        .collect();
    // The one-word sweeps are shown, and the given design may be outside the ranges.
    all.extend(sweeps(bench));
    all.sort();
    all.dedup();
    bench.expect(all.len(), false);
    bench.run(&all)?;
    let worst = worst_merit(bench, scale);
    let good: Vec<Lengths> = all
        .into_iter()
        .filter(|l| bench.merit(scale, l) <= worst)
        .collect();
    bench.price(&good);
    bench.price(&sweeps(bench));
    Ok(fronts(bench, scale, worst))
}

/// Above this a point does not count.
pub fn worst_merit(bench: &Bench, scale: &Scale) -> f64 {
    let given = bench.merit(scale, &bench.space.given());
    if given.is_finite() {
        WORST_MERIT.max(given)
    } else {
        WORST_MERIT
    }
}

/// The fronts of all that has run, by objective.
pub fn fronts(bench: &Bench, scale: &Scale, worst: f64) -> Vec<Vec<Point>> {
    let all = bench.all();
    let given = bench.space.given();
    let inside = |l: &&Lengths| bench.space.contains(l) || **l == given;
    let of = |objective: usize| {
        let points = all.iter().filter(inside).map(|lengths| Point {
            lengths: lengths.clone(),
            cost: bench.cost(objective, lengths),
            merit: bench.merit(scale, lengths).max(FINEST_MERIT),
        });
        front(points.collect(), &given, worst)
    };
    (0..bench.objectives.len()).map(of).collect()
}

/// The points of a front, and with `wider` above 1 those that are at most so many times its merit behind it.
fn near(bench: &Bench, scale: &Scale, objective: usize, front: &[Point], wider: f64) -> Vec<Point> {
    if wider <= 1.0 {
        return front.to_vec();
    }
    let all = bench.all().into_iter().filter(|l| bench.space.contains(l));
    let points = all.map(|lengths| Point {
        cost: bench.cost(objective, &lengths),
        merit: bench.merit(scale, &lengths).max(FINEST_MERIT),
        lengths,
    });
    let is_near = |p: &Point| p.cost.is_finite() && p.merit <= wider * merit_at(front, p.cost);
    points.filter(is_near).collect()
}

/// A front's merit at a cost.
fn merit_at(front: &[Point], cost: f64) -> f64 {
    let behind = front.partition_point(|p| p.cost <= cost);
    let best = behind.checked_sub(1).and_then(|k| front.get(k));
    best.map_or(WORST_MERIT, |p| p.merit)
}

/// Moves from a point that may be on the front, each with its predicted merit over the front's at its cost. `limits` of
/// that for what costs less and for what costs more.
fn promising(
    bench: &Bench,
    sums: &Additive,
    objective: usize,
    front: &[Point],
    point: &Point,
    limits: [f64; 2],
    found: &mut dyn FnMut(Lengths, f64),
) {
    let Some(figures) = bench.figures(&point.lengths) else {
        return;
    };
    let mut offer = |lengths: Lengths| {
        let from = (&point.lengths[..], figures);
        let Some((merit, cost)) = sums.moved(from, point.cost, objective, &lengths) else {
            return;
        };
        let cost = if bench.costs(&lengths).is_some() {
            bench.cost(objective, &lengths)
        } else {
            cost
        };
        let gain = merit.max(FINEST_MERIT) / merit_at(front, cost);
        // What costs more has to be better; what costs less may be a little worse than is known for that.
        let limit = if cost < point.cost {
            limits[0]
        } else {
            limits[1]
        };
        if gain <= limit {
            found(lengths, gain);
        }
    };
    let count = bench.space.variables.len();
    let moved = |l: &[u32], k: usize, by: i32| bench.space.moved(l, k, by);
    for i in 0..count {
        for by in [-2, -1, 1, 2] {
            let Some(one) = moved(&point.lengths, i, by) else {
                continue;
            };
            for j in i + 1..count {
                for other in [-1, 1] {
                    if let Some(two) = moved(&one, j, other) {
                        offer(two);
                    }
                }
            }
            offer(one);
        }
    }
}
