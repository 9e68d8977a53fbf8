//! Names that another one's shape called for when it was off.

use super::*;
use crate::thermal::channels::Channels;
use crate::thermal::effects::{Candidate, Point};
use crate::thermal::search::{Effort, Search};
use crate::thermal::synthetic::{Pull, Random, triangle};
use std::collections::BTreeMap;
use std::sync::Arc;

/// What stays of a large pull whose shape is a fifth too small and of two names beside it: a supply that is there (or not),
/// and damping, which mends what the pull is off.
fn stay(supply_dps: f64) -> Vec<String> {
    let pull = Pull {
        supply_dps,
        ..Pull::default()
    };
    let pulled = pull.made();
    let c = &pulled.channels;
    let split = c.split().expect("enough rows");
    let search = Search::new(c, &split, Effort::default(), Vec::new());
    let term = |id: &str, point: Point| {
        let is_it = |c: &&Arc<dyn Candidate>| c.id() == id;
        let candidate = search.candidates().iter().find(is_it).expect(id).clone();
        Term::new(candidate, point)
    };
    let terms = [
        term(
            "amplitude_phase_coupling",
            Point::at(0, &[0.8 * pulled.most_u]),
        ),
        term("damping_bias", Point::form(0)),
        term("supply_sensitivity", Point::form(0)),
    ];
    let model = search.model(&terms).expect("enough rows");
    let spared = search.spared(model).expect("enough rows");
    spared.terms.iter().map(Term::id).collect()
}

#[test]
fn a_name_that_mended_anothers_shape_is_taken_back_and_a_cause_is_not() {
    assert_eq!(stay(0.0), ["amplitude_phase_coupling"]);
    assert_eq!(
        stay(0.1),
        ["amplitude_phase_coupling", "supply_sensitivity"]
    );
}

/// What a sweep leaves of an acceleration's effect and a supply's, where the acceleration is a sinusoid that is read with noise:
/// a tone of its frequency fits better.
fn swept_beside_a_wave() -> Vec<String> {
    let (rows, mut random) = (300, Random::new(2));
    let degc = [triangle(rows / 2), triangle(rows / 2)].concat();
    let wave = |k: usize| (std::f64::consts::TAU * 12.0 * k as f64 / rows as f64).sin();
    let supply = |k: usize| f64::from(u8::from(k / 11 % 3 == 1));
    let output = (0..rows).map(|k| {
        0.3 - 0.002 * degc[k] + 0.01 * (8.0 * wave(k) + 3.0 * supply(k) + random.normal())
    });
    let output = output.collect();
    let read = (0..rows).map(|k| wave(k) + 0.1 * random.normal());
    let columns = BTreeMap::from([
        ("rate_out_dps".to_owned(), output),
        ("accel_g".to_owned(), read.collect()),
        ("supply_v".to_owned(), (0..rows).map(supply).collect()),
        ("die_degc".to_owned(), degc.clone()),
    ]);
    let time_s: Vec<f64> = (0..rows).map(|k| 10.0 * k as f64).collect();
    let c = Channels::new(&time_s, &columns, "die_degc", |t| t).unwrap();
    let search = Search::new(&c, &c.split().unwrap(), Effort::default(), Vec::new());
    let term = |id: &str| {
        let mut all = search.candidates().iter();
        let candidate = all.find(|c| c.id() == id).unwrap().clone();
        Term::new(candidate, Point::form(0))
    };
    let terms = [term("g_sensitivity"), term("supply_sensitivity")];
    let swept = search.swept(search.model(&terms).unwrap()).unwrap();
    swept.terms.iter().map(Term::id).collect()
}

#[test]
fn a_tone_takes_no_names_place_whose_channel_has_its_frequency() {
    assert_eq!(
        swept_beside_a_wave(),
        ["g_sensitivity", "supply_sensitivity"]
    );
}

/// What stays of a jump and a broad crossing beside a narrow crossing that swings to both sides, and a step (or none) elsewhere.
fn united(seed: u64, step_dps: f64) -> Vec<String> {
    let (rows, mut random) = (600, Random::new(seed));
    let degc = [triangle(rows / 2), triangle(rows / 2)].concat();
    let output = degc.iter().map(|t| {
        let x = (t - 20.0) / 2.0;
        let step = if *t > 55.0 { step_dps } else { 0.0 };
        0.3 - 0.01 * t + 0.45 * 2.0 * x / (1.0 + x * x) + step + 0.02 * random.normal()
    });
    let output = output.collect();
    let read = degc.iter().map(|t| t + 0.03 * random.normal());
    let columns = BTreeMap::from([
        ("rate_out_dps".to_owned(), output),
        ("die_degc".to_owned(), read.collect()),
    ]);
    let time_s: Vec<f64> = (0..rows).map(|k| 20.0 * k as f64).collect();
    let c = Channels::new(&time_s, &columns, "die_degc", |t| t).unwrap();
    let search = Search::new(&c, &c.split().unwrap(), Effort::default(), Vec::new());
    let term = |id: &str, point: Point| {
        let is_it = |c: &&Arc<dyn Candidate>| c.id() == id;
        let candidate = search.candidates().iter().find(is_it).unwrap().clone();
        Term::new(candidate, point)
    };
    let at = |degc: f64| (degc - 35.0) / 35.0;
    // A gradual step and a broad swing look like a narrow one.
    let terms = match step_dps {
        0.0 => [
            term("stress_jump", Point::at(3, &[at(20.0), -3.4])),
            term("mode_crossing", Point::at(0, &[at(20.0), -1.2])),
        ],
        _ => [
            term("stress_jump", Point::at(0, &[at(55.0)])),
            term("mode_crossing", Point::at(0, &[at(20.0), -2.9])),
        ],
    };
    let mut model = search.model(&terms).unwrap();
    if step_dps == 0.0 {
        model = search.polished(model).unwrap();
    }
    let united = search.united(model).unwrap();
    united.terms.iter().map(Term::id).collect()
}

#[test]
fn two_shapes_of_one_place_are_one_where_it_does_for_both() {
    for seed in 1..5 {
        assert_eq!(united(seed, 0.0), ["mode_crossing"], "{seed}");
        let both = ["stress_jump", "mode_crossing"];
        assert_eq!(united(seed, 0.1), both, "{seed}");
        // Worth less than the second of one place has to be.
        assert_eq!(united(seed, 0.018), both, "{seed}");
    }
}
