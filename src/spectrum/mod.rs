//! Spectra of the circuit's words. [`nco`] measures the oscillator's spurs and holds them against
//! what `truncation` predicts; `lines` finds spectral lines with their level and frequency.

mod lines;
pub mod nco;
mod truncation;

#[cfg(test)]
mod nco_tests;

pub use nco::{NcoSpurs, nco_spurs};
pub use truncation::{Predicted, TruncationSpur};
