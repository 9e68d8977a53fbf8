//! Decimated samples: how they are stored, and which columns a design's have.

use crate::design::Design;

/// Decimated samples, row after row, in the columns of [`columns`]. An engine appends to the kind that its
/// [`no_rows`](super::engine::Engine::no_rows) gives.
#[derive(Debug, Clone, PartialEq)]
pub enum Rows {
    /// Raw integers, where all words of the decimated rate have at most 64 bits.
    Integer(Vec<i64>),
    /// Raw integers, where some have more.
    Wide(Vec<i128>),
    /// Real values: 1, turns, deg/s, Hz.
    Real(Vec<f64>),
}

impl Rows {
    /// Removes all rows and keeps their memory.
    pub fn clear(&mut self) {
        match self {
            Rows::Integer(words) => words.clear(),
            Rows::Wide(words) => words.clear(),
            Rows::Real(values) => values.clear(),
        }
    }

    /// All raw integers in 128 bits; `None` of real values.
    pub fn raw(&self) -> Option<Vec<i128>> {
        match self {
            Rows::Integer(words) => Some(words.iter().map(|word| i128::from(*word)).collect()),
            Rows::Wide(words) => Some(words.clone()),
            Rows::Real(_) => None,
        }
    }
}

/// The columns of a row after `index`, in the contract's order.
pub fn columns(design: &Design) -> Vec<&'static str> {
    let mut columns = super::CHANNELS.to_vec();
    columns.extend(["phase", "magnitude"]);
    if has_rate(design) {
        columns.push("rate");
    }
    if design.circuit.phase_loop.is_some() {
        columns.push("tuning_word");
    }
    if design.circuit.amplitude_loop.is_some() {
        columns.push("gain");
    }
    if has_rate(design) && is_flagged(design) {
        columns.push("in_range");
    }
    columns
}

fn has_rate(design: &Design) -> bool {
    design
        .compensation
        .as_ref()
        .is_some_and(|c| c.input.is_of_chain())
}

fn is_flagged(design: &Design) -> bool {
    let compensation = design.compensation.as_ref();
    compensation.is_some_and(|c| c.flagged_range().is_some())
}
