//! `simulate --trace`: the trace holds the words that `replay` computes from the traced codes.

use crate::common::command::{gyrogen_here, text, told};
use std::collections::BTreeMap;
use std::path::Path;
use std::process::Output;

fn simulate(out: &Path, more: &[&str]) -> Output {
    let mut all = vec!["simulate", "--out", text(out)];
    all.extend(more);
    gyrogen_here(&all)
}

/// Cells by column, empty ones left out.
fn columns(path: &Path) -> BTreeMap<String, Vec<String>> {
    let mut reader = csv::Reader::from_path(path).expect("a CSV");
    let names = reader.headers().expect("a header").clone();
    let mut columns: BTreeMap<String, Vec<String>> = BTreeMap::new();
    for record in reader.records() {
        let record = record.expect("a row");
        for (name, cell) in names.iter().zip(&record).filter(|(_, c)| !c.is_empty()) {
            let column = columns.entry(name.to_owned()).or_default();
            column.push(cell.to_owned());
        }
    }
    columns
}

fn column<'a>(columns: &'a BTreeMap<String, Vec<String>>, name: &str) -> &'a [String] {
    let found = columns
        .iter()
        .find(|(k, _)| k.as_str() == name || k.starts_with(&format!("{name} [")));
    found.unwrap_or_else(|| panic!("no column {name}")).1
}

/// The codes of the trace through `replay`, a path of its own, give the trace's rows.
#[test]
fn traced_rows_are_replayed_rows() {
    let folder = tempfile::tempdir().expect("a folder");
    let out = folder.path().join("out");
    let rows = 300;
    let output = simulate(&out, &["--trace-format", "csv", "--trace-rows", "300"]);
    assert!(output.status.success(), "{output:?}");
    let trace = columns(&out.join("trace.csv"));
    let [drive, sense] = ["drive", "sense"].map(|c| column(&trace, &format!("circuit.adc {c}")));
    assert_eq!(drive.len(), rows * 32);

    let mut codes = String::from("drive_code,sense_code\n");
    for (d, s) in drive.iter().zip(sense) {
        codes += &format!("{d},{s}\n");
    }
    let (capture, replayed) = (folder.path().join("c.csv"), folder.path().join("r.csv"));
    std::fs::write(&capture, codes).expect("written");
    let design = out.join("design.toml");
    let output = gyrogen_here(&[
        "replay",
        text(&design),
        "--capture",
        text(&capture),
        "--out",
        text(&replayed),
    ]);
    assert!(output.status.success(), "{output:?}");
    let replayed = columns(&replayed);
    for (node, replay) in [
        ("circuit.decimator.output drive_i", "drive_i"),
        ("circuit.decimator.output sense_q", "sense_q"),
        ("circuit.cordic phase", "phase"),
        ("circuit.cordic magnitude", "magnitude"),
        ("compensation.output rate", "rate"),
        ("circuit.amplitude_loop gain", "gain"),
    ] {
        let (traced, wanted) = (column(&trace, node), column(&replayed, replay));
        assert_eq!(traced.len(), rows, "{node}");
        assert_eq!(traced, wanted, "{node}");
        // From power-on every node moves.
        assert!(traced.iter().any(|w| *w != traced[0]), "{node} never moves");
    }
}

#[test]
fn nodes_are_chosen_by_name_and_unknown_ones_refused() {
    let folder = tempfile::tempdir().expect("a folder");
    let out = folder.path().join("out");
    let output = simulate(&out, &["--trace", "circuit.cordic,circuit.adc drive"]);
    assert!(output.status.success(), "{output:?}");
    let vcd = std::fs::read_to_string(out.join("trace.vcd")).expect("a VCD by default");
    let wires = vcd.lines().filter(|l| l.starts_with("$var")).count();
    assert_eq!(wires, 3, "phase, magnitude, drive");

    let none = folder.path().join("none");
    let output = simulate(&none, &["--trace", "circuit.cordic phas"]);
    assert_eq!(output.status.code(), Some(2));
    let message = told(&output);
    assert!(
        message.contains("did you mean `circuit.cordic phase`"),
        "{message}"
    );
    assert!(!none.exists(), "nothing is written for a bad name");
}

/// The float twin of a node is near its words, and not equal to them.
#[test]
fn float_values_are_the_words_values() {
    let folder = tempfile::tempdir().expect("a folder");
    let traced = |arithmetic: &str| {
        let out = folder.path().join(arithmetic);
        let more = ["--trace", "circuit.decimator", "--trace-format", "csv"];
        let output = simulate(&out, &[&more[..], &["--trace-arith", arithmetic]].concat());
        assert!(output.status.success(), "{output:?}");
        let trace = columns(&out.join("trace.csv"));
        let words = column(&trace, "circuit.decimator.output drive_q");
        let numbers = words.iter().map(|w| w.parse().expect("a number"));
        numbers.collect::<Vec<f64>>()
    };
    let (fixed, float) = (traced("fixed"), traced("float"));
    let lsb = 2f64.powi(-22);
    let far = |(raw, value): (&f64, &f64)| (raw * lsb - value).abs();
    let greatest = fixed.iter().zip(&float).map(far).fold(0.0, f64::max);
    assert!(greatest > 0.0 && greatest < 1e-4, "{greatest:e}");
    assert!(float.iter().any(|v| v.abs() > 0.01));
}
