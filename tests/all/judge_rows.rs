//! Rows that judge steer nothing: whatever their output is, `close` comes to the same names, parameters and firmware.

use crate::blind::dice::Dice;
use crate::blind::{Class, Scenario, make};
use crate::rng::Rng;
use gyrogen::design::{Design, reader};
use gyrogen::record::ThermalRecord;
use gyrogen::statistics::blocks::Role;
use gyrogen::thermal::close::{Closed, close};
use gyrogen::thermal::search::Effort;
use std::path::Path;

/// Seed of all records here.
const SEED: u64 = 8;

fn record(scenario: &Scenario, design: &Design) -> ThermalRecord {
    let csv = make(scenario).csv;
    let parsed =
        gyrogen::record::thermal::parse(csv.as_bytes(), Path::new("r.csv"), &design.record);
    parsed.expect("a record").0
}

/// All of an answer that an output may steer, to the last bit: what each row is for, steps with their parameters and
/// probabilities, coefficients, what is left, what firmware does.
fn steered(closed: &Closed) -> String {
    let c = &closed.closure;
    let step = |s: &gyrogen::verdict::Step| {
        let bits = |of: &std::collections::BTreeMap<String, f64>| {
            let each = of
                .iter()
                .map(|(name, v)| format!("{name} {:x}", v.to_bits()));
            each.collect::<Vec<_>>()
        };
        let p = [s.p_value, s.selection_frequency].map(f64::to_bits);
        let rivals = &s.indistinguishable_from;
        let [parameters, deviations] = [&s.parameters, &s.parameter_std].map(bits);
        format!(
            "{} {parameters:?} {deviations:?} {p:?} {rivals:?}",
            s.effect
        )
    };
    let steps: Vec<String> = c.steps.iter().map(step).collect();
    let beta: Vec<u64> = closed.after.beta.iter().map(|b| b.to_bits()).collect();
    let plan = closed.correction.as_ref().map(|c| format!("{:?}", c.plan));
    let structure = &c.residual_structure;
    format!(
        "{:?} {steps:?} {beta:?} {:?} {structure:?} {:x} {plan:?}",
        closed.split.roles,
        c.evidence,
        c.noise_floor_rms.to_bits()
    )
}

fn closed(record: &ThermalRecord, design: &Design) -> Closed {
    close(record, Vec::new(), design, "test", Effort::default()).expect("an answer")
}

/// Noise a thousand times the output's spread, or nothing, in the place of the output of rows that judge.
fn nothing_is_steered(scenario: &Scenario) -> Closed {
    let design = reader::read(None).expect("the default");
    let record = record(scenario, &design);
    let before = closed(&record, &design);
    let judging = before.split.rows(Role::Judge);
    assert!(judging.contains(&true));
    let told = steered(&before);
    let mut rng = Rng::new(SEED);
    let mut noise = || 1e3 * rng.gauss();
    let replaced: [&mut dyn FnMut() -> f64; 2] = [&mut noise, &mut || 0.0];
    for made in replaced {
        let mut other = record.clone();
        let output = other.columns.get_mut("rate_out_dps").expect("an output");
        let rows = output.iter_mut().zip(&judging).filter(|(_, judge)| **judge);
        rows.for_each(|(out, _)| *out = made());
        let after = closed(&other, &design);
        assert_eq!(steered(&after), told, "{scenario:?}");
        // It is there that the difference shows.
        let [was, is] = [&before, &after].map(|c| c.closure.after.heldout_rms);
        assert_ne!(was, is, "{scenario:?}");
    }
    before
}

fn scenarios() -> Vec<Scenario> {
    let single = |id| Scenario {
        ratio: Some(6.0),
        ..Scenario::single(id, SEED)
    };
    vec![
        single("thermal_lag"),
        single("supply_sensitivity"),
        single("quadrature_leakage"),
        // With an applied rate.
        single("scale_factor_asymmetry"),
        single("output_saturation"),
        single("output_deadband"),
        Scenario::drawn(Class::Pair, SEED),
        Scenario::drawn(Class::None, SEED),
        Scenario::drawn(Class::HiddenChannel, SEED),
    ]
}

#[test]
fn judge_rows_steer_nothing() {
    let all = scenarios();
    let found: Vec<Closed> = all.iter().map(nothing_is_steered).collect();
    let named = found.iter().filter(|c| !c.closure.steps.is_empty()).count();
    let rated = found
        .iter()
        .filter(|c| c.channels.moving("rate_dps").is_some())
        .count();
    assert!(named >= 5 && rated >= 3, "{named} {rated}");
}
