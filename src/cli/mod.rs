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
mod closing;
mod controls;
mod earlier;
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
mod unknown;
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
#[command(after_help = "Exit status: 0 done, 1 a check failed, 2 an error.")]
struct Cli {
    #[command(subcommand)]
    command: Command,
    /// Print errors only. Files and exit statuses do not change.
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
    let parser = parser();
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

/// The parser; words that are chosen from a list are taken in capitals too, and numbers with a minus behind an option.
fn parser() -> clap::Command {
    let is_path = |arg: &clap::Arg| {
        let of = arg.get_value_parser().type_id();
        of == std::any::TypeId::of::<std::path::PathBuf>()
    };
    Cli::command().mut_subcommands(|command| {
        command.mut_args(|arg| {
            let is_of_words =
                !arg.get_possible_values().is_empty() && arg.get_action().takes_values();
            let is_value =
                arg.get_action().takes_values() && !arg.is_positional() && !is_path(&arg);
            match (is_of_words, is_value) {
                (true, _) => arg.ignore_case(true),
                // What is wrong with the number is its own parser's to say.
                (false, true) => arg.allow_negative_numbers(true),
                _ => arg,
            }
        })
    })
}

/// A parser's error with what to do about it.
fn with_advice(mut error: clap::Error) -> clap::Error {
    use clap::error::{ContextKind, ContextValue, ErrorKind};
    let text = |error: &clap::Error, kind| match error.get(kind) {
        Some(ContextValue::String(text)) => text.clone(),
        _ => String::new(),
    };
    match error.kind() {
        ErrorKind::UnknownArgument => unknown::with_advice(error),
        ErrorKind::InvalidSubcommand => {
            let word = text(&error, ContextKind::InvalidSubcommand);
            if let Some(tip) = unknown::of_command(&word) {
                error.remove(ContextKind::SuggestedSubcommand);
                return with_tip(error, tip);
            }
            if error.get(ContextKind::SuggestedSubcommand).is_some() {
                return error;
            }
            // `help WORD` asks for no similar word by itself.
            let parser = Cli::command();
            let names: Vec<&str> = parser.get_subcommands().map(|c| c.get_name()).collect();
            if let Some(name) = crate::nearest::nearest(&word, &names) {
                let similar = ContextValue::Strings(vec![name.to_owned()]);
                error.insert(ContextKind::SuggestedSubcommand, similar);
            }
            error
        }
        ErrorKind::InvalidValue => {
            let option = text(&error, ContextKind::InvalidArg);
            match unknown::of_value(&option, &text(&error, ContextKind::InvalidValue)) {
                Some(tip) => with_tip(error, tip),
                None => error,
            }
        }
        ErrorKind::ValueValidation => {
            match values::plain_integer(&text(&error, ContextKind::InvalidValue)) {
                Some(digits) => {
                    let tip = format!("write the number in digits alone: {digits}");
                    with_tip(error, &tip)
                }
                None => error,
            }
        }
        ErrorKind::ArgumentConflict => {
            let (one, other) = (
                text(&error, ContextKind::InvalidArg),
                text(&error, ContextKind::PriorArg),
            );
            with_tip(error, of_conflict(&one, &other))
        }
        ErrorKind::MissingRequiredArgument => {
            let missing = match error.get(ContextKind::InvalidArg) {
                Some(ContextValue::Strings(missing)) => missing.join(" "),
                _ => String::new(),
            };
            with_tip(error, &of_missing(&missing))
        }
        _ => error,
    }
}

/// A parser's error with a line of advice.
fn with_tip(mut error: clap::Error, tip: &str) -> clap::Error {
    use clap::error::{ContextKind, ContextValue};
    let tip = ContextValue::StyledStrs(vec![tip.to_owned().into()]);
    error.insert(ContextKind::Suggested, tip);
    error
}

/// What to do about two options that exclude each other.
fn of_conflict(one: &str, other: &str) -> &'static str {
    let has = |name: &str| one.contains(name) || other.contains(name);
    if one == other && has("--for") {
        return "give all limits in one `--for`, as in --for \"bias_dps<=0.01 arw_deg_rth<=0.01\"";
    }
    if one == other {
        return "give it once";
    }
    if has("[DESIGN]") && has("--design") {
        return "the design is given twice: as a file alone, or with --design, not both";
    }
    if has("--record") && has("--capture") {
        return "a thermal record and a capture of ADC codes are closed by themselves: one command for each";
    }
    if has("--self-test") {
        return "a self-test measures the search itself, on simulated records: run it by itself, or leave `--self-test` out";
    }
    if has("--capture") {
        return "the other option is for thermal records (`--record`): leave it out, or give a record";
    }
    "leave one of the two out"
}

/// What to do about options that are missing.
fn of_missing(missing: &str) -> String {
    const SAID: [(&str, &str); 4] = [
        (
            "--self-test",
            "an option was given that is one of the self-test's: add `--self-test`, or leave that option out",
        ),
        (
            "--profile",
            "`--readings` is how many readings are taken of a profile: add `--profile`, or leave `--readings` out",
        ),
        (
            "--capture",
            "give the captured ADC codes with `--capture FILE` and the file for the rows with `--out FILE`, for example `--capture \
             capture.csv --out rows.csv`; the one file without an option is the design (TOML), which may be left out",
        ),
        (
            "--record",
            "give the measured record with `--record FILE`; `close` takes a capture of ADC codes with `--capture FILE` in its place",
        ),
    ];
    const EXAMPLES: [(&str, &str); 9] = [
        ("--function", "--function 'sin(x)'"),
        ("--domain", "--domain=0,1"),
        ("--input", "--input Q1.15"),
        ("--output", "--output Q1.15"),
        ("--out <DIR>", "--out out"),
        ("--out <FILE>", "--out rows.csv"),
        ("--lang", "--lang c"),
        ("<BUNDLE>", "gyrogen verify out/firmware/c"),
        ("<SHELL>", "gyrogen completions bash"),
    ];
    let words: Vec<&str> = missing.split_whitespace().collect();
    if let Some((_, said)) = SAID.iter().find(|(name, _)| words.contains(name)) {
        return (*said).to_owned();
    }
    if words.contains(&"<NAME>") {
        let names = crate::schemas::NAMES.map(|(name, _)| name);
        return format!("give one of {}", names.join(", "));
    }
    let of_these = EXAMPLES.iter().filter(|(name, _)| missing.contains(name));
    let examples: Vec<&str> = of_these.map(|(_, example)| *example).collect();
    match examples.is_empty() {
        true => "add it; `--help` behind the command says what it is".to_owned(),
        false => format!("for example `{}`", examples.join(" ")),
    }
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_help_of_the_program_has_its_exit_statuses() {
        let said = "Exit status: 0 done, 1 a check failed, 2 an error.";
        let help = parser().render_long_help().to_string();
        assert!(help.trim_end().ends_with(said), "{help}");
    }

    #[test]
    fn every_argument_that_is_required_by_itself_has_an_example() {
        let mut parser = parser();
        parser.build();
        for command in parser.get_subcommands() {
            for arg in command.get_arguments().filter(|a| a.is_required_set()) {
                let tip = of_missing(&arg.to_string());
                assert!(!tip.starts_with("add it"), "{command}: {arg}: {tip}");
            }
        }
        assert_eq!(
            of_missing("--domain <A,B> --output <FORMAT>"),
            "for example `--domain=0,1 --output Q1.15`"
        );
        assert_eq!(of_missing("--out <DIR>"), "for example `--out out`");
        assert_eq!(of_missing("--out <FILE>"), "for example `--out rows.csv`");
        assert!(of_missing("<NAME>").starts_with("give one of design, "));
    }

    #[test]
    fn limits_that_are_given_one_by_one_are_told_to_stand_in_one_option() {
        let twice = of_conflict("--for <LIMITS>", "--for <LIMITS>");
        assert!(twice.contains("all limits in one `--for`"), "{twice}");
        let other = of_conflict("--out <DIR>", "--out <DIR>");
        assert_eq!(other, "give it once");
    }
}
