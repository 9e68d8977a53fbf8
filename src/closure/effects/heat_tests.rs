//! Lags of records that begin before the gyro is soaked.

use super::*;
use crate::closure::search::{Effort, Search, Term as Step};
use crate::closure::synthetic::{Random, triangle};
use std::collections::BTreeMap;

const ROWS: usize = 400;
const TAU_S: f64 = 200.0;

/// Names and the first one's parameters, of a record whose bias follows a temperature that lags and is `behind_k`
/// lower at the start than the thermometer's, 0.04 deg/s a kelvin.
fn lagging(seed: u64, behind_k: f64) -> (Vec<String>, Reported) {
    let mut random = Random::new(seed);
    let degc = [triangle(ROWS / 2), triangle(ROWS / 2)].concat();
    let time_s: Vec<f64> = (0..ROWS).map(|k| 20.0 * k as f64).collect();
    let late = lag(&time_s, &degc, TAU_S);
    let output = (0..ROWS).map(|k| {
        let late = late[k] - behind_k * (-time_s[k] / TAU_S).exp();
        0.3 - 0.01 * degc[k] + 0.04 * (degc[k] - late) + 0.01 * random.normal()
    });
    let columns = BTreeMap::from([
        ("rate_out_dps".to_owned(), output.collect()),
        ("die_degc".to_owned(), degc.clone()),
    ]);
    let c = Channels::new(&time_s, &columns, "die_degc", |t| t).unwrap();
    let search = Search::new(&c, &c.split().unwrap(), Effort::default(), Vec::new());
    let found = search.run().unwrap();
    let model = search.model(&found.terms).unwrap();
    let estimates = search.estimates(&model);
    let first = found.terms.first().zip(estimates.first());
    let reported = first.map(|(term, estimate)| term.candidate.report(&c, estimate));
    (
        found.terms.iter().map(Step::id).collect(),
        reported.unwrap_or_default(),
    )
}

#[test]
fn a_record_that_begins_before_the_gyro_is_soaked_is_a_lag_alone() {
    for (seed, behind_k) in [(0, 12.0), (1, -12.0), (2, 40.0), (3, 0.0)] {
        let (names, reported) = lagging(seed, behind_k);
        assert_eq!(names, ["thermal_lag"], "{behind_k}");
        let (tau_s, std_s) = reported["tau_s"];
        assert!((tau_s - TAU_S).abs() < 4.0 * std_s + 10.0, "{reported:?}");
        let found_k = reported.get("start_behind_k").copied();
        match found_k {
            Some((found_k, std_k)) => {
                assert!((found_k - behind_k).abs() < 4.0 * std_k, "{reported:?}");
            }
            None => assert!(behind_k.abs() < 1.0, "{reported:?}"),
        }
    }
}
