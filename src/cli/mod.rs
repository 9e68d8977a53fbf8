//! The command line, one file a subcommand: parse, call the library, print.
//!
//! Results go to stdout or to files, talk to stderr. Exit status 0 = done and every check holds,
//! 1 = a check does not hold, 2 = the input cannot be used (`docs/manual.md`).

#[macro_use]
mod terminal;

mod common;

mod alternatives;
mod approx;
mod check;
mod close;
mod controls;
mod emit;
mod equiv;
mod init;
mod recorded;
mod replay;
mod run;
mod schema;
mod self_test;
mod shell;
mod simulate;
mod stages;
mod study;
mod values;
mod verify;

use crate::error::{Error, Result};
use clap::{CommandFactory, FromArgMatches, Parser, Subcommand};
use common::{comparison_table, design, json, threads, warnings};
use recorded::Recorded;
use std::process::ExitCode;

/// From a MEMS gyro's thermal drift to trusted fixed-point firmware.
#[derive(Debug, Parser)]
#[command(name = "gyrogen", version, about, long_about = None, max_term_width = 100)]
struct Cli {
    #[command(subcommand)]
    command: Command,
    /// Print errors only; files are written, and exit statuses are what they are.
    #[arg(long, short, global = true, conflicts_with = "verbose")]
    quiet: bool,
    /// Print each stage of the work and what it took.
    #[arg(long, short, global = true)]
    verbose: bool,
}

#[derive(Debug, Subcommand)]
enum Command {
    Approx(approx::Arguments),
    Check(check::Arguments),
    Close(close::Arguments),
    Completions(shell::Completions),
    Emit(emit::Arguments),
    Equiv(equiv::Arguments),
    Init(init::Arguments),
    Man(shell::Man),
    Replay(replay::Arguments),
    Run(run::Arguments),
    Schema(schema::Arguments),
    Simulate(simulate::Arguments),
    Study(study::Arguments),
    Verify(verify::Arguments),
}

/// Runs the command that the process was started with.
pub fn main() -> ExitCode {
    crate::leftovers::on_signals();
    let parser = Cli::command();
    let result = match parser.clone().try_get_matches() {
        Ok(matches) => {
            let cli = Cli::from_arg_matches(&matches).unwrap_or_else(|e| e.exit());
            terminal::set_loudness(match (cli.quiet, cli.verbose) {
                (true, _) => terminal::Loudness::Quiet,
                (_, true) => terminal::Loudness::Verbose,
                _ => terminal::Loudness::Usual,
            });
            run(&cli.command, &recorded::recorded(&parser, &matches))
        }
        Err(e) if e.use_stderr() => with_advice(e).exit(),
        // Help, the version.
        Err(e) => {
            crate::output::standard::keep(e.print());
            Ok(())
        }
    };
    // What could not be printed does not hide why a command failed.
    let result = result.and_then(|()| crate::output::standard::check());
    // Nothing ends before a signal that has come has removed what is left.
    let _held = crate::leftovers::undisturbed();
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(e) => {
            match &e {
                Error::Check(text) => {
                    terminal::complain(format_args!("check failed: {text}"));
                }
                Error::Input(_) => terminal::complain(format_args!("{e}")),
                Error::ReaderGone => {}
            }
            ExitCode::from(e.exit_status())
        }
    }
}

/// A parser's error with what to do about it.
fn with_advice(mut error: clap::Error) -> clap::Error {
    use clap::error::{ContextKind, ContextValue, ErrorKind};
    let text = |error: &clap::Error, kind| match error.get(kind) {
        Some(ContextValue::String(text)) => text.clone(),
        _ => String::new(),
    };
    match error.kind() {
        ErrorKind::UnknownArgument => of_unknown_argument(error),
        ErrorKind::InvalidSubcommand if error.get(ContextKind::SuggestedSubcommand).is_none() => {
            // `help WORD` asks for no similar word by itself.
            let word = text(&error, ContextKind::InvalidSubcommand);
            let parser = Cli::command();
            let names: Vec<&str> = parser.get_subcommands().map(|c| c.get_name()).collect();
            if let Some(name) = crate::nearest::nearest(&word, &names) {
                let similar = ContextValue::Strings(vec![name.to_owned()]);
                error.insert(ContextKind::SuggestedSubcommand, similar);
            }
            error
        }
        ErrorKind::ValueValidation => {
            if let Some(digits) = values::plain_integer(&text(&error, ContextKind::InvalidValue)) {
                let advice = format!("write the number in digits alone: {digits}");
                let advice = ContextValue::StyledStrs(vec![advice.into()]);
                error.insert(ContextKind::Suggested, advice);
            }
            error
        }
        _ => error,
    }
}

/// Says where a second file belongs: one file alone, the design, has no option.
fn of_unknown_argument(mut error: clap::Error) -> clap::Error {
    use clap::error::{ContextKind, ContextValue};
    let argument = match error.get(ContextKind::InvalidArg) {
        Some(ContextValue::String(argument)) => argument.clone(),
        _ => return error,
    };
    let advice = match argument.as_str() {
        "--record" => "records are taken by `run` and `close`",
        "--capture" => "captures are taken by `replay`, `equiv` and `close`",
        // A similar option, if there is one, is named beside this.
        option if option.starts_with('-') => "",
        _ => {
            "a record is given with --record FILE, a capture with --capture FILE, a folder for results with --out DIR; the \
             design is the one file without an option"
        }
    };
    error.remove(ContextKind::Suggested);
    if !advice.is_empty() {
        let advice = vec![advice.into()];
        error.insert(ContextKind::Suggested, ContextValue::StyledStrs(advice));
    }
    error
}

/// Runs a subcommand; `recorded` is what its files say of how they were made.
fn run(command: &Command, recorded: &Recorded) -> Result<()> {
    if let Some(name) = &recorded.ambiguous {
        talk!(
            "warning: two inputs are called {name}, and the files written here name both by that name alone: rename one \
             to be able to make them again [same_base_name]"
        );
    }
    match command {
        Command::Approx(arguments) => approx::run(arguments, recorded),
        Command::Check(arguments) => check::run(arguments, recorded),
        Command::Close(arguments) => close::run(arguments, recorded),
        Command::Completions(arguments) => shell::completions(arguments, Cli::command()),
        Command::Emit(arguments) => emit::run(arguments, recorded),
        Command::Equiv(arguments) => equiv::run(arguments, recorded),
        Command::Init(arguments) => init::run(arguments),
        Command::Man(arguments) => shell::man(arguments, Cli::command()),
        Command::Replay(arguments) => replay::run(arguments, recorded),
        Command::Run(arguments) => run::run(arguments, recorded),
        Command::Schema(arguments) => schema::run(arguments),
        Command::Simulate(arguments) => simulate::run(arguments, recorded),
        Command::Study(arguments) => study::run(arguments, recorded),
        Command::Verify(arguments) => verify::run(arguments, recorded),
    }
}
