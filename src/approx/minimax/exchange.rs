//! Levelled reference systems: the inner step of the exchange algorithm.
//!
//! A reference is a set of n + 1 points, n the number of coefficients. Its levelled error is the largest
//! lower bound of the maximum error that those points can prove (de la Vallee Poussin); exchanging points so
//! that it grows is the dual simplex method on the linear programme of the approximation (E. Stiefel,
//! "Note on Jordan elimination, linear programming and Tchebycheff approximation", Numerische
//! Mathematik 2, 1960), and needs no Haar condition.

use super::samples::Point;
use super::wide::{Wide, dot};

/// A point with the values of the basis there.
#[derive(Debug, Clone)]
pub(super) struct Place {
    /// The function there.
    pub point: Point,
    /// The basis functions there.
    pub row: Vec<Wide>,
}

/// A solved reference.
#[derive(Debug, Clone)]
pub(super) struct Levelled {
    /// Coefficients of the basis functions.
    pub coefficients: Vec<Wide>,
    /// The levelled error, >= 0.
    pub error: f64,
    /// Sign of the error at each place.
    signs: Vec<f64>,
    /// Magnitudes of the multipliers: how much each point carries.
    multipliers: Vec<Wide>,
}

/// Solves a square system by elimination with full pivoting; None if it is singular.
pub(super) fn solve(mut matrix: Vec<Vec<Wide>>, mut right: Vec<Wide>) -> Option<Vec<Wide>> {
    let n = right.len();
    let mut order: Vec<usize> = (0..n).collect();
    let largest = |m: &[Vec<Wide>], k: usize| {
        let mut best = (k, k, 0.0);
        for (r, row) in m.iter().enumerate().skip(k) {
            for (c, v) in row.iter().enumerate().skip(k) {
                if v.abs().hi > best.2 {
                    best = (r, c, v.abs().hi);
                }
            }
        }
        best
    };
    let size = largest(&matrix, 0).2;
    for k in 0..n {
        let (r, c, pivot) = largest(&matrix, k);
        if pivot <= 1e-28 * size || !pivot.is_finite() {
            return None;
        }
        matrix.swap(k, r);
        right.swap(k, r);
        matrix.iter_mut().for_each(|row| row.swap(k, c));
        order.swap(k, c);
        for i in k + 1..n {
            let factor = matrix[i][k] / matrix[k][k];
            if factor.hi == 0.0 {
                continue;
            }
            let (done, open) = matrix.split_at_mut(i);
            for (to, from) in open[0][k..].iter_mut().zip(&done[k][k..]) {
                *to -= factor * *from;
            }
            let v = factor * right[k];
            right[i] -= v;
        }
    }
    let mut solution = vec![Wide::ZERO; n];
    for k in (0..n).rev() {
        let known = dot(&matrix[k][k + 1..], &solution[k + 1..]);
        solution[k] = (right[k] - known) / matrix[k][k];
    }
    let mut ordered = vec![Wide::ZERO; n];
    for (k, &place) in order.iter().enumerate() {
        ordered[place] = solution[k];
    }
    Some(ordered)
}

/// Columns (sign times row, 1/weight) of a reference: the basis matrix of the simplex method.
fn columns(places: &[Place], signs: &[f64]) -> Vec<Vec<Wide>> {
    places
        .iter()
        .zip(signs)
        .map(|(p, &s)| column(p, s))
        .collect()
}

fn column(place: &Place, sign: f64) -> Vec<Wide> {
    let mut column: Vec<Wide> = place.row.iter().map(|v| v.scaled(sign)).collect();
    column.push(Wide::ONE / Wide::from(place.point.weight));
    column
}

fn transposed(m: &[Vec<Wide>]) -> Vec<Vec<Wide>> {
    (0..m.len())
        .map(|k| m.iter().map(|row| row[k]).collect())
        .collect()
}

/// Multipliers of the only linear relation among the rows of n + 1 places; None if there are
/// several (a degenerate reference).
fn relation(places: &[Place]) -> Option<Vec<Wide>> {
    let n = places.len().checked_sub(1)?;
    // Some multiplier is not 0; set one to 1 and solve for the others, trying the middle first.
    let mut tries: Vec<usize> = (0..=n).collect();
    tries.sort_by_key(|&k| k.abs_diff(n / 2));
    for free in tries {
        let others: Vec<&Place> = places
            .iter()
            .enumerate()
            .filter_map(|(k, p)| (k != free).then_some(p))
            .collect();
        let rows: Vec<Vec<Wide>> = others.iter().map(|p| p.row.clone()).collect();
        let right = places[free].row.iter().map(|&v| -v).collect();
        if let Some(mut found) = solve(transposed(&rows), right) {
            found.insert(free, Wide::ONE);
            return Some(found);
        }
    }
    None
}

/// Solves a reference of n + 1 places.
pub(super) fn levelled(places: &[Place]) -> Option<Levelled> {
    let relation = relation(places)?;
    let size = relation.iter().fold(0.0f64, |m, v| m.max(v.abs().hi));
    let mut sum = Wide::ZERO;
    for (l, p) in relation.iter().zip(places) {
        sum += *l * p.point.value;
    }
    let flip = if sum.hi < 0.0 { -1.0 } else { 1.0 };
    let signs: Vec<f64> = relation
        .iter()
        .map(|l| {
            if l.abs().hi <= 1e-27 * size || l.hi >= 0.0 {
                flip
            } else {
                -flip
            }
        })
        .collect();
    with_signs(places, signs)
}

/// Solves a reference whose signs are known.
fn with_signs(places: &[Place], signs: Vec<f64>) -> Option<Levelled> {
    let n = places.len() - 1;
    let basis = columns(places, &signs);
    let mut unit = vec![Wide::ZERO; n];
    unit.push(Wide::ONE);
    let multipliers = solve(transposed(&basis), unit)?;
    let right = places
        .iter()
        .zip(&signs)
        .map(|(p, &s)| p.point.value.scaled(s))
        .collect();
    let mut coefficients = solve(basis, right)?;
    let error = coefficients.pop()?.hi;
    Some(Levelled {
        coefficients,
        error,
        signs,
        multipliers,
    })
}

/// Exchanges one place for `entering`, whose error has the sign `sign`: the new levelled error is not
/// below the old one.
pub(super) fn exchange(
    places: &mut [Place],
    solved: &Levelled,
    entering: Place,
    sign: f64,
) -> Option<Levelled> {
    exchange_at(places, solved, entering, sign).map(|(next, _)| next)
}

/// The same with the index of the place that left.
pub(super) fn exchange_at(
    places: &mut [Place],
    solved: &Levelled,
    entering: Place,
    sign: f64,
) -> Option<(Levelled, usize)> {
    let basis = columns(places, &solved.signs);
    let direction = solve(transposed(&basis), column(&entering, sign))?;
    let mut leaving: Option<(usize, Wide)> = None;
    for (k, (d, l)) in direction.iter().zip(&solved.multipliers).enumerate() {
        if d.hi <= 1e-25 {
            continue;
        }
        let ratio = *l / *d;
        if leaving.is_none_or(|(_, least)| ratio < least) {
            leaving = Some((k, ratio));
        }
    }
    let (k, _) = leaving?;
    let mut signs = solved.signs.clone();
    *places.get_mut(k)? = entering;
    *signs.get_mut(k)? = sign;
    Some((with_signs(places, signs)?, k))
}

impl Levelled {
    /// Signed multipliers: orthogonal to the basis, and the levelled error is their inner product with
    /// the function. Their magnitudes over the points' weights add up to 1.
    pub(super) fn weights(&self) -> Vec<f64> {
        let both = self.multipliers.iter().zip(&self.signs);
        both.map(|(l, s)| l.hi * s).collect()
    }
}
