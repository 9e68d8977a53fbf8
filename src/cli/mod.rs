//! The command line, one file a subcommand: parse, call the library, print.
//!
//! Results go to stdout or to files, talk to stderr. Exit status 0 = done and every check holds,
//! 1 = a check does not hold, 2 = the input cannot be used (`docs/manual.md`).

#[macro_use]
mod common;

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
mod values;
mod verify;

use crate::error::Error;
use clap::{Parser, Subcommand};
use common::{OutputFormat, comparison_table, design, json, make_folder, table, threads, with_bar};
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
