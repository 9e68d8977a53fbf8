//! Thresholds: their likelihood is a staircase, flat between readings.

use super::judge::PRICE;
use crate::closure::channels::Channels;
use crate::closure::effects::{Candidate, Point};

/// Gain within which points are as good as the best.
const FLAT: f64 = 0.2;

/// Turns over all thresholds.
const TURNS: usize = 3;

/// A point near `top`, with each threshold in the middle of the stair that gains most: it may lie anywhere
/// between two readings that were fitted, and the middle errs least on those that were not. Where
/// a candidate has no stairs: the middle of the plateau of `fine` around `top`.
pub fn settled(
    candidate: &dyn Candidate,
    c: &Channels,
    top: &Point,
    fine: &[(Point, f64)],
    gain: impl Fn(&Point) -> f64,
) -> Point {
    let (axes, others) = candidate.stairs(c, top);
    if axes.is_empty() {
        return middle(top, fine, gain);
    }
    let (mut best, mut reached) = climbed(candidate, c, top, &gain);
    for other in others {
        let (point, there) = climbed(candidate, c, &other, &gain);
        // What needs a parameter less may gain less.
        let more = best.theta.len() as f64 - point.theta.len() as f64;
        if there + PRICE * more > reached {
            (best, reached) = (point, there);
        }
    }
    best
}

/// Along each threshold in turn to the middle of its highest stair, and the gain there.
fn climbed(
    candidate: &dyn Candidate,
    c: &Channels,
    start: &Point,
    gain: &impl Fn(&Point) -> f64,
) -> (Point, f64) {
    let mut best = start.clone();
    let mut reached = gain(&best);
    for _ in 0..TURNS {
        let before = best.clone();
        let axes = candidate.stairs(c, &best).0.len();
        for axis in 0..axes {
            let (stairs, _) = candidate.stairs(c, &best);
            let Some(along) = stairs.into_iter().nth(axis) else {
                continue;
            };
            let gains: Vec<f64> = along.iter().map(gain).collect();
            let highest = (0..gains.len()).max_by(|a, b| gains[*a].total_cmp(&gains[*b]));
            let Some(top) = highest.filter(|k| gains[*k] > reached - FLAT) else {
                continue;
            };
            let level = |k: &usize| gains[*k] > gains[top] - FLAT;
            let first = (0..=top).rev().take_while(level).last().unwrap_or(top);
            let last = (top..gains.len()).take_while(level).last().unwrap_or(top);
            let mut point = along[first].clone();
            for (theta, end) in point.theta.iter_mut().zip(&along[last].theta) {
                *theta = 0.5 * (*theta + end);
            }
            let there = gain(&point);
            if there > reached - FLAT {
                (best, reached) = (point, there);
            }
        }
        if best == before {
            break;
        }
    }
    (best, reached)
}

/// The middle of the plateau of `fine` around a top.
fn middle(top: &Point, fine: &[(Point, f64)], gain: impl Fn(&Point) -> f64) -> Point {
    let reached = gain(top);
    let level: Vec<&Point> = fine
        .iter()
        .filter(|(p, there)| p.form == top.form && *there > reached - FLAT)
        .map(|(p, _)| p)
        .collect();
    if level.is_empty() {
        return top.clone();
    }
    let mut out = top.clone();
    for (k, theta) in out.theta.iter_mut().enumerate() {
        *theta = level.iter().map(|p| p.theta[k]).sum::<f64>() / level.len() as f64;
    }
    if gain(&out) > reached - FLAT {
        out
    } else {
        top.clone()
    }
}
