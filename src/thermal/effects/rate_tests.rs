//! A dead band that hardly any reading is within.

use super::*;
use crate::thermal::search::{Effort, Search, Term as Step};
use crate::thermal::synthetic::{Random, triangle};
use std::collections::BTreeMap;

const ROWS: usize = 300;

/// Names, what is left and the first step's report, of a scale factor with `slope_ppm` a kelvin and `bend_ppm` a kelvin squared about
/// 25 degC, and a supply that moves the output.
fn scaled(seed: u64, slope_ppm: f64, bend_ppm: f64) -> (Vec<String>, Option<String>, Reported) {
    let mut random = Random::new(seed);
    let degc = [triangle(ROWS), triangle(ROWS)].concat();
    let rows = 2 * ROWS;
    let rate = |k: usize| 50.0 * ((k / 5 * 7 % 9) as f64 - 4.0);
    let supply: Vec<f64> = (0..rows)
        .map(|k| 5.0 + 0.1 * ((k / 11 * 5 % 7) as f64 - 3.0))
        .collect();
    let output = (0..rows).map(|k| {
        let off = degc[k] - 25.0;
        let ppm = slope_ppm * off + bend_ppm * off * off;
        let bias = 0.3 - 0.01 * degc[k] + 0.2 * (supply[k] - 5.0);
        rate(k) * (1.0 + 1e-6 * ppm) + bias + 0.02 * random.normal()
    });
    let columns = BTreeMap::from([
        ("rate_out_dps".to_owned(), output.collect()),
        ("rate_dps".to_owned(), (0..rows).map(rate).collect()),
        ("supply_v".to_owned(), supply),
        ("die_degc".to_owned(), degc.clone()),
    ]);
    let time_s: Vec<f64> = (0..rows).map(|k| 10.0 * k as f64).collect();
    let c = Channels::new(&time_s, &columns, "die_degc", |t| t).unwrap();
    let search = Search::new(&c, &c.split().unwrap(), Effort::default(), Vec::new());
    let found = search.run().unwrap();
    let estimates = search.estimates(&search.model(&found.terms).unwrap());
    let reported = found.terms[0].candidate.report(&c, &estimates[0]);
    let mut names: Vec<String> = found.terms.iter().map(Step::id).collect();
    names.sort();
    (names, found.left, reported)
}

#[test]
fn a_bent_scale_factor_hides_no_other_effect() {
    let both = ["scale_factor_temperature", "supply_sensitivity"];
    for (seed, slope_ppm, bend_ppm) in [(1, 1200.0, -3.0), (2, -400.0, 4.0), (3, 50.0, 5.0)] {
        let (names, left, reported) = scaled(seed, slope_ppm, bend_ppm);
        assert_eq!(
            (names.as_slice(), left),
            (both.map(str::to_owned).as_slice(), None),
            "{seed}"
        );
        for (name, true_one) in [
            ("slope_ppm_per_k", slope_ppm),
            ("curvature_ppm_per_k2", bend_ppm),
        ] {
            let (value, std) = reported[name];
            assert!(
                (value - true_one).abs() < 4.0 * std + 0.01 * true_one.abs(),
                "{seed} {name}: {value}"
            );
        }
    }
    // One that is linear has no bend.
    for (seed, slope_ppm) in [(4, 1200.0), (5, 20.0), (6, -5.0)] {
        let (names, left, reported) = scaled(seed, slope_ppm, 0.0);
        assert_eq!(
            (names.as_slice(), left),
            (both.map(str::to_owned).as_slice(), None),
            "{seed}"
        );
        assert!(!reported.contains_key("curvature_ppm_per_k2"), "{seed}");
    }
}

#[test]
fn a_scale_is_nominal_at_the_root_next_to_the_lines() {
    assert_eq!(scale_zero(2.0, -1.0, 0.0), 0.5);
    for (slope, bend, zero) in [(2.0, 0.3, 0.4), (-3.0, 0.5, -0.2), (1.0, -0.8, 0.1)] {
        let constant = -(slope * zero + bend * zero * zero);
        assert!(
            (scale_zero(slope, constant, bend) - zero).abs() < 1e-12,
            "{zero}"
        );
    }
    // None at all: the line's.
    assert_eq!(scale_zero(1.0, 2.0, 5.0), -2.0);
}

#[test]
fn where_a_scale_is_nominal_is_as_uncertain_as_each_coefficient_makes_it() {
    for (beta, beta_std) in [
        ([2.0, -1.0, 0.0], [0.01, 0.03, 0.0]),
        ([-0.3, 0.9, 0.0], [0.004, 0.001, 0.0]),
        ([1.0, -0.4, 0.2], [0.002, 0.003, 0.004]),
    ] {
        let zero = |b: &[f64]| scale_zero(b[0], b[1], b[2]);
        let estimate = Estimate {
            beta: beta.to_vec(),
            beta_std: beta_std.to_vec(),
            point: Point::form(0),
            theta_std: Vec::new(),
        };
        let by = (0..3).map(|k| {
            let (mut above, mut below) = (beta, beta);
            above[k] += 1e-3 * beta_std[k];
            below[k] -= 1e-3 * beta_std[k];
            (zero(&above) - zero(&below)) / 2e-3
        });
        let std = by.map(|d| d * d).sum::<f64>().sqrt();
        let own = scale_zero_std(&estimate, zero(&beta));
        assert!((own / std - 1.0).abs() < 1e-4, "{own} {std}");
    }
}
