//! `simulate` as a user runs it: the published figures, both drive modes, files, refusals.

use crate::common::command::{gyrogen_here, text, told};
use crate::common::json::number;
use serde_json::Value;
use std::path::Path;

fn simulate(arguments: &[&str], out: &Path) -> Value {
    let mut all = vec!["simulate"];
    all.extend(arguments);
    all.extend(["--out", text(out), "--format", "json"]);
    let output = gyrogen_here(&all);
    let talk = told(&output);
    assert_eq!(output.status.code(), Some(0), "{talk}");
    let written = std::fs::read(out.join("simulate.json")).expect("simulate.json");
    assert_eq!(output.stdout, written, "stdout and simulate.json differ");
    serde_json::from_slice(&output.stdout).expect("JSON on stdout")
}

/// The columns of a CSV by name.
fn columns(path: &Path) -> (Vec<String>, Vec<Vec<f64>>) {
    let mut reader = csv::Reader::from_path(path).expect("a CSV");
    let names: Vec<String> = reader
        .headers()
        .expect("a header")
        .iter()
        .map(str::to_owned)
        .collect();
    let rows: Vec<Vec<f64>> = reader
        .records()
        .map(|r| {
            let cells = r.expect("a row");
            cells.iter().map(|c| c.parse().expect("a number")).collect()
        })
        .collect();
    (names, rows)
}

fn column(path: &Path, name: &str) -> Vec<f64> {
    let (names, rows) = columns(path);
    let k = names
        .iter()
        .position(|n| n == name)
        .unwrap_or_else(|| panic!("no {name}"));
    rows.iter().map(|r| r[k]).collect()
}

/// The default design with the phase loop that its text has switched off.
fn tracking(folder: &Path) -> std::path::PathBuf {
    let path = folder.join("tracking.toml");
    assert!(gyrogen_here(&["init", text(&path)]).status.success());
    let design = std::fs::read_to_string(&path).expect("a design");
    let mut inside = false;
    let lines: Vec<String> = design
        .lines()
        .map(|line| {
            inside = line == "#[circuit.phase_loop]" || (inside && !line.is_empty());
            match line.strip_prefix('#') {
                Some(setting) if inside && !setting.starts_with(' ') => setting.to_owned(),
                _ => line.to_owned(),
            }
        })
        .collect();
    std::fs::write(&path, lines.join("\n") + "\n").expect("written");
    path
}

#[test]
fn the_default_run_reproduces_every_published_figure() {
    let folder = tempfile::tempdir().expect("a folder");
    let out = folder.path().join("out");
    let s = simulate(&[], &out);
    assert_eq!(s["schema"], "gyrogen.simulate/1");
    let figures = s["paper"].as_array().expect("figures");
    assert!(figures.len() >= 14, "{}", figures.len());
    for figure in figures {
        assert_eq!(figure["agrees"], true, "{figure}");
        let off = number(figure, "obtained") - number(figure, "published");
        assert!(
            off.abs() <= number(figure, "tolerance") * 1.000_001,
            "{figure}"
        );
    }
    let by_simulation = figures.iter().filter(|f| f["by"] == "simulation").count();
    assert!(by_simulation >= 3);
    assert!((number(&s, "before.fixed.drift_pp_dps") - 160.0).abs() < 3.0);
    assert!((0.045..0.055).contains(&number(&s, "ratio")));
    assert!(number(&s, "float_fixed.rate_out_dps") < 0.01);
    assert!(number(&s, "float_fixed.rate_dps") < 0.01);

    let (names, rows) = columns(&out.join("record.csv"));
    let expected = "time_s rate_out_dps chamber_degc phase_rad die_degc agc quad_dps";
    assert_eq!(names.join(" "), expected);
    assert_eq!(rows.len(), 29 * 3);
    let report = std::fs::read_to_string(out.join("report.html")).expect("a report");
    assert!(report.matches("<figure>").count() >= 4);
    // The fitted design reads back, and simulates to the same drift by its own coefficients.
    let again = simulate(
        &[text(&out.join("design.toml"))],
        &folder.path().join("again"),
    );
    let (a, b) = (
        number(&s, "after.fixed.drift_pp_dps"),
        number(&again, "after.fixed.drift_pp_dps"),
    );
    assert!((a - b).abs() < 1e-6, "{a} {b}");
}

/// Coefficients of 0 compensate nothing, and the run fits its own.
#[test]
fn the_rows_after_are_told_to_be_of_fitted_coefficients() {
    let folder = tempfile::tempdir().expect("a folder");
    let (file, out) = (folder.path().join("zero.toml"), folder.path().join("out"));
    let mut design = include_str!("../../src/design/default.toml").to_owned();
    for (from, to) in [
        ("[114923930, 800391448, 1415954326]", "[0, 0, 0]"),
        ("step_k = 5.0", "step_k = 10.0"),
        ("samples_per_reading = 512", "samples_per_reading = 16"),
    ] {
        assert_eq!(design.matches(from).count(), 1, "{from}");
        design = design.replace(from, to);
    }
    std::fs::write(&file, design).expect("written");
    let output = gyrogen_here(&["simulate", text(&file), "--out", text(&out)]);
    assert_eq!(output.status.code(), Some(0), "{}", told(&output));
    let said = String::from_utf8(output.stdout).expect("UTF-8");
    let words: Vec<&str> = said.split_whitespace().collect();
    let said = words.join(" ");
    for due in [
        "after: compensated by a polynomial that was fitted to these readings",
        "not by the coefficients of the given design.",
        "in `run` both have the same ADC codes.",
    ] {
        assert!(said.contains(due), "{due}: {said}");
    }
}

#[test]
fn tracking_locks_follows_the_tempco_and_compensates_as_well() {
    let folder = tempfile::tempdir().expect("a folder");
    let fixed_frequency = simulate(&[], &folder.path().join("a"));
    let design = tracking(folder.path());
    let out = folder.path().join("b");
    let s = simulate(&[text(&design)], &out);
    assert_eq!(s["drive"], "resonance_tracking");
    assert_eq!(s["lock"]["locked"], true);
    assert!((number(&s, "lock.tempco_ppm_per_k") + 24.7).abs() < 0.05);
    assert!(number(&s, "lock.freq_error_hz") < 0.02);
    let by_phase = number(&fixed_frequency, "after.fixed.drift_pp_dps");
    let by_frequency = number(&s, "after.fixed.drift_pp_dps");
    assert!(by_frequency < 1.02 * by_phase, "{by_frequency} {by_phase}");
    // From the record alone, as an outsider would: the slope of the frequency over the chamber.
    let path = out.join("record.csv");
    let (degc, hz) = (column(&path, "chamber_degc"), column(&path, "freq_hz"));
    let n = degc.len() as f64;
    let mean = |v: &[f64]| v.iter().sum::<f64>() / n;
    let (mx, my) = (mean(&degc), mean(&hz));
    let cross: f64 = degc.iter().zip(&hz).map(|(x, y)| (x - mx) * (y - my)).sum();
    let square: f64 = degc.iter().map(|x| (x - mx).powi(2)).sum();
    let ppm = 1e6 * cross / square / 1750.0;
    assert!((ppm + 24.7).abs() < 0.05, "{ppm}");
    assert!(!columns(&path).0.contains(&"phase_rad".to_owned()));
}

#[test]
fn the_bytes_do_not_depend_on_the_threads() {
    let folder = tempfile::tempdir().expect("a folder");
    let outs = ["1", "2", "3"].map(|threads| {
        let out = folder.path().join(threads);
        let s = simulate(&["--threads", threads], &out);
        let read = |name: &str| std::fs::read(out.join(name)).expect("a file");
        (
            s,
            read("record.csv"),
            read("readings.csv"),
            read("report.html"),
        )
    });
    assert_eq!(outs[0], outs[1]);
    assert_eq!(outs[0], outs[2]);
}

/// Every sample of a stretch against warm starts at the same temperatures: the analytic steady state is
/// where the continuous motion is.
#[test]
fn continuous_motion_is_where_warm_starts_are() {
    let folder = tempfile::tempdir().expect("a folder");
    let design = folder.path().join("short.toml");
    // A slow ramp, so that the loops follow; no noise.
    let quiet = "[thermal_run]\nstart_degc = 20.0\nstop_degc = 30.0\nstep_k = 10.0\nramp_k_per_min = 30.0\n\
        dwell_s = 1.0\nreadings_per_dwell = 1\nadc_noise_lsb = 0.0\nrate_noise_dps_rthz = 0.0\nflicker_dph = 0.0\n\
        rate_random_walk_dph_rth = 0.0\nquadrature_dps = 200.0\n";
    std::fs::write(&design, quiet).expect("written");
    let out = folder.path().join("continuous");
    let s = simulate(&[text(&design), "--duration", "30"], &out);
    assert_eq!(s["mode"], "continuous");
    let record = out.join("record.csv");
    let times = column(&record, "time_s");
    assert_eq!(times.len(), 30);
    // The same chamber as a profile: a dwell, ten seconds for its reading, the ramp.
    let profile = folder.path().join("profile.csv");
    std::fs::write(&profile, "time_s,chamber_degc\n0,20\n11,20\n31,30\n").expect("written");
    let warm = folder.path().join("warm");
    simulate(
        &[
            text(&design),
            "--profile",
            text(&profile),
            "--readings",
            "311",
        ],
        &warm,
    );
    let (t, phase) = (
        column(&warm.join("record.csv"), "time_s"),
        column(&warm.join("record.csv"), "phase_rad"),
    );
    let continuous = column(&record, "phase_rad");
    // The structure follows the ramp by 0.9 K, 9 mrad/K.
    assert!((continuous[29] - continuous[0]).abs() > 5e-3);
    for (time, value) in times.iter().zip(&continuous).skip(1) {
        let nearest =
            (0..t.len()).min_by(|a, b| (t[*a] - time).abs().total_cmp(&(t[*b] - time).abs()));
        let expected = phase[nearest.expect("a reading")];
        // At the end the phase moves by 1 mrad/s; the motion lags by 2 Q / w1 = 9 ms, and
        // temperatures are up to date to 10 ms.
        assert!(
            (value - expected).abs() < 2e-5,
            "{time} s: {value} {expected}"
        );
    }
}

#[test]
fn a_profile_with_rate_supply_and_acceleration_has_their_columns() {
    let folder = tempfile::tempdir().expect("a folder");
    let profile = folder.path().join("profile.csv");
    let rows = "time_s,chamber_degc,rate_dps,supply_v,accel_g\n0,20,0,5,0\n100,30,100,5.1,0.5\n200,20,-100,4.9,-0.5\n";
    std::fs::write(&profile, rows).expect("written");
    let design = folder.path().join("d.toml");
    let effects = "[gyro.effects]\nsupply_sensitivity = { dps_per_v = 10.0, nominal_v = 5.0 }\n";
    std::fs::write(&design, effects).expect("written");
    let (out, plain) = (folder.path().join("out"), folder.path().join("plain"));
    let along = ["--profile", text(&profile), "--readings", "21"];
    simulate(&[&[text(&design)], &along[..]].concat(), &out);
    std::fs::write(&design, "[gyro]\ndrive_q = 50.0\n").expect("written");
    simulate(&[&[text(&design)], &along[..]].concat(), &plain);
    let of = |out: &Path, name: &str| column(&out.join("record.csv"), name);
    let (with, without) = (of(&out, "rate_out_dps"), of(&plain, "rate_out_dps"));
    for ((a, b), v) in with.iter().zip(&without).zip(of(&out, "supply_v")) {
        assert!((a - b - 10.0 * (v - 5.0)).abs() < 0.01, "{a} {b} {v}");
    }
    let rate = of(&out, "rate_dps");
    assert_eq!((rate[10], rate[20]), (100.0, -100.0));
    assert_eq!(of(&out, "accel_g")[20], -0.5);
    // The output follows the table.
    assert!(without[10] - without[20] > 150.0);
}

#[test]
fn a_chamber_that_no_gyro_works_in_is_told_at_its_line_and_not_of_the_record() {
    let folder = tempfile::tempdir().expect("a folder");
    let profile = folder.path().join("hot.csv");
    std::fs::write(&profile, "time_s,chamber_degc\n0,25\n600,900\n1200,25\n").expect("written");
    let out = folder.path().join("out");
    let along = ["--profile", text(&profile), "--readings", "60"];
    let output = gyrogen_here(&[&["simulate", "--out", text(&out)], &along[..]].concat());
    let talk = told(&output);
    assert_eq!(talk.matches("chamber_beyond").count(), 1, "{talk}");
    assert!(
        talk.contains("warning: hot.csv:3: the chamber is at 900 degC"),
        "{talk}"
    );
    // Remedies for a measured file.
    for word in ["Leave cells", "[record.columns]", "Unwrap"] {
        assert!(!talk.contains(word), "{word}: {talk}");
    }
}

#[test]
fn what_cannot_be_simulated_is_refused() {
    let folder = tempfile::tempdir().expect("a folder");
    let out = folder.path().join("out");
    let profile = folder.path().join("bad.csv");
    std::fs::write(&profile, "time_s,chamber_degc\n0,20\n9,cold\n").expect("written");
    let design = tracking(folder.path());
    let broken = folder.path().join("broken.toml");
    let of = std::fs::read_to_string(&design).expect("a design");
    std::fs::write(
        &broken,
        of.replace("setpoint_raw = -4194304", "setpoint_raw = 4194304"),
    )
    .expect("written");
    let cases: [(&[&str], &str); 6] = [
        (&["--profile", text(&profile)], "bad.csv:3:3"),
        (&["--profile", "nowhere.csv"], "nowhere.csv"),
        (&["--duration", "0"], "error: `--duration` is 0 s; it has"),
        (&["--duration", "-5"], "error: `--duration` is -5 s; it has"),
        (
            &["--duration", "nan"],
            "error: `--duration` is NaN s; it has",
        ),
        (&[text(&broken)], "setpoint"),
    ];
    for (arguments, words) in cases {
        let mut all = vec!["simulate", "--out", text(&out)];
        all.extend(arguments);
        let output = gyrogen_here(&all);
        let talk = told(&output);
        assert_eq!(output.status.code(), Some(2), "{arguments:?}: {talk}");
        assert!(talk.contains(words), "{arguments:?}: {talk}");
        assert!(!out.exists(), "{arguments:?}");
    }
}
