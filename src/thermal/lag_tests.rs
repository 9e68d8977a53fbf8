//! A part of the bias that lags, closed: what firmware makes of it.

use super::channels::lag;
use super::close::{Closed, close};
use super::search::{Effort, Search};
use super::synthetic::{self, Random, triangle};
use crate::correction::Term;
use crate::design::reader;
use crate::record::ThermalRecord;
use crate::verdict::Step;
use std::ops::Range;

const ROWS: usize = 600;
const TAU_S: f64 = 60.0;

/// A part of the bias: deg/s, and deg/s per unit of u and of its square.
type Curve = [f64; 3];

const BIAS: Curve = [8.0, -3.0, 1.0];

fn at(curve: Curve, degc: f64) -> f64 {
    let u = degc / 35.0 - 1.0;
    curve[0] + curve[1] * u + curve[2] * u * u
}

/// A share of the whole bias.
fn of_bias(share: f64) -> Curve {
    BIAS.map(|b| share * b)
}

fn closed_record(record: &ThermalRecord) -> Closed {
    let design = reader::read(None).unwrap();
    close(record, Vec::new(), &design, "test", Effort::default()).unwrap()
}

/// Four heatings; `late` is a part of the bias that follows a temperature which lags; noise of 0.01 deg/s, no power
/// in these rows.
fn closed(late: Curve, without_power: &[Range<usize>]) -> Closed {
    let mut random = Random::new(8);
    let degc: Vec<f64> = [triangle(ROWS / 4), triangle(ROWS / 4)].concat().repeat(2);
    let time_s: Vec<f64> = (0..ROWS).map(|k| k as f64).collect();
    let behind = lag(&time_s, &degc, TAU_S);
    let output: Vec<f64> = degc
        .iter()
        .zip(&behind)
        .map(|(t, l)| at(BIAS, *t) + at(late, *t) - at(late, *l) + 0.01 * random.normal())
        .collect();
    let mut record = synthetic::record("die_degc", &degc, &output);
    if !without_power.is_empty() {
        let on = |k: usize| {
            let ends = without_power.iter().map(|off| off.end);
            ends.filter(|end| *end <= k).max().unwrap_or(0)
        };
        let on_s = (0..ROWS).map(|k| (k - on(k)) as f64).collect();
        let name = "time_since_power_on_s".to_owned();
        record.columns.insert(name, on_s);
        let logged = |k: &usize| without_power.iter().all(|off| !off.contains(k));
        let kept = |column: &Vec<f64>| (0..ROWS).filter(logged).map(|k| column[k]).collect();
        record.time_s = kept(&record.time_s);
        for column in record.columns.values_mut() {
            *column = kept(column);
        }
    }
    closed_record(&record)
}

fn firmware_over_float(closed: &Closed) -> f64 {
    let fixed = closed.closure.firmware.heldout_rms;
    let fixed = fixed.unwrap_or_else(|| panic!("{:?}", closed.closure.warnings));
    fixed / closed.closure.after.heldout_rms
}

fn lags(closed: &Closed) -> Vec<bool> {
    let plan = &closed.correction.as_ref().unwrap().plan;
    let kept = |term: &Term| match term {
        Term::Lag { kept, .. } | Term::LagOfCurve { kept, .. } | Term::CurveOfLag { kept, .. } => {
            Some(*kept)
        }
        _ => None,
    };
    plan.terms.iter().filter_map(kept).collect()
}

/// The only step, which has to be this one.
fn only(closed: &Closed) -> &Step {
    let steps = closed.closure.steps.iter();
    let names: Vec<&str> = steps.map(|s| s.effect.as_str()).collect();
    assert_eq!(names, ["thermal_lag"]);
    &closed.closure.steps[0]
}

/// Whether a parameter is what it is due to be, with its unit per K and a share that it may be off.
fn is(step: &Step, name: &str, due: f64, off: f64) {
    let found = step.parameters[name];
    assert!((found / due - 1.0).abs() < off, "{name}: {found} for {due}");
}

#[test]
fn what_lags_with_a_curve_has_a_gain_and_a_curvature_and_one_time_constant() {
    for late in [of_bias(0.9), [0.0, -2.0, -1.5], [0.0, 0.4, 2.5]] {
        let closed = closed(late, &[]);
        let step = only(&closed);
        is(step, "tau_s", TAU_S, 0.05);
        // In the middle of the readings.
        let u = closed.channels.middle_degc / 35.0 - 1.0;
        let due = (late[1] + 2.0 * late[2] * u) / 35.0;
        is(step, "gain_dps_per_k", due, 0.05);
        is(step, "curvature_dps_per_k2", late[2] / 35f64.powi(2), 0.05);
        is(step, "reference_degc", closed.channels.middle_degc, 0.01);
        let left = closed.closure.after.heldout_rms;
        assert!(left < 0.011, "{late:?}: {left}");
    }
}

#[test]
fn what_lags_in_proportion_has_no_curvature() {
    for gain_dps in [-2.0, 0.3] {
        let closed = closed([0.0, gain_dps, 0.0], &[]);
        let step = only(&closed);
        is(step, "tau_s", TAU_S, 0.05);
        is(step, "gain_dps_per_k", gain_dps / 35.0, 0.05);
        assert!(
            !["curvature_dps_per_k2", "reference_degc"]
                .iter()
                .any(|name| step.parameters.contains_key(*name)),
            "{step:?}"
        );
        assert!(firmware_over_float(&closed) < 1.02);
    }
}

#[test]
fn a_second_lag_is_worth_its_delay_only_where_the_thermometers_noise_shows() {
    // One slow heating and cooling, all of the bias behind by 20 s; a reading's noise makes 0.5 and 8 mdps beside 10.
    const SLOW_ROWS: usize = 1200;
    let time_s: Vec<f64> = (0..SLOW_ROWS).map(|k| k as f64).collect();
    let turn = |k: usize| std::f64::consts::TAU * k as f64 / SLOW_ROWS as f64;
    let degc: Vec<f64> = (0..SLOW_ROWS)
        .map(|k| 35.0 - 35.0 * turn(k).cos())
        .collect();
    for (noise_degc, lags_due) in [(0.02, 1), (0.3, 2)] {
        let mut random = Random::new(8);
        let late = lag(&time_s, &degc, 20.0);
        let output: Vec<f64> = late
            .iter()
            .map(|t| at([0.8, 0.5, -0.8], *t) + 0.01 * random.normal())
            .collect();
        let read: Vec<f64> = degc
            .iter()
            .map(|t| t + noise_degc * random.normal())
            .collect();
        let closed = closed_record(&synthetic::record("die_degc", &read, &output));
        only(&closed);
        assert_eq!(lags(&closed).len(), lags_due, "{noise_degc}");
    }
}

#[test]
fn firmware_bends_the_lagging_temperature_and_does_not_delay_the_curve() {
    for late in [of_bias(0.9), [0.0, 0.4, 2.5]] {
        let closed = closed(late, &[]);
        let ratio = firmware_over_float(&closed);
        assert!(ratio < 1.02, "{late:?}: {ratio}");
        let plan = &closed.correction.as_ref().unwrap().plan;
        let mut terms = plan.terms.iter();
        assert!(terms.any(|t| matches!(t, Term::CurveOfLag { .. })));
    }
}

#[test]
fn the_gain_of_a_lag_of_nearly_the_whole_bias_is_looked_at() {
    let closed = closed(of_bias(0.9), &[]);
    let effort = Effort::default();
    let search = Search::new(&closed.channels, &closed.split, effort, Vec::new());
    let constancy = search.constancy(&closed.after, &closed.after.terms[0]);
    assert!(constancy.is_some());
}

#[test]
fn a_lag_larger_than_the_bias_is_the_only_name() {
    for share in [1.7, 4.0] {
        let closed = closed(of_bias(share), &[]);
        only(&closed);
        // Noise of 0.01.
        let left = closed.closure.after.heldout_rms;
        assert!(left < 0.015, "{share}: {left}");
        assert!(firmware_over_float(&closed) < 1.02);
    }
}

#[test]
fn a_lag_that_restarts_do_not_interrupt_keeps_its_state_over_them() {
    // Interrupted, and off for half the lag and for all of it, in which the temperature goes on as before.
    for off in [
        [160..160, 300..300, 470..470],
        [160..190, 305..365, 470..475],
    ] {
        let closed = closed(of_bias(0.3), &off);
        assert_eq!(closed.closure.steps[0].effect, "thermal_lag");
        let kept = lags(&closed);
        assert!(!kept.is_empty() && kept.iter().all(|k| *k), "{kept:?}");
        let mut said = closed.closure.warnings.iter();
        assert!(said.any(|w| w.code == "firmware_needs_clock"));
        let ratio = firmware_over_float(&closed);
        assert!(ratio < 1.02, "{off:?}: {ratio}");
    }
}

#[test]
fn without_restarts_nothing_has_to_be_kept() {
    let closed = closed(of_bias(0.3), &[]);
    assert!(lags(&closed).iter().all(|kept| !kept));
    let mut said = closed.closure.warnings.iter();
    assert!(said.all(|w| w.code != "firmware_needs_clock"));
}

/// Two heatings whose slope is an error, seen by a thermometer with noise.
fn closed_rate(thermometer_noise_degc: f64) -> Closed {
    let mut random = Random::new(3);
    let degc: Vec<f64> = triangle(150).repeat(4);
    let slope = |k: usize| (degc[k.min(598) + 1] - degc[k.max(1) - 1]) / 2.0;
    let output: Vec<f64> = (0..ROWS)
        .map(|k| at(BIAS, degc[k]) + 0.2 * slope(k) + 0.01 * random.normal())
        .collect();
    let read: Vec<f64> = degc
        .iter()
        .map(|t| t + thermometer_noise_degc * random.normal())
        .collect();
    let record = synthetic::record("die_degc", &read, &output);
    closed_record(&record)
}

#[test]
fn firmware_that_leaves_more_than_the_model_says_so() {
    let said = |closed: &Closed| {
        let mut warnings = closed.closure.warnings.iter();
        warnings.any(|w| w.code == "firmware_behind")
    };
    let late = closed_rate(0.05);
    assert_eq!(late.closure.steps[0].effect, "temperature_rate");
    let ratio = firmware_over_float(&late);
    assert!(ratio > 1.05 && said(&late), "{ratio}");
    let lag = closed([0.0, -2.0, 0.0], &[]);
    assert!(firmware_over_float(&lag) < 1.02 && !said(&lag));
}

/// What a lag that was so far behind, degC, at the first row, or after a gap of 40 rows, is called.
fn names_of_a_lag_behind(first_degc: f64, after_gap_degc: f64) -> (Vec<String>, f64) {
    let (gap, gain) = (250..290, 0.004);
    let mut random = Random::new(3);
    let degc: Vec<f64> = [triangle(ROWS / 4), triangle(ROWS / 4)].concat().repeat(2);
    let time_s: Vec<f64> = (0..ROWS).map(|k| k as f64).collect();
    let late = lag(&time_s, &degc, TAU_S);
    let gone = |behind_degc: f64, since: usize, k: usize| match k >= since {
        true => behind_degc * (-((k - since) as f64) / TAU_S).exp(),
        false => 0.0,
    };
    let output: Vec<f64> = (0..ROWS)
        .map(|k| {
            let behind =
                degc[k] - late[k] + gone(first_degc, 0, k) + gone(after_gap_degc, gap.end, k);
            at(BIAS, degc[k]) + gain * behind + 0.01 * random.normal()
        })
        .collect();
    let mut record = synthetic::record("die_degc", &degc, &output);
    let kept = |column: &Vec<f64>| {
        let rows = (0..ROWS).filter(|k| !gap.contains(k));
        rows.map(|k| column[k]).collect()
    };
    record.time_s = kept(&record.time_s);
    for column in record.columns.values_mut() {
        *column = kept(column);
    }
    let closed = closed_record(&record);
    let steps = closed.closure.steps.iter();
    let names = steps.map(|s| s.effect.clone()).collect();
    (names, closed.closure.steps[0].parameters["tau_s"])
}

#[test]
fn how_far_a_lag_was_behind_before_the_record_or_a_gap_is_no_other_name() {
    for (first_degc, after_gap_degc) in [(25.0, 0.0), (0.0, -20.0), (-20.0, 15.0)] {
        let (names, tau_s) = names_of_a_lag_behind(first_degc, after_gap_degc);
        assert_eq!(names, ["thermal_lag"], "{first_degc} {after_gap_degc}");
        assert!(
            (tau_s / TAU_S - 1.0).abs() < 0.15,
            "{first_degc} {after_gap_degc}: {tau_s}"
        );
    }
    // Farther behind than the thermometer goes, no lag is: that is a warm-up.
    let (names, _) = names_of_a_lag_behind(400.0, 0.0);
    assert!(names.contains(&"warmup_transient".to_owned()), "{names:?}");
}
