//! `closure.json` (`gyrogen.closure/1`, `docs/manual.md`): what a measurement says beyond its declared
//! model. Thermal records and captures share it; a capture's figures are in codes.

use crate::record::Warning;
use serde::Serialize;
use std::collections::BTreeMap;

/// Name of the form.
pub const SCHEMA: &str = "gyrogen.closure/1";

/// What it comes to.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, schemars::JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Verdict {
    /// Nothing beyond the noise was left before any step.
    Complete,
    /// A step was taken, and nothing beyond the noise is left.
    Explained,
    /// A step was taken, and structure is left.
    PartlyExplained,
    /// Structure is left, and no candidate earns a step.
    Unexplained,
}

impl Verdict {
    /// The verdict that follows from the number of steps and from what is left.
    pub fn of(steps: usize, structure_left: bool) -> Self {
        match (steps > 0, structure_left) {
            (false, false) => Verdict::Complete,
            (true, false) => Verdict::Explained,
            (true, true) => Verdict::PartlyExplained,
            (false, true) => Verdict::Unexplained,
        }
    }
}

/// The error with one model, in [`Closure::unit`].
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, schemars::JsonSchema)]
pub struct Errors {
    /// Over the rows that were fitted.
    pub train_rms: f64,
    /// Over the rows that no estimate used.
    pub heldout_rms: f64,
    /// The largest of them.
    pub heldout_max_abs: f64,
}

/// An effect that was added.
#[derive(Debug, Clone, PartialEq, Serialize, schemars::JsonSchema)]
pub struct Step {
    /// Id of the contract, `covariate:NAME`, or the user's own.
    pub effect: String,
    /// Columns that it needs.
    pub channels: Vec<String>,
    /// Values, units in the names.
    pub parameters: BTreeMap<String, f64>,
    /// Standard deviations by the same names.
    pub parameter_std: BTreeMap<String, f64>,
    /// Held-out error with this and all steps before it.
    pub heldout_rms: f64,
    /// Chance that the best of all candidates does as well where there is nothing.
    pub p_value: f64,
    /// Share of the record's halves in which the effect is chosen.
    pub selection_frequency: f64,
    /// What explains this record as well; at most four.
    pub indistinguishable_from: Vec<String>,
    /// The experiment that tells them apart.
    pub separating_experiment: Option<String>,
}

/// What the firmware that would be emitted leaves, bit-accurately, on the same held-out rows.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, schemars::JsonSchema)]
pub struct FirmwareErrors {
    /// Whether firmware can see all that the steps need.
    pub compensable: bool,
    /// `None` where not.
    pub heldout_rms: Option<f64>,
    /// `None` where not.
    pub heldout_max_abs: Option<f64>,
}

/// What is left after the last step.
#[derive(Debug, Clone, PartialEq, Default, Serialize, schemars::JsonSchema)]
pub struct Structure {
    /// More than noise.
    pub left: bool,
    /// Where it shows most.
    pub strongest_channel: Option<String>,
}

/// What became of a candidate.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, schemars::JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Fate {
    /// It is a step.
    Taken,
    /// The record does not call for it.
    Rejected,
    /// It explains the record as well as a step that was taken, or as the temperature does in the declared model.
    Confounded,
    /// The record does not show what it does, or it lies within the declared model.
    NotExcited,
    /// The record lacks a channel that it needs.
    NoChannel,
}

/// The evidence for and against one candidate.
#[derive(Debug, Clone, PartialEq, Serialize, schemars::JsonSchema)]
pub struct Evidence {
    /// Its id.
    pub effect: String,
    /// What became of it.
    pub fate: Fate,
    /// Chance that the best of all candidates does as well as this one, before any step; `None`
    /// where it was not scored.
    pub p_value: Option<f64>,
    /// Gain in log-likelihood, before any step.
    pub gain: Option<f64>,
    /// Why, or what to do, in a sentence.
    pub remark: String,
}

/// `closure.json`.
#[derive(Debug, Clone, PartialEq, Serialize, schemars::JsonSchema)]
pub struct Closure {
    /// [`SCHEMA`].
    pub schema: &'static str,
    /// Of the tool.
    pub version: &'static str,
    /// Of the design's text.
    pub design_sha256: String,
    /// As it was called.
    pub command: String,
    /// What it comes to.
    pub verdict: Verdict,
    /// `deg/s`, or `lsb` for a capture.
    pub unit: &'static str,
    /// What no smooth model removes, from the measurement itself.
    pub noise_floor_rms: f64,
    /// With the declared effects alone.
    pub before: Errors,
    /// What was added, in order.
    pub steps: Vec<Step>,
    /// With the steps.
    pub after: Errors,
    /// With the compensation that would be emitted.
    pub firmware: FirmwareErrors,
    /// What is left.
    pub residual_structure: Structure,
    /// All candidates.
    pub evidence: Vec<Evidence>,
    /// What the user should know of.
    pub warnings: Vec<Warning>,
}
