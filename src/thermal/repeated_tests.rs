//! Thermometers that repeat their readings, and such that do not although it looks so.

use super::*;
use crate::design::reader;
use crate::record::ThermalRecord;
use crate::thermal::close::close;
use crate::thermal::search::Effort;
use crate::thermal::synthetic::{Random, record, triangle};

const ROWS: usize = 600;

/// A record whose bias follows `degc`, of which the log has what `logged` makes of it.
fn made(seed: u64, degc: &[f64], logged: impl Fn(usize) -> f64) -> ThermalRecord {
    let mut random = Random::new(seed);
    let out: Vec<f64> = degc
        .iter()
        .map(|t| 2.0 + 0.05 * t - 3e-4 * t * t + 0.02 * random.normal())
        .collect();
    let logged: Vec<f64> = (0..degc.len()).map(logged).collect();
    record("die_degc", &logged, &out)
}

/// Names, and whether the repeated readings are said; firmware's error is then put down to them and not to its words.
fn closed(record: &ThermalRecord) -> (Vec<String>, bool) {
    let design = reader::parse("", None).unwrap();
    let closed = close(record, Vec::new(), &design, "test", Effort::default()).unwrap();
    let names = closed.closure.steps.iter().map(|s| s.effect.clone());
    let behind = closed.closure.warnings.iter();
    for w in behind.filter(|w| w.code == "firmware_behind") {
        assert!(
            w.message.contains("readings as they are") && !w.message.contains("words"),
            "{}",
            w.message
        );
    }
    let said = closed.closure.warnings.iter();
    (
        names.collect(),
        said.map(|w| w.code.to_string())
            .any(|code| code == "thermometer_repeats"),
    )
}

/// Two readings' noise, so that no course is exact.
fn noisy(seed: u64) -> Vec<f64> {
    let mut random = Random::new(seed + 100);
    triangle(ROWS)
        .iter()
        .map(|t| t + 0.01 * random.normal())
        .collect()
}

#[test]
fn readings_that_are_repeated_name_no_lag() {
    for seed in 0..4 {
        let degc = noisy(seed);
        for (rows, offset) in [(3.0, 0), (5.0, 2), (2.5, 0), (1.6, 1)] {
            let last = |k: usize| {
                let new = ((k + offset) as f64 / rows).floor() * rows - offset as f64;
                degc[new.ceil().max(0.0) as usize]
            };
            let (names, said) = closed(&made(seed, &degc, last));
            assert!(names.is_empty(), "{seed} {rows}: {names:?}");
            assert!(said || rows < 2.0, "{seed} {rows}");
        }
    }
}

#[test]
fn a_set_temperature_is_not_repeated() {
    // Steps of 5 K, each for 10 rows, which the gyro follows at once.
    let degc: Vec<f64> = (0..ROWS)
        .map(|k| 5.0 * (7.0 - (k as f64 / 10.0 % 28.0).floor() + 14.0 - 7.0).abs())
        .collect();
    // The same, by a controller that hits them to some hundredths.
    let hit: Vec<f64> = degc
        .iter()
        .enumerate()
        .map(|(k, t)| t + 0.3 * ((k / 10) as f64 * 1.7).sin())
        .collect();
    for degc in [degc, hit] {
        let (names, said) = closed(&made(1, &degc, |k| degc[k]));
        assert!(names.is_empty() && !said, "{names:?}");
    }
}

#[test]
fn fine_and_coarse_readings_are_not_repeated() {
    let degc = noisy(3);
    for step in [0.0, 0.01, 0.1, 1.0, 2.0] {
        let read = |k: usize| match step {
            0.0 => degc[k],
            step => (degc[k] / step).round() * step,
        };
        let readings: Vec<f64> = (0..ROWS).map(read).collect();
        assert!(!repeats(&readings, &new_readings(&readings)), "{step}");
    }
}
