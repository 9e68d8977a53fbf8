//! Random changes of the default design: never a panic, always an answer with a place.

use crate::design::limits;
use crate::design::reader::parse;
use crate::design::template::DEFAULT;
use crate::error::Error;
use proptest::prelude::*;

#[rustfmt::skip]
const TOKENS: &[&str] = &[
    "",
    "0",
    "-1",
    "1",
    "64",
    "63",
    "1e999",
    "nan",
    "-inf",
    "0x7fff_ffff_ffff_ffff",
    "9e307",
    "18446744073709551616",
    "170141183460469231731687303715884105728",
    "\"Q1.63\"",
    "\"UQ0.64\"",
    "\"Q64.0\"",
    "\"auto\"",
    "\"die_degc\"",
    "{ }",
    "[]",
    "[[",
    "]",
    "=",
    "#",
    "\"",
    "'''",
    ".",
    "true",
    "1979-05-27T07:32:00Z",
    "µ",
    "\0",
    "\u{feff}",
    "raw",
    "format",
    "[circuit]",
    "\n",
    "{ format = \"Q1.63\", overflow = \"error\" }",
    "{ raw = -9223372036854775808, shift = 63 }",
];

/// A change of the text: what kind, where, with what.
fn change(text: &str, (kind, at, token): (u8, usize, usize)) -> String {
    let mut lines: Vec<String> = text.lines().map(str::to_owned).collect();
    if lines.is_empty() {
        return TOKENS[token % TOKENS.len()].to_owned();
    }
    let at = at % lines.len();
    let token = TOKENS[token % TOKENS.len()];
    match kind {
        0 => drop(lines.remove(at)),
        1 => lines.insert(at, lines[at].clone()),
        2 => {
            let other = (at * 7 + 3) % lines.len();
            lines.swap(at, other);
        }
        // Turn a setting on or off.
        3 => match lines[at].strip_prefix('#') {
            Some(setting) => lines[at] = setting.to_owned(),
            None => lines[at].insert(0, '#'),
        },
        4 => match lines[at].split_once('=') {
            Some((key, _)) => lines[at] = format!("{key}= {token}"),
            None => lines[at].push_str(token),
        },
        _ => {
            let middle = lines[at].len() / 2;
            let at_middle = lines[at].is_char_boundary(middle);
            lines[at].insert_str(if at_middle { middle } else { 0 }, token);
        }
    }
    lines.join("\n")
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(600))]

    #[test]
    fn no_change_of_the_text_panics(
        changes in prop::collection::vec((0u8..6, 0usize..1000, 0usize..1000), 1..6),
    ) {
        // Settings rather than explanations: they are a third of the lines.
        let settings: Vec<&str> = DEFAULT
            .lines()
            .filter(|line| !line.starts_with("# ") && !line.is_empty())
            .collect();
        let text = changes.into_iter().fold(settings.join("\n"), |text, c| change(&text, c));
        match parse(&text, None) {
            Ok(design) => prop_assert_eq!(limits::check(&design), Ok(())),
            Err(Error::Input(e)) => {
                prop_assert!(e.line.is_some() && e.column.is_some() && e.help.is_some());
                let _ = e.to_string();
            }
            Err(e) => prop_assert!(false, "{}", e),
        }
    }
}
