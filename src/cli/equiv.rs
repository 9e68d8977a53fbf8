//! `gyrogen equiv`: float against fixed node by node, model against emitted C and Rust.

use super::recorded::Recorded;
use super::stages::Stages;
use super::terminal::OutputFormat;
use crate::cosim::stream::{STEPS, stimulus};
use crate::design::Design;
use crate::emit::views::Language;
use crate::equivalence::job::{self, Request, Stimulus};
use crate::equivalence::outcome::{Equivalence, NodeReport};
use crate::equivalence::shrink;
use crate::error::{Error, InputError, Result};
use crate::output::name_of;
use crate::record::capture::CaptureReader;
use crate::text::{away_from_zero_decimals, constant, number};
use crate::timing;
use std::path::{Path, PathBuf};

/// Compare the fixed-point circuit with its float twin, every word within a bound, and the emitted code with the model.
#[derive(Debug, clap::Args)]
pub struct Arguments {
    #[command(flatten)]
    design: super::common::DesignFile,
    /// Captured ADC codes, drive and sense (CSV or NPY); codes made by `--stimulus` if left out.
    #[arg(long, value_name = "FILE")]
    capture: Option<PathBuf>,
    /// ADC samples, 1 to 1000000000; if left out, 10000000, or the whole capture.
    #[arg(long, value_name = "N", value_parser = super::values::whole::<u64>(1..=1_000_000_000))]
    samples: Option<u64>,
    /// Which codes are made where no capture is given.
    #[arg(long, value_enum, default_value = "operating")]
    stimulus: Kind,
    /// A second design file: its circuit runs on the same codes, and the first word that differs is reported.
    #[arg(long, value_name = "DESIGN")]
    against: Option<PathBuf>,
    /// Threads, 1 to 1024; as many as the machine has if left out. The result does not depend on it.
    #[arg(long, value_name = "N", value_parser = super::values::whole::<u16>(1..=1024))]
    threads: Option<u16>,
    /// Folder for the results; made if it does not exist.
    #[arg(long, value_name = "DIR", default_value = "gyrogen-out")]
    out: PathBuf,
    /// Language of the emitted code that is built and compared; both if left out, or that for which there is a
    /// compiler.
    #[arg(long, value_enum, ignore_case = true)]
    lang: Option<Language>,
    #[command(flatten)]
    force: super::common::Force,
    /// How the result is printed on stdout.
    #[arg(long, value_enum, default_value = "text")]
    format: OutputFormat,
}

#[derive(Debug, Clone, Copy, clap::ValueEnum)]
enum Kind {
    /// Those of the design's simulated gyro, at 24 temperatures of its thermal run, at rest and turning.
    Operating,
    /// Tones beside the oscillator, full-scale squares, constants, steps, noise.
    Adversarial,
}

/// ADC samples if nobody says how many.
const SAMPLES: usize = 10_000_000;

/// Runs the command.
///
/// # Errors
/// An unusable design or capture, no compiler (exit 2); a node outside its bound, an overflow, emitted
/// code that differs, a difference from the design given with `--against` (exit 1).
pub fn run(arguments: &Arguments, recorded: &Recorded) -> Result<()> {
    let watch = Stages::start("making the stimulus");
    let design = arguments.design.read()?;
    let planned = [
        "equiv.json",
        "equiv.html",
        job::COUNTEREXAMPLE,
        timing::NAME,
    ];
    if let Some(samples) = arguments.samples {
        enough(&design, samples, None)?;
    }
    let look = || match &arguments.capture {
        Some(path) => CaptureReader::open(path, design.circuit.adc.format).map(drop),
        None => Ok(()),
    };
    let mut results = super::common::claim_after(
        &arguments.out,
        &planned,
        &recorded.inputs,
        arguments.force,
        look,
    )?;
    let languages = super::common::languages(arguments.lang)?;
    let (drive, sense, origin) = codes(&design, arguments)?;
    let stimulus = Stimulus {
        drive: &drive,
        sense: &sense,
        origin: &origin,
    };
    let other = arguments.against.as_deref().map(|p| super::design(Some(p)));
    let other = other.transpose()?;
    let request = Request {
        command: &recorded.command,
        against: other.as_ref(),
        threads: super::threads(arguments.threads),
        languages: &languages,
    };
    watch.stage("comparing");
    let (result, counterexample) = job::equivalence(&design, stimulus, request)?;
    // What fails, does so in however few samples: a shrunk counterexample is a capture too.
    if result.holds {
        enough(&design, drive.len() as u64, arguments.capture.as_deref())?;
    }
    watch.stage("writing");
    let json = super::json(&result);
    results.write("equiv.json", json.as_bytes())?;
    let page = crate::report::equivalence::html(&design, &result)?;
    results.write("equiv.html", page.as_bytes())?;
    if let Some((drive, sense)) = counterexample {
        let text = shrink::capture_text(&design, &drive, &sense);
        results.write(job::COUNTEREXAMPLE, text.as_bytes())?;
    }
    watch.write(&mut results, &result.design_sha256, &recorded.command)?;
    results.finish()?;
    match arguments.format {
        OutputFormat::Json => super::terminal::give(&json),
        OutputFormat::Text => print(&design, &result, &arguments.out),
    }
    super::warnings(&result.warnings);
    if result.holds {
        return Ok(());
    }
    Err(Error::Check(result.reasons.join("; ")))
}

/// Drive and sense codes, and their origin.
fn codes(design: &Design, arguments: &Arguments) -> Result<(Vec<i32>, Vec<i32>, String)> {
    let most = arguments.samples.map(|n| n as usize);
    if let Some(path) = &arguments.capture {
        super::common::refuse_design(("equiv", "--capture"), path, arguments.design.path())?;
        let (drive, sense) = read(design, path, most.unwrap_or(usize::MAX))?;
        return Ok((drive, sense, format!("capture {}", name_of(path))));
    }
    let samples = most.unwrap_or(SAMPLES);
    let (codes, origin) = match arguments.stimulus {
        Kind::Operating => (
            stimulus(design, samples)?,
            format!(
                "the design's gyro in closed loop, in {STEPS} equal stretches at temperatures of its thermal run (up and down), at rest \
                 and turning"
            ),
        ),
        Kind::Adversarial => (
            crate::vectors::stimulus::capture(design, samples, 1),
            "tones, squares, constants, steps and noise".to_owned(),
        ),
    };
    Ok((codes.0, codes.1, origin))
}

/// Refuses fewer samples than make one row; `capture` has them, or else `--samples` asks for them.
///
/// # Errors
/// Too few samples (exit 2).
pub(super) fn enough(design: &Design, samples: u64, capture: Option<&Path>) -> Result<()> {
    let least = job::least_samples(design);
    if samples >= least {
        return Ok(());
    }
    let d = &design.circuit.decimator;
    let why = format!(
        "a row takes {} samples (circuit.decimator.ratio), and the first row of a full decimator is row {}",
        d.ratio,
        least / u64::from(d.ratio)
    );
    Err(match capture {
        Some(path) => InputError::new(format!(
            "the capture has {samples} ADC samples, and {least} are the least: {why}"
        ))
        .in_file(path)
        .help("capture longer: the figures are certain from some thousand rows on"),
        None => InputError::new(format!(
            "`--samples` is {samples}, and {least} are the least: {why}"
        ))
        .help(format!("give `--samples {least}` or more")),
    }
    .into())
}

/// The first codes of a capture.
fn read(design: &Design, path: &Path, most: usize) -> Result<(Vec<i32>, Vec<i32>)> {
    const BLOCK: usize = 1 << 16;
    let mut capture = CaptureReader::open(path, design.circuit.adc.format)?;
    super::replay::warn_of_mismatches(design, &capture);
    let (mut drive, mut sense) = (Vec::new(), Vec::new());
    let (mut d, mut s) = (Vec::new(), Vec::new());
    while drive.len() < most
        && capture.read_block(&mut d, &mut s, BLOCK.min(most - drive.len()))? > 0
    {
        drive.extend_from_slice(&d);
        sense.extend_from_slice(&s);
    }
    Ok((drive, sense))
}

fn print(design: &Design, e: &Equivalence, out: &Path) {
    super::common::say_what_is_emitted(design);
    // In two tables: one of all columns is too wide for a terminal.
    let mut errors = super::terminal::table(&[
        "node",
        "max error, LSB",
        "bound, LSB",
        "rms, LSB",
        "predicted rms, LSB",
    ]);
    let mut words =
        super::terminal::table(&["node", "one LSB is", "headroom", "overflows", "flags"]);
    for n in &e.nodes {
        errors.add_row(error_row(n));
        words.add_row(word_row(n));
    }
    super::terminal::numbers(&mut errors, 1..);
    super::terminal::numbers(&mut words, 1..4);
    super::terminal::show(&errors);
    say!(
        "error: fixed point less floating point, in LSB of the node. Its bound holds at every sample. A node whose LSB is in \
         deg/s is the bias or the rate, or a step on the way to them."
    );
    super::terminal::show(&words);
    say!(
        "headroom: bits by which the words could grow before they overflow. none: they overflowed. -: does not apply."
    );
    if e.nodes.iter().any(|n| n.name.contains(" inner ")) {
        say!(
            "compensation.accumulator: of step k of Horner's scheme, inner k is the product of the input and the step before, outer k its \
             sum with coefficient k."
        );
    }
    say!("{} ADC samples, {} rows: {}", e.samples, e.rows, e.stimulus);
    for (emitted, language) in [(&e.model_vs_c, "C"), (&e.model_vs_rust, "Rust")] {
        let Some(emitted) = emitted else {
            say!("emitted {language}: not built");
            continue;
        };
        say!(
            "emitted {language}: {} words compared with the model, {} mismatches",
            emitted.compared,
            emitted.mismatches
        );
    }
    if let Some(first) = &e.first_overflow {
        say!("{}", first.sentence());
        say!("  path: {}", first.path.join(" > "));
        for repair in &e.repairs {
            say!(
                "  repair: {} = {} (was {})",
                repair.key,
                repair.to,
                repair.from
            );
        }
        if e.repair_verified == Some(true) {
            say!("  tried: with that nothing overflows");
        }
    }
    print_spurs(e);
    if !e.loops.is_empty() {
        super::simulate::show_loops(&e.loops);
    }
    if let Some(against) = &e.against {
        match &against.first_difference {
            Some(first) => say!("{}", first.sentence()),
            None => say!(
                "no word of {} nodes differs from the other design's",
                against.nodes
            ),
        }
        if !against.not_compared.is_empty() {
            say!("  of one design only: {}", against.not_compared.join(", "));
        }
    }
    if let Some(name) = &e.counterexample {
        say!("shrunk stimulus: {name}");
    }
    for note in &e.notes {
        say!("note: {note}");
    }
    say!(
        "verdict: {}",
        if e.holds { "holds" } else { "does not hold" }
    );
    let mut next = vec!["equiv.html"];
    next.extend(e.counterexample.as_deref());
    super::common::wrote(out, &next);
}

fn print_spurs(e: &Equivalence) {
    let s = &e.nco_spurs;
    let Some(measured) = &s.measured else {
        say!("NCO: no carrier to measure spurs against");
        return;
    };
    let db = |level: Option<f64>| level.map_or("none".to_owned(), |l| format!("{l:.2} dBc"));
    say!(
        "spurs of the NCO at {:.3} Hz: {}, the strongest {} (predicted {}). Mixed with the design's quadrature, the worst of them \
         makes a tone of {} deg/s in the rate.",
        s.carrier_hz,
        measured.spurs,
        db(measured.sfdr_dbc.map(|l| -l)),
        db(
            match (s.predicted.truncation_dbc(), s.predicted.table_dbc) {
                (Some(a), Some(b)) => Some(a.max(b)),
                (a, b) => a.or(b),
            }
        ),
        number(s.quadrature_tone_dps, 3)
    );
}

/// A node's errors.
fn error_row(n: &NodeReport) -> Vec<String> {
    let decimals = |v: f64| if v.abs() < 1e3 { 3 } else { 0 };
    let lsb = |v: f64| format!("{:.*}", decimals(v / n.lsb), v / n.lsb);
    let bound = n.bound / n.lsb;
    let some = |v: Option<f64>| v.map_or("-".to_owned(), lsb);
    vec![
        n.name.clone(),
        lsb(n.max_abs_error),
        away_from_zero_decimals(bound, decimals(bound)),
        lsb(n.rms_error),
        some(n.predicted_rms),
    ]
}

/// A node's words and flags.
fn word_row(n: &NodeReport) -> Vec<String> {
    let unit = if n.unit == "1" { "" } else { n.unit };
    vec![
        n.name.clone(),
        format!("{} {unit}", constant(n.lsb, 3))
            .trim_end()
            .to_owned(),
        n.headroom("-"),
        n.overflows.to_string(),
        n.flags.join(" "),
    ]
}
