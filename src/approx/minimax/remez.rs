//! Minimax polynomials by the exchange algorithm.
//!
//! E. Ya. Remez, "Sur la determination des polynomes d'approximation de degre donnee", Comm. Soc. Math.
//! Kharkov 10 (1934): all alternating extrema enter at once. Where fewer than n + 1 of them alternate (no
//! Haar condition: an odd basis on both sides of 0, say) one point enters at a time, see `exchange`.
//! Systems are solved in Chebyshev functions with some 32 digits.

use super::basis::Chebyshev;
use super::exchange::{self, Levelled, Place};
use super::extrema::Extremum;
use super::samples::Samples;
use super::wide::{Wide, dot};
use crate::error::{InputError, Result};

/// A best approximation.
#[derive(Debug, Clone)]
pub struct Minimax {
    /// One a monomial of the basis, ascending exponents.
    pub coefficients: Vec<Wide>,
    /// Its largest weighted error, in the function's unit (absolute weight) or in parts (relative).
    pub error: f64,
    /// No polynomial of the basis has a smaller one: the largest levelled error seen.
    pub lower_bound: f64,
    /// The places of the last reference, ascending: where the error levels.
    pub reference: Vec<f64>,
    /// Steps taken.
    pub iterations: usize,
    /// True if `error` is within 1e-8 of `lower_bound`, plus 4e-15 of the function: one known to double
    /// precision is noise there.
    pub converged: bool,
}

/// Exchange steps at most.
const MOST_STEPS: usize = 400;
/// Rounding noise of a function known to a double, as a part of its magnitude.
const NOISE: f64 = 4e-15;

/// The minimax polynomial over samples.
///
/// Errors: a function so ill-conditioned on its interval that no reference can be solved. A result that
/// has not converged within the step limit is returned with `converged` false.
pub fn minimax(samples: &Samples) -> Result<Minimax> {
    let run = Run::new(samples);
    let mut places = run.start();
    let mut solved = exchange::levelled(&places).ok_or_else(ill_conditioned)?;
    let scale = run.scale();
    let mut best: Option<(f64, Vec<Wide>)> = None;
    let mut lower = 0.0f64;
    let mut iterations = 0;
    let mut stalled = 0;
    let mut converged = false;
    while iterations < MOST_STEPS {
        iterations += 1;
        lower = lower.max(solved.error);
        let errors = run.errors(&solved.coefficients);
        let largest = samples.supremum(&errors);
        if best.as_ref().is_none_or(|(e, _)| largest < *e) {
            best = Some((largest, solved.coefficients.clone()));
        }
        if largest <= lower * (1.0 + 1e-10) || largest <= 1e-28 * scale {
            converged = true;
            break;
        }
        let extrema = samples.extrema(&errors);
        let next = run.step(&mut places, &solved, &extrema, stalled > 3);
        let Some(next) = next else { break };
        stalled = if next.error > lower * (1.0 + 1e-12) {
            0
        } else {
            stalled + 1
        };
        if stalled > 40 || (stalled > 5 && largest <= lower + NOISE * scale) {
            break;
        }
        solved = next;
    }
    let (_, coefficients) = best.ok_or_else(ill_conditioned)?;
    let coefficients = run.functions.to_monomials(&coefficients);
    let error = samples.supremum_of(&coefficients).0;
    let mut reference: Vec<f64> = places.iter().map(|p| p.point.x).collect();
    reference.sort_by(f64::total_cmp);
    Ok(Minimax {
        converged: converged || error <= lower * (1.0 + 1e-8) + NOISE * scale,
        coefficients,
        lower_bound: lower.min(error),
        error,
        reference,
        iterations,
    })
}

fn ill_conditioned() -> crate::error::Error {
    InputError::new("the polynomials cannot be told apart on this interval")
        .help("use a lower degree, or a variable that is centred in the interval")
        .into()
}

/// What stays the same from step to step.
struct Run<'s, 'a> {
    samples: &'s Samples<'a>,
    functions: Chebyshev,
    rows: Vec<Vec<Wide>>,
}

impl<'s, 'a> Run<'s, 'a> {
    fn new(samples: &'s Samples<'a>) -> Self {
        let functions = Chebyshev::new(&samples.basis, samples.low, samples.high);
        let rows = samples.points.iter().map(|p| functions.at(p.x)).collect();
        Run {
            samples,
            functions,
            rows,
        }
    }

    /// The function's weighted magnitude.
    fn scale(&self) -> f64 {
        let sizes = self
            .samples
            .points
            .iter()
            .map(|p| p.value.abs().hi * p.weight);
        sizes.fold(0.0, f64::max)
    }

    /// n + 1 places like the extrema of a Chebyshev polynomial. The ends are left out a little for an odd
    /// basis, which is 0 at 0.
    fn start(&self) -> Vec<Place> {
        let wanted = self.samples.basis.len() + 1;
        let last = self.samples.points.len() - 1;
        let both_sides = self.samples.low < 0.0
            && self.samples.high > 0.0
            && self.samples.basis.progression().1 == 2;
        // On both sides of 0 equal magnitudes would make equal rows: take one side.
        let first = if both_sides {
            self.samples
                .points
                .iter()
                .position(|p| p.x > 0.0)
                .unwrap_or(0)
        } else {
            0
        };
        let span = last - first;
        let skip = usize::from(self.samples.basis.progression().0 == 1);
        (0..wanted)
            .map(|k| {
                let step = (k + skip) * span / (wanted - 1 + skip);
                let from_zero = self.samples.high > 0.0;
                let index = if from_zero { first + step } else { last - step };
                self.at_index(index)
            })
            .collect()
    }

    fn at_index(&self, index: usize) -> Place {
        Place {
            point: self.samples.points[index],
            row: self.rows[index].clone(),
        }
    }

    /// The place of an extremum, between the points if the function is known there.
    fn at(&self, extremum: &Extremum) -> Place {
        let on_point = self.samples.points[extremum.index].x == extremum.x;
        match self.samples.point_at(extremum.x) {
            Some(point) if !on_point => Place {
                point,
                row: self.functions.at(extremum.x),
            },
            _ => self.at_index(extremum.index),
        }
    }

    fn errors(&self, coefficients: &[Wide]) -> Vec<f64> {
        self.samples
            .points
            .iter()
            .zip(&self.rows)
            .map(|(p, row)| (p.value - dot(coefficients, row)).hi * p.weight)
            .collect()
    }

    /// The next reference: all extrema if enough of them alternate, else one.
    fn step(
        &self,
        places: &mut Vec<Place>,
        solved: &Levelled,
        extrema: &[Extremum],
        one_only: bool,
    ) -> Option<Levelled> {
        let wanted = self.samples.basis.len() + 1;
        if extrema.len() >= wanted && !one_only {
            let chosen = choose(extrema.to_vec(), wanted);
            let trial: Vec<Place> = chosen.iter().map(|e| self.at(e)).collect();
            if let Some(next) = exchange::levelled(&trial)
                && next.error > solved.error
            {
                *places = trial;
                return Some(next);
            }
        }
        let worst = extrema
            .iter()
            .max_by(|a, b| a.error.abs().total_cmp(&b.error.abs()))?;
        exchange::exchange(places, solved, self.at(worst), worst.error.signum())
    }
}

/// `wanted` alternating extrema with the largest among them.
fn choose(mut extrema: Vec<Extremum>, wanted: usize) -> Vec<Extremum> {
    while extrema.len() > wanted {
        let size = |k: usize| extrema[k].error.abs();
        let last = extrema.len() - 1;
        if extrema.len() == wanted + 1 {
            let drop = if size(0) < size(last) { 0 } else { last };
            extrema.remove(drop);
            continue;
        }
        // The least goes with its smaller neighbour, so that signs still alternate.
        let least = (0..=last)
            .min_by(|&a, &b| size(a).total_cmp(&size(b)))
            .unwrap_or(0);
        if least == 0 || least == last {
            extrema.remove(least);
        } else {
            let from = if size(least - 1) < size(least + 1) {
                least - 1
            } else {
                least
            };
            extrema.drain(from..from + 2);
        }
    }
    extrema
}

#[cfg(test)]
#[path = "remez_tests.rs"]
mod tests;
