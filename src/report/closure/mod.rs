//! The page of a closure: verdict, steps, residuals, evidence.
//!
//! [`tables`] puts the closure into words, [`figures`] draws on what [`view`] prepares: residuals, and each step's
//! [`contribution`] against the channel that [`curve`] chooses; [`allan`] is the Allan deviation, [`weighed`] what lost and what to measure next,
//! [`controls`] are those of `--controls` in words.

pub mod allan;
pub mod contribution;
pub mod controls;
pub mod curve;
pub mod figures;
pub mod tables;
pub mod view;
pub mod weighed;

#[cfg(test)]
mod page_tests;

use super::design_diff::{DesignDiff, Line};
use super::figure::Figure;
use super::narrow::rendered;
use super::page::Equivalent;
use super::text::grouped;
use crate::error::Result;
use crate::record::Warning;
use crate::selftest::controls::Controls;
use crate::thermal::close::Closed;
use crate::thermal::firmware::emitted::Emitted;
use crate::verdict::{Closure, Verdict};
use askama::Template;
use tables::{TakenStep, Told};
use view::View;

/// The page.
#[derive(Debug, Template)]
#[template(path = "report/close.html")]
struct Page {
    name: String,
    headline: String,
    /// What the causes are found beside.
    base: &'static str,
    /// Class and text of the verdict's flag.
    flag: [&'static str; 2],
    unit: &'static str,
    /// Model, training rms, held-out rms, largest held-out, held-out rms over the noise floor.
    errors: Vec<[String; 5]>,
    evidence: Vec<Told>,
    /// The candidates that came nearest.
    weighed: Option<Figure>,
    /// What to measure where something is left.
    measure: Vec<String>,
    /// How many warnings and notes.
    counted: Option<String>,
    /// Code, label, column, message.
    warnings: Vec<[String; 4]>,
    own: Own,
}

/// What the pages of records and of captures each say in their own way.
#[derive(Debug)]
pub struct Own {
    /// What follows from the verdict.
    pub finding: String,
    /// Over the table of errors.
    pub lead: String,
    /// Whether there is a channel that is neither the thermometer nor time.
    pub has_others: bool,
    /// In order.
    pub steps: Vec<TakenStep>,
    /// Residuals and steps.
    pub figures: Vec<Figure>,
    /// After the figures.
    pub emitted: Option<Comparison>,
    /// What the closure changes in the design.
    pub diff: Option<Changes>,
    /// What names and silence are worth.
    pub controls: Option<controls::Shown>,
    /// After the evidence; in its place a sentence that says why there is none, or nothing.
    pub last: std::result::Result<Figure, String>,
    /// Name and value.
    pub provenance: Vec<[String; 2]>,
}

/// What was asked for beside the closure.
#[derive(Debug, Clone, Copy, Default)]
pub struct Beside<'a> {
    /// Emitted code against the model.
    pub emitted: Option<&'a Emitted>,
    /// Controls.
    pub controls: Option<&'a Controls>,
    /// The design with the correction beside that without.
    pub diff: Option<&'a DesignDiff>,
}

/// What the closure changes in the design.
#[derive(Debug)]
pub struct Changes {
    /// How much.
    sentence: String,
    /// The diff.
    lines: Vec<Line>,
}

/// Emitted code against the model.
#[derive(Debug)]
pub struct Comparison {
    /// What was compared.
    lead: String,
    /// A line each.
    equivalence: Vec<Equivalent>,
    /// Words and mismatches.
    sum: [String; 2],
    /// Without a mismatch.
    holds: bool,
}

impl Comparison {
    fn of(e: &Emitted) -> Self {
        let (readings, [c, rust]) = (grouped(e.readings), &e.toolchains);
        Comparison {
            lead: format!(
                "The whole record, {readings} readings, through the emitted C and Rust, built and run here, against the \
                 model's fixed-point block: the result and the fault of every call, with those for the readings between \
                 rows where the correction has a memory. Where nothing differs, the firmware's errors above are those of \
                 the emitted code. Built with {c}; {rust}.",
            ),
            equivalence: e.functions.iter().map(Equivalent::of).collect(),
            sum: [grouped(e.words_compared), grouped(e.mismatches)],
            holds: e.mismatches == 0,
        }
    }
}

/// The report as one HTML file; `name` is that of the record.
///
/// # Errors
/// A page that cannot be rendered, which would be a fault of this program.
pub fn html(closed: &Closed, name: &str) -> Result<String> {
    html_beside(closed, &Beside::default(), name)
}

/// The same with what was asked for beside.
///
/// # Errors
/// As [`html`].
pub fn html_beside(closed: &Closed, beside: &Beside<'_>, name: &str) -> Result<String> {
    let c = &closed.closure;
    let view = View::new(closed);
    let lead = format!(
        "Output less applied rate and less the model. Held-out rows are whole stretches of time that no estimate has \
         seen. The noise floor, from differences of neighbouring rows, is {} {} rms. {}",
        tables::value(c.noise_floor_rms),
        c.unit_text(),
        tables::firmware(c)
    );
    let own = Own {
        finding: tables::finding(&view),
        has_others: closed.channels.columns.keys().any(|name| name != "time_s"),
        lead,
        steps: tables::steps(closed),
        figures: figures::all(&view),
        emitted: beside.emitted.map(Comparison::of),
        diff: beside.diff.map(|diff| Changes {
            sentence: diff.sentence(),
            lines: diff.lines(),
        }),
        controls: beside.controls.map(controls::Shown::of),
        last: allan::figure(&view),
        provenance: tables::provenance(closed),
    };
    page(c, name, own)
}

/// The page around what is its own.
///
/// # Errors
/// A page that cannot be rendered, which would be a fault of this program.
pub fn page(c: &Closure, name: &str, own: Own) -> Result<String> {
    let page = Page {
        name: name.to_owned(),
        headline: tables::headline(c),
        base: tables::base(c),
        flag: match c.verdict {
            Verdict::Complete => ["good", "complete"],
            Verdict::Explained => ["good", "explained"],
            Verdict::PartlyExplained => ["note", "partly explained"],
            Verdict::Unexplained => ["bad", "unexplained"],
        },
        unit: c.unit_text(),
        errors: tables::errors(c),
        evidence: tables::evidence(c),
        weighed: weighed::figure(c),
        measure: weighed::measure_next(c, own.has_others),
        counted: Warning::counted(&c.warnings),
        warnings: c
            .warnings
            .iter()
            .map(|w| {
                let column = w.column.clone().unwrap_or_else(|| "–".to_owned());
                [
                    w.code.to_owned(),
                    w.label().to_owned(),
                    column,
                    w.message.clone(),
                ]
            })
            .collect(),
        own,
    };
    rendered(&page)
}
