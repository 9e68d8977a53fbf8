//! `gyrogen check`: what can be said of a design before anything is built. Ranges are proved for every ADC code
//! and state ([`proved`], by the traced program); codes of the design's own simulated gyro say what does
//! happen ([`crate::nodes::run`]) and what each word's rounding does to the rate ([`budget`]);
//! [`remarks`] name what could be better, with the change that makes it so; [`requirements`] holds the figures
//! against the design's own limits.

pub mod budget;
pub mod outcome;
pub mod proved;
pub mod remarks;
pub mod requirements;

use crate::circuit::setpoint::OutOfReach;
use crate::circuit::{engine, vector_width};
use crate::cosim::stream::stimulus;
use crate::cost::{self, Target};
use crate::design::Design;
use crate::emit::bundle::{Bundle, Part, trace_compensation};
use crate::equivalence::predicted;
use crate::error::Result;
use crate::nodes::node::operation;
use crate::nodes::repair::Repair;
use crate::nodes::{repair, run};
use outcome::{Check, NodeCheck, Overflows, Witness};
use proved::Proved;
use requirements::Requirement;

/// ADC samples of the design's own gyro that are run if nobody says how many.
pub const SAMPLES: usize = 1_000_000;

/// Checks a design; `samples` codes of its own gyro are run.
///
/// # Errors
/// A design whose gyro cannot be simulated; cycles that are required of no processor.
pub fn check(design: &Design, command: &str, samples: usize) -> Result<Check> {
    let program = engine::trace(design);
    let mut all = proved::nodes(design, &program);
    let by_channel = design
        .compensation
        .as_ref()
        .is_some_and(|c| !c.input.is_of_chain());
    if by_channel {
        all.extend(proved::of_casts(&trace_compensation(design)));
    }
    let (drive, sense) = stimulus(design, samples)?;
    let seen = run::run(design, &drive, &sense);
    let predictions = predicted::predict(design, &seen);
    let budget = budget::Budget::new(design, &seen, &predictions);
    let first = seen.first_overflow.as_ref();
    let mut nodes: Vec<NodeCheck> = all
        .iter()
        .map(|p| {
            let mut node = node(design, p, &budget);
            let overflows: u64 = budget.nodes(&p.name).map(|n| n.overflows).sum();
            if overflows > 0 && node.overflow == Overflows::Possible {
                node.overflow = Overflows::Certain;
                let event = first.filter(|e| e.part.starts_with(&p.name));
                node.witness = Some(Witness {
                    words: overflows,
                    sample: event.map(|e| e.sample),
                    operands: event.map_or(Vec::new(), |e| e.operands.clone()),
                    operation: event.map(|e| operation(&e.part, &e.operands)),
                    value: event.map(|e| e.value),
                });
            }
            node
        })
        .collect();
    let bundle = Bundle::new(design, Part::Chain);
    let targets = Target::ALL.into_iter().filter(|t| *t != Target::Host);
    let costs = targets.map(|t| cost::of_bundle(&bundle, t)).collect();
    let remarks = remarks::remarks(design, &nodes, &budget);
    let (requirements, confidence) = requirements::requirements(design)?;
    let of_vector = vector_overflows(design, &mut nodes, samples)?;
    let others = nodes
        .iter()
        .filter(|n| of_vector.is_none() || n.name != vector_width::KEY);
    let mut repairs = repair::repairs(design, &seen, (&drive, &sense)).0;
    let mut reasons: Vec<String> = Vec::new();
    for node in others {
        let Some(mut reason) = node.failure() else {
            continue;
        };
        // Once, though several words have their format from a key.
        if let Some(k) = repairs.iter().position(|r| r.is_of(&node.name)) {
            let mend = repairs.remove(k);
            reason += &format!(
                ". The smallest change that mends it, in {}: {}{}",
                design.place_of(&mend.key),
                mend.change(),
                beyond_the_samples(&mend, &nodes)
            );
        }
        reasons.push(reason);
    }
    reasons.splice(0..0, of_vector);
    reasons.extend(OutOfReach::of(design).map(|far| far.sentence()));
    reasons.extend(requirements.iter().filter_map(Requirement::failure));
    Ok(Check {
        schema: "gyrogen.check/1",
        version: env!("CARGO_PKG_VERSION"),
        design_sha256: design.source.sha256.clone(),
        command: command.to_owned(),
        samples: drive.len() as u64,
        nodes,
        rate_rms_dps: budget.rate_rms_dps(),
        predicted_rate_rms_dps: budget.predicted_rate_rms_dps(),
        costs,
        remarks,
        requirements,
        confidence,
        holds: reasons.is_empty(),
        reasons,
    })
}

/// Where the ranges that are proved of a repaired format's words need a longer one: that the repair is for the samples that were
/// run. "At least", as a word before these that is made longer too may bring larger values to them.
fn beyond_the_samples(mend: &Repair, nodes: &[NodeCheck]) -> String {
    let own = nodes.iter().filter(|n| mend.is_of(&n.name));
    let range = own.clone().fold((0, 0), |(high, low): (i128, i128), n| {
        (high.max(n.proved[1]), low.min(n.proved[0]))
    });
    let symmetric = own.clone().any(|n| n.mode == "saturate_symmetric");
    mend.longer(range, symmetric).map_or(String::new(), |format| {
        format!(" (for the samples that were run; to hold what is proved possible for all inputs it takes at least {format})")
    })
}

fn node(design: &Design, p: &Proved, budget: &budget::Budget) -> NodeCheck {
    let impossible = p.range.is_within(p.limits.low, p.limits.high);
    let overflow = match (p.by_design, impossible) {
        (Some(_), _) => Overflows::ByDesign,
        (None, true) => Overflows::Impossible,
        (None, false) if p.range.low > p.limits.high || p.range.high < p.limits.low => {
            Overflows::Certain
        }
        (None, false) => Overflows::Possible,
    };
    let open = matches!(overflow, Overflows::Possible | Overflows::Certain);
    NodeCheck {
        name: p.name.clone(),
        format: p.format.clone(),
        rounding: p.rounding,
        mode: p.by_design.unwrap_or(p.mode),
        proved: [p.range.low, p.range.high],
        limits: [p.limits.low, p.limits.high],
        headroom_bits: (p.by_design.is_none()).then(|| p.headroom_bits()).flatten(),
        overflow,
        operands: if open { p.operands.clone() } else { Vec::new() },
        path: if open {
            repair::path(design, &p.name)
        } else {
            Vec::new()
        },
        witness: None,
        follows_from: None,
        budget: budget.line(&p.name),
    }
}

/// Why a CORDIC whose x and y wrap fails. The words that overflow through it alone are marked: the design is run again with
/// the width that holds x and y.
fn vector_overflows(
    design: &Design,
    nodes: &mut [NodeCheck],
    samples: usize,
) -> Result<Option<String>> {
    let vector = nodes.iter().find(|n| n.name == vector_width::KEY);
    let Some(vector) = vector.filter(|n| n.overflow == Overflows::Certain) else {
        return Ok(None);
    };
    let Some(short) = vector_width::TooShort::of(design) else {
        return Ok(None);
    };
    let (path, seen) = (vector.path.clone(), vector.seen());
    let mut wide = design.clone();
    wide.circuit.cordic.width = short.needs;
    let (drive, sense) = stimulus(&wide, samples)?;
    let again = run::run(&wide, &drive, &sense);
    let again = budget::Budget::new(&wide, &again, &[]);
    let mut followers = Vec::new();
    let after = |n: &&mut NodeCheck| n.name != vector_width::KEY && path.contains(&n.name);
    for node in nodes.iter_mut().filter(after) {
        let Some(witness) = &node.witness else {
            continue;
        };
        if again.nodes(&node.name).all(|n| n.overflows == 0) {
            followers.push(format!("{} ({} words)", node.name, witness.words));
            node.follows_from = Some(vector_width::KEY);
        }
    }
    let mut reason = format!(
        "{} overflows {} bits: {}. It happened to {seen}",
        vector_width::KEY,
        short.has,
        short.sentence()
    );
    if !followers.is_empty() {
        reason += &format!(
            ". Overflows that follow from it, and are gone with `width = {}`: {}",
            short.needs,
            followers.join(", ")
        );
    }
    Ok(Some(reason))
}

#[cfg(test)]
mod tests;
