//! Overflows: where a word goes, and the smallest formats that remove them.

use super::node::Node;
use super::probe::Seen;
use super::run;
use crate::circuit::vector_width::TooShort;
use crate::design::{Design, limits};
use crate::numeric::format::{Format, Overflow, Quantizer};
use serde::Serialize;

/// Formats that are changed one after the other before a design is called beyond repair.
const MOST_REPAIRS: usize = 12;

/// A change of one format.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, schemars::JsonSchema)]
pub struct Repair {
    /// The dotted key.
    pub key: String,
    /// As it is.
    pub from: String,
    /// As it would have to be.
    pub to: String,
}

impl Repair {
    /// In words.
    pub fn change(&self) -> String {
        format!("{} from {} to {}", self.key, self.from, self.to)
    }

    /// The format that would hold these raw words, in the LSB of the repaired one, too; `None` where the repaired one does, and
    /// of a length that is no format.
    pub fn longer(&self, range: (i128, i128), symmetric: bool) -> Option<Format> {
        let to: Format = self.to.parse().ok()?;
        holding(to, range, symmetric).filter(|held| *held != to)
    }

    /// True if a node of this name has its format from the key.
    pub fn is_of(&self, node: &str) -> bool {
        is_of(&self.key, node)
    }
}

fn is_of(key: &str, node: &str) -> bool {
    node == key || node.strip_prefix(key).is_some_and(|r| r.starts_with(' '))
}

/// Repairs overflow after overflow, running the design again on the same drive and sense codes after each, until nothing
/// overflows. Gives the changes and whether the last run was clean.
pub fn repairs(design: &Design, seen: &Seen, codes: (&[i32], &[i32])) -> (Vec<Repair>, bool) {
    let mut repairs: Vec<Repair> = Vec::new();
    let (mut design, mut seen) = (design.clone(), seen.clone());
    while seen.first_overflow.is_some() {
        if repairs.len() == MOST_REPAIRS {
            return (repairs, false);
        }
        let Some((mut repair, repaired)) = smallest_repair(&design, &seen) else {
            return (repairs, false);
        };
        let run = |design: &Design| run::run(design, codes.0, codes.1);
        (design, seen) = (repaired.clone(), run(&repaired));
        while is_enough(&repair, &seen)
            && let Some((shorter, less)) = one_bit_less(&repair, &design)
        {
            let tried = run(&less);
            if !is_enough(&shorter, &tried) {
                break;
            }
            (repair, design, seen) = (shorter, less, tried);
        }
        repairs.push(repair);
    }
    (repairs, true)
}

/// The smallest change of the first overflowing node's format that holds every word which this run
/// brought to it: integer bits are added, fraction bits kept; an unsigned format becomes signed if a
/// word is negative. `circuit.cordic.width` becomes what every ADC code needs (proved). `None` if no format of 64 bits does, or
/// the design would then need more than 127 bits.
pub fn smallest_repair(design: &Design, seen: &Seen) -> Option<(Repair, Design)> {
    let event = seen.first_overflow.as_ref()?;
    let key = event.label.key;
    let mut repaired = design.clone();
    let (from, to) = match key {
        "circuit.cordic.width" => {
            let width = &mut repaired.circuit.cordic.width;
            let from = *width;
            let proved = TooShort::of(design).map_or(0, |short| short.needs);
            *width = seen.needed_width.max(proved);
            (from <= 64 && *width <= 64).then(|| (from.to_string(), width.to_string()))?
        }
        "circuit.phase_loop.integrator_bits" => {
            let bits = &mut repaired.circuit.phase_loop.as_mut()?.integrator_bits;
            let from = *bits;
            *bits = signed_bits(words_before(seen, key));
            (*bits <= 64).then(|| (from.to_string(), bits.to_string()))?
        }
        _ => {
            let quantizer = quantizer_mut(&mut repaired, key)?;
            let from = quantizer.format;
            let symmetric = quantizer.overflow == Overflow::SaturateSymmetric;
            quantizer.format = holding(from, words_before(seen, key), symmetric)?;
            (from.to_string(), quantizer.format.to_string())
        }
    };
    limits::check(&repaired).ok()?;
    let key = key.to_owned();
    Some((Repair { key, from, to }, repaired))
}

/// The same repair with one integer bit less: a word that saturated may have brought larger ones to its own
/// format than the repaired design does. `None` if nothing is left to take away.
pub fn one_bit_less(repair: &Repair, repaired: &Design) -> Option<(Repair, Design)> {
    let mut design = repaired.clone();
    let format = &mut quantizer_mut(&mut design, &repair.key)?.format;
    format.integer_bits = format.integer_bits.checked_sub(1)?;
    if format.integer_bits < u32::from(format.signed) || format.bits() == 0 {
        return None;
    }
    let to = format.to_string();
    let shorter = Repair {
        to,
        ..repair.clone()
    };
    (shorter.to != shorter.from).then_some((shorter, design))
}

/// True if no word overflowed in the format of a repair.
pub fn is_enough(repair: &Repair, seen: &Seen) -> bool {
    let first = seen.first_overflow.as_ref();
    first.is_none_or(|e| e.label.key != repair.key)
        && nodes_of(seen, &repair.key).all(|n| n.overflows == 0)
}

/// The format and its rules behind a key, where it has them.
pub fn quantizer_mut<'a>(design: &'a mut Design, key: &str) -> Option<&'a mut Quantizer> {
    match key {
        "circuit.demodulator.product" => Some(&mut design.circuit.demodulator.product),
        "circuit.decimator.output" => Some(&mut design.circuit.decimator.output),
        "compensation.accumulator" => Some(&mut design.compensation.as_mut()?.accumulator),
        "compensation.output" => Some(&mut design.compensation.as_mut()?.output),
        _ => None,
    }
}

fn nodes_of<'a>(seen: &'a Seen, key: &'a str) -> impl Iterator<Item = &'a Node> {
    let nodes = seen.nodes.iter();
    nodes.filter(move |n| is_of(key, &n.identity.name))
}

/// Greatest and least word before the overflow step, over all nodes of a key.
fn words_before(seen: &Seen, key: &str) -> (i128, i128) {
    nodes_of(seen, key).fold((0, 0), |(high, low), n| {
        (high.max(n.before.0), low.min(n.before.1))
    })
}

/// Bits of a two's-complement word that holds both.
fn signed_bits((high, low): (i128, i128)) -> u32 {
    let bits = |v: i128| {
        129 - if v < 0 {
            v.leading_ones()
        } else {
            v.leading_zeros()
        }
    };
    bits(high).max(bits(low))
}

/// The format with as few more integer bits as hold both raw words.
fn holding(from: Format, (high, low): (i128, i128), symmetric: bool) -> Option<Format> {
    let low = if symmetric && from.signed {
        low.min(-high) - 1
    } else {
        low
    };
    let signed = from.signed || low < 0;
    let needed = signed_bits((high, low)) - u32::from(!signed);
    let before = from.bits();
    let bits = if from.signed == signed {
        needed.max(before)
    } else {
        needed
    };
    (bits <= 64).then_some(())?;
    Some(Format {
        signed,
        integer_bits: bits
            .saturating_sub(from.fraction_bits)
            .max(u32::from(signed)),
        fraction_bits: from.fraction_bits,
    })
}

/// The format behind a key, as text.
pub fn format_of(design: &Design, key: &str) -> String {
    let circuit = &design.circuit;
    let quantizer = match key {
        "circuit.demodulator.product" => Some(circuit.demodulator.product),
        "circuit.decimator.output" => Some(circuit.decimator.output),
        "compensation.accumulator" => design.compensation.as_ref().map(|c| c.accumulator),
        "compensation.output" => design.compensation.as_ref().map(|c| c.output),
        _ => None,
    };
    match (key, quantizer, &circuit.phase_loop) {
        (_, Some(quantizer), _) => quantizer.to_string(),
        ("circuit.cordic.width", ..) => format!("{} bits", circuit.cordic.width),
        (_, _, Some(l)) => format!("{} bits", l.integrator_bits),
        _ => String::new(),
    }
}

/// Every node that a node's word reaches, to the columns of the output.
pub fn path(design: &Design, node: &str) -> Vec<String> {
    let circuit = &design.circuit;
    let mut path = vec![node.to_owned()];
    let on_phase = design
        .compensation
        .as_ref()
        .is_some_and(|c| c.input == crate::design::CompensationInput::Phase);
    let (key, channel) = node.split_once(' ').unwrap_or((node, ""));
    let drive = channel.starts_with("drive");
    let mut push = |name: String| path.push(name);
    let mut reached = key;
    if reached == "circuit.demodulator.product" {
        push(format!("circuit.decimator.output {channel}"));
        reached = "circuit.decimator.output";
    }
    if reached == "circuit.decimator.output" {
        push(format!("output column {channel}"));
        if drive {
            push("circuit.cordic phase".into());
            push("circuit.cordic magnitude".into());
            reached = "circuit.cordic.width";
        } else if on_phase && channel == "sense_i" {
            reached = "compensation.output rate";
        }
    }
    if reached == "circuit.cordic.width" {
        push("output column phase".into());
        push("output column magnitude".into());
        if circuit.phase_loop.is_some() {
            push("circuit.phase_loop.integrator_bits".into());
            push("output column tuning_word".into());
        }
        if circuit.amplitude_loop.is_some() {
            push("circuit.amplitude_loop integrator".into());
            push("output column gain".into());
        }
        if on_phase {
            reached = "compensation.accumulator";
            push(reached.into());
        }
    } else if reached == "circuit.phase_loop.integrator_bits" {
        push("output column tuning_word".into());
    }
    if reached == "compensation.accumulator" {
        push("compensation.output bias".into());
    }
    if reached.starts_with("compensation.") {
        push("compensation.output rate".into());
        push("output column rate".into());
    }
    path.dedup();
    path
}
