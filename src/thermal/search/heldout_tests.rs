//! Rows that no model explains, and errors without them.

use super::super::{Effort, Search, Term};
use crate::statistics::blocks::Role;
use crate::thermal::channels::Channels;
use crate::thermal::effects::Point;
use crate::thermal::synthetic::{Random, triangle};
use std::collections::BTreeMap;

/// Rms of the noise, deg/s.
const NOISE_DPS: f64 = 0.01;

/// Two heatings with a supply of two levels, which the output follows by three times the noise, and rows that are off by
/// thirty times.
fn channels(rows: usize, off: impl Fn(usize) -> bool) -> Channels {
    supplied(rows, 3.0, off)
}

/// The same where the output follows the supply by `gain` times the noise.
fn supplied(rows: usize, gain: f64, off: impl Fn(usize) -> bool) -> Channels {
    let mut random = Random::new(8);
    let degc = [triangle(rows / 2), triangle(rows - rows / 2)].concat();
    let supply: Vec<f64> = (0..rows)
        .map(|k| f64::from(u8::from(k / 7 % 2 == 1)))
        .collect();
    let output = (0..rows).map(|k| {
        let accident = if off(k) { 30.0 } else { 0.0 };
        0.3 - 0.002 * degc[k] + NOISE_DPS * (gain * supply[k] + accident + random.normal())
    });
    let columns = BTreeMap::from([
        ("rate_out_dps".to_owned(), output.collect()),
        ("supply_v".to_owned(), supply),
        ("die_degc".to_owned(), degc),
    ]);
    let time_s: Vec<f64> = (0..rows).map(|k| 10.0 * k as f64).collect();
    Channels::new(&time_s, &columns, "die_degc", |t| t).unwrap()
}

/// The rows that are accidents to the declared model and to the one with the supply, and the held-out rms of both, in units
/// of the noise.
fn judged(c: &Channels) -> (Vec<usize>, [f64; 2]) {
    let search = Search::new(c, &c.split().unwrap(), Effort::default(), Vec::new());
    let supply = search.candidates().iter();
    let supply = supply
        .clone()
        .find(|s| s.id() == "supply_sensitivity")
        .unwrap();
    let term = Term::new(supply.clone(), supply.points(c).remove(0));
    let (before, after) = (search.model(&[]).unwrap(), search.model(&[term]).unwrap());
    let accidents = search.accidents([&before, &after]).into_iter().enumerate();
    let rows = accidents.filter(|(_, a)| *a).map(|(row, _)| row).collect();
    let squares = search.heldout_squares([&before, &after]);
    (rows, squares.map(|s| s.sqrt() / NOISE_DPS))
}

#[test]
fn few_rows_that_stand_alone_are_accidents_and_the_rest_is_what_is_judged() {
    let c = channels(300, |k| k % 41 == 13);
    let (rows, [before, after]) = judged(&c);
    let due = [13, 54, 95, 136, 177, 218, 259];
    let roles = c.split().unwrap().roles;
    let seen = due.into_iter().filter(|row| roles[*row] != Role::Judge);
    assert_eq!(rows, seen.collect::<Vec<usize>>());
    assert!(rows.len() >= 5, "{rows:?}");
    assert!((0.85..1.15).contains(&after), "{after}");
    assert!((1.6..2.1).contains(&before), "{before}");
}

#[test]
fn rows_that_are_off_too_often_for_accidents_are_left() {
    let left = |every: usize| {
        let c = supplied(300, 0.0, |k| k % every == 3);
        let split = c.split().unwrap();
        let search = Search::new(&c, &split, Effort::default(), Vec::new());
        let found = search.run().unwrap();
        let riddled = search.riddled(&search.model(&found.terms).unwrap());
        let rows = split.roles.iter().enumerate();
        let off = rows.filter(|(k, role)| k % every == 3 && **role != Role::Judge);
        let all_of_them = riddled.map(|rows| rows.len() == off.count());
        (found.terms.len(), found.left, all_of_them)
    };
    assert_eq!(left(8), (0, Some("time_s".to_owned()), Some(true)));
    assert_eq!(left(12), (0, Some("time_s".to_owned()), Some(true)));
    assert!(left(40).2.is_none());
}

#[test]
fn what_stands_together_is_frequent_or_is_one_of_few_rows_is_no_accident() {
    let nothing: [usize; 0] = [];
    assert_eq!(
        judged(&channels(300, |k| (120..128).contains(&k))).0,
        nothing
    );
    assert_eq!(judged(&channels(300, |k| k % 11 == 3)).0, nothing);
    assert_eq!(judged(&channels(56, |k| k == 20)).0, nothing);
    assert_eq!(judged(&channels(76, |k| k == 17)).0, [17]);
}

#[test]
fn accidents_among_held_out_rows_do_not_take_a_name_back() {
    // In all of the first blocks that are held out, on the side that the supply is not on.
    let plain = channels(330, |_| false);
    let held = plain.split().unwrap().rows(Role::Choose);
    let off = |k: usize| held[k] && k % 14 == 3;
    assert!((3..16).contains(&(0..330).filter(|k| off(*k)).count()));
    let c = channels(330, off);
    let search = Search::new(&c, &c.split().unwrap(), Effort::default(), Vec::new());
    let found = search.run().unwrap();
    let names: Vec<String> = found.terms.iter().map(Term::id).collect();
    assert_eq!(
        (names, found.left),
        (vec!["supply_sensitivity".to_owned()], None)
    );
}

#[test]
fn a_row_on_the_wrong_side_of_a_step_is_the_models_error() {
    let (rows, mut random) = (300, Random::new(3));
    let degc = [triangle(rows / 2), triangle(rows / 2)].concat();
    let middle = degc.iter().sum::<f64>() / rows as f64;
    // The first crossing is a row late; a spike is as large, but far from there.
    let first = degc.iter().position(|t| *t > middle).unwrap();
    let spike = degc.iter().position(|t| *t > middle + 15.0).unwrap();
    let output = (0..rows).map(|k| {
        let step = f64::from(u8::from(degc[k] > middle && k != first));
        let off = step + f64::from(u8::from(k == spike));
        0.3 - 0.002 * degc[k] + NOISE_DPS * (30.0 * off + random.normal())
    });
    let columns = BTreeMap::from([
        ("rate_out_dps".to_owned(), output.collect()),
        ("die_degc".to_owned(), degc.clone()),
    ]);
    let time_s: Vec<f64> = (0..rows).map(|k| 10.0 * k as f64).collect();
    let c = Channels::new(&time_s, &columns, "die_degc", |t| t).unwrap();
    let search = Search::new(&c, &c.split().unwrap(), Effort::default(), Vec::new());
    let jump = search.candidates().iter();
    let jump = jump.clone().find(|s| s.id() == "stress_jump").unwrap();
    let at = (middle - c.middle_degc) / c.kelvin_per_u;
    let term = Term::new(jump.clone(), Point::at(0, &[at]));
    let model = search.model(&[term]).unwrap();
    let residual = model.residual(&c);
    for row in [first, spike] {
        assert!(
            residual[row].abs() > 20.0 * NOISE_DPS,
            "{row}: {residual:?}"
        );
    }
    let accidents = search.accidents([&model]);
    assert!(accidents[spike] && !accidents[first]);
}
