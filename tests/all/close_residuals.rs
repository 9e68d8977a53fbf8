//! `residuals.csv` of `gyrogen close`: whoever reads it comes to the errors of `closure.json`.

use crate::common::command::gyrogen_in;
use gyrogen::plant::noise::Noise;
use serde_json::Value;
use std::path::Path;

const ROWS: usize = 360;

/// A supply of two levels at three times the noise, and ten rows that are far off.
fn record(folder: &Path) {
    let white = Noise::new(11, 1);
    let mut csv = String::from("time_s,rate_out_dps,die_degc,supply_v\n");
    for k in 0..ROWS {
        let degc = 25.0 + 30.0 * (k as f64 / 57.0).sin();
        let supply_v = if k / 13 % 2 == 0 { 3.0 } else { 3.3 };
        let accident = if k % 37 == 19 { 0.4 } else { 0.0 };
        let out =
            0.3 + 0.01 * degc + 0.1 * (supply_v - 3.0) + accident + 0.01 * white.normal(k as u64);
        csv += &format!("{},{out:.6},{degc:.4},{supply_v}\n", 20 * k);
    }
    std::fs::write(folder.join("r.csv"), csv).expect("written");
}

/// A column of a CSV of numbers.
fn column(csv: &str, name: &str) -> Vec<f64> {
    let mut lines = csv.lines();
    let header = lines.next().expect("a header");
    let at = header.split(',').position(|c| c == name).expect(name);
    let field = |line: &str| {
        line.split(',')
            .nth(at)
            .expect("a field")
            .parse()
            .expect("a number")
    };
    lines.map(field).collect()
}

#[test]
fn the_residuals_give_the_errors_of_the_closure() {
    let folder = tempfile::tempdir().expect("a folder");
    record(folder.path());
    let out = gyrogen_in(
        folder.path(),
        &["close", "--record", "r.csv", "--out", "o"],
        &[],
    );
    assert_eq!(out.status.code(), Some(0));
    let read =
        |name: &str| std::fs::read_to_string(folder.path().join("o").join(name)).expect(name);
    let closure: Value = serde_json::from_str(&read("closure.json")).expect("JSON");
    assert_eq!(closure["steps"][0]["effect"], "supply_sensitivity");
    let csv = read("residuals.csv");
    let [held_out, outlier] = ["held_out", "outlier"].map(|name| column(&csv, name));
    assert_eq!(held_out.len(), ROWS);
    let off: Vec<usize> = (0..ROWS).filter(|k| outlier[*k] == 1.0).collect();
    assert_eq!(off, (0..10).map(|k| 37 * k + 19).collect::<Vec<_>>());
    let warnings = closure["warnings"].as_array().expect("a list");
    let told = warnings
        .iter()
        .find(|w| w["code"] == "outliers")
        .expect("a warning");
    let message = told["message"].as_str().expect("text");
    assert!(message.starts_with("10 of 360 rows"), "{message}");
    for (name, errors) in [
        ("before_dps", &closure["before"]),
        ("after_dps", &closure["after"]),
        ("firmware_dps", &closure["firmware"]),
    ] {
        let all = column(&csv, name);
        let rows: Vec<usize> = (0..ROWS)
            .filter(|k| held_out[*k] == 1.0 && outlier[*k] == 0.0)
            .collect();
        let square: f64 = rows.iter().map(|k| all[*k] * all[*k]).sum();
        let rms = (square / rows.len() as f64).sqrt();
        let most = rows.iter().fold(0.0, |m: f64, k| m.max(all[*k].abs()));
        for (own, key) in [(rms, "heldout_rms"), (most, "heldout_max_abs")] {
            let told = errors[key].as_f64().expect(key);
            assert!(
                (own / told - 1.0).abs() < 1e-9,
                "{name} {key}: {own} {told}"
            );
        }
    }
}
