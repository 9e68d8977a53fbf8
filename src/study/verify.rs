//! Points before they are reported: run again with other noise over more temperatures, rates and a longer detuned
//! run; started from power-on; every cast's range proved.

use super::bench::VERIFY_SEED;
use super::certainty::{Errors, square_error};
use super::figures::{Figures, added};
use super::measure::{Output, run};
use super::scenario::{Extent, Plan, Role};
use crate::circuit::engine::{self, ArithmeticKind};
use crate::cosim::path::Path;
use crate::cosim::rest;
use crate::design::Design;
use crate::error::Result;
use crate::numeric::format::Overflow;
use crate::plant::noise::Noise;

/// The runs that verify every point of a study.
pub struct Verifier<'a> {
    given: &'a Design,
    /// What is run.
    pub plan: Plan,
    /// The given design without quantisation.
    pub twin: Output,
    seed: u64,
    /// Casts of the given design whose range is not proved.
    unproved: Vec<String>,
    /// The twin's rows after a start from power-on and those of the settled one, deg/s; none without loops.
    start: Option<[Vec<f64>; 2]>,
}

/// What a point's verification found.
#[derive(Debug, Clone, PartialEq)]
pub struct Verified {
    /// What its words add, with other noise than the search had.
    pub figures: Figures,
    /// How certain they are.
    pub errors: Errors,
    /// Casts that can overflow as far as the ranges of the words say, and that of the given design cannot.
    pub overflows: Vec<String>,
    /// Mean error of the output after a start from power-on, less that of the settled circuit under the same
    /// conditions, and the standard error of this difference, deg/s; none without loops.
    pub startup_dps: Option<[f64; 2]>,
}

/// Rows that a start-up takes at most: what settles later is not waited for (convention).
const LONGEST_START: usize = 100_000;
/// Rows averaged after it, and of the circuit that was settled before: 0.6 s of the default (convention).
const AFTER_START: usize = 1024;

impl<'a> Verifier<'a> {
    /// For points made from `given`.
    ///
    /// # Errors
    /// A phase loop that cannot lock.
    pub fn new(given: &'a Design) -> Result<Self> {
        let seed = given.thermal_run.seed ^ VERIFY_SEED;
        let plan = Plan::new(given, Extent::VERIFY, seed)?;
        let twin = run(given, ArithmeticKind::Float, &plan)?;
        let mut verifier = Verifier {
            given,
            plan,
            twin,
            seed,
            unproved: unproved(given),
            start: None,
        };
        verifier.start = verifier.started(given, ArithmeticKind::Float)?;
        Ok(verifier)
    }

    /// Verifies a design.
    ///
    /// # Errors
    /// A phase loop that cannot lock; a circuit that stops on an overflow.
    pub fn verify(&self, design: &Design) -> Result<Verified> {
        let output = run(design, ArithmeticKind::Fixed, &self.plan)?;
        let mut overflows = unproved(design);
        overflows.retain(|label| !self.unproved.contains(label));
        let started = self.started(design, ArithmeticKind::Fixed)?;
        let startup_dps = match (started, &self.start) {
            (Some([started, held]), Some([started_float, held_float])) => {
                let after = differences(&started, started_float);
                let settled = differences(&held, held_float);
                let square = square_error(&after) + square_error(&settled);
                Some([mean(&after) - mean(&settled), square.sqrt()])
            }
            _ => None,
        };
        Ok(Verified {
            figures: added(&self.plan, &output, &self.twin),
            errors: Errors::new(&self.plan, &output, &self.twin),
            overflows,
            startup_dps,
        })
    }

    /// What a design's words add, over the verification's runs.
    ///
    /// # Errors
    /// As [`verify`](Self::verify).
    pub fn figures(&self, design: &Design) -> Result<Figures> {
        let output = run(design, ArithmeticKind::Fixed, &self.plan)?;
        Ok(added(&self.plan, &output, &self.twin))
    }

    /// The same with their standard errors.
    ///
    /// # Errors
    /// As [`verify`](Self::verify).
    pub fn figures_and_errors(&self, design: &Design) -> Result<(Figures, Errors)> {
        let output = run(design, ArithmeticKind::Fixed, &self.plan)?;
        Ok((
            added(&self.plan, &output, &self.twin),
            Errors::new(&self.plan, &output, &self.twin),
        ))
    }

    fn startup_rows(&self) -> usize {
        rest::settling_rows(self.given).map_or(LONGEST_START, |n| n.min(LONGEST_START))
    }

    /// The output under the plan's middle temperature, row by row, deg/s: after a start from power-on, and of the
    /// circuit that was settled before; `None` without loops.
    fn started(&self, design: &Design, kind: ArithmeticKind) -> Result<Option<[Vec<f64>; 2]>> {
        let circuit = &design.circuit;
        if circuit.phase_loop.is_none() && circuit.amplitude_loop.is_none() {
            return Ok(None);
        }
        let rests = self.plan.nominal.iter();
        let rests: Vec<_> = rests.filter(|s| s.role == Role::Rest).collect();
        let Some(stretch) = rests.get(rests.len() / 2) else {
            return Ok(None);
        };
        let noise = Noise::new(self.seed, u64::MAX / 2);
        let mut path = Path::new(design, kind);
        path.start(stretch.conditions);
        path.gyroscope.stop();
        for _ in 0..self.startup_rows() {
            path.period(&noise)?;
        }
        let started = rates(design, &mut path, &noise)?;
        let mut path = Path::new(design, kind);
        path.warm_start(design, stretch.conditions, &noise)?;
        Ok(Some([started, rates(design, &mut path, &noise)?]))
    }
}

/// [`AFTER_START`] rows of the output, deg/s.
fn rates(design: &Design, path: &mut Path, noise: &Noise) -> Result<Vec<f64>> {
    let scale = crate::circuit::scale::full_scale_dps(design);
    let mut rates = Vec::with_capacity(AFTER_START);
    for _ in 0..AFTER_START {
        let row = path.period(noise)?;
        let [_, _, sense_i, _] = row.channels;
        rates.push(if row.rate_dps.is_nan() {
            sense_i * scale
        } else {
            row.rate_dps
        });
    }
    Ok(rates)
}

fn differences(fixed: &[f64], float: &[f64]) -> Vec<f64> {
    fixed.iter().zip(float).map(|(a, b)| a - b).collect()
}

fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len().max(1) as f64
}

/// The casts of a design that the ranges of their words do not keep inside their formats, by label. A wrap is meant.
pub fn unproved(design: &Design) -> Vec<String> {
    let program = engine::trace(design);
    let mut out = Vec::new();
    for (number, cast) in program.casts.iter().enumerate() {
        let limited = cast.overflow.is_some_and(|o| o != Overflow::Wrap);
        let label = cast.label.to_string();
        if limited && !program.is_proved_in_range(number) && !out.contains(&label) {
            out.push(label);
        }
    }
    out
}
