//! The HTML report: one file that needs nothing else, for people.
//!
//! [`page`] and [`tables`] turn an outcome into what the template prints, [`figures`] draws it on
//! what [`scene`] prepares, [`svg`] with [`axis`] is the plot writer under the figures, [`text`]
//! formats numbers; [`simulation`] is the page of `simulate`, [`closure`] that of `close`, [`capture`] that of `close --capture`, [`design_diff`] what a closure changes in the design, [`selftest`] that of its self-test, [`study`] that of a word-length study. Colours and layout are in `templates/report/`.

pub mod axis;
pub mod capture;
pub mod closure;
pub mod design_diff;
pub mod figures;
pub mod page;
pub mod scene;
pub mod selftest;
pub mod simulation;
pub mod study;
pub mod svg;
pub mod tables;
pub mod text;

use crate::design::Design;
use crate::error::{InputError, Result};
use crate::job::coefficients::Rounded;
use crate::job::outcome::{Outcome, Point, Summary};
use crate::thermal::BaselineFit;
use askama::Template;

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
    pub points: &'a [Point],
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

/// The report as one HTML file.
///
/// # Errors
/// A page that cannot be rendered, which would be a fault of this program.
pub fn html(outcome: &Outcome) -> Result<String> {
    let parts = &outcome.parts;
    let compensation = parts.design.compensation.as_ref();
    render(&Shown {
        summary: &outcome.summary,
        design: &parts.design,
        fit: &parts.fit,
        rounded: &parts.rounded,
        chosen: &parts.chosen,
        points: &parts.points,
        toolchains: [
            &parts.firmware.c.harness.toolchain,
            &parts.firmware.rust.harness.toolchain,
        ],
        output_lsb: compensation.map_or(f64::NAN, |c| c.output.format.lsb()),
    })
}

fn render(shown: &Shown) -> Result<String> {
    let page = page::Page::new(shown).render();
    page.map_err(|e| InputError::new(format!("the report cannot be rendered: {e}")).into())
}
