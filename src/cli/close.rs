//! `gyrogen close`: what a measurement says beyond its declared model.

use super::closing::{self, Said};
use super::recorded::Recorded;
use super::stages::Stages;
use super::terminal::OutputFormat;
use crate::capture;
use crate::correction::Planned;
use crate::design::Design;
use crate::emit::views::Language;
use crate::error::{Error, InputError, Result};
use crate::firmware::correction;
use crate::firmware::correction::Origin;
use crate::firmware::files::EmittedFile;
use crate::output::{Results, name_of};
use crate::record::capture::CaptureReader;
use crate::record::{ThermalRecord, Warning};
use crate::report::closure::Beside;
use crate::report::design_diff::DesignDiff;
use crate::selftest::controls::Controls;
use crate::thermal::close;
use crate::thermal::close::Closed;
use crate::thermal::firmware::emitted;
use crate::thermal::firmware::emitted::{Emitted, Told};
use crate::thermal::search::Effort;
use crate::timing;
use std::path::{Path, PathBuf};

/// For a record of your own: find which effects the drift consists of, or that none is known, and write firmware against them.
///
/// Use `close` where the polynomial that `run` fits leaves too much drift, or where you want to know what the drift
/// consists of. It searches for causes, such as a lag, a step or a mode crossing, and says how sure each one is. Its
/// firmware takes off bias and causes together, so that it stands in place of that of `run`.
#[derive(Debug, clap::Args)]
#[command(
    override_usage = "gyrogen close [OPTIONS] [DESIGN] --record FILE\n       \
                            gyrogen close [OPTIONS] [DESIGN] --capture FILE\n       \
                            gyrogen close [OPTIONS] [DESIGN] --self-test [--record FILE]"
)]
pub struct Arguments {
    /// A measured thermal record (CSV, PX4 ULog, ArduPilot DataFlash); needed unless --capture or --self-test is given.
    #[arg(long, value_name = "FILE", required_unless_present_any = ["capture", "self_test", "design"])]
    pub(super) record: Option<PathBuf>,
    /// Captured ADC codes in place of a record: CSV, or NPY with its keys in a TOML file beside it.
    #[arg(long, value_name = "FILE", conflicts_with = "record")]
    capture: Option<PathBuf>,
    /// Plant effects of several sizes and say which of them are found; with --record, in the
    /// experiment and the noise of that record.
    #[arg(long, conflicts_with = "capture")]
    self_test: bool,
    /// Build the emitted C and Rust with this machine's compilers, run the whole record through them and
    /// compare every word with the model.
    #[arg(long, conflicts_with_all = ["capture", "self_test"])]
    verify: bool,
    /// Close the record again with columns that mean nothing, and with effects planted in what is left, and say which of
    /// them get a name.
    #[arg(long, conflicts_with_all = ["capture", "self_test"])]
    controls: bool,
    /// Take a temperature correction off again that an autopilot had applied, where its log has the coefficients.
    #[arg(long, conflicts_with = "capture")]
    pub(super) undo_correction: bool,
    #[command(flatten)]
    design: super::common::DesignFile,
    /// Folder for the results; made if it does not exist. If left out, gyrogen-close; a self-test then
    /// writes no files.
    #[arg(long, value_name = "DIR")]
    pub(super) out: Option<PathBuf>,
    #[command(flatten)]
    pub(super) force: super::common::Force,
    /// How the result is printed on stdout.
    #[arg(long, value_enum, default_value = "text")]
    pub(super) format: OutputFormat,
    #[command(flatten)]
    pub(super) test: super::self_test::Options,
}

/// Where results go.
const FOLDER: &str = "gyrogen-close";

/// What is written beside the firmware.
const PLANNED: [&str; 6] = [
    "closure.json",
    "design.toml",
    "design.diff",
    "residuals.csv",
    "report.html",
    timing::NAME,
];

/// Runs the command.
///
/// # Errors
/// An unusable design or record; with `--verify` no compiler (exit 2); emitted code that differs from the model,
/// and with `--controls` a name for a column without meaning (exit 1).
pub fn run(arguments: &Arguments, recorded: &Recorded) -> Result<()> {
    let watch = Stages::start("reading the input");
    let measured = arguments.record.is_some() || arguments.capture.is_some();
    if let Some(alone) = arguments.design.path()
        && !measured
        && !arguments.self_test
    {
        return Err(nothing_measured(alone));
    }
    for (file, option) in [
        (&arguments.record, "--record"),
        (&arguments.capture, "--capture"),
    ] {
        if let Some(file) = file {
            super::common::refuse_design(("close", option), file, arguments.design.path())?;
        }
    }
    let mut design = arguments.design.read()?;
    design.record.undo_correction = arguments.undo_correction;
    if arguments.self_test {
        return super::self_test::run(arguments, &design, recorded, &watch);
    }
    let out = arguments.out.as_deref().unwrap_or(Path::new(FOLDER));
    let look = || match (&arguments.record, &arguments.capture) {
        (Some(record), _) => crate::record::read_any(record, &design.record).map(drop),
        (None, Some(path)) => CaptureReader::open(path, design.circuit.adc.format).map(drop),
        (None, None) => Ok(()),
    };
    let mut results =
        super::common::claim_after(out, &PLANNED, &recorded.inputs, arguments.force, look)?;
    results.replaces("firmware/");
    let mut of_record = Vec::new();
    let (closure, said, compared, controls) = if let Some(path) = &arguments.capture {
        watch.stage("closing");
        let closed = capture::close(path, &design, &recorded.command)?;
        watch.stage("writing");
        let page = crate::report::capture::html(&closed, &name_of(path))?;
        results.write("report.html", page.as_bytes())?;
        (closed.closure, None, None, None)
    } else if let Some(path) = &arguments.record {
        if !arguments.force.force {
            crate::verify::firmware::refuse_edited(out)?;
        }
        let (record, warnings) = crate::record::read_any(path, &design.record)?;
        of_record.clone_from(&warnings);
        watch.stage("closing");
        if arguments.format == OutputFormat::Text {
            say!("read: {}", record.understood(&design.record));
        }
        let mut closed = close::close(
            &record,
            warnings,
            &design,
            &recorded.command,
            Effort::default(),
        )?;
        if arguments.format == OutputFormat::Text {
            let average_s = design.record.average_s;
            let rows = record.rows_understood(&closed.closure.warnings, average_s);
            say!("rows: {rows}");
        }
        super::warnings(&super::common::parted(&closed.closure.warnings, &of_record).0);
        watch.stage("emitting and verifying");
        let prefix = correction::prefix(&design.name);
        let augmented = augmented(&closed, &design);
        let sources = sources(&closed, &prefix, augmented.as_deref())?;
        let compared = if arguments.verify {
            compared(&mut closed, &record, &sources, &prefix)?
        } else {
            None
        };
        let controls = if arguments.controls {
            Some(super::controls::run(&closed, &record, &design, &watch)?)
        } else {
            None
        };
        watch.stage("writing");
        let beside = Beside {
            emitted: compared.as_ref(),
            controls: controls.as_ref(),
            diff: None,
        };
        write(
            &closed,
            path,
            (&design, augmented.as_deref()),
            &sources,
            beside,
            (&mut results, arguments.force.force),
        )?;
        let said = Some(Said::of(&closed));
        (closed.closure, said, compared, controls)
    } else {
        return Ok(());
    };
    let json = super::json(&All {
        told: Told {
            closure: &closure,
            emitted: compared.as_ref(),
        },
        controls: controls.as_ref(),
    });
    results.write("closure.json", json.as_bytes())?;
    watch.write(&mut results, &closure.design_sha256, &recorded.command)?;
    let note = super::earlier::note(out, "closure.json", super::earlier::MEASURED, &json);
    results.finish()?;
    note.iter().for_each(|note| talk!("{note}"));
    match arguments.format {
        OutputFormat::Json => super::terminal::give(&json),
        OutputFormat::Text => closing::print(
            &closure,
            said.as_ref(),
            compared.as_ref(),
            controls.as_ref(),
            out,
        ),
    }
    super::warnings(&super::common::parted(&closure.warnings, &of_record).1);
    let differences = compared.map_or(Vec::new(), |c| c.differences());
    let mut failures = Vec::new();
    if !differences.is_empty() {
        failures.push(format!(
            "the emitted code is not the model: {}",
            differences.join("; ")
        ));
    }
    failures.extend(controls.and_then(|c| c.failure()));
    if failures.is_empty() {
        return Ok(());
    }
    Err(Error::Check(failures.join("; ")))
}

/// A file alone: whether it is the design or the measurement, the other one is missing or has no option.
fn nothing_measured(path: &Path) -> Error {
    let toml = path
        .extension()
        .is_some_and(|e| e.eq_ignore_ascii_case("toml"));
    let file = name_of(path);
    let help = match toml {
        true => format!("give the record beside the design: gyrogen close {file} --record FILE"),
        false => format!(
            "a record is given with --record {file}, a capture of ADC codes with --capture {file}"
        ),
    };
    InputError::new("`close` needs a measurement, and which one is said by an option")
        .in_file(path)
        .help(help)
        .into()
}

/// `closure.json` with what was asked for beside it.
#[derive(serde::Serialize)]
struct All<'a> {
    #[serde(flatten)]
    told: Told<'a>,
    #[serde(skip_serializing_if = "Option::is_none")]
    controls: Option<&'a Controls>,
}

/// The text of the design with the correction, where there is one.
fn augmented(closed: &Closed, design: &Design) -> Option<String> {
    let correction = closed.correction.as_ref()?;
    let planned = Planned {
        plan: correction.plan.clone(),
        noise_dps: correction.formats.noise_dps,
        heldout_rms_dps: correction.heldout_rms_dps,
    };
    Some(crate::job::fitted_design::with_correction(design, &planned))
}

/// The correction in C and in Rust, where there is one. What is emitted names the design that it can be emitted from again.
fn sources(
    closed: &Closed,
    prefix: &str,
    augmented: Option<&str>,
) -> Result<Option<[Vec<EmittedFile>; 2]>> {
    let Some((correction, augmented)) = closed.correction.as_ref().zip(augmented) else {
        return Ok(None);
    };
    let origin = Origin {
        prefix,
        sha256: &crate::digest::sha256(augmented.as_bytes()),
        command: &closed.closure.command,
    };
    let of = |language| correction::emit(correction, &origin, language);
    Ok(Some([of(Language::C)?, of(Language::Rust)?]))
}

/// The sources beside the model; a warning where there are none.
fn compared(
    closed: &mut Closed,
    record: &ThermalRecord,
    sources: &Option<[Vec<EmittedFile>; 2]>,
    prefix: &str,
) -> Result<Option<Emitted>> {
    if let Some(sources) = sources {
        return emitted::check(closed, record, prefix, sources.clone());
    }
    closed.closure.warnings.push(Warning::general(
        "nothing_to_verify",
        "no firmware was emitted, so that none was compared with the model",
    ));
    Ok(None)
}

/// The report, and where there is a correction its sources and the design with it, beside what that changes.
fn write(
    closed: &Closed,
    path: &Path,
    (design, augmented): (&Design, Option<&str>),
    sources: &Option<[Vec<EmittedFile>; 2]>,
    beside: Beside<'_>,
    (results, force): (&mut Results, bool),
) -> Result<()> {
    let augmented = augmented.map(|text| (DesignDiff::of(design, text), text));
    let beside = Beside {
        diff: augmented.as_ref().map(|(diff, _)| diff),
        ..beside
    };
    let page = crate::report::closure::html_beside(closed, &beside, &name_of(path))?;
    if let Some((diff, text)) = &augmented {
        results.write("design.toml", text.as_bytes())?;
        results.write("design.diff", diff.unified.as_bytes())?;
    }
    for (files, folder) in sources
        .iter()
        .flatten()
        .zip(["firmware/c", "firmware/rust"])
    {
        super::common::bundle(files, folder, results, force)?;
    }
    results.write_with("residuals.csv", |path| {
        crate::thermal::residuals::write(closed, path)
    })?;
    results.write("report.html", page.as_bytes())?;
    // A design's text on a terminal; `design.toml` has it.
    if let Some((diff, _)) = &augmented
        && std::io::IsTerminal::is_terminal(&std::io::stderr())
    {
        talk!("{}", diff.sentence());
    }
    Ok(())
}
