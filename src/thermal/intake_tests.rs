//! The temperature behind a thermometer that is none.

use super::channels::Channels;
use super::close::close;
use super::intake::{Intake, refused};
use super::search::Effort;
use super::synthetic::{Random, record, triangle};
use crate::design::{Design, reader};
use crate::record::ThermalRecord;

fn design() -> Design {
    reader::parse("", None).unwrap()
}

/// A record whose resonance moves by the gyro's own law around `nominal_hz`, over 60 K; and the codes of the
/// warnings.
fn taken(nominal_hz: f64, more: Option<&str>) -> (Channels, Vec<&'static str>) {
    let design = design();
    let degc: Vec<f64> = (0..200)
        .map(|k| -3.15 + 60.0 * f64::from(k) / 199.0)
        .collect();
    let slope = -0.5 * design.gyro.stiffness_tempco_per_k.abs() * nominal_hz;
    let freq: Vec<f64> = degc
        .iter()
        .map(|t| nominal_hz + slope * (t - 26.85))
        .collect();
    let mut record = record("freq_hz", &freq, &vec![0.0; 200]);
    record
        .columns
        .extend(more.map(|name| (name.to_owned(), degc.clone())));
    let intake = Intake::of(&record, &design, Vec::new()).unwrap();
    assert_eq!(intake.channels.thermometer, "freq_hz");
    let codes = intake.warnings.iter().map(|w| w.code).collect();
    (intake.whole(), codes)
}

#[test]
fn the_designs_own_frequency_tells_the_temperature() {
    let own = design().gyro.drive_frequency_hz;
    let (c, warnings) = taken(own, None);
    assert!(warnings.is_empty(), "{warnings:?}");
    assert!((c.middle_degc - 26.85).abs() < 0.01 && (c.kelvin_per_u + 30.0).abs() < 0.01);
    // A unit whose resonance is 0.2 % off is 80 K off by the law, and still one that may be meant.
    let (c, warnings) = taken(0.998 * own, None);
    assert!(warnings.is_empty(), "{warnings:?}");
    assert!((c.middle_degc - 26.85).abs() > 50.0, "{}", c.middle_degc);
}

#[test]
fn a_foreign_frequency_keeps_differences_of_temperature_and_is_said_to_have_no_other() {
    for times in [0.01, 0.3, 0.9, 1.1, 7.0, 200.0] {
        let (c, warnings) = taken(times * design().gyro.drive_frequency_hz, None);
        assert_eq!(warnings, ["temperature_unknown"], "{times}");
        // Counted from the reference temperature, with the law's relative slope at the readings.
        assert!(
            (c.middle_degc - 26.85).abs() < 1e-6,
            "{times}: {}",
            c.middle_degc
        );
        assert!(
            (c.kelvin_per_u + 30.0).abs() < 0.01,
            "{times}: {}",
            c.kelvin_per_u
        );
    }
}

#[test]
fn a_column_in_degc_says_what_a_foreign_frequency_cannot() {
    for name in ["die_degc", "chamber_degc"] {
        let (c, warnings) = taken(5e4, Some(name));
        assert!(warnings.is_empty(), "{warnings:?}");
        assert!((c.middle_degc - 26.85).abs() < 1e-6 && (c.kelvin_per_u + 30.0).abs() < 1e-6);
    }
}

#[test]
fn one_reading_of_the_thermometer_that_is_a_glitch_names_nothing() {
    for (seed, glitch_degc) in [(0, -400.0), (1, 300.0), (2, 1e6)] {
        let mut random = Random::new(seed);
        let degc = triangle(400);
        let output: Vec<f64> = degc
            .iter()
            .map(|t| 0.3 - 0.01 * t + 1e-4 * t * t + 0.01 * random.normal())
            .collect();
        let mut read = degc.clone();
        read[133] = glitch_degc;
        let record = record("die_degc", &read, &output);
        let closed = close(&record, Vec::new(), &design(), "test", Effort::default()).unwrap();
        let steps = &closed.closure.steps;
        assert!(steps.is_empty(), "{glitch_degc}: {steps:?}");
        assert!(closed.closure.after.heldout_rms < 0.012);
        let mut said = closed.closure.warnings.iter();
        assert!(said.any(|w| w.code == "thermometer_glitch"));
    }
}

#[test]
fn rows_that_an_average_leaves_too_few_of_are_told_in_the_design() {
    let degc: Vec<f64> = (0..12).map(|k| 4.0 * f64::from(k)).collect();
    let mut record = record("die_degc", &degc, &degc);
    let text = "[record]\naverage_s = 160\n";
    let design = crate::design::reader::parse(text, Some(std::path::Path::new("d.toml"))).unwrap();
    let said =
        |record: &ThermalRecord| refused(record, &design.record, "few".to_owned()).to_string();
    // Rows as they are in the file are nothing that the average made.
    record.lines = (2..14).collect();
    assert!(
        !said(&record).contains("average_s = 160"),
        "{}",
        said(&record)
    );
    record.lines = (0..12).map(|k| 2 + 16 * k).collect();
    let told = said(&record);
    assert!(
        told.starts_with("d.toml:2:13: error: few. average_s = 160 s leaves 12 rows"),
        "{told}"
    );
}

#[test]
fn a_record_of_which_no_row_can_be_held_out_is_refused() {
    for rows in [15, 16, 17] {
        let mut random = Random::new(rows as u64);
        let degc: Vec<f64> = (0..rows).map(|k| 4.0 * k as f64).collect();
        let output: Vec<f64> = degc
            .iter()
            .map(|t| 0.3 - 0.01 * t + 0.01 * random.normal())
            .collect();
        let record = record("die_degc", &degc, &output);
        let closed = close(&record, Vec::new(), &design(), "test", Effort::default());
        let refused = closed.err().map(|e| e.to_string());
        assert!(refused.is_some_and(|e| e.contains("held out")), "{rows}");
    }
}

#[test]
fn a_column_that_is_nearly_empty_is_no_thermometer() {
    let degc = triangle(200);
    let mut record = record("die_degc", &degc, &vec![0.0; 200]);
    for (every, expected) in [
        (50, "die_degc"),
        (3, "die_degc"),
        (2, "phase_rad"),
        (1, "phase_rad"),
    ] {
        let phase = |k: usize| match k % every {
            0 => -1.5 - 1e-3 * degc[k],
            _ => f64::NAN,
        };
        let phase = (0..200).map(phase).collect();
        record.columns.insert("phase_rad".to_owned(), phase);
        let intake = Intake::of(&record, &design(), Vec::new()).unwrap();
        assert_eq!(intake.channels.thermometer, expected, "{every}");
    }
}

#[test]
fn a_column_that_is_named_like_a_thermometer_is_told_with_the_line_that_makes_it_one() {
    for (name, line) in [
        ("temp_degC", Some("die_degc = \"temp_degC\"")),
        (
            "temp_degF",
            Some("die_degc = { column = \"temp_degF\", unit = \"degF\" }"),
        ),
        ("humidity", None),
    ] {
        let record = record(name, &triangle(200), &vec![0.0; 200]);
        let intake = Intake::of(&record, &design(), Vec::new()).unwrap();
        let said = intake.warnings.iter().find(|w| w.code == "no_thermometer");
        let said = &said.expect("a warning").message;
        match line {
            Some(line) => assert!(said.ends_with(&format!("of the design: {line}")), "{said}"),
            None => assert!(
                said.ends_with("die_degc = { column = \"NAME_IN_THE_FILE\", unit = \"degC\" }"),
                "{said}"
            ),
        }
    }
}
