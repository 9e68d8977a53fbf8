//! A recorded command is read back by a shell and by the parser, and says the same.

use super::super::Cli;
use super::{Recorded, quoted, recorded};
use clap::{CommandFactory, FromArgMatches};
use proptest::prelude::*;
use proptest::sample::select;
use std::ffi::{OsStr, OsString};
use std::process::Command;

/// What the parser reads from arguments, and what is recorded of it.
fn parsed(arguments: &[OsString]) -> Result<(String, Recorded), clap::Error> {
    let parser = Cli::command();
    let matches = parser.clone().try_get_matches_from(arguments)?;
    let read = format!("{:?}", Cli::from_arg_matches(&matches)?);
    Ok((read, recorded(&parser, &matches)))
}

/// The words that a shell makes of a line.
fn shell_words(line: &str) -> Vec<OsString> {
    let out = Command::new("bash")
        .args(["-c", &format!("printf '%s\\0' {line}")])
        .output()
        .expect("a shell");
    assert!(out.status.success(), "{line}");
    let mut words: Vec<OsString> = out.stdout.split(|b| *b == 0).map(word_of).collect();
    words.pop();
    words
}

#[cfg(unix)]
fn word_of(bytes: &[u8]) -> OsString {
    <OsStr as std::os::unix::ffi::OsStrExt>::from_bytes(bytes).to_owned()
}

/// Any text that an argument can be.
fn word() -> impl Strategy<Value = String> {
    prop_oneof![
        "[a-zA-Z0-9^*+/(). -]{1,12}",
        "\\PC{0,10}",
        "-[a-z]{0,3}[= ]?.{0,5}",
        "[\t\n'\"\\\\$`!*/#~]{1,6}",
    ]
    .prop_map(|text| text.replace('\0', ""))
}

/// Any base name.
fn name() -> impl Strategy<Value = String> {
    word()
        .prop_map(|text| text.replace('/', "%"))
        .prop_filter("a file's name", |text| {
            !["", ".", ".."].contains(&text.as_str())
        })
}

fn option<T: ToString>(
    long: &'static str,
    value: impl Strategy<Value = T>,
) -> impl Strategy<Value = Vec<String>> {
    proptest::option::of(value.prop_map(move |v| format!("--{long}={}", v.to_string())))
        .prop_map(|found| found.into_iter().collect())
}

fn flag(long: &'static str) -> impl Strategy<Value = Vec<String>> {
    any::<bool>().prop_map(move |on| {
        if on {
            vec![format!("--{long}")]
        } else {
            vec![]
        }
    })
}

/// Any of a list.
fn one(of: &'static [&'static str]) -> impl Strategy<Value = String> {
    select(of).prop_map(str::to_owned)
}

/// The parts in one list of arguments.
fn all(parts: Vec<BoxedStrategy<Vec<String>>>) -> BoxedStrategy<Vec<String>> {
    parts.prop_map(|parts| parts.concat()).boxed()
}

fn approx() -> BoxedStrategy<Vec<String>> {
    const FORMATS: &[&str] = &["Q1.15", "UQ0.16", "Q4.28", "Q-3.20", "Q20.-4"];
    let needed = |long: &'static str, value: BoxedStrategy<String>| {
        value
            .prop_map(move |v| vec![format!("--{long}={v}")])
            .boxed()
    };
    let formats = proptest::collection::vec(one(&["Q1.15", "Q2.20", "UQ1.9"]), 1..4);
    let parameters = proptest::collection::vec(word(), 0..3);
    all(vec![
        Just(vec!["approx".to_owned()]).boxed(),
        needed("function", word().boxed()),
        needed("domain", word().boxed()),
        option("degree", 0usize..40).boxed(),
        option("monomials", one(&["all", "odd", "even"])).boxed(),
        needed("input", one(FORMATS).boxed()),
        needed("output", one(FORMATS).boxed()),
        option("coefficients", formats.prop_map(|f| f.join(","))).boxed(),
        option("intermediate", one(FORMATS)).boxed(),
        option("evaluation", one(&["horner", "estrin"])).boxed(),
        option("form", one(&["polynomial", "table", "piecewise", "auto"])).boxed(),
        option("bound", proptest::num::f64::NORMAL).boxed(),
        option("weight", one(&["absolute", "relative"])).boxed(),
        parameters
            .prop_map(|all| all.iter().map(|p| format!("--parameter={p}")).collect())
            .boxed(),
        flag("exhaustive").boxed(),
        option("target", one(&["host", "cortex-m4"])).boxed(),
        option("name", word()).boxed(),
    ])
}

fn with_design(
    command: &'static str,
    options: Vec<BoxedStrategy<Vec<String>>>,
) -> BoxedStrategy<Vec<String>> {
    let design = proptest::option::of(name());
    let design = design.prop_map(|d| d.map_or(vec![], |d| vec!["--".to_owned(), d]));
    let mut parts = vec![Just(vec![command.to_owned()]).boxed()];
    parts.extend(options);
    parts.push(design.boxed());
    all(parts)
}

/// Arguments of any subcommand whose files name their command.
fn arguments() -> BoxedStrategy<Vec<String>> {
    let effects = proptest::collection::vec(word(), 0..3);
    let effects = effects.prop_map(|all| all.iter().map(|e| format!("--effect={e}")).collect());
    let nodes = proptest::collection::vec("[^\0,]{1,6}", 1..4).prop_map(|n| n.join(","));
    let file = |long: &'static str| {
        name()
            .prop_map(move |n| vec![format!("--{long}={n}")])
            .boxed()
    };
    prop_oneof![
        3 => approx(),
        1 => with_design("run", vec![option("record", name()).boxed()]),
        1 => with_design(
            "simulate",
            vec![option("duration", proptest::num::f64::NORMAL).boxed(), option("trace-rows", 1..9000).boxed()],
        ),
        1 => with_design(
            "simulate",
            vec![
                file("profile"),
                option("readings", 10..2000).boxed(),
                option("trace", nodes).boxed(),
                option("trace-format", one(&["csv", "npy", "vcd"])).boxed(),
                option("trace-arith", one(&["fixed", "float"])).boxed(),
            ],
        ),
        1 => with_design(
            "equiv",
            vec![
                option("capture", name()).boxed(),
                option("against", name()).boxed(),
                option("samples", 1..9999).boxed(),
                option("stimulus", one(&["operating", "adversarial"])).boxed(),
            ],
        ),
        1 => with_design(
            "emit",
            vec![
                one(&["c", "rust"]).prop_map(|l| vec![format!("--lang={l}")]).boxed(),
                option("part", one(&["chain", "compensation", "tables", "correction"])).boxed(),
            ],
        ),
        1 => name().prop_map(|bundle| ["verify", "--target=cortex-m4", "--", &bundle].map(str::to_owned).to_vec()),
        1 => all(vec![
            Just(vec!["close".to_owned()]).boxed(),
            file("record"),
            flag("verify").boxed(),
            flag("controls").boxed(),
            option("design", name()).boxed(),
        ]),
        1 => all(vec![Just(vec!["close".to_owned()]).boxed(), file("capture"), option("design", name()).boxed()]),
        1 => all(vec![
            Just(["close", "--self-test"].map(str::to_owned).to_vec()).boxed(),
            option("record", name()).boxed(),
            option("records", 1..1000).boxed(),
            option("clean", 0..1000).boxed(),
            option("seed", any::<u64>()).boxed(),
            effects.boxed(),
        ]),
    ]
    .boxed()
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(200))]

    #[test]
    fn the_recorded_command_is_the_same_request(arguments in arguments()) {
        let given: Vec<OsString> = std::iter::once("gyrogen".to_owned()).chain(arguments).map(OsString::from).collect();
        // What the parser refuses is never recorded.
        let (read, first) = match parsed(&given) {
            Ok(parsed) => parsed,
            Err(refused) => return Err(TestCaseError::reject(refused.to_string())),
        };
        prop_assert!(!first.command.contains(['\n', '\r']) && !first.command.contains("*/"), "{}", first.command);
        let words = shell_words(&first.command);
        let (again, second) = match parsed(&words) {
            Ok(parsed) => parsed,
            Err(refused) => return Err(TestCaseError::fail(format!("{}: {refused}", first.command))),
        };
        prop_assert_eq!(&read, &again, "{}", &first.command);
        prop_assert_eq!(first.command, second.command);
    }

    #[test]
    fn a_shell_reads_a_quoted_word_back(bytes in proptest::collection::vec(1u8.., 0..12)) {
        #[cfg(unix)]
        {
            let word = word_of(&bytes);
            prop_assert_eq!(shell_words(&quoted(&word)), [word]);
        }
    }
}

fn line(arguments: &[&str]) -> Recorded {
    let arguments: Vec<OsString> = arguments.iter().map(OsString::from).collect();
    parsed(&arguments).expect("accepted").1
}

#[test]
fn places_threads_and_defaults_are_not_recorded() {
    let all = line(&[
        "gyrogen",
        "equiv",
        "--threads",
        "2",
        "--out",
        "somewhere/else",
        "--capture",
        "/a/b/c 1.csv",
        "../d/x.toml",
        "--stimulus",
        "operating",
        "--format=json",
    ]);
    assert_eq!(all.command, "gyrogen equiv x.toml --capture 'c 1.csv'");
    assert_eq!(all.inputs.len(), 2);
    assert_eq!(all.ambiguous, None);
    let two = line(&["gyrogen", "equiv", "a/x.toml", "--against", "b/x.toml"]);
    assert_eq!(two.command, "gyrogen equiv x.toml --against x.toml");
    assert_eq!(two.ambiguous.as_deref(), Some("x.toml"));
    let minus = line(&[
        "gyrogen",
        "approx",
        "--function=-x^2",
        "--domain=-1,1",
        "--input",
        "Q1.9",
        "--output",
        "Q2.10",
        "--degree",
        "2",
        "--coefficients",
        "Q2.14,Q2.13",
    ]);
    assert_eq!(
        minus.command,
        "gyrogen approx '--function=-x^2' --domain=-1,1 --degree 2 --input Q1.9 --output Q2.10 --coefficients Q2.14,Q2.13"
    );
    let folder = line(&["gyrogen", "verify", "."]);
    let here = std::env::current_dir().expect("a folder");
    let here = quoted(here.file_name().expect("a name"));
    assert_eq!(folder.command, format!("gyrogen verify {here}"));
    assert_eq!(quoted(OsStr::new("")), "''");
}
