//! Steps that happen once, and others.

use super::*;
use crate::thermal::channels::Channels;
use crate::thermal::search::Effort;
use crate::thermal::synthetic::{Random, triangle};
use std::collections::BTreeMap;

const ROWS: usize = 400;

/// What is found of temperatures, degC, and an output beside noise of 0.01 deg/s: names, those
/// that happen once, and the channel of what is left.
fn found(seed: u64, degc: Vec<f64>, output: &[f64]) -> (Vec<String>, Vec<String>, Option<String>) {
    let mut random = Random::new(seed);
    let noisy = output.iter().map(|v| v + 0.01 * random.normal()).collect();
    let columns = BTreeMap::from([
        ("rate_out_dps".to_owned(), noisy),
        ("die_degc".to_owned(), degc),
    ]);
    let time_s: Vec<f64> = (0..columns["die_degc"].len())
        .map(|k| 10.0 * k as f64)
        .collect();
    let c = Channels::new(&time_s, &columns, "die_degc", |t| t).unwrap();
    let search = Search::new(&c, &c.split().unwrap(), Effort::default(), Vec::new());
    let found = search.run().unwrap();
    let names = found.terms.iter().map(Term::id).collect();
    (names, found.once, found.left)
}

#[test]
fn a_step_that_happens_once_is_one_of_time_as_well() {
    let stepped = |degc: &[f64]| {
        degc.iter()
            .map(|t| if *t > 40.0 { 0.1 } else { 0.0 })
            .collect()
    };
    for seed in 1..4 {
        let once: Vec<f64> = (0..ROWS).map(|k| 70.0 * k as f64 / ROWS as f64).collect();
        let out: Vec<f64> = stepped(&once);
        let (names, at_once, left) = found(seed, once, &out);
        assert!(
            names.contains(&"stress_jump".to_owned()),
            "{seed}: {names:?}"
        );
        assert_eq!(at_once, ["stress_jump"], "{seed}");
        assert_eq!(left.as_deref(), Some("time_s"), "{seed}");
        let often = [triangle(ROWS / 4), triangle(ROWS / 4)].concat();
        let out: Vec<f64> = stepped(&often);
        let (names, at_once, left) = found(seed, often, &out);
        assert_eq!(names, ["stress_jump"], "{seed}");
        assert_eq!((at_once, left), (Vec::new(), None), "{seed}");
    }
}
