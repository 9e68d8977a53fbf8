//! The page of a closure: verdict, steps, residuals, evidence.
//!
//! [`tables`] puts the closure into words, [`figures`] draws on what [`view`] prepares: residuals, and each step's
//! [`contribution`] against the channel that [`curve`] chooses; [`allan`] is the Allan deviation.

pub mod allan;
pub mod contribution;
pub mod curve;
pub mod figures;
pub mod tables;
pub mod view;

#[cfg(test)]
mod page_tests;

use super::figures::Figure;
use crate::closure::close::Closed;
use crate::closure::verdict::Verdict;
use crate::error::{InputError, Result};
use askama::Template;
use tables::{TakenStep, Told};
use view::View;

/// The page.
#[derive(Debug, Template)]
#[template(path = "report/close.html")]
struct Page {
    name: String,
    headline: String,
    finding: String,
    /// Class and text of the verdict's flag.
    flag: [&'static str; 2],
    unit: &'static str,
    /// Model, training rms, held-out rms, largest held-out, held-out rms over the noise floor.
    errors: Vec<[String; 5]>,
    floor: String,
    firmware: String,
    steps: Vec<TakenStep>,
    /// Residuals and steps.
    figures: Vec<Figure>,
    /// The Allan deviation, after the evidence.
    last: Figure,
    evidence: Vec<Told>,
    /// Code, column, message.
    warnings: Vec<[String; 3]>,
    provenance: Vec<[String; 2]>,
}

/// The report as one HTML file; `name` is that of the record.
///
/// # Errors
/// A page that cannot be rendered, which would be a fault of this program.
pub fn html(closed: &Closed, name: &str) -> Result<String> {
    let c = &closed.closure;
    let view = View::new(closed);
    let page = Page {
        name: name.to_owned(),
        headline: tables::headline(c),
        finding: tables::finding(&view),
        flag: match c.verdict {
            Verdict::Complete => ["good", "complete"],
            Verdict::Explained => ["good", "explained"],
            Verdict::PartlyExplained => ["note", "partly explained"],
            Verdict::Unexplained => ["bad", "unexplained"],
        },
        unit: c.unit,
        errors: tables::errors(c),
        floor: tables::value(c.noise_floor_rms),
        firmware: tables::firmware(c),
        steps: tables::steps(closed),
        figures: figures::all(&view),
        last: figures::allan_deviation(&view),
        evidence: tables::evidence(c),
        warnings: c
            .warnings
            .iter()
            .map(|w| {
                let column = w.column.clone().unwrap_or_else(|| "–".to_owned());
                [w.code.to_owned(), column, w.message.clone()]
            })
            .collect(),
        provenance: tables::provenance(closed),
    };
    page.render()
        .map_err(|e| InputError::new(format!("the report cannot be rendered: {e}")).into())
}
