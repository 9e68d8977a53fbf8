//! Found names, with and without something left beside them.

use super::*;
use crate::statistics::blocks::Role;
use crate::thermal::channels::Channels;
use crate::thermal::search::Effort;
use crate::thermal::synthetic::{Random, triangle};
use std::collections::BTreeMap;

const ROWS: usize = 300;

/// Supply and acceleration, each switched in its own way.
fn switched(k: usize) -> [f64; 2] {
    [k / 11 % 3 == 1, k / 17 % 2 == 1].map(|on| f64::from(u8::from(on)))
}

/// Two heatings; the output has the supply times `supply` of the row and the acceleration times `g`, in units of
/// its noise.
fn channels(supply: impl Fn(usize) -> f64, g: f64) -> Channels {
    disturbed(supply, g, |_| 0.0)
}

/// The same with something else of the row.
fn disturbed(supply: impl Fn(usize) -> f64, g: f64, other: impl Fn(usize) -> f64) -> Channels {
    let mut random = Random::new(5);
    let degc = [triangle(ROWS / 2), triangle(ROWS / 2)].concat();
    let output = (0..ROWS).map(|k| {
        let [on, turned] = switched(k);
        let added = supply(k) * on + g * turned + other(k) + random.normal();
        0.3 - 0.2 * (degc[k] / 35.0 - 1.0) + 0.01 * added
    });
    let columns = BTreeMap::from([
        ("rate_out_dps".to_owned(), output.collect()),
        (
            "supply_v".to_owned(),
            (0..ROWS).map(|k| switched(k)[0]).collect(),
        ),
        (
            "accel_g".to_owned(),
            (0..ROWS).map(|k| switched(k)[1]).collect(),
        ),
        ("die_degc".to_owned(), degc),
    ]);
    let time_s: Vec<f64> = (0..ROWS).map(|k| 10.0 * k as f64).collect();
    Channels::new(&time_s, &columns, "die_degc", |t| t).unwrap()
}

/// What stays of both names, the supply's with a probability and rivals, and what becomes undecided.
fn kept(c: &Channels, p_value: f64, rivals: usize, left: bool) -> (Vec<String>, Vec<String>) {
    kept_of(c, [p_value, 1e-60], rivals, left)
}

fn kept_of(
    c: &Channels,
    p_values: [f64; 2],
    rivals: usize,
    left: bool,
) -> (Vec<String>, Vec<String>) {
    let search = Search::new(c, &c.split().unwrap(), Effort::default(), Vec::new());
    let term = |id: &str, p_value: f64, rivals: usize| {
        let candidate = search.candidates().iter().find(|c| c.id() == id);
        let candidate = candidate.unwrap().clone();
        let point = candidate.points(c).remove(0);
        Term {
            p_value,
            rivals: (0..rivals).map(|k| format!("rival {k}")).collect(),
            ..Term::new(candidate, point)
        }
    };
    let mut found = Found {
        terms: vec![
            term("supply_sensitivity", p_values[0], rivals),
            term("g_sensitivity", p_values[1], 0),
        ],
        left: left.then(|| "time_s".to_owned()),
        ..Found::default()
    };
    search.kept_alone(&mut found).unwrap();
    assert!(found.left.is_some() || !left);
    let ids = found.terms.iter().map(Term::id).collect();
    (ids, found.undecided)
}

const BOTH: [&str; 2] = ["supply_sensitivity", "g_sensitivity"];

#[test]
fn a_weak_name_stands_where_nothing_else_is_left() {
    let c = channels(|_| 4.0, 9.0);
    assert_eq!(kept(&c, 1e-3, 0, false).0, BOTH);
    assert_eq!(kept(&c, 1e-3, 0, true).0, BOTH[1..]);
    assert_eq!(kept(&c, 1e-7, 0, true).0, BOTH);
}

#[test]
fn a_gain_that_turns_over_is_no_law_where_more_is_left() {
    let turning = channels(|k| if k < ROWS / 3 { 8.0 } else { 1.0 }, 5.0);
    assert_eq!(kept(&turning, 1e-60, 0, false).0, BOTH);
    assert_eq!(kept(&turning, 1e-60, 0, true).0, BOTH[1..]);
}

#[test]
fn what_most_halves_do_not_show_is_not_named_where_more_is_left() {
    // Without anything of the supply its halves cannot select it, however small its probability was beside others.
    let without = channels(|_| 0.0, 5.0);
    assert_eq!(kept(&without, 1e-60, 0, true).0, BOTH[1..]);
}

#[test]
fn more_than_four_rivals_are_undecided() {
    let c = channels(|_| 4.0, 9.0);
    assert_eq!(
        kept(&c, 1e-60, 4, false),
        (BOTH.map(str::to_owned).to_vec(), Vec::new())
    );
    let (names, undecided) = kept(&c, 1e-60, 5, false);
    assert_eq!(names, BOTH[1..]);
    assert_eq!((undecided.len(), undecided[0].as_str()), (6, BOTH[0]));
}

#[test]
fn beside_slow_noise_a_name_needs_more() {
    // A sum of kicks of half the noise is some three times the noise over the record, one of four times it 24.
    let walk = |kick: f64| {
        let mut random = Random::new(9);
        let mut at = 0.0;
        let course: Vec<f64> = (0..ROWS)
            .map(|_| {
                at += kick * random.normal();
                at
            })
            .collect();
        disturbed(|_| 4.0, 5.0, |k| course[k])
    };
    for (kick, p_value, stays) in [
        (0.0, 9e-3, true),
        (0.5, 9e-3, false),
        (0.5, 1e-19, true),
        (4.0, 1e-19, false),
        (4.0, 1e-21, true),
    ] {
        let (names, _) = kept(&walk(kick), p_value, 0, false);
        assert_eq!(
            names.contains(&BOTH[0].to_owned()),
            stays,
            "{kick}, {p_value}"
        );
    }
}

#[test]
fn beside_something_larger_names_have_to_explain_a_good_part() {
    // A wander of ten times what both names explain, and one of less.
    for (size, p_value, names) in [(1.0, 1e-19, 2), (60.0, 1e-19, 0), (60.0, 1e-21, 2)] {
        let bump = |k: usize| size * (-((k as f64 - 140.0) / 60.0).powi(2)).exp();
        let c = disturbed(|_| 4.0, 5.0, bump);
        let (kept, _) = kept_of(&c, [p_value; 2], 0, true);
        assert_eq!(kept.len(), names, "{size}, {p_value}");
    }
}

#[test]
fn names_that_outweigh_what_is_known_of_the_rest_need_not_explain_most() {
    // Beside a wander of ten times what they explain, and a shape without a name that gains less than each, or more.
    for (strange, names) in [(28.0, 2), (60.0, 0)] {
        let bump = |k: usize| 60.0 * (-((k as f64 - 140.0) / 60.0).powi(2)).exp();
        let c = disturbed(|_| 4.0, 5.0, bump);
        let search = Search::new(&c, &c.split().unwrap(), Effort::default(), Vec::new());
        let term = |id: &str, p_value: f64, gain: f64| {
            let candidate = search.candidates().iter().find(|c| c.id() == id).unwrap();
            let point = candidate.points(&c).remove(0);
            Term {
                p_value,
                gain,
                ..Term::new(candidate.clone(), point)
            }
        };
        let stranger = term("outside:curve", 1e-9, strange);
        let mut found = Found {
            terms: BOTH.map(|id| term(id, 1e-15, 47.0)).to_vec(),
            strangers: vec![stranger],
            left: Some("time_s".to_owned()),
            ..Found::default()
        };
        search.kept_below(&mut found).unwrap();
        assert_eq!(found.terms.len(), names, "{strange}");
    }
}

#[test]
fn names_that_predict_worse_than_none_are_dropped() {
    // Its gain has the other sign in the rows that are held out.
    let c = channels(|_| 4.0, 5.0);
    let search_rows = c.split().unwrap().rows(Role::Choose);
    let against = channels(|k| if search_rows[k] { -9.0 } else { 4.0 }, 5.0);
    assert_eq!(kept(&against, 1e-60, 0, false).0, BOTH[1..]);
    // What was dropped is left, and the other name too weak beside it.
    assert!(kept_of(&against, [1e-60, 1e-3], 0, false).0.is_empty());
}

#[test]
fn of_few_rows_that_a_name_explains_what_is_left_is_no_slow_noise() {
    // Two staircases of the rate, a reading a level: a cubic of 20 times the noise, and of 7 times.
    for (rows, noise_dps) in [(22, 0.1), (22, 0.3), (30, 0.1), (30, 0.3)] {
        let mut random = Random::new(1);
        let rate: Vec<f64> = (0..rows).map(|k| 40.0 * (k % 11) as f64 - 200.0).collect();
        let output = rate
            .iter()
            .map(|r| r + 2.0 * (r / 200.0).powi(3) + noise_dps * random.normal());
        let columns = BTreeMap::from([
            ("rate_out_dps".to_owned(), output.collect()),
            ("rate_dps".to_owned(), rate.clone()),
            ("die_degc".to_owned(), vec![25.0; rows]),
        ]);
        let time_s: Vec<f64> = (0..rows).map(|k| 10.0 * k as f64).collect();
        let c = Channels::new(&time_s, &columns, "die_degc", |t| t).unwrap();
        let search = Search::new(&c, &c.split().unwrap(), Effort::default(), Vec::new());
        let found = search.run().unwrap();
        let names: Vec<String> = found.terms.iter().map(Term::id).collect();
        assert_eq!(names, ["scale_factor_nonlinearity"], "{rows}, {noise_dps}");
    }
}

#[test]
fn a_lag_that_only_the_first_hour_tells_from_a_rate_keeps_its_name_beside_slow_noise() {
    let (rows, tau_s, turn) = (2000, 300.0, std::f64::consts::TAU / 7000.0);
    for seed in 0..3 {
        let mut random = Random::new(seed);
        let time_s: Vec<f64> = (0..rows).map(|k| 10.0 * k as f64).collect();
        let degc: Vec<f64> = time_s
            .iter()
            .map(|t| 25.0 + 30.0 * (turn * t).sin())
            .collect();
        let (mut lagging, mut walk) = (25.0, 0.0);
        let output = time_s.iter().zip(&degc).map(|(t, degc)| {
            lagging += (degc - lagging) * (1.0 - f64::exp(-10.0 / tau_s));
            walk += 0.0005 * random.normal();
            let ageing = 0.05 * (t / 3000.0).ln_1p();
            0.3 - 0.01 * degc + 0.01 * (lagging - degc) + ageing + walk + 0.01 * random.normal()
        });
        let columns = BTreeMap::from([
            ("rate_out_dps".to_owned(), output.collect::<Vec<f64>>()),
            ("die_degc".to_owned(), degc.clone()),
        ]);
        let c = Channels::new(&time_s, &columns, "die_degc", |t| t).unwrap();
        let search = Search::new(&c, &c.split().unwrap(), Effort::default(), Vec::new());
        let found = search.run().unwrap();
        let names: Vec<String> = found.terms.iter().map(Term::id).collect();
        assert!(
            names.contains(&"thermal_lag".to_owned()),
            "{seed}: {names:?}"
        );
    }
}

#[test]
fn a_name_without_which_ten_times_as_much_is_left_needs_no_smaller_probability() {
    let kept = |supply: f64| kept(&channels(|_| supply, 30.0), 1e-4, 0, true).0;
    assert_eq!(kept(40.0), BOTH);
    // In a third of the rows: not quite five times.
    assert_eq!(kept(10.0), BOTH[1..]);
}
