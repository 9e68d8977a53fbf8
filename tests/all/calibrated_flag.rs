//! `outside = "flag"`: the emitted firmware, the model and a definition written out here say the same about every
//! input, and damage to an end of the range is found.

use crate::common::command::{good, gyrogen, told};
use serde_json::Value;
use std::path::Path;

/// The default design with the flag; `range` as its calibrated range, if any.
fn design(folder: &Path, range: &str, input: &str) {
    // Never over an existing file.
    let _ = std::fs::remove_file(folder.join("plain.toml"));
    let made = gyrogen(&["init", "plain.toml"], folder);
    good(&made);
    let text = std::fs::read_to_string(folder.join("plain.toml")).unwrap();
    let text = text
        .replace("#outside = \"clamp\"", "outside = \"flag\"")
        .replace(
            "#clamp_raw = [-5900000, -3900000]",
            &format!("{range}\n{input}"),
        );
    let text = match input.is_empty() {
        true => text,
        false => text.replace("input = \"phase\"", "input = \"die_degc\""),
    };
    std::fs::write(folder.join("d.toml"), text).unwrap();
}

/// Thermometer and flag in the vectors.
fn vectors(folder: &Path, bundle: &str) -> Vec<(i64, i64)> {
    let text = std::fs::read_to_string(folder.join(bundle).join("vectors/in_range.csv")).unwrap();
    let rows = text.lines().skip(1).map(|line| {
        let words: Vec<i64> = line.split(',').map(|w| w.parse().unwrap()).collect();
        assert_eq!(words.len(), 3);
        (words[0], words[1])
    });
    rows.collect()
}

const WORD: &str = "input_format = \"Q9.7\"\nrate_input_format = \"Q2.22\"\ninput_scale_bits = 13";

#[test]
fn the_flag_is_the_same_in_c_and_rust_and_damage_to_an_end_is_found() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    for (range, input, part) in [
        ("clamp_raw = [-5900000, -3900000]", "", "chain"),
        ("clamp_raw = [-512, 9000]", WORD, "compensation"),
    ] {
        design(at, range, input);
        let [low, high]: [i64; 2] = match part {
            "chain" => [-5900000, -3900000],
            _ => [-512, 9000],
        };
        for (language, source) in [("c", "gyro.c"), ("rust", "src/lib.rs")] {
            let bundle = format!("{part}-{language}");
            let arguments = [
                "emit", "d.toml", "--lang", language, "--part", part, "--out",
            ];
            let made = gyrogen(&[&arguments[..], &[bundle.as_str()]].concat(), at);
            good(&made);
            let verified = gyrogen(&["verify", &bundle], at);
            good(&verified);

            let rows = vectors(at, &bundle);
            for (word, flag) in &rows {
                assert_eq!(*flag, i64::from(low <= *word && *word <= high), "{word}");
            }
            for word in [low - 1, low, high, high + 1] {
                assert!(rows.iter().any(|(w, _)| *w == word), "{word}");
            }
            let text = std::fs::read_to_string(at.join(&bundle).join("manifest.json")).unwrap();
            let manifest: Value = serde_json::from_str(&text).unwrap();
            let said = &manifest["calibrated"];
            assert_eq!(said["low"].as_i64(), Some(low));
            assert_eq!(said["high"].as_i64(), Some(high));
            assert_eq!(said["outside"], "flag");

            // One end off by one in the flag's function.
            let path = at.join(&bundle).join(source);
            let text = std::fs::read_to_string(&path).unwrap();
            assert!(text.contains("in_range("));
            let function = text
                .find("int32_t gyro_in_range(")
                .or(text.find("fn in_range("))
                .unwrap();
            let (before, after) = text.split_at(function);
            // Constants are printed as magnitudes.
            let [whole, moved] = [high.unsigned_abs(), high.unsigned_abs() + 1];
            let damaged = after.replacen(&whole.to_string(), &moved.to_string(), 1);
            assert_ne!(damaged, after);
            std::fs::write(&path, before.to_owned() + &damaged).unwrap();
            let found = gyrogen(&["verify", &bundle], at);
            assert_eq!(found.status.code(), Some(1));
            assert!(told(&found).contains("in_range ("), "{}", told(&found));
        }
    }
}

#[test]
fn the_chain_s_rows_carry_the_flag_and_no_other_contract_does() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    // A drive tone whose phase runs through the whole circle, so that both sides are met.
    let mut codes = String::from("drive_code,sense_code\n");
    for k in 0..32 * 400 {
        let turn = f64::from(k) * (1.0 / 32.0 + 1.0 / 6000.0);
        let drive = (20000.0 * (turn * std::f64::consts::TAU).sin()).round();
        codes += &format!("{drive},{}\n", k % 7);
    }
    std::fs::write(at.join("codes.csv"), codes).unwrap();
    design(at, "clamp_raw = [-5900000, 3900000]", "");
    for (outside, flagged) in [("flag", true), ("clamp", false), ("hold_slope", false)] {
        let text = std::fs::read_to_string(at.join("d.toml")).unwrap();
        let text = text.replace("outside = \"flag\"", &format!("outside = \"{outside}\""));
        std::fs::write(at.join("o.toml"), text).unwrap();
        let arguments = [
            "replay",
            "o.toml",
            "--capture",
            "codes.csv",
            "--out",
            "rows.csv",
        ];
        let made = gyrogen(&arguments, at);
        good(&made);
        let rows = std::fs::read_to_string(at.join("rows.csv")).unwrap();
        let header: Vec<&str> = rows.lines().next().unwrap().split(',').collect();
        assert_eq!(header.last() == Some(&"in_range"), flagged);
        if !flagged {
            assert!(!header.contains(&"in_range"));
            continue;
        }
        let phase = header.iter().position(|h| *h == "phase").unwrap();
        let mut seen = [0; 2];
        for line in rows.lines().skip(1) {
            let words: Vec<i64> = line.split(',').map(|w| w.parse().unwrap()).collect();
            let inside = (-5900000..=3900000).contains(&words[phase]);
            assert_eq!(*words.last().unwrap(), i64::from(inside));
            seen[usize::from(inside)] += 1;
        }
        assert!(seen[0] > 20 && seen[1] > 20, "{seen:?}");
    }
}

#[test]
fn a_flag_without_a_range_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    design(folder.path(), "", "");
    let arguments = ["emit", "d.toml", "--lang", "c", "--out", "x"];
    let refused = gyrogen(&arguments, folder.path());
    assert_eq!(refused.status.code(), Some(2));
    assert!(told(&refused).contains("clamp_raw"), "{}", told(&refused));
    assert!(!folder.path().join("x").exists());
}
