//! A drift and a warm-up, each called what it is.

use super::*;
use crate::thermal::search::{Effort, Search, Term as Step};
use crate::thermal::synthetic::{Random, triangle};
use std::collections::BTreeMap;

const ROWS: usize = 300;

/// Names of a record of two heatings, and the first one's parameters; `on_s`: since power-on; `added`, deg/s, in each row.
fn named_at(
    seed: u64,
    time_s: &[f64],
    on_s: Vec<f64>,
    added: impl Fn(usize) -> f64,
) -> (Vec<String>, Reported) {
    let mut random = Random::new(seed);
    let degc = [triangle(ROWS / 2), triangle(ROWS / 2)].concat();
    let output = degc.iter().enumerate().map(|(k, degc)| {
        let u = degc / 35.0 - 1.0;
        2.0 - 1.5 * u + 0.7 * u * u + added(k) + 0.01 * random.normal()
    });
    let columns = BTreeMap::from([
        ("rate_out_dps".to_owned(), output.collect()),
        ("time_since_power_on_s".to_owned(), on_s),
        ("die_degc".to_owned(), degc.clone()),
    ]);
    let c = Channels::new(time_s, &columns, "die_degc", |t| t).unwrap();
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

/// The same with one power-on; `added`, deg/s, at a time, s.
fn named(seed: u64, added: impl Fn(f64) -> f64) -> (Vec<String>, Reported) {
    let time_s: Vec<f64> = (0..ROWS).map(|k| 10.0 * k as f64).collect();
    named_at(seed, &time_s, time_s.clone(), |k| added(time_s[k]))
}

#[test]
fn a_straight_drift_over_one_power_on_is_no_warm_up() {
    for (seed, dps) in [(0, 0.2), (1, -0.3), (2, 0.5), (3, -2.0), (4, 10.0)] {
        let (names, reported) = named(seed, |t| dps * t / 3000.0);
        assert_eq!(names, ["ageing_drift"], "{seed}, {dps}");
        let ratio = reported["drift_dps_per_h"].0 / (1.2 * dps);
        assert!((ratio - 1.0).abs() < 0.1, "{seed}, {dps}: {ratio}");
    }
}

#[test]
fn a_warm_up_that_ends_while_the_power_is_on_keeps_its_name() {
    for tau_s in [300.0, 1000.0] {
        let (names, reported) = named(5, |t| 0.5 * (-t / tau_s).exp());
        assert_eq!(names, ["warmup_transient"], "{tau_s}");
        let ratio = reported["tau_s"].0 / tau_s;
        assert!((ratio - 1.0).abs() < 0.1, "{tau_s}: {ratio}");
    }
}

#[test]
fn no_warm_up_takes_longer_than_the_power_is_on() {
    let columns = BTreeMap::from([
        ("rate_out_dps".to_owned(), vec![0.0; 4]),
        (
            "time_since_power_on_s".to_owned(),
            vec![50.0, 60.0, 0.0, 10.0],
        ),
        ("die_degc".to_owned(), vec![0.0, 1.0, 2.0, 3.0]),
    ]);
    let time_s = [0.0, 10.0, 20.0, 30.0];
    let c = Channels::new(&time_s, &columns, "die_degc", |t| t).unwrap();
    for (tau_s, due_s) in [(20.0, 20.0), (59.0, 59.0), (1e6, 60.0)] {
        let point = Point::at(0, &[f64::ln(tau_s)]);
        assert!((warm_s(&c, &point) - due_s).abs() < 1e-9, "{tau_s}");
        let column = Warmup.columns(&c, &Bias::default(), &point).remove(0);
        assert!((column[0] - (-50.0 / due_s).exp()).abs() < 1e-12, "{tau_s}");
    }
}

/// What the time since power-on counts from is said where the record does not tell it.
#[test]
fn the_equation_says_what_is_taken_as_power_on() {
    let time_s = [0.0, 10.0, 20.0, 30.0];
    let equation = |on_s: Option<Vec<f64>>| {
        let mut columns = BTreeMap::from([
            ("rate_out_dps".to_owned(), vec![0.0; 4]),
            ("die_degc".to_owned(), vec![0.0, 1.0, 2.0, 3.0]),
        ]);
        columns.extend(on_s.map(|on_s| ("time_since_power_on_s".to_owned(), on_s)));
        let c = Channels::new(&time_s, &columns, "die_degc", |t| t).unwrap();
        Warmup.equation(&c, &Point::at(0, &[f64::ln(20.0)]))
    };
    assert!(equation(None).contains("time_s = 0 is taken as power-on"));
    assert!(!equation(Some(vec![50.0, 60.0, 70.0, 80.0])).contains("time_s = 0"));
}

/// The same with four power-ons of 750 s, each after a rest; `start` of each.
fn restarted(seed: u64, rest_s: [f64; 3], start: [f64; 4]) -> (Vec<String>, Reported) {
    let on_s = |k: usize| 10.0 * (k % 75) as f64;
    let since: Vec<f64> = (0..4).map(|k| rest_s.iter().take(k).sum::<f64>()).collect();
    let time_s: Vec<f64> = (0..ROWS).map(|k| 10.0 * k as f64 + since[k / 75]).collect();
    let transient = |k: usize| 0.3 * start[k / 75] * (-on_s(k) / 150.0).exp();
    named_at(seed, &time_s, (0..ROWS).map(on_s).collect(), transient)
}

#[test]
fn a_warm_up_after_a_short_rest_starts_smaller() {
    // Cooling with 100 s: what is left of a warm-up that is over.
    let rest_s = [30.0, 200.0, 60.0];
    let start = |rest_s: f64| 1.0 - (-rest_s / 100.0).exp();
    let starts = [1.0, start(30.0), start(200.0), start(60.0)];
    for seed in 0..3 {
        let (names, reported) = restarted(seed, rest_s, starts);
        assert_eq!(names, ["warmup_transient"], "{seed}");
        let (cooling_s, std_s) = reported["cooling_tau_s"];
        assert!(
            (cooling_s - 100.0).abs() < 4.0 * std_s + 10.0,
            "{reported:?}"
        );
        // After any rest the same: no cooling is asked for.
        let (names, reported) = restarted(seed, rest_s, [1.0; 4]);
        assert_eq!(names, ["warmup_transient"], "{seed}");
        assert!(!reported.contains_key("cooling_tau_s"), "{reported:?}");
    }
}

#[test]
fn a_warm_up_at_the_pace_of_the_rows_is_doubted() {
    let time_s: Vec<f64> = (0..ROWS).map(|k| 10.0 * k as f64).collect();
    let columns = BTreeMap::from([
        ("rate_out_dps".to_owned(), vec![0.0; ROWS]),
        (
            "die_degc".to_owned(),
            [triangle(ROWS / 2), triangle(ROWS / 2)].concat(),
        ),
    ]);
    let c = Channels::new(&time_s, &columns, "die_degc", |t| t).unwrap();
    let odds = |tau_s: f64| Warmup.odds_against(&c, &Point::at(0, &[tau_s.ln()]));
    assert_eq!([odds(40.0), odds(400.0)], [0.0, 0.0]);
    // A factor of e is two of what is unusual.
    let faster = odds(40.0 / 1f64.exp());
    assert!((faster - 2.0 * UNUSUAL).abs() < 1e-9, "{faster}");
}
