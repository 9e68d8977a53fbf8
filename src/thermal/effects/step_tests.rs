//! A bias that steps at a temperature, closed: where the firmware's relay switches.

use super::{Bias, Candidate, Point, at_jumps};
use crate::correction::Term;
use crate::design::reader;
use crate::statistics::blocks::Role;
use crate::thermal::channels::Channels;
use crate::thermal::close::close;
use crate::thermal::effects::Reported;
use crate::thermal::search::{Effort, Search};
use crate::thermal::synthetic;
use crate::thermal::synthetic::Random;
use std::collections::BTreeMap;

/// Held-out error of the firmware over the model's, and the relay's centre (degC) and gap (K): stairs of 5 K, up and
/// down twice, each of twelve rows and one on the way to the next, 3.3 K up or 1.4 K down; the bias is 0.4 deg/s higher above `at_degc`; noise of
/// 0.01 deg/s and of `read_k` in the thermometer.
fn relayed(at_degc: f64, read_k: f64) -> (f64, f64, f64) {
    let mut random = Random::new(12);
    let stairs = 13;
    let course = (0..4 * stairs * 13).map(|k| {
        let (stair, row) = (k / 13, k % 13);
        let level = |stair: usize| {
            let way = stair % (2 * stairs);
            5.0 * way.min(2 * stairs - way) as f64
        };
        let way = level(stair + 1) - level(stair);
        let share = if way > 0.0 { 0.66 } else { 0.28 };
        level(stair) + way * if row == 12 { share } else { 0.0 }
    });
    let course: Vec<f64> = course.collect();
    let output: Vec<f64> = course
        .iter()
        .map(|t| {
            let jump = if *t > at_degc { 0.4 } else { 0.0 };
            2.0 - 0.05 * t + jump + 0.01 * random.normal()
        })
        .collect();
    let read: Vec<f64> = course
        .iter()
        .map(|t| t + read_k * random.normal())
        .collect();
    let record = synthetic::record("die_degc", &read, &output);
    let design = reader::read(None).unwrap();
    let closed = close(&record, Vec::new(), &design, "test", Effort::default()).unwrap();
    let names: Vec<&str> = closed
        .closure
        .steps
        .iter()
        .map(|s| s.effect.as_str())
        .collect();
    assert_eq!(names, ["stress_jump"], "{at_degc}, {read_k}");
    let ratio = closed.closure.firmware.heldout_rms.unwrap() / closed.closure.after.heldout_rms;
    let plan = &closed.correction.as_ref().unwrap().plan;
    let relay = plan.terms.iter().find_map(|t| match t {
        Term::Step { centre, gap, .. } => Some((*centre, *gap)),
        _ => None,
    });
    let (centre, gap) = relay.unwrap();
    let input = &plan.inputs[0];
    (
        ratio,
        input.offset + input.scale * centre,
        input.scale * gap,
    )
}

#[test]
fn the_relay_switches_where_the_readings_are_and_not_where_their_smooth_course_is() {
    // Between the rows on the way up, at 33.3 degC, and on the way down, at 33.6, which lie nearer to the stair that
    // comes before or after them in the smooth course.
    let (ratio, centre, gap) = relayed(33.45, 0.01);
    assert!(ratio < 1.02, "{ratio}, {centre} degC, {gap} K");
    assert!((33.25..33.65).contains(&centre), "{centre} degC, {gap} K");
}

#[test]
fn a_relay_at_a_noisy_stair_does_not_chatter() {
    let (ratio, centre, gap) = relayed(34.9, 0.15);
    assert!(ratio < 1.1, "{ratio}, {centre} degC, {gap} K");
}

/// Parameters of a step of 0.4 deg/s, the only name; from `least_degc` up and down to 42 degC three times
/// and to 70 four times: the bias goes up at 45 and comes back at 25, if it gets there.
fn stepped(seed: u64, least_degc: f64) -> Reported {
    let mut random = Random::new(seed);
    let rows = 420;
    let degc: Vec<f64> = (0..rows)
        .map(|k| {
            let way = (k % 60) as f64 / 30.0;
            let most_degc = if k < 180 { 42.0 } else { 70.0 };
            least_degc + (most_degc - least_degc) * way.min(2.0 - way)
        })
        .collect();
    let (names, reported) = switched(&mut random, &degc, 0.4, false);
    assert_eq!(names, ["stress_jump"], "{seed}, {least_degc}");
    reported
}

/// What a course of temperature says of a step of so much, deg/s, up at 45 and down at 25 degC, that begins up or not: the names and
/// the parameters of the first.
fn switched(
    random: &mut Random,
    degc: &[f64],
    step_dps: f64,
    mut up: bool,
) -> (Vec<String>, Reported) {
    let output = degc.iter().map(|t| {
        up = *t > 45.0 || up && *t > 25.0;
        2.0 - 0.05 * t + if up { step_dps } else { 0.0 } + 0.01 * random.normal()
    });
    let columns = BTreeMap::from([
        ("rate_out_dps".to_owned(), output.collect()),
        ("die_degc".to_owned(), degc.to_vec()),
    ]);
    let time_s: Vec<f64> = (0..degc.len()).map(|k| 10.0 * k as f64).collect();
    let c = Channels::new(&time_s, &columns, "die_degc", |t| t).unwrap();
    let search = Search::new(&c, &c.split().unwrap(), Effort::default(), Vec::new());
    let found = search.run().unwrap();
    let names = found.terms.iter().map(|t| t.id()).collect();
    let estimate = search.estimates(&search.model(&found.terms).unwrap());
    let reported = found.terms[0].candidate.report(&c, &estimate[0]);
    (names, reported)
}

#[test]
fn of_a_step_once_and_a_hysteresis_that_do_equally_well_the_law_is_taken() {
    for seed in 0..3 {
        // Never below 30 degC again: whether it would have come back nothing says.
        let open = stepped(seed, 30.0);
        assert!(!open.contains_key("returns"), "{seed}: {open:?}");
        let (centre, gap) = (open["temperature_degc"].0, open["hysteresis_k"].0);
        let (up, down) = (centre + 0.5 * gap, centre - 0.5 * gap);
        assert!(
            (43.0..47.0).contains(&up) && down < 30.5,
            "{seed}: {open:?}"
        );
        // It came back.
        let shown = stepped(seed, 10.0);
        let gap = shown["hysteresis_k"].0;
        assert!((18.0..22.0).contains(&gap), "{seed}: {shown:?}");
    }
}

#[test]
fn a_step_by_and_by_is_a_step_with_a_width() {
    for (seed, width_k) in [(0, 1.0), (1, 3.0), (2, 4.5)] {
        let (rows, mut random) = (600, Random::new(seed));
        let degc = [synthetic::triangle(rows / 2), synthetic::triangle(rows / 2)].concat();
        let output = degc.iter().map(|t| {
            let spread = 1.0 / (1.0 + (-2.0 * (t - 30.0) / width_k).exp());
            0.3 - 0.01 * t + 0.3 * spread + 0.01 * random.normal()
        });
        let columns = BTreeMap::from([
            ("rate_out_dps".to_owned(), output.collect()),
            ("die_degc".to_owned(), degc.clone()),
        ]);
        let time_s: Vec<f64> = (0..rows).map(|k| 10.0 * k as f64).collect();
        let c = Channels::new(&time_s, &columns, "die_degc", |t| t).unwrap();
        let search = Search::new(&c, &c.split().unwrap(), Effort::default(), Vec::new());
        let found = search.run().unwrap();
        let names: Vec<String> = found.terms.iter().map(|t| t.id()).collect();
        assert_eq!(
            (names, found.left),
            (vec!["stress_jump".to_owned()], None),
            "{width_k}"
        );
        let model = search.model(&found.terms).unwrap();
        let estimate = &search.estimates(&model)[0];
        let reported: Reported = found.terms[0].candidate.report(&c, estimate);
        for (name, value) in [
            ("temperature_degc", 30.0),
            ("width_k", width_k),
            ("height_dps", 0.3),
        ] {
            let (found, std) = reported[name];
            assert!(
                (found - value).abs() < 4.0 * std + 0.02 * value,
                "{width_k} {reported:?}"
            );
        }
    }
}

/// Two slow heatings of many rows with noise in the thermometer, whose bias steps by 3 deg/s at 18 degC down and 24 degC up.
fn dense(seed: u64) -> Channels {
    let (rows, mut random) = (3600, Random::new(seed));
    let degc: Vec<f64> = [synthetic::triangle(rows / 2), synthetic::triangle(rows / 2)].concat();
    let mut above = false;
    let output = degc.iter().map(|t| {
        above = *t > if above { 18.0 } else { 24.0 };
        0.3 - 0.01 * t + 3.0 * f64::from(u8::from(above)) + 0.05 * random.normal()
    });
    let columns = BTreeMap::from([
        ("rate_out_dps".to_owned(), output.collect()),
        ("die_degc".to_owned(), degc.clone()),
    ]);
    let time_s: Vec<f64> = (0..rows).map(|k| 2.0 * k as f64).collect();
    Channels::new(&time_s, &columns, "die_degc", |t| t).unwrap()
}

#[test]
fn a_loop_switches_at_the_row_where_the_error_jumps() {
    for seed in 0..3 {
        let c = dense(seed);
        let split = c.split().unwrap();
        let places = at_jumps(&c, &split.rows(Role::Fit));
        let is_loop = |p: &&Point| p.form == 1 && (p.theta[1] - 6.0 / 35.0).abs() < 1e-2;
        assert!(places.iter().any(|p| is_loop(&p)), "{seed}: {places:?}");
        let found = Search::new(&c, &split, Effort::default(), Vec::new()).run();
        let found = found.unwrap();
        let names: Vec<String> = found.terms.iter().map(|t| t.id()).collect();
        assert_eq!(
            (names, found.left),
            (vec!["stress_jump".to_owned()], None),
            "{seed}"
        );
        // No place is taken from rows that are held out.
        assert!(
            at_jumps(&c, &vec![false; c.len()])
                .iter()
                .all(|p| p.form != 1)
        );
    }
}

/// The same of triangles between 0 and 60 degC, from row `first_row` of one on, with a step of 0.1 deg/s that begins up.
fn begun(seed: u64, first_row: usize) -> (Vec<String>, Reported) {
    let degc: Vec<f64> = (0..480)
        .map(|k| {
            let way = ((k + first_row) % 120) as f64 / 60.0;
            60.0 * way.min(2.0 - way)
        })
        .collect();
    switched(&mut Random::new(seed), &degc, 0.1, true)
}

#[test]
fn a_record_that_begins_within_the_gap_begins_on_either_side() {
    for seed in 0..3 {
        // At 30 degC, nearer to where it is down, but it has not come back yet.
        let (names, reported) = begun(seed, 30);
        assert_eq!(names, ["stress_jump"], "{seed}");
        assert_eq!(reported["begins_warm"].0, 1.0, "{seed} {reported:?}");
        // At 40 degC and falling: the usual guess.
        let (names, reported) = begun(seed, 80);
        assert_eq!(names, ["stress_jump"], "{seed}");
        assert!(!reported.contains_key("begins_warm"), "{seed}");
    }
}

#[test]
fn thresholds_are_open_between_the_readings_that_are_seen() {
    let degc: Vec<f64> = synthetic::triangle(200);
    let columns = BTreeMap::from([
        ("rate_out_dps".to_owned(), vec![0.0; 200]),
        ("die_degc".to_owned(), degc),
    ]);
    let time_s: Vec<f64> = (0..200).map(|k| 10.0 * k as f64).collect();
    let c = Channels::new(&time_s, &columns, "die_degc", |t| t).unwrap();
    let search = Search::new(&c, &c.split().unwrap(), Effort::default(), Vec::new());
    let is_it = |k: &&std::sync::Arc<dyn Candidate>| k.id() == "stress_jump";
    let jump = search.candidates().iter().find(is_it).unwrap();
    // Rows around the way up over 0.1 are not seen.
    let seen: Vec<bool> = (0..200).map(|k| !(50..60).contains(&k)).collect();
    let point = Point::at(1, &[0.0, 0.2]);
    let column = |point: &Point| jump.columns(&c, &Bias::default(), point).remove(0);
    let own = column(&point);
    let open = jump.open(&c, &point, &seen);
    assert_eq!(open.len(), 4);
    let mut apart = 0;
    for other in &open {
        let other = column(other);
        let pairs = own.iter().zip(&other).zip(&seen);
        assert!(pairs.clone().all(|((a, b), seen)| a == b || !seen));
        apart += pairs.filter(|((a, b), _)| a != b).count();
    }
    assert!(apart >= 8, "{apart}");
    // A step at one temperature may come back at another one that was not seen, and a spread one has no threshold.
    let sharp = jump.open(&c, &Point::at(0, &[0.0]), &seen);
    assert_eq!(sharp.len(), 6);
    assert!(sharp.iter().any(|p| p.form == 1 && p.theta[1] > 0.05));
    assert!(jump.open(&c, &Point::at(3, &[0.0, -2.0]), &seen).is_empty());
}
