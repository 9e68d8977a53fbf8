//! `gyrogen simulate`: plant and circuit in closed loop, float and fixed.

use super::recorded::Recorded;
use super::replay::Arith;
use super::stages::Stages;
use super::terminal::OutputFormat;
use crate::error::{Error, Result};
use crate::output::Results;
use crate::simulation::hunting::{self, Hunting};
use crate::simulation::outcome::{Both, Outcome};
use crate::simulation::trace::Wanted;
use crate::simulation::{self, Course, Request, record_csv};
use crate::text::number;
use crate::timing;
use std::path::{Path, PathBuf};

/// Simulate the gyro and its circuit in closed loop, in float and in fixed point: thermal record, traces, figures.
#[derive(Debug, clap::Args)]
pub struct Arguments {
    #[command(flatten)]
    design: super::common::DesignFile,
    /// Simulate every ADC sample of the first S seconds of the design's thermal run, instead of its averaged readings; the
    /// compensation is not run then.
    #[arg(
        long,
        value_name = "S",
        conflicts_with = "profile",
        value_parser = super::values::number
    )]
    duration: Option<f64>,
    /// A chamber of your own over time, in place of the design's thermal run (CSV: time_s, chamber_degc, and where wanted
    /// rate_dps, supply_v, accel_g).
    #[arg(long, value_name = "FILE")]
    profile: Option<PathBuf>,
    /// Averaged readings along a profile, 10 to 1000000; only with --profile.
    #[arg(long, value_name = "N", default_value_t = 500, requires = "profile", value_parser = super::values::whole::<u64>(10..=1_000_000))]
    readings: u64,
    /// Folder for the results; made if it does not exist.
    #[arg(long, value_name = "DIR", default_value = "gyrogen-simulate")]
    out: PathBuf,
    /// Nodes (words of the circuit) to trace from power-on, separated by commas: names as `equiv` prints them, or their
    /// beginnings; all if left out.
    #[arg(long, value_name = "NODE", value_delimiter = ',')]
    trace: Vec<String>,
    /// Length of the trace, in decimated samples, 1 to 1000000.
    #[arg(long, value_name = "N", default_value_t = 64, value_parser = super::values::whole::<u64>(1..=1_000_000))]
    trace_rows: u64,
    /// Format of the trace's file, `trace.FORMAT`.
    #[arg(long, value_enum, default_value = "vcd")]
    trace_format: TraceFormat,
    /// What is traced: the bit-accurate circuit's raw words, or its float twin's values.
    #[arg(long, value_enum, default_value = "fixed")]
    trace_arith: Arith,
    /// Threads, 1 to 1024; as many as the machine has if left out. The result does not depend on it.
    #[arg(long, value_name = "N", value_parser = super::values::whole::<u16>(1..=1024))]
    threads: Option<u16>,
    #[command(flatten)]
    force: super::common::Force,
    /// How the result is printed on stdout.
    #[arg(long, value_enum, default_value = "text")]
    format: OutputFormat,
}

/// Formats of a trace; the variants' names are the file's extensions.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
enum TraceFormat {
    /// Table of text.
    Csv,
    /// NumPy array.
    Npy,
    /// Value change dump, for wave viewers.
    Vcd,
}

impl TraceFormat {
    fn file_name(self) -> &'static str {
        match self {
            TraceFormat::Csv => "trace.csv",
            TraceFormat::Npy => "trace.npy",
            TraceFormat::Vcd => "trace.vcd",
        }
    }
}

/// Runs the command.
///
/// # Errors
/// An unusable design or profile (exit 2); a circuit that stops on an overflow, a phase loop that does not lock (exit 1).
pub fn run(arguments: &Arguments, recorded: &Recorded) -> Result<()> {
    let watch = Stages::start("reading the design");
    let design = arguments.design.read()?;
    let trace = arguments.trace_format.file_name();
    let planned = [
        "record.csv",
        "readings.csv",
        "design.toml",
        trace,
        "report.html",
        "simulate.json",
        timing::NAME,
    ];
    let mut results =
        super::common::claim(&arguments.out, &planned, &recorded.inputs, arguments.force)?;
    // In another format.
    results.replaces("trace.");
    let request = Request {
        course: match (&arguments.duration, &arguments.profile) {
            (Some(seconds), _) => Course::Continuous(*seconds),
            (None, Some(path)) => Course::Profile(path.clone()),
            (None, None) => Course::ThermalRun,
        },
        profile_readings: arguments.readings,
        threads: super::threads(arguments.threads),
        trace: Wanted {
            nodes: arguments.trace.clone(),
            rows: arguments.trace_rows as usize,
            arithmetic: arguments.trace_arith.into(),
        },
        command: recorded.command.clone(),
    };
    let progress = |what: &str, done: u64, total: u64| {
        watch.stage(what);
        watch.at(done, Some(total));
    };
    let outcome = simulation::simulate(&design, &request, &progress)?;
    watch.stage("writing");
    let json = super::json(&outcome.summary);
    let html = crate::report::simulation::html(&outcome)?;
    write(&outcome, &mut results, trace, &json, &html)?;
    watch.write(
        &mut results,
        &outcome.summary.design_sha256,
        &recorded.command,
    )?;
    results.finish()?;
    match arguments.format {
        OutputFormat::Json => super::terminal::give(&json),
        OutputFormat::Text => print(&outcome, &arguments.out),
    }
    super::warnings(&outcome.summary.warnings);
    let failures = outcome.failures();
    if failures.is_empty() {
        return Ok(());
    }
    Err(Error::Check(failures.join("; ")))
}

fn write(
    outcome: &Outcome,
    results: &mut Results,
    trace: &str,
    json: &str,
    html: &str,
) -> Result<()> {
    let parts = &outcome.parts;
    results.write("record.csv", parts.record_csv.as_bytes())?;
    let readings = record_csv::both_paths(&parts.run.taken, parts.after.as_deref());
    results.write("readings.csv", readings.as_bytes())?;
    if let Some((fitted, _)) = &parts.calibrated {
        let text = crate::job::fitted_design::text(fitted);
        results.write("design.toml", text.as_bytes())?;
    }
    results.write_with(trace, |path| parts.trace.write(path))?;
    results.write("report.html", html.as_bytes())?;
    results.write("simulate.json", json.as_bytes())
}

/// Whose coefficients the rows "after" have: [`simulation::simulate`] fits them to the readings of its own run.
const AFTER: &str = "after: compensated by a polynomial that was fitted to these readings (it is in the design.toml written here), not by the \
                     coefficients of the given design.";

fn print(outcome: &Outcome, out: &Path) {
    let s = &outcome.summary;
    if !s.paper.is_empty() {
        let mut table = super::terminal::table(&[
            "published figure",
            "source",
            "published",
            "obtained",
            "by",
            "",
        ]);
        for f in &s.paper {
            let decimals = decimals(f.tolerance);
            table.add_row([
                f.what.to_owned(),
                f.source.to_owned(),
                format!("{:.decimals$} {}", f.published, f.unit),
                format!("{:.decimals$} {}", f.obtained, f.unit),
                f.by.to_owned(),
                if f.agrees { "agrees" } else { "differs" }.to_owned(),
            ]);
        }
        super::terminal::show(&table);
    }
    let mut table = super::terminal::table(&[
        "rate output",
        "drift of readings, deg/s",
        "rms of readings, deg/s",
        "drift left",
    ]);
    let mut rows = |name: &str, both: &Both| {
        for (path, drift, before) in [
            ("float", both.float, s.before.float),
            ("fixed", both.fixed, s.before.fixed),
        ] {
            let whole = before.drift_pp_dps.max(f64::MIN_POSITIVE);
            table.add_row([
                format!("{name}, {path}"),
                format!("{:.4}", drift.drift_pp_dps),
                format!("{:.4}", drift.rms_dps),
                format!("{:.2} %", 100.0 * drift.drift_pp_dps / whole),
            ]);
        }
    };
    rows("before compensation", &s.before);
    if let Some(after) = &s.after {
        rows("after", after);
    }
    super::terminal::numbers(&mut table, 1..);
    super::terminal::show(&table);
    say!(
        "drift: largest less smallest reading. rms: of the readings about zero, so that a constant bias is in it and not in the \
         drift."
    );
    if s.after.is_some() {
        say!("{AFTER}");
    } else {
        say!(
            "There are no rows \"after\", for no compensation was run: {}.",
            match outcome.parts.run.continuous {
                true => "that takes the averaged readings of a thermal run (leave --duration out)",
                false =>
                    "that takes a run at rest over some temperatures, and a fit whose coefficients their format holds (a warning says where \
                     it does not)",
            }
        );
    }
    if !s.loops.is_empty() {
        show_loops(&s.loops);
    }
    if outcome.parts.run.profile.is_some() {
        say!(
            "Loops and power-on are those of the temperatures in [thermal_run] of the design, not of the profile."
        );
    }
    print_sentences(outcome);
    let mut next = vec!["report.html", "record.csv"];
    if outcome.parts.calibrated.is_some() {
        next.push("design.toml");
    }
    super::common::wrote(out, &next);
}

fn print_sentences(outcome: &Outcome) {
    let s = &outcome.summary;
    let a = &s.float_fixed;
    say!(
        "{} readings, drive at {}. The fixed-point chain is at most {} rad, {} Hz and {} deg/s (before compensation) from the \
         same chain in floating point. The latter has a run of its own, without the rounding of the ADC; in `run` both have the same ADC \
         codes.",
        s.readings,
        s.drive.replace('_', " "),
        number(a.phase_rad, 3),
        number(a.freq_hz, 3),
        number(a.rate_out_dps, 3)
    );
    if let Some(lock) = &s.lock {
        say!(
            "The phase loop is {}. Its mean phase is within {} rad of the setpoint, its frequency within {} Hz of the \
             resonance.{}",
            if lock.locked {
                "locked everywhere"
            } else {
                "not locked everywhere"
            },
            number(lock.phase_error_rad, 3),
            number(lock.freq_error_hz, 3),
            lock.tempco_ppm_per_k.map_or(String::new(), |t| format!(
                " The frequency moves by {t:.2} ppm/K."
            ))
        );
    }
    let time = |t: Option<f64>| t.map_or("not seen".to_owned(), |t| format!("{:.0} ms", 1e3 * t));
    let up = &s.startup;
    say!(
        "After power-on at {} degC the amplitude is within 1 % of its final value after {}, the phase within 0.1 deg of its own after {}{}.",
        up.chamber_degc,
        time(up.amplitude_s),
        time(up.phase_s),
        match up.lock_s {
            Some(t) => format!(", frequency within 10 ppm after {}", time(Some(t))),
            None => String::new(),
        }
    );
}

/// What quantisation leaves of the loops, as a table and what it means.
pub(super) fn show_loops(found: &[Hunting]) {
    let mut table = super::terminal::table(&[
        "loop, unit of its output",
        "degC",
        "output pp\ncircuit",
        "output pp\nmodel",
        "error pp\ncircuit",
        "error pp\nmodel",
        "error pp\nlimit",
        "mean\nerror",
    ]);
    for h in found {
        table.add_row([
            format!("{}, {}", h.name, h.output_unit),
            format!("{}", h.chamber_degc),
            format!("{:.0}", h.output_pp_lsb),
            format!("{:.0}", h.predicted_output_pp_lsb),
            format!("{:.0}", h.error_pp_lsb),
            format!("{:.0}", h.predicted_error_pp_lsb),
            format!("{:.0}", h.most_error_pp_lsb()),
            format!("{:.3}", h.error_mean_lsb),
        ]);
    }
    super::terminal::numbers(&mut table, 1..);
    super::terminal::show(&table);
    for definition in hunting::definitions(found) {
        say!("{definition}");
    }
}

/// Decimals that show a tolerance.
fn decimals(tolerance: f64) -> usize {
    (-tolerance.log10()).ceil().max(0.0) as usize
}
