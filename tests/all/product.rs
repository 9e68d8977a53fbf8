//! `gyrogen emit --part all`: chain, conversion and correction of one design, built, checked and shown together.

use crate::common::command::{all_of, gyrogen, run};
use crate::common::compiler::cc;
use std::path::{Path, PathBuf};

const CORRECTION: &str = r#"
[correction]
period_s = 0.2
full_scale_dps = 500.0
noise_dps = 2e-3
inputs = [
    { column = "phase_rad", offset = -1.8, scale = 0.4 },
    { column = "supply_v", offset = 3.3, scale = 0.2 },
    { column = "freq_hz", offset = 1750.0, scale = 40.0 },
]
terms = [
    { kind = "product", gain_dps = 109.6, factors = [] },
    { kind = "product", gain_dps = 97.2, factors = [[0, 1]] },
    { kind = "lag", gain_dps = 4.0, input = 0, tau_s = 1.0 },
    { kind = "product", gain_dps = 0.1, factors = [[1, 1]] },
    { kind = "product", gain_dps = 0.5, factors = [[2, 1]] },
]
"#;

/// The default design, with its phase loop on if asked, and the correction.
fn design(phase_loop: bool, folder: &Path) {
    let mut text = format!("name = \"gyro\"\n{CORRECTION}");
    if phase_loop {
        let init = gyrogen(&["init", "whole.toml"], folder);
        assert!(init.status.success(), "{}", all_of(&init));
        let whole = std::fs::read_to_string(folder.join("whole.toml")).expect("a design");
        let mut inside = false;
        let line = |line: &str| {
            inside = line == "#[circuit.phase_loop]" || (inside && !line.is_empty());
            let on = inside && line.starts_with('#') && !line.starts_with("# ");
            line[usize::from(on)..].to_owned() + "\n"
        };
        text = whole.lines().map(line).collect::<String>() + CORRECTION;
    }
    std::fs::write(folder.join("design.toml"), text).expect("written");
}

fn emitted(language: &str, folder: &Path) -> PathBuf {
    let part = ["emit", "design.toml", "--part", "all", "--lang", language];
    let output = gyrogen(&[&part[..], &["--out", language]].concat(), folder);
    assert!(output.status.success(), "{}", all_of(&output));
    folder.join(language)
}

/// The example of a bundle's README.
fn example(folder: &Path, language: &str) -> String {
    let readme = std::fs::read_to_string(folder.join("README.md")).expect("a README");
    let (_, after) = readme
        .split_once(&format!("```{language}\n"))
        .expect("an example");
    after.split_once("\n```").expect("its end").0.to_owned() + "\n"
}

/// Compiles a program with all parts and runs it; its exit status.
fn run_c(main: &str, folder: &Path) -> Option<i32> {
    std::fs::write(folder.join("build.c"), main).expect("written");
    let mut arguments = vec![
        "-std=c99",
        "-O2",
        "-Wall",
        "-Wextra",
        "-Wconversion",
        "-Wshadow",
        "-pedantic",
        "-Werror",
    ];
    arguments.extend([
        "-Ichain",
        "-Iconversion",
        "-Icorrection",
        "build.c",
        "-o",
        "example",
    ]);
    let sources: Vec<String> = ["gyro", "gyro_tables"]
        .map(|name| format!("chain/{name}.c"))
        .into_iter()
        .chain(
            ["gyro_conversion", "gyro_conversion_tables"]
                .map(|name| format!("conversion/{name}.c")),
        )
        .chain(
            ["gyro_correction", "gyro_correction_tables"]
                .map(|name| format!("correction/{name}.c")),
        )
        .collect();
    arguments.extend(sources.iter().map(String::as_str));
    let built = cc().args(&arguments).current_dir(folder).output();
    let built = built.expect("a C compiler");
    assert!(built.status.success(), "{}", all_of(&built));
    let status = run("./example", &[], folder).status.code();
    for made in ["build.c", "example"] {
        std::fs::remove_file(folder.join(made)).expect("removed");
    }
    status
}

#[test]
fn all_parts_verify_together_and_the_c_example_runs() {
    for phase_loop in [false, true] {
        let top = tempfile::tempdir().expect("a folder");
        design(phase_loop, top.path());
        let folder = emitted("c", top.path());
        assert_eq!(run_c(&example(&folder, "c"), &folder), Some(0));
        let verified = gyrogen(&["verify", "c", "--design", "design.toml"], top.path());
        assert!(verified.status.success(), "{}", all_of(&verified));
        let all = all_of(&verified);
        for name in [
            "chain/chain",
            "conversion/sequence",
            "conversion/convert",
            "correction/correct",
            "all parts together",
        ] {
            assert!(all.contains(name), "{name} is not in {all}");
        }
        // A part is a bundle of its own.
        let part = gyrogen(
            &[
                "verify",
                "c/conversion",
                "--out",
                "part",
                "--design",
                "design.toml",
            ],
            top.path(),
        );
        assert!(part.status.success(), "{}", all_of(&part));

        // The check is of what goes between the parts: every wrong wire shows.
        let path = folder.join("test/gyro_all.c");
        let check = std::fs::read_to_string(&path).expect("the check");
        assert_eq!(run_c(&check, &folder), Some(0));
        let mut wrong = vec![
            ("row.sense_i", "row.sense_q"),
            ("row.phase", "row.phase + 1"),
            ("words.rate);\n", "words.drive_phase);\n"),
            // The zeroed state restarts by itself.
            ("(reading == 0U) ? 1 : 0", "1"),
            ("words.complete != 0", "words.complete == 0"),
            ("words.drive_phase,", "words.drive_phase / 2,"),
        ];
        if phase_loop {
            wrong.push(("g.chain.nco.tuning_word", "g.chain.nco.phase"));
            wrong.push(("words.drive_frequency,", "0,"));
        }
        for (from, to) in wrong {
            assert!(check.contains(from), "{from} is not in {check}");
            let damaged = check.replacen(from, to, 1);
            assert_eq!(run_c(&damaged, &folder), Some(1), "{from} -> {to} passes");
        }

        // Damage to a part, and a part of another product.
        let source = folder.join("conversion/gyro_conversion.c");
        let text = std::fs::read_to_string(&source).expect("a source");
        std::fs::write(&source, text.replacen("_C(1)", "_C(2)", 1)).expect("written");
        assert_eq!(gyrogen(&["verify", "c"], top.path()).status.code(), Some(1));
        let again = gyrogen(
            &[
                "emit",
                "design.toml",
                "--part",
                "all",
                "--lang",
                "c",
                "--out",
                "c",
            ],
            top.path(),
        );
        assert_eq!(again.status.code(), Some(2));
        assert!(
            all_of(&again).contains("conversion/gyro_conversion.c (edited)"),
            "{}",
            all_of(&again)
        );
        std::fs::write(&source, text).expect("written");
        let again = gyrogen(
            &[
                "emit",
                "design.toml",
                "--part",
                "chain",
                "--lang",
                "c",
                "--out",
                "c",
            ],
            top.path(),
        );
        assert!(again.status.success(), "{}", all_of(&again));
        assert!(!folder.join("conversion/manifest.json").exists());
        assert!(!folder.join("verify.json").exists());
    }
}

#[test]
fn all_parts_verify_together_in_rust_and_the_example_runs() {
    let top = tempfile::tempdir().expect("a folder");
    design(true, top.path());
    let folder = emitted("rust", top.path());
    let verified = gyrogen(&["verify", "rust", "--design", "design.toml"], top.path());
    assert!(verified.status.success(), "{}", all_of(&verified));
    assert!(all_of(&verified).contains("all parts together"));

    let cargo = std::env::var("CARGO").unwrap_or_else(|_| "cargo".to_owned());
    let tested = run(
        &cargo,
        &["test", "--offline", "--release", "--target-dir", "target"],
        &folder,
    );
    assert!(tested.status.success(), "{}", all_of(&tested));
    let bin = folder.join("src/bin");
    std::fs::create_dir(&bin).expect("made");
    std::fs::write(bin.join("example.rs"), example(&folder, "rust")).expect("written");
    let shown = [
        "run",
        "--offline",
        "--release",
        "--target-dir",
        "target",
        "--bin",
        "example",
    ];
    let shown = run(&cargo, &shown, &folder);
    assert!(shown.status.success(), "{}", all_of(&shown));
    // A wrong wire shows.
    let main = folder.join("src/main.rs");
    let text = std::fs::read_to_string(&main).expect("the check");
    assert!(text.contains("row.sense_i"));
    std::fs::write(&main, text.replacen("row.sense_i", "row.sense_q", 1)).expect("written");
    let check = [
        "run",
        "--offline",
        "--release",
        "--target-dir",
        "target",
        "--bin",
        "check",
    ];
    assert_eq!(run(&cargo, &check, &folder).status.code(), Some(1));
}

#[test]
#[ignore = "needs make and cmake; run by .ci/run"]
fn make_and_cmake_check_all_parts() {
    let top = tempfile::tempdir().expect("a folder");
    design(true, top.path());
    let folder = emitted("c", top.path());
    let made = run("make", &["check"], &folder);
    let text = all_of(&made);
    assert!(
        made.status.success() && text.ends_with("together: pass\n"),
        "{text}"
    );
    let configured = run("cmake", &["-S", ".", "-B", "build/cmake"], &folder);
    assert!(configured.status.success(), "{}", all_of(&configured));
    let check = ["--build", "build/cmake", "--target", "check"];
    let whole = run("cmake", &check, &folder);
    assert!(whole.status.success(), "{}", all_of(&whole));
    let path = folder.join("test/gyro_all.c");
    let text = std::fs::read_to_string(&path).expect("the check");
    std::fs::write(&path, text.replacen("row.sense_i", "row.sense_q", 1)).expect("written");
    assert!(!run("make", &["check"], &folder).status.success());
    assert!(!run("cmake", &check, &folder).status.success());
}

#[test]
fn coefficients_that_no_record_gave_are_noted() {
    let top = tempfile::tempdir().expect("a folder");
    design(false, top.path());
    for (part, is_noted) in [("all", true), ("chain", true), ("conversion", false)] {
        let arguments = [
            "emit",
            "design.toml",
            "--part",
            part,
            "--lang",
            "c",
            "--out",
            part,
        ];
        let output = gyrogen(&arguments, top.path());
        assert!(output.status.success(), "{}", all_of(&output));
        let said = all_of(&output);
        let of_rate_alone =
            said.contains("Only the chain's own rate (`row.rate`) uses these coefficients");
        assert_eq!(of_rate_alone, part == "all", "{said}");
        assert_eq!(
            said.contains("warning: the coefficients"),
            part == "chain",
            "{said}"
        );
        let notes = said.contains("not fitted to a record");
        assert_eq!(notes, is_noted, "{part}: {}", all_of(&output));
    }
}

#[test]
fn what_does_not_go_together_is_refused() {
    let top = tempfile::tempdir().expect("a folder");
    let refused = |text: &str, rule: &str| {
        std::fs::write(top.path().join("design.toml"), text).expect("written");
        for part in ["all", "conversion"] {
            let part = [
                "emit",
                "design.toml",
                "--lang",
                "c",
                "--out",
                "c",
                "--part",
                part,
            ];
            let output = gyrogen(&part, top.path());
            assert_eq!(output.status.code(), Some(2), "{}", all_of(&output));
            assert!(all_of(&output).contains(rule), "{}", all_of(&output));
        }
        assert!(!top.path().join("c/manifest.json").exists());
    };
    refused("", "no [correction]");
    refused(
        &CORRECTION
            .replace("phase_rad", "die_degc")
            .replace("freq_hz", "die2_degc"),
        "none of its inputs",
    );
    refused(
        &CORRECTION.replace("period_s = 0.2", "period_s = 0.0005"),
        "shorter than one row",
    );
    refused(
        &CORRECTION.replace("period_s = 0.2", "period_s = 0.0008"),
        "1.400 rows",
    );
    // A chain without a compensation has no rate in deg/s.
    design(true, top.path());
    let text = std::fs::read_to_string(top.path().join("design.toml")).expect("a design");
    let (before, after) = text
        .split_once("\n[compensation]\n")
        .expect("a compensation");
    let (_, after) = after.split_once("\n[").expect("the next table");
    refused(&format!("{before}\n[{after}"), "[compensation]");
}

#[test]
fn a_product_that_is_not_whole_does_not_verify() {
    let top = tempfile::tempdir().expect("a folder");
    design(false, top.path());
    let folder = emitted("c", top.path());
    let manifest = folder.join("manifest.json");
    let text = std::fs::read_to_string(&manifest).expect("a manifest");
    let fails = |why: &str| {
        let verified = gyrogen(&["verify", "c"], top.path());
        assert_eq!(verified.status.code(), Some(1), "{}", all_of(&verified));
        assert!(all_of(&verified).contains(why), "{}", all_of(&verified));
    };
    // Without its parts in the manifest.
    let (before, after) = text.split_once("  \"parts\": [").expect("parts");
    let (_, after) = after.split_once("],\n").expect("their end");
    std::fs::write(&manifest, format!("{before}{after}")).expect("written");
    fails("its parts are not");
    std::fs::write(&manifest, &text).expect("written");
    // A part's manifest in other line ends.
    let part = folder.join("chain/manifest.json");
    let of_part = std::fs::read_to_string(&part).expect("a manifest");
    std::fs::write(&part, of_part.replace('\n', "\r\n")).expect("written");
    let verified = gyrogen(&["verify", "c"], top.path());
    let said = all_of(&verified);
    assert_eq!(verified.status.code(), Some(1), "{said}");
    assert!(
        said.contains("in their line ends alone (CR LF for LF): chain/manifest.json")
            && !said.contains("the digest of chain"),
        "{said}"
    );
    // A part of another design.
    let other = ["emit", "--part", "chain", "--lang", "c", "--out", "other"];
    assert!(gyrogen(&other, top.path()).status.success());
    std::fs::copy(
        top.path().join("other/manifest.json"),
        folder.join("chain/manifest.json"),
    )
    .expect("copied");
    fails("is not of this product");
    // Without a part.
    std::fs::remove_dir_all(folder.join("chain")).expect("removed");
    fails("chain/manifest.json is no manifest");
}
