//! The search over sets: a scan beside each of the best few, level by level, then exchanges around the best.

use super::MOST_TERMS;
use super::columns::{Frame, Member, Shapes};
use super::lines;
use super::refine::refined;
use super::score::{Node, Stage, against, node, odds, price, stage};
use crate::thermal::effects::Point;
use std::sync::Arc;

/// Sets of one size that are kept (calibration on the split *tune* of the corpus is to come; 3 names what 6 does there).
const WIDTH: usize = 3;

/// Further terms that are tried beside each of them.
const TRIED: usize = 5;

/// Nats by which the best set of a size may be behind the best of all before the search stops (convention: e^-15).
const BEHIND: f64 = 15.0;

/// Most lines and events of a set.
const MOST_EVENTS: usize = 8;

/// A further term as a scan sees it.
#[derive(Clone)]
pub struct Seen {
    pub member: Member,
    /// Gain in score by the grid alone.
    pub gain: f64,
    /// The best points of its other forms, where they are less than fifteen nats (`BEHIND`) behind: their grids may be too coarse to tell.
    pub others: Vec<Point>,
}

/// What one candidate's points gain beside a stage: the best of them and its Occam factor. None where no shape is excited.
fn seen(
    frame: &Frame,
    stage: &Stage,
    node: &Node,
    shapes: &Shapes,
    white: &[Vec<Vec<f64>>],
) -> Option<Seen> {
    let (candidate, points) = (&shapes.candidate, &shapes.points);
    let known = !candidate.acts_on_bias() && !stage.holds();
    let mut all: Vec<(f64, usize)> = Vec::new();
    let priced = |k: usize| {
        odds(
            candidate.as_ref(),
            shapes.columns.get(k).map_or(1, Vec::len),
        )
    };
    for (k, point) in points.iter().enumerate() {
        let is_sized = candidate.is_sized(point);
        let l = match known {
            true => stage.with_known(&shapes.columns[k], &shapes.beyond[k], &white[k], is_sized),
            false => stage.with(
                frame,
                &frame.of(candidate.as_ref(), &node.bias, point),
                is_sized,
            ),
        };
        if let Some(l) = l.filter(|l| l.is_finite()) {
            all.push((l - against(frame, candidate.as_ref(), point) + priced(k), k));
        }
    }
    let best = *all.iter().max_by(|a, b| a.0.total_cmp(&b.0))?;
    let mean = all.iter().map(|(l, _)| (l - best.0).exp()).sum::<f64>() / points.len() as f64;
    let occam = mean.ln();
    all.sort_by(|a, b| b.0.total_cmp(&a.0));
    let mut others: Vec<Point> = Vec::new();
    for (l, k) in all {
        let is_new = |form: usize| {
            form != points[best.1].form && others.iter().all(|p: &Point| p.form != form)
        };
        if l > best.0 - BEHIND && is_new(points[k].form) {
            others.push(points[k].clone());
        }
    }
    Some(Seen {
        others,
        gain: best.0 - stage.likelihood + occam,
        member: Member {
            candidate: candidate.clone(),
            point: points[best.1].clone(),
            occam,
            evident: false,
            fixed: known.then(|| Arc::new(shapes.columns[best.1].clone())),
        },
    })
}

/// Every candidate that is not in the set, beside it at one noise; the greatest gain first.
pub fn scan(frame: &Frame, node: &Node, noise: usize) -> Vec<Seen> {
    let Some(stage) = stage(frame, &node.members, &node.bias, noise) else {
        return Vec::new();
    };
    let taken = node.ids();
    let mut out = Vec::new();
    let full = node.causes() >= MOST_TERMS;
    let events = node.members.iter().filter(|m| m.is_noise()).count();
    for (shapes, white) in frame.shapes.iter().zip(frame.white(noise)) {
        let open = match shapes.candidate.repeats() {
            true => events < MOST_EVENTS,
            false => !full && !taken.contains(&shapes.candidate.id()),
        };
        if open {
            out.extend(seen(frame, &stage, node, shapes, white));
        }
    }
    if events < MOST_EVENTS {
        let named = !taken
            .iter()
            .any(|id| id == crate::thermal::effects::tone::NAMED);
        if let Some((candidate, point, cells)) = lines::strongest(frame, &stage, named) {
            let columns = frame.of(candidate.as_ref(), &node.bias, &point);
            if let Some(l) = stage.with(frame, &columns, false) {
                // One cell of the spectrum among all.
                let occam = -cells.max(1.0).ln();
                let fixed = frame.fixed(candidate.as_ref(), &point);
                out.push(Seen {
                    others: Vec::new(),
                    gain: l - stage.likelihood + occam + odds(candidate.as_ref(), columns.len()),
                    member: Member {
                        candidate,
                        point,
                        occam,
                        evident: false,
                        fixed,
                    },
                });
            }
        }
    }
    out.sort_by(|a, b| b.gain.total_cmp(&a.gain));
    out
}

/// The set with a further term: its form and its parameters at their best, its score at its own noise.
pub fn child(frame: &Frame, parent: &Node, seen: &Seen, noise: usize) -> Option<Node> {
    let from = |point: &Point| -> Option<(Vec<Member>, f64)> {
        let mut members = parent.members.clone();
        members.push(Member {
            fixed: frame.fixed(seen.member.candidate.as_ref(), point),
            point: point.clone(),
            ..seen.member.clone()
        });
        let last = members.len() - 1;
        let (members, l) = refined(frame, &members, last, &parent.bias, noise)?;
        let price = price(&members);
        Some((members, l + price))
    };
    let points = [&seen.member.point].into_iter().chain(&seen.others);
    let (members, _) = points.filter_map(from).max_by(|a, b| a.1.total_cmp(&b.1))?;
    of(frame, members, parent)
}

/// What the data sheets have against the members' shapes.
fn sheets(frame: &Frame, members: &[Member]) -> f64 {
    members
        .iter()
        .filter(|m| !m.is_line())
        .map(|m| against(frame, m.candidate.as_ref(), &m.point))
        .sum()
}

/// The set again with every member's parameters refined in turn.
pub fn polished(frame: &Frame, from: &Node) -> Option<Node> {
    let mut now = from.clone();
    for k in 0..now.members.len() {
        if !now.members[k].evident {
            let (members, _) = refined(frame, &now.members, k, &now.bias, now.noise)?;
            now.members = members;
        }
    }
    let mut best = node(frame, now.members, &now.bias, now.noise)?;
    best.score -= sheets(frame, &best.members);
    Some(best)
}

/// The set of some members, scored.
pub fn of(frame: &Frame, members: Vec<Member>, like: &Node) -> Option<Node> {
    let mut out = node(frame, members, &like.bias, like.noise)?;
    out.score -= sheets(frame, &out.members);
    Some(out)
}

/// The sets of the next size: the best by score, one for each hypothesis.
fn next(frame: &Frame, level: &[Node], declared_noise: usize) -> Vec<Node> {
    let mut out: Vec<Node> = Vec::new();
    for parent in level {
        let mut noises = vec![parent.noise, declared_noise];
        noises.dedup();
        let mut tried: Vec<String> = Vec::new();
        for noise in noises {
            let mut all = scan(frame, parent, noise);
            all.retain(|s| !tried.contains(&s.member.candidate.id()));
            for s in all.iter().take(TRIED) {
                tried.push(s.member.candidate.id());
                let Some(made) = child(frame, parent, s, noise) else {
                    continue;
                };
                let ids = made.ids();
                match out.iter_mut().find(|n| n.ids() == ids) {
                    Some(same) if same.score < made.score => *same = made,
                    Some(_) => {}
                    None => out.push(made),
                }
            }
        }
    }
    out.sort_by(|a, b| b.score.total_cmp(&a.score));
    out
}

/// The best set, from `start` (what the record shows without a fit) on.
pub fn search(frame: &Frame, start: &Node) -> Node {
    let mut level = vec![start.clone()];
    let mut best = start.clone();
    for _ in 0..MOST_TERMS + MOST_EVENTS {
        level = next(frame, &level, start.noise);
        level.truncate(WIDTH);
        let Some(first) = level.first() else { break };
        if first.score > best.score {
            best = first.clone();
        }
        if first.score < best.score - BEHIND {
            break;
        }
    }
    settled(frame, best)
}

/// The best set among its neighbours: each member out, and whatever a scan beside the rest has in its place.
fn settled(frame: &Frame, mut best: Node) -> Node {
    for _ in 0..MOST_TERMS {
        let mut better = polished(frame, &best).filter(|p| p.score > best.score);
        for k in 0..best.members.len() {
            if best.members[k].evident {
                continue;
            }
            for made in around(frame, &best, k).into_iter().take(2) {
                if made.score > better.as_ref().map_or(best.score, |b| b.score) {
                    better = Some(made);
                }
            }
        }
        match better {
            Some(b) if b.score > best.score + 1e-3 => best = b,
            _ => break,
        }
    }
    best
}

/// The set without member `k`, and with the likeliest others in its place, as the last member; best first.
pub fn around(frame: &Frame, set: &Node, k: usize) -> Vec<Node> {
    let mut members = set.members.clone();
    let gone = members.remove(k);
    let Some(without) = of(frame, members, set) else {
        return Vec::new();
    };
    let mut out = Vec::new();
    for noise in [set.noise, without.noise] {
        for s in scan(frame, &without, noise).iter().take(TRIED) {
            let id = s.member.candidate.id();
            let is_in = |n: &Node| n.members.last().is_some_and(|m| m.candidate.id() == id);
            if id != gone.candidate.id() && !out.iter().any(is_in) {
                out.extend(child(frame, &without, s, noise));
            }
        }
        if set.noise == without.noise {
            break;
        }
    }
    out.push(without);
    out.sort_by(|a, b| b.score.total_cmp(&a.score));
    out
}
