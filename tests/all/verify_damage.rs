//! `gyrogen verify` finds small damage in emitted code: exit 1, and stderr names the table or
//! function and the first input that differs.

use crate::common::command::told;
use crate::common::files::copy;
use std::path::PathBuf;

use crate::oracle::bundle::{Bundle, Language};
use crate::oracle::golden;
use crate::oracle::number::{CastTo, Format, Overflow, Rounding};
use crate::oracle::toml_text::Printer;

/// One text replaced once in one file; `at` stands before it.
struct Damage {
    file: &'static str,
    at: &'static str,
    from: &'static str,
    to: &'static str,
    /// What stderr has to name.
    named: &'static str,
}

const fn damage([file, at, from, to]: [&'static str; 4], named: &'static str) -> Damage {
    Damage {
        file,
        at,
        from,
        to,
        named,
    }
}

const C: [Damage; 8] = [
    damage(["gyro_tables.c", "gyro_sine_0[", "201,", "202,"], "sine_0"),
    damage(
        ["gyro_tables.c", "gyro_cordic_angle[", "667544", "667545"],
        "cordic_angle",
    ),
    damage(["gyro.c", "gyro_bias(", "(7961641)", "(7961642)"], "bias"),
    damage(
        ["gyro.c", "gyro_demodulate(", ", 15U)", ", 14U)"],
        "demodulate",
    ),
    damage(["gyro.c", "gyro_bias(", "(64)", "(63)"], "bias"),
    damage(["gyro.c", "gyro_decimate(", "(256)", "(255)"], "chain"),
    damage(
        ["gyro_arith.h", "gyro_check_32(", "a < low", "a <= low"],
        "demodulate",
    ),
    damage(
        ["gyro_arith.h", "gyro_check_32(", "a > high", "a >= high"],
        "demodulate",
    ),
];

const RUST: [Damage; 6] = [
    damage(["src/lib.rs", "static SINE_0", "201,", "202,"], "sine_0"),
    damage(
        ["src/lib.rs", "pub fn bias(", "7961641_", "7961642_"],
        "bias",
    ),
    damage(
        ["src/lib.rs", "pub fn demodulate(", ">> 15;", ">> 14;"],
        "demodulate",
    ),
    damage(["src/lib.rs", "pub fn bias(", "(64_", "(63_"], "bias"),
    damage(
        ["src/lib.rs", "fn check_i32(", "a < low", "a <= low"],
        "demodulate",
    ),
    damage(
        ["src/lib.rs", "fn check_i32(", "a > high", "a >= high"],
        "demodulate",
    ),
];

/// The golden design with coarser products, which overflow, and that is an error.
fn design_text() -> String {
    let mut design = golden::design();
    design.nco.table = Format::q(2, 14);
    design.product = CastTo::new(Format::q(1, 14), Rounding::HalfUp, Overflow::Error);
    Printer::plain().print(&design)
}

/// Damages a copy of the bundle and verifies it.
fn found(bundle: &Bundle, damage: &Damage, folder: PathBuf) -> Result<(), String> {
    copy(&bundle.folder, &folder);
    let path = folder.join(damage.file);
    let text = std::fs::read_to_string(&path).expect("a source");
    let start = text.find(damage.at).expect("the place of the damage");
    let (before, after) = text.split_at(start);
    let Damage { from, to, .. } = damage;
    if !after.contains(from) {
        return Err(format!(
            "{}: no {from:?} after {:?}",
            damage.file, damage.at
        ));
    }
    let text = format!("{before}{}", after.replacen(from, to, 1));
    std::fs::write(&path, text).expect("a writable folder");
    let damaged = Bundle {
        folder,
        language: bundle.language,
        manifest: bundle.manifest.clone(),
    };
    let output = damaged.verify();
    let stderr = told(&output);
    let difference = format!(
        "{} ({}): first difference at",
        damage.named,
        bundle.language.name()
    );
    if output.status.code() == Some(1) && stderr.contains(&difference) {
        return Ok(());
    }
    Err(format!("{from:?} to {to:?}: {}\n{stderr}", output.status))
}

fn all_are_found(language: Language, damages: &'static [Damage]) {
    let folder = tempfile::tempdir().expect("a scratch folder");
    let path = folder.path().join("design.toml");
    std::fs::write(&path, design_text()).expect("a writable folder");
    let bundle = Bundle::emit(&path, language, folder.path().join("whole")).expect("a bundle");
    let missed: Vec<String> = std::thread::scope(|scope| {
        let (bundle, folder) = (&bundle, folder.path());
        let one =
            |(k, damage)| scope.spawn(move || found(bundle, damage, folder.join(format!("{k}"))));
        let running: Vec<_> = damages.iter().enumerate().map(one).collect();
        let results = running.into_iter().map(|run| run.join().expect("no panic"));
        results.filter_map(Result::err).collect()
    });
    assert!(missed.is_empty(), "\n{}", missed.join("\n\n"));
}

#[test]
fn damage_in_c_is_found_and_named() {
    all_are_found(Language::C, &C);
}

#[test]
fn damage_in_rust_is_found_and_named() {
    all_are_found(Language::Rust, &RUST);
}
