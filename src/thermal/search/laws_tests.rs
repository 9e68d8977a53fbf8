use super::*;
use crate::thermal::channels::Channels;
use crate::thermal::search::Effort;
use crate::thermal::synthetic::{Random, triangle};
use std::collections::BTreeMap;

const ROWS: usize = 900;

/// A place of the experiment: temperature (-1..1), supply, acceleration.
struct Place {
    u: f64,
    supply_v: f64,
    accel_g: f64,
}

/// Names, and the channel of what is left, of an effect in white noise of 0.01 deg/s.
fn found(seed: u64, effect: impl Fn(&Place) -> f64) -> (Vec<String>, Option<String>) {
    let mut random = Random::new(seed);
    let degc = [triangle(ROWS / 2), triangle(ROWS / 2)].concat();
    let supply: Vec<f64> = (0..ROWS)
        .map(|k| 5.0 + 0.2 * (k as f64 / 37.0).sin())
        .collect();
    let places = [1.0, 0.0, -1.0, 0.71, -0.71, 0.5];
    let accel: Vec<f64> = (0..ROWS).map(|k| places[k / 12 * 5 % 6]).collect();
    let output = (0..ROWS).map(|k| {
        let place = Place {
            u: degc[k] / 35.0 - 1.0,
            supply_v: supply[k],
            accel_g: accel[k],
        };
        0.3 - 0.1 * place.u + effect(&place) + 0.01 * random.normal()
    });
    let columns = BTreeMap::from([
        ("rate_out_dps".to_owned(), output.collect()),
        ("supply_v".to_owned(), supply.clone()),
        ("accel_g".to_owned(), accel.clone()),
        ("die_degc".to_owned(), degc.clone()),
    ]);
    let time_s: Vec<f64> = (0..ROWS).map(|k| 8.0 * k as f64).collect();
    let c = Channels::new(&time_s, &columns, "die_degc", |t| t).unwrap();
    let search = Search::new(&c, &c.split().unwrap(), Effort::default(), Vec::new());
    let found = search.run().unwrap();
    let mut names: Vec<String> = found.terms.iter().map(Term::id).collect();
    names.sort();
    (names, found.left)
}

fn named(names: &[&str], left: Option<&str>) -> (Vec<String>, Option<String>) {
    let names = names.iter().map(|n| (*n).to_owned()).collect();
    (names, left.map(str::to_owned))
}

#[test]
fn a_law_that_bends_a_little_has_its_name() {
    for (seed, square, kinked, left) in [
        (1, 0.12, 0.0, None),
        (2, 0.12, 0.0, None),
        (3, 0.0, 0.12, Some("supply_v")),
    ] {
        let bent = |p: &Place| {
            let v = (p.supply_v - 5.0) / 0.2;
            0.15 * (v + square * v * v + kinked * f64::from(u8::from(v > 0.3)))
        };
        let due = named(&["supply_sensitivity"], left);
        assert_eq!(found(seed, bent), due, "{seed}");
    }
    let straight = |p: &Place| 0.75 * (p.supply_v - 5.0);
    assert_eq!(found(4, straight), named(&["supply_sensitivity"], None));
}

#[test]
fn what_bends_too_much_is_no_law() {
    let bent = |p: &Place| {
        let v = (p.supply_v - 5.0) / 0.2;
        0.15 * (v + 1.0 * v * v)
    };
    assert_eq!(found(1, bent), named(&[], Some("supply_v")));
}

#[test]
fn a_second_name_of_a_channel_has_to_be_more_than_a_bend() {
    // The zero of the accelerometer is off by 15 mg.
    let off = |p: &Place| 0.3 * (p.accel_g + 0.015).powi(2);
    let both = |p: &Place| 0.3 * p.accel_g * p.accel_g + 0.06 * p.accel_g;
    for seed in 1..=3 {
        let due = named(&["g_squared_sensitivity"], None);
        assert_eq!(found(seed, off), due, "{seed}");
        let due = named(&["g_sensitivity", "g_squared_sensitivity"], None);
        assert_eq!(found(seed, both), due, "{seed}");
    }
}

#[test]
fn a_bend_in_temperature_of_about_third_order_is_that() {
    let bend = |p: &Place| 0.8 * (p.u - 0.05).atan();
    for seed in 1..=3 {
        let due = named(&["bias_third_order"], None);
        assert_eq!(found(seed, bend), due, "{seed}");
    }
}
