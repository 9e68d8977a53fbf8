//! What the template prints: every number as text with its digits, every sentence put together.

use super::Shown;
use super::figure::Figure;
use super::figures;
use super::tables;
use super::text::{bounding, decimals_of, fixed, grouped, percent, significant};
use crate::digest::sha256;
use crate::job::fitted_design;
use crate::job::outcome::{Drift, not_fitted, single_readings};
use crate::output::name_of;
use crate::record::Warning;
use crate::verify::compare::Compared;
use askama::Template;

/// Both languages, as [`Summary::built`](crate::job::outcome::Summary::built) names them.
const BOTH: &str = "C and Rust";

/// The page.
#[derive(Debug, Template)]
#[template(path = "report/run.html")]
pub struct Page {
    /// The design's name.
    pub name: String,
    /// What came of it, in a sentence.
    pub headline: String,
    /// True if emitted code and model agree everywhere.
    pub holds: bool,
    /// The languages that were built and compared.
    pub built: &'static str,
    /// The same with the model, as equal things.
    pub equal: String,
    /// What limits the result, in a sentence.
    pub finding: String,
    /// Drift by path: name, peak to peak, rms, share of before.
    pub drift: Vec<[String; 4]>,
    /// Largest distance of fixed and float, deg/s.
    pub apart: String,
    /// The figures.
    pub figures: Vec<Figure>,
    /// What, deg/s, output LSB, kind.
    pub budget: Vec<[String; 4]>,
    /// The sums in the same layout.
    pub budget_sums: Vec<[String; 4]>,
    /// The bias against the fit, in sentences.
    pub certainty: Vec<String>,
    /// Forms that keep to the design's bound; empty without one.
    pub alternatives: Vec<Alternative>,
    /// The fit: name, value.
    pub fit: Vec<[String; 2]>,
    /// Orders that were tried.
    pub orders: Vec<Order>,
    /// Unit of the first column of coefficients.
    pub unit: String,
    /// The firmware's variable in words.
    pub variable: String,
    /// Format of the coefficients.
    pub format: String,
    /// Coefficients: order, physical, of the variable, raw, rounding error.
    pub coefficients: Vec<[String; 5]>,
    /// Formats: name, value.
    pub formats: Vec<[String; 2]>,
    /// Why they were chosen.
    pub chosen: Vec<String>,
    /// Emitted code against the model.
    pub equivalence: Vec<Equivalent>,
    /// Words and mismatches in all.
    pub equivalence_sum: [String; 2],
    /// How many warnings and notes.
    pub counted: Option<String>,
    /// Code, label, column, message.
    pub warnings: Vec<[String; 4]>,
    /// Name, value.
    pub provenance: Vec<[String; 2]>,
    /// Path, SHA-256.
    pub emitted: Vec<[String; 2]>,
    /// Where the guarantee stops.
    pub limits: Vec<String>,
}

/// An order that was tried.
#[derive(Debug)]
pub struct Order {
    /// The order.
    pub order: usize,
    /// Whether it is the one.
    pub used: bool,
    /// In-sample, held-out, held-out without spikes.
    pub rms: [String; 3],
}

/// A form that keeps to the design's bound.
#[derive(Debug)]
pub struct Alternative {
    /// In words.
    pub detail: String,
    /// ROM, multiplications, additions, cycles, certified error in deg/s and in output LSB.
    pub numbers: [String; 6],
    /// The firmware's.
    pub chosen: bool,
    /// `chosen`, `not beaten` or nothing.
    pub mark: &'static str,
}

/// A line of the comparison.
#[derive(Debug)]
pub struct Equivalent {
    /// Function, table or chain.
    pub name: String,
    /// `C`, `Rust`.
    pub language: String,
    /// How many.
    pub inputs: String,
    /// Whether those are all.
    pub coverage: &'static str,
    /// How many.
    pub words: String,
    /// How many.
    pub mismatches: String,
    /// Whether there are none.
    pub same: bool,
    /// In words.
    pub first: String,
}

impl Equivalent {
    /// A comparison's line.
    pub fn of(c: &Compared) -> Self {
        Equivalent {
            name: c.name.clone(),
            language: language(c.language),
            inputs: grouped(c.inputs),
            coverage: if c.exhaustive { "all" } else { "sample" },
            words: grouped(c.compared),
            mismatches: grouped(c.mismatches),
            same: c.mismatches == 0,
            first: c.first.clone().unwrap_or_else(|| "–".to_owned()),
        }
    }
}

impl Page {
    /// Formats everything.
    pub fn new(shown: &Shown) -> Self {
        let s = shown.summary;
        Page {
            name: shown.design.name.clone(),
            headline: headline(shown),
            holds: s.equivalence.mismatches == 0,
            built: s.built(),
            equal: format!(
                "model = emitted {}",
                s.built().replace(" and ", " = emitted ")
            ),
            finding: s.finding.clone(),
            drift: drift(shown),
            apart: significant(s.equivalence.fixed_minus_float_max_dps, 3),
            figures: figures::all(shown),
            budget: s
                .budget
                .lines
                .iter()
                .map(|l| budget_line(&l.what, l.dps, shown, l.kind))
                .collect(),
            budget_sums: vec![
                budget_line("sum of the bounds", s.budget.bound_dps, shown, "bound"),
                budget_line(
                    "root sum square of the estimates",
                    s.budget.estimate_dps,
                    shown,
                    "estimate",
                ),
            ],
            certainty: s.certainty_text.clone(),
            alternatives: tables::alternatives(shown),
            fit: tables::fit(shown),
            orders: tables::orders(shown),
            unit: shown.fit.unit.to_owned(),
            variable: tables::variable(shown),
            format: s.fit.coefficient_format.clone(),
            coefficients: tables::coefficients(shown),
            formats: tables::formats(shown),
            chosen: shown.chosen.to_vec(),
            equivalence: equivalence(shown),
            equivalence_sum: [
                grouped(s.equivalence.compared),
                grouped(s.equivalence.mismatches),
            ],
            counted: Warning::counted(&s.warnings),
            warnings: s
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
            provenance: provenance(shown),
            emitted: s
                .emitted
                .iter()
                .map(|e| [e.path.clone(), e.sha256.clone()])
                .collect(),
            limits: limits(shown),
        }
    }
}

/// "1 mismatch", "0 mismatches".
fn mismatches(count: u64) -> String {
    let plural = if count == 1 { "" } else { "es" };
    format!("{} mismatch{plural}", grouped(count))
}

fn headline(shown: &Shown) -> String {
    let s = shown.summary;
    let (before, after) = (s.before.drift_pp_dps, s.after.fixed.drift_pp_dps);
    // Three digits of the smaller figure, and as many decimals of the other.
    let digits = 2.0 - before.min(after).max(f64::MIN_POSITIVE).log10().floor();
    let decimals = digits.clamp(0.0, decimals_of(shown.output_lsb) as f64) as usize;
    let change = if after <= before { "falls" } else { "rises" };
    let verdict = match (s.equivalence.mismatches == 0, s.built() == BOTH) {
        (true, true) => "carry",
        (true, false) => "carries",
        (false, true) => "do not carry",
        (false, false) => "does not carry",
    };
    let drift = not_fitted(s).map(|said| format!("{said} The"));
    let drift = drift.unwrap_or_else(|| {
        format!(
            "Bias drift over temperature {change} from {} to {} deg/s peak to peak ({} of what it was; means over bins of temperature), \
             computed in fixed point{}",
            fixed(before, decimals),
            fixed(after, decimals),
            percent(after, before),
            match single_readings(s, shown.points) {
                Some(said) => format!(". {said} The"),
                None => "; the".to_owned(),
            }
        )
    });
    format!(
        "{drift} emitted {} {verdict} the model's bits: {} in {} words compared. Left over, rms: {}.",
        s.built(),
        mismatches(s.equivalence.mismatches),
        grouped(s.equivalence.compared),
        s.word_lengths.clause(s.fit.heldout_rms_dps)
    )
}

fn drift(shown: &Shown) -> Vec<[String; 4]> {
    let s = shown.summary;
    // Four digits of the smallest figure, no more than the output has.
    let least = [s.before, s.after.float, s.after.fixed]
        .iter()
        .fold(f64::INFINITY, |m, d| m.min(d.rms_dps).min(d.drift_pp_dps));
    let digits = 3.0 - least.max(f64::MIN_POSITIVE).log10().floor();
    let decimals = digits.clamp(0.0, decimals_of(shown.output_lsb) as f64) as usize;
    let share = |d: Drift| {
        let text = percent(d.drift_pp_dps, s.before.drift_pp_dps);
        text.trim_end_matches("\u{202f}%").to_owned()
    };
    let line = |name: &str, d: Drift| {
        [
            name.to_owned(),
            fixed(d.drift_pp_dps, decimals),
            fixed(d.rms_dps, decimals),
            share(d),
        ]
    };
    let mut lines = vec![
        line("before compensation", s.before),
        line("after, float model", s.after.float),
        line("after, fixed-point model", s.after.fixed),
    ];
    lines.extend(s.after.c.map(|drift| line("after, emitted C", drift)));
    lines.extend(s.after.rust.map(|drift| line("after, emitted Rust", drift)));
    lines
}

fn budget_line(what: &str, dps: f64, shown: &Shown, kind: &str) -> [String; 4] {
    let lsb = dps / shown.output_lsb;
    let shown = |v: f64| match kind {
        "bound" => bounding(v, 3),
        _ => significant(v, 3),
    };
    [what.to_owned(), shown(dps), shown(lsb), kind.to_owned()]
}

fn equivalence(shown: &Shown) -> Vec<Equivalent> {
    let e = &shown.summary.equivalence;
    let mut lines: Vec<Equivalent> = e.functions.iter().map(Equivalent::of).collect();
    let counted: u64 = e.functions.iter().map(|c| c.mismatches).sum();
    let on_record = e.mismatches.saturating_sub(counted);
    let differing = shown.points.iter().find(|p| p.differs());
    lines.push(Equivalent {
        name: "readings of the record".to_owned(),
        language: "C, Rust".to_owned(),
        inputs: grouped(shown.points.len() as u64),
        coverage: "sample",
        words: "not counted".to_owned(),
        mismatches: grouped(on_record),
        same: on_record == 0,
        first: differing.map_or("–".to_owned(), |p| {
            let [time, fixed] = [p.time_s, p.fixed_dps].map(reading);
            let [c, rust] = p.emitted(reading);
            format!("at {time} s: fixed {fixed}, C {c}, Rust {rust} deg/s")
        }),
    });
    lines
}

/// All digits of a reading.
fn reading(value: f64) -> String {
    if value.is_finite() {
        value.to_string()
    } else {
        "none".to_owned()
    }
}

fn language(name: &str) -> String {
    match name {
        "c" => "C".to_owned(),
        "rust" => "Rust".to_owned(),
        other => other.to_owned(),
    }
}

fn provenance(shown: &Shown) -> Vec<[String; 2]> {
    let s = shown.summary;
    let line = |name: &str, value: String| [name.to_owned(), value];
    let own = "the design's own thermal run, simulated (record.csv in the output folder)";
    let path = shown.design.source.path.as_ref();
    vec![
        line("command", s.command.clone()),
        line("gyrogen", s.version.to_owned()),
        line(
            "design",
            path.map_or("embedded default".to_owned(), |p| name_of(p)),
        ),
        line("SHA-256 of the design as read", s.design_sha256.clone()),
        line(
            "SHA-256 of design.toml",
            sha256(fitted_design::text(shown.design).as_bytes()),
        ),
        line("record", s.record.clone().unwrap_or_else(|| own.to_owned())),
        line("C compiler and flags", shown.toolchains[0].to_owned()),
        line("Rust compiler and flags", shown.toolchains[1].to_owned()),
    ]
}

fn limits(shown: &Shown) -> Vec<String> {
    let built = shown.summary.built();
    let bits = if shown.summary.equivalence.mismatches == 0 {
        format!(
            "The bits of the model and of the emitted {built} are equal on the inputs that were compared: on \
             every input there is where the table says all, elsewhere on corner cases, pseudo-random words \
             and the record, and nothing is claimed beyond them."
        )
    } else {
        format!(
            "The bits of the model and of the emitted {built} differ on at least one of the inputs that were \
             compared: do not use this firmware."
        )
    };
    let compilers = "This holds for the compilers and flags listed under provenance; for another compiler, \
         other flags or a target processor, run the self-test that is emitted with the firmware there.";
    let plant = if shown.summary.record.is_some() {
        "The drift figures are those of this one record within its calibrated range; the bias polynomial \
         is a model of the device, and another profile, another unit or an aged one may drift otherwise."
    } else {
        "The drift figures come from a simulated gyro: the plant is a model, and they say nothing of a \
         device until a record of it has been run."
    };
    vec![bits, compilers.to_owned(), plant.to_owned()]
}

#[cfg(test)]
#[path = "page_tests.rs"]
mod tests;
