//! The command line, one file a subcommand: parse, call the library, print.
//!
//! Results go to stdout or to files, talk to stderr. Exit status 0 = done and every check holds,
//! 1 = a check does not hold, 2 = the input cannot be used (`docs/manual.md`).

/// A line on stdout. A reader that has gone away (`| head`) is no reason to stop: what is written to files
/// is.
macro_rules! say {
    ($($words:tt)*) => {{
        use std::io::Write as _;
        _ = writeln!(std::io::stdout(), $($words)*);
    }};
}

mod alternatives;
mod approx;
mod close;
mod controls;
mod emit;
mod equiv;
mod init;
mod replay;
mod run;
mod self_test;
mod simulate;
mod verify;

use crate::error::{Error, Result};
use crate::verify::compare::Compared;
use clap::{Parser, Subcommand, ValueEnum};
use std::io::IsTerminal;
use std::process::ExitCode;
use std::sync::Mutex;

/// From a MEMS gyro's thermal drift to trusted fixed-point firmware.
#[derive(Debug, Parser)]
#[command(name = "gyrogen", version, about, long_about = None, max_term_width = 100)]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    Approx(approx::Arguments),
    Close(close::Arguments),
    Emit(emit::Arguments),
    Equiv(equiv::Arguments),
    Init(init::Arguments),
    Replay(replay::Arguments),
    Run(run::Arguments),
    Simulate(simulate::Arguments),
    Verify(verify::Arguments),
}

/// How results are printed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, ValueEnum)]
pub enum OutputFormat {
    /// Tables and sentences.
    #[default]
    Text,
    /// The JSON that is written to the file.
    Json,
}

/// Runs the command that the process was started with.
pub fn main() -> ExitCode {
    let cli = Cli::parse();
    let result = match &cli.command {
        Command::Approx(arguments) => approx::run(arguments),
        Command::Close(arguments) => close::run(arguments),
        Command::Emit(arguments) => emit::run(arguments),
        Command::Equiv(arguments) => equiv::run(arguments),
        Command::Init(arguments) => init::run(arguments),
        Command::Replay(arguments) => replay::run(arguments),
        Command::Run(arguments) => run::run(arguments),
        Command::Simulate(arguments) => simulate::run(arguments),
        Command::Verify(arguments) => verify::run(arguments),
    };
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(e) => {
            match &e {
                Error::Check(text) => eprintln!("check failed: {text}"),
                Error::Input(_) => eprintln!("{e}"),
            }
            ExitCode::from(e.exit_status())
        }
    }
}

/// Reads the design named on the command line, or the embedded default.
fn design(path: Option<&std::path::Path>) -> Result<crate::design::Design> {
    crate::design::reader::read(path)
}

/// The threads that were asked for, or as many as the machine has.
fn threads(asked: Option<u16>) -> usize {
    asked.map_or_else(
        || std::thread::available_parallelism().map_or(1, usize::from),
        usize::from,
    )
}

/// Something with a bar of its progress (done, in all) on a terminal, gone when it ends.
fn with_bar<T>(work: impl FnOnce(crate::selftest::Progress<'_>) -> T) -> T {
    let bar: Mutex<Option<indicatif::ProgressBar>> = Mutex::new(None);
    let loud = std::io::stderr().is_terminal();
    let progress = |done: usize, total: usize| {
        if let Ok(mut bar) = bar.lock()
            && loud
        {
            let bar = bar.get_or_insert_with(|| indicatif::ProgressBar::new(total as u64));
            bar.set_position(done as u64);
        }
    };
    let out = work(&progress);
    if let Ok(Some(bar)) = bar.into_inner() {
        bar.finish_and_clear();
    }
    out
}

/// Indented JSON with a final newline: what is written and what `--format json` prints.
fn json<T: serde::Serialize>(value: &T) -> String {
    // Structures of strings and finite numbers always have a JSON form.
    serde_json::to_string_pretty(value).unwrap_or_default() + "\n"
}

/// Makes a folder for results.
fn make_folder(folder: &std::path::Path) -> Result<()> {
    std::fs::create_dir_all(folder)
        .map_err(|e| crate::error::io_error(folder, "make the folder", &e))
}

/// A table of numbers for the terminal.
fn table(header: &[&str]) -> comfy_table::Table {
    let mut table = comfy_table::Table::new();
    table.load_style(comfy_table::presets::UTF8_HORIZONTAL_ONLY);
    table.set_header(header);
    table
}

/// Emitted code against the model, a line each.
fn comparison_table(compared: &[Compared]) -> comfy_table::Table {
    let mut table = table(&[
        "emitted",
        "language",
        "inputs",
        "words compared",
        "mismatches",
    ]);
    for c in compared {
        let inputs = if c.exhaustive {
            format!("{} (all)", c.inputs)
        } else {
            c.inputs.to_string()
        };
        table.add_row([
            c.name.clone(),
            c.language.to_owned(),
            inputs,
            c.compared.to_string(),
            c.mismatches.to_string(),
        ]);
    }
    for column in table.column_iter_mut().skip(2) {
        column.set_cell_alignment(comfy_table::CellAlignment::Right);
    }
    table
}
