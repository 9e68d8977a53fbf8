//! A bias that follows the temperature, and a thermometer whose readings have noise.

use super::*;
use crate::thermal::search::{Effort, Search, Term};
use crate::thermal::synthetic::{Random, triangle};
use std::collections::BTreeMap;

const ROWS: usize = 1000;
const NOISE_DPS: f64 = 0.1;

/// A record of a bias in the temperature; its thermometer's noise makes `share` of the output's noise. A quadrature wanders
/// beside it that nothing follows.
fn record(seed: u64, share: f64, step_k: f64) -> Channels {
    let mut random = Random::new(seed);
    let degc = [triangle(ROWS / 2), triangle(ROWS / 2)].concat();
    let output = |u: f64| 2.0 - 1.5 * u + 0.4 * u * u;
    let rate: Vec<f64> = degc
        .iter()
        .map(|t| output(t / 35.0 - 1.0) + NOISE_DPS * random.normal())
        .collect();
    // The slope is 1.6 deg/s per unit of u, rms.
    let noise_k = share * NOISE_DPS / 1.6 * 35.0;
    let read = |t: f64| (t / step_k).round() * step_k;
    let die: Vec<f64> = degc
        .iter()
        .map(|t| read(t + noise_k * random.normal()))
        .collect();
    let mut quadrature_dps = -20.0;
    let quadrature: Vec<f64> = (0..ROWS)
        .map(|_| {
            quadrature_dps += 0.3 * random.normal();
            quadrature_dps
        })
        .collect();
    let columns = BTreeMap::from([
        ("rate_out_dps".to_owned(), rate),
        ("die_degc".to_owned(), die),
        ("quad_dps".to_owned(), quadrature),
    ]);
    let time_s: Vec<f64> = (0..ROWS).map(|k| 10.0 * k as f64).collect();
    Channels::new(&time_s, &columns, "die_degc", |t| t).unwrap()
}

#[test]
fn what_readings_err_by_is_no_effect_of_the_temperature() {
    for (seed, share, step_k) in [
        (1, 0.5, 1e-6),
        (2, 0.5, 1e-6),
        (3, 0.4, 1e-6),
        (4, 0.5, 0.5),
    ] {
        let c = record(seed, share, step_k);
        assert_eq!(errors_of(&c).len(), 2, "{seed}");
        let search = Search::new(&c, &c.split().unwrap(), Effort::default(), Vec::new());
        let found = search.run().unwrap();
        let names: Vec<String> = found.terms.iter().map(Term::id).collect();
        assert_eq!((names, found.left), (Vec::new(), None), "{seed}");
        // The model is the declared one and no more: it predicts by the reading.
        let model = search.model(&[]).unwrap();
        assert_eq!(model.columns.len(), 3);
    }
}

#[test]
fn readings_that_hardly_err_cost_nothing() {
    assert!(errors_of(&record(1, 0.001, 1e-6)).is_empty());
    // A thermometer that stands still errs by nothing.
    let columns = BTreeMap::from([
        ("rate_out_dps".to_owned(), vec![0.0, 1.0, 0.5, 0.2]),
        ("die_degc".to_owned(), vec![20.0; 4]),
    ]);
    let time_s = [0.0, 1.0, 2.0, 3.0];
    let c = Channels::new(&time_s, &columns, "die_degc", |t| t).unwrap();
    assert!(errors_of(&c).is_empty());
}

/// As [`record`], slowly curved by a third order, with a drive gain that follows the temperature and is read with little noise.
fn with_gain(seed: u64, own_k: f64) -> Channels {
    with_gain_read(seed, own_k, |t, random| t + 2.0 * random.normal())
}

/// The same with a thermometer that reads a temperature so.
fn with_gain_read(seed: u64, own_k: f64, read: impl Fn(f64, &mut Random) -> f64) -> Channels {
    let mut random = Random::new(seed);
    let degc = [triangle(ROWS / 2), triangle(ROWS / 2)].concat();
    let u = |t: f64| t / 35.0 - 1.0;
    let output = |u: f64| 2.0 - 1.5 * u + 0.4 * u * u + 0.5 * u.powi(3);
    let rate = degc
        .iter()
        .map(|t| output(u(*t)) + NOISE_DPS * random.normal())
        .collect();
    let die = degc.iter().map(|t| read(*t, &mut random)).collect();
    let gain = degc
        .iter()
        .map(|t| 1.0 + 0.05 * u(t + own_k * random.normal()))
        .collect();
    let columns = BTreeMap::from([
        ("rate_out_dps".to_owned(), rate),
        ("die_degc".to_owned(), die),
        ("agc".to_owned(), gain),
    ]);
    let time_s: Vec<f64> = (0..ROWS).map(|k| 10.0 * k as f64).collect();
    Channels::new(&time_s, &columns, "die_degc", |t| t).unwrap()
}

#[test]
fn a_channel_that_reads_the_temperature_better_is_no_cause() {
    for seed in 1..=3 {
        let c = with_gain(seed, 0.1);
        assert_eq!(errors_of(&c).len(), 6, "{seed}");
        let search = Search::new(&c, &c.split().unwrap(), Effort::default(), Vec::new());
        let found = search.run().unwrap();
        let names: Vec<String> = found.terms.iter().map(Term::id).collect();
        let third = vec!["bias_third_order".to_owned()];
        assert_eq!((names, found.left), (third, None), "{seed}");
    }
    // One that moves by itself says nothing of the thermometer's noise.
    assert_eq!(errors_of(&with_gain(1, 3.0)).len(), 2);
}

#[test]
fn rounding_and_a_few_rows_without_a_reading_are_no_reason_to_distrust_a_channel() {
    let coarse = |t: f64, _: &mut Random| (t / 0.7).round() * 0.7;
    let odd = |t: f64, random: &mut Random| {
        let rarely = if random.normal() > 2.6 { 25.0 } else { 0.0 };
        t + 2.0 * random.normal() + rarely
    };
    for seed in 1..=3 {
        for c in [
            with_gain_read(seed, 0.01, coarse),
            with_gain_read(seed, 0.01, odd),
        ] {
            assert!(by_others(&c).is_some(), "{seed}");
        }
    }
}

#[test]
fn a_channel_that_lags_now_and_then_is_another_temperature() {
    // Off in one row out of twenty.
    let late = |t: f64, random: &mut Random| {
        let rarely = if random.normal() > 1.65 { 25.0 } else { 0.0 };
        t + 2.0 * random.normal() + rarely
    };
    assert!(by_others(&with_gain_read(1, 0.01, late)).is_none());
}
