//! A command that is called again with the folder of an earlier call: what is replaced is said, and what somebody edited,
//! another design's firmware and that of the other language stay unless that is forced.

use crate::common::command::{gyrogen_in, told};
use std::fs;
use std::path::Path;

/// A correction's bundle: small, with vectors and a sequence.
const DESIGN: &str = r#"
name = "tested"
[correction]
period_s = 1.0
full_scale_dps = 100.0
noise_dps = 1e-2
inputs = [{ column = "die_degc", offset = 25.0, scale = 50.0 }]
terms = [
    { kind = "product", gain_dps = 10.0, factors = [] },
    { kind = "product", gain_dps = 5.0, factors = [[0, 1]] },
]
"#;

fn edited() -> String {
    DESIGN.replace("10.0, factors", "10.1, factors")
}

/// Status and talk of a command.
fn gyrogen(folder: &Path, arguments: &[&str]) -> (Option<i32>, String) {
    let out = gyrogen_in(folder, arguments, &[]);
    let said = told(&out);
    (out.status.code(), said)
}

/// Emits a design to `fw`.
fn emit(folder: &Path, design: &str, language: &str, more: &[&str]) -> (Option<i32>, String) {
    let fixed = ["emit", design, "--lang", language, "--out", "fw"];
    gyrogen(folder, &[&fixed[..], more].concat())
}

/// The design texts as `NAME/design.toml` each.
fn designs(folder: &Path, texts: &[(&str, &str)]) {
    for (name, text) in texts {
        fs::create_dir_all(folder.join(name)).expect("a folder");
        fs::write(folder.join(name).join("design.toml"), text).expect("written");
    }
}

#[test]
fn an_edited_bundle_is_not_overwritten_and_an_unedited_one_leaves_nothing() {
    let top = tempfile::tempdir().expect("a folder");
    let here = top.path();
    fs::write(here.join("design.toml"), DESIGN).expect("written");
    fs::write(here.join("other.toml"), DESIGN).expect("written");
    assert_eq!(emit(here, "design.toml", "c", &[]).0, Some(0));
    // Firmware of another design file is not replaced without being asked.
    let (status, said) = emit(here, "other.toml", "c", &[]);
    assert_eq!(status, Some(2), "{said}");
    assert!(
        said.contains("`gyrogen emit design.toml --lang c`"),
        "{said}"
    );
    assert!(said.contains("name another folder with --out"), "{said}");
    // That of the same one is, and nothing is said where it is the same text.
    let (status, said) = emit(here, "design.toml", "c", &[]);
    assert!(status == Some(0) && !said.contains("note: "), "{said}");
    let source = here.join("fw/tested_correction.c");
    fs::write(&source, "mine").expect("written");
    let (status, said) = emit(here, "design.toml", "c", &[]);
    assert_eq!(status, Some(2), "{said}");
    assert!(said.contains("tested_correction.c (edited)"), "{said}");
    assert_eq!(fs::read_to_string(&source).expect("there"), "mine");
    let (status, said) = emit(here, "design.toml", "c", &["--force"]);
    assert_eq!(status, Some(0), "{said}");
    assert!(said.contains("tested_correction.c (edited)"), "{said}");
    assert_ne!(fs::read_to_string(&source).expect("there"), "mine");
}

/// Two designs in files of one name, as the folders of two calls of `run` have them.
#[test]
fn a_design_file_of_the_same_name_is_known_by_its_text_and_the_designs_name() {
    let top = tempfile::tempdir().expect("a folder");
    let here = top.path();
    let renamed = DESIGN.replace("\"tested\"", "\"other\"");
    designs(here, &[("a", DESIGN), ("b", &edited()), ("c", &renamed)]);
    assert_eq!(emit(here, "a/design.toml", "c", &[]).0, Some(0));
    // It may be the same design, edited: replaced, and said.
    let (status, said) = emit(here, "b/design.toml", "c", &[]);
    assert_eq!(status, Some(0), "{said}");
    let digits = &gyrogen::digest::sha256(DESIGN.as_bytes())[..12];
    assert!(
        said.contains("note: this replaced other firmware"),
        "{said}"
    );
    assert!(said.contains(digits) && said.contains("--out"), "{said}");
    // It cannot be the same one.
    let before = fs::read(here.join("fw/manifest.json")).expect("a manifest");
    let (status, said) = emit(here, "c/design.toml", "c", &[]);
    assert_eq!(status, Some(2), "{said}");
    assert!(said.contains("design name `tested`"), "{said}");
    assert!(
        said.contains("design name `other`") && said.contains("--force"),
        "{said}"
    );
    assert_eq!(
        fs::read(here.join("fw/manifest.json")).expect("there"),
        before
    );
    let (status, said) = emit(here, "c/design.toml", "c", &["--force"]);
    assert_eq!(status, Some(0), "{said}");
    assert!(
        said.contains("note: this replaced other firmware"),
        "{said}"
    );
    assert!(!here.join("fw/tested_correction.c").exists());
}

#[test]
fn another_function_in_the_folder_of_one_is_said() {
    let top = tempfile::tempdir().expect("a folder");
    let of = |function: &str| {
        let fixed =
            "approx --domain=0,1 --degree 2 --input Q1.10 --output Q2.10 --coefficients Q2.14";
        let mut arguments: Vec<&str> = fixed.split(' ').collect();
        arguments.extend(["--function", function]);
        let (status, said) = gyrogen(top.path(), &arguments);
        assert_eq!(status, Some(0), "{said}");
        said
    };
    assert!(!of("sin(x)").contains("note: "));
    assert!(!of("sin(x)").contains("note: "), "the same again");
    let said = of("cos(x)");
    assert!(
        said.contains("note: gyrogen-approx held the results of") && said.contains("sin(x)"),
        "{said}"
    );
}

#[test]
fn the_firmware_of_the_other_language_stays() {
    let top = tempfile::tempdir().expect("a folder");
    let here = top.path();
    fs::write(here.join("design.toml"), DESIGN).expect("written");
    assert_eq!(emit(here, "design.toml", "c", &[]).0, Some(0));
    let (status, said) = emit(here, "design.toml", "rust", &[]);
    assert_eq!(status, Some(2), "{said}");
    assert!(said.contains("in C") && said.contains("in Rust"), "{said}");
    assert!(said.contains("name another folder with --out"), "{said}");
    assert!(here.join("fw/tested_correction.c").is_file());
    let (status, said) = emit(here, "design.toml", "rust", &["--force"]);
    assert_eq!(status, Some(0), "{said}");
    assert!(
        said.contains("note: this replaced other firmware"),
        "{said}"
    );
    assert!(!here.join("fw/tested_correction.c").exists());
    assert_eq!(gyrogen(here, &["verify", "fw"]).0, Some(0));
}

#[test]
fn a_damaged_manifest_is_named_and_forced_gives_a_bundle_that_verifies() {
    for language in ["c", "rust"] {
        let top = tempfile::tempdir().expect("a folder");
        let here = top.path();
        fs::write(here.join("design.toml"), DESIGN).expect("written");
        assert_eq!(emit(here, "design.toml", "c", &[]).0, Some(0));
        let path = here.join("fw/manifest.json");
        let text = fs::read_to_string(&path).expect("a manifest");
        let damaged = match language {
            "c" => &text[..text.len() / 2],
            _ => "{}",
        };
        fs::write(&path, damaged).expect("written");
        fs::write(here.join("fw/notes.txt"), "mine").expect("written");
        let (status, said) = emit(here, "design.toml", language, &[]);
        assert_eq!(status, Some(2), "{said}");
        assert!(
            said.starts_with(&Path::new("fw").join("manifest.json").display().to_string()),
            "{said}"
        );
        assert!(
            said.contains("the manifest of the bundle here is damaged"),
            "{said}"
        );
        assert!(!said.contains("tested_correction.c"), "{said}");
        let (status, said) = emit(here, "design.toml", language, &["--force"]);
        assert_eq!(status, Some(0), "{said}");
        assert!(said.contains("manifest.json (damaged)"), "{said}");
        assert!(
            said.contains("left beside the bundle: \"notes.txt\""),
            "{said}"
        );
        let (status, said) = gyrogen(here, &["verify", "fw"]);
        assert_eq!(status, Some(0), "{said}");
        let notes = fs::read_to_string(here.join("fw/notes.txt"));
        assert_eq!(notes.expect("there"), "mine");
    }
}

/// A warm-up and a way back.
fn record(offset_dps: f64) -> String {
    let mut csv = String::from("time_s,rate_out_dps,die_degc\n");
    for k in 0..240 {
        let degc = 20.0 + 0.25 * f64::from(if k < 120 { k } else { 240 - k });
        let wobble = 0.01 * (7.7 * f64::from(k * k)).sin();
        let dps = offset_dps - 0.02 * degc + 2e-4 * degc * degc + wobble;
        csv += &format!("{},{dps:.5},{degc:.3}\n", 2 * k);
    }
    csv
}

#[test]
fn results_of_another_record_are_replaced_with_a_note() {
    let top = tempfile::tempdir().expect("a folder");
    let here = top.path();
    for (name, csv) in [("a", record(0.5)), ("b", record(0.7))] {
        fs::create_dir(here.join(name)).expect("a folder");
        fs::write(here.join(name).join("r.csv"), csv).expect("written");
    }
    for command in ["close", "run"] {
        let of = |record: &str| gyrogen(here, &[command, "--record", record, "--out", command]);
        for (record, is_noted) in [("a/r.csv", false), ("a/r.csv", false), ("b/r.csv", true)] {
            let (status, said) = of(record);
            assert_eq!(status, Some(0), "{said}");
            let named = format!("the results of `gyrogen {command} --record r.csv`");
            assert_eq!(
                said.contains(&named),
                is_noted,
                "{command} {record}: {said}"
            );
        }
    }
}
