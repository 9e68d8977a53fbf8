//! A quadrature that contains the output is told from one that leaks into it.

use super::*;
use crate::design::reader;
use crate::record::ThermalRecord;
use crate::thermal::close::close;
use crate::thermal::intake::Intake;
use crate::thermal::search::Effort;
use crate::thermal::synthetic::{Random, record, triangle};

const ROWS: usize = 240;
const NOISE_DPS: f64 = 0.02;

/// A record whose quadrature drifts with the temperature, swings once in a while and has a noise of its own; `leaks` of it, rad, are in the output
/// and `turned`, rad, of the output's noise and warm-up in it.
fn made(seed: u64, leaks: f64, turned: f64) -> ThermalRecord {
    let mut random = Random::new(seed);
    let degc = triangle(ROWS);
    let mut out = Vec::new();
    let mut quad = Vec::new();
    for (k, t) in degc.iter().enumerate() {
        let swing = (k as f64 / 17.0).sin();
        let q = 600.0 - 0.02 * t + 0.1 * swing + 0.5 * NOISE_DPS * random.normal();
        let warm = 0.4 * (-(k as f64) / 40.0).exp() + NOISE_DPS * random.normal();
        out.push(3.0 + 0.05 * t - 4e-4 * t * t + warm + leaks * (q - 600.0));
        quad.push(q + turned * warm);
    }
    let mut record = record("die_degc", &degc, &out);
    record.columns.insert(NAME.to_owned(), quad);
    record
}

fn said_of(record: &ThermalRecord) -> (bool, bool) {
    let design = reader::parse("", None).unwrap();
    let intake = Intake::of(record, &design, Vec::new()).unwrap();
    let mut said = intake.warnings.iter();
    let said = said.any(|w| w.code == "quadrature_contains_output");
    (said, intake.channels.column(NAME).is_none())
}

#[test]
fn a_leakage_of_any_plausible_angle_keeps_the_channel() {
    for seed in 0..20 {
        for leaks in [0.0, 0.01, 0.1, -0.3] {
            assert_eq!(
                said_of(&made(seed, leaks, 0.0)),
                (false, false),
                "{seed} {leaks}"
            );
        }
    }
}

#[test]
fn a_quadrature_with_the_outputs_noise_is_left_out_and_said() {
    for seed in 0..20 {
        for turned in [0.5, -0.6, 0.9] {
            assert_eq!(
                said_of(&made(seed, 0.0, turned)),
                (true, true),
                "{seed} {turned}"
            );
        }
    }
}

#[test]
fn a_leakage_of_no_plausible_angle_keeps_the_channel_where_the_applied_rate_is_not_in_it() {
    // Steps of a table: from row to row the rate stands still.
    let rate = |k: usize| 50.0 * ((k / 20 % 5) as f64 - 2.0);
    let swept = |leaks: f64, turned: f64, seed: u64| {
        let mut made = made(seed, leaks, turned);
        let rates: Vec<f64> = (0..ROWS).map(rate).collect();
        for (name, of_rate) in [(NAME, turned), ("rate_out_dps", 1.0)] {
            let column = made.columns.get_mut(name).unwrap();
            for (v, rate) in column.iter_mut().zip(&rates) {
                *v += of_rate * rate;
            }
        }
        made.columns.insert("rate_dps".to_owned(), rates);
        made
    };
    for seed in 0..20 {
        for leaks in [0.7, -3.0] {
            let made = swept(leaks, 0.0, seed);
            assert_eq!(said_of(&made), (false, false), "{seed} {leaks}");
        }
        let steep = made(seed, -3.0, 0.0);
        assert_eq!(said_of(&steep), (true, true), "{seed}: without a rate");
        assert_eq!(said_of(&swept(0.0, 0.6, seed)), (true, true), "{seed}");
    }
}

#[test]
fn what_the_output_shares_with_its_quadrature_is_no_leakage() {
    let design = reader::parse("", None).unwrap();
    for seed in 0..4 {
        let effort = Effort::default();
        let record = made(seed, 0.0, 0.5);
        let closed = close(&record, Vec::new(), &design, "test", effort).unwrap();
        let names: Vec<&str> = closed
            .closure
            .steps
            .iter()
            .map(|s| s.effect.as_str())
            .collect();
        assert_eq!(names, ["warmup_transient"], "{seed}");
    }
}

#[test]
fn an_output_and_a_quadrature_that_both_follow_the_applied_rate_do_not_contain_each_other() {
    for seed in 0..20 {
        let mut made = made(seed, 0.02, 0.0);
        let rate = |k: usize| 50.0 * (k as f64 / 9.0).sin();
        for (k, v) in made.columns.get_mut(NAME).unwrap().iter_mut().enumerate() {
            *v += 0.01 * rate(k);
        }
        for (k, v) in made
            .columns
            .get_mut("rate_out_dps")
            .unwrap()
            .iter_mut()
            .enumerate()
        {
            *v += rate(k) - 0.03 * rate(k).powi(3) / 2500.0;
        }
        let rates = (0..ROWS).map(rate).collect();
        made.columns.insert("rate_dps".to_owned(), rates);
        assert_eq!(said_of(&made), (false, false), "{seed}");
    }
}
