//! `gyrogen close` on records whose cause only the bank knows (`blind`), and on the default's own run.
//!
//! `GYROGEN_CLOSE=N` tries N records of every class instead of a few, `GYROGEN_SEED=S` others.

use crate::blind::score::Mark;
use crate::blind::{Class, Scenario, tally};
use gyrogen::design::reader;
use gyrogen::thermal::close;
use gyrogen::thermal::search::Effort;
use serde_json::Value;
use std::path::Path;

fn number(name: &str) -> Option<u64> {
    std::env::var(name).ok().and_then(|v| v.parse().ok())
}

/// The library's answer to a record, and which rows it held out.
fn answer(csv: &str) -> Result<(Value, Vec<bool>), String> {
    let design = reader::read(None).map_err(|e| e.to_string())?;
    let path = Path::new("blind.csv");
    let read = gyrogen::record::thermal::parse(csv.as_bytes(), path, &design.record);
    let (record, warnings) = read.map_err(|e| e.to_string())?;
    let closed = close::close(&record, warnings, &design, "test", Effort::default());
    let closed = closed.map_err(|e| e.to_string())?;
    let value = serde_json::to_value(&closed.closure).map_err(|e| e.to_string())?;
    // Repeated rows are averaged in reading: then rows cannot be compared with the oracle's.
    let rows = csv.lines().filter(|l| !l.starts_with('#')).count() - 1;
    let heldout = closed.split.judging();
    Ok((
        value,
        if heldout.len() == rows {
            heldout
        } else {
            Vec::new()
        },
    ))
}

fn marks(classes: &[(Class, u64)]) -> Vec<Mark> {
    let base = number("GYROGEN_SEED").unwrap_or(20);
    let scenarios: Vec<Scenario> = classes
        .iter()
        .flat_map(|(class, few)| {
            let count = number("GYROGEN_CLOSE").unwrap_or(*few);
            (base..base + count).map(|seed| Scenario::drawn(*class, seed))
        })
        .collect();
    let marks = tally::run(&scenarios, answer);
    println!("{}\n{}", tally::table(&marks), tally::confusion(&marks));
    let broken: Vec<_> = marks.iter().flat_map(|m| &m.violations).collect();
    assert!(broken.is_empty(), "{broken:?}");
    marks
}

#[test]
fn effects_are_named_alone_and_in_company() {
    let marks = marks(&[(Class::Single, 16), (Class::Pair, 8), (Class::Covariate, 6)]);
    let of = |class| tally::figures(&tally::of_class(&marks, class));
    assert!(of(Class::Single).right >= Some(90.0));
    assert!(of(Class::Pair).recall >= Some(75.0) && of(Class::Pair).precision >= Some(85.0));
    assert!(of(Class::Covariate).right >= Some(80.0));
    for class in [Class::Single, Class::Covariate] {
        assert!(of(class).over_oracle_median <= Some(1.03));
        assert_eq!(of(class).worse, 0);
    }
}

#[test]
fn noise_and_what_is_hidden_get_no_name() {
    let marks = marks(&[
        (Class::None, 12),
        (Class::NoiseOnly, 8),
        (Class::Unexcited, 6),
        (Class::Outside, 8),
    ]);
    let of = |class| tally::figures(&tally::of_class(&marks, class));
    // One name in twenty-six may be chance; two are not.
    let named: usize = [Class::None, Class::NoiseOnly, Class::Unexcited]
        .iter()
        .map(|class| {
            let marks = tally::of_class(&marks, *class);
            marks.iter().filter(|m| m.false_discovery).count()
        })
        .sum();
    assert!(named <= 1, "{named} names for nothing");
    assert!(of(Class::Outside).confident_wrong <= Some(13.0));
}

/// Columns as an answer in JSON.
fn step<'a>(value: &'a Value, effect: &str) -> Option<&'a Value> {
    let steps = value["steps"].as_array()?;
    steps.iter().find(|s| s["effect"] == effect)
}

#[test]
fn the_default_gyro_hides_a_mode_crossing() {
    let design = reader::read(None).unwrap();
    let outcome = gyrogen::job::run(
        &design,
        None,
        "test",
        &[gyrogen::emit::views::Language::C],
        &|_| {},
    )
    .unwrap();
    let csv = outcome.parts.record_csv.unwrap();
    let (value, _) = answer(&csv).unwrap();
    let step = step(&value, "mode_crossing").expect("the crossing is named");
    // What `thermal_run` plants: 4.5 deg/s at 37.5 degC.
    let at = step["parameters"]["center_degc"].as_f64().unwrap();
    assert!((at - 37.5).abs() < 0.5, "{at}");
    let before = value["before"]["heldout_rms"].as_f64().unwrap();
    let after = value["after"]["heldout_rms"].as_f64().unwrap();
    assert!(after < 0.1 * before, "{before} -> {after}");
    assert_eq!(value["residual_structure"]["left"], false, "{value}");
}

#[test]
fn a_step_among_other_causes_is_no_resonance() {
    // Their first steps lead to a narrow resonance in the step's place, beside which nothing else is found.
    let seeds = [4_700_023, 4_700_050];
    let scenarios = seeds.map(|seed| Scenario::drawn(Class::Triple, seed));
    for mark in tally::run(&scenarios, answer) {
        assert!(mark.planted.contains("stress_jump"), "{}", mark.planted);
        let all = (mark.found, mark.named, mark.rightly);
        assert_eq!(all, (3, 3, 3), "{}: {}", mark.planted, mark.answered);
    }
}

#[test]
fn one_shape_is_not_named_as_two() {
    // The crossing's swing to both sides begins as a step; what a step is off looks like a phase that drifts.
    let scenario = Scenario::drawn(Class::Pair, 5_400_024);
    for mark in tally::run(&[scenario], answer) {
        assert_eq!(mark.planted, "warmup_transient+mode_crossing");
        assert_eq!((mark.found, mark.named), (2, 2), "{}", mark.answered);
    }
}
