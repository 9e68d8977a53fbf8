//! What to do about an argument that a command does not have.

use clap::CommandFactory;
use clap::error::{ContextKind, ContextValue};

/// Says where a second file belongs: one file alone, the design, has no option.
pub(super) fn with_advice(mut error: clap::Error) -> clap::Error {
    let argument = match error.get(ContextKind::InvalidArg) {
        Some(ContextValue::String(argument)) => argument.clone(),
        _ => return error,
    };
    let parser = super::Cli::command();
    let mut words = std::env::args_os().skip(1);
    let name = words.find(|word| word.as_encoded_bytes().first() != Some(&b'-'));
    let command = name.and_then(|name| parser.find_subcommand(name));
    error.remove(ContextKind::Suggested);
    match command.map_or(String::new(), |command| advice(command, &argument)) {
        // A similar option, if there is one, is named beside this.
        none if none.is_empty() => error,
        tip => super::with_tip(error, &tip),
    }
}

/// What to write in the place of an argument; empty where nothing is known.
fn advice(command: &clap::Command, argument: &str) -> String {
    let said = match (command.get_name(), argument) {
        ("run" | "close", "--record") | ("replay" | "equiv" | "close", "--capture") => "",
        (_, "--record") => "records are taken by `run` and `close`",
        (_, "--capture") => "captures are taken by `replay`, `equiv` and `close`",
        ("approx", "--from" | "--to") => "give the domain as --domain=0,1",
        (_, "--lang") => {
            "`close` and `approx` always write both C and Rust, without an option; `run`, `equiv` and `emit` take `--lang`"
        }
        (_, "-o") => return of_out(command),
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

/// The option that another tool calls `-o`.
fn of_out(command: &clap::Command) -> String {
    value_of(command, "out").map_or(String::new(), |value| {
        format!("did you mean --out {value}?")
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
        assert_eq!(said("emit", "--foo"), "");
        let emit = said("emit", "b.toml");
        assert!(
            !emit.contains("--record") && emit.contains("the design is"),
            "{emit}"
        );
        assert!(said("run", "b.toml").contains("a record is given with --record FILE"));
    }
}
