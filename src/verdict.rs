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

/// Part of the model's gain (in mean square) of which firmware must reach more to be of use (convention: whole codes that are
/// moved by less than half an LSB of what was found gain nothing, but for chance).
const LEAST_SHARE: f64 = 0.1;

impl FirmwareErrors {
    /// These, unless firmware with the steps leaves about as much as there is without it, or more: then nothing is to be
    /// emitted, and the text says so. `none` is the held-out rms without firmware, `model` that with the steps in the
    /// model, in `unit`.
    ///
    /// # Errors
    /// That text, with the three figures.
    pub fn unless_useless(
        self,
        none: f64,
        model: f64,
        unit: &str,
    ) -> std::result::Result<Self, String> {
        let Some(rms) = self.heldout_rms else {
            return Ok(self);
        };
        let gain = none.powi(2) - rms.powi(2);
        let of_model = none.powi(2) - model.powi(2);
        // A figure that is no number is no gain.
        if gain > 0.0 && gain > LEAST_SHARE * of_model {
            return Ok(self);
        }
        let what = if rms > none { "worse" } else { "no better" };
        Err(format!(
            "firmware would be {what} than none: held-out rms {none:.4} {unit} before, {model:.4} {unit} in the model, {rms:.4} {unit} \
             in firmware, whose words are too coarse for what was found; nothing is emitted"
        ))
    }
}

impl Closure {
    /// The thermometer whose heating and cooling differ by more than noise. What is left depends on more than its reading then.
    ///
    /// Time rises all along a record, so that whatever hangs on the past of the temperature (lag, hysteresis) shows in time too:
    /// where time comes first and heating and cooling differ, both have to be said.
    pub fn loops_in(&self) -> Option<&str> {
        let mut warnings = self.warnings.iter();
        let found = warnings.find(|w| w.code == "heating_cooling_loop")?;
        found.column.as_deref()
    }
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
    /// Gain in log-likelihood, before any step; below 0 where it makes the record less likely.
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
    /// Of the design's text as read; the firmware names that of `design.toml` beside it, which has the correction.
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

impl Closure {
    /// [`Closure::unit`] as sentences and tables have it.
    pub fn unit_text(&self) -> &'static str {
        match self.unit {
            "lsb" => "LSB",
            other => other,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::FirmwareErrors;

    #[test]
    fn firmware_that_gains_nothing_is_told_with_its_figures() {
        let told = |none, model, firmware| {
            let errors = FirmwareErrors {
                compensable: true,
                heldout_rms: Some(firmware),
                heldout_max_abs: Some(1.0),
            };
            errors.unless_useless(none, model, "LSB").err()
        };
        let worse = told(0.35, 0.035, 0.5).unwrap();
        for part in [
            "worse than none",
            "0.3500 LSB before",
            "0.0350 LSB in the model",
            "0.5000 LSB in firmware",
        ] {
            assert!(worse.contains(part), "{worse}");
        }
        assert!(
            told(0.35, 0.035, 0.35)
                .unwrap()
                .contains("no better than none")
        );
        assert!(told(0.5, 0.035, 0.4999).is_some());
        assert!(told(f64::NAN, 0.1, 0.1).is_some());
        // Little beside the noise is a gain all the same.
        assert_eq!(told(1.01, 1.0, 1.002), None);
        let nothing = FirmwareErrors::default();
        assert_eq!(nothing.unless_useless(1.0, 0.1, "LSB"), Ok(nothing));
    }
}
