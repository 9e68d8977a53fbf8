//! What to do about an argument that a command does not have.

use clap::CommandFactory;
use clap::error::{ContextKind, ContextValue};

/// Says where a second file belongs: one file alone, the design, has no option.
pub(super) fn with_advice(mut error: clap::Error) -> clap::Error {
    let argument = match error.get(ContextKind::InvalidArg) {
        Some(ContextValue::String(argument)) => argument.clone(),
        _ => return error,
    };
    let mut parser = super::Cli::command();
    parser.build();
    let mut command = given_command().and_then(|name| parser.find_subcommand_mut(name));
    error.remove(ContextKind::Suggested);
    if let Some(ContextValue::String(similar)) = error.get(ContextKind::SuggestedArg)
        && !is_near(&argument, similar)
    {
        error.remove(ContextKind::SuggestedArg);
    }
    if let Some(usage) = command.as_mut().map(|command| command.render_usage()) {
        // The parser's own shows what it believes that the misspelt option stands for as required.
        error.insert(ContextKind::Usage, ContextValue::StyledStr(usage));
    }
    match command.map_or(String::new(), |command| advice(command, &argument)) {
        // A similar option, if there is one, is named beside this.
        none if none.is_empty() => error,
        tip => {
            error.remove(ContextKind::SuggestedArg);
            super::with_tip(error, &tip)
        }
    }
}

/// Whether an option may be a misspelling of another one: the parser takes `--order` for `--force`.
fn is_near(given: &str, similar: &str) -> bool {
    crate::nearest::nearest(given, &[similar]).is_some()
}

/// The command on this process's command line: the first word that is no option.
fn given_command() -> Option<std::ffi::OsString> {
    let mut words = std::env::args_os().skip(1);
    words.find(|word| word.as_encoded_bytes().first() != Some(&b'-'))
}

/// Which command does what is called otherwise elsewhere; `None` for any other word.
pub(super) fn of_command(word: &str) -> Option<&'static str> {
    match word.to_lowercase().as_str() {
        "fit" | "calibrate" | "calibration" | "compensate" => Some(
            "`run --record FILE` fits the bias to a record and writes firmware; `close --record FILE` looks for what that fit leaves",
        ),
        "build" | "generate" | "codegen" => {
            Some("`emit --lang c` (or `rust`) writes the firmware of a design")
        }
        _ => None,
    }
}

/// What to write in the place of a value that an option does not have; `None` where its possible values say enough.
pub(super) fn of_value(option: &str, value: &str) -> Option<&'static str> {
    let is_lang = option.split(' ').next() == Some("--lang");
    let lower = value.to_lowercase();
    let is_both = ["both", "all"].contains(&lower.as_str())
        || (lower.contains("rust")
            && lower
                .split(|c: char| !c.is_alphanumeric())
                .any(|w| w == "c"));
    (is_lang && is_both).then(|| both(&given_command().unwrap_or_default()))
}

/// How both languages are had.
fn both(command: &std::ffi::OsStr) -> &'static str {
    match command == "emit" {
        true => {
            "one language at a time: once with `--lang c` and once with `--lang rust`, each with a folder of its own (`--out`)"
        }
        false => "leave `--lang` out for both C and Rust",
    }
}

/// What to write in the place of an argument; empty where nothing is known.
fn advice(command: &clap::Command, argument: &str) -> String {
    let said = match (command.get_name(), argument) {
        ("run" | "close", "--record") | ("replay" | "equiv" | "close", "--capture") => "",
        (_, "--record") => "records are taken by `run` and `close`",
        (_, "--capture") => "captures are taken by `replay`, `equiv` and `close`",
        (_, "--for") => {
            "`study` takes limits in `--for`; those of `check` stand in the design's [requirements]"
        }
        ("approx", "--from" | "--to") => "give the domain as --domain=0,1",
        (_, "--lang") => {
            "`close` and `approx` always write both C and Rust, without an option; `run`, `equiv` and `emit` take `--lang`"
        }
        ("run" | "close", "--bound") => {
            "the bound on the compensation's error stands in the design: bound_dps in [compensation]"
        }
        ("run", "--order") => "the order of the fit stands in the design: `order = 3` in [fit]",
        ("simulate", "--samples") => "give how long the run is as --duration S, in seconds",
        (_, "-o") => return of_option(command, "out"),
        (_, "--language") => return of_option(command, "lang"),
        (_, number) if number.starts_with('-') && number.parse::<f64>().is_ok() => {
            "a number is the value of an option, and stands behind its name"
        }
        (_, option) if option.starts_with('-') => "",
        ("approx", function) => {
            return format!(
                "give the function as --function '{function}' and its domain as --domain=0,1"
            );
        }
        ("verify", _) => "one folder at a time",
        _ => return of_files(command),
    };
    said.to_owned()
}

/// What an option of a command takes, as its help says it; `None` where the command does not have it.
fn value_of(command: &clap::Command, long: &str) -> Option<String> {
    let arg = command
        .get_arguments()
        .find(|a| a.get_long() == Some(long))?;
    let name = arg.get_value_names()?.first()?;
    Some(name.to_string())
}

/// An option that another tool calls otherwise.
fn of_option(command: &clap::Command, long: &str) -> String {
    value_of(command, long).map_or(String::new(), |value| {
        format!("did you mean --{long} {value}?")
    })
}

/// Where a file goes that has no option before it.
fn of_files(command: &clap::Command) -> String {
    let given = ["record", "capture", "out"].into_iter().filter_map(|long| {
        let value = value_of(command, long)?;
        let what = match (long, value.as_str()) {
            ("out", "DIR") => "folder for results",
            ("out", _) => "file for results",
            _ => long,
        };
        Some(format!("a {what} is given with --{long} {value}"))
    });
    let design = value_of(command, "design")
        .map(|_| "the design is the one file without an option".to_owned());
    let said: Vec<String> = given.chain(design).collect();
    match said.is_empty() {
        true => "leave it out".to_owned(),
        false => said.join("; "),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn said(command: &str, argument: &str) -> String {
        let parser = super::super::Cli::command();
        advice(
            parser.find_subcommand(command).expect("a command"),
            argument,
        )
    }

    #[test]
    fn a_tip_names_options_that_the_command_has() {
        let approx = said("approx", "sin(x)");
        assert!(approx.contains("--function 'sin(x)'"), "{approx}");
        assert_eq!(said("approx", "--from"), "give the domain as --domain=0,1");
        assert_eq!(said("verify", "b"), "one folder at a time");
        assert_eq!(said("emit", "-o"), "did you mean --out DIR?");
        assert_eq!(said("emit", "--language"), "did you mean --lang LANG?");
        assert_eq!(said("emit", "--foo"), "");
        assert!(said("check", "--for").contains("[requirements]"));
        assert!(said("run", "--bound").contains("bound_dps in [compensation]"));
        assert!(said("run", "--order").contains("`order = 3` in [fit]"));
        assert!(!is_near("--order", "--force") && is_near("--recrod", "--record"));
        assert!(is_near("--forc", "--force"));
        assert!(said("simulate", "--samples").contains("--duration S"));
        assert!(said("equiv", "-5").contains("the value of an option"));
        let emit = said("emit", "b.toml");
        assert!(
            !emit.contains("--record") && emit.contains("the design is"),
            "{emit}"
        );
        assert!(said("run", "b.toml").contains("a record is given with --record FILE"));
    }

    #[test]
    fn a_command_of_another_name_and_both_languages_have_their_tip() {
        assert!(
            of_command("Fit")
                .is_some_and(|t| t.contains("run --record") && t.contains("close --record"))
        );
        assert!(of_command("generate").is_some_and(|t| t.contains("emit")));
        assert_eq!(of_command("clsoe"), None);
        for value in ["both", "ALL", "c,rust", "rust+c"] {
            assert!(of_value("--lang <LANG>", value).is_some(), "{value}");
        }
        assert_eq!(of_value("--lang <LANG>", "python"), None);
        assert_eq!(of_value("--part <PART>", "both"), None);
        assert!(both("emit".as_ref()).contains("one language at a time"));
        assert!(both("run".as_ref()).contains("leave `--lang` out"));
    }
}
