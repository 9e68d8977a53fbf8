//! Integer coefficients for a fitted polynomial: nearest in the greatest error over the calibrated range, and among
//! near ones those that the firmware's own evaluation does best with.

use super::Evaluation;
use crate::approx::minimax::search::Effort;
use crate::approx::minimax::{
    Basis, Budget, CoefficientFormat, Datapath, Monomials, Problem, Samples, Weight, minimax,
    search,
};
use crate::design::{Circuit, Compensation};
use crate::error::Result;
use crate::numeric::polynomial;

/// Words of the calibrated range that candidates are run over.
const WORDS: i128 = 4096;
/// A first look at a candidate takes every so manyth of them.
const FIRST_LOOK: usize = 16;
/// Candidates, evaluations and nodes; some tenths of a second.
const EFFORT: Effort = Effort {
    candidates: 200,
    evaluations: 2000,
    budget: Budget { nodes: 200_000 },
    thorough: false,
};

/// Raw coefficients for `exact` (in the variable p, lowest order first), in the compensation's formats. Never worse
/// than `rounded` over the words that are looked at.
///
/// # Errors
/// A coefficient that its format cannot hold.
pub fn best(
    circuit: &Circuit,
    compensation: &Compensation,
    exact: &[f64],
    rounded: &[i128],
) -> Result<Vec<i128>> {
    let path = Path::new(circuit, compensation, exact);
    let whole = path.largest(rounded, f64::INFINITY, 1);
    let (Some(nominal), [first, .., last]) = (whole, path.points.as_slice()) else {
        return Ok(rounded.to_vec());
    };
    let target = |p: f64| polynomial::evaluate(exact, p);
    let basis = Basis::new(Monomials::All, exact.len().saturating_sub(1) as u32)?;
    let (low, high) = (first.p, last.p);
    let samples = Samples::new(&target, &basis, low, high, Weight::Absolute)?;
    let real = minimax(&samples)?;
    let format = CoefficientFormat::from(compensation.coefficient_format);
    let problem = Problem::new(&samples, &real, &[format])?;
    let found = search(&problem, &path, EFFORT)?;
    let better = found.total_error < nominal && path.takes(&found.raw);
    Ok(if better { found.raw } else { rounded.to_vec() })
}

struct Point {
    word: i128,
    p: f64,
    wanted_dps: f64,
}

/// The bias block over words of the calibrated range.
struct Path<'a> {
    circuit: &'a Circuit,
    compensation: &'a Compensation,
    points: Vec<Point>,
}

impl<'a> Path<'a> {
    fn new(circuit: &'a Circuit, compensation: &'a Compensation, exact: &[f64]) -> Self {
        let evaluation = Evaluation::new(circuit, compensation);
        let (low, high) = evaluation.calibrated();
        let words = (0..=WORDS).map(|k| low + (high - low) * k / WORDS);
        let mut points: Vec<Point> = words
            .map(|word| {
                let p = evaluation.variable(word);
                let wanted_dps = polynomial::evaluate(exact, p);
                Point {
                    word,
                    p,
                    wanted_dps,
                }
            })
            .collect();
        points.dedup_by_key(|p| p.word);
        Path {
            circuit,
            compensation,
            points,
        }
    }

    /// True if the formats hold the coefficients.
    fn takes(&self, raw: &[i128]) -> bool {
        let c = self.compensation;
        let shift = c.accumulator.format.fraction_bits - c.coefficient_format.fraction_bits;
        let held = |v: &i128| {
            c.coefficient_format.contains(*v) && c.accumulator.format.contains(v << shift)
        };
        raw.iter().all(held)
    }

    fn largest(&self, raw: &[i128], limit: f64, every: usize) -> Option<f64> {
        if !self.takes(raw) {
            return None;
        }
        let compensation = Compensation {
            coefficients_raw: raw.to_vec(),
            ..self.compensation.clone()
        };
        let evaluation = Evaluation::new(self.circuit, &compensation);
        let mut largest = 0.0f64;
        for point in self.points.iter().step_by(every) {
            largest = largest.max((evaluation.bias_dps(point.word) - point.wanted_dps).abs());
            if largest > limit {
                return None;
            }
        }
        Some(largest)
    }
}

impl Datapath for Path<'_> {
    fn max_error(&self, raw: &[i128], limit: f64) -> Option<f64> {
        self.largest(raw, limit, 1)
    }

    fn sample_error(&self, raw: &[i128], limit: f64) -> Option<f64> {
        self.largest(raw, limit, FIRST_LOOK)
    }

    fn evaluation_bound(&self, _raw: &[i128]) -> f64 {
        let evaluation = Evaluation::new(self.circuit, self.compensation);
        let p_max = self.points.iter().map(|p| p.p.abs()).fold(0.0, f64::max);
        evaluation.steps_bound_dps(p_max) + evaluation.output_bound_dps()
    }
}
