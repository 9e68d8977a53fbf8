//! `gyrogen approx --bound`: the shortest words that keep the bound, and what is said where none do.

use crate::common::command::{gyrogen, told};
use serde_json::Value;
use std::process::Output;

const BIAS: [&str; 8] = [
    "approx",
    "--function",
    "109.60+242.97*pi*x+136.82*(pi*x)^2",
    "--domain=-0.68,-0.47",
    "--input",
    "Q1.19",
    "--output",
    "Q12.20",
];
const SINE: [&str; 8] = [
    "approx",
    "--function",
    "sin(pi*x/2)",
    "--domain=-1,1",
    "--input",
    "Q1.15",
    "--output",
    "Q1.15",
];

fn approx(request: &[&str], more: &[&str]) -> Output {
    let folder = tempfile::tempdir().unwrap();
    let own = ["--format", "json", "--out", "out"];
    gyrogen(&[request, more, &own[..]].concat(), folder.path())
}

fn made(request: &[&str], more: &[&str]) -> Value {
    let output = approx(request, more);
    let told = told(&output);
    assert!(output.status.success(), "{more:?}: {told}");
    serde_json::from_slice(&output.stdout).unwrap()
}

fn refused(request: &[&str], more: &[&str]) -> String {
    let output = approx(request, more);
    assert_eq!(output.status.code(), Some(2));
    told(&output)
}

fn fraction_bits(json: &Value, which: &str) -> u32 {
    let format = json["formats"][which].as_str().unwrap();
    let (_, bits) = format.rsplit_once(['.', '-']).unwrap();
    bits.parse().unwrap()
}

#[test]
fn a_wide_bound_takes_short_words_and_a_narrow_one_longer_ones() {
    let mut last = (0, 0);
    for bound in ["1", "0.01", "1e-4", "2e-6"] {
        let json = made(&BIAS, &["--form=polynomial", "--bound", bound]);
        let certified = json["error"]["certified_max_abs"].as_f64().unwrap();
        let bound: f64 = bound.parse().unwrap();
        assert!(certified <= bound, "{certified} {bound}");
        // No words for nothing: with 4 bits more than these, most of a bound would be left.
        assert!(certified > 0.1 * bound, "{certified} {bound}");
        let bits = ["coefficients", "intermediate"].map(|w| fraction_bits(&json, w));
        assert!(bits[0] >= last.0 && bits[1] >= last.1, "{bits:?} {last:?}");
        last = (bits[0], bits[1]);
    }
    assert!(last.0 >= 12, "{last:?}");
}

#[test]
fn formats_that_are_given_are_kept() {
    let degree = ["--bound", "0.01", "--form=polynomial"];
    let json = made(
        &BIAS,
        &[&degree[..], &["--coefficients", "Q12.18"]].concat(),
    );
    assert_eq!(json["formats"]["coefficients"], "Q12.18");
    assert!(fraction_bits(&json, "intermediate") < 18);
    let json = made(
        &BIAS,
        &[&degree[..], &["--intermediate", "Q12.22"]].concat(),
    );
    assert_eq!(json["formats"]["intermediate"], "Q12.22");
    assert!(fraction_bits(&json, "coefficients") < 10);
}

#[test]
fn a_refusal_says_how_near_it_came_and_what_is_in_the_way() {
    let cases = [
        (
            vec!["--bound=1e-4", "--degree=3"],
            "`--degree 3` is in the way",
        ),
        (
            vec!["--bound=1e-4", "--degree=5", "--coefficients=Q2.8"],
            "`--coefficients Q2.8` is in the way: without it, odd polynomial of degree 5",
        ),
        (
            vec!["--bound=1e-4", "--intermediate=Q3.9"],
            "`--intermediate Q3.9` is in the way",
        ),
        (
            vec!["--bound=1.6e-5", "--form=auto"],
            "`--output` is in the way: with Q1.16",
        ),
    ];
    for (more, way) in cases {
        let told = refused(&SINE, &more);
        assert!(told.contains("the nearest reaches "), "{told}");
        assert!(told.contains(way), "{told}");
    }
    // Where the output's LSB forbids it, no form is named.
    let told = refused(&SINE, &["--bound=1e-6", "--form=auto"]);
    for due in [
        "with `--output` Q1.15: rounding to it alone costs up to half an LSB, 1.53e-5",
        "give `--output` at least 19 fraction bits, or a wider bound",
    ] {
        assert!(told.contains(due), "{told}");
    }
    assert!(!told.contains("nearest"), "{told}");
}
