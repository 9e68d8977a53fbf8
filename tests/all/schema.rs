//! `gyrogen schema NAME` against what is really written.

use crate::common::command::{gyrogen, told};
use serde_json::{Value, json};
use std::path::Path;

fn schema(name: &str) -> Value {
    let out = gyrogen(&["schema", name], Path::new("."));
    assert!(out.status.success(), "{name}");
    serde_json::from_slice(&out.stdout).unwrap()
}

fn read(path: &Path) -> Value {
    let text = std::fs::read_to_string(path);
    serde_json::from_str(&text.unwrap_or_else(|e| panic!("{}: {e}", path.display()))).unwrap()
}

fn errors(schema: &Value, instance: &Value) -> Vec<String> {
    let validator = jsonschema::validator_for(schema).unwrap();
    let errors = validator.iter_errors(instance);
    errors
        .map(|e| format!("{}: {e}", e.instance_path))
        .collect()
}

/// Runs a command that writes `file` into `out`, and holds the file against the schema of `name`.
fn holds(name: &str, arguments: &[&str], folder: &Path, file: &str) -> Value {
    let done = gyrogen(arguments, folder);
    let text = told(&done);
    assert_ne!(done.status.code(), Some(2), "{arguments:?}: {text}");
    let written = read(&folder.join(file));
    let found = errors(&schema(name), &written);
    assert!(found.is_empty(), "{name}: {found:#?}");
    written
}

#[test]
fn what_check_approx_and_emit_write_fits_and_damage_does_not() {
    let folder = tempfile::tempdir().unwrap();
    let dir = folder.path();
    let check = holds(
        "check",
        &["check", "--samples", "20000", "--out", "c"],
        dir,
        "c/check.json",
    );
    let mut damaged = check.clone();
    damaged["nodes"][0]["proved"][0] = "low".into();
    assert!(!errors(&schema("check"), &damaged).is_empty());
    let mut damaged = check;
    damaged.as_object_mut().unwrap().remove("holds");
    assert!(!errors(&schema("check"), &damaged).is_empty());
    let approx = [
        "approx",
        "--function",
        "sin(x)",
        "--domain=0,1",
        "--degree",
        "3",
        "--input",
        "Q2.8",
        "--output",
        "Q2.10",
        "--coefficients",
        "Q2.14",
        "--out",
        "a",
    ];
    holds("approx", &approx, dir, "a/approx.json");
    std::fs::write(dir.join("capture.csv"), "drive_code,sense_code\n1,2\n").unwrap();
    let replay = [
        "replay",
        "--capture",
        "capture.csv",
        "--format",
        "json",
        "--out",
        "rows.csv",
    ];
    let replayed: Value = serde_json::from_slice(&gyrogen(&replay, dir).stdout).unwrap();
    assert!(errors(&schema("replay"), &replayed).is_empty());
    assert_eq!(
        (&replayed["samples"], &replayed["rows"]),
        (&json!(1), &json!(0))
    );
    // The default's coefficients are of another gyro, and the capture is too short for a row.
    assert_eq!(replayed["warnings"].as_array().map(Vec::len), Some(2));
    let emit = [
        "emit",
        "--lang",
        "c",
        "--part",
        "compensation",
        "--out",
        "e",
    ];
    holds("bundle", &emit, dir, "e/manifest.json");
}

#[test]
fn the_design_fits_and_an_unknown_key_does_not() {
    let as_json = |text: &str| serde_json::to_value(text.parse::<toml::Table>().unwrap()).unwrap();
    let schema = schema("design");
    let default = gyrogen::design::template::DEFAULT;
    let found = errors(&schema, &as_json(default));
    assert!(found.is_empty(), "{found:#?}");
    // What is switched off in the default, with the examples that stand there.
    let on: String = default
        .lines()
        .map(|l| match l.strip_prefix('#') {
            Some(rest) if !rest.starts_with(' ') && !rest.is_empty() => format!("{rest}\n"),
            _ => format!("{l}\n"),
        })
        .collect();
    let found = errors(&schema, &as_json(&on));
    assert!(found.is_empty(), "{found:#?}");
    for (from, to) in [
        ("stages = 3", "stagges = 3"),
        ("stages = 3", "stages = \"three\""),
        ("table = \"Q1.15\"", "table = \"16 bits\""),
        (
            "rounding = \"half_up\", overflow",
            "rounding = \"nearest\", overflow",
        ),
    ] {
        let found = errors(&schema, &as_json(&default.replacen(from, to, 1)));
        assert!(!found.is_empty(), "{to}");
    }
}

#[test]
fn every_name_has_a_schema_with_descriptions() {
    for (name, _) in gyrogen::schemas::NAMES {
        let schema = schema(name);
        assert!(jsonschema::validator_for(&schema).is_ok(), "{name}");
        let text = schema.to_string();
        assert!(text.contains("\"description\""), "{name}");
    }
    let out = gyrogen(&["schema", "nothing"], Path::new("."));
    assert_eq!(out.status.code(), Some(2));
}

#[test]
#[ignore = "runs every command, 30 s; .ci/run has it"]
fn what_every_command_writes_fits() {
    let folder = tempfile::tempdir().unwrap();
    let dir = folder.path();
    holds("run", &["run", "--out", "r"], dir, "r/summary.json");
    holds(
        "equiv",
        &["equiv", "--samples", "100000", "--out", "q"],
        dir,
        "q/equiv.json",
    );
    holds(
        "simulate",
        &["simulate", "--out", "s"],
        dir,
        "s/simulate.json",
    );
    let close = ["close", "--record", "r/record.csv", "--out", "c"];
    holds("close", &close, dir, "c/closure.json");
    let verify = ["verify", "r/firmware/c", "--out", "v"];
    holds("verify", &verify, dir, "v/verify.json");
    let test = [
        "close",
        "--self-test",
        "--records",
        "2",
        "--clean",
        "2",
        "--effect",
        "thermal_lag",
        "--out",
        "t",
    ];
    holds("selftest", &test, dir, "t/selftest.json");
}
