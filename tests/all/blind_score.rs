//! The scorer of blind records against answers whose marks are known beforehand.

use crate::blind::linear::rms;
use crate::blind::score::{self, Mark};
use crate::blind::tally::{self, figures, of_class};
use crate::blind::{BlindRecord, CLASSES, Class, Scenario, Truth, dump, make};
use serde_json::{Value, json};

/// An answer in the contract's form with these steps; figures of a perfect fit.
fn answer(steps: &[(&str, &[&str])], left: bool) -> Value {
    let verdict = match (steps.is_empty(), left) {
        (true, false) => "complete",
        (false, false) => "explained",
        (false, true) => "partly_explained",
        (true, true) => "unexplained",
    };
    let steps: Vec<Value> = steps
        .iter()
        .map(|(effect, like)| json!({"effect": effect, "indistinguishable_from": like}))
        .collect();
    json!({
        "schema": "gyrogen.closure/1", "verdict": verdict, "unit": "deg/s", "noise_floor_rms": 0.1,
        "before": {"heldout_rms": 1.0}, "after": {"heldout_rms": 0.5}, "steps": steps,
        "firmware": {"compensable": true, "heldout_rms": 0.505},
        "residual_structure": {"left": left, "strongest_channel": Value::Null},
    })
}

/// What somebody who knows the truth would answer.
fn perfect(t: &Truth) -> Value {
    let steps: Vec<(&str, &[&str])> = t.effects.iter().map(|e| (e.as_str(), &[][..])).collect();
    let left = matches!(
        t.class,
        Class::Outside | Class::HiddenChannel | Class::NoiseOnly
    );
    let mut v = answer(&steps, left);
    v["residual_structure"]["strongest_channel"] = json!(t.outside_channel);
    v
}

/// Four of each class.
fn records() -> Vec<BlindRecord> {
    dump::bank(4, 40).iter().map(|(_, s)| make(s)).collect()
}

/// Every fifth block of rows.
fn heldout(r: &BlindRecord) -> Vec<bool> {
    let n = r.truth.reading.len();
    (0..n).map(|k| (k * 20 / n) % 5 == 2).collect()
}

/// The only mark of one record.
fn mark(r: &BlindRecord, v: &Value) -> Mark {
    score::score(r, v, &[])
}

#[test]
fn the_truth_gets_full_marks_and_silence_none() {
    let records = records();
    let marks: Vec<Mark> = records
        .iter()
        .map(|r| mark(r, &perfect(&r.truth)))
        .collect();
    assert!(marks.iter().all(|m| m.violations.is_empty()), "{marks:?}");
    for class in CLASSES {
        let f = figures(&of_class(&marks, class));
        for full in [f.right, f.recall, f.precision, f.admitted]
            .into_iter()
            .flatten()
        {
            assert_eq!(full, 100.0, "{class:?} {f:?}");
        }
        assert!(f.false_discoveries.unwrap_or(0.0) + f.confident_wrong.unwrap_or(0.0) == 0.0);
        assert_eq!((f.worse, f.violations), (0, 0));
    }
    let silent: Vec<Mark> = records
        .iter()
        .map(|r| mark(r, &answer(&[], false)))
        .collect();
    for class in [
        Class::Single,
        Class::Pair,
        Class::Triple,
        Class::Covariate,
        Class::Confounded,
    ] {
        let f = figures(&of_class(&silent, class));
        assert_eq!(f.recall, Some(0.0), "{class:?}");
        assert_eq!(f.right.unwrap_or(0.0), 0.0);
        assert_eq!(f.precision, None);
    }
    assert_eq!(
        figures(&of_class(&silent, Class::Outside)).admitted,
        Some(0.0)
    );
    assert_eq!(
        figures(&of_class(&silent, Class::None)).false_discoveries,
        Some(0.0)
    );
}

#[test]
fn a_name_for_everything_is_a_discovery_everywhere() {
    let same = answer(&[("periodic_pickup", &[])], false);
    let marks: Vec<Mark> = records().iter().map(|r| mark(r, &same)).collect();
    for class in [
        Class::None,
        Class::NoiseOnly,
        Class::HiddenChannel,
        Class::Unexcited,
    ] {
        assert_eq!(
            figures(&of_class(&marks, class)).false_discoveries,
            Some(100.0),
            "{class:?}"
        );
    }
    assert_eq!(
        figures(&of_class(&marks, Class::Outside)).confident_wrong,
        Some(100.0)
    );
    let table = tally::table(&marks);
    assert_eq!(table.lines().count(), 2 + CLASSES.len(), "{table}");
    assert!(tally::confusion(&marks).contains("periodic_pickup x"));
    // With the word that more is left it is no confident name.
    let hedged = answer(&[("periodic_pickup", &[])], true);
    let outside: Vec<Mark> = records()
        .iter()
        .filter(|r| r.truth.class == Class::Outside)
        .map(|r| mark(r, &hedged))
        .collect();
    assert!(outside.iter().all(|m| !m.confident_wrong));
}

#[test]
fn half_of_a_pair_is_half_the_recall() {
    let r = make(&Scenario::drawn(Class::Pair, 9));
    let (a, b) = (r.truth.effects[0].as_str(), r.truth.effects[1].as_str());
    let m = mark(&r, &answer(&[(a, &[])], true));
    assert_eq!((m.wanted, m.found, m.named, m.rightly), (2, 1, 1, 1));
    let m = mark(
        &r,
        &answer(&[(a, &[]), (b, &[]), ("covariate:nobody", &[])], true),
    );
    assert_eq!((m.wanted, m.found, m.named, m.rightly), (2, 2, 3, 2));
}

#[test]
fn a_listed_truth_counts_only_where_it_is_inseparable() {
    let r = make(&Scenario::drawn(Class::Confounded, 3));
    let (own, other) = (
        r.truth.alternatives[0].0.as_str(),
        r.truth.alternatives[0].1.as_str(),
    );
    assert_eq!(
        mark(&r, &answer(&[(other, &[own])], false)).right,
        Some(true)
    );
    assert_eq!(mark(&r, &answer(&[(other, &[])], false)).right, Some(false));
    let r = make(&Scenario::single("supply_sensitivity", 3));
    let hedged = answer(&[("g_sensitivity", &["supply_sensitivity"])], false);
    assert_eq!(mark(&r, &hedged).right, Some(false));
}

#[test]
fn broken_answers_are_seen() {
    let r = make(&Scenario::drawn(Class::None, 1));
    let good = answer(&[], false);
    assert!(mark(&r, &good).violations.is_empty());
    for (key, bad) in [
        ("schema", json!("other")),
        ("verdict", json!("explained")),
        ("steps", Value::Null),
        ("noise_floor_rms", Value::Null),
        ("residual_structure", json!({})),
        ("before", json!({})),
    ] {
        let mut v = good.clone();
        v[key] = bad;
        assert_eq!(mark(&r, &v).violations.len(), 1, "{key}");
    }
    let five = answer(&[("thermal_lag", &["a", "b", "c", "d", "e"])], false);
    assert_eq!(mark(&r, &five).violations.len(), 1);
    assert_eq!(score::score(&r, &good, &[true]).violations.len(), 1);
    let crash = |_: &str| Err("panicked".to_owned());
    let marks = tally::run(&[Scenario::drawn(Class::Single, 1)], crash);
    assert_eq!(figures(&[&marks[0]]).violations, 1);
    assert_eq!(marks[0].right, Some(false));
}

#[test]
fn the_oracle_is_at_the_noise_and_others_are_measured_by_it() {
    let mut ratios = Vec::new();
    for r in records()
        .iter()
        .filter(|r| r.truth.class != Class::Unexcited)
    {
        let held = heldout(r);
        let oracle = score::oracle_rms(r, &held);
        let noise: Vec<f64> = (0..held.len())
            .filter(|k| held[*k])
            .map(|k| r.truth.noise_dps[k])
            .collect();
        ratios.push(oracle / rms(&noise));
        let mut v = perfect(&r.truth);
        v["after"]["heldout_rms"] = json!(1.5 * oracle);
        v["before"]["heldout_rms"] = json!(1.2 * oracle);
        v["firmware"]["heldout_rms"] = json!(3.0 * oracle);
        let m = score::score(r, &v, &held);
        assert!((m.over_oracle.expect("marked") - 1.5).abs() < 1e-12);
        assert!((m.after_over_before.expect("both") - 1.25).abs() < 1e-12);
        assert!((m.firmware_over_float.expect("both") - 2.0).abs() < 1e-12);
        let f = figures(&[&m]);
        assert_eq!(f.worse, 1);
    }
    let median = tally::quantile(&ratios, 0.5).expect("some");
    assert!((0.97..1.06).contains(&median), "{median}");
    assert_eq!(tally::quantile(&[3.0, 1.0, 2.0, 4.0], 0.5), Some(2.0));
    assert_eq!(tally::quantile(&[], 0.5), None);
}
