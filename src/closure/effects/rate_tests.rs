//! A dead band that hardly any reading is within.

use super::*;
use crate::closure::search::{Effort, Search, Term as Step};
use crate::closure::synthetic::{Random, triangle};
use std::collections::BTreeMap;

const ROWS: usize = 300;

#[test]
fn a_dead_band_of_a_hundred_thousandth_of_the_rate_shows_by_what_it_subtracts() {
    let half_width_dps = 1e-3;
    for seed in 0..3 {
        let mut random = Random::new(seed);
        let degc = [triangle(ROWS / 2), triangle(ROWS / 2)].concat();
        let rate: Vec<f64> = (0..ROWS)
            .map(|k| 100.0 * (0.17 * k as f64 + 0.05).sin())
            .collect();
        let output = degc.iter().zip(&rate).map(|(t, r)| {
            let through = (r.abs() - half_width_dps).max(0.0) * r.signum();
            let u = t / 35.0 - 1.0;
            through + 0.3 - 0.2 * u + half_width_dps / 3.0 * random.normal()
        });
        let columns = BTreeMap::from([
            ("rate_out_dps".to_owned(), output.collect()),
            ("rate_dps".to_owned(), rate.clone()),
            ("die_degc".to_owned(), degc.clone()),
        ]);
        let time_s: Vec<f64> = (0..ROWS).map(|k| 10.0 * k as f64).collect();
        let c = Channels::new(&time_s, &columns, "die_degc", |t| t).unwrap();
        let search = Search::new(&c, &c.split().unwrap(), Effort::default(), Vec::new());
        let found = search.run().unwrap();
        let names: Vec<String> = found.terms.iter().map(Step::id).collect();
        assert_eq!(names, ["output_deadband"], "{seed}");
        let estimate = search.estimates(&search.model(&found.terms).unwrap());
        let reported = found.terms[0].candidate.report(&c, &estimate[0]);
        let ratio = reported["half_width_dps"].0 / half_width_dps;
        assert!((ratio - 1.0).abs() < 0.1, "{seed}: {ratio}");
        assert_eq!(reported["subtracts"].0, 1.0);
    }
}

#[test]
fn a_hard_dead_band_is_found_where_a_sweep_passes_its_edge_row_by_row() {
    for (seed, half_dps) in [(1, 0.174), (2, 0.071), (3, 0.22)] {
        let (rows, mut random) = (1800, Random::new(seed));
        let degc = [triangle(rows / 2), triangle(rows / 2)].concat();
        let rate = |k: usize| 0.27 * (k as f64 / 61.0).sin();
        let passed = |o: f64| if o.abs() <= half_dps { 0.0 } else { o };
        let output =
            (0..rows).map(|k| 0.3 - 0.01 * degc[k] + passed(rate(k)) + 0.005 * random.normal());
        let columns = BTreeMap::from([
            ("rate_out_dps".to_owned(), output.collect()),
            ("rate_dps".to_owned(), (0..rows).map(rate).collect()),
            ("die_degc".to_owned(), degc.clone()),
        ]);
        let time_s: Vec<f64> = (0..rows).map(|k| 10.0 * k as f64).collect();
        let c = Channels::new(&time_s, &columns, "die_degc", |t| t).unwrap();
        let search = Search::new(&c, &c.split().unwrap(), Effort::default(), Vec::new());
        let found = search.run().unwrap();
        let names: Vec<String> = found.terms.iter().map(|t| t.id()).collect();
        assert_eq!(
            (names, found.left),
            (vec!["output_deadband".to_owned()], None)
        );
        let found_dps = found.terms[0].point.theta[0].exp();
        assert!(
            (found_dps - half_dps).abs() < 0.002,
            "{found_dps} {half_dps}"
        );
    }
}
