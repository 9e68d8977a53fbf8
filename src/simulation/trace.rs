//! The words of the circuit's nodes from power-on, for tables and wave viewers.
//!
//! The codes of [`super::startup`] are run once more through fixed and float at once
//! ([`crate::nodes::run`]), every node keeping its words. The design is the one with the fitted
//! compensation, so that the trace shows the whole firmware.

use crate::circuit::engine::ArithmeticKind;
use crate::design::Design;
use crate::design::suggest;
use crate::error::{InputError, Result};
use crate::nodes::node::Node;
use crate::nodes::run;
use crate::trace_file::{Signal, Trace, Values};

/// What is traced.
#[derive(Debug, Clone, PartialEq)]
pub struct Wanted {
    /// Names of nodes, or beginnings of names that end at a `.` or a space; empty = every node.
    pub nodes: Vec<String>,
    /// Decimated rows.
    pub rows: usize,
    /// Raw words, or float values.
    pub arithmetic: ArithmeticKind,
}

/// Runs `codes` (drive, sense: the first `rows` periods of them) and gives the wanted nodes.
///
/// # Errors
/// A name that is none of the circuit's nodes; a word beyond 64 bits.
pub fn trace(design: &Design, (drive, sense): (&[i32], &[i32]), wanted: &Wanted) -> Result<Trace> {
    let ratio = design.circuit.decimator.ratio;
    let samples = wanted.rows.saturating_mul(ratio as usize);
    let count = samples.min(drive.len()).min(sense.len());
    let [drive, sense] = [drive, sense].map(|codes| codes.get(..count).unwrap_or_default());
    let seen = run::run_remembering(design, drive, sense);
    let mut signals = vec![
        codes(design, "drive", drive, wanted.arithmetic),
        codes(design, "sense", sense, wanted.arithmetic),
    ];
    for node in &seen.nodes {
        signals.push(signal(node, count, ratio, wanted.arithmetic)?);
    }
    Ok(Trace {
        sample_rate_hz: design.circuit.sample_rate_hz,
        first_sample: 0,
        signals: chosen(signals, &wanted.nodes)?,
    })
}

fn codes(design: &Design, name: &str, codes: &[i32], arithmetic: ArithmeticKind) -> Signal {
    let format = design.circuit.adc.format;
    let values = match arithmetic {
        ArithmeticKind::Fixed => Values::Integer {
            bits: format.bits(),
            values: codes.iter().map(|c| i64::from(*c)).collect(),
        },
        ArithmeticKind::Float => {
            Values::Real(codes.iter().map(|c| f64::from(*c) * format.lsb()).collect())
        }
    };
    Signal {
        name: format!("circuit.adc {name}"),
        unit: unit("1", format.fraction_bits as i32, arithmetic),
        every: 1,
        values,
    }
}

fn unit(unit: &str, fraction_bits: i32, arithmetic: ArithmeticKind) -> String {
    match (arithmetic, unit) {
        (ArithmeticKind::Float, "1") => String::new(),
        (ArithmeticKind::Float, unit) => unit.to_owned(),
        (ArithmeticKind::Fixed, unit) if fraction_bits == 0 => unit.to_owned(),
        (ArithmeticKind::Fixed, "1") => format!("2^-{fraction_bits}"),
        (ArithmeticKind::Fixed, unit) => format!("2^-{fraction_bits} {unit}"),
    }
}

fn signal(node: &Node, samples: usize, ratio: u32, arithmetic: ArithmeticKind) -> Result<Signal> {
    let identity = &node.identity;
    let history = node.history.as_ref();
    let length = history.map_or(0, |h| h.raw.len());
    // A node notes a word a sample, or a word a row.
    let every = if ratio == 1 || length == samples {
        1
    } else {
        ratio
    };
    let values = match arithmetic {
        ArithmeticKind::Float => Values::Real(history.map_or(Vec::new(), |h| h.real.clone())),
        ArithmeticKind::Fixed => {
            let words = history.map_or(&[][..], |h| &h.raw);
            let narrow = words.iter().map(|w| i64::try_from(*w));
            let values: std::result::Result<Vec<i64>, _> = narrow.collect();
            Values::Integer {
                bits: bits(identity.limits),
                values: values.map_err(|_| {
                    InputError::new(format!(
                        "a word of `{}` needs more than the 64 bits that a trace holds",
                        identity.name
                    ))
                    .help("leave the node out with --trace, or trace float values with --trace-arith float")
                })?,
            }
        }
    };
    Ok(Signal {
        name: identity.name.clone(),
        unit: unit(identity.unit, identity.fraction_bits, arithmetic),
        every,
        values,
    })
}

/// Bits of a word, two's complement where it can be negative; 64 at most.
fn bits((low, high): (i128, i128)) -> u32 {
    let of = |magnitude: i128| 128 - magnitude.leading_zeros();
    let bits = if low < 0 {
        of(high.max(-(low + 1))) + 1
    } else {
        of(high).max(1)
    };
    bits.min(64)
}

/// Signals by name or by the beginning of a name, in the circuit's order.
fn chosen(signals: Vec<Signal>, wanted: &[String]) -> Result<Vec<Signal>> {
    if wanted.is_empty() {
        return Ok(signals);
    }
    let names = |signal: &Signal, wanted: &str| {
        let rest = signal.name.strip_prefix(wanted);
        rest.is_some_and(|rest| rest.is_empty() || rest.starts_with(['.', ' ']))
    };
    for name in wanted {
        if !signals.iter().any(|s| names(s, name)) {
            let all: Vec<&str> = signals.iter().map(|s| s.name.as_str()).collect();
            // `circuit.cordic` stands for all of its nodes.
            let beginnings = all.iter().filter_map(|n| n.split_once(' ')).map(|n| n.0);
            let words: Vec<&str> = all.iter().copied().chain(beginnings).collect();
            let near = suggest::nearest_word(name, &words);
            let help = match near {
                Some(near) => format!("did you mean `{near}`?"),
                None => format!("the nodes are: {}", all.join(", ")),
            };
            return Err(
                InputError::new(format!("`{name}` is no node of this circuit"))
                    .help(help)
                    .into(),
            );
        }
    }
    let wants = |s: &Signal| wanted.iter().any(|name| names(s, name));
    Ok(signals.into_iter().filter(wants).collect())
}
