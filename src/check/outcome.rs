//! `check.json` (`gyrogen.check/1`).

use super::budget::Line;
use super::remarks::Remark;
use super::requirements::Requirement;
use crate::cost::Cost;
use crate::numeric::format::{Format, Rounding};
use crate::study::certainty::Confidence;
use crate::text::number;
use serde::Serialize;

/// What is known of a word's overflow.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, schemars::JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Overflows {
    /// Proved, for every ADC code and state.
    Impossible,
    /// The proved range does not fit; no code that was run does it.
    Possible,
    /// Codes of the design's own gyro do it, or every value does.
    Certain,
    /// Wrapping or limiting is the word's function.
    ByDesign,
}

/// Overflows that were seen.
#[derive(Debug, Clone, PartialEq, Serialize, schemars::JsonSchema)]
pub struct Witness {
    /// Words that did not fit.
    pub words: u64,
    /// The ADC sample of the circuit's first, if it was here.
    pub sample: Option<u64>,
    /// What went in, raw.
    pub operands: Vec<i128>,
    /// What was done with it, in words.
    pub operation: Option<String>,
    /// The raw word before the overflow step.
    pub value: Option<i128>,
}

/// One word.
#[derive(Debug, Clone, PartialEq, Serialize, schemars::JsonSchema)]
pub struct NodeCheck {
    /// The dotted key of the design, with the channel or the part; as in `equiv.json`.
    pub name: String,
    /// Its format.
    pub format: String,
    /// How dropped bits are rounded; null where none are.
    pub rounding: Option<Rounding>,
    /// What happens beyond the format.
    pub mode: &'static str,
    /// Least and greatest raw value that can come, for every ADC code and state.
    pub proved: [i128; 2],
    /// Least and greatest raw value that fits.
    pub limits: [i128; 2],
    /// log2 of how much the proved range could grow; negative where it does not fit; null for a word that is always
    /// 0 or whose end is its function.
    pub headroom_bits: Option<f64>,
    /// Whether it overflows.
    pub overflow: Overflows,
    /// Where overflow is not excluded: the ranges of what the value is made of, raw.
    pub operands: Vec<[i128; 2]>,
    /// Where overflow is not excluded: every word that it reaches.
    pub path: Vec<String>,
    /// Overflows that were seen.
    pub witness: Option<Witness>,
    /// The word whose overflow makes those of this one: without it none is seen here. Null where there is none.
    pub follows_from: Option<&'static str>,
    /// What the word's own rounding does to the rate; null for a word that rounds nothing.
    pub budget: Option<Line>,
}

impl NodeCheck {
    /// A range of raw words as values, in the unit of the compensation where it is one of its words; raw where the word
    /// has no format.
    pub fn in_units(&self, [low, high]: [i128; 2]) -> String {
        let Ok(format) = self.format.parse::<Format>() else {
            return format!("the raw words {low} to {high}");
        };
        let unit = match self.name.starts_with("compensation.") {
            true => " deg/s",
            false => "",
        };
        let value = |raw: i128| number(raw as f64 * format.lsb(), 5);
        format!("{} to {}{unit}", value(low), value(high))
    }

    /// What makes the check fail, in a sentence.
    pub fn failure(&self) -> Option<String> {
        if self.overflow != Overflows::Certain || self.follows_from.is_some() {
            return None;
        }
        Some(format!(
            "{} overflows {} ({}): {}; path {}",
            self.name,
            self.format,
            self.mode,
            self.seen(),
            self.path.join(" > ")
        ))
    }

    /// What overflows, in words.
    pub fn seen(&self) -> String {
        let [low, high] = self.proved;
        match &self.witness {
            Some(w) => {
                let first = w.sample.zip(w.value).zip(w.operation.as_deref());
                let first = first.map_or(String::new(), |((sample, value), operation)| {
                    format!(", the first at sample {sample}: the raw word {value} ({operation})")
                });
                format!("{} words of the design's own gyro{first}", w.words)
            }
            None => format!("every value, {low} to {high}"),
        }
    }
}

/// `check.json`.
#[derive(Debug, Clone, PartialEq, Serialize, schemars::JsonSchema)]
pub struct Check {
    /// `gyrogen.check/1`.
    pub schema: &'static str,
    /// Of the tool.
    pub version: &'static str,
    /// Of the design's text.
    pub design_sha256: String,
    /// The command.
    pub command: String,
    /// ADC samples of the design's own gyro that were run.
    pub samples: u64,
    /// Every word, in the order of the circuit's steps.
    pub nodes: Vec<NodeCheck>,
    /// Fixed less float in the rate over those samples, rms, deg/s; null without a compensation of the circuit.
    pub rate_rms_dps: Option<f64>,
    /// The same by theory; null where its conditions do not hold.
    pub predicted_rate_rms_dps: Option<f64>,
    /// By processor.
    pub costs: Vec<Cost>,
    /// What could be better.
    pub remarks: Vec<Remark>,
    /// What the design requires, each with what was obtained; empty without `[requirements]`.
    pub requirements: Vec<Requirement>,
    /// With which confidence the bounds of these hold; null without any.
    pub confidence: Option<Confidence>,
    /// Nothing overflows for certain, the amplitude loop can reach its setpoint, and every requirement is met.
    pub holds: bool,
    /// Why not.
    pub reasons: Vec<String>,
}
