//! The curve of a lag after a jump, beside the lag of the same curve.

use super::sample::{evaluate, plan as random, record};
use super::*;

const PERIOD_S: f64 = 2.0;
const TAU_S: f64 = 60.0;
const GAIN_DPS: f64 = 3.0;
/// Neither straight nor of one direction between the ends of the jump.
const KNOTS: [f64; 5] = [0.4, -1.0, 0.5, 0.8, -0.3];
/// x before the jump and after it.
const JUMP: (f64, f64) = (-0.8, 0.9);

fn curve_of_lag(kept: bool) -> Term {
    Term::CurveOfLag {
        gain_dps: GAIN_DPS,
        input: 0,
        values: KNOTS.to_vec(),
        tau_s: TAU_S,
        kept,
    }
}

fn lag_of_curve() -> Term {
    Term::LagOfCurve {
        gain_dps: GAIN_DPS,
        input: 0,
        values: KNOTS.to_vec(),
        tau_s: TAU_S,
        kept: false,
    }
}

fn plan(terms: Vec<Term>) -> Plan {
    let x = Input {
        column: "phase_rad".into(),
        offset: 1.0,
        scale: 0.5,
    };
    Plan {
        period_s: PERIOD_S,
        inputs: vec![x],
        full_scale_dps: 500.0,
        terms,
    }
}

/// x of the first `before` readings, then the other; no rate. Reading `restart` is one after power-on.
fn jump(rows: usize, before: usize, restart: usize) -> Vec<Reading> {
    let at = |n: usize| Reading {
        time_s: PERIOD_S * n as f64,
        time_since_power_on_s: Some(PERIOD_S * (n - if n < restart { 0 } else { restart }) as f64),
        inputs: vec![1.0 + 0.5 * if n < before { JUMP.0 } else { JUMP.1 }],
        rate_out_dps: 0.0,
    };
    (0..rows).map(at).collect()
}

fn c(x: f64) -> f64 {
    let u = (x + 1.0) * 2.0;
    let k = (u as usize).min(KNOTS.len() - 2);
    KNOTS[k] + (KNOTS[k + 1] - KNOTS[k]) * (u - k as f64)
}

/// What is left of a jump `after` readings later: its own period is a ramp.
fn left(after: usize) -> f64 {
    let h = PERIOD_S / TAU_S;
    (1.0 - (-h).exp()) / h * (-h * after as f64).exp()
}

#[test]
fn after_a_jump_the_curve_of_a_lag_runs_along_the_curve_and_a_lag_of_it_straight_there() {
    const BEFORE: usize = 5;
    const RESTART: usize = 30;
    let readings = jump(120, BEFORE, RESTART);
    let y = |n: usize| match n < BEFORE {
        true => JUMP.0,
        false => JUMP.1 - (JUMP.1 - JUMP.0) * left(n - BEFORE),
    };
    let x = |n: usize| if n < BEFORE { JUMP.0 } else { JUMP.1 };
    let along = |n: usize| -GAIN_DPS * (c(x(n)) - c(y(n)));
    let along_anew = |n: usize| if n < RESTART { along(n) } else { 0.0 };
    let straight = |n: usize| match (BEFORE..RESTART).contains(&n) {
        true => -GAIN_DPS * (c(JUMP.1) - c(JUMP.0)) * left(n - BEFORE),
        false => 0.0,
    };
    let due: [(Term, &dyn Fn(usize) -> f64); 3] = [
        (curve_of_lag(true), &along),
        (curve_of_lag(false), &along_anew),
        (lag_of_curve(), &straight),
    ];
    for (term, due) in due {
        let correction = Correction::auto(&plan(vec![term.clone()])).unwrap();
        let bound = correction.bound_dps();
        assert!(bound < 2e-4, "{term:?}: {bound}");
        for got in [correction.run(&readings), correction.run_float(&readings)] {
            for (n, got) in got.iter().enumerate() {
                let far = (got - due(n)).abs();
                assert!(far <= bound, "{term:?}, reading {n}: {got}, not {}", due(n));
            }
        }
    }
    // The two are told apart: the curve is passed on the way.
    let apart = (BEFORE..RESTART).map(|n| (along(n) - straight(n)).abs());
    assert!(apart.fold(0.0, f64::max) > 1.0);
}

#[test]
fn curves_of_lags_alone_stay_within_their_bound_and_use_it() {
    let (mut worst, mut count) = (0.0f64, 0);
    for seed in 0..40 {
        let mut plan = random(seed, 1 + seed as usize % 4, false);
        plan.terms.retain(|t| matches!(t, Term::CurveOfLag { .. }));
        let correction = Correction::auto(&plan).unwrap();
        let readings = record(&plan, 600, seed);
        let due = evaluate(&plan, 0, &readings);
        let bound = correction.bound_dps();
        for got in [correction.run(&readings), correction.run_float(&readings)] {
            let far = got.iter().zip(&due).map(|(a, b)| (a - b).abs());
            let share = far.fold(0.0, f64::max) / bound;
            assert!(share <= 1.0, "plan {seed}: {share} of {bound}");
            worst = worst.max(share);
        }
        count += usize::from(!plan.terms.is_empty());
    }
    assert!(count > 20, "{count}");
    // With no other term beside them, nothing hides an error of theirs.
    assert!(worst > 0.4, "{worst}");
}

#[test]
fn at_rest_the_curve_of_a_lag_is_exactly_nothing() {
    let correction = Correction::auto(&plan(vec![curve_of_lag(false)])).unwrap();
    let got = correction.run(&jump(3000, 5, usize::MAX));
    assert!(got[10] != 0.0);
    // What rounding leaves in this state is less than half an LSB of the word that the curve reads.
    assert_eq!(got[2500..], [0.0; 500]);
}

#[test]
fn both_readings_of_a_curve_share_its_table_and_the_terms_are_counted_together() {
    let correction = Correction::auto(&plan(vec![curve_of_lag(true)])).unwrap();
    assert_eq!(correction.trace().tables.len(), 1);
    let refused = |terms: Vec<Term>| plan(terms).check().unwrap_err().to_string();
    let mixed = |with: Term| [vec![with; 4], vec![curve_of_lag(false); 5]].concat();
    let lag = Term::Lag {
        gain_dps: 1.0,
        input: 0,
        tau_s: TAU_S,
        kept: false,
    };
    let e = refused(mixed(lag));
    assert!(e.contains("`lag and lag_of_curve and curve_of_lag`"), "{e}");
    let curve = Term::Curve {
        input: 0,
        values_dps: KNOTS.to_vec(),
    };
    let e = refused(mixed(curve));
    assert!(
        e.contains("`lag_of_curve and curve_of_lag and curve`"),
        "{e}"
    );
    let mut flat = curve_of_lag(false);
    if let Term::CurveOfLag { values, .. } = &mut flat {
        values.truncate(1);
    }
    assert!(refused(vec![flat]).contains("knots"));
}
