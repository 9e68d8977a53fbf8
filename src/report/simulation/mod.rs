//! The page of a simulation.

pub mod figures;

use super::figure::Figure;
use super::narrow::rendered;
use super::text::{decimals_of, fixed, percent, significant};
use crate::error::Result;
use crate::record::Warning;
use crate::simulation::hunting::{self, Hunting};
use crate::simulation::outcome::{Drift, Outcome};
use askama::Template;

/// The page.
#[derive(Debug, Template)]
#[template(path = "report/simulate.html")]
struct Page {
    name: String,
    headline: String,
    finding: String,
    /// Path, peak to peak, rms, share of before.
    drift: Vec<[String; 4]>,
    /// What, source, published, obtained, by, agrees.
    paper: Vec<([String; 5], bool)>,
    figures: Vec<Figure>,
    /// Loop with the unit of its output, temperature, output (circuit, reduced model), error (circuit, reduced model, at
    /// most), mean.
    loops: Vec<[String; 8]>,
    /// What these columns hold.
    loops_words: Vec<String>,
    /// What the facts are of.
    facts_are: &'static str,
    /// Name, value.
    facts: Vec<[String; 2]>,
    /// How many warnings and notes.
    counted: Option<String>,
    /// Code, label, column, message.
    warnings: Vec<[String; 4]>,
    provenance: Vec<[String; 2]>,
}

/// The report as one HTML file.
///
/// # Errors
/// A page that cannot be rendered, which would be a fault of this program.
pub fn html(outcome: &Outcome) -> Result<String> {
    let s = &outcome.summary;
    let page = Page {
        name: outcome.parts.design.name.clone(),
        headline: headline(outcome),
        finding: format!(
            "{} readings, {}; float and fixed differ by at most {} deg/s{}.",
            s.readings,
            s.mode.replace('_', " "),
            significant(s.float_fixed.rate_out_dps, 2),
            if s.after.is_some() {
                " before compensation"
            } else {
                ""
            }
        ),
        drift: drift(outcome),
        paper: s
            .paper
            .iter()
            .map(|f| {
                let decimals = decimals_of(f.tolerance);
                let value = |v: f64| format!("{} {}", fixed(v, decimals), f.unit);
                let cells = [
                    f.what.to_owned(),
                    f.source.to_owned(),
                    value(f.published),
                    value(f.obtained),
                    f.by.to_owned(),
                ];
                (cells, f.agrees)
            })
            .collect(),
        figures: figures::all(outcome),
        loops: loops(outcome),
        loops_words: hunting::definitions(&outcome.summary.loops),
        facts_are: match (s.fit.is_some(), s.lock.is_some()) {
            (true, true) => "Fit, lock and power-on",
            (true, false) => "Fit and power-on",
            (false, true) => "Lock and power-on",
            (false, false) => "Power-on",
        },
        facts: facts(outcome),
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
        provenance: [
            ("command", s.command.clone()),
            ("version", s.version.to_owned()),
            ("design's SHA-256", s.design_sha256.clone()),
        ]
        .map(|(name, value)| [name.to_owned(), value])
        .to_vec(),
    };
    rendered(&page)
}

fn headline(outcome: &Outcome) -> String {
    let s = &outcome.summary;
    let before = s.before.fixed.drift_pp_dps;
    let drive = s.drive.replace('_', " ");
    match &s.after {
        Some(after) => format!(
            "Drive at {drive}: the rate output at rest drifts by {} deg/s. Compensated in the bit-accurate chain, with a polynomial that \
             was fitted to these readings, it drifts by {} deg/s ({}).",
            significant(before, 4),
            significant(after.fixed.drift_pp_dps, 4),
            percent(after.fixed.drift_pp_dps, before)
        ),
        None => format!(
            "Drive at {drive}: the rate output's error varies by {} deg/s, peak to peak.",
            significant(before, 4)
        ),
    }
}

fn drift(outcome: &Outcome) -> Vec<[String; 4]> {
    let s = &outcome.summary;
    let row = |name: &str, drift: Drift, before: Drift| {
        [
            name.to_owned(),
            fixed(drift.drift_pp_dps, 4),
            fixed(drift.rms_dps, 4),
            percent(drift.drift_pp_dps, before.drift_pp_dps),
        ]
    };
    let before = &s.before;
    let [float, fixed_point] = match &s.after {
        Some(_) => ["before compensation, float", "before compensation, fixed"],
        None => ["not compensated, float", "not compensated, fixed"],
    };
    let mut rows = vec![
        row(float, before.float, before.float),
        row(fixed_point, before.fixed, before.fixed),
    ];
    if let Some(after) = &s.after {
        rows.push(row("after, float", after.float, before.float));
        rows.push(row("after, fixed", after.fixed, before.fixed));
    }
    rows
}

fn loops(outcome: &Outcome) -> Vec<[String; 8]> {
    let row = |h: &Hunting| {
        [
            format!("{}, {}", h.name.replace('_', " "), h.output_unit),
            fixed(h.chamber_degc, 1),
            fixed(h.output_pp_lsb, 0),
            fixed(h.predicted_output_pp_lsb, 0),
            fixed(h.error_pp_lsb, 0),
            fixed(h.predicted_error_pp_lsb, 0),
            fixed(h.most_error_pp_lsb(), 0),
            fixed(h.error_mean_lsb, 3),
        ]
    };
    outcome.summary.loops.iter().map(row).collect()
}

fn facts(outcome: &Outcome) -> Vec<[String; 2]> {
    let s = &outcome.summary;
    let mut facts = Vec::new();
    let mut add = |name: &str, value: String| facts.push([name.to_owned(), value]);
    if let Some(fit) = &s.fit {
        add("thermometer", fit.thermometer.clone());
        add("order", fit.order.to_string());
        add(
            "residual of the fit",
            format!("{} deg/s rms", significant(fit.residual_rms_dps, 3)),
        );
        add("coefficients, raw", format!("{:?}", fit.coefficients_raw));
        for chosen in &fit.chosen {
            add("chosen", chosen.clone());
        }
    }
    if let Some(lock) = &s.lock {
        add(
            "phase loop",
            if lock.locked {
                "locked at every reading"
            } else {
                "not locked everywhere"
            }
            .to_owned(),
        );
        add(
            "mean phase off the setpoint, at most",
            format!("{} rad", significant(lock.phase_error_rad, 2)),
        );
        add(
            "mean frequency off the resonance, at most",
            format!("{} Hz", significant(lock.freq_error_hz, 2)),
        );
        if let Some(tempco) = lock.tempco_ppm_per_k {
            let text = format!("{} ppm/K", significant(tempco, 4));
            add("frequency against temperature", text);
        }
    }
    let time = |t: Option<f64>| {
        t.map_or("not seen".to_owned(), |t| {
            format!("{} ms", significant(1e3 * t, 3))
        })
    };
    add(
        "power-on: amplitude settled, 1 %",
        time(s.startup.amplitude_s),
    );
    add("power-on: phase settled, 0.1 deg", time(s.startup.phase_s));
    if s.lock.is_some() {
        add("power-on: frequency within 10 ppm", time(s.startup.lock_s));
    }
    facts
}
