//! The chain's rows as emitted code has to give them.

use crate::circuit::engine::{self, ArithmeticKind, Rows};
use crate::design::Design;

/// Rows of the model, where `error` saturates and goes on as the emitted code does.
pub fn saturating_rows(design: &Design, drive: &[i32], sense: &[i32]) -> Vec<i128> {
    let design = design.without_stops();
    let mut engine = engine::engine(&design, ArithmeticKind::Fixed);
    let mut rows = engine.no_rows();
    // No cast stops this run.
    let _ = engine.process(drive, sense, &mut rows);
    match rows {
        Rows::Integer(words) => words,
        Rows::Real(_) => Vec::new(),
    }
}

/// The model's rows, each with the number of the fault so far as its last word.
pub fn expected_rows(design: &Design, drive: &[i32], sense: &[i32]) -> Vec<Vec<i128>> {
    let columns = engine::columns(design).len();
    let ratio = design.circuit.decimator.ratio as u64;
    let mut watching = engine::engine(design, ArithmeticKind::Fixed);
    let mut rows = watching.no_rows();
    let stopped = watching.process(drive, sense, &mut rows).err();
    saturating_rows(design, drive, sense)
        .chunks_exact(columns)
        .enumerate()
        .map(|(k, row)| {
            let end = (k as u64 + 1) * ratio;
            let noted = stopped.as_ref().filter(|o| o.sample < end);
            let fault = noted.map_or(0, |o| o.cast + 1);
            row.iter().copied().chain([fault as i128]).collect()
        })
        .collect()
}
