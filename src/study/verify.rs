//! Points before they are reported: run again with other noise over more temperatures, rates and a longer detuned
//! run; started from power-on; every cast's range proved.

use super::bench::VERIFY_SEED;
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
use serde::Serialize;

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
    start: Option<f64>,
}

/// What a point's verification found.
#[derive(Debug, Clone, PartialEq, Serialize, schemars::JsonSchema)]
pub struct Verified {
    /// What its words add, with other noise than the search had.
    pub figures: Figures,
    /// Casts that can overflow as far as the ranges of the words say, and that of the given design cannot.
    pub overflows: Vec<String>,
    /// Mean error of the output after a start from power-on, less that of the settled circuit, deg/s; none without loops.
    pub startup_error_dps: Option<f64>,
    /// Rows after power-on that were left out of that.
    pub startup_rows: usize,
}

/// Rows that a start-up takes at most.
const LONGEST_START: usize = 20_000;
/// Rows averaged after it.
const AFTER_START: usize = 256;

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
        let figures = self.figures(design)?;
        let mut overflows = unproved(design);
        overflows.retain(|label| !self.unproved.contains(label));
        let started = self.started(design, ArithmeticKind::Fixed)?;
        let startup_error_dps = match (started, self.start) {
            (Some(fixed), Some(float)) => Some(fixed - float - figures.bias_dps),
            _ => None,
        };
        Ok(Verified {
            figures,
            overflows,
            startup_error_dps,
            startup_rows: self.startup_rows(),
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

    fn startup_rows(&self) -> usize {
        rest::settling_rows(self.given).map_or(LONGEST_START, |n| n.min(LONGEST_START))
    }

    /// Mean output after a start from power-on under the plan's middle temperature; `None` without loops.
    fn started(&self, design: &Design, kind: ArithmeticKind) -> Result<Option<f64>> {
        let circuit = &design.circuit;
        if circuit.phase_loop.is_none() && circuit.amplitude_loop.is_none() {
            return Ok(None);
        }
        let rests: Vec<_> = self
            .plan
            .nominal
            .iter()
            .filter(|s| s.role == Role::Rest)
            .collect();
        let Some(stretch) = rests.get(rests.len() / 2) else {
            return Ok(None);
        };
        let mut path = Path::new(design, kind);
        path.start(stretch.conditions);
        path.gyroscope.stop();
        let noise = Noise::new(self.seed, u64::MAX / 2);
        for _ in 0..self.startup_rows() {
            path.period(&noise)?;
        }
        let scale = crate::circuit::scale::full_scale_dps(design);
        let mut sum = 0.0;
        for _ in 0..AFTER_START {
            let row = path.period(&noise)?;
            let [_, _, sense_i, _] = row.channels;
            sum += if row.rate_dps.is_nan() {
                sense_i * scale
            } else {
                row.rate_dps
            };
        }
        Ok(Some(sum / AFTER_START as f64))
    }
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
