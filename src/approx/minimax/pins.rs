//! Branches of the search by what the polynomial is at 0 and at 1 or -1.
//!
//! There every polynomial of the formats is a multiple of one number, so its error is one of few values: a
//! half, one and a half, ... of that unit, or none, one, two. Many coefficients share the error of such a place, a plateau
//! on which neither the lattice's nearest plane nor steps find the way down. With these values fixed
//! the others are points of a smaller lattice, whose errors differ.

use super::coefficients::Budget;
use super::problem::{Candidate, Problem};
use crate::numeric::format::pow2;

/// More branches than these are not looked at: the unit is small beside the error, and there is no plateau.
const MOST: usize = 48;

/// Coefficients with given values at the places: `base` plus integer multiples of `transform`'s rows.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Branch {
    /// Weighted error at the places.
    pub error: f64,
    pub base: Vec<i128>,
    pub transform: Vec<Vec<i128>>,
}

impl Problem<'_, '_> {
    /// All branches whose error at the places is at most `limit`, least first; `None` where no place is in the
    /// interval, or there are too many.
    pub(super) fn branches(&self, limit: f64) -> Option<Vec<Branch>> {
        let exponents = &self.samples.basis.exponents;
        let constant = exponents.first() == Some(&0);
        let origin = (constant && self.is_inside(0.0)).then_some(0);
        let side = [1.0, -1.0].into_iter().find(|x| self.is_inside(*x));
        let values = match origin {
            Some(k) => self.values_at(0.0, 0.0, self.formats.get(k)?.lsb(), limit)?,
            None => vec![(0, 0.0)],
        };
        let mut all = Vec::new();
        for (value, error) in values {
            let mut base = self.rounded.raw.clone();
            let mut free: Vec<usize> = (0..base.len()).collect();
            let mut known = 0.0;
            if let Some(k) = origin {
                *base.get_mut(k)? = value;
                known = value as f64 * self.formats.get(k)?.lsb();
                free.retain(|j| *j != k);
            }
            match side {
                None if origin.is_some() => {
                    let transform = free.iter().map(|k| unit(base.len(), *k)).collect();
                    all.push(Branch {
                        error,
                        base,
                        transform,
                    });
                }
                None => return None,
                Some(x) => all.extend(self.pinned_at(x, &base, &free, (known, error), limit)?),
            }
            if all.len() > MOST {
                return None;
            }
        }
        all.sort_by(|a, b| a.error.total_cmp(&b.error).then(a.base.cmp(&b.base)));
        Some(all)
    }

    fn is_inside(&self, x: f64) -> bool {
        (self.samples.low..=self.samples.high).contains(&x)
    }

    /// Multiples of `unit` that with `known` come within `limit` of the function at x, with their errors.
    fn values_at(&self, x: f64, known: f64, unit: f64, limit: f64) -> Option<Vec<(i128, f64)>> {
        let samples = self.samples;
        let there = samples.points.iter().find(|p| p.x == x).copied();
        let point = there.or_else(|| samples.point_at(x))?;
        let wanted = (point.value - super::Wide::from(known)).scaled(1.0 / unit);
        let reach = limit / (unit * point.weight);
        if !(0.0..=MOST as f64).contains(&reach) {
            return None;
        }
        let nearest = wanted.round()?;
        let around = reach as i128 + 1;
        let off = |value: i128| {
            let rest = wanted - super::Wide::from_integer(value);
            (value, rest.abs().hi * unit * point.weight)
        };
        let values = (nearest - around..=nearest + around).map(off);
        Some(values.filter(|(_, error)| *error <= limit).collect())
    }

    /// The branches at 1 or -1 of coefficients of which those of `free` may change.
    fn pinned_at(
        &self,
        x: f64,
        base: &[i128],
        free: &[usize],
        (known, error): (f64, f64),
        limit: f64,
    ) -> Option<Vec<Branch>> {
        let finest = free.iter().map(|k| self.formats[*k].fraction_bits).max()?;
        // Of each coefficient, in the finest one's units.
        let factor = |k: usize| {
            let shift = finest - self.formats[k].fraction_bits;
            let odd = self.samples.basis.exponents[k] % 2 == 1;
            let size = (shift < 64).then(|| 1i128 << shift)?;
            Some(if x < 0.0 && odd { -size } else { size })
        };
        let factors: Vec<i128> = free.iter().map(|k| factor(*k)).collect::<Option<_>>()?;
        let (pivot, sign) = free
            .iter()
            .zip(&factors)
            .rev()
            .find(|(_, f)| f.abs() == 1)
            .map(|(k, f)| (*k, *f))?;
        let sum = |raw: &[i128]| -> i128 {
            let terms = free.iter().zip(&factors);
            terms.map(|(k, f)| raw[*k] * f).sum()
        };
        let mut transform = Vec::new();
        for (k, f) in free.iter().zip(&factors).filter(|(k, _)| **k != pivot) {
            let mut row = unit(base.len(), *k);
            row[pivot] = -f * sign;
            transform.push(row);
        }
        let branch = |(value, there): (i128, f64)| {
            let mut base = base.to_vec();
            base[pivot] += (value - sum(&base)) * sign;
            Branch {
                error: error.max(there),
                base,
                transform: transform.clone(),
            }
        };
        let values = self.values_at(x, known, pow2(-finest), limit)?;
        Some(values.into_iter().map(branch).collect())
    }

    /// Looks for better coefficients branch by branch; the nodes spent, and whether that was all.
    pub(super) fn improve_by_branches(&self, best: &mut Candidate, budget: Budget) -> (u64, bool) {
        let Some(branches) = self.branches(best.error) else {
            return (0, false);
        };
        let (mut nodes, mut all) = (0, true);
        for pass in 0..2 {
            // First a look at each, for a good start helps the others; then what is left of the budget.
            all = true;
            let count = branches.len().max(1) as u64;
            for branch in &branches {
                if branch.error > best.error * (1.0 - 1e-12) || branch.transform.is_empty() {
                    all &= !branch.transform.is_empty();
                    continue;
                }
                let left = budget.nodes.saturating_sub(nodes);
                let share = if pass == 0 { left / (8 * count) } else { left };
                let (spent, complete) = self.improve_in(branch, best, share);
                nodes += spent;
                all &= complete;
            }
            if all {
                break;
            }
        }
        (nodes, all)
    }

    fn improve_in(&self, branch: &Branch, best: &mut Candidate, most: u64) -> (u64, bool) {
        let (mut base, mut transform) = (branch.base.clone(), branch.transform.clone());
        let mut nodes = 0;
        loop {
            let before = best.error;
            let Some(frame) = self.frame(&base, before, Some(transform)) else {
                return (nodes, false);
            };
            let z = frame.ball.nearest_plane();
            if let Some(raw) = frame.raw(&z).filter(|raw| self.admits(raw)) {
                let near = self.candidate(raw);
                let found = self.descend(&frame, &near, z);
                if found.error < best.error * (1.0 - 1e-12) {
                    *best = found.clone();
                }
                base = found.raw;
            }
            let (spent, complete) = self.improve(&frame, best, most.saturating_sub(nodes));
            nodes += spent;
            if complete || nodes >= most || best.error > 0.98 * before {
                return (nodes, complete);
            }
            transform = frame.transform;
        }
    }
}

fn unit(n: usize, k: usize) -> Vec<i128> {
    (0..n).map(|j| i128::from(j == k)).collect()
}

#[cfg(test)]
#[path = "pins_tests.rs"]
mod tests;
