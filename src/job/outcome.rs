//! What the main job comes to: `summary.json` and everything that the report shows.

use super::bound::Kept;
use super::budget::Budget;
use super::coefficients::Rounded;
pub use super::points::{Point, Points};
use super::word_lengths::WordLengths;
use super::{drift_pp, rms};
use crate::compensation::certainty;
use crate::compensation::certainty::{Certainty, OfRun};
use crate::design::Design;
use crate::digest::sha256;
use crate::output::name_of;
use crate::record::Warning;
use crate::record::thermal::ENOUGH_ROWS;
use crate::text::number;
use crate::thermal::BaselineFit;
use crate::thermal::no_gain;
use crate::verify::compare::Compared;
use crate::verify::firmware::Firmware;
use serde::Serialize;
use std::path::PathBuf;

/// What an outcome is made of.
#[derive(Debug)]
pub struct Parts {
    /// With coefficients, formats and calibrated range filled in.
    pub design: Design,
    /// The command.
    pub command: String,
    /// The record, if it was measured.
    pub record_path: Option<PathBuf>,
    /// Its columns with their units, and its rows, as they were understood.
    pub understood: Option<[String; 2]>,
    /// The record, if it was simulated.
    pub record_csv: Option<String>,
    /// The fit.
    pub fit: BaselineFit,
    /// Of the record, as its reader said them.
    pub of_record: Vec<Warning>,
    /// Of record and fit.
    pub warnings: Vec<Warning>,
    /// Formats that were chosen for the design, with the reason; empty if it had its own.
    pub chosen: Vec<String>,
    /// The coefficients in their formats.
    pub rounded: Rounded,
    /// What each step costs.
    pub budget: Budget,
    /// How the design's bound is kept, if it has one.
    pub kept: Option<Kept>,
    /// The bias against the fit, proved and run.
    pub certainty: Certainty,
    /// Emitted and built.
    pub firmware: Firmware,
    /// Against the model.
    pub compared: Vec<Compared>,
    /// Readings.
    pub points: Points,
    /// What the word lengths do to them.
    pub word_lengths: WordLengths,
}

/// `summary.json` (`gyrogen.run/1`).
#[derive(Debug, Clone, Serialize, schemars::JsonSchema)]
pub struct Summary {
    /// `gyrogen.run/1`.
    pub schema: &'static str,
    /// Of the tool.
    pub version: &'static str,
    /// Of the design's text as read; the firmware names that of `design.toml` beside it, which has the fit.
    pub design_sha256: String,
    /// The command.
    pub command: String,
    /// The record's file; null for the design's own run.
    pub record: Option<String>,
    /// Not compensated.
    pub before: Drift,
    /// Compensated.
    pub after: After,
    /// after.fixed / before, peak to peak.
    pub ratio: f64,
    /// The fit.
    pub fit: FitSummary,
    /// Formats that were chosen, with the reason; empty if the design's own were used.
    pub chosen: Vec<String>,
    /// What limits the result: the fit, the word lengths, which of them most.
    pub finding: String,
    /// Fixed less float over the readings, and by which word.
    pub word_lengths: WordLengths,
    /// What each step of the compensation costs.
    pub budget: Budget,
    /// The emitted bias against the fitted polynomial: proved, and run over the calibrated inputs.
    pub certainty: Certainty,
    /// How `compensation.bound_dps` is kept.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub bound: Option<Kept>,
    /// The same in words.
    pub certainty_text: Vec<String>,
    /// Emitted code against the model.
    pub equivalence: Equivalence,
    /// The firmware's files.
    pub emitted: Vec<Emitted>,
    /// What the user should know of.
    pub warnings: Vec<Warning>,
}

impl Summary {
    /// The languages whose emitted code was built and compared, in words.
    pub fn built(&self) -> &'static str {
        match (self.after.c.is_some(), self.after.rust.is_some()) {
            (true, false) => "C",
            (false, true) => "Rust",
            _ => "C and Rust",
        }
    }
}

/// How far the rate output drifts over the record.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, schemars::JsonSchema)]
pub struct Drift {
    /// Greatest minus least mean over bins of the thermometer, deg/s.
    pub drift_pp_dps: f64,
    /// Root mean square over all readings, deg/s.
    pub rms_dps: f64,
}

/// After compensation, by path.
#[derive(Debug, Clone, Serialize, schemars::JsonSchema)]
pub struct After {
    /// `f64`, the fit's own coefficients.
    pub float: Drift,
    /// Bit-accurate model.
    pub fixed: Drift,
    /// Emitted code (C and Rust, the larger figure).
    pub emitted: Drift,
    /// Emitted C; absent where it was not built.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub c: Option<Drift>,
    /// Emitted Rust.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub rust: Option<Drift>,
}

/// The fit in numbers.
#[derive(Debug, Clone, Serialize, schemars::JsonSchema)]
pub struct FitSummary {
    /// The record's column.
    pub thermometer: String,
    /// Its unit.
    pub unit: String,
    /// Calibrated range in that unit.
    pub range: (f64, f64),
    /// Of the polynomial.
    pub order: usize,
    /// Why this order.
    pub reason: String,
    /// Lowest first, deg/s over powers of the thermometer's unit.
    pub coefficients: Vec<f64>,
    /// In the firmware's variable and formats.
    pub coefficients_raw: Vec<i128>,
    /// Of those.
    pub coefficient_format: String,
    /// Over the rows that were fitted, deg/s.
    pub in_sample_rms_dps: f64,
    /// Over held-out blocks, deg/s.
    pub heldout_rms_dps: f64,
    /// Over held-out blocks, deg/s.
    pub heldout_max_abs_dps: f64,
    /// What no smooth model can remove, deg/s.
    pub noise_floor_rms_dps: f64,
    /// Rows with a spike.
    pub outliers: usize,
}

/// Emitted code against the model.
#[derive(Debug, Clone, Serialize, schemars::JsonSchema)]
pub struct Equivalence {
    /// Output words.
    pub compared: u64,
    /// Inputs with a difference.
    pub mismatches: u64,
    /// By table, function and chain.
    pub functions: Vec<Compared>,
    /// Largest distance of the fixed from the float path over the record, deg/s.
    pub fixed_minus_float_max_dps: f64,
}

/// An emitted file.
#[derive(Debug, Clone, Serialize, schemars::JsonSchema)]
pub struct Emitted {
    /// Inside the output folder.
    pub path: String,
    /// Lower-case hexadecimal.
    pub sha256: String,
}

/// The main job's result.
#[derive(Debug)]
pub struct Outcome {
    /// For machines.
    pub summary: Summary,
    /// For the report.
    pub parts: Parts,
}

/// By how much single readings are off where heating and cooling differ, or may, which means over bins of temperature do
/// not show; `None` without the warning that says so.
pub fn single_readings(summary: &Summary, points: &Points) -> Option<String> {
    let differ = summary.warnings.iter().find_map(|w| match w.code {
        "heating_cooling_loop" => Some("differ"),
        "loop_or_slow_noise" => Some("may differ (see the warning)"),
        _ => None,
    })?;
    let largest = points.iter().map(|p| p.fixed_dps.abs());
    Some(format!(
        "Heating and cooling {differ}, and the drift is that of their average: single readings are off by {} deg/s rms and by \
         up to {} deg/s after compensation.",
        number(summary.after.fixed.rms_dps, 3),
        number(largest.fold(0.0, f64::max), 3)
    ))
}

/// What stands for the drift over temperature where the thermometer never moves, a sentence; `None`: it does.
pub fn not_fitted(summary: &Summary) -> Option<String> {
    let mut warnings = summary.warnings.iter();
    warnings.any(|w| w.code == "thermometer_constant").then(|| {
        format!(
            "No dependence on temperature could be fitted: {} is constant.",
            summary.fit.thermometer
        )
    })
}

/// Up to this many times the noise floor the held-out error is taken for noise alone (convention).
const NOISE_ALONE: f64 = 1.5;

impl Outcome {
    /// Draws the conclusions.
    pub fn new(parts: Parts) -> Self {
        let drift = |of: &dyn Fn(&Point) -> f64| Drift {
            drift_pp_dps: drift_pp(&parts.points, of),
            rms_dps: rms(&parts.points, of),
        };
        let before = drift(&|p| p.before_dps);
        let built = |of: fn(&Point) -> Option<f64>| {
            let is_built = parts.points.iter().any(|p| of(&p).is_some());
            is_built.then(|| drift(&|p| of(p).unwrap_or(f64::NAN)))
        };
        let (c, rust) = (built(|p| p.c_dps), built(|p| p.rust_dps));
        let fixed = drift(&|p| p.fixed_dps);
        let after = After {
            float: drift(&|p| p.float_dps),
            emitted: match (c, rust) {
                (Some(c), Some(rust)) if c.drift_pp_dps < rust.drift_pp_dps => rust,
                (c, rust) => c.or(rust).unwrap_or(fixed),
            },
            fixed,
            c,
            rust,
        };
        let points = &parts.points;
        let apart = points.iter().map(|p| (p.fixed_dps - p.float_dps).abs());
        let on_record = points.iter().filter(|p| p.differs()).count() as u64;
        let is_measured = parts.record_path.is_some();
        let triples = points
            .iter()
            .map(|p| [p.thermometer, p.before_dps, p.fixed_dps]);
        let mut said = parts.warnings.iter();
        let has_loop = said.any(|w| w.code == "heating_cooling_loop");
        let no_gain =
            is_measured.then(|| no_gain::warning(&parts.fit.thermometer, triples, has_loop, true));
        let compensation = parts.design.compensation.as_ref();
        let fit = &parts.fit;
        let summary = Summary {
            schema: "gyrogen.run/1",
            version: env!("CARGO_PKG_VERSION"),
            design_sha256: parts.design.source.sha256.clone(),
            command: parts.command.clone(),
            record: parts.record_path.as_ref().map(|p| name_of(p)),
            ratio: after.fixed.drift_pp_dps / before.drift_pp_dps.max(f64::MIN_POSITIVE),
            before,
            after,
            fit: FitSummary {
                thermometer: fit.thermometer.clone(),
                unit: fit.unit.to_owned(),
                range: fit.range,
                order: fit.order,
                reason: fit.reason.clone(),
                coefficients: fit.coefficients.clone(),
                coefficients_raw: compensation.map_or(Vec::new(), |c| c.coefficients_raw.clone()),
                coefficient_format: compensation
                    .map_or(String::new(), |c| c.coefficient_format.to_string()),
                in_sample_rms_dps: fit.in_sample_rms_dps,
                heldout_rms_dps: fit.heldout_rms_dps,
                heldout_max_abs_dps: fit.heldout_max_abs_dps,
                noise_floor_rms_dps: fit.noise_floor_rms_dps,
                outliers: fit.outliers.len(),
            },
            chosen: parts.chosen.clone(),
            finding: parts.word_lengths.sentence(fit.heldout_rms_dps),
            word_lengths: parts.word_lengths.clone(),
            budget: parts.budget.clone(),
            certainty_text: {
                let least_certain = format!("{} {}", number(fit.least_certain(), 5), fit.unit);
                let at = (fit.order > 0).then_some(least_certain.as_str());
                let bounds = &parts.certainty.bounds;
                let of_run = OfRun {
                    least_certain: at,
                    saturates: parts.certainty.saturates,
                };
                let mut text = certainty::sentences_with(&parts.design, bounds, Some(of_run));
                text.push(certainty::run_sentence(&parts.design, &parts.certainty));
                text
            },
            certainty: parts.certainty.clone(),
            bound: parts.kept.clone(),
            equivalence: Equivalence {
                compared: parts.compared.iter().map(|c| c.compared).sum(),
                mismatches: parts.compared.iter().map(|c| c.mismatches).sum::<u64>() + on_record,
                functions: parts.compared.clone(),
                fixed_minus_float_max_dps: apart.fold(0.0, f64::max),
            },
            emitted: parts
                .firmware
                .bundles()
                .flat_map(|(files, folder)| {
                    files.iter().map(move |file| Emitted {
                        path: format!("{folder}/{}", file.path),
                        sha256: sha256(file.text.as_bytes()),
                    })
                })
                .collect(),
            warnings: parts
                .warnings
                .iter()
                .cloned()
                .chain(no_gain.flatten())
                .collect(),
        };
        Outcome { summary, parts }
    }

    /// True if something is left that may have a cause beside the bias, and that a search can find: not noise, not words that
    /// overflow, and not of a few rows.
    pub fn leaves_drift(&self) -> bool {
        let (fit, words) = (&self.summary.fit, &self.summary.word_lengths);
        let overflows = self.parts.certainty.saturates || words.overflow.is_some();
        let is_left = self.single_readings().is_some()
            || fit.heldout_rms_dps > NOISE_ALONE * fit.noise_floor_rms_dps;
        is_left && !overflows && self.parts.points.len() >= ENOUGH_ROWS
    }

    /// True if emitted code and model agree everywhere.
    pub fn holds(&self) -> bool {
        self.summary.equivalence.mismatches == 0
    }

    /// Where heating and cooling differ, what the drift of their means leaves out: see [`single_readings`].
    pub fn single_readings(&self) -> Option<String> {
        single_readings(&self.summary, &self.parts.points)
    }

    /// Where the thermometer never moves, what is said of the drift: see [`not_fitted`].
    pub fn not_fitted(&self) -> Option<String> {
        not_fitted(&self.summary)
    }

    /// The first difference of each function that has one.
    pub fn differences(&self) -> Vec<String> {
        let functions = &self.summary.equivalence.functions;
        let mut lines: Vec<String> = functions
            .iter()
            .filter_map(|c| {
                Some(format!(
                    "{} ({}): {}",
                    c.name,
                    c.language,
                    c.first.as_ref()?
                ))
            })
            .collect();
        for p in self.parts.points.iter() {
            if lines.is_empty() && p.differs() {
                let [c, rust] = p.emitted(|dps| dps.to_string());
                lines.push(format!(
                    "record at {} s: fixed {}, C {c}, Rust {rust} deg/s",
                    p.time_s, p.fixed_dps
                ));
            }
        }
        lines
    }
}
