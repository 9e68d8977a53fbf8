//! `run` and `equiv` with a compiler for one language, with none, and with one that is none.

use crate::common::command::{gyrogen_in, told};
use serde_json::Value;
use std::path::Path;
use std::process::Output;

fn equiv(here: &Path, more: &[&str], variables: &[(&str, &str)]) -> Output {
    let equiv = ["equiv", "--samples", "20000", "--out", "out"];
    gyrogen_in(here, &[&equiv[..], more].concat(), variables)
}

#[test]
fn what_can_be_built_is_compared_and_the_rest_is_said() {
    let folder = tempfile::tempdir().expect("a folder");
    let here = folder.path();
    let output = equiv(here, &[], &[("RUSTC", "/bin/false")]);
    let said = told(&output);
    assert!(
        said.contains("note: only the emitted code of one language (c)")
            && said.contains("/bin/false")
            && !said.contains("error:"),
        "{said}"
    );
    let json = std::fs::read_to_string(here.join("out/equiv.json")).expect("a result");
    let json: Value = serde_json::from_str(&json).expect("JSON");
    assert!(json["model_vs_c"].is_object() && json["model_vs_rust"].is_null());
    assert_eq!(json["model_vs_c"]["mismatches"], 0);

    let output = equiv(here, &["--lang", "c"], &[("RUSTC", "/bin/false")]);
    let said = told(&output);
    assert!(!said.contains("/bin/false"), "{said}");

    let output = equiv(here, &[], &[("CC", "/bin/false"), ("RUSTC", "/bin/false")]);
    assert_eq!(output.status.code(), Some(2));
    let said = told(&output);
    assert!(
        said.contains("which CC names") && !said.contains("there is no compiler"),
        "{said}"
    );
}
