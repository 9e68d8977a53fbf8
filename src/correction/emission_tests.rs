//! Emitted C and Rust against the model, and damage to them.

use super::sample::{bends, plan, record};
use super::*;
use crate::emit::views::Language;
use crate::firmware::correction::{Origin, emit};
use crate::firmware::files;
use crate::verify::bundle::{Against, verify};
use crate::verify::correction::Firmware;
use crate::verify::target::Target;

const ORIGIN: Origin = Origin {
    prefix: "tested",
    sha256: "0",
    command: "test",
};

#[test]
fn emitted_c_and_rust_are_the_model_bit_for_bit_on_random_plans() {
    let mut bent = 0;
    for seed in [0, 1, 3, 5, 8u64] {
        // As many inputs, and relays.
        let plan = plan(1000 + seed, seed as usize, true);
        bent += usize::from(bends(&plan));
        let correction = Correction::auto(&plan).unwrap();
        let firmware =
            Firmware::make(&correction, &ORIGIN, &[Language::C, Language::Rust]).unwrap();
        let readings = record(&plan, 3000, seed);
        let compared = firmware.compare(&correction, &readings).unwrap();
        assert!(compared.len() >= 2);
        for c in compared {
            assert_eq!(c.mismatches, 0, "plan {seed}: {} {:?}", c.name, c.first);
            assert!(c.name != "correct" || c.inputs >= 3000);
        }
    }
    assert!(bent >= 2, "{bent} plans with an s2");
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
        let good = verify(
            folder.path(),
            Target::Host,
            &Against::default(),
            &|_, _| Ok(Vec::new()),
            "test",
        )
        .unwrap();
        assert!(good.holds && good.selftest == Some(true), "{good:?}");
        assert!(
            good.functions
                .iter()
                .any(|f| f.name == "sequence" && f.inputs >= 3072)
        );

        // Each multiplier of the step: one in 256 more shows in all of them, one LSB in nearly all (a
        // constant may be finer than any output).
        let source = match language {
            Language::C => "tested.c",
            Language::Rust => "src/lib.rs",
        };
        let file = emitted.iter().find(|f| f.path == source).unwrap();
        let mut unseen = Vec::new();
        let count = multipliers(&file.text, language).len();
        // Both languages print the same program; compiling Rust takes longer.
        let every = if language == Language::C { 4 } else { 20 };
        let ks = (0..count).step_by(every);
        for (k, share) in ks.flat_map(|k| [(k, 256), (k, i64::MAX)]) {
            let (what, damaged) = damage(&file.text, language, k, share);
            std::fs::write(folder.path().join(source), damaged).unwrap();
            let bad = verify(
                folder.path(),
                Target::Host,
                &Against::default(),
                &|_, _| Ok(Vec::new()),
                "test",
            )
            .unwrap();
            if bad.vectors.mismatches == 0 {
                unseen.push((what, share));
            }
        }
        // All passes over the laws of the rate but the last one see their constants through the laws' slopes, here
        // of a few ten thousandths.
        let laws = plan.terms.iter().filter(|t| t.is_on_rate()).count();
        let blurred = laws * (correction.formats.passes(&plan) - 1);
        let coarse = unseen.iter().filter(|(_, share)| *share == 256).count();
        assert!(
            count >= 10 && unseen.len() - coarse <= count / 10 + blurred,
            "{count}: {unseen:#?}"
        );
        assert!(coarse <= blurred, "{unseen:#?}");
    }
}

/// Place and value of each constant that something is multiplied by.
fn multipliers(text: &str, language: Language) -> Vec<(std::ops::Range<usize>, i64)> {
    let after = match language {
        Language::C => ") * ",
        Language::Rust => ".wrapping_mul(",
    };
    let mut found = Vec::new();
    let mut start = 0;
    for line in text.split_inclusive('\n') {
        if let Some(end) = line.find(after).filter(|_| line.contains(" = ")) {
            let head = line[..end].trim_end_matches(')');
            let head = head.trim_end_matches("_i64").trim_end_matches("_i32");
            let digits = head.trim_end_matches(|c: char| c.is_ascii_digit()).len();
            let sign = line[..digits].trim_end_matches(['-', '(']);
            let is_first = match language {
                Language::C => line[..digits].ends_with("_C("),
                Language::Rust => sign.ends_with("= "),
            };
            if let Ok(value) = head[digits..].parse::<i64>()
                && is_first
            {
                found.push((start + digits..start + head.len(), value));
            }
        }
        start += line.len();
    }
    found
}

/// The source with the k-th multiplier more by its share, at least by one; and its line.
fn damage(text: &str, language: Language, k: usize, share: i64) -> (String, String) {
    let (range, value) = multipliers(text, language)[k].clone();
    let line = text[range.start..].lines().next().unwrap_or("");
    let mut damaged = text.to_owned();
    damaged.replace_range(range, &(value + value / share + 1).to_string());
    (line.to_owned(), damaged)
}
