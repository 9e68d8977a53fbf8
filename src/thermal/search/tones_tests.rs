//! Tones faster than the blocks of rows that a long record's noise is estimated on, and which of two has the name.

use crate::thermal::channels::Channels;
use crate::thermal::effects::tone::Pickup;
use crate::thermal::effects::{Candidate, Point};
use crate::thermal::search::{Effort, Search, Term};
use crate::thermal::synthetic::{Pull, Random, triangle};
use std::collections::BTreeMap;
use std::sync::Arc;

#[test]
fn a_fast_tone_in_a_long_record_keeps_its_frequency() {
    for (seed, cycles_a_row) in [(1, 0.36), (2, 0.41), (3, 0.07), (4, 0.19)] {
        keeps_its_frequency(seed, cycles_a_row, 0.0);
    }
}

/// Means of three rows have nothing of a third of a cycle a row.
#[test]
fn a_tone_that_blocks_would_hide_is_found() {
    keeps_its_frequency(5, 1.0 / 3.0, 0.0);
}

/// Means of blocks at uneven times have no one slower tone that a fast one looks like.
#[test]
fn a_fast_tone_at_uneven_times_is_found() {
    for (seed, cycles_a_row) in [(6, 0.36), (7, 0.45)] {
        keeps_its_frequency(seed, cycles_a_row, 0.95);
    }
}

/// As fast as the rows tell where they do not pause, and faster than their number says.
#[test]
fn a_fast_tone_in_a_record_with_a_pause_is_found() {
    let mut random = Random::new(8);
    let at: Vec<usize> = (0..200).chain(500..700).collect();
    let degc = triangle(at.len());
    let cycles_a_row = 0.47;
    let output = at.iter().zip(&degc).map(|(at, degc)| {
        let tone = (std::f64::consts::TAU * cycles_a_row * *at as f64).sin();
        0.3 - 0.01 * degc + 0.05 * tone + 0.01 * random.normal()
    });
    let columns = BTreeMap::from([
        ("rate_out_dps".to_owned(), output.collect()),
        ("die_degc".to_owned(), degc.clone()),
    ]);
    let time_s: Vec<f64> = at.iter().map(|at| *at as f64).collect();
    let c = Channels::new(&time_s, &columns, "die_degc", |t| t).unwrap();
    let search = Search::new(&c, &c.split().unwrap(), Effort::default(), Vec::new());
    let found = search.run().unwrap();
    let names: Vec<String> = found.terms.iter().map(|t| t.id()).collect();
    assert_eq!(names, ["periodic_pickup"]);
    let hz = found.terms[0].point.theta[0];
    assert!((hz - cycles_a_row).abs() < 0.05 / c.span_s(), "{hz}");
}

/// The tone is the only name, and nothing is left. Rows come by up to `uneven` of a row too late.
fn keeps_its_frequency(seed: u64, cycles_a_row: f64, uneven: f64) {
    let rows = 2000;
    let mut random = Random::new(seed);
    let degc = [triangle(rows / 2), triangle(rows / 2)].concat();
    let at: Vec<f64> = (0..rows)
        .map(|k| k as f64 + uneven * random.uniform())
        .collect();
    let output = degc.iter().zip(&at).map(|(degc, at)| {
        let tone = (std::f64::consts::TAU * cycles_a_row * at).sin();
        0.3 - 0.01 * degc + 0.05 * tone + 0.01 * random.normal()
    });
    let columns = BTreeMap::from([
        ("rate_out_dps".to_owned(), output.collect()),
        ("die_degc".to_owned(), degc.clone()),
    ]);
    let time_s: Vec<f64> = at.iter().map(|at| 10.0 * at).collect();
    let c = Channels::new(&time_s, &columns, "die_degc", |t| t).unwrap();
    let effort = Effort {
        rows: 500,
        ..Effort::default()
    };
    let search = Search::new(&c, &c.split().unwrap(), effort, Vec::new());
    let found = search.run().unwrap();
    let names: Vec<String> = found.terms.iter().map(|t| t.id()).collect();
    assert_eq!(
        (names, found.left),
        (vec!["periodic_pickup".to_owned()], None),
        "{seed}"
    );
    let hz = found.terms[0].point.theta[0];
    // A twentieth of what the record resolves.
    let wanted_hz = cycles_a_row / 10.0;
    assert!(
        (hz - wanted_hz).abs() < 0.05 / c.span_s(),
        "{hz} {wanted_hz}"
    );
}

/// Whether a tone of so many periods, which came second and has no name, is named where the first is no longer in.
fn is_named(periods: f64, first_is_in: bool) -> bool {
    let pulled = Pull::default().made();
    let c = &pulled.channels;
    let split = c.split().expect("enough rows");
    let search = Search::new(c, &split, Effort::default(), Vec::new());
    let tone = |frequency_hz: f64, further: bool| {
        let candidate: Arc<dyn Candidate> = Arc::new(Pickup {
            frequency_hz,
            further,
        });
        Term::new(candidate, Point::at(0, &[frequency_hz]))
    };
    let mut terms = vec![tone(periods / c.span_s(), true)];
    terms.extend(first_is_in.then(|| tone(9.0 / c.span_s(), false)));
    let model = search.model(&terms).expect("enough rows");
    let model = search.one_tone_named(model).expect("enough rows");
    model.terms[0].candidate.named()
}

#[test]
fn a_second_tone_has_the_name_of_a_first_that_is_no_longer_in() {
    assert!(is_named(20.0, false));
    assert!(!is_named(20.0, true));
    // Too few to tell from what wanders.
    assert!(!is_named(2.0, false));
}

/// A record of a staircase of temperatures, `step` rows each, in `turns` ramps up and down, with an output of it and of the row.
fn on_stairs(
    seed: u64,
    rows: usize,
    (step, turns): (usize, usize),
    of: impl Fn(f64, usize) -> f64,
) -> (Vec<String>, Option<String>) {
    let quarter = rows / turns;
    let level = |k: usize| {
        let at = (k / step * step) as f64 / quarter as f64;
        let up = at.fract();
        30.0 + 40.0
            * if (at as usize).is_multiple_of(2) {
                up
            } else {
                1.0 - up
            }
    };
    // The chamber is followed within a row or two.
    let mut now = level(0);
    let degc: Vec<f64> = (0..rows)
        .map(|k| {
            now += 0.8 * (level(k) - now);
            now
        })
        .collect();
    on_course(seed, degc, of)
}

/// A record of a course of temperatures, with an output of its rate and of the row.
fn on_course(
    seed: u64,
    degc: Vec<f64>,
    of: impl Fn(f64, usize) -> f64,
) -> (Vec<String>, Option<String>) {
    let (rows, mut random) = (degc.len(), Random::new(seed));
    let rate = |k: usize| degc[k] - degc[k.saturating_sub(1)];
    let output = (0..rows).map(|k| 0.3 - 0.01 * degc[k] + of(rate(k), k) + 0.02 * random.normal());
    let columns = BTreeMap::from([
        ("rate_out_dps".to_owned(), output.collect()),
        ("die_degc".to_owned(), degc.clone()),
    ]);
    let time_s: Vec<f64> = (0..rows).map(|k| 60.0 * k as f64).collect();
    let c = Channels::new(&time_s, &columns, "die_degc", |t| t).unwrap();
    let search = Search::new(&c, &c.split().unwrap(), Effort::default(), Vec::new());
    let found = search.run().unwrap();
    (found.terms.iter().map(|t| t.id()).collect(), found.left)
}

#[test]
fn the_pace_of_a_staircase_is_no_pickup() {
    for seed in 0..4 {
        let (names, _) = on_stairs(seed, 140, (3, 6), |rate, _| 0.02 * rate * rate);
        assert!(
            !names.contains(&"periodic_pickup".to_owned()),
            "{seed} {names:?}"
        );
    }
}

/// Twice as fast as the chamber, whose square therefore swings with it, but not on stairs.
#[test]
fn a_tone_of_twice_the_chambers_frequency_is_a_pickup_where_the_chamber_is_none() {
    for seed in 0..4 {
        let tone = |k: usize| 0.3 * (std::f64::consts::TAU * k as f64 / 238.0 + 0.7).sin();
        let (names, left) = on_stairs(seed, 1200, (20, 5), |_, k| tone(k));
        assert_eq!(
            (names, left),
            (vec!["periodic_pickup".to_owned()], None),
            "{seed}"
        );
    }
}

/// Two periods of the chamber beat in the square of its rate.
#[test]
fn a_tone_at_the_beat_of_a_smooth_chamber_is_a_pickup() {
    let wave = |periods: f64, k: usize| (std::f64::consts::TAU * periods * k as f64 / 900.0).sin();
    let degc: Vec<f64> = (0..900)
        .map(|k| 40.0 + 25.0 * wave(4.0, k) + 10.0 * wave(10.0, k))
        .collect();
    let all = (0..12).map(|seed| on_course(seed, degc.clone(), |_, k| 0.3 * wave(6.0, k + 11)));
    // Where chance leaves something beside it, it may be an answer to the temperature.
    let (named, others): (Vec<_>, Vec<_>) = all.partition(|(_, left)| left.is_none());
    assert!(named.len() >= 10, "{others:?}");
    assert!(named.iter().all(|(names, _)| *names == ["periodic_pickup"]));
    assert!(others.iter().all(|(names, _)| names.is_empty()));
}
