//! `equiv.json` (`gyrogen.equiv/1`): what a run comes to.

use super::against::{Against, FirstDifference};
use super::predicted::Prediction;
use crate::circuit::vector_width::{self, TooShort};
use crate::design::Design;
use crate::nodes::histogram::Histogram;
use crate::nodes::node::{Node, operation};
use crate::nodes::probe::Seen;
use crate::nodes::repair::{self, Repair};
use crate::record::Warning;
use crate::simulation::hunting::Hunting;
use crate::spectrum::NcoSpurs;
use crate::verify::compare::Compared;
use serde::Serialize;

/// One node.
#[derive(Debug, Clone, Serialize, schemars::JsonSchema)]
pub struct NodeReport {
    /// The dotted key of the design, with the channel or the part.
    pub name: String,
    /// Of every figure without a unit in its name.
    pub unit: &'static str,
    /// One LSB in that unit.
    pub lsb: f64,
    /// Words.
    pub count: u64,
    /// Greatest |fixed - float|.
    pub max_abs_error: f64,
    /// Greatest bound of a sample.
    pub bound: f64,
    /// Greatest error / bound of a sample; at most 1 if the node is within its bound.
    pub worst_error_to_bound: f64,
    /// The ADC sample of that.
    pub worst_at_sample: u64,
    /// Samples outside their own bound.
    pub outside_bound: u64,
    /// The first of them.
    pub first_outside_sample: Option<u64>,
    /// Mean of fixed - float.
    pub mean_error: f64,
    /// Root mean square of fixed - float.
    pub rms_error: f64,
    /// The same by the theory of quantisation; null where its conditions do not hold (see `flags`).
    pub predicted_rms: Option<f64>,
    /// Root mean square of the node's own rounding; null where it drops no bits.
    pub local_rms: Option<f64>,
    /// The same by theory; null where its conditions do not hold.
    pub predicted_local_rms: Option<f64>,
    /// Least value.
    pub min: f64,
    /// Greatest value.
    pub max: f64,
    /// Least raw word.
    pub min_raw: i128,
    /// Greatest raw word.
    pub max_raw: i128,
    /// log2 of the factor by which the words could grow; null for a node that stays 0.
    pub headroom_bits: Option<f64>,
    /// Words that did not fit.
    pub overflows: u64,
    /// Conditions that do not hold; see `notes`.
    pub flags: Vec<&'static str>,
    /// How often fixed - float was how large; for the report.
    #[serde(skip)]
    pub errors: Histogram,
}

impl NodeReport {
    /// From what was seen and predicted.
    pub fn new(node: &Node, prediction: &Prediction) -> Self {
        let identity = &node.identity;
        let lsb = crate::numeric::format::pow2(-identity.fraction_bits);
        let (min_raw, max_raw) = if node.count > 0 {
            (node.min_raw, node.max_raw)
        } else {
            (0, 0)
        };
        NodeReport {
            name: identity.name.clone(),
            unit: identity.unit,
            lsb,
            count: node.count,
            max_abs_error: node.max_abs_error,
            bound: node.max_bound,
            worst_error_to_bound: node.worst.0,
            worst_at_sample: node.worst.1,
            outside_bound: node.outside,
            first_outside_sample: node.first_outside,
            mean_error: node.mean_error(),
            rms_error: node.rms_error(),
            predicted_rms: prediction.rms,
            local_rms: node.local_rms_lsb().map(|rms| rms * lsb),
            predicted_local_rms: prediction.local_rms_lsb.map(|rms| rms * lsb),
            min: min_raw as f64 * lsb,
            max: max_raw as f64 * lsb,
            min_raw,
            max_raw,
            headroom_bits: node.headroom_bits(),
            overflows: node.overflows,
            flags: prediction.flags.clone(),
            errors: node.errors.clone(),
        }
    }

    /// The headroom in bits, for a table; `absent` where there is no figure. A node that overflowed has none, although its words
    /// after saturation or wrap are within the format.
    pub fn headroom(&self, absent: &str) -> String {
        match self.headroom_bits {
            Some(_) if self.overflows > 0 => "none".to_owned(),
            Some(bits) => format!("{bits:.2}"),
            None => absent.to_owned(),
        }
    }
}

/// The first overflow, in the order of the circuit's steps.
#[derive(Debug, Clone, Serialize, schemars::JsonSchema)]
pub struct FirstOverflow {
    /// 0-based ADC sample; at the slow rate the period's last.
    pub sample: u64,
    /// The dotted key with its channel, as in the message of an overflow that stops `replay`.
    pub node: String,
    /// The node's name in `nodes`.
    pub part: String,
    /// What went into it, raw.
    pub operands: Vec<i128>,
    /// The raw word before the overflow step.
    pub value: i128,
    /// The same in the node's unit.
    pub real_value: f64,
    /// The format that does not hold it.
    pub format: String,
    /// From the node to the columns of the output.
    pub path: Vec<String>,
    /// The smallest change that removes it; null if there is none within 64 and 127 bits.
    pub repair: Option<Repair>,
    /// Of a `circuit.cordic.width` that is too short: what it needs, where it stands and what to write; else null.
    pub mend: Option<String>,
}

impl FirstOverflow {
    /// From what was seen.
    pub fn new(design: &Design, seen: &Seen, repair: Option<Repair>) -> Option<Self> {
        let event = seen.first_overflow.as_ref()?;
        let node = seen.nodes.get(event.node)?;
        let lsb = crate::numeric::format::pow2(-node.identity.fraction_bits);
        Some(FirstOverflow {
            sample: event.sample,
            node: event.label.to_string(),
            part: event.part.clone(),
            operands: event.operands.clone(),
            value: event.value,
            real_value: event.value as f64 * lsb,
            format: repair::format_of(design, event.label.key),
            path: repair::path(design, &event.part),
            repair,
            mend: (event.label.key == vector_width::KEY)
                .then(|| TooShort::of(design))
                .flatten()
                .map(|short| short.sentence()),
        })
    }

    /// One sentence.
    pub fn sentence(&self) -> String {
        let mut text = format!(
            "overflow at sample {} in {}: the raw word {} does not fit {} ({})",
            self.sample,
            self.node,
            self.value,
            self.format,
            operation(&self.part, &self.operands)
        );
        match (&self.mend, &self.repair) {
            (Some(mend), _) => text += &format!("; {mend}"),
            (None, Some(r)) => {
                text += &format!(". The smallest change that mends it: {}", r.change())
            }
            (None, None) => {
                text += ". No wider format within 64 bits a word and 127 an intermediate holds it"
            }
        }
        text
    }
}

/// Emitted code against the model.
#[derive(Debug, Clone, Serialize, schemars::JsonSchema)]
pub struct Emitted {
    /// Output words compared.
    pub compared: u64,
    /// Inputs (rows of a chain) with a difference.
    pub mismatches: u64,
    /// The first difference, in words.
    pub first: Option<String>,
    /// By table, function, chain.
    pub parts: Vec<Compared>,
}

impl Emitted {
    /// Of one language.
    pub fn new(parts: Vec<Compared>) -> Self {
        let first = parts.iter().find_map(|p| {
            let first = p.first.as_ref()?;
            Some(format!("{}: {first}", p.name))
        });
        Emitted {
            compared: parts.iter().map(|p| p.compared).sum(),
            mismatches: parts.iter().map(|p| p.mismatches).sum(),
            first,
            parts,
        }
    }
}

/// `equiv.json`.
#[derive(Debug, Clone, Serialize, schemars::JsonSchema)]
pub struct Equivalence {
    /// `gyrogen.equiv/1`.
    pub schema: &'static str,
    /// Of the tool.
    pub version: &'static str,
    /// Of the design's text.
    pub design_sha256: String,
    /// The command.
    pub command: String,
    /// Where the codes came from.
    pub stimulus: String,
    /// ADC samples.
    pub samples: u64,
    /// Decimated samples.
    pub rows: u64,
    /// In the order of the circuit's steps.
    pub nodes: Vec<NodeReport>,
    /// Emitted C; null where it was not built.
    pub model_vs_c: Option<Emitted>,
    /// Emitted Rust.
    pub model_vs_rust: Option<Emitted>,
    /// Null if nothing overflowed.
    pub first_overflow: Option<FirstOverflow>,
    /// The changes, one after the other, until nothing overflows on this stimulus; empty if nothing did.
    pub repairs: Vec<Repair>,
    /// The design with all of them was run again, and nothing overflowed; null if nothing had to be repaired.
    pub repair_verified: Option<bool>,
    /// Of the phase loop; null without one.
    pub phase_loop: Option<LoopReport>,
    /// Every error is within its bound, nothing overflowed, emitted code has the model's bits.
    pub holds: bool,
    /// What does not hold.
    pub reasons: Vec<String>,
    /// What the flags mean, and what else to know.
    pub notes: Vec<String>,
    /// Where the design's own numbers do not fit each other.
    pub warnings: Vec<Warning>,
    /// The oscillator's spurs, at the design's tuning word.
    pub nco_spurs: NcoSpurs,
    /// What quantisation leaves of the loops: dead band and limit cycle, measured and predicted; empty without a loop.
    pub loops: Vec<Hunting>,
    /// The other design's chain on the same codes; null if none was given.
    pub against: Option<Against>,
    /// The first word in which the two chains differ; null if none does, or if there is one chain only.
    pub first_difference: Option<FirstDifference>,
    /// The shrunk stimulus on which a node leaves its bound, or emitted code differs: a file beside this one.
    pub counterexample: Option<String>,
}

/// How the phase loop was bounded.
#[derive(Debug, Clone, Serialize, schemars::JsonSchema)]
pub struct LoopReport {
    /// The linear loop contracts.
    pub contracting: bool,
    /// Rows in which a difference dies out to 1e-4.
    pub settling_rows: u64,
    /// ADC sample from which the loop no longer holds the two together; null = never.
    pub lost_at_sample: Option<u64>,
}
