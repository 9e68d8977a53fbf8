//! Causes that follow the temperature are told apart no better than their readings allow.

use crate::thermal::channels::Channels;
use crate::thermal::search::{Effort, Search};
use crate::thermal::synthetic::{Random, triangle};
use std::collections::BTreeMap;

const ROWS: usize = 600;
const NOISE_DPS: f64 = 0.02;

/// Of a record whose supply follows the cube of the temperature, is read with a noise (in parts of its course) and acts on the output, which has a noise of `noise_dps`: the
/// names and what is as good.
fn found(seed: u64, reading: f64, noise_dps: f64) -> (Vec<String>, Vec<String>) {
    let mut random = Random::new(seed);
    let degc = [triangle(ROWS / 2), triangle(ROWS - ROWS / 2)].concat();
    let of = |degc: f64| ((degc - 20.0) / 40.0).powi(3);
    let output = degc
        .iter()
        .map(|t| 0.3 - 0.01 * t + 0.3 * of(*t) + noise_dps * random.normal());
    let output: Vec<f64> = output.collect();
    let supply = degc
        .iter()
        .map(|t| 5.0 + 0.1 * (of(*t) + reading * random.normal()));
    let columns = BTreeMap::from([
        ("rate_out_dps".to_owned(), output),
        ("supply_v".to_owned(), supply.collect()),
        ("die_degc".to_owned(), degc),
    ]);
    said(columns)
}

/// The names and what is as good of a record of these columns.
fn said(columns: BTreeMap<String, Vec<f64>>) -> (Vec<String>, Vec<String>) {
    let time_s: Vec<f64> = (0..ROWS).map(|k| 30.0 * k as f64).collect();
    let c = Channels::new(&time_s, &columns, "die_degc", |t| t).unwrap();
    let search = Search::new(&c, &c.split().unwrap(), Effort::default(), Vec::new());
    let found = search.run().unwrap();
    let rivals = found.terms.iter().flat_map(|t| t.rivals.clone());
    let rivals = rivals.collect();
    (found.terms.iter().map(|t| t.id()).collect(), rivals)
}

#[test]
fn a_cause_that_was_read_with_noise_is_named_or_listed() {
    for seed in 0..6 {
        let (names, rivals) = found(seed, 0.014, NOISE_DPS);
        assert_eq!(names.len(), 1, "{seed} {names:?}");
        let mut both = [names, rivals].concat();
        both.sort();
        assert_eq!(both, ["bias_third_order", "supply_sensitivity"], "{seed}");
    }
}

#[test]
fn a_channel_of_which_most_is_noise_is_no_equal() {
    for seed in 0..6 {
        let (names, rivals) = found(seed, 0.3, NOISE_DPS);
        assert_eq!(names, ["bias_third_order"], "{seed}");
        assert!(rivals.is_empty(), "{seed} {rivals:?}");
    }
}

#[test]
fn a_channel_that_is_the_steps_shape_and_noise_is_listed_however_much_the_noise_takes_away() {
    for seed in 0..6 {
        let (names, rivals) = found(seed, 0.014, 0.5 * NOISE_DPS);
        let mut both = [names, rivals].concat();
        both.sort();
        assert_eq!(both, ["bias_third_order", "supply_sensitivity"], "{seed}");
    }
}

/// The acceleration swings as a table tilts, `own` of it beyond a sinusoid, and acts on the output: the names and what is as good.
fn swung(seed: u64, own: f64) -> (Vec<String>, Vec<String>) {
    let mut random = Random::new(seed);
    let degc = [triangle(ROWS / 2), triangle(ROWS - ROWS / 2)].concat();
    let accel = (0..ROWS).map(|k| {
        let angle = std::f64::consts::TAU * 37.0 * k as f64 / ROWS as f64;
        angle.sin() + own * (3.0 * angle).sin()
    });
    let accel: Vec<f64> = accel.collect();
    let pairs = degc.iter().zip(&accel);
    let output = pairs.map(|(t, g)| 0.3 - 0.01 * t + 0.1 * g + NOISE_DPS * random.normal());
    let columns = BTreeMap::from([
        ("rate_out_dps".to_owned(), output.collect()),
        ("accel_g".to_owned(), accel),
        ("die_degc".to_owned(), degc),
    ]);
    said(columns)
}

#[test]
fn a_sinusoid_of_a_channel_may_be_a_pickup_of_its_frequency() {
    for seed in 0..3 {
        let (names, rivals) = swung(seed, 0.0);
        assert_eq!(names, ["g_sensitivity"], "{seed}");
        assert_eq!(rivals, ["periodic_pickup"], "{seed}");
        let (names, rivals) = swung(seed, 0.2);
        assert_eq!((names, rivals.len()), (vec!["g_sensitivity".to_owned()], 0));
    }
}
