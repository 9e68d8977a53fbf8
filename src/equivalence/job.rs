//! All of `gyrogen equiv`: the paired run, the emitted code, the overflow's repair.

use super::outcome::{Emitted, Equivalence, FirstOverflow, LoopReport, NodeReport};
use super::predicted;
use super::{against, shrink};
use crate::design::Design;
use crate::emit::views::Language;
use crate::error::Result;
use crate::nodes::probe::Seen;
use crate::nodes::{repair, run};
use crate::record::Warning;
use crate::simulation::hunting::{Hunting, hunting};
use crate::spectrum::{NcoSpurs, nco_spurs};
use crate::verify::compare;
use crate::verify::firmware::Firmware;

/// Rows that are compared with emitted code; a decimator of small ratio makes as many rows as samples.
const MOST_ROWS: usize = 1 << 20;

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

/// The fewest ADC samples that a comparison says something of: with them the decimator, which starts empty, gives its first row
/// of nothing but samples.
pub fn least_samples(design: &Design) -> u64 {
    let d = &design.circuit.decimator;
    u64::from(d.ratio) * u64::from(d.stages) * u64::from(d.differential_delay)
}

/// How much of it, and how.
#[derive(Debug, Clone, Copy)]
pub struct Request<'a> {
    /// Written into the result.
    pub command: &'a str,
    /// A second design, whose chain runs on the same codes.
    pub against: Option<&'a Design>,
    /// More than one: emitted code is built and compared beside the paired run. The result is the same.
    pub threads: usize,
    /// Languages of the emitted code that is built.
    pub languages: &'a [Language],
}

/// Runs everything; with the result the shrunk stimulus, if a node left its bound or emitted code differs. The result
/// depends on designs, codes and command alone.
///
/// # Errors
/// No compiler, emitted code that cannot be built or run, a design to compare with that does not fit.
pub fn equivalence(
    design: &Design,
    stimulus: Stimulus,
    request: Request,
) -> Result<(Equivalence, Option<Codes>)> {
    let against = request
        .against
        .map(|other| against::against(design, other, stimulus.drive, stimulus.sense));
    let against = against.transpose()?;
    let beside = || Beside::new(design, stimulus, request.command, request.languages);
    let (seen, beside) = if request.threads < 2 {
        let beside = beside();
        (run::run(design, stimulus.drive, stimulus.sense), beside)
    } else {
        std::thread::scope(|scope| {
            let beside = scope.spawn(beside);
            let seen = run::run(design, stimulus.drive, stimulus.sense);
            match beside.join() {
                Ok(beside) => (seen, beside),
                Err(panic) => std::panic::resume_unwind(panic),
            }
        })
    };
    let beside = beside?;
    let outside = |d: &[i32], s: &[i32]| {
        let seen = run::run(design, d, s);
        seen.nodes.iter().any(|n| n.outside > 0)
    };
    let mismatched = |d: &[i32], s: &[i32]| beside.differs(design, d, s);
    let counterexample = counterexample(&seen, &beside.emitted, stimulus, &outside, &mismatched);
    let mut result = assemble(design, stimulus, request.command, &seen, beside);
    result.counterexample = counterexample.as_ref().map(|_| COUNTEREXAMPLE.to_owned());
    if let Some(against) = against {
        result.first_difference = against.first_difference.clone();
        if let Some(first) = &against.first_difference {
            result.holds = false;
            result.reasons.push(first.sentence());
        }
        result.against = Some(against);
    }
    Ok((result, counterexample))
}

/// Drive and sense codes.
pub type Codes = (Vec<i32>, Vec<i32>);

/// The name of the file with the shrunk stimulus.
pub const COUNTEREXAMPLE: &str = "counterexample.csv";

/// The stimulus shrunk to what still makes a node leave its bound (`outside`), or else what still makes emitted code differ
/// from the model (`mismatched`). `None` if neither happened, or emitted code differs elsewhere only.
pub fn counterexample(
    seen: &Seen,
    emitted: &[Option<Emitted>; 2],
    stimulus: Stimulus,
    outside: &dyn Fn(&[i32], &[i32]) -> bool,
    mismatched: &dyn Fn(&[i32], &[i32]) -> bool,
) -> Option<Codes> {
    let on_stimulus = |e: &Emitted| {
        let mut parts = e.parts.iter();
        parts.any(|p| p.name == ON_STIMULUS && p.mismatches > 0)
    };
    let fails = if seen.nodes.iter().any(|n| n.outside > 0) {
        outside
    } else if emitted.iter().flatten().any(on_stimulus) {
        mismatched
    } else {
        return None;
    };
    let (drive, sense) = (stimulus.drive, stimulus.sense);
    Some(shrink::shrink(drive, sense, shrink::MOST_RUNS, fails))
}

/// The chain's comparison on the stimulus, among the parts.
const ON_STIMULUS: &str = "chain on the stimulus";

/// What is done beside the paired run.
struct Beside {
    firmware: Firmware,
    emitted: [Option<Emitted>; 2],
    nco_spurs: NcoSpurs,
    loops: Vec<Hunting>,
    notes: Vec<String>,
}

impl Beside {
    fn new(
        design: &Design,
        stimulus: Stimulus,
        command: &str,
        languages: &[Language],
    ) -> Result<Self> {
        let firmware = Firmware::make(design, command, languages)?;
        let emitted = compared(design, stimulus, &firmware)?;
        let mut notes = Vec::new();
        let loops = hunting(design).unwrap_or_else(|error| {
            notes.push(format!(
                "the loops' limit cycles are not measured, as the run without noise stops: {error}"
            ));
            Vec::new()
        });
        Ok(Beside {
            firmware,
            emitted,
            nco_spurs: nco_spurs(design),
            loops,
            notes,
        })
    }

    /// Does emitted code differ from the model on these codes?
    fn differs(&self, design: &Design, drive: &[i32], sense: &[i32]) -> bool {
        let chain = compare::chain(design, &self.firmware.drivers(), 1, drive, sense);
        chain.is_ok_and(|all| all.iter().any(|c| c.mismatches > 0))
    }
}

/// Every table and function, the chain on its own stimulus and on these codes: by C and Rust, where they were built.
fn compared(
    design: &Design,
    stimulus: Stimulus,
    firmware: &Firmware,
) -> Result<[Option<Emitted>; 2]> {
    let limit = MOST_ROWS.saturating_mul(design.circuit.decimator.ratio as usize);
    let count = stimulus.drive.len().min(limit);
    let (drive, sense) = (
        stimulus.drive.get(..count).unwrap_or_default(),
        stimulus.sense.get(..count).unwrap_or_default(),
    );
    let (bundle, drivers) = (&firmware.bundle, firmware.drivers());
    // Beside the paired run, which has the other thread.
    let mut parts = compare::with_model(design, bundle, &drivers, 1)?;
    if bundle.has_chain {
        let chains = compare::chain(design, &drivers, 1, drive, sense)?;
        for (parts, mut chain) in parts.iter_mut().zip(chains) {
            chain.name = ON_STIMULUS.into();
            parts.push(chain);
        }
    }
    let mut emitted = [None, None];
    for ((language, _), parts) in drivers.iter().zip(parts) {
        emitted[usize::from(*language == Language::Rust)] = Some(Emitted::new(parts));
    }
    Ok(emitted)
}

fn assemble(
    design: &Design,
    stimulus: Stimulus,
    command: &str,
    seen: &Seen,
    beside: Beside,
) -> Equivalence {
    let [c, rust] = beside.emitted;
    let predictions = predicted::predict(design, seen);
    let pairs = seen.nodes.iter().zip(&predictions);
    let nodes: Vec<NodeReport> = pairs.map(|(n, p)| NodeReport::new(n, p)).collect();
    let (repairs, verified) = repair::repairs(design, seen, (stimulus.drive, stimulus.sense));
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
        if let Some(emitted) = emitted.as_ref().filter(|e| e.mismatches > 0) {
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
        notes: [notes(design, seen, &predictions), beside.notes].concat(),
        warnings: Warning::of_setpoint(design).into_iter().collect(),
        nco_spurs: beside.nco_spurs,
        loops: beside.loops,
        against: None,
        first_difference: None,
        counterexample: None,
    }
}

fn notes(design: &Design, seen: &Seen, predictions: &[predicted::Prediction]) -> Vec<String> {
    let mut notes = Vec::new();
    for (flag, meaning) in predicted::FLAGS {
        if predictions.iter().any(|p| p.flags.contains(&flag)) {
            notes.push(format!("nodes flagged [{flag}]: {meaning}"));
        }
    }
    if seen.cut_rows > 0 {
        notes.push(format!(
            "on {} rows the drive phase lies so near half a turn that fixed and float stand on both sides of the cut. What is \
             computed from the phase (bias, rate) differs there as the design says it must. Turn the phase's zero away \
             from the operating point if that is not wanted",
            seen.cut_rows
        ));
    }
    let by_channel = design
        .compensation
        .as_ref()
        .is_some_and(|c| !c.input.is_of_chain());
    if design.correction.is_some() {
        notes.push(
            "the design has a correction, which is not compared here: circuit and compensation alone are. `gyrogen close --verify` \
             compares its code with its model"
                .into(),
        );
    }
    if by_channel {
        notes.push(
            "the compensation's input is a word of its own, not the chain's phase. It is no node of the chain, and is compared \
             with emitted code only"
                .into(),
        );
    }
    notes
}
