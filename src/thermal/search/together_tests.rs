//! Causes that show beside each other only.

use crate::thermal::channels::Channels;
use crate::thermal::search::{Effort, Found, Search};
use crate::thermal::synthetic::{Random, triangle};
use std::collections::BTreeMap;
use std::f64::consts::TAU;

const ROWS: usize = 420;
const NOISE_DPS: f64 = 0.02;

fn found(columns: Vec<(&str, Vec<f64>)>) -> (Vec<String>, Option<String>) {
    let columns: BTreeMap<String, Vec<f64>> = columns
        .into_iter()
        .map(|(name, values)| (name.to_owned(), values))
        .collect();
    let time_s: Vec<f64> = (0..ROWS).map(|k| 60.0 * k as f64).collect();
    let c = Channels::new(&time_s, &columns, "die_degc", |t| t).unwrap();
    let search = Search::new(&c, &c.split().unwrap(), Effort::default(), Vec::new());
    let Found { terms, left, .. } = search.run().unwrap();
    let mut names: Vec<String> = terms.iter().map(|t| t.id()).collect();
    names.sort();
    (names, left)
}

fn degc() -> Vec<f64> {
    [triangle(ROWS / 2), triangle(ROWS - ROWS / 2)].concat()
}

/// A walk of unit deviation.
fn walk(random: &mut Random) -> Vec<f64> {
    let mut sum = 0.0;
    let steps = (0..ROWS).map(|_| {
        sum += random.normal();
        sum
    });
    let walk: Vec<f64> = steps.collect();
    let mean = walk.iter().sum::<f64>() / ROWS as f64;
    let square = walk.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / ROWS as f64;
    walk.iter().map(|v| (v - mean) / square.sqrt()).collect()
}

#[test]
fn a_supply_that_wanders_and_ageing_are_found_though_each_alone_is_no_better_than_a_walk() {
    // A part of a period against a part of a line.
    for (seed, turn) in [(0, 0.637), (1, 0.262), (2, 0.637), (3, 0.262)] {
        let mut random = Random::new(seed);
        let degc = degc();
        let supply = |k: usize| (TAU * (0.8 * k as f64 / ROWS as f64 + turn)).sin();
        let output = (0..ROWS)
            .map(|k| {
                let ageing = 0.3 * k as f64 / ROWS as f64;
                0.3 - 0.01 * degc[k] - 0.085 * supply(k) + ageing + NOISE_DPS * random.normal()
            })
            .collect();
        let supply = (0..ROWS).map(|k| 5.0 + 0.05 * supply(k)).collect();
        let (names, left) = found(vec![
            ("rate_out_dps", output),
            ("die_degc", degc),
            ("supply_v", supply),
        ]);
        assert_eq!(names, ["ageing_drift", "supply_sensitivity"], "{seed}");
        assert_eq!(left, None, "{seed}");
    }
}

#[test]
fn a_walk_of_the_rate_beside_a_walk_of_the_supply_has_no_name() {
    for seed in 0..12 {
        let mut random = Random::new(100 + seed);
        let (degc, supply, rate) = (degc(), walk(&mut random), walk(&mut random));
        let output = (0..ROWS)
            .map(|k| 0.3 - 0.01 * degc[k] + 0.1 * rate[k] + NOISE_DPS * random.normal())
            .collect();
        let supply = supply.iter().map(|v| 5.0 + 0.05 * v).collect();
        let columns = vec![
            ("rate_out_dps", output),
            ("die_degc", degc),
            ("supply_v", supply),
        ];
        assert_eq!(found(columns).0, Vec::<String>::new(), "{seed}");
    }
}

#[test]
fn what_a_clip_holds_back_is_no_part_of_another_effect() {
    for seed in 0..3 {
        let mut random = Random::new(200 + seed);
        let degc = degc();
        // Two fifths of the rows are clipped, before the noise.
        let agc: Vec<f64> = walk(&mut random).iter().map(|v| 1.0 + 0.02 * v).collect();
        let rate: Vec<f64> = (0..ROWS)
            .map(|k| [0.0, 60.0, -60.0, 110.0, -130.0][k / 2 % 5])
            .collect();
        let output = (0..ROWS)
            .map(|k| {
                let total = rate[k] + 0.3 - 0.01 * degc[k] + 8.0 * (agc[k] - 1.0);
                total.clamp(-100.0, 90.0) + NOISE_DPS * random.normal()
            })
            .collect();
        let (names, left) = found(vec![
            ("rate_out_dps", output),
            ("rate_dps", rate),
            ("die_degc", degc),
            ("agc", agc),
        ]);
        assert_eq!(names, ["damping_bias", "output_saturation"], "{seed}");
        assert_eq!(left, None, "{seed}");
    }
}

#[test]
fn a_scale_factor_that_is_off_in_one_direction_is_an_asymmetry_alone() {
    for (seed, sign) in [(0, 1.0), (1, -1.0)] {
        let mut random = Random::new(300 + seed);
        let degc = degc();
        let rate: Vec<f64> = (0..ROWS)
            .map(|k| [0.0, 40.0, -40.0, 90.0, -90.0][k / 3 % 5])
            .collect();
        let output = (0..ROWS)
            .map(|k| {
                let off = 2e-3 * f64::max(sign * rate[k], 0.0);
                rate[k] + 0.3 - 0.01 * degc[k] + off + NOISE_DPS * random.normal()
            })
            .collect();
        let columns = vec![
            ("rate_out_dps", output),
            ("rate_dps", rate),
            ("die_degc", degc),
        ];
        assert_eq!(found(columns).0, ["scale_factor_asymmetry"], "{sign}");
    }
}

#[test]
fn a_third_order_and_ageing_are_a_pair_where_the_temperature_goes_one_way() {
    let (rows, noise_dps) = (270, 0.016);
    let mut found_both = 0;
    for seed in 0..8 {
        let mut random = Random::new(400 + seed);
        // Fast, slowly, fast again.
        let u: Vec<f64> = (0..rows)
            .map(|k| 2.0 * k as f64 / rows as f64 - 1.0)
            .map(|x| 0.35 * x + 0.65 * x.powi(3))
            .collect();
        let output = (0..rows).map(|k| {
            let (u, t) = (u[k], k as f64 / rows as f64);
            -1.0 + 0.2 * u + 0.1 * u * u - 0.27 * u.powi(3) - 0.48 * t + noise_dps * random.normal()
        });
        let columns = BTreeMap::from([
            ("rate_out_dps".to_owned(), output.collect::<Vec<f64>>()),
            (
                "die_degc".to_owned(),
                u.iter().map(|u| 45.0 + 20.0 * u).collect(),
            ),
        ]);
        let time_s: Vec<f64> = (0..rows).map(|k| 15.0 * k as f64).collect();
        let c = Channels::new(&time_s, &columns, "die_degc", |t| t).unwrap();
        let search = Search::new(&c, &c.split().unwrap(), Effort::default(), Vec::new());
        let found = search.run().unwrap();
        let mut names: Vec<String> = found.terms.iter().map(|t| t.id()).collect();
        names.sort();
        found_both += usize::from(names == ["ageing_drift", "bias_third_order"]);
    }
    assert!(found_both >= 6, "{found_both}");
}

#[test]
fn an_odd_row_at_each_of_two_jumps_hides_no_large_effect() {
    for seed in 0..3 {
        let mut random = Random::new(500 + seed);
        let degc = degc();
        let at = |k: usize| 6.6 * (k % 81) as f64 / 81.0 - 3.2;
        let quadrature: Vec<f64> = walk(&mut random).iter().map(|w| 20.0 + 3.0 * w).collect();
        // Two readings of the acceleration are means over a jump, of which the output is no function.
        let mean = |k: usize| [80, 323].contains(&k);
        let accel = |k: usize| match mean(k) {
            true => 0.25 * at(k) + 0.75 * at(k + 1),
            false => at(k),
        };
        let output = (0..ROWS).map(|k| {
            let after = at(k + usize::from(mean(k)));
            let square = 0.25 * at(k) * at(k) + 0.75 * after * after;
            let drift = 1.5e-4 * (degc[k] - 35.0) * quadrature[k];
            0.3 - 0.01 * degc[k] - 0.0137 * square + drift + 0.006 * random.normal()
        });
        let (names, left) = found(vec![
            ("rate_out_dps", output.collect()),
            ("die_degc", degc.clone()),
            ("accel_g", (0..ROWS).map(accel).collect()),
            ("quad_dps", quadrature.clone()),
        ]);
        assert_eq!(
            names,
            ["demod_phase_drift", "g_squared_sensitivity"],
            "{seed}"
        );
        assert_eq!(left, None, "{seed}");
    }
}
