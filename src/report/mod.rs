//! The HTML report: one file that needs nothing else, for people.
//!
//! [`page`] and [`tables`] turn an outcome into what the template prints, [`figures`] draws it on
//! what [`scene`] prepares, [`svg`] with [`axis`] and `frame` is the plot writer under the figures, [`figure`] puts legend, drawing and data
//! together, `density` draws many points, [`text`] formats numbers; [`simulation`] is the page of `simulate`, [`closure`] that of `close`, [`capture`] that of `close --capture`, [`design_diff`] what a closure changes in the design, [`equivalence`] that of `equiv`, [`approx`] that of `approx`, [`selftest`] that of its self-test, [`study`] that of a word-length study. Colours and layout are in `templates/report/`.

pub mod approx;
pub mod axis;
pub mod capture;
pub mod closure;
mod density;
pub mod design_diff;
pub mod equivalence;
pub mod figure;
pub mod figures;
mod frame;
mod marks;
mod narrow;
pub mod page;
pub mod scene;
pub mod selftest;
mod shown;
pub mod simulation;
pub mod study;
pub mod svg;
pub mod tables;
pub mod text;

use crate::emit::views::Language;
use crate::error::Result;
use crate::job::outcome::Outcome;
use narrow::rendered;
pub use shown::Shown;

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
            parts.firmware.toolchain(Language::C),
            parts.firmware.toolchain(Language::Rust),
        ],
        output_lsb: compensation.map_or(f64::NAN, |c| c.output.format.lsb()),
    })
}

fn render(shown: &Shown) -> Result<String> {
    rendered(&page::Page::new(shown))
}
