//! Plant and circuit in closed loop at the ADC rate, float and fixed.
//!
//! The circuit's oscillator and drive gain excite the gyro, whose two inputs go through the ADCs
//! into the circuit, sample by sample. Inside a decimation period the loops do not act, so plant and
//! circuit take turns in blocks of R samples.
//!
//! In reading order: [`path`] (one circuit around one gyro; [`inexact`]: what is between them), [`rest`] (where the loops come to
//! rest, and how fast: warm starts), [`surroundings`] (what acts on the gyro at a time), [`readings`] (averaged
//! readings, each warm-started by itself), [`stream`] (the same in one unbroken stream of codes).

pub mod inexact;
pub mod path;
pub mod readings;
pub mod rest;
pub mod stream;
pub mod surroundings;

pub use crate::circuit::scale;
pub use path::{Path, RealRow};

#[cfg(test)]
mod tests;
