//! The main job as a user runs it: the embedded default, and real records where they are at hand.

use crate::common::command::{all_of, good, gyrogen, gyrogen_here, shell, text, told};
use crate::common::json::number;
use serde_json::Value;
use sha2::{Digest, Sha256};
use std::path::{Path, PathBuf};

fn run(design: Option<&Path>, record: Option<&Path>, out: &Path) -> Value {
    let mut arguments = vec!["run"];
    arguments.extend(design.map(text));
    if let Some(record) = record {
        arguments.extend(["--record", text(record)]);
    }
    arguments.extend(["--out", text(out), "--format", "json"]);
    let output = gyrogen_here(&arguments);
    let talk = told(&output);
    assert_eq!(output.status.code(), Some(0), "{talk}");
    let printed: Value = serde_json::from_slice(&output.stdout).expect("JSON on stdout");
    let written = std::fs::read(out.join("summary.json")).expect("summary.json");
    assert_eq!(output.stdout, written, "stdout and summary.json differ");
    printed
}

/// Section 6 of the design: 160 deg/s before, the published 5 % after, the same in every path.
#[test]
fn the_default_design_reproduces_the_published_figures_through_all_paths() {
    let folder = tempfile::tempdir().expect("a folder");
    let summary = run(None, None, folder.path());
    assert_eq!(summary["schema"], "gyrogen.run/1");
    let before = number(&summary, "before.drift_pp_dps");
    assert!((before - 160.0).abs() < 3.0, "{before}");
    let ratio = number(&summary, "ratio");
    assert!((0.045..0.055).contains(&ratio), "{ratio}");
    let fixed = number(&summary, "after.fixed.drift_pp_dps");
    assert!((fixed - number(&summary, "after.float.drift_pp_dps")).abs() < 0.02);
    assert_eq!(fixed, number(&summary, "after.emitted.drift_pp_dps"));
    assert!(number(&summary, "equivalence.fixed_minus_float_max_dps") < 0.02);
    assert_eq!(number(&summary, "equivalence.mismatches"), 0.0);
    assert!(number(&summary, "equivalence.compared") >= f64::from(1 << 20));
    let bias = summary["equivalence"]["functions"]
        .as_array()
        .expect("functions");
    let exhaustive = bias
        .iter()
        .filter(|f| f["name"] == "bias" && f["exhaustive"] == true);
    assert!(
        exhaustive.filter(|f| f["inputs"] == 1 << 24).count() == 2,
        "C and Rust"
    );

    for file in summary["emitted"].as_array().expect("files") {
        let path = folder.path().join(file["path"].as_str().expect("a path"));
        let bytes = std::fs::read(&path).expect("an emitted file");
        let sum: String = Sha256::digest(&bytes)
            .iter()
            .map(|b| format!("{b:02x}"))
            .collect();
        assert_eq!(file["sha256"], sum.as_str(), "{}", path.display());
    }
    let report = std::fs::read_to_string(folder.path().join("report.html")).expect("report.html");
    assert_eq!(report.matches("<figure>").count(), 4);
    // One file: nothing is fetched.
    for outside in ["src=", "href=\"http", "url(", "@import", "<script"] {
        assert!(!report.contains(outside), "{outside}");
    }

    // The bundles stand on their own.
    for language in ["c", "rust"] {
        let bundle = folder.path().join("firmware").join(language);
        let output = gyrogen_here(&["verify", text(&bundle)]);
        assert_eq!(output.status.code(), Some(0), "{language}");
    }

    // The record of the own run, read back as a measured one, gives the same compensation.
    let design = folder.path().join("quadratic.toml");
    std::fs::write(&design, "[fit]\norder = 2\n").expect("a design");
    let again = folder.path().join("again");
    let summary_again = run(
        Some(&design),
        Some(&folder.path().join("record.csv")),
        &again,
    );
    assert_eq!(
        summary["fit"]["coefficients_raw"],
        summary_again["fit"]["coefficients_raw"]
    );
    let apart = fixed - number(&summary_again, "after.fixed.drift_pp_dps");
    assert!(apart.abs() < 0.02, "{apart}");
}

#[test]
fn the_same_run_gives_the_same_bytes() {
    let folder = tempfile::tempdir().expect("a folder");
    let of = |name: &str| {
        let out = folder.path().join(name);
        let summary = run(None, None, &out);
        let read = |file: &str| std::fs::read(out.join(file)).expect("a file");
        (
            summary,
            read("record.csv"),
            read("firmware/c/gyro.c"),
            read("firmware/rust/src/lib.rs"),
        )
    };
    assert_eq!(of("one"), of("two"));
}

#[test]
fn a_word_that_overflows_is_named_with_its_mend_and_nothing_is_called_proved() {
    let folder = tempfile::tempdir().expect("a folder");
    let at = folder.path();
    let text = include_str!("../../src/design/default.toml");
    let (from, to) = (
        "output = { format = \"Q12.12\"",
        "output = { format = \"Q7.12\"",
    );
    assert_eq!(text.matches(from).count(), 1);
    std::fs::write(at.join("o.toml"), text.replace(from, to)).expect("a design");
    let output = gyrogen(&["run", "o.toml", "--out", "out"], at);
    good(&output);
    let all = all_of(&output);
    let change = "The smallest change that mends it: compensation.output from Q7.12 to Q9.12";
    for said in [
        "The firmware's bias keeps to no bound: a word saturates",
        "Nor does the rate.",
        "compensation.output overflows. ",
    ] {
        assert!(all.contains(said), "{said}: {all}");
    }
    // With the result and in the warning.
    assert_eq!(all.matches(change).count(), 2, "{all}");
    for wrong in ["proved", "No word alone", "next: "] {
        assert!(!all.contains(wrong), "{wrong}: {all}");
    }
    assert!(all.contains(", record.csv, "), "{all}");

    // The same for a record of one's own.
    let order = text
        .replace(from, to)
        .replace("order = \"by_record\"", "order = 2");
    std::fs::write(at.join("again.toml"), order).expect("a design");
    let again = [
        "run",
        "again.toml",
        "--record",
        "out/record.csv",
        "--out",
        "again",
    ];
    let again = gyrogen(&again, at);
    good(&again);
    let all = all_of(&again);
    assert!(
        all.contains("Nor does the rate.") && all.contains(change),
        "{all}"
    );
    assert!(!all.contains("proved") && !all.contains("next: "), "{all}");

    let checked = gyrogen(&["check", "o.toml", "--samples", "100000"], at);
    assert_eq!(checked.status.code(), Some(1));
    let told = told(&checked);
    let line = text.lines().position(|l| l.starts_with(from)).expect("it") + 1;
    let mend = format!(
        ". The smallest change that mends it, in o.toml, line {line}: compensation.output from Q7.12 to Q9.12"
    );
    assert_eq!(told.matches(&mend).count(), 1, "{told}");
}

/// Records of real chips: the held-out error is no worse than the table beside them (polynomials of degree 1 to 5, both
/// autopilots' cubics).
#[test]
#[ignore = "measured records stand outside of the repository"]
fn measured_records_become_firmware() {
    let data = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../shared/data");
    let folder = tempfile::tempdir().expect("a folder");
    for (file, axis, best) in [
        ("lego_hub_rb.csv", "x", 0.02655),
        ("lego_hub_rb.csv", "y", 0.02655),
        ("lego_hub_rb.csv", "z", 0.02145),
        ("lego_hub_rx.csv", "x", 0.01725),
        ("lego_hub_rx.csv", "y", 0.01985),
        ("lego_hub_rx.csv", "z", 0.02235),
    ] {
        let design = folder.path().join("design.toml");
        let mapping = format!(
            "[record]\nrow_period_s = 15\n[record.columns]\nrate_out_dps = \"gyro_{axis}_dps\"\n\
             die_degc = \"temperature_degc\"\n"
        );
        std::fs::write(&design, mapping).expect("a design");
        let summary = run(
            Some(&design),
            Some(&data.join(file)),
            &folder.path().join("out"),
        );
        let heldout = number(&summary, "fit.heldout_rms_dps");
        assert!(heldout <= best, "{file} {axis}: {heldout}");
        assert_eq!(number(&summary, "equivalence.mismatches"), 0.0);
        let fixed = number(&summary, "after.fixed.rms_dps");
        assert!((fixed / number(&summary, "after.float.rms_dps") - 1.0).abs() < 0.01);
        // The bit-accurate compensation leaves what the fit leaves.
        let left = fixed / number(&summary, "fit.in_sample_rms_dps");
        assert!((left - 1.0).abs() < 0.02, "{file} {axis}: {left}");
    }
}

#[test]
fn init_writes_a_design_that_runs_and_never_overwrites() {
    let folder = tempfile::tempdir().expect("a folder");
    let design = folder.path().join("design.toml");
    assert_eq!(
        gyrogen_here(&["init", text(&design)]).status.code(),
        Some(0)
    );
    let before = std::fs::read(&design).expect("the design");
    let second = gyrogen_here(&["init", text(&design)]);
    assert_eq!(second.status.code(), Some(2));
    assert_eq!(std::fs::read(&design).expect("the design"), before);
    let out = folder.path().join("emitted");
    let emit = ["emit", text(&design), "--lang", "c", "--out", text(&out)];
    assert_eq!(gyrogen_here(&emit).status.code(), Some(0));
}

/// What `init` writes is the embedded default, also where a record calls for other formats than its own
/// `[compensation]` has.
#[test]
fn the_file_of_init_runs_on_a_record_as_the_embedded_default() {
    let folder = tempfile::tempdir().expect("a folder");
    let (design, record) = (
        folder.path().join("my.toml"),
        folder.path().join("record.csv"),
    );
    assert_eq!(
        gyrogen_here(&["init", text(&design)]).status.code(),
        Some(0)
    );
    let mut csv = String::from("time_s,phase_rad,rate_out_dps\n");
    for k in 0..80 {
        let phase = -1.5 - 0.005 * f64::from(k);
        let noise = 0.01 * f64::from(k * 7919 % 13 - 6);
        csv += &format!("{k},{phase},{}\n", 2000.0 * (phase + 1.7).powi(3) + noise);
    }
    std::fs::write(&record, csv).expect("a record");
    let (mine, own) = (folder.path().join("mine"), folder.path().join("own"));
    let from_file = run(Some(&design), Some(&record), &mine);
    let embedded = run(None, Some(&record), &own);
    // An order 1 coefficient of some 54 000 deg/s, which the default's Q12.20 does not hold.
    assert!(!embedded["chosen"].as_array().expect("chosen").is_empty());
    for key in ["fit", "chosen", "before", "after", "budget", "warnings"] {
        assert_eq!(from_file[key], embedded[key], "{key}");
    }
    let body = |out: &Path| {
        let text = std::fs::read_to_string(out.join("firmware/c/gyro.c")).expect("C");
        text.lines().skip(1).map(str::to_owned).collect::<Vec<_>>()
    };
    assert_eq!(body(&mine), body(&own));
}

/// A phase loop that is turned on in the file of `init` makes its compensation by the phase useless: that is said.
#[test]
fn a_phase_loop_in_the_file_of_init_takes_the_tuning_word() {
    let folder = tempfile::tempdir().expect("a folder");
    let design = folder.path().join("my.toml");
    let made = gyrogen_here(&["init"]);
    let lines = String::from_utf8(made.stdout).expect("UTF-8");
    let on = |line: &str| match line.strip_prefix('#') {
        Some(setting)
            if [
                "[circuit.phase_loop]",
                "setpoint_raw",
                "proportional",
                "integral = ",
            ]
            .iter()
            .any(|key| setting.starts_with(key)) =>
        {
            setting.to_owned()
        }
        _ => line.to_owned(),
    };
    let lines: Vec<String> = lines.lines().map(on).collect();
    let text_on = lines
        .join("\n")
        .replace("#integrator_bits", "integrator_bits");
    std::fs::write(&design, text_on).expect("a design");
    let summary = run(Some(&design), None, &folder.path().join("out"));
    let codes = summary["warnings"].as_array().expect("warnings");
    assert!(
        codes.iter().any(|w| w["code"] == "phase_is_held"),
        "{codes:?}"
    );
}

/// A phase in degrees fits no phase word: said, with the factor. Beside another thermometer it is only unlikely.
#[test]
fn a_phase_in_degrees_stops_only_a_fit_over_it() {
    let folder = tempfile::tempdir().expect("a folder");
    let (record, design) = (
        folder.path().join("record.csv"),
        folder.path().join("by_die.toml"),
    );
    let mut csv = String::from("time_s,die_degc,phase_rad,rate_out_dps\n");
    for k in 0..60 {
        let t = 20.0 + 0.5 * f64::from(k);
        let noise = 0.01 * f64::from(k * 7919 % 13 - 6);
        csv += &format!("{k},{t},{},{}\n", -90.0 - 0.5 * t, 0.3 + 0.02 * t + noise);
    }
    std::fs::write(&record, csv).expect("a record");
    let out = folder.path().join("out");
    let refused = gyrogen_here(&["run", "--record", text(&record), "--out", text(&out)]);
    let talk = told(&refused);
    assert_eq!(refused.status.code(), Some(2), "{talk}");
    assert!(
        talk.contains("phase_rad") && talk.contains("57.29578"),
        "{talk}"
    );

    std::fs::write(&design, "[record]\nthermometer = \"die_degc\"\n").expect("a design");
    let summary = run(Some(&design), Some(&record), &out);
    let codes = summary["warnings"].as_array().expect("warnings");
    assert!(
        codes.iter().any(|w| w["code"] == "phase_in_degrees"),
        "{codes:?}"
    );
}

/// A record of 60 rows, in a folder: its times, and what its thermometer shows.
fn sixty(folder: &Path, step_s: i32, die_degc: fn(i32) -> f64) {
    let mut csv = String::from("time_s,die_degc,rate_out_dps\n");
    for k in 0..60 {
        let noise = 0.01 * f64::from(k * 7919 % 13 - 6);
        let rate = 0.8 + 0.01 * f64::from(k) + noise;
        csv += &format!("{},{},{rate}\n", step_s * k, die_degc(k));
    }
    std::fs::write(folder.join("record.csv"), csv).expect("a record");
}

/// Milliseconds that nobody marked change what every result means.
#[test]
fn what_is_said_of_the_record_comes_before_the_results() {
    let folder = tempfile::tempdir().expect("a folder");
    sixty(folder.path(), 10_000, |k| 20.0 + 0.5 * f64::from(k));
    for (command, result) in [
        ("run --out a", "words compared"),
        ("close --out b", "noise floor"),
        ("run --out c --format json", "\"fit\""),
    ] {
        let line = format!("gyrogen {command} --record record.csv 2>&1");
        let said = all_of(&shell(&line, folder.path()));
        let place = |part: &str| said.find(part).unwrap_or_else(|| panic!("{part}: {said}"));
        assert!(place("[time_step_implausible]") < place(result), "{said}");
        assert_eq!(said.matches("[time_step_implausible]").count(), 1, "{said}");
    }
}

/// A thermometer that stands gives no drift over temperature, and no causes to look for.
#[test]
fn a_constant_thermometer_is_the_first_thing_said() {
    let folder = tempfile::tempdir().expect("a folder");
    sixty(folder.path(), 1, |_| 25.0);
    let output = gyrogen(&["run", "--record", "record.csv"], folder.path());
    good(&output);
    let said = all_of(&output);
    let headline = "No dependence on temperature could be fitted: die_degc is constant.";
    assert!(said.contains(&format!("\n{headline}\n")), "{said}");
    assert!(!told(&output).contains("next:"), "{said}");
    let page = std::fs::read_to_string(folder.path().join("gyrogen-out/report.html"));
    assert!(page.expect("a report").contains(headline));
}

/// What an earlier run made and this one does not goes: its record would be taken for that of these results. What was edited
/// is asked for first.
#[test]
fn a_run_leaves_nothing_of_an_earlier_one() {
    let folder = tempfile::tempdir().expect("a folder");
    let at = folder.path();
    sixty(at, 60, |k| 20.0 + 0.5 * f64::from(k));
    good(&gyrogen(&["run", "--lang", "c", "--out", "out"], at));
    assert!(at.join("out/record.csv").is_file());
    let measured = [
        "run",
        "--lang",
        "c",
        "--out",
        "out",
        "--record",
        "record.csv",
    ];
    std::fs::write(at.join("out/design.toml"), "mine").expect("written");
    let refused = gyrogen(&measured, at);
    assert_eq!(refused.status.code(), Some(2));
    assert!(told(&refused).contains("it was edited since it was written"));
    let forced = gyrogen(&[&measured[..], &["--force"]].concat(), at);
    good(&forced);
    let said = told(&forced);
    assert!(
        said.contains("--force overwrites: design.toml (edited)"),
        "{said}"
    );
    assert!(!at.join("out/record.csv").exists());
    let sums = shell("cd out && sha256sum --check --quiet SHA256SUMS", at);
    good(&sums);
}

/// A rate that was not measured in some rows counts as none, and the fitted design reproduces the
/// firmware.
#[test]
fn gaps_in_the_applied_rate_and_the_fitted_design() {
    let folder = tempfile::tempdir().expect("a folder");
    let record = folder.path().join("record.csv");
    let mut csv = String::from("time_s,die_degc,rate_out_dps,rate_dps\n");
    for k in 0..60 {
        let t = 20.0 + 0.5 * f64::from(k);
        let applied = if k % 3 == 0 {
            String::new()
        } else {
            "1.5".to_owned()
        };
        let rate = if k % 3 == 0 { 0.0 } else { 1.5 };
        let noise = 0.01 * f64::from(k * 7919 % 13 - 6);
        csv += &format!("{k},{t},{},{applied}\n", 0.3 + 0.02 * t + rate + noise);
    }
    std::fs::write(&record, csv).expect("a record");
    let out = folder.path().join("out");
    let summary = run(None, Some(&record), &out);
    assert_eq!(number(&summary, "equivalence.mismatches"), 0.0);
    assert!(number(&summary, "after.fixed.rms_dps") < 0.1);
    assert!(number(&summary, "before.rms_dps") > 0.5);

    let again = folder.path().join("again");
    let design = out.join("design.toml");
    let emit = [
        "emit",
        text(&design),
        "--lang",
        "c",
        "--part",
        "compensation",
        "--out",
        text(&again),
    ];
    assert_eq!(gyrogen_here(&emit).status.code(), Some(0));
    let body = |path: PathBuf| {
        let text = std::fs::read_to_string(path).expect("C");
        text.lines().skip(1).map(str::to_owned).collect::<Vec<_>>()
    };
    assert_eq!(
        body(again.join("gyro.c")),
        body(out.join("firmware/c/gyro.c"))
    );

    // Its thermometer is not what the own thermal run has.
    let other = folder.path().join("other");
    let own = gyrogen_here(&["run", text(&design), "--out", text(&other)]);
    assert_eq!(own.status.code(), Some(2));
    assert!(told(&own).contains("--record"));
}

/// What cannot be used ends with status 2, says what to do, and writes nothing.
#[test]
fn unusable_input_writes_nothing() {
    let folder = tempfile::tempdir().expect("a folder");
    let write = |name: &str, text: &str| {
        let path = folder.path().join(name);
        std::fs::write(&path, text).expect("a file");
        path
    };
    let good = "time_s,phase_rad,rate_out_dps\n".to_owned()
        + &(0..40)
            .map(|k| format!("{k},{},{}\n", -1.5 - 0.01 * f64::from(k), k))
            .collect::<String>();
    let record = write("good.csv", &good);
    let backwards = write("backwards.csv", &good.replace("\n20,", "\n2,"));
    let no_rate = write("no_rate.csv", &good.replace("rate_out_dps", "rate"));
    let short = write("short.csv", "time_s,phase_rad,rate_out_dps\n0,-1,2\n");
    let bad_cell = write("bad_cell.csv", &good.replace("-1.6", "minus"));
    let degrees = write("order.toml", "[fit]\norder = 99\n");
    let unknown = write("unknown.toml", "[fitt]\norder = 2\n");
    let other = write(
        "other.toml",
        "[compensation]\ninput = \"die_degc\"\ninput_format = \"Q8.8\"\nrate_input_format = \"Q12.20\"\n\
         coefficients_raw = [1]\ncoefficient_format = \"Q12.20\"\naccumulator = \"Q13.27\"\n\
         rate_full_scale_dps = 1\noutput = \"Q12.20\"\n",
    );
    let small = write(
        "small.toml",
        "[compensation]\ninput = \"phase\"\ncoefficients_raw = [1]\ncoefficient_format = \"Q2.20\"\n\
         accumulator = \"Q13.27\"\nrate_full_scale_dps = 2048\noutput = \"Q12.12\"\n",
    );
    let missing = folder.path().join("missing.csv");
    for (design, record, words) in [
        (None, &backwards, "backwards.csv:22:1"),
        (None, &no_rate, "rate_out_dps"),
        (None, &short, "short.csv"),
        (None, &bad_cell, "bad_cell.csv:12:4"),
        (None, &missing, "missing.csv"),
        (Some(&degrees), &record, "order.toml:2:9"),
        (Some(&unknown), &record, "unknown.toml:1:"),
        (Some(&other), &record, "die_degc"),
        (Some(&small), &record, "integer bits"),
    ] {
        let out = folder.path().join("out");
        let mut arguments = vec!["run"];
        arguments.extend(design.map(|d: &PathBuf| text(d)));
        arguments.extend(["--record", text(record), "--out", text(&out)]);
        let output = gyrogen_here(&arguments);
        let talk = told(&output);
        assert_eq!(output.status.code(), Some(2), "{words}: {talk}");
        assert!(talk.contains(words), "{words}: {talk}");
        assert!(
            talk.contains("help:") && !talk.contains("panicked"),
            "{talk}"
        );
        assert!(!out.exists(), "{words}: something was written");
    }
}
