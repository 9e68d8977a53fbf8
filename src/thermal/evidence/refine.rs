//! A term's parameters beside the others, from the best point of its grid.

use super::columns::{Frame, Member};
use super::score::{against, at_noise};
use crate::thermal::effects::{Bias, Point};

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
    let mut best = members.to_vec();
    let value = |members: &[Member]| {
        let m = &members[k];
        let l = at_noise(frame, members, bias, noise)?.0;
        Some(l - against(frame, m.candidate.as_ref(), &m.point))
    };
    let mut top = value(&best)?;
    let with = |members: &[Member], point: Point| {
        let mut out = members.to_vec();
        out[k].fixed = frame.fixed(out[k].candidate.as_ref(), &point);
        out[k].point = point;
        out
    };
    let candidate = best[k].candidate.clone();
    let mut steps = candidate.spacing(frame.channels, &best[k].point);
    steps.iter_mut().for_each(|s| *s *= 0.5);
    for _ in 0..HALVINGS {
        for j in 0..best[k].point.theta.len() {
            for sign in [1.0, -1.0] {
                let mut point = best[k].point.clone();
                point.theta[j] += sign * steps.get(j).copied().unwrap_or(0.1);
                let tried = with(&best, point);
                if let Some(l) = value(&tried).filter(|l| *l > top) {
                    (best, top) = (tried, l);
                    break;
                }
            }
        }
        steps.iter_mut().for_each(|s| *s *= 0.5);
    }
    let (along, others) = candidate.stairs(frame.channels, &best[k].point);
    let beside = candidate.beside(frame.channels, &best[k].point);
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
        let tried = with(&best, point);
        if let Some(l) = value(&tried).filter(|l| *l > top) {
            (best, top) = (tried, l);
        }
    }
    Some((best, top))
}
