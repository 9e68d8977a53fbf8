//! `gyrogen close` of a simulated gyro without any effect beyond the declared model: what its circuit does to the
//! readings (noise that both channels share, coarse words) is no physical cause.

use crate::common::command::{good, gyrogen_in};
use gyrogen::design::reader;
use serde_json::Value;
use std::f64::consts::TAU;
use std::fmt::Write as _;
use std::fs;
use std::path::Path;

/// Cycles of the chamber of three hours each, by an amplitude.
fn profile(cycles: u32, amplitude_k: f64) -> String {
    let mut text = String::from("time_s,chamber_degc\n");
    for k in 0..=180 * cycles {
        let at_s = 60.0 * f64::from(k);
        let degc = 35.0 + amplitude_k * (TAU * at_s / 10_800.0).sin();
        writeln!(text, "{at_s},{degc:.4}").unwrap();
    }
    text
}

/// The default design without effects, other keys changed.
fn design(changes: &[(&str, &str)]) -> String {
    let default = reader::read(None).unwrap().source.text.clone();
    let effect = default
        .find("# A parasitic mode crosses the drive")
        .unwrap();
    let next = default.find("# ---- The thermal run").unwrap();
    let mut text = format!("{}{}", &default[..effect], &default[next..]);
    for (from, to) in changes {
        assert!(text.contains(from), "{from}");
        text = text.replace(from, to);
    }
    text
}

/// Simulates 600 readings of a design in two cycles over 68 K and closes their record with it.
fn closed(folder: &Path, text: &str) -> Value {
    closed_of(folder, text, &profile(2, 34.0), 600)
}

/// Simulates readings of a design under a chamber's profile and closes their record with it.
fn closed_of(folder: &Path, text: &str, profile: &str, readings: u32) -> Value {
    fs::write(folder.join("gyro.toml"), text).unwrap();
    fs::write(folder.join("profile.csv"), profile).unwrap();
    let simulate =
        format!("simulate gyro.toml --profile profile.csv --readings {readings} --out simulated");
    let close = "close --record simulated/record.csv --design gyro.toml --out closed";
    for command in [&simulate, close] {
        let arguments: Vec<&str> = command.split(' ').collect();
        let out = gyrogen_in(folder, &arguments, &[]);
        good(&out);
    }
    let text = fs::read_to_string(folder.join("closed/closure.json")).unwrap();
    serde_json::from_str(&text).unwrap()
}

/// The rate's noise shows in the quadrature as well, which moves with temperature: beside a lag that takes the
/// temperature out of it, it explains some of that noise.
#[test]
fn noise_that_two_channels_share_has_no_name() {
    for seed in ["seed = 1", "seed = 6"] {
        let folder = tempfile::tempdir().unwrap();
        let closure = closed(folder.path(), &design(&[("seed = 20040024", seed)]));
        assert_eq!(closure["steps"], serde_json::json!([]), "{seed}");
    }
}

/// A phase word of 12 bits from 10 micro-rotations: 0.3 deg/s of sawteeth, of which the course between the steps
/// leaves an eighth, and no cause is seen in them.
#[test]
fn steps_of_the_phase_word_are_taken_out_and_not_named() {
    let quiet = [
        ("adc_noise_lsb = 1.0", "adc_noise_lsb = 0.1"),
        (
            "rate_noise_dps_rthz = 0.0073",
            "rate_noise_dps_rthz = 0.0001",
        ),
        ("flicker_dph = 30.0", "flicker_dph = 0.1"),
        (
            "rate_random_walk_dph_rth = 10.0",
            "rate_random_walk_dph_rth = 0.02",
        ),
        ("angle_bits = 24", "angle_bits = 12"),
        ("iterations = 20", "iterations = 10"),
    ];
    let folder = tempfile::tempdir().unwrap();
    // Half the range in half the readings, as many to a step of the word: a quarter of the time.
    let closure = closed_of(folder.path(), &design(&quiet), &profile(1, 17.0), 300);
    assert_eq!(closure["steps"], serde_json::json!([]));
    let warning = &closure["warnings"][0];
    assert_eq!(warning["code"], "thermometer_quantised");
    assert!(
        warning["message"]
            .as_str()
            .unwrap()
            .contains("as the design's circuit predicts")
    );
    // Most is left near the turning points, which are fitted on or held out: over both.
    let square = |rows: &str| closure["after"][rows].as_f64().unwrap().powi(2);
    let after = (0.73 * square("train_rms") + 0.27 * square("heldout_rms")).sqrt();
    let firmware = closure["firmware"]["heldout_rms"].as_f64().unwrap();
    assert!(after < 0.06 && firmware > 0.3, "{after} {firmware}");
}

/// An ADC of 8 bits with a tenth of an LSB of noise before it, and an oscillator of 32 phases: 0.5 deg/s that turn with
/// temperature. The circuit's own blocks tell them, and what is in the record beside them.
#[test]
fn rounding_of_an_undithered_adc_is_taken_out_and_not_named() {
    let changes = [
        (
            "format = \"Q1.15\"\n\n# The osc",
            "format = \"Q1.7\"\n\n# The osc",
        ),
        ("adc_noise_lsb = 1.0", "adc_noise_lsb = 0.1"),
        (
            "rate_noise_dps_rthz = 0.0073",
            "rate_noise_dps_rthz = 0.0001",
        ),
        ("flicker_dph = 30.0", "flicker_dph = 0.1"),
        (
            "rate_random_walk_dph_rth = 10.0",
            "rate_random_walk_dph_rth = 0.02",
        ),
    ];
    let folder = tempfile::tempdir().unwrap();
    let closure = closed(folder.path(), &design(&changes));
    assert_eq!(closure["steps"], serde_json::json!([]));
    let before = closure["before"]["heldout_rms"].as_f64().unwrap();
    assert!(before < 0.06, "{before}");
    let warnings = closure["warnings"].as_array().unwrap();
    assert!(warnings.iter().any(|w| w["code"] == "adc_not_dithered"));
    // The firmware reads the codes.
    let firmware = closure["firmware"]["heldout_rms"].as_f64().unwrap();
    assert!(firmware > 0.3, "{firmware}");

    // A cause of 0.2 deg/s rms beside it.
    let effect = "[gyro.effects.mode_crossing]\namplitude_dps = 0.3\ncenter_degc = 37.5\nhalf_width_k = 3.7\n\n\n# ---- The thermal run";
    let mut changes = changes.to_vec();
    changes.push(("# ---- The thermal run", effect));
    let closure = closed(folder.path(), &design(&changes));
    let steps = closure["steps"].as_array().unwrap();
    assert_eq!(steps.len(), 1, "{steps:?}");
    assert_eq!(steps[0]["effect"], "mode_crossing");
    let center_degc = steps[0]["parameters"]["center_degc"].as_f64().unwrap();
    assert!((center_degc - 37.5).abs() < 1.0, "{center_degc}");
}
