//! `gyrogen close --verify`: the emitted code beside the model on the whole record.

use crate::common::command::gyrogen_in;
use gyrogen::plant::noise::Noise;
use serde_json::Value;
use std::f64::consts::TAU;
use std::path::Path;

/// Thermal cycles with a lag that firmware can follow; every seventh row is missing, so that the correction
/// steps between rows.
fn record(folder: &Path) {
    let white = Noise::new(7, 1);
    let mut csv = String::from("time_s,rate_out_dps,die_degc\n");
    let (mut late, mut before) = (-5.0, -5.0);
    for k in 0..420u64 {
        let t = 15.0 * k as f64;
        let degc = 25.0 - 30.0 * (TAU * t / 2100.0).cos();
        late += (0.5 * (degc + before) - late) * (1.0 - (-15.0f64 / 120.0).exp());
        before = degc;
        if k % 7 == 3 {
            continue;
        }
        let out = 0.3 + 0.01 * degc + 0.02 * (degc - late) + 0.01 * white.normal(k);
        csv += &format!("{t},{out:.6},{degc:.4}\n");
    }
    std::fs::write(folder.join("r.csv"), csv).expect("written");
}

const CLOSE: [&str; 5] = ["close", "--record", "r.csv", "--out", "o"];

fn close(folder: &Path, more: &[&str], environment: &[(&str, &str)]) -> (Option<i32>, [String; 2]) {
    let out = gyrogen_in(folder, &[&CLOSE[..], more].concat(), environment);
    let text = |bytes: Vec<u8>| String::from_utf8(bytes).expect("text");
    (out.status.code(), [text(out.stdout), text(out.stderr)])
}

#[test]
fn every_word_of_the_emitted_code_is_the_models() {
    let folder = tempfile::tempdir().expect("a folder");
    record(folder.path());
    let (status, [said, talk]) = close(folder.path(), &["--verify"], &[]);
    assert_eq!(status, Some(0), "{talk}");
    assert!(said.contains(" words compared, 0 mismatches"), "{said}");
    let json = std::fs::read(folder.path().join("o/closure.json")).expect("the closure");
    let json: Value = serde_json::from_slice(&json).expect("JSON");
    assert_eq!(json["steps"][0]["effect"], "thermal_lag");
    let emitted = &json["emitted"];
    assert_eq!(
        (&emitted["readings"], &emitted["mismatches"]),
        (&360.into(), &0.into())
    );
    let functions = emitted["functions"].as_array().expect("a list");
    for language in ["c", "rust"] {
        // Each reading and each that the logger missed, result and fault of each.
        let of = |f: &&Value| f["name"] == "correct" && f["language"] == language;
        let step = functions.iter().find(of).expect("the step");
        assert_eq!(
            (&step["inputs"], &step["compared"]),
            (&420.into(), &840.into())
        );
    }
    let compared = |f: &Value| f["compared"].as_u64().expect("a count");
    let words: u64 = functions.iter().map(compared).sum();
    assert_eq!(emitted["words_compared"], words);
    let page = std::fs::read_to_string(folder.path().join("o/report.html")).expect("a page");
    assert!(page.contains("id=\"emitted\"") && page.contains("360 readings"));

    // The same closure without it: neither key nor section.
    let (status, [said, _]) = close(folder.path(), &["--format", "json"], &[]);
    assert_eq!(status, Some(0));
    let plain: Value = serde_json::from_str(&said).expect("JSON");
    let page = std::fs::read_to_string(folder.path().join("o/report.html")).expect("a page");
    assert!(plain.get("emitted").is_none() && !page.contains("id=\"emitted\""));
    for key in ["firmware", "steps", "design_sha256"] {
        assert_eq!(plain[key], json[key]);
    }
}

#[test]
fn without_firmware_there_is_nothing_to_compare_and_that_is_said() {
    let folder = tempfile::tempdir().expect("a folder");
    let made = |name: &str| folder.path().join("o").join(name).exists();
    record(folder.path());
    let (status, [_, talk]) = close(folder.path(), &[], &[]);
    assert_eq!(status, Some(0), "{talk}");
    assert!(made("firmware/c/manifest.json") && made("design.toml") && made("design.diff"));
    let white = Noise::new(8, 1);
    let mut csv = String::from("time_s,rate_out_dps,chamber_degc\n");
    for k in 0..300u64 {
        let t = 15.0 * k as f64;
        let degc = 25.0 - 30.0 * (TAU * t / 2100.0).cos();
        csv += &format!(
            "{t},{:.6},{degc:.4}\n",
            0.01 * degc + 0.01 * white.normal(k)
        );
    }
    std::fs::write(folder.path().join("r.csv"), csv).expect("written");
    let (status, [said, talk]) = close(folder.path(), &["--verify"], &[]);
    assert_eq!(status, Some(0), "{talk}");
    assert!(
        talk.contains("[nothing_to_verify]") && !said.contains("compared"),
        "{said}{talk}"
    );
    assert!(
        talk.contains("does not see chamber_degc")
            && talk.contains("name it die_degc in [record.columns]")
            && talk.contains("[not_compensable]")
            && said.contains("no firmware was written: the warnings say why"),
        "{talk}"
    );
    // What an earlier record left is not taken for this one's.
    assert!(talk.contains("they were replaced"), "{talk}");
    assert!(!made("firmware") && !made("design.toml") && !made("design.diff"));
    // Nor is a record that has a result's name written over.
    let rows = std::fs::read(folder.path().join("r.csv")).expect("the record");
    std::fs::write(folder.path().join("o/residuals.csv"), &rows).expect("written");
    std::fs::remove_file(folder.path().join("r.csv")).expect("removed");
    std::os::unix::fs::symlink("o/residuals.csv", folder.path().join("r.csv")).expect("a link");
    let (status, [_, talk]) = close(folder.path(), &[], &[]);
    assert_eq!(status, Some(2), "{talk}");
    let kept = std::fs::read(folder.path().join("o/residuals.csv")).expect("the record");
    assert!(talk.contains("written over") && kept == rows, "{talk}");
}

#[test]
fn no_compiler_is_an_error_of_the_input_and_captures_have_no_firmware() {
    let folder = tempfile::tempdir().expect("a folder");
    record(folder.path());
    for variable in ["CC", "RUSTC"] {
        let nowhere = [(variable, "/nowhere/compiler")];
        let (status, [_, talk]) = close(folder.path(), &["--verify"], &nowhere);
        assert_eq!(status, Some(2), "{talk}");
        assert!(
            talk.contains("no compiler") && talk.contains(variable),
            "{talk}"
        );
        // Off by default.
        assert_eq!(close(folder.path(), &[], &nowhere).0, Some(0));
    }
    let run = |arguments: &[&str]| gyrogen_in(folder.path(), arguments, &[]).status.code();
    assert_eq!(run(&["close", "--capture", "c.csv", "--verify"]), Some(2));
    assert_eq!(run(&["close", "--self-test", "--verify"]), Some(2));
}

/// The first constant of three digits or more in the emitted step, and the next one up.
#[cfg(unix)]
fn one_off(text: &str) -> (String, String) {
    let (_, step) = text
        .split_once("gyro_correction_correct(")
        .expect("the step");
    // No input of a record is at the limit of its word.
    let lines = step.lines().filter(|line| !line.contains("_in_range = "));
    let constants = lines.flat_map(|line| line.split("INT32_C(").skip(1));
    let mut values = constants.filter_map(|rest| rest.split(')').next()?.parse::<i64>().ok());
    let value = values.find(|v| *v >= 100).expect("a constant");
    (
        format!("INT32_C({value})"),
        format!("INT32_C({})", value + 1),
    )
}

/// A C compiler that first makes a constant of the source greater by one.
#[cfg(unix)]
#[test]
fn a_constant_that_is_one_off_in_the_emitted_source_is_seen() {
    let folder = tempfile::tempdir().expect("a folder");
    record(folder.path());
    assert_eq!(close(folder.path(), &[], &[]).0, Some(0));
    let source = folder.path().join("o/firmware/c/gyro_correction.c");
    let text = std::fs::read_to_string(source).expect("the source");
    let (from, to) = one_off(&text);
    let compiler = folder.path().join("damaging-cc");
    let script = format!(
        "for a in \"$@\"; do case \"$a\" in */gyro_correction.c)\n\
         sed '1,/{from}/s/{from}/{to}/' \"$a\" > \"$a.new\" && mv \"$a.new\" \"$a\";; esac; done\nexec cc \"$@\"\n"
    );
    std::fs::write(&compiler, script).expect("written");
    // Nothing is executable that this process has written: another test's child may still hold it open.
    let compiler = format!("sh {}", compiler.display());
    let damaging = [("CC", compiler.as_str())];
    let (status, [said, talk]) = close(folder.path(), &["--verify"], &damaging);
    assert_eq!(status, Some(1), "{from} -> {to}: {said}{talk}");
    assert!(
        talk.contains("check failed") && talk.contains("correct (c)"),
        "{talk}"
    );
    assert!(
        !talk.contains("(rust)") && !said.contains(" 0 mismatches"),
        "{talk}"
    );
    let json = std::fs::read(folder.path().join("o/closure.json")).expect("the closure");
    let json: Value = serde_json::from_slice(&json).expect("JSON");
    assert!(json["emitted"]["mismatches"].as_u64() > Some(0));
    let page = std::fs::read_to_string(folder.path().join("o/report.html")).expect("a page");
    assert!(page.contains("first difference") && page.contains("emitted ["));
}
