//! The command that makes the same files again, as every file records it.
//!
//! One function makes it for all subcommands, from what the parser read: the options in the order in which they are
//! declared, without those that the result does not depend on ([`NOT_OF_THE_RESULT`]) and without values that are the
//! default anyway. Files and folders are named by their base names alone, so that the bytes do not depend on where the
//! command was started; run in a folder that holds the inputs, it gives the same bytes.

use crate::output::base_name;
use clap::parser::ValueSource;
use clap::{Arg, ArgMatches, ValueHint};
use std::ffi::{OsStr, OsString};
use std::path::{Path, PathBuf};

/// Options that say where and how a result is written, not what it is.
const NOT_OF_THE_RESULT: [&str; 8] = [
    "out", "format", "threads", "shard", "merge", "force", "quiet", "verbose",
];

/// What was asked for.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub(super) struct Recorded {
    /// The command, quoted as a shell needs it.
    pub(super) command: String,
    /// Files and folders that are read, as the user named them.
    pub(super) inputs: Vec<PathBuf>,
    /// A base name that two of the inputs share: no one folder can hold both.
    pub(super) ambiguous: Option<String>,
}

/// What `matches` of the whole parser `cli` asks for.
pub(super) fn recorded(cli: &clap::Command, matches: &ArgMatches) -> Recorded {
    let mut out = Recorded::default();
    let mut words: Vec<OsString> = vec![cli.get_name().into()];
    let Some((name, matches)) = matches.subcommand() else {
        return out;
    };
    let Some(subcommand) = cli.find_subcommand(name) else {
        return out;
    };
    words.push(name.into());
    let mut positional = Vec::new();
    for arg in subcommand.get_arguments() {
        let id = arg.get_id().as_str();
        if NOT_OF_THE_RESULT.contains(&id) || !is_given(arg, matches) {
            continue;
        }
        let values = values(arg, matches, &mut out.inputs);
        match arg.get_long() {
            None => positional.extend(values),
            Some(long) if !arg.get_action().takes_values() => {
                words.push(format!("--{long}").into())
            }
            Some(long) => values.into_iter().for_each(|value| {
                // A value that begins with a hyphen is read as an option unless it is tied to its own.
                if value.as_encoded_bytes().first() == Some(&b'-') {
                    let mut word = OsString::from(format!("--{long}="));
                    word.push(value);
                    words.push(word);
                } else {
                    words.extend([format!("--{long}").into(), value]);
                }
            }),
        }
    }
    if positional
        .iter()
        .any(|p| p.as_encoded_bytes().first() == Some(&b'-'))
    {
        // Everything after `--` is positional.
        words.push("--".into());
        words.extend(positional);
    } else {
        // The design stands first, as people write it.
        words.splice(2..2, positional);
    }
    let quoted: Vec<String> = words.iter().map(|word| quoted(word)).collect();
    out.command = quoted.join(" ");
    out.ambiguous = ambiguous(&out.inputs);
    out
}

/// Given by the user, and not just the default.
fn is_given(arg: &Arg, matches: &ArgMatches) -> bool {
    let id = arg.get_id().as_str();
    if matches.value_source(id) != Some(ValueSource::CommandLine) {
        return false;
    }
    if !arg.get_action().takes_values() {
        return matches.get_flag(id);
    }
    let given = matches.get_raw(id).into_iter().flatten();
    !given.eq(arg.get_default_values().iter().map(|v| v.as_os_str()))
}

/// The values of an option, one an occurrence, or those of a positional argument; a path by its base name, and in
/// `inputs` as it was given.
fn values(arg: &Arg, matches: &ArgMatches, inputs: &mut Vec<PathBuf>) -> Vec<OsString> {
    let is_path = arg.get_value_hint() == ValueHint::AnyPath;
    let mut one = |value: &OsStr| {
        if !is_path {
            return value.to_owned();
        }
        inputs.push(value.into());
        base_name(Path::new(value))
    };
    let occurrences = matches.get_raw_occurrences(arg.get_id().as_str());
    let mut out = Vec::new();
    for occurrence in occurrences.into_iter().flatten() {
        let values: Vec<OsString> = occurrence.map(&mut one).collect();
        match arg.get_value_delimiter() {
            // The parser has split the list.
            Some(delimiter) => {
                let delimiter = delimiter.to_string();
                out.push(values.join(OsStr::new(&delimiter)));
            }
            None => out.extend(values),
        }
    }
    out
}

/// The first base name of two files that are not the same one.
fn ambiguous(inputs: &[PathBuf]) -> Option<String> {
    let real = |path: &PathBuf| std::fs::canonicalize(path).unwrap_or_else(|_| path.clone());
    inputs.iter().enumerate().find_map(|(k, path)| {
        let name = base_name(path);
        let is_other = |other: &PathBuf| base_name(other) == name && real(other) != real(path);
        let found = inputs[..k].iter().any(is_other);
        found.then(|| name.to_string_lossy().into_owned())
    })
}

/// A word as a shell reads it back to the same bytes. What could end or garble a comment of the emitted sources (line
/// ends, `*/`, characters that turn the direction of a line) is written as an escape.
pub(super) fn quoted(word: &OsStr) -> String {
    let plain = |c: char| c.is_alphanumeric() || "-_./=,:+@%".contains(c);
    let simple = |c: char| plain(c) || (c.is_ascii() && !c.is_control());
    match word.to_str() {
        Some(text) if !text.is_empty() && text.chars().all(plain) && !text.contains("//") => {
            text.to_owned()
        }
        Some(text)
            if text.chars().all(simple) && !["*/", "/*", "//"].iter().any(|c| text.contains(c)) =>
        {
            format!("'{}'", text.replace('\'', r"'\''"))
        }
        _ => escaped(word),
    }
}

/// As `$'...'`: letters, digits and a few marks as they are, every other byte as three octal digits.
fn escaped(word: &OsStr) -> String {
    let plain = |c: char| c.is_alphanumeric() || " -_.=,:+@%".contains(c);
    let mut out = String::from("$'");
    for chunk in word.as_encoded_bytes().utf8_chunks() {
        for c in chunk.valid().chars() {
            if plain(c) {
                out.push(c);
            } else {
                let mut bytes = [0; 4];
                let bytes = c.encode_utf8(&mut bytes).bytes();
                bytes.for_each(|b| out += &format!("\\{b:03o}"));
            }
        }
        let bytes = chunk.invalid().iter();
        bytes.for_each(|b| out += &format!("\\{b:03o}"));
    }
    out + "'"
}

#[cfg(test)]
#[path = "recorded_tests.rs"]
mod tests;
