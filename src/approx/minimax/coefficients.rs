//! The best integer coefficients under ideal evaluation, with a proof where the budget allows.
//!
//! Rounding each minimax coefficient loses up to orders of magnitude where the coefficients are short; the
//! closest-vector view is N. Brisebarre, S. Chevillard, "Efficient polynomial L-infinity approximations", ARITH 18
//! (2007); bounding the optimum's coefficients and searching them all is N. Brisebarre, J.-M. Muller,
//! A. Tisserand, "Computing machine-efficient polynomial approximations", ACM TOMS 32 (2006). Here: a start by
//! Babai's nearest plane and descent, then every lattice point of an ellipsoid that must contain the optimum
//! (`ellipsoid`, `cuts`), by Schnorr and Euchner's enumeration. Few points are left, for the
//! ellipsoid is nearly the smallest one, so that polynomials of ten coefficients take milliseconds.

use super::cuts::Cuts;
use super::problem::{self, Candidate, Frame, Problem};
use crate::error::{InputError, Result};
use std::cell::Cell;

/// How much may be spent. Steps, not seconds: the same result on every machine.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Budget {
    /// Nodes of the enumeration, a point within the limit counting as 50; some 10 million take a second.
    pub nodes: u64,
}

impl Default for Budget {
    fn default() -> Self {
        Budget { nodes: 4_000_000 }
    }
}

/// The best coefficients found.
#[derive(Debug, Clone, PartialEq)]
pub struct Best {
    /// One a monomial, ascending exponents.
    pub raw: Vec<i128>,
    /// Their values.
    pub values: Vec<f64>,
    /// Largest weighted error of the polynomial in real arithmetic.
    pub error: f64,
    /// No coefficients in these formats have a smaller error (to 1e-9 of it).
    pub lower_bound: f64,
    /// True if the enumeration was complete, or `error` cannot be less ([`Problem::lattice_bound`], the
    /// real minimax error): `error` is `lower_bound`. Never where the points miss a kink.
    pub proved: bool,
    /// Nodes visited.
    pub nodes: u64,
    /// The real minimax error: what infinitely long coefficients would reach.
    pub minimax_error: f64,
    /// Each minimax coefficient rounded to nearest.
    pub rounded: Candidate,
    /// Babai's nearest plane on the reduced lattice, as in Brisebarre and Chevillard's method.
    pub babai: Candidate,
}

/// Coefficients in order of their ideal error.
#[derive(Debug, Clone, PartialEq)]
pub struct Enumeration {
    /// Best first.
    pub candidates: Vec<Candidate>,
    /// Every choice of coefficients whose error is below this is among them; 0 if the budget was
    /// spent before that was known of any.
    pub complete_below: f64,
    /// Nodes visited.
    pub nodes: u64,
}

/// What a point whose error is looked at everywhere costs, in nodes.
const LEAF_COST: u64 = 50;

/// Slack of comparisons between rounded sums, relative.
const SLACK: f64 = 1e-9;

impl Problem<'_, '_> {
    /// The coefficients with the smallest largest error.
    ///
    /// Errors: monomials that 106 bits do not tell apart on the interval.
    pub fn best(&self, budget: Budget) -> Result<Best> {
        let mut frame = self
            .frame(&self.rounded.raw, self.rounded.error, None)
            .ok_or_else(too_fine)?;
        let babai = self.babai(&frame);
        let mut best = if babai.error < self.rounded.error {
            self.descend(&frame, &babai, frame.ball.nearest_plane())
        } else {
            self.descend(&frame, &self.rounded, vec![0; self.formats.len()])
        };
        let least = self.minimax.lower_bound.max(self.lattice_bound());
        // With the function evaluated at the peaks: between points a kink is higher than it seems.
        let at_floor = |c: &Candidate| {
            let floor = least * (1.0 + SLACK);
            c.error <= floor && self.exact_error(&c.raw) <= floor
        };
        let (mut nodes, mut proved) = (0, at_floor(&best));
        let mut share = 20_000;
        let mut most = budget.nodes / 2;
        while !proved && nodes < most {
            let transform = Some(frame.transform.clone());
            frame = self
                .frame(&best.raw, best.error, transform)
                .ok_or_else(too_fine)?;
            let before = best.error;
            let (spent, complete) = self.improve(&frame, &mut best, share.min(most - nodes));
            nodes += spent;
            proved = complete || at_floor(&best);
            if best.error > 0.98 * before {
                share *= 10;
            }
            if !proved && nodes >= most && most < budget.nodes {
                let left = Budget {
                    nodes: budget.nodes - nodes,
                };
                let (spent, complete) = self.improve_by_branches(&mut best, left);
                nodes += spent;
                proved = complete || at_floor(&best);
                // The rest, if any, is for all together.
                most = budget.nodes;
            }
        }
        let rounded = self.exactly(&self.rounded);
        let babai = self.exactly(&babai);
        let seen = best.error;
        best = self.exactly(&best);
        // Points that miss a kink inside the interval prove nothing about the maximum.
        proved &= best.error <= seen * (1.0 + 1e-6);
        for other in [&rounded, &babai] {
            if other.error < best.error {
                best = other.clone();
            }
        }
        let error = best.error;
        Ok(Best {
            values: self.values(&best.raw).iter().map(|v| v.to_f64()).collect(),
            lower_bound: if proved { error } else { least.min(error) },
            raw: best.raw,
            error,
            proved,
            nodes,
            minimax_error: self.minimax.error,
            rounded,
            babai,
        })
    }

    /// The best coefficients up to an error of `limit`, at most `most` of them.
    pub fn enumerate(&self, limit: f64, most: usize, budget: Budget) -> Result<Enumeration> {
        let near = self
            .frame(&self.rounded.raw, limit, None)
            .ok_or_else(too_fine)?;
        let start = self.babai(&near).raw;
        let frame = self
            .frame(&start, limit, Some(near.transform))
            .ok_or_else(too_fine)?;
        let mut candidates: Vec<Candidate> = Vec::new();
        let mut limit = limit;
        let mut scratch = vec![0.0; frame.errors.len()];
        let first = square(limit);
        let mut cuts = Cuts::new(&frame);
        let at = limit;
        let mut exclude = |free: usize, z: &[i64], room: f64| cuts.excludes(free, z, at, room);
        let mut leaf = |z: &[i64]| {
            let mut cost = 0;
            if let Some(found) = self.look(&frame, z, limit, &mut scratch) {
                cost = LEAF_COST;
                candidates.push(found);
                if candidates.len() >= 2 * most.max(1) {
                    sort(&mut candidates);
                    candidates.truncate(most.max(1));
                    limit = candidates.last().map_or(limit, |c| c.error);
                }
            }
            (square(limit), cost)
        };
        let (nodes, complete) = frame
            .ball
            .visit(first, budget.nodes, &mut exclude, &mut leaf);
        sort(&mut candidates);
        if candidates.len() > most {
            candidates.truncate(most);
            limit = candidates.last().map_or(limit, |c| c.error);
        }
        Ok(Enumeration {
            candidates,
            complete_below: if complete { limit } else { 0.0 },
            nodes,
        })
    }

    /// Babai's point, or the rounded one if it is outside the formats.
    fn babai(&self, frame: &Frame) -> Candidate {
        match frame.raw(&frame.ball.nearest_plane()) {
            Some(raw) if self.admits(&raw) => self.candidate(raw),
            _ => self.rounded.clone(),
        }
    }

    fn exactly(&self, candidate: &Candidate) -> Candidate {
        Candidate {
            error: self.exact_error(&candidate.raw).max(candidate.error),
            ..candidate.clone()
        }
    }

    /// The lattice point if it is in the formats and its error at most `limit`.
    fn look(&self, frame: &Frame, z: &[i64], limit: f64, scratch: &mut [f64]) -> Option<Candidate> {
        frame.errors_within(z, limit, scratch)?;
        let raw = frame.raw(z)?;
        if !self.admits(&raw) {
            return None;
        }
        let error = self.samples.supremum(scratch);
        (error <= limit).then(|| Candidate {
            raw,
            error,
            rms: problem::rms(scratch),
        })
    }

    /// Enumerates what is better than `best`; (nodes, whether that was all).
    pub(super) fn improve(&self, frame: &Frame, best: &mut Candidate, nodes: u64) -> (u64, bool) {
        let mut scratch = vec![0.0; frame.errors.len()];
        let first = square(best.error);
        let mut cuts = Cuts::new(frame);
        // The limit of the cuts follows the best error.
        let current = Cell::new(best.error);
        let mut exclude =
            |free: usize, z: &[i64], room: f64| cuts.excludes(free, z, current.get(), room);
        let mut leaf = |z: &[i64]| {
            // Strictly better, so that equal ones keep the first.
            let limit = best.error * (1.0 - 1e-12);
            if let Some(found) = self.look(frame, z, limit, &mut scratch) {
                *best = found;
                current.set(best.error);
            }
            (square(best.error), 0)
        };
        frame.ball.visit(first, nodes, &mut exclude, &mut leaf)
    }

    /// Steps along reduced vectors, and sums and differences of two, while the error falls. `z` is where
    /// `start` is in the frame.
    pub(super) fn descend(&self, frame: &Frame, start: &Candidate, mut z: Vec<i64>) -> Candidate {
        let mut best = start.clone();
        let mut scratch = vec![0.0; frame.errors.len()];
        let moves = moves(z.len());
        for _ in 0..30 {
            let before = best.error;
            for step in &moves {
                let mut trial = z.clone();
                for &(k, by) in step {
                    trial[k] += by;
                }
                let limit = best.error * (1.0 - 1e-12);
                if let Some(found) = self.look(frame, &trial, limit, &mut scratch) {
                    best = found;
                    z = trial;
                }
            }
            if best.error > 0.999 * before {
                break;
            }
        }
        best
    }
}

/// Plus and minus one along each coordinate, then along each pair of them.
pub(super) fn moves(n: usize) -> Vec<Vec<(usize, i64)>> {
    let mut moves: Vec<Vec<(usize, i64)>> = Vec::new();
    for i in 0..n {
        moves.extend([vec![(i, 1)], vec![(i, -1)]]);
    }
    for i in 0..n {
        for j in 0..i {
            for (a, b) in [(1, 1), (1, -1), (-1, 1), (-1, -1)] {
                moves.push(vec![(i, a), (j, b)]);
            }
        }
    }
    moves
}

fn square(limit: f64) -> f64 {
    limit * limit * (1.0 + SLACK)
}

/// By error, errors that are equal but for rounding by their rms.
fn sort(candidates: &mut [Candidate]) {
    let least = candidates.iter().fold(f64::INFINITY, |m, c| m.min(c.error));
    let step = (least * SLACK).max(f64::MIN_POSITIVE);
    let key = |c: &Candidate| (c.error / step).round();
    candidates.sort_by(|a, b| {
        let by_error = key(a).total_cmp(&key(b)).then(a.rms.total_cmp(&b.rms));
        by_error.then_with(|| a.raw.cmp(&b.raw))
    });
}

fn too_fine() -> crate::error::Error {
    InputError::new("the coefficients cannot be told apart: their steps change the polynomial by too little on this interval")
        .help("use a lower degree, fewer fraction bits, or a variable that is centred in the interval")
        .into()
}

#[cfg(test)]
#[path = "coefficients_tests.rs"]
mod tests;
