//! Tones faster than the blocks of rows that a long record's noise is estimated on, and which of two has the name.

use crate::closure::channels::Channels;
use crate::closure::effects::tone::Pickup;
use crate::closure::effects::{Candidate, Point};
use crate::closure::search::{Effort, Search, Term};
use crate::closure::synthetic::{Pull, Random, triangle};
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
