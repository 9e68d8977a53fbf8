//! `study.json`: what a study found.

use super::budget::Budget;
use super::certainty::{Bounds, Confidence};
use super::figures::Figures;
use super::merit::Scale;
use crate::cost::Cost;
use serde::Serialize;
use std::collections::BTreeMap;

/// Lengths by key.
pub type WordLengths = BTreeMap<&'static str, u32>;

/// A word that was varied.
#[derive(Debug, Clone, PartialEq, Serialize, schemars::JsonSchema)]
pub struct Parameter {
    /// The dotted key.
    pub name: &'static str,
    /// Words that go with it.
    pub tied: Vec<&'static str>,
    /// What its number counts: `bits` (of a format all of them), `micro-rotations`, `fraction bits`.
    pub unit: &'static str,
    /// The least length.
    pub low: u32,
    /// The largest.
    pub high: u32,
    /// The given design's.
    pub given: u32,
}

/// A design of the front, or the given one.
#[derive(Debug, Clone, PartialEq, Serialize, schemars::JsonSchema)]
pub struct Point {
    /// 1, 2, ... by rising merit number; 0 = the given design.
    pub number: usize,
    /// The file that makes it, beside `study.json`; the given design has its own.
    pub design: Option<String>,
    /// The targets on whose front it is; none for a design that was chosen for what a front of price and merit does not
    /// weigh: bytes or cycles that are required, or that its bounds are within the limits.
    pub targets: Vec<String>,
    /// Lengths of all words that were varied.
    pub word_lengths: WordLengths,
    /// What it costs, by target.
    pub cost: BTreeMap<String, Cost>,
    /// The one number that the search made small, by target.
    pub price: BTreeMap<String, f64>,
    /// The same in parts of the given design's.
    pub price_of_given: BTreeMap<String, f64>,
    /// What the words add to the bias, deg/s.
    pub bias_error_dps: f64,
    /// To the drift over temperature, deg/s.
    pub drift_residual_dps: f64,
    /// To the noise, deg/s/sqrt(Hz).
    pub noise_dps_rthz: f64,
    /// To the angle random walk, deg/sqrt(h).
    pub arw_deg_rth: f64,
    /// To the scale factor, ppm.
    pub scale_factor_ppm: f64,
    /// Amplitude of the largest line, deg/s.
    pub spur_dps: f64,
    /// Its frequency, Hz.
    pub spur_hz: f64,
    /// It is in the run with the detuned oscillator.
    pub spur_detuned: bool,
    /// A smaller line would not have been seen, deg/s.
    pub spur_floor_dps: f64,
    /// The largest figure in parts of its limit.
    pub merit: f64,
    /// That figure.
    pub limited_by: &'static str,
    /// Each figure in parts of its limit.
    pub parts: BTreeMap<&'static str, f64>,
    /// What each figure may be with the study's confidence (`confidence`).
    pub bounds: Bounds,
    /// Each figure of the data sheet is at most one percent worse than the given design's: the whole of its bounds is
    /// within that, or what the words add is at most one percent above what those of the given design add on the same noise.
    pub as_good_as_given: bool,
    /// Its figures hold what is asked, with the whole of their bounds; without requirements `as_good_as_given`. A target's
    /// chosen point is one of these.
    pub shown: bool,
    /// Run bit for bit with other noise than the search's, started from power-on, ranges proved.
    pub verified: bool,
    /// Mean error after a start from power-on less that of the settled circuit under the same conditions, deg/s.
    pub startup_error_dps: Option<f64>,
    /// Keys with another value than in the given design.
    pub changes: BTreeMap<String, String>,
    /// Designs that the noise of the measurement does not tell from this one: dearer, and hardly better.
    pub alternatives: Vec<WordLengths>,
}

/// A word's curve.
#[derive(Debug, Clone, PartialEq, Serialize, schemars::JsonSchema)]
pub struct Sweep {
    /// The dotted key.
    pub name: &'static str,
    /// The longest length below the given one that makes the design worse; null = none in the range.
    pub first_that_hurts: Option<u32>,
    /// The longest length above the given one that makes it better; null = none in the range.
    pub last_that_helps: Option<u32>,
    /// Point by point.
    pub curve: Vec<Swept>,
}

/// One length of a word, the others as given.
#[derive(Debug, Clone, PartialEq, Serialize, schemars::JsonSchema)]
pub struct Swept {
    /// The length.
    pub length: u32,
    /// What all words then add; null = there is no such design.
    pub figures: Option<Figures>,
    /// The largest figure in parts of its limit.
    pub merit: Option<f64>,
    /// By target.
    pub price: BTreeMap<String, f64>,
}

/// One word more or less at the chosen point.
#[derive(Debug, Clone, PartialEq, Serialize, schemars::JsonSchema)]
pub struct Step {
    /// The dotted key.
    pub name: &'static str,
    /// -1 or 1.
    pub by: i32,
    /// The length that it then has.
    pub length: u32,
    /// What the words then add; null = there is no such design.
    pub figures: Option<Figures>,
    /// The largest figure in parts of its limit.
    pub merit: Option<f64>,
    /// By target.
    pub price: BTreeMap<String, f64>,
}

/// The point that is chosen for a target.
#[derive(Debug, Clone, PartialEq, Serialize, schemars::JsonSchema)]
pub struct Chosen {
    /// The target.
    pub target: String,
    /// Number in `front`; null = none meets what is required.
    pub point: Option<usize>,
    /// Where something is required and none meets it: the number of the verified design that comes nearest, in `front` or
    /// `nearest`; 0 = the given design.
    pub nearest: Option<usize>,
    /// Why this one, or what is in the way and what to do.
    pub reason: String,
    /// One bit more or less of each word.
    pub sensitivity: Vec<Step>,
}

/// A limit and whether it can be met.
#[derive(Debug, Clone, PartialEq, Serialize, schemars::JsonSchema)]
pub struct Required {
    /// The figure.
    pub name: &'static str,
    /// As required.
    pub limit: f64,
    /// The best that is shown of any design: of a figure the largest that it may be with the study's confidence.
    pub best: f64,
    /// Of a figure its size in that design without the interval; null of costs and the bandwidth.
    pub estimate: Option<f64>,
    /// It can be met by itself.
    pub can_be_met: bool,
    /// If not: the word that limits it.
    pub limited_by: Option<&'static str>,
    /// The length that this word has in that best design.
    pub length: Option<u32>,
    /// That is the end of the word's range in this study.
    pub at_end_of_range: bool,
    /// The study varies this word.
    pub varied: bool,
    /// One bit more of it (of a cost: less) lowers that best by more than a merit is certain to. False: no word's bit does.
    pub step_helps: bool,
}

/// A design that costs a quarter less than the given one on a target and is as good.
#[derive(Debug, Clone, PartialEq, Serialize, schemars::JsonSchema)]
pub struct Quarter {
    /// The target.
    pub target: String,
    /// At most so much of the given design's cost.
    pub share: f64,
    /// Number in `front`; null = there is none.
    pub point: Option<usize>,
    /// There is none among all combinations of `words`: each was priced, and run where it is cheap enough.
    pub proved_none: bool,
    /// The words concerned, those that move the price, with every length that was tried.
    pub words: Vec<QuarterWord>,
    /// The other words, which were as here.
    pub others: WordLengths,
    /// Combinations.
    pub designs: usize,
    /// Those that are cheap enough; null where no combinations were tried.
    pub cheap_enough: Option<usize>,
    /// The least merit of these in the search's runs.
    pub best_merit: Option<f64>,
    /// The figure that makes it.
    pub best_limited_by: Option<&'static str>,
}

/// A word and the lengths that were tried.
#[derive(Debug, Clone, PartialEq, Serialize, schemars::JsonSchema)]
pub struct QuarterWord {
    /// The dotted key.
    pub name: &'static str,
    /// Its lengths.
    pub lengths: Vec<u32>,
}

/// `study.json`.
#[derive(Debug, Clone, PartialEq, Serialize, schemars::JsonSchema)]
pub struct Study {
    /// `gyrogen.study/1`.
    pub schema: &'static str,
    /// Of gyrogen.
    pub version: &'static str,
    /// Of the given design's text.
    pub design_sha256: String,
    /// What makes this again.
    pub command: String,
    /// Words and ranges.
    pub parameters: Vec<Parameter>,
    /// The design as given.
    pub reference: Point,
    /// Undominated, verified designs, the finest last.
    pub front: Vec<Point>,
    /// Verified designs off the front that come nearest to what is required on a target where none meets it. Their start from
    /// power-on may be off by more than a point of the front may be.
    pub nearest: Vec<Point>,
    /// The points that are chosen.
    pub chosen: Vec<Chosen>,
    /// What was required; empty without requirements.
    pub required: Vec<Required>,
    /// The limits that a merit of 1 stands for.
    pub limits: Scale,
    /// Where they come from.
    pub limits_from: &'static str,
    /// The figures of the instrument without quantisation.
    pub instrument: Figures,
    /// -3 dB of the decimator, Hz.
    pub bandwidth_hz: f64,
    /// `search` or `exhaustive`.
    pub method: &'static str,
    /// Combinations of lengths.
    pub space: f64,
    /// With which confidence the points' bounds hold.
    pub confidence: Confidence,
    /// By target: a design that costs a quarter less and is as good as the given one, or what shows that there is none;
    /// empty where something is required.
    pub quarter_less: Vec<Quarter>,
    /// Designs that were priced or run.
    pub designs_considered: usize,
    /// Designs that were run bit for bit.
    pub designs_simulated: usize,
    /// Points of the search's front that their verification did not confirm.
    pub points_dropped: usize,
    /// By word.
    pub sweeps: Vec<Sweep>,
    /// What each word of the given design adds.
    pub budget: Budget,
    /// The same of the chosen designs, by target.
    pub chosen_budgets: BTreeMap<String, Budget>,
    /// What was run.
    pub conditions: Conditions,
    /// What else is to be known.
    pub notes: Vec<String>,
}

/// What every design ran.
#[derive(Debug, Clone, PartialEq, Serialize, schemars::JsonSchema)]
pub struct Conditions {
    /// Temperatures at rest, heating and cooling, in search and verification.
    pub temperatures: [usize; 2],
    /// The largest rate applied, both ways, deg/s.
    pub full_rate_dps: f64,
    /// The detuned oscillator is off by so much, Hz; null where a phase loop sets it.
    pub detuned_hz: Option<f64>,
    /// ADC samples of a run in search and verification.
    pub samples: [u64; 2],
}

/// `study.json` and the design files: name and text.
#[derive(Debug, Clone, PartialEq)]
pub struct Done {
    /// The result.
    pub study: Study,
    /// Name below the folder, text.
    pub files: Vec<(String, String)>,
}
