//! A bundle in the hands of somebody without gyrogen: `make check`, CMake and `cargo test` pass, and damage fails.

use crate::common::command::{all_of, good, run};
use crate::oracle::harness::binary;
use std::path::{Path, PathBuf};

fn emitted(language: &str, at: &Path) -> PathBuf {
    let folder = at.join(language);
    good(&run(
        &binary(),
        &["emit", "--lang", language, "--out", language],
        at,
    ));
    folder
}

/// Ten damages of a product: file, what stands there, what a hand makes of it.
const DAMAGES: [(&str, &str, &str); 10] = [
    (
        "gyro.c",
        "const int32_t product = gyro_asr_32(biased, 8U);",
        "const int32_t product = gyro_asr_32(biased, 9U);",
    ),
    ("gyro.c", "exact + INT32_C(128)", "exact + INT32_C(127)"),
    (
        "gyro.c",
        "tuning_word = UINT32_C(134217728)",
        "tuning_word = UINT32_C(134217729)",
    ),
    ("gyro.c", "    s->delay_2 = new_delay_2;\n", ""),
    (
        "gyro.c",
        "difference = x - step_x",
        "difference = x + step_x",
    ),
    ("gyro.c", "INT64_C(1415954326)", "INT64_C(1415954327)"),
    (
        "gyro.c",
        "out.magnitude = (int32_t)rounded;",
        "out.magnitude = 0;",
    ),
    ("gyro_tables.c", "32767", "32766"),
    ("gyro_selftest.c", "UINT64_C(0x", "UINT64_C(0x1"),
    ("vectors/bias.csv", "\n-1,448921,", "\n-1,448920,"),
];

/// With checksums of the damaged files: it is code and vectors that have to notice.
#[test]
#[ignore = "needs make and sha256sum; run by .ci/run"]
fn make_check_passes_and_fails_for_each_of_ten_damages() {
    let top = tempfile::tempdir().expect("a folder");
    let folder = emitted("c", top.path());
    let whole = run("make", &["check"], &folder);
    let said = all_of(&whole);
    assert!(
        whole.status.success() && said.ends_with("check: pass\n"),
        "{said}"
    );
    for (name, from, to) in DAMAGES {
        let path = folder.join(name);
        let text = std::fs::read_to_string(&path).expect("a file of the bundle");
        assert!(text.contains(from), "{name} has no {from:?}");
        std::fs::write(&path, text.replacen(from, to, 1)).expect("written");
        let sums = folder.join("SHA256SUMS");
        let before = std::fs::read_to_string(&sums).expect("checksums");
        let damaged = run("make", &["check"], &folder);
        assert!(
            !damaged.status.success() && all_of(&damaged).contains(&format!("{name}: FAILED")),
            "{name}: {}",
            all_of(&damaged)
        );
        let names: Vec<&str> = before.lines().map(|l| &l[66..]).collect();
        let anew = run("sha256sum", &names, &folder);
        std::fs::write(&sums, &anew.stdout).expect("written");
        let damaged = run("make", &["check"], &folder);
        assert!(
            !damaged.status.success(),
            "{name} with {to:?} passes:\n{}",
            all_of(&damaged)
        );
        std::fs::write(&path, text).expect("written");
        std::fs::write(&sums, before).expect("written");
    }
    // A file that is not there.
    std::fs::remove_file(folder.join("vectors/nco.csv")).expect("removed");
    assert!(!run("make", &["check"], &folder).status.success());
}

#[test]
#[ignore = "needs cmake; run by .ci/run"]
fn cmake_checks_too() {
    let top = tempfile::tempdir().expect("a folder");
    let folder = emitted("c", top.path());
    let configured = run("cmake", &["-S", ".", "-B", "build"], &folder);
    assert!(configured.status.success(), "{}", all_of(&configured));
    let check = ["--build", "build", "--target", "check"];
    let whole = run("cmake", &check, &folder);
    assert!(whole.status.success(), "{}", all_of(&whole));
    let path = folder.join("gyro.c");
    let text = std::fs::read_to_string(&path).expect("a source");
    std::fs::write(&path, text.replacen(DAMAGES[1].1, DAMAGES[1].2, 1)).expect("written");
    assert!(!run("cmake", &check, &folder).status.success());
}

#[test]
fn cargo_test_runs_the_vectors_of_a_rust_bundle() {
    let top = tempfile::tempdir().expect("a folder");
    let folder = emitted("rust", top.path());
    let cargo = std::env::var("CARGO").unwrap_or_else(|_| "cargo".to_owned());
    let test = ["test", "--offline", "--release", "--target-dir", "target"];
    let whole = run(&cargo, &test, &folder);
    assert!(whole.status.success(), "{}", all_of(&whole));
    let path = folder.join("src/lib.rs");
    let text = std::fs::read_to_string(&path).expect("a source");
    let from = "wrapping_add(128_i32)";
    assert!(text.contains(from));
    std::fs::write(&path, text.replacen(from, "wrapping_add(127_i32)", 1)).expect("written");
    let damaged = run(&cargo, &test, &folder);
    assert!(!damaged.status.success(), "{}", all_of(&damaged));
}
