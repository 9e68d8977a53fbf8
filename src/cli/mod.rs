//! The command line, one file a subcommand: parse, call the library, print.
//!
//! Results go to stdout or to files, talk to stderr. Exit status 0 = done and every check holds,
//! 1 = a check does not hold, 2 = the input cannot be used (`contracts/cli.md`).

mod replay;

use crate::error::{Error, Result};
use clap::{Parser, Subcommand, ValueEnum};
use std::process::ExitCode;

/// From a MEMS gyro's thermal drift to trusted fixed-point firmware.
#[derive(Debug, Parser)]
#[command(name = "gyrogen", version, about, long_about = None, max_term_width = 100)]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    Replay(replay::Arguments),
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
        Command::Replay(arguments) => replay::run(arguments),
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
