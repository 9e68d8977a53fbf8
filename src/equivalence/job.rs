//! All of `gyrogen equiv`: the paired run, the emitted code, the overflow's repair.

use super::outcome::{Emitted, Equivalence, FirstOverflow, LoopReport, NodeReport};
use super::overflow::{self, Repair};
use super::predicted;
use super::probe::Seen;
use super::run;
use crate::design::Design;
use crate::emit::bundle::Bundle;
use crate::error::Result;
use crate::job::firmware::{Built, Firmware};
use crate::verify::compare;

/// Rows that are compared with emitted code; a decimator of small ratio makes as many rows as samples.
const MOST_ROWS: usize = 1 << 20;

/// Formats that are changed one after the other before a design is called beyond repair.
const MOST_REPAIRS: usize = 12;

/// The codes, and where they came from.
#[derive(Debug, Clone, Copy)]
pub struct Stimulus<'a> {
    /// Drive codes.
    pub drive: &'a [i32],
    /// As many sense codes.
    pub sense: &'a [i32],
    /// In words.
    pub origin: &'a str,
}

/// Runs everything. The result depends on design and codes alone.
///
/// # Errors
/// No compiler, or emitted code that cannot be built or run.
pub fn equivalence(design: &Design, stimulus: Stimulus, command: &str) -> Result<Equivalence> {
    let (seen, emitted) = std::thread::scope(|scope| {
        let emitted = scope.spawn(|| emitted(design, stimulus, command));
        let seen = run::run(design, stimulus.drive, stimulus.sense);
        match emitted.join() {
            Ok(emitted) => (seen, emitted),
            Err(panic) => std::panic::resume_unwind(panic),
        }
    });
    let [c, rust] = emitted?;
    Ok(assemble(design, stimulus, command, &seen, c, rust))
}

/// C and Rust: every table and function, the chain on its own stimulus and on these codes.
fn emitted(design: &Design, stimulus: Stimulus, command: &str) -> Result<[Emitted; 2]> {
    let firmware = Firmware::make(design, command)?;
    let limit = MOST_ROWS.saturating_mul(design.circuit.decimator.ratio as usize);
    let count = stimulus.drive.len().min(limit);
    let (drive, sense) = (
        stimulus.drive.get(..count).unwrap_or_default(),
        stimulus.sense.get(..count).unwrap_or_default(),
    );
    let one = |built: &Built, bundle: &Bundle| -> Result<Emitted> {
        let mut parts = compare::with_model(design, bundle, built.language, &built.harness)?;
        if bundle.has_chain {
            let harness = &built.harness;
            let mut chain = compare::chain(design, built.language, harness, drive, sense)?;
            chain.name = "chain on the stimulus".into();
            parts.push(chain);
        }
        Ok(Emitted::new(parts))
    };
    Ok([
        one(&firmware.c, &firmware.bundle)?,
        one(&firmware.rust, &firmware.bundle)?,
    ])
}

/// Repairs overflow after overflow, running the design again after each, until nothing overflows.
/// Gives the changes and whether the last run was clean.
pub fn repairs(design: &Design, seen: &Seen, stimulus: Stimulus) -> (Vec<Repair>, bool) {
    let mut repairs: Vec<Repair> = Vec::new();
    let (mut design, mut seen) = (design.clone(), seen.clone());
    while seen.first_overflow.is_some() {
        if repairs.len() == MOST_REPAIRS {
            return (repairs, false);
        }
        let Some((repair, repaired)) = overflow::smallest_repair(&design, &seen) else {
            return (repairs, false);
        };
        seen = run::run(&repaired, stimulus.drive, stimulus.sense);
        design = repaired;
        repairs.push(repair);
    }
    (repairs, true)
}

fn assemble(
    design: &Design,
    stimulus: Stimulus,
    command: &str,
    seen: &Seen,
    c: Emitted,
    rust: Emitted,
) -> Equivalence {
    let predictions = predicted::predict(design, seen);
    let pairs = seen.nodes.iter().zip(&predictions);
    let nodes: Vec<NodeReport> = pairs.map(|(n, p)| NodeReport::new(n, p)).collect();
    let (repairs, verified) = repairs(design, seen, stimulus);
    let first_overflow = FirstOverflow::new(design, seen, repairs.first().cloned());
    let repair_verified = first_overflow.is_some().then_some(verified);
    let mut reasons = Vec::new();
    for node in nodes.iter().filter(|n| n.outside_bound > 0) {
        reasons.push(format!(
            "{}: {} of {} words outside their bound, the first at sample {}",
            node.name,
            node.outside_bound,
            node.count,
            node.first_outside_sample.unwrap_or(0)
        ));
    }
    if let Some(first) = &first_overflow {
        reasons.push(first.sentence());
    }
    for (emitted, language) in [(&c, "C"), (&rust, "Rust")] {
        if emitted.mismatches > 0 {
            let first = emitted.first.as_deref().unwrap_or("");
            reasons.push(format!(
                "emitted {language} differs from the model: {first}"
            ));
        }
    }
    Equivalence {
        schema: "gyrogen.equiv/1",
        version: env!("CARGO_PKG_VERSION"),
        design_sha256: design.source.sha256.clone(),
        command: command.to_owned(),
        stimulus: stimulus.origin.to_owned(),
        samples: stimulus.drive.len() as u64,
        rows: stimulus.drive.len() as u64 / u64::from(design.circuit.decimator.ratio),
        nodes,
        model_vs_c: c,
        model_vs_rust: rust,
        first_overflow,
        repairs,
        repair_verified,
        phase_loop: seen.phase_loop.as_ref().map(|l| LoopReport {
            contracting: l.is_contracting(),
            settling_rows: l.settling_rows(),
            lost_at_sample: l.lost_at(),
        }),
        holds: reasons.is_empty(),
        reasons,
        notes: notes(design, seen, &predictions),
        counterexample: None,
    }
}

fn notes(design: &Design, seen: &Seen, predictions: &[predicted::Prediction]) -> Vec<String> {
    let mut notes = Vec::new();
    for (flag, meaning) in predicted::FLAGS {
        if predictions.iter().any(|p| p.flags.contains(&flag)) {
            notes.push(format!("{flag}: {meaning}"));
        }
    }
    if seen.cut_rows > 0 {
        notes.push(format!(
            "on {} rows the drive phase lies so near half a turn that fixed and float stand on both sides of \
             the cut: what is computed from the phase (bias, rate) then differs as the design says it must",
            seen.cut_rows
        ));
    }
    let by_channel = design
        .compensation
        .as_ref()
        .is_some_and(|c| !c.input.is_of_chain());
    if by_channel {
        notes.push(
            "the compensation's input is a word of its own, not the chain's phase: it is no node of the chain, and \
             is compared with emitted code only"
                .into(),
        );
    }
    notes
}
