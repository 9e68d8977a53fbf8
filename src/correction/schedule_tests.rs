//! When the correction steps.

use super::*;
use crate::correction::{Input, Term};

/// A step every 10 s.
fn plan(terms: Vec<Term>) -> Plan {
    Plan {
        period_s: 10.0,
        inputs: vec![Input {
            column: "phase_rad".into(),
            offset: 1.0,
            scale: 0.5,
        }],
        full_scale_dps: 500.0,
        terms,
    }
}

#[test]
fn steps_follow_the_clock() {
    let times = |times: &[f64]| -> Vec<Reading> {
        let at = |t: &f64| Reading {
            time_s: *t,
            time_since_power_on_s: None,
            inputs: vec![],
            rate_out_dps: 0.0,
        };
        times.iter().map(at).collect()
    };
    let counts = |t: &[f64]| -> Vec<(bool, u64)> {
        let steps = schedule(&plan(Vec::new()), &times(t));
        steps.iter().map(|s| (s.restart, s.count)).collect()
    };
    // Power-on, even, gap, late; a repeated time is a step that the next one saves.
    assert_eq!(
        counts(&[0.0, 10.0, 40.0, 51.0, 51.0, 71.0, 80.0]),
        [
            (true, 1),
            (false, 1),
            (false, 3),
            (false, 1),
            (false, 1),
            (false, 1),
            (false, 1)
        ]
    );
    // Twelve per cent late each time: after 25 readings, three more steps than readings.
    let late: Vec<f64> = (0..26).map(|n| 11.2 * f64::from(n)).collect();
    let total: u64 = counts(&late).iter().map(|(_, c)| c).sum();
    assert_eq!(total, 29);
    // The first reading 30 s after power-on; a restart; a gap beyond the most.
    assert_eq!(
        counts(&[30.0, 40.0, 5.0, 15.0, 1e9]),
        [
            (true, 4),
            (false, 1),
            (true, 2),
            (false, 1),
            (false, MOST_STEPS)
        ]
    );
}

#[test]
fn a_state_that_is_kept_goes_on_without_power() {
    let lag = |kept: bool| {
        plan(vec![Term::Lag {
            gain_dps: 1.0,
            input: 0,
            tau_s: 300.0,
            kept,
        }])
    };
    let rows = [
        (0.0, 0.0),
        (10.0, 10.0),
        (95.0, 5.0),
        (105.0, 15.0),
        (105.0, 0.0),
    ];
    let readings = rows.map(|(time_s, on_s)| Reading {
        time_s,
        time_since_power_on_s: Some(on_s),
        inputs: vec![0.0],
        rate_out_dps: 0.0,
    });
    let steps = |kept: bool| -> Vec<(u64, u64)> {
        let steps = schedule(&lag(kept), &readings);
        steps.iter().map(|s| (s.unpowered, s.count)).collect()
    };
    assert_eq!(steps(false), [(0, 1), (0, 1), (0, 2), (0, 1), (0, 1)]);
    // On again 80 s after the last reading: seven steps and the restart. At once: the restart alone.
    assert_eq!(steps(true), [(0, 1), (0, 1), (7, 2), (0, 1), (0, 1)]);
    let restarts: Vec<bool> = schedule(&lag(true), &readings)[2].restarts().collect();
    assert_eq!(restarts, [[false; 7].as_slice(), &[true, false]].concat());
    let long = [
        readings[1].clone(),
        Reading {
            time_s: 1e9,
            ..readings[0].clone()
        },
    ];
    assert_eq!(schedule(&lag(true), &long)[1].unpowered, MOST_STEPS);
}
