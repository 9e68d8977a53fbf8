//! A bias that steps at a temperature, closed: where the firmware's relay switches.

use crate::closure::close::close;
use crate::closure::search::Effort;
use crate::closure::synthetic::{self, Random};
use crate::correction::Term;
use crate::design::reader;

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
