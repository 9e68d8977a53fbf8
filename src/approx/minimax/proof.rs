//! Whether any coefficients have a smaller total error, decided by what the output's codes allow.
//!
//! A total error of at most T means that at every input code the result is one of the output codes within T
//! of the function. The result is the polynomial's value rounded, so the value lies between the least such
//! code less half an LSB (and what the evaluation rounds) and the greatest plus as much: a [`Slab`]. Among
//! neighbouring inputs some have a function value that is just within T of an output code, and there the slab is
//! nearly tight: together they say about |f - p| <= T - half an LSB, where the triangle inequality alone would
//! say T + half an LSB. The lattice points in all slabs are few, and can all be run.

use super::coefficients::Budget;
use super::problem::{Candidate, Problem};
use super::samples::{Point, Samples};
use super::wide::Wide;
use super::{Basis, Monomials};

/// Slabs for each coefficient. Twice as many and the design of the ellipsoid would leave some out.
pub(super) const SLABS_EACH: usize = 14;
/// Widening against rounding, relative to the slab and to the function.
const SLACK: f64 = 1e-7;

/// What coefficients with a total error of at most some T have in common: `low <= p(x) <= high`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Slab {
    /// Where.
    pub x: f64,
    /// Least value of the polynomial.
    pub low: f64,
    /// Its greatest value.
    pub high: f64,
}

/// All slabs that are looked at, or the knowledge that no result can be good enough.
#[derive(Debug, Clone, PartialEq)]
pub enum Slabs {
    /// Some; none if nothing is known.
    Some(Vec<Slab>),
    /// At some input no output code is within T.
    Impossible,
}

/// The coefficients in all slabs, at most `most` of them, and whether these are all.
pub(super) fn within(
    problem: &Problem,
    slabs: Vec<Slab>,
    most: usize,
    budget: Budget,
) -> Option<(Vec<Candidate>, bool)> {
    let basis = &problem.samples.basis;
    let mut points: Vec<Point> = slabs.iter().filter_map(|s| point(s, basis)).collect();
    points.sort_by(|a, b| a.x.total_cmp(&b.x));
    let (low, high) = (points.first()?.x, points.last()?.x);
    if points.len() <= basis.len() || low >= high {
        return None;
    }
    let samples = Samples {
        basis: basis.clone(),
        low,
        high,
        points,
        between: None,
    };
    let tight = Problem::new(&samples, problem.minimax, &problem.formats).ok()?;
    let listed = tight.enumerate(1.0 + SLACK, most, budget).ok()?;
    let all = listed.complete_below >= 1.0 && listed.candidates.len() < most;
    Some((listed.candidates, all))
}

/// The slab's middle, its weight such that its ends are at an error of 1.
fn point(slab: &Slab, basis: &Basis) -> Option<Point> {
    let middle = 0.5 * (slab.low + slab.high);
    let half = 0.5 * (slab.high - slab.low);
    let half = half * (1.0 + SLACK) + 8.0 * f64::EPSILON * middle.abs();
    // An odd or even polynomial's value on one side is its value on the other.
    let (x, middle) = match basis.monomials {
        Monomials::All => (slab.x, middle),
        Monomials::Odd if slab.x < 0.0 => (-slab.x, -middle),
        Monomials::Odd | Monomials::Even => (slab.x.abs(), middle),
    };
    let vanishes = basis.monomials == Monomials::Odd && x == 0.0;
    (half > 0.0 && half.is_finite() && !vanishes).then(|| Point {
        x,
        value: Wide::from(middle),
        weight: 1.0 / half,
    })
}
