//! Dead bands, beside a bias, in sweeps and in means over a swinging rate.

use super::*;
use crate::statistics::blocks::Role;
use crate::thermal::search::{Effort, Search, Term as Step};
use crate::thermal::synthetic::{Random, triangle};
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
fn a_small_dead_band_shows_beside_a_bias_that_goes_far_from_row_to_row() {
    for (seed, bias_dps) in [(1, 1.0), (2, 10.0), (3, 30.0)] {
        let mut random = Random::new(seed);
        let (rows, half_width_dps) = (400, 0.01);
        let degc: Vec<f64> = (0..rows).map(|_| 60.0 * random.uniform()).collect();
        let rate = |k: usize| 40.0 * (0.17 * k as f64 + 0.05).sin();
        let output = (0..rows).map(|k| {
            let through = (rate(k).abs() - half_width_dps).max(0.0) * rate(k).signum();
            let u = degc[k] / 30.0 - 1.0;
            through + bias_dps * (u + 0.3 * u * u) + 0.004 * random.normal()
        });
        let columns = BTreeMap::from([
            ("rate_out_dps".to_owned(), output.collect()),
            ("rate_dps".to_owned(), (0..rows).map(rate).collect()),
            ("die_degc".to_owned(), degc.clone()),
        ]);
        let time_s: Vec<f64> = (0..rows).map(|k| 20.0 * k as f64).collect();
        let c = Channels::new(&time_s, &columns, "die_degc", |t| t).unwrap();
        let search = Search::new(&c, &c.split().unwrap(), Effort::default(), Vec::new());
        let found = search.run().unwrap();
        let names: Vec<String> = found.terms.iter().map(Step::id).collect();
        assert_eq!(names, ["output_deadband"], "{bias_dps}");
        let width = found.terms[0].point.theta[0].exp();
        assert!((width - half_width_dps).abs() < 1e-3, "{bias_dps}: {width}");
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

/// Channels of a dead band that lets the full rate through beyond `half_dps`, at given rates.
fn banded(rates: &[f64], half_dps: f64, noise_dps: f64, seed: u64) -> Channels {
    let mut random = Random::new(seed);
    let rows = rates.len();
    let degc = [triangle(rows / 2), triangle(rows - rows / 2)].concat();
    let passed = |o: f64| if o.abs() <= half_dps { 0.0 } else { o };
    let pairs = degc.iter().zip(rates);
    let output = pairs.map(|(t, o)| 0.3 - 0.01 * t + passed(*o) + noise_dps * random.normal());
    let columns = BTreeMap::from([
        ("rate_out_dps".to_owned(), output.collect()),
        ("rate_dps".to_owned(), rates.to_vec()),
        ("die_degc".to_owned(), degc.clone()),
    ]);
    let time_s: Vec<f64> = (0..rows).map(|k| 10.0 * k as f64).collect();
    Channels::new(&time_s, &columns, "die_degc", |t| t).unwrap()
}

#[test]
fn a_few_rows_at_the_edge_of_a_dead_band_are_no_spikes_in_a_long_record_either() {
    // Fast sweeps through a narrow band: few rows near its edge, each far off where the edge is wrong.
    for (seed, half_dps) in [(1, 1.05), (2, 0.62), (3, 1.37), (4, 0.9)] {
        let rates: Vec<f64> = (0..1445)
            .map(|k| 7.3 * (k as f64 * 0.137 + seed as f64).sin())
            .collect();
        let c = banded(&rates, half_dps, 0.02, seed);
        let search = Search::new(&c, &c.split().unwrap(), Effort::default(), Vec::new());
        let found = search.run().unwrap();
        let names: Vec<String> = found.terms.iter().map(|t| t.id()).collect();
        assert_eq!(
            (names, found.left),
            (vec!["output_deadband".to_owned()], None),
            "{seed}"
        );
        // No fitted row is on the wrong side.
        let found_dps = found.terms[0].point.theta[0].exp();
        let wrong = |o: &f64| (o.abs() <= found_dps) != (o.abs() <= half_dps);
        let pairs = rates.iter().zip(&search.used);
        let off = pairs.filter(|(o, used)| **used && wrong(o)).count();
        assert_eq!(off, 0, "{seed}: {found_dps} {half_dps}");
    }
}

#[test]
fn a_dead_band_claims_no_more_than_fitted_rows_show_where_held_out_ones_contradict() {
    let half_dps = 0.15;
    // Rates within the band, just outside of it and far outside; those just outside in held-out rows alone.
    let far = |k: usize| [2.1, -1.7, 0.05, -2.3, 1.9, -0.06][k / 6 % 6];
    let rates: Vec<f64> = (0..600).map(far).collect();
    let held = banded(&rates, half_dps, 0.008, 5)
        .split()
        .unwrap()
        .rows(Role::Choose);
    let near = |(o, held): (&f64, &bool)| match *held {
        true => 2.0 * half_dps * o.signum(),
        false => *o,
    };
    let rates: Vec<f64> = rates.iter().zip(&held).map(near).collect();
    let c = banded(&rates, half_dps, 0.008, 5);
    let split = c.split().unwrap();
    let search = Search::new(&c, &split, Effort::default(), Vec::new());
    let contradicted =
        |i: usize| split.roles[i] == Role::Choose && (0.2..1.0).contains(&rates[i].abs());
    assert!((0..600).filter(|i| contradicted(*i)).count() > 50);
    let found = search.run().unwrap();
    let names: Vec<String> = found.terms.iter().map(|t| t.id()).collect();
    assert_eq!(names, ["output_deadband"]);
    let found_dps = found.terms[0].point.theta[0].exp();
    assert!((0.06..0.0601).contains(&found_dps), "{found_dps}");
}

#[test]
fn a_dead_band_is_found_in_means_over_a_rate_that_swings() {
    for (seed, half_dps, subtracts) in [(1, 0.06, true), (2, 0.05, true), (3, 4.0, false)] {
        let (rows, inner) = (400, 60);
        let mut random = Random::new(seed);
        let degc = [triangle(rows / 2), triangle(rows / 2)].concat();
        // Some six rows a swing, or twenty.
        let turn = if subtracts { 1.03 } else { 0.31 };
        let rate = |t: f64| 40.0 * (turn * t).sin();
        let passed = |o: f64| match (o.abs() <= half_dps, subtracts) {
            (true, _) => 0.0,
            (false, true) => o - half_dps * o.signum(),
            (false, false) => o,
        };
        let mean = |k: usize, f: &dyn Fn(f64) -> f64| -> f64 {
            let within = (0..inner).map(|i| k as f64 + (f64::from(i) + 0.5) / f64::from(inner));
            within.map(f).sum::<f64>() / f64::from(inner)
        };
        let output = (0..rows).map(|k| {
            let passed = mean(k, &|t| passed(rate(t)));
            0.3 - 0.01 * degc[k] + passed + 0.01 * random.normal()
        });
        let columns = BTreeMap::from([
            ("rate_out_dps".to_owned(), output.collect()),
            (
                "rate_dps".to_owned(),
                (0..rows).map(|k| mean(k, &rate)).collect(),
            ),
            ("die_degc".to_owned(), degc.clone()),
        ]);
        let time_s: Vec<f64> = (0..rows).map(|k| 20.0 * k as f64).collect();
        let c = Channels::new(&time_s, &columns, "die_degc", |t| t).unwrap();
        let search = Search::new(&c, &c.split().unwrap(), Effort::default(), Vec::new());
        let found = search.run().unwrap();
        let names: Vec<String> = found.terms.iter().map(|t| t.id()).collect();
        assert_eq!(names, ["output_deadband"], "{seed}");
        let found_dps = found.terms[0].point.theta[0].exp();
        assert!(
            (found_dps / half_dps - 1.0).abs() < 0.05,
            "{seed}: {found_dps}"
        );
    }
}
