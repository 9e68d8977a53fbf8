//! A term's parameters beside the others, from the best point of its grid.

use super::columns::{Frame, Member};
use super::score::{against, at_noise, stage};
use crate::thermal::effects::{Bias, Candidate, Point};

/// Times that the distance of two points is halved: to a fiftieth of the grid's, finer than the deviation of a parameter with t of 25.
const HALVINGS: usize = 6;

/// Most points of a threshold's staircase that are looked at around the present one.
const STAIRS: usize = 24;

/// The members with the parameters of member `k` where their likelihood, less what its data sheet has against them, is greatest;
/// with that likelihood. Downhill along each parameter in turn, then along the staircases of thresholds and
/// the shapes that are asked only where the name is in.
pub fn refined(
    frame: &Frame,
    members: &[Member],
    k: usize,
    bias: &Bias,
    noise: usize,
) -> Option<(Vec<Member>, f64)> {
    let with = |point: &Point| {
        let mut out = members.to_vec();
        out[k].fixed = frame.fixed(out[k].candidate.as_ref(), point);
        out[k].point = point.clone();
        out
    };
    let candidate = &members[k].candidate;
    let against = |point: &Point| against(frame, candidate.as_ref(), point);
    let whole =
        |point: &Point| Some(at_noise(frame, &with(point), bias, noise)?.0 - against(point));
    let start = &members[k].point;
    if !members.iter().any(|m| m.candidate.acts_on_bias()) {
        // What the others leave does not depend on this one: Schur complements.
        let mut others = members.to_vec();
        others.remove(k);
        let beside = stage(frame, &others, bias, noise)?;
        let part = |point: &Point| {
            let columns = frame.of(candidate.as_ref(), bias, point);
            Some(beside.with(frame, &columns, candidate.is_sized(point))? - against(point))
        };
        let (point, _) = greatest(frame, candidate.as_ref(), start, part)?;
        // Physics may exclude its coefficients; then each step has to be admitted.
        if let Some(l) = whole(&point) {
            return Some((with(&point), l));
        }
    }
    let (point, l) = greatest(frame, candidate.as_ref(), start, whole)?;
    Some((with(&point), l))
}

/// The point of a candidate at which `value` is greatest, from a start.
fn greatest(
    frame: &Frame,
    candidate: &dyn Candidate,
    start: &Point,
    value: impl Fn(&Point) -> Option<f64>,
) -> Option<(Point, f64)> {
    let mut best = start.clone();
    let mut top = value(&best)?;
    let mut steps = candidate.spacing(frame.channels, &best);
    steps.iter_mut().for_each(|s| *s *= 0.5);
    for _ in 0..HALVINGS {
        for j in 0..best.theta.len() {
            for sign in [1.0, -1.0] {
                let mut point = best.clone();
                point.theta[j] += sign * steps.get(j).copied().unwrap_or(0.1);
                if let Some(l) = value(&point).filter(|l| *l > top) {
                    (best, top) = (point, l);
                    break;
                }
            }
        }
        steps.iter_mut().for_each(|s| *s *= 0.5);
    }
    let (along, others) = candidate.stairs(frame.channels, &best);
    let beside = candidate.beside(frame.channels, &best);
    let thin = |list: Vec<Point>| {
        let every = list.len().div_ceil(STAIRS).max(1);
        list.into_iter().step_by(every)
    };
    let all = along
        .into_iter()
        .flat_map(thin)
        .chain(others.into_iter().take(STAIRS))
        .chain(beside);
    for point in all {
        if let Some(l) = value(&point).filter(|l| *l > top) {
            (best, top) = (point, l);
        }
    }
    Some((best, top))
}
