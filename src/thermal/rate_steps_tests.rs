//! Records in pairs: one as it is measured, the other with its output rounded.

use super::super::baseline::{BaselineFit, fit};
use super::super::close::close;
use super::super::search::Effort;
use super::super::synthetic::{Random, few, record, triangle};
use super::step_of;
use crate::design::{FitOrder, RecordMapping, reader};

const ROWS: usize = 600;

/// An output of 1.4 deg/s of drift, with noise.
fn output(noise_dps: f64, seed: u64) -> Vec<f64> {
    let mut random = Random::new(seed);
    let rows = triangle(ROWS).into_iter();
    rows.map(|t| 0.3 + 0.02 * t + noise_dps * random.normal())
        .collect()
}

fn rounded(values: &[f64], step: f64) -> Vec<f64> {
    values.iter().map(|v| (v / step).round() * step).collect()
}

fn fitted(output: &[f64]) -> BaselineFit {
    let record = record("die_degc", &triangle(ROWS), output);
    let order = few(FitOrder::Fixed(1));
    fit(&record, &RecordMapping::default(), &order).unwrap()
}

fn is_told(f: &BaselineFit) -> bool {
    let told = f
        .warnings
        .iter()
        .filter(|w| w.code == "rate_resolution_coarse");
    assert_eq!(told.count(), usize::from(f.rate_steps.is_some()));
    f.rate_steps.is_some()
}

#[test]
fn rounding_that_noise_does_not_dither_is_told_and_is_the_floor() {
    for step in [0.05, 0.1, 0.25] {
        for seed in 0..6 {
            let noise = step * [0.02, 0.1, 0.2][seed as usize % 3];
            let fine = output(noise, seed);
            let f = fitted(&fine);
            assert!(!is_told(&f), "{step} {seed}");
            assert!((f.noise_floor_rms_dps / noise - 1.0).abs() < 0.15);
            let f = fitted(&rounded(&fine, step));
            assert!(is_told(&f), "{step} {seed}");
            let found = f.rate_steps.unwrap();
            assert!((found.step_dps / step - 1.0).abs() < 1e-6, "{found:?}");
            assert!(
                f.noise_floor_rms_dps >= 0.999 * step / 12f64.sqrt(),
                "{step} {seed}: {}",
                f.noise_floor_rms_dps
            );
        }
    }
    let f = fitted(&rounded(&output(0.01, 1), 0.1));
    let told = f.rate_steps.unwrap().warning().message;
    assert!(
        told.starts_with("rate_out_dps comes in steps of 0.1 deg/s, more than twice its noise. The rounding alone is 0.0289 deg/s rms"),
        "{told}"
    );
}

#[test]
fn odd_rows_and_the_last_digit_of_a_float_hide_no_steps() {
    for seed in 0..6 {
        let mut output = rounded(&output(0.01, seed), 0.1);
        output.iter_mut().for_each(|v| *v = f64::from(*v as f32));
        output.iter_mut().step_by(40).for_each(|v| *v += 0.013);
        output.iter_mut().step_by(3).for_each(|v| *v *= 1.0 + 1e-7);
        let f = fitted(&output);
        assert!(is_told(&f), "{seed}");
        assert!((f.rate_steps.unwrap().step_dps - 0.1).abs() < 1e-5);
    }
}

#[test]
fn steps_that_noise_dithers_are_not_told() {
    for seed in 0..6 {
        // Noise of the step and of twice the step; a gyro's LSB of 250 deg/s over 2^15; four decimals.
        for (noise, step) in [
            (0.1, 0.1),
            (0.2, 0.1),
            (0.05, 250.0 / 32_768.0),
            (0.01, 1e-4),
        ] {
            let f = fitted(&rounded(&output(noise, seed), step));
            assert!(!is_told(&f), "{noise} {step} {seed}");
            assert!((f.noise_floor_rms_dps / noise.hypot(step / 12f64.sqrt()) - 1.0).abs() < 0.15);
        }
        // Codes.
        let codes: Vec<f64> = output(0.05, seed)
            .iter()
            .map(|v| (v * 131.0).round())
            .collect();
        assert!(!is_told(&fitted(&codes)), "{seed}");
    }
}

#[test]
fn neither_a_constant_nor_a_table_without_noise_has_steps() {
    assert_eq!(step_of(vec![0.3; ROWS]), None);
    assert!(!is_told(&fitted(&output(0.0, 0))));
    // Set points: the output goes in even steps, as the bias does.
    let degc: Vec<f64> = (0..ROWS).map(|k| 10.0 * (k / 60) as f64).collect();
    let even: Vec<f64> = degc.iter().map(|t| 0.3 + 0.02 * t).collect();
    let record = record("die_degc", &degc, &even);
    let order = few(FitOrder::Fixed(1));
    let f = fit(&record, &RecordMapping::default(), &order).unwrap();
    assert!(!is_told(&f), "{:?}", f.rate_steps);
    // One odd row of a constant is no level.
    let mut output = vec![0.3; ROWS];
    output[100] = 0.7;
    assert_eq!(step_of(output), None);
}

#[test]
fn close_tells_the_steps_once_and_has_the_same_least_floor() {
    let design = reader::read(None).unwrap();
    let fine = output(0.01, 2);
    for (output, step) in [(rounded(&fine, 0.1), Some(0.1)), (fine, None)] {
        let record = record("die_degc", &triangle(ROWS), &output);
        let closed = close(&record, Vec::new(), &design, "test", Effort::default()).unwrap();
        let warnings = closed.closure.warnings.iter();
        let told = warnings.filter(|w| w.code == "rate_resolution_coarse");
        assert_eq!(told.count(), usize::from(step.is_some()));
        let floor = closed.closure.noise_floor_rms;
        match step {
            Some(step) => assert!(floor >= 0.999 * step / 12f64.sqrt(), "{floor}"),
            None => assert!((floor / 0.01 - 1.0).abs() < 0.15, "{floor}"),
        }
    }
}
