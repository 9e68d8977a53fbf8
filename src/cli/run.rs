//! `gyrogen run`: the main job, end to end.

use super::alternatives;
use super::recorded::{Recorded, quoted};
use super::stages::Stages;
use super::terminal::OutputFormat;
use crate::emit::views::Language;
use crate::error::{Error, Result};
use crate::job;
use crate::job::DRIFT_BINS;
use crate::job::bound::Line;
use crate::job::outcome::{Drift, Outcome};
use crate::text::{at_most, constant};
use crate::thermal::BaselineFit;
use crate::thermal::order::OrderTrial;
use crate::timing;
use std::path::{Path, PathBuf};

/// Fit the polynomial alone, to the simulated default or a record: fixed point, C and Rust, built and compared, report.
///
/// Use `run` first. It fits one polynomial in the thermometer, writes firmware that subtracts it, and says how much drift
/// is left. If too much is left, use `close` on the same record: it searches for causes that no polynomial follows, and
/// writes firmware against them.
#[derive(Debug, clap::Args)]
pub struct Arguments {
    #[command(flatten)]
    design: super::common::DesignFile,
    /// A measured thermal record (CSV, PX4 ULog, ArduPilot DataFlash); the simulated thermal run of the
    /// design if left out.
    #[arg(long, value_name = "FILE")]
    record: Option<PathBuf>,
    /// Take a temperature correction off again that an autopilot had applied, where its log has the coefficients.
    #[arg(long, requires = "record")]
    undo_correction: bool,
    /// Folder for the results; made if it does not exist.
    #[arg(long, value_name = "DIR", default_value = "gyrogen-out")]
    out: PathBuf,
    /// Language of the emitted code that is built and compared (both are written); both if left out, or that for
    /// which there is a compiler.
    #[arg(long, value_enum, ignore_case = true)]
    lang: Option<Language>,
    #[command(flatten)]
    force: super::common::Force,
    /// How the result is printed on stdout.
    #[arg(long, value_enum, default_value = "text")]
    format: OutputFormat,
}

/// What is written beside the firmware.
const PLANNED: [&str; 5] = [
    "record.csv",
    "design.toml",
    "report.html",
    "summary.json",
    timing::NAME,
];

/// Runs the command.
///
/// # Errors
/// An unusable design or record (exit 2); emitted code that differs from the model (exit 1).
pub fn run(arguments: &Arguments, recorded: &Recorded) -> Result<()> {
    let watch = Stages::start("reading the design");
    if let Some(record) = &arguments.record {
        super::common::refuse_design(("run", "--record"), record, arguments.design.path())?;
    }
    let mut design = arguments.design.read()?;
    design.record.undo_correction = arguments.undo_correction;
    let look = || match &arguments.record {
        Some(record) => crate::record::read_any(record, &design.record).map(drop),
        None => Ok(()),
    };
    let mut results = super::common::claim_after(
        &arguments.out,
        &PLANNED,
        &recorded.inputs,
        arguments.force,
        look,
    )?;
    if !arguments.force.force {
        crate::verify::firmware::refuse_edited(&arguments.out)?;
    }
    if arguments.record.is_none() && !design.record.columns.is_empty() {
        talk!(
            "warning: without --record the firmware is that of the design's simulated gyro, and [record.columns] is not used"
        );
    }
    let languages = super::common::languages(arguments.lang)?;
    let outcome = job::run(
        &design,
        arguments.record.as_deref(),
        &recorded.command,
        &languages,
        &|step| watch.stage(step),
    )?;
    watch.stage("writing");
    let html = crate::report::html(&outcome)?;
    let json = super::json(&outcome.summary);
    for (files, folder) in outcome.parts.firmware.bundles() {
        super::common::bundle(files, folder, &mut results, arguments.force.force)?;
    }
    if let Some(record) = &outcome.parts.record_csv {
        results.write("record.csv", record.as_bytes())?;
    }
    let fitted = job::fitted_design::text(&outcome.parts.design);
    results.write("design.toml", fitted.as_bytes())?;
    results.write("report.html", html.as_bytes())?;
    results.write("summary.json", json.as_bytes())?;
    watch.write(
        &mut results,
        &outcome.summary.design_sha256,
        &recorded.command,
    )?;
    let note = super::earlier::note(
        &arguments.out,
        "summary.json",
        super::earlier::MEASURED,
        &json,
    );
    results.finish()?;
    note.iter().for_each(|note| talk!("{note}"));
    let parts = &outcome.parts;
    if let (Some([columns, rows]), OutputFormat::Text) = (&parts.understood, arguments.format) {
        say!("read: {columns}");
        say!("rows: {rows}");
    }
    let (first, mut others) = super::common::parted(&outcome.summary.warnings, &parts.of_record);
    super::warnings(&first);
    match arguments.format {
        OutputFormat::Json => super::terminal::give(&json),
        OutputFormat::Text => {
            print(&outcome, &arguments.out);
            // What it says stands beside the drift.
            others.retain(|w| w.code != "heating_cooling_loop");
        }
    }
    super::warnings(&others);
    if design.correction.is_some() {
        talk!("{}", super::emit::lacks_correction("compensation"));
    }
    if outcome.holds() {
        // A thermometer that stands is to be mended first.
        if outcome.not_fitted().is_none() && outcome.leaves_drift() {
            talk!("{}", next(arguments));
        }
        return Ok(());
    }
    Err(Error::Check(format!(
        "emitted code differs from the model: {}",
        outcome.differences().join("; ")
    )))
}

/// What comes after a run: the command that looks into the same record.
fn next(arguments: &Arguments) -> String {
    let of = |path: &Path| quoted(path.as_os_str());
    let design = arguments.design.path();
    let design = design.map_or(String::new(), |path| format!(" {}", of(path)));
    let made = arguments.out.join("record.csv");
    let record = of(arguments.record.as_deref().unwrap_or(&made));
    let undo = match arguments.undo_correction {
        true => " --undo-correction",
        false => "",
    };
    format!(
        "next: `gyrogen close{design} --record {record}{undo}` looks for causes of the drift that is left, and writes firmware against \
         them"
    )
}

fn print(outcome: &Outcome, out: &Path) {
    let s = &outcome.summary;
    if let Some(said) = outcome.not_fitted() {
        say!("{said}");
    }
    super::terminal::show(&super::comparison_table(&s.equivalence.functions));
    say!(
        "words compared: of a function its results, state and fault number at each call; of the chain every output word of each row; of a \
         table every entry."
    );
    let mut table = super::terminal::table(&[
        "rate output at rest",
        "drift of bin means, deg/s",
        "rms of readings, deg/s",
        "drift left",
    ]);
    let before = s.before.drift_pp_dps;
    let mut row = |name: &str, drift: Drift| {
        table.add_row([
            name.to_owned(),
            format!("{:.4}", drift.drift_pp_dps),
            format!("{:.4}", drift.rms_dps),
            match before > 0.0 {
                true => format!("{:.2} %", 100.0 * drift.drift_pp_dps / before),
                false => "-".to_owned(),
            },
        ]);
    };
    row("before compensation", s.before);
    row("after, float model", s.after.float);
    row("after, fixed-point model", s.after.fixed);
    for (name, drift) in [
        ("after, emitted C", s.after.c),
        ("after, emitted Rust", s.after.rust),
    ] {
        if let Some(drift) = drift {
            row(name, drift);
        }
    }
    super::terminal::numbers(&mut table, 1..);
    super::terminal::show(&table);
    if let Some(said) = outcome.single_readings() {
        say!("{said}");
    }
    say!(
        "drift: largest less smallest mean over {DRIFT_BINS} bins of the thermometer, in which noise averages out. rms: of every \
         reading about zero, with noise and a constant bias, so that it can be larger than the drift."
    );
    say!("fit in {}: {}.", s.fit.thermometer, s.fit.reason);
    say!(
        "held-out rms {:.4} deg/s{}: each of {} blocks in time was predicted from the others. The noise floor, from differences of neighbouring \
         residuals, is {:.4} deg/s rms. Both are of the fitted polynomial; `close` has other ones, of other rows and with its causes.",
        s.fit.heldout_rms_dps,
        which_rows(&outcome.parts.fit),
        outcome.parts.fit.blocks.len(),
        s.fit.noise_floor_rms_dps
    );
    for chosen in &s.chosen {
        say!("chosen: {chosen}");
    }
    // The bias first: the bound of the rate is made of it.
    let (bias, others) = s.certainty_text.split_at(s.certainty_text.len().min(1));
    for line in bias {
        say!("{line}");
    }
    // The rate can saturate where the bias cannot: the gyro turns.
    let rate = match s.certainty.saturates {
        true => "Nor does the rate".to_owned(),
        false => format!(
            "The rate adds two roundings, of the thermometer to its word and of the rate to the output: it is at most {} deg/s from \
             what the fitted polynomial gives (proved, unless a word saturates)",
            at_most(s.budget.bound_dps, 3)
        ),
    };
    say!("{rate}. The fit's own error is the held-out rms (an estimate).");
    for line in others {
        say!("{line}");
    }
    say!("{}", s.finding);
    if let Some(kept) = &s.bound {
        let errors = ["certified, deg/s", "output LSB"];
        say!(
            "bias function for a bound of {} deg/s on {}:\n{}",
            kept.bound_dps,
            kept.target.name(),
            alternatives::table(&errors, kept.alternatives.iter().map(alternative))
        );
        let marked = kept.alternatives.iter().map(|a| (a.undominated, a.chosen));
        say!("{}", alternatives::marks(marked));
    }
    say!(
        "calibrated for {} .. {} {}",
        constant(s.fit.range.0, 7),
        constant(s.fit.range.1, 7),
        s.fit.unit
    );
    say!(
        "model against emitted {}: {} words compared, {} mismatches",
        s.built(),
        s.equivalence.compared,
        s.equivalence.mismatches
    );
    let mut next = vec!["report.html", "design.toml"];
    next.extend(outcome.parts.record_csv.as_ref().map(|_| "record.csv"));
    next.extend(outcome.parts.firmware.bundles().map(|(_, folder)| folder));
    super::common::wrote(out, &next);
}

/// Which rows the held-out rms is of, where the reason for the order has it of others.
fn which_rows(fit: &BaselineFit) -> &'static str {
    let trial = fit.orders_tried.iter().find(|t| t.order == fit.order);
    match trial.is_some_and(OrderTrial::outliers_change_heldout) {
        true => " of all rows, those that stand out too",
        false => "",
    }
}

fn alternative(line: &Line) -> alternatives::Line<'_> {
    alternatives::Line {
        detail: &line.detail,
        cost: line.cost,
        errors: vec![
            at_most(line.certified_max_dps, 5),
            at_most(line.certified_max_lsb, 4),
        ],
        undominated: line.undominated,
        chosen: line.chosen,
    }
}
