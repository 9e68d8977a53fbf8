//! Emitted C and Rust against the model, and damage to them.

use super::firmware::{Origin, emit};
use super::sample::{plan, record};
use super::*;
use crate::emit::files;
use crate::emit::views::Language;
use crate::verify::bundle::verify;

const ORIGIN: Origin = Origin {
    prefix: "tested",
    sha256: "0",
    command: "test",
};

#[test]
fn emitted_c_and_rust_are_the_model_bit_for_bit_on_random_plans() {
    for seed in 0..10u64 {
        // No input, one and so on up to eight, and relays.
        let plan = plan(1000 + seed, seed as usize % 9, true);
        let correction = Correction::auto(&plan).unwrap();
        let firmware = Firmware::make(&correction, &ORIGIN).unwrap();
        let readings = record(&plan, 3000, seed);
        let compared = firmware.compare(&correction, &readings).unwrap();
        assert!(compared.len() >= 2);
        for c in compared {
            assert_eq!(c.mismatches, 0, "plan {seed}: {} {:?}", c.name, c.first);
            assert!(c.name != "correct" || c.inputs >= 3000);
        }
    }
}

#[test]
fn a_bundle_verifies_from_its_files_and_damage_to_a_constant_shows() {
    let plan = plan(2004, 3, true);
    let correction = Correction::auto(&plan).unwrap();
    for language in [Language::C, Language::Rust] {
        let emitted = emit(&correction, &ORIGIN, language).unwrap();
        assert_eq!(emitted, emit(&correction, &ORIGIN, language).unwrap());
        let folder = tempfile::tempdir().unwrap();
        files::write(&emitted, folder.path()).unwrap();
        let good = verify(folder.path(), "test").unwrap();
        assert!(good.holds && good.selftest == Some(true), "{good:?}");
        assert!(good.functions.iter().any(|f| f.name == "correct" && f.inputs == 3072));

        // Each constant of the step that is not a limit, one more.
        let (source, open) = match language {
            Language::C => ("tested.c", "_C("),
            Language::Rust => ("src/lib.rs", "."),
        };
        let file = emitted.iter().find(|f| f.path == source).unwrap();
        let damaged = damages(&file.text, language);
        assert!(damaged.len() >= 5, "{open}: {}", damaged.len());
        for (what, text) in damaged {
            std::fs::write(folder.path().join(source), text).unwrap();
            let bad = verify(folder.path(), "test").unwrap();
            assert!(bad.vectors.mismatches > 0, "{language:?}: {what}");
        }
    }
}

/// The source with one multiplier one more, for each multiplier with a constant in it.
fn damages(text: &str, language: Language) -> Vec<(String, String)> {
    let mut all = Vec::new();
    for (start, line) in text
        .lines()
        .scan(0, |at, line| {
            let start = *at;
            *at += line.len() + 1;
            Some((start, line))
        })
        .filter(|(_, line)| match language {
            Language::C => line.contains(" * ") && line.contains("const int") && line.contains("_C("),
            Language::Rust => line.contains(".wrapping_mul(") && line.contains("let t"),
        })
    {
        let place = match language {
            Language::C => line.find("_C(").map(|k| k + 3),
            Language::Rust => line.find("= ").map(|k| k + 2),
        };
        let Some(place) = place else { continue };
        let digits: String = line[place..]
            .trim_start_matches(['(', '-'])
            .chars()
            .take_while(char::is_ascii_digit)
            .collect();
        let Ok(value) = digits.parse::<i64>() else {
            continue;
        };
        let at = start + place + line[place..].find(&digits).unwrap_or(0);
        let mut damaged = text.to_owned();
        damaged.replace_range(at..at + digits.len(), &(value + 1).to_string());
        all.push((line.trim().to_owned(), damaged));
    }
    all
}
