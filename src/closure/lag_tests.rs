//! A part of the bias that lags, closed: what firmware makes of it.

use super::channels::lag;
use super::close::{Closed, close};
use super::search::{Effort, Search};
use super::synthetic::{self, Random, triangle};
use crate::correction::Term;
use crate::design::reader;
use std::ops::Range;

const ROWS: usize = 600;
const TAU_S: f64 = 60.0;

/// deg/s at a temperature, degC.
fn bias_dps(degc: f64) -> f64 {
    let u = degc / 35.0 - 1.0;
    8.0 - 3.0 * u + 1.0 * u * u
}

/// Four heatings, `share` of the bias follows with its lag; noise of 0.01 deg/s, no power in these rows.
fn closed(share: f64, without_power: &[Range<usize>]) -> Closed {
    let mut random = Random::new(8);
    let degc: Vec<f64> = [triangle(ROWS / 4), triangle(ROWS / 4)].concat().repeat(2);
    let time_s: Vec<f64> = (0..ROWS).map(|k| k as f64).collect();
    let now: Vec<f64> = degc.iter().map(|t| bias_dps(*t)).collect();
    let late = lag(&time_s, &now, TAU_S);
    let output: Vec<f64> = now
        .iter()
        .zip(&late)
        .map(|(now, late)| now + share * (now - late) + 0.01 * random.normal())
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
    let design = reader::read(None).unwrap();
    close(&record, Vec::new(), &design, "test", Effort::default()).unwrap()
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

#[test]
fn a_lag_of_nearly_the_whole_bias_is_the_same_in_firmware_and_its_gain_is_looked_at() {
    let closed = closed(0.9, &[]);
    let step = &closed.closure.steps[0];
    assert_eq!(step.effect, "thermal_lag");
    assert!(step.parameters.contains_key("share_of_bias"), "{step:?}");
    let ratio = firmware_over_float(&closed);
    assert!(ratio < 1.02, "{ratio}");
    let effort = Effort::default();
    let search = Search::new(&closed.channels, &closed.split, effort, Vec::new());
    let constancy = search.constancy(&closed.after, &closed.after.terms[0]);
    assert!(constancy.is_some());
}

#[test]
fn a_lag_larger_than_the_bias_is_the_only_name() {
    for share in [1.7, 4.0] {
        let closed = closed(share, &[]);
        let steps = closed.closure.steps.iter();
        let names: Vec<&str> = steps.map(|s| s.effect.as_str()).collect();
        assert_eq!(names, ["thermal_lag"], "{share}");
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
        let closed = closed(0.3, &off);
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
    let closed = closed(0.3, &[]);
    assert!(lags(&closed).iter().all(|kept| !kept));
    let mut said = closed.closure.warnings.iter();
    assert!(said.all(|w| w.code != "firmware_needs_clock"));
}
