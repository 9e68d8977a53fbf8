//! Two bit-accurate chains on the same codes: the first word in which they differ.
//!
//! Both run once and leave a digest of all words after every `SPAN` samples. In the first span whose
//! digests differ, both run again and keep their words; these are compared one by one.

use crate::circuit::engine;
use crate::design::Design;
use crate::error::{InputError, Result};
use crate::nodes::layout::Layout;
use crate::nodes::probe::Tap;
use crate::nodes::run::run_tapped;
use crate::numeric::format::pow2;
use serde::Serialize;
use std::cell::RefCell;
use std::rc::Rc;

/// Samples between digests.
const SPAN: u64 = 1 << 14;

/// The result of a comparison.
#[derive(Debug, Clone, PartialEq, Serialize, schemars::JsonSchema)]
pub struct Against {
    /// SHA-256 of the other design's text.
    pub design_sha256: String,
    /// Nodes that both have; the others are left out.
    pub nodes: usize,
    /// Nodes of only one of them.
    pub not_compared: Vec<String>,
    /// Null if no word differs.
    pub first_difference: Option<FirstDifference>,
}

/// The first word in which two chains differ, in the order of the circuit's steps.
#[derive(Debug, Clone, PartialEq, Serialize, schemars::JsonSchema)]
pub struct FirstDifference {
    /// 0-based ADC sample; at the slow rate the period's last.
    pub sample: u64,
    /// 0-based row that the sample belongs to.
    pub row: u64,
    /// The node's name.
    pub node: String,
    /// Its raw words, in this design and in the other.
    pub values: [i128; 2],
    /// The same in the node's unit.
    pub real_values: [f64; 2],
}

impl FirstDifference {
    /// One sentence.
    pub fn sentence(&self) -> String {
        let [a, b] = self.values;
        format!(
            "the designs differ first at sample {} (row {}) in {}: {a} and {b}",
            self.sample, self.row, self.node
        )
    }
}

/// A node of both, and the left shifts that give both words the same LSB.
#[derive(Debug, Clone)]
struct Common {
    name: String,
    fraction_bits: [i32; 2],
}

impl Common {
    fn shift(&self, side: usize) -> u32 {
        let [a, b] = self.fraction_bits;
        let own = if side == 0 { a } else { b };
        (a.max(b) - own).clamp(0, 127) as u32
    }
}

/// Runs both designs, overflows saturating where they would stop, and finds the first difference of value
/// (words of different LSB are compared as the numbers that they are).
///
/// # Errors
/// Designs whose codes, rows or columns are not the same.
pub fn against(design: &Design, other: &Design, drive: &[i32], sense: &[i32]) -> Result<Against> {
    comparable(design, other)?;
    let layouts = [design, other].map(Layout::new);
    let (common, maps, not_compared) = common(&layouts);
    let digests: Vec<Vec<u64>> = [design, other]
        .iter()
        .zip(&maps)
        .enumerate()
        .map(|(side, (d, map))| digests(d, drive, sense, taps(map, &common, side)))
        .collect();
    let [a, b] = digests.as_slice() else {
        return Err(InputError::new("two designs are compared").into());
    };
    let span = a.iter().zip(b).position(|(a, b)| a != b);
    let first_difference = span.and_then(|span| {
        let words: Vec<Vec<Word>> = [design, other]
            .iter()
            .zip(&maps)
            .enumerate()
            .map(|(side, (d, map))| words(d, drive, sense, span as u64, taps(map, &common, side)))
            .collect();
        let pairs = words.first()?.iter().zip(words.get(1)?);
        let (a, b) = pairs.into_iter().find(|(a, b)| a.aligned != b.aligned)?;
        let node = common.get(a.common)?;
        let lsb = node.fraction_bits.map(|bits| pow2(-bits));
        let ratio = u64::from(design.circuit.decimator.ratio);
        Some(FirstDifference {
            sample: a.sample,
            row: a.sample / ratio,
            node: node.name.clone(),
            values: [a.raw, b.raw],
            real_values: [a.raw as f64 * lsb[0], b.raw as f64 * lsb[1]],
        })
    });
    Ok(Against {
        design_sha256: other.source.sha256.clone(),
        nodes: common.len(),
        not_compared,
        first_difference,
    })
}

fn comparable(design: &Design, other: &Design) -> Result<()> {
    let (a, b) = (&design.circuit, &other.circuit);
    let refuse = |key: &str, a: String, b: String| {
        let help = "compare designs that take the same codes and put out the same columns";
        let message = format!(
            "the designs cannot be compared: {key} is {a} in the design and {b} in the other (--against)"
        );
        Err(InputError::new(message).help(help).into())
    };
    if a.adc.format != b.adc.format {
        let (a, b) = (a.adc.format.to_string(), b.adc.format.to_string());
        return refuse("circuit.adc.format", a, b);
    }
    if a.decimator.ratio != b.decimator.ratio {
        let (a, b) = (a.decimator.ratio.to_string(), b.decimator.ratio.to_string());
        return refuse("circuit.decimator.ratio", a, b);
    }
    let columns = [design, other].map(engine::columns);
    for (column, key) in [
        ("rate", "compensation"),
        ("tuning_word", "circuit.phase_loop"),
        ("gain", "circuit.amplitude_loop"),
    ] {
        let [a, b] = [0, 1].map(|k: usize| {
            let there = columns.get(k).is_some_and(|c| c.contains(&column));
            if there { "present" } else { "absent" }.to_owned()
        });
        if a != b {
            return refuse(key, a, b);
        }
    }
    Ok(())
}

/// Nodes by name; for each design which of them its nodes are; names without a partner.
fn common(layouts: &[Layout; 2]) -> (Vec<Common>, [Vec<Option<usize>>; 2], Vec<String>) {
    let [a, b] = layouts;
    let mut common = Vec::new();
    let mut maps = [
        vec![None; a.identities.len()],
        vec![None; b.identities.len()],
    ];
    let mut alone = Vec::new();
    for (k, identity) in a.identities.iter().enumerate() {
        let place = b.identities.iter().position(|i| i.name == identity.name);
        let (Some(at), Some(partner)) = (place, place.and_then(|p| b.identities.get(p))) else {
            alone.push(identity.name.clone());
            continue;
        };
        for (map, k) in maps.iter_mut().zip([k, at]) {
            if let Some(slot) = map.get_mut(k) {
                *slot = Some(common.len());
            }
        }
        common.push(Common {
            name: identity.name.clone(),
            fraction_bits: [identity.fraction_bits, partner.fraction_bits],
        });
    }
    let left = b.identities.iter().zip(&maps[1]);
    alone.extend(
        left.filter(|(_, m)| m.is_none())
            .map(|(i, _)| i.name.clone()),
    );
    (common, maps, alone)
}

/// For each node of a design: which common node, and its shift.
fn taps(map: &[Option<usize>], common: &[Common], side: usize) -> Vec<Option<(usize, u32)>> {
    map.iter()
        .map(|m| m.and_then(|k| Some((k, common.get(k)?.shift(side)))))
        .collect()
}

/// FNV-1a over words.
#[derive(Debug)]
struct Digest {
    nodes: Vec<Option<(usize, u32)>>,
    kept: Rc<RefCell<Vec<u64>>>,
}

impl Tap for Digest {
    fn word(&self, node: usize, sample: u64, raw: i128) {
        let Some(Some((common, shift))) = self.nodes.get(node) else {
            return;
        };
        let word = raw.wrapping_shl(*shift);
        let span = (sample / SPAN) as usize;
        let mut kept = self.kept.borrow_mut();
        if kept.len() <= span {
            kept.resize(span + 1, 0xcbf2_9ce4_8422_2325);
        }
        if let Some(digest) = kept.get_mut(span) {
            for part in [*common as u64, word as u64, (word >> 64) as u64] {
                *digest = (*digest ^ part)
                    .wrapping_mul(0x0100_0000_01b3)
                    .rotate_left(23);
            }
        }
    }
}

fn digests(
    design: &Design,
    drive: &[i32],
    sense: &[i32],
    nodes: Vec<Option<(usize, u32)>>,
) -> Vec<u64> {
    let kept = Rc::new(RefCell::new(Vec::new()));
    let tap = Digest {
        nodes,
        kept: Rc::clone(&kept),
    };
    run_tapped(design, drive, sense, Box::new(tap), &mut |_, _| {});
    kept.take()
}

/// A word of a node that both have.
#[derive(Debug, Clone, Copy)]
struct Word {
    common: usize,
    sample: u64,
    raw: i128,
    /// With the LSB of the finer of both.
    aligned: i128,
}

#[derive(Debug)]
struct Keep {
    nodes: Vec<Option<(usize, u32)>>,
    span: u64,
    kept: Rc<RefCell<Vec<Word>>>,
}

impl Tap for Keep {
    fn word(&self, node: usize, sample: u64, raw: i128) {
        if sample / SPAN != self.span {
            return;
        }
        if let Some(Some((common, shift))) = self.nodes.get(node) {
            self.kept.borrow_mut().push(Word {
                common: *common,
                sample,
                raw,
                aligned: raw.wrapping_shl(*shift),
            });
        }
    }
}

fn words(
    design: &Design,
    drive: &[i32],
    sense: &[i32],
    span: u64,
    nodes: Vec<Option<(usize, u32)>>,
) -> Vec<Word> {
    let end = (((span + 1) * SPAN) as usize).min(drive.len());
    let kept = Rc::new(RefCell::new(Vec::new()));
    let tap = Keep {
        nodes,
        span,
        kept: Rc::clone(&kept),
    };
    let (drive, sense) = (
        drive.get(..end).unwrap_or(drive),
        sense.get(..end).unwrap_or(sense),
    );
    run_tapped(design, drive, sense, Box::new(tap), &mut |_, _| {});
    kept.take()
}
