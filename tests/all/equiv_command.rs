//! `gyrogen equiv` as a user runs it: repairs, two designs, threads, counterexamples.

use crate::common::command::{gyrogen_here, gyrogen_in, told};
use gyrogen::design::{Design, reader};
use gyrogen::equivalence::job::{Stimulus, counterexample};
use gyrogen::equivalence::outcome::Emitted;
use gyrogen::equivalence::shrink::{MOST_RUNS, capture_text, shrink};
use gyrogen::nodes::run::run;
use gyrogen::verify::compare::Compared;
use proptest::prelude::*;
use serde_json::Value;
use std::path::Path;
use std::process::Output;

fn equiv(arguments: &[&str], out: &Path) -> Output {
    gyrogen_here(
        &[
            &["equiv"],
            arguments,
            &["--out", out.to_str().expect("UTF-8")],
        ]
        .concat(),
    )
}

fn result(out: &Path) -> Value {
    let bytes = std::fs::read(out.join("equiv.json")).expect("equiv.json");
    serde_json::from_slice(&bytes).expect("JSON")
}

fn default_text() -> String {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("src/design/default.toml");
    std::fs::read_to_string(path).expect("the default design")
}

/// Sets a key of a table: `from` becomes `to` in its line.
fn edit(text: &str, key: &str, from: &str, to: &str) -> String {
    let (table, name) = key.rsplit_once('.').expect("a dotted key");
    let (mut inside, mut edits) = (false, 0);
    let lines: Vec<String> = text
        .lines()
        .map(|line| {
            if line.starts_with('[') {
                inside = line.trim_end() == format!("[{table}]");
            }
            if inside && line.starts_with(&format!("{name} = ")) {
                assert!(line.contains(from), "{line} has no {from}");
                edits += 1;
                return line.replacen(from, to, 1);
            }
            line.to_owned()
        })
        .collect();
    assert_eq!(edits, 1, "{key}");
    lines.join("\n") + "\n"
}

fn text(value: &Value) -> &str {
    value.as_str().expect("a string")
}

/// Shortens, runs, applies what is reported to the file, runs again.
fn repaired(design: &str, key: &str, from: &str, to: &str, arguments: &[&str]) {
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("design.toml");
    let out = folder.path().join("out");
    let mut design = edit(design, key, from, to);
    std::fs::write(&file, &design).expect("written");
    let mut all = vec![file.to_str().expect("UTF-8")];
    all.extend(arguments);
    let output = equiv(&all, &out);
    let talk = told(&output);
    assert_eq!(output.status.code(), Some(1), "{key}: {talk}");
    assert!(
        talk.contains("overflow at sample") && talk.contains(key),
        "{talk}"
    );
    let said = String::from_utf8_lossy(&output.stdout).into_owned();
    let of_key = said.lines().filter(|l| l.trim_start().starts_with(key));
    let mut words = of_key.map(|l| l.split_whitespace().collect::<Vec<_>>());
    assert!(words.any(|w| w.contains(&"none")), "{key}: {said}");
    assert!(
        said.contains("  tried: with that nothing overflows\n"),
        "{said}"
    );
    let json = result(&out);
    let first = &json["first_overflow"];
    assert!(text(&first["node"]).starts_with(key), "{first}");
    assert!(
        first["sample"].is_u64() && first["operands"].is_array(),
        "{first}"
    );
    assert_eq!(json["repair_verified"], true);
    assert_eq!(first["repair"], json["repairs"][0]);
    let repairs = json["repairs"].as_array().expect("a list");
    assert_eq!(
        repairs.len(),
        1,
        "only one format was too short: {repairs:?}"
    );
    for r in repairs {
        design = edit(&design, text(&r["key"]), text(&r["from"]), text(&r["to"]));
    }
    std::fs::write(&file, &design).expect("written");
    let output = equiv(&all, &out);
    let talk = told(&output);
    assert_eq!(output.status.code(), Some(0), "{key}: {talk}");
    let json = result(&out);
    assert_eq!(json["first_overflow"], Value::Null);
    assert_eq!(json["holds"], true);
}

#[test]
fn a_short_accumulator_is_reported_with_the_repair_that_works() {
    // c1 and c2 p have the same sign below p = 0 and add up to more than each alone.
    let design = edit(
        &default_text(),
        "compensation.coefficients_raw",
        "800391448",
        "-1415954326",
    );
    let samples = ["--samples", "400000"];
    repaired(
        &design,
        "compensation.accumulator",
        "Q13.27",
        "Q12.27",
        &samples,
    );
}

#[test]
fn words_four_bits_too_short_are_reported_with_the_repair_that_works() {
    // An ADC of +-8 V, so that the formats have integer bits to lose.
    let design = edit(&default_text(), "circuit.adc.format", "Q1.15", "Q4.12");
    let design = edit(&design, "circuit.demodulator.product", "Q2.22", "Q5.22");
    let design = edit(&design, "circuit.decimator.output", "Q2.22", "Q5.22");
    let design = edit(&design, "circuit.cordic.width", "32", "40");
    let design = edit(&design, "compensation.output", "Q12.12", "Q17.12");
    let arguments = ["--samples", "300000", "--stimulus", "adversarial"];
    for key in ["circuit.demodulator.product", "circuit.decimator.output"] {
        repaired(&design, key, "Q5.22", "Q1.22", &arguments);
    }
}

#[test]
fn tables_of_words_fit_a_terminal_of_100_columns() {
    let folder = tempfile::tempdir().expect("a folder");
    let longest = [
        ("check", "circuit.decimator integrators drive_i"),
        ("equiv", "circuit.demodulator.product drive_i"),
    ];
    for (command, name) in longest {
        let arguments = [command, "--samples", "100000", "--out", "out"];
        let output = gyrogen_in(folder.path(), &arguments, &[("COLUMNS", "100")]);
        assert_eq!(output.status.code(), Some(0), "{}", told(&output));
        let said = String::from_utf8(output.stdout).expect("UTF-8");
        // Each row on one line, in both tables.
        let rows = said
            .lines()
            .filter(|l| l.starts_with(&format!(" {name}  ")));
        assert_eq!(rows.count(), 2, "{said}");
        let wide = said.lines().find(|l| l.chars().count() > 100);
        assert_eq!(wide, None, "{said}");
        let told = match command {
            "check" => "proved range: of the value before the word saturates or wraps",
            // Each node with its flags.
            _ => "  coherent_nco\n",
        };
        assert!(said.contains(told), "{said}");
    }
}

#[test]
fn a_setpoint_out_of_reach_is_warned_of_and_its_loop_is_not_praised() {
    let folder = tempfile::tempdir().expect("a folder");
    let (file, out) = (folder.path().join("high.toml"), folder.path().join("out"));
    let key = "circuit.amplitude_loop.setpoint_raw";
    let design = edit(&default_text(), key, "1048576", "100000000");
    std::fs::write(&file, design).expect("written");
    let name = file.to_str().expect("UTF-8");
    let output = equiv(&[name, "--samples", "20000"], &out);
    let talk = told(&output);
    assert!(
        talk.contains("warning: high.toml, line ") && talk.contains("[setpoint_out_of_reach]"),
        "{talk}"
    );
    let said = String::from_utf8(output.stdout).expect("UTF-8");
    assert!(
        said.contains("The output stands at its limit in all rows")
            && !said.contains("dead band: none")
            && said.contains("note: nodes flagged [open_loop_integral]: their errors add up"),
        "{said}"
    );
    assert_eq!(result(&out)["warnings"][0]["code"], "setpoint_out_of_reach");
    for command in ["simulate", "run"] {
        let out = folder.path().join(command);
        let arguments = [command, name, "--out", out.to_str().expect("UTF-8")];
        let talk = told(&gyrogen_here(&arguments));
        assert!(
            talk.contains("[setpoint_out_of_reach]"),
            "{command}: {talk}"
        );
    }
}

#[test]
fn too_few_samples_for_a_row_are_refused_with_the_fewest_that_do() {
    let folder = tempfile::tempdir().expect("a folder");
    let out = folder.path().join("out");
    // Periods of 32 samples, a decimator of three stages.
    for samples in ["5", "95"] {
        let output = equiv(&["--samples", samples], &out);
        let talk = told(&output);
        assert_eq!(output.status.code(), Some(2), "{talk}");
        assert!(talk.contains("give `--samples 96` or more"), "{talk}");
        assert!(!out.exists());
    }
    let output = equiv(&["--samples", "96"], &out);
    assert_eq!(output.status.code(), Some(0), "{}", told(&output));
    let capture = folder.path().join("c.csv");
    std::fs::write(&capture, "drive_code,sense_code\n1,2\n3,4\n").expect("written");
    let short = folder.path().join("short");
    let name = capture.to_str().expect("UTF-8");
    let output = equiv(&["--capture", name], &short);
    let talk = told(&output);
    assert_eq!(output.status.code(), Some(2), "{talk}");
    assert!(
        talk.contains("the capture has 2 ADC samples, and 96 are the least"),
        "{talk}"
    );
    assert!(!short.join("equiv.json").exists());
}

#[test]
fn two_designs_are_compared_word_by_word() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = |name: &str, text: &str| {
        let path = folder.path().join(name);
        std::fs::write(&path, text).expect("written");
        path.to_str().expect("UTF-8").to_owned()
    };
    let design = default_text();
    let same = path("same.toml", &design);
    let floor = edit(&design, "circuit.decimator.output", "half_up", "floor");
    let other = path("other.toml", &floor);
    let ratio = path(
        "ratio.toml",
        &edit(&design, "circuit.decimator.ratio", "32", "64"),
    );
    let out = folder.path().join("out");
    let run = |file: &str| equiv(&["--samples", "100000", "--against", file], &out);

    assert_eq!(run(&same).status.code(), Some(0));
    assert_eq!(result(&out)["first_difference"], Value::Null);

    let output = run(&other);
    assert_eq!(output.status.code(), Some(1));
    let first = result(&out)["first_difference"].clone();
    assert!(
        text(&first["node"]).starts_with("circuit.decimator.output"),
        "{first}"
    );
    let (sample, row) = (first["sample"].as_u64(), first["row"].as_u64());
    assert_eq!(sample.map(|s| s / 32), row);
    assert_eq!(sample.map(|s| s % 32), Some(31));
    let [a, b] = [0, 1].map(|k| first["values"][k].as_i64().expect("an integer"));
    assert_eq!(a - b, 1, "half_up and floor differ by one step");
    assert!(told(&output).contains("differ first at sample"));

    let output = run(&ratio);
    assert_eq!(output.status.code(), Some(2));
    assert!(told(&output).contains("circuit.decimator.ratio"));
}

#[test]
fn one_and_two_threads_write_the_same_bytes() {
    let folder = tempfile::tempdir().expect("a folder");
    let bytes = ["1", "2"].map(|threads| {
        let out = folder.path().join(threads);
        let output = equiv(&["--samples", "200000", "--threads", threads], &out);
        assert_eq!(output.status.code(), Some(0));
        std::fs::read(out.join("equiv.json")).expect("equiv.json")
    });
    assert!(bytes[0] == bytes[1]);
    let json: Value = serde_json::from_slice(&bytes[0]).expect("JSON");
    assert!(json["nco_spurs"]["measured"].is_object());
    assert_eq!(json["loops"].as_array().map(Vec::len), Some(3));
    assert_eq!(json["counterexample"], Value::Null);
}

fn default() -> Design {
    reader::read(None).expect("the default")
}

fn emitted(mismatches: u64) -> Option<Emitted> {
    Some(Emitted::new(vec![Compared {
        language: "c",
        name: "chain on the stimulus".into(),
        inputs: 1,
        exhaustive: false,
        compared: 1,
        mismatches,
        first: None,
    }]))
}

#[test]
fn a_damaged_bound_and_damaged_code_leave_a_short_counterexample() {
    let design = default();
    let (drive, sense) = gyrogen::vectors::stimulus::capture(&design, 20_000, 5);
    let stimulus = Stimulus {
        drive: &drive,
        sense: &sense,
        origin: "",
    };
    let never = |_: &[i32], _: &[i32]| false;
    let honest = run(&design, &drive, &sense);
    let none = counterexample(&honest, &[emitted(0), emitted(0)], stimulus, &never, &never);
    assert!(none.is_none());

    // The decimator's bound, a twentieth of what it is.
    let damaged = |d: &[i32], s: &[i32]| {
        let seen = run(&design, d, s);
        let at = seen.places.decimator;
        seen.nodes[at..at + 4].iter().any(|n| n.worst.0 > 0.05)
    };
    assert!(damaged(&drive, &sense));
    let mut seen = honest.clone();
    seen.nodes[seen.places.decimator].outside = 1;
    let (d, s) = counterexample(&seen, &[emitted(0), emitted(0)], stimulus, &damaged, &never)
        .expect("shrunk");
    assert!(
        damaged(&d, &s) && d.len() < 200,
        "{} samples are left",
        d.len()
    );

    // Emitted code that takes one code of the drive wrongly.
    let wrong = drive[7777];
    let differs = |d: &[i32], _: &[i32]| d.contains(&wrong);
    let (d, s) = counterexample(
        &honest,
        &[emitted(1), emitted(0)],
        stimulus,
        &never,
        &differs,
    )
    .expect("shrunk");
    assert_eq!((d, s), (vec![wrong], vec![0]));
}

/// `Err` has the shrunk stimulus as a capture.
fn holds(
    design: &Design,
    drive: &[i32],
    sense: &[i32],
    fails: &dyn Fn(&[i32], &[i32]) -> bool,
) -> Result<(), String> {
    if !fails(drive, sense) {
        return Ok(());
    }
    let (d, s) = shrink(drive, sense, MOST_RUNS, fails);
    Err(capture_text(design, &d, &s))
}

#[test]
fn a_failing_stimulus_is_printed_as_a_short_capture() {
    let design = default();
    let drive: Vec<i32> = (0..5000).map(|k| k % 97).collect();
    let fails = |d: &[i32], _: &[i32]| d.iter().filter(|c| **c == 96).count() > 1;
    let printed = holds(&design, &drive, &drive, &fails).expect_err("fails");
    let expected = "drive_code,sense_code\n96,0\n96,0\n";
    assert!(printed.ends_with(expected), "{printed}");
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("shrunk.csv");
    std::fs::write(&file, printed).expect("written");
    let capture = gyrogen::record::capture::CaptureReader::open(&file, design.circuit.adc.format);
    let (mut d, mut s) = (Vec::new(), Vec::new());
    capture
        .expect("a capture")
        .read_block(&mut d, &mut s, 10)
        .expect("rows");
    assert_eq!((d, s), (vec![96, 96], vec![0, 0]));
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(16))]
    #[test]
    fn no_stimulus_takes_a_node_out_of_its_bound(
        codes in prop::collection::vec((-32768i32..=32767, -32768i32..=32767), 1..4000),
    ) {
        let design = default();
        let (drive, sense): (Vec<i32>, Vec<i32>) = codes.into_iter().unzip();
        let fails = |d: &[i32], s: &[i32]| run(&design, d, s).nodes.iter().any(|n| n.outside > 0);
        if let Err(capture) = holds(&design, &drive, &sense, &fails) {
            prop_assert!(false, "a node leaves its bound on this capture:\n{}", capture);
        }
    }
}
