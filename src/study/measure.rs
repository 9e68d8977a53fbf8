//! What a design puts out over a plan's stretches, and how far that is from the float twin.

use super::scenario::{Plan, Stretch, detuned};
use crate::circuit::engine::ArithmeticKind;
use crate::circuit::scale::full_scale_dps;
use crate::cosim::path::Path;
use crate::design::Design;
use crate::error::Result;

/// The rate of every row, deg/s, by stretch: the nominal ones, then the detuned one.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Output {
    /// deg/s.
    pub rates_dps: Vec<Vec<f64>>,
}

/// Runs a design over a plan. Without a rate in its chain the output is sense I in deg/s.
///
/// # Errors
/// An overflow where the design says `error`; a phase loop that cannot lock.
pub fn run(design: &Design, kind: ArithmeticKind, plan: &Plan) -> Result<Output> {
    let mut output = Output::default();
    let mut path = Path::new(design, kind);
    for stretch in &plan.nominal {
        output
            .rates_dps
            .push(stretch_of(design, &mut path, stretch)?);
    }
    if let Some(stretch) = &plan.detuned {
        let design = detuned(design, plan.detuned_hz);
        let mut path = Path::new(&design, kind);
        output
            .rates_dps
            .push(stretch_of(&design, &mut path, stretch)?);
    }
    Ok(output)
}

fn stretch_of(design: &Design, path: &mut Path, stretch: &Stretch) -> Result<Vec<f64>> {
    let scale = full_scale_dps(design);
    path.warm_start(design, stretch.conditions, &stretch.noise)?;
    let mut rates = Vec::with_capacity(stretch.rows);
    for _ in 0..stretch.rows {
        let row = path.period(&stretch.noise)?;
        let [_, _, sense_i, _] = row.channels;
        rates.push(if row.rate_dps.is_nan() {
            sense_i * scale
        } else {
            row.rate_dps
        });
    }
    Ok(rates)
}
