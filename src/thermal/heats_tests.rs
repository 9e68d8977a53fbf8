//! A gyro whose phase follows the structure's temperature, and a die whose own temperature runs ahead of it.

use super::channels::lag;
use super::close::close;
use super::search::Effort;
use super::synthetic::{self, Random};
use crate::design::reader;
use crate::verdict::{Closure, Fate, Step};

const ROWS: usize = 900;
const NOISE_DPS: f64 = 0.01;

/// How the chamber goes: two unequal heatings, degC, a row a second.
fn chamber_degc() -> Vec<f64> {
    [synthetic::triangle(400), synthetic::triangle(500)].concat()
}

/// The steps of a record with this effect of the die's temperature; the structure follows the chamber by minutes, the die
/// sooner.
fn steps(effect: impl Fn(&[f64], &[f64]) -> Vec<f64>) -> Vec<Step> {
    let mut random = Random::new(21);
    let time_s: Vec<f64> = (0..ROWS).map(|k| k as f64).collect();
    let structure = lag(&time_s, &chamber_degc(), 90.0);
    let die = lag(&time_s, &chamber_degc(), 15.0);
    let added = effect(&time_s, &die);
    let rate: Vec<f64> = structure
        .iter()
        .zip(&added)
        .map(|(degc, added)| {
            let u = degc / 35.0 - 1.0;
            8.0 - 3.0 * u + u * u + added + NOISE_DPS * random.normal()
        })
        .collect();
    let phase = structure
        .iter()
        .map(|degc| -std::f64::consts::FRAC_PI_2 - 0.3 * (degc / 35.0 - 1.0));
    let phase: Vec<f64> = phase.map(|rad| rad + 1e-5 * random.normal()).collect();
    let mut record = synthetic::record("phase_rad", &phase, &rate);
    let die = die.iter().map(|degc| degc + 0.01 * random.normal());
    record.columns.insert("die_degc".to_owned(), die.collect());
    let design = reader::read(None).expect("the default design");
    let closed = close(&record, Vec::new(), &design, "test", Effort::default());
    closed.expect("a sound record").closure.steps
}

fn close_to(step: &Step, name: &str, due: f64, relative: f64) {
    let is = step.parameters[name];
    assert!((is / due - 1.0).abs() < relative, "{name}: {is} for {due}");
}

/// 0.3 deg/s for a rate of 1 K/s that only the die has: the phase's own rate is another.
#[test]
fn the_rate_of_the_dies_temperature_is_the_only_name() {
    let steps = steps(|_, die| {
        (0..ROWS)
            .map(|k| (die[(k + 1).min(ROWS - 1)] - die[k.saturating_sub(1)]) / 2.0)
            .map(|k_per_s| 0.3 * k_per_s)
            .collect()
    });
    let [step] = steps.as_slice() else {
        panic!("{steps:?}");
    };
    assert_eq!(step.effect, "temperature_rate");
    assert_eq!(step.channels, ["die_degc", "time_s"]);
    close_to(step, "gain_dps_s_per_k", 0.3, 0.1);
}

#[test]
fn what_lags_behind_the_dies_temperature_is_the_only_name() {
    let steps = steps(|time_s, die| {
        let behind = lag(time_s, die, 40.0);
        die.iter()
            .zip(&behind)
            .map(|(t, l)| 0.02 * (t - l))
            .collect()
    });
    let [step] = steps.as_slice() else {
        panic!("{steps:?}");
    };
    assert_eq!(step.effect, "thermal_lag");
    close_to(step, "gain_dps_per_k", 0.02, 0.1);
    close_to(step, "tau_s", 40.0, 0.1);
}

/// The closure of a record at rest whose acceleration goes with the temperature but for `apart` of it.
fn tilted(apart: f64) -> Closure {
    let mut random = Random::new(22);
    let degc = chamber_degc();
    let rate: Vec<f64> = degc
        .iter()
        .map(|t| 0.02 * t + NOISE_DPS * random.normal())
        .collect();
    let mut record = synthetic::record("die_degc", &degc, &rate);
    let tilt = |(k, t): (usize, &f64)| t / 70.0 + apart * (0.3 * k as f64).sin();
    let accel = degc.iter().enumerate().map(tilt).collect();
    record.columns.insert("accel_g".to_owned(), accel);
    let design = reader::read(None).expect("the default design");
    let closed = close(&record, Vec::new(), &design, "test", Effort::default());
    closed.expect("a sound record").closure
}

#[test]
fn what_goes_with_the_temperature_is_told_from_what_does_nothing() {
    for (apart, due) in [(0.001, Fate::Confounded), (0.3, Fate::Rejected)] {
        let closure = tilted(apart);
        assert!(closure.steps.is_empty());
        let mut evidence = closure.evidence.iter();
        let own = evidence.find(|e| e.effect == "g_sensitivity");
        assert_eq!(own.map(|e| e.fate), Some(due), "{apart}");
        let mut warnings = closure.warnings.iter();
        let told = warnings.find(|w| w.code == "goes_with_temperature");
        assert_eq!(told.is_some(), due == Fate::Confounded, "{apart}");
        // It says where the experiment stands.
        let has_place = |text: &str| text.contains("The table Evidence in report.html");
        assert!(told.is_none_or(|w| has_place(&w.message)), "{told:?}");
    }
}
