//! `gyrogen emit` of a design with a correction and `gyrogen verify` from a design file.

use crate::common::command::{gyrogen, told};
use std::path::Path;

const DESIGN: &str = r#"
name = "corrected"

[correction]
period_s = 10.0
full_scale_dps = 500.0
noise_dps = 2e-3
inputs = [
    { column = "phase_rad", offset = -1.8, scale = 0.4 },
    { column = "supply_v", offset = 3.3, scale = 0.2 },
]
terms = [
    { kind = "product", gain_dps = 109.6, factors = [] },
    { kind = "product", gain_dps = 97.2, factors = [[0, 1]] },
    { kind = "product", gain_dps = 21.9, factors = [[0, 2]] },
    { kind = "lag", gain_dps = 4.0, input = 0, tau_s = 600.0 },
    { kind = "curve_of_lag", gain_dps = 0.5, input = 0, tau_s = 900.0, kept = "yes", values = [0, 1, -0.5] },
    { kind = "decay", gain_dps = 0.5, tau_s = 900.0 },
    { kind = "step", gain_dps = 0.3, input = 0, centre = 0.2, gap = 0.1, once = "no" },
    { kind = "product", gain_dps = 0.1, factors = [[1, 1]] },
    { kind = "cubic", ppm = 80.0, rate_max_dps = 500.0 },
]
"#;

#[test]
fn a_design_with_a_correction_becomes_firmware_that_verifies() {
    let folder = tempfile::tempdir().expect("a folder");
    std::fs::write(folder.path().join("design.toml"), DESIGN).expect("written");
    for language in ["c", "rust"] {
        let part = [
            "--part",
            "correction",
            "--lang",
            language,
            "--out",
            language,
        ];
        let emitted = gyrogen(
            &[&["emit", "design.toml"], &part[..]].concat(),
            folder.path(),
        );
        let said = told(&emitted);
        assert!(emitted.status.success(), "{said}");
        let verified = gyrogen(&["verify", language], folder.path());
        let said = told(&verified);
        assert!(verified.status.success(), "{said}");
    }
    let manifest = std::fs::read_to_string(folder.path().join("c/manifest.json"));
    let manifest = manifest.expect("a manifest");
    assert!(manifest.contains("\"part\": \"correction\""), "{manifest}");

    // A changed vector shows.
    let vectors = folder.path().join("c/vectors/sequence.csv");
    let text = std::fs::read_to_string(&vectors).expect("vectors");
    let damaged = text.replacen(",0\n", ",1\n", 1);
    std::fs::write(&vectors, damaged).expect("written");
    let verified = gyrogen(&["verify", "c"], folder.path());
    assert_eq!(verified.status.code(), Some(1));
}

#[test]
fn without_a_correction_there_is_nothing_to_emit() {
    let folder = tempfile::tempdir().expect("a folder");
    let part = ["emit", "--part", "correction", "--lang", "c", "--out", "c"];
    let emitted = gyrogen(&part, folder.path());
    assert_eq!(emitted.status.code(), Some(2));
    assert!(told(&emitted).contains("[correction]"));
}

/// Exit status and talk of an `emit` to C.
fn emitted(design: &[&str], part: &[&str], folder: &Path) -> (Option<i32>, String) {
    let fixed = ["--lang", "c", "--out", "c"];
    let output = gyrogen(&[&["emit"], design, part, &fixed[..]].concat(), folder);
    let said = told(&output);
    (output.status.code(), said)
}

fn part_of(folder: &Path) -> String {
    let text = std::fs::read_to_string(folder.join("c/manifest.json")).expect("a manifest");
    let manifest: serde_json::Value = serde_json::from_str(&text).expect("JSON");
    manifest["part"].as_str().expect("a part").to_owned()
}

/// Somebody who closed the loop gets the correction, or is told that it is not there.
#[test]
fn a_design_with_a_correction_emits_it_or_says_that_it_is_missing() {
    let folder = tempfile::tempdir().expect("a folder");
    let at = folder.path();
    std::fs::write(at.join("design.toml"), DESIGN).expect("written");
    let (status, said) = emitted(&["design.toml"], &[], at);
    assert_eq!((status, part_of(at).as_str()), (Some(0), "correction"));
    assert!(
        said.contains("part: correction") && !said.contains("warning"),
        "{said}"
    );

    for part in ["chain", "compensation"] {
        let (status, said) = emitted(&["design.toml"], &["--part", part], at);
        assert_eq!((status, part_of(at).as_str()), (Some(0), part));
        assert!(
            said.contains("warning: the design has a [correction]"),
            "{said}"
        );
        assert!(said.contains("--part correction"), "{said}");
    }
    let (status, said) = emitted(&["design.toml"], &["--part", "correction"], at);
    let lines: Vec<&str> = said.lines().collect();
    assert_eq!((status, lines.len()), (Some(0), 3), "{said}");
    assert!(lines[0].starts_with("note: the bundle that was here is gone"));
    assert!(lines[1].starts_with("wrote ") && lines[2].starts_with("digest "));
}

/// A polynomial that no record was fitted for is said to be one; a fitted one goes without a word.
#[test]
fn an_unfitted_compensation_is_said() {
    let folder = tempfile::tempdir().expect("a folder");
    let at = folder.path();
    let (status, said) = emitted(&[], &[], at);
    assert_eq!((status, part_of(at).as_str()), (Some(0), "chain"));
    assert!(said.contains("not fitted to a record"), "{said}");
    let (_, said) = emitted(&[], &["--part", "tables"], at);
    assert!(!said.contains("not fitted"), "{said}");

    let ran = gyrogen(&["run", "--out", "out"], at);
    assert_eq!(ran.status.code(), Some(0));
    // The embedded default's firmware is not replaced by that of a file without being asked.
    let (status, said) = emitted(&["out/design.toml"], &[], at);
    assert!(status == Some(2) && said.contains("--force"), "{said}");
    let (status, said) = emitted(&["out/design.toml"], &["--force"], at);
    assert_eq!(status, Some(0));
    assert!(
        !said.contains("not fitted") && !said.contains("warning"),
        "{said}"
    );
}

/// `tables` means the tables in both languages: no function beside them.
#[test]
fn a_bundle_of_tables_holds_nothing_else() {
    let folder = tempfile::tempdir().expect("a folder");
    let part = ["emit", "--part", "tables", "--lang", "rust", "--out", "t"];
    assert_eq!(gyrogen(&part, folder.path()).status.code(), Some(0));
    let lib = std::fs::read_to_string(folder.path().join("t/src/lib.rs")).expect("Rust");
    assert!(lib.contains("pub static SINE_0") && lib.contains("pub use selftest::selftest;"));
    for absent in ["pub fn bias", "pub fn cordic", "struct", "CIC"] {
        assert!(!lib.contains(absent), "{absent}");
    }
    let verified = gyrogen(&["verify", "t"], folder.path());
    assert_eq!(verified.status.code(), Some(0));
}
