//! What the page of `run` shows.

use crate::design::Design;
use crate::job::coefficients::Rounded;
use crate::job::outcome::{Points, Summary};
use crate::thermal::BaselineFit;

/// What the report is made from.
#[derive(Debug, Clone, Copy)]
pub struct Shown<'a> {
    /// For machines.
    pub summary: &'a Summary,
    /// With coefficients, formats and calibrated range filled in.
    pub design: &'a Design,
    /// The fit.
    pub fit: &'a BaselineFit,
    /// The coefficients in their formats.
    pub rounded: &'a Rounded,
    /// Formats that were chosen, with the reason.
    pub chosen: &'a [String],
    /// Readings.
    pub points: &'a Points,
    /// Compilers with their flags: C, Rust.
    pub toolchains: [&'a str; 2],
    /// LSB of the output, deg/s.
    pub output_lsb: f64,
}

impl Shown<'_> {
    /// True if the firmware limits its input to the calibrated range.
    pub fn is_clamped(&self) -> bool {
        let c = self.design.compensation.as_ref();
        c.is_some_and(|c| c.clamp_raw.is_some())
    }
}
