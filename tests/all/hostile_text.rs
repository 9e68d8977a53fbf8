//! Names, columns and paths that are meant to become code: they are refused with the reason, or stand in
//! comments and strings of the emitted sources alone.
//!
//! A small lexer of C and one of Rust take comments and strings out. What is left of a bundle made with hostile texts
//! has to be, token by token, what is left of the same bundle made with plain ones.
//!
//! `GYROGEN_HOSTILE=N`: so many texts.

use crate::common::command::told;
use crate::common::dice::Dice;
use gyrogen::correction::Correction;
use gyrogen::design::reader;
use gyrogen::design::record_columns::unit_of;
use gyrogen::emit::views::Language;
use gyrogen::firmware::correction::{Origin, emit};
use gyrogen::firmware::files::EmittedFile;
use std::path::Path;

/// Texts in an ordinary run.
const TEXTS: usize = 1000;
/// Columns of a correction.
const COLUMNS: usize = 8;
/// Texts that one column or command is made of: a bundle takes a second to emit.
const JOINED: usize = 6;

/// What closes, opens, splices, escapes, reorders or commands.
const PIECES: [&str; 30] = [
    " */ int evil(void); /*",
    "*/",
    "/*",
    "//",
    "\n",
    "\nfn evil() {}\n",
    "\r\n",
    "\\",
    "\\\n",
    "??/",
    "??/\n",
    "\"",
    "\" ; evil(",
    "'",
    "`",
    "*/ /* /*",
    "/* /* */",
    "\u{1b}[2J",
    "\0",
    "\u{202e}",
    "\u{2066}evil\u{2069}",
    "\u{2028}",
    "\u{feff}",
    "$(evil)",
    "#",
    "%:",
    "<::>",
    "r#\"",
    "\"#",
    "é µ °",
];

fn joined(dice: &mut Dice) -> String {
    (0..JOINED).map(|_| hostile(dice)).collect()
}

fn hostile(dice: &mut Dice) -> String {
    let mut below = |n: usize| dice.below(n as u64) as usize;
    let count = 1 + below(5);
    let mut text = String::new();
    for _ in 0..count {
        match below(4) {
            0 => text.push(char::from_u32(below(0x3000) as u32).unwrap_or('*')),
            1 => text.push_str(["supply", "t_degc", "a", "*", "/"][below(5)]),
            _ => text.push_str(PIECES[below(PIECES.len())]),
        }
    }
    text
}

/// C without comments, strings and white space: lines are spliced first, as the standard says.
fn c_tokens(text: &str) -> String {
    let trigraphs = text.replace("??/", "\\");
    let spliced = trigraphs.replace("\\\r\n", "").replace("\\\n", "");
    let all: Vec<char> = spliced.chars().collect();
    let mut left = String::new();
    let mut k = 0;
    while k < all.len() {
        let next = all.get(k + 1).copied();
        match (all[k], next) {
            ('/', Some('*')) => {
                k += 2;
                while k < all.len() && !(all[k] == '*' && all.get(k + 1) == Some(&'/')) {
                    k += 1;
                }
                k += 2;
            }
            ('/', Some('/')) => {
                while k < all.len() && !matches!(all[k], '\n' | '\r') {
                    k += 1;
                }
            }
            (quote @ ('"' | '\''), _) => {
                k += 1;
                while k < all.len() && all[k] != quote && all[k] != '\n' {
                    k += 1 + usize::from(all[k] == '\\');
                }
                k += 1;
                left.push(quote);
            }
            (c, _) => {
                if !c.is_whitespace() {
                    left.push(c);
                }
                k += 1;
            }
        }
    }
    left
}

/// Rust without comments (which nest), strings and white space.
fn rust_tokens(text: &str) -> String {
    let all: Vec<char> = text.chars().collect();
    let mut left = String::new();
    let mut k = 0;
    while k < all.len() {
        match (all[k], all.get(k + 1).copied()) {
            ('/', Some('*')) => {
                let mut depth = 1;
                k += 2;
                while k < all.len() && depth > 0 {
                    match (all[k], all.get(k + 1).copied()) {
                        ('*', Some('/')) => (depth, k) = (depth - 1, k + 2),
                        ('/', Some('*')) => (depth, k) = (depth + 1, k + 2),
                        _ => k += 1,
                    }
                }
            }
            ('/', Some('/')) => {
                while k < all.len() && all[k] != '\n' {
                    k += 1;
                }
            }
            ('"', _) => {
                k += 1;
                while k < all.len() && all[k] != '"' {
                    k += 1 + usize::from(all[k] == '\\');
                }
                k += 1;
                left.push('"');
            }
            (c, _) => {
                if !c.is_whitespace() {
                    left.push(c);
                }
                k += 1;
            }
        }
    }
    left
}

/// A design with a correction that reads these columns.
fn design(columns: &[String]) -> String {
    let quoted = |text: &String| toml::Value::String(text.clone()).to_string();
    let inputs: Vec<String> = columns
        .iter()
        .map(|c| format!("{{ column = {}, offset = 0.0, scale = 1.0 }}", quoted(c)))
        .collect();
    let terms: Vec<String> = (0..columns.len())
        .map(|k| format!("{{ kind = \"product\", gain_dps = 0.5, factors = [[{k}, 1]] }}"))
        .collect();
    format!(
        "[correction]\nperiod_s = 1.0\nfull_scale_dps = 100.0\nnoise_dps = 0.01\ninputs = [{}]\nterms = [{}]\n",
        inputs.join(", "),
        terms.join(", ")
    )
}

fn bundle(columns: &[String], command: &str, language: Language) -> Vec<EmittedFile> {
    let text = design(columns);
    let design = reader::parse(&text, Some(Path::new("d.toml"))).expect("a design");
    let correction: Correction = design
        .correction
        .expect("a correction")
        .compile()
        .expect("a correction");
    let origin = Origin {
        prefix: "hostile",
        sha256: "0",
        command,
    };
    emit(&correction, &origin, language).expect("a bundle")
}

/// What is built by, without comments: every comment of ours is a line of its own.
fn rules(text: &str) -> String {
    let is_comment = |line: &&str| line.starts_with('#');
    text.lines().filter(|l| !is_comment(l)).collect()
}

/// The sources without comments and strings.
fn code(files: &[EmittedFile]) -> Vec<(String, String)> {
    let of = |f: &EmittedFile| match f.path.rsplit('.').next() {
        Some("c" | "h") => Some((f.path.clone(), c_tokens(&f.text))),
        Some("rs") => Some((f.path.clone(), rust_tokens(&f.text))),
        Some("Makefile" | "txt" | "toml") => Some((f.path.clone(), rules(&f.text))),
        _ => None,
    };
    files.iter().filter_map(of).collect()
}

fn texts(count: usize) {
    let mut dice = Dice(2004);
    for language in [Language::C, Language::Rust] {
        for _ in 0..count.div_ceil(2 * JOINED * (COLUMNS + 1)) {
            let columns: Vec<String> = (0..COLUMNS).map(|_| joined(&mut dice)).collect();
            let command = format!("gyrogen emit {}", joined(&mut dice));
            // Of a column's name nothing but its unit reaches the code, which names the parameter after it.
            let plain = columns.iter().map(|c| match unit_of(c) {
                "degC" => "column_degc".to_owned(),
                _ => "column".to_owned(),
            });
            let plain: Vec<String> = plain.collect();
            let expected = code(&bundle(&plain, "gyrogen emit", language));
            assert!(expected.len() >= 2 && expected.iter().any(|(_, text)| text.len() > 1000));
            let files = bundle(&columns, &command, language);
            // Not compared by `assert_eq`, which prints both.
            assert!(code(&files) == expected, "{columns:?} {command:?}");
            for file in files.iter().filter(|f| !f.path.ends_with(".csv")) {
                let is_plain = |c: char| c == '\n' || (c == '\t' && file.path == "Makefile");
                let hidden = |c: &char| !is_plain(*c) && !gyrogen::text::is_visible(*c);
                assert_eq!(file.text.chars().find(hidden), None, "{}", file.path);
            }
        }
    }
}

#[test]
fn hostile_columns_and_commands_stay_in_comments_and_strings() {
    let asked = std::env::var("GYROGEN_HOSTILE").ok();
    texts(asked.and_then(|n| n.parse().ok()).unwrap_or(TEXTS));
}

#[test]
#[ignore = "ten thousand texts take some minutes"]
fn ten_thousand_hostile_texts_stay_in_comments_and_strings() {
    texts(10_000);
}

/// Sources of hostile columns and commands, as compilers see them.
#[test]
#[ignore = "two hundred bundles are compiled: a minute"]
fn two_hundred_hostile_bundles_compile() {
    let mut dice = Dice(1997);
    for round in 0..100 {
        let columns: Vec<String> = (0..COLUMNS).map(|_| hostile(&mut dice)).collect();
        let command = format!("gyrogen emit {}", hostile(&mut dice));
        for language in [Language::C, Language::Rust] {
            let made = tempfile::tempdir().expect("a folder");
            let files = bundle(&columns, &command, language);
            gyrogen::firmware::files::write(&files, made.path()).expect("written");
            let arguments: &[&str] = match language {
                Language::C => &[
                    "-c",
                    "cc -std=c99 -Wall -Wextra -Wconversion -Wshadow -pedantic -Werror -fsyntax-only -I. *.c test/*.c",
                ],
                Language::Rust => &[
                    "-c",
                    "rustc --edition 2021 -D warnings --crate-type rlib --crate-name hostile --emit metadata src/lib.rs",
                ],
            };
            let output = std::process::Command::new("sh")
                .args(arguments)
                .current_dir(made.path())
                .output()
                .expect("a shell");
            assert!(
                output.status.success(),
                "{round} {columns:?} {command:?}: {}",
                told(&output)
            );
        }
    }
}

#[test]
fn the_lexers_see_what_the_languages_see() {
    assert_eq!(c_tokens("a /* b */ c // d\\\ne\nf \"*/\" g"), "acf\"g");
    assert_eq!(c_tokens("a // b ??/\nc\nd"), "ad");
    assert_eq!(
        c_tokens("/* x */ int evil(void); /* y */"),
        "intevil(void);"
    );
    assert_eq!(
        rust_tokens("a /* b /* c */ d */ e // f\ng \"//\" h"),
        "aeg\"h"
    );
}

#[test]
fn a_name_that_becomes_an_identifier_is_refused_with_the_reason() {
    let mut dice = Dice(7);
    let mut names: Vec<String> = (0..2000).map(|_| hostile(&mut dice)).collect();
    let words = [
        "Gyro", "E1", "gyroA", "int8", "size", "while", "match", "self", "core", "std", "_a",
        "a__b", "a_", "é", "", "1a", "gyro-a",
    ];
    names.extend(words.map(str::to_owned));
    for name in names {
        let text = format!("name = {}\n", toml::Value::String(name.clone()));
        match reader::parse(&text, None) {
            Ok(_) => {
                let snake = name
                    .bytes()
                    .all(|b| b.is_ascii_lowercase() || b.is_ascii_digit() || b == b'_');
                assert!(snake && !words.contains(&name.as_str()), "{name:?}");
            }
            Err(e) => {
                let said = e.to_string();
                assert!(said.contains("help:"), "{said}");
                assert!(
                    said.chars()
                        .all(|c| c == '\n' || gyrogen::text::is_visible(c)),
                    "{said:?}"
                );
            }
        }
    }
}
