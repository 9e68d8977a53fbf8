//! The search by evidence (`thermal::evidence`), on records whose cause only the bank knows (`blind`).

mod blind;

use blind::dice::Dice;
use blind::rng::Rng;
use blind::{Class, Scenario, make};
use gyrogen::design::{Design, reader};
use gyrogen::record::ThermalRecord;
use gyrogen::thermal::channels::Channels;
use gyrogen::thermal::evidence::posterior::answer;
use gyrogen::thermal::intake::Intake;
use gyrogen::thermal::search::{Effort, Search};
use std::path::Path;

/// Seed of all records here.
const SEED: u64 = 8;

fn read(csv: &str, design: &Design) -> ThermalRecord {
    let parsed =
        gyrogen::record::thermal::parse(csv.as_bytes(), Path::new("r.csv"), &design.record);
    parsed.expect("a record").0
}

/// Names, in order, with their parameters.
fn named(
    channels: &Channels,
    split: &gyrogen::statistics::blocks::Split,
) -> Vec<(String, Vec<f64>)> {
    let search = Search::new(channels, split, Effort::default(), Vec::new());
    let found = answer(&search).expect("enough rows");
    let term = |t: &gyrogen::thermal::search::Term| (t.id(), t.point.theta.clone());
    found.terms.iter().map(term).collect()
}

/// The names of a record of the bank.
fn names(scenario: &Scenario) -> Vec<String> {
    let design = reader::read(None).expect("the default");
    let record = read(&make(scenario).csv, &design);
    let intake = Intake::of(&record, &design, Vec::new()).expect("a thermometer");
    let all = named(&intake.channels, &intake.split);
    all.into_iter().map(|(id, _)| id).collect()
}

#[test]
fn a_large_effect_is_named_and_noise_is_not() {
    for id in [
        "thermal_lag",
        "supply_sensitivity",
        "scale_factor_asymmetry",
    ] {
        let scenario = Scenario {
            ratio: Some(6.0),
            ..Scenario::single(id, SEED)
        };
        assert_eq!(names(&scenario), [id]);
    }
    for class in [Class::None, Class::NoiseOnly] {
        assert!(names(&Scenario::drawn(class, SEED)).is_empty(), "{class:?}");
    }
}

/// The columns of a CSV in another order, with `more` in front.
fn rearranged(csv: &str, more: &[(&str, Vec<f64>)]) -> String {
    let mut row = 0;
    let line = |line: &str| {
        if line.starts_with('#') {
            return line.to_owned();
        }
        let mut cells: Vec<String> = line.split(',').rev().map(str::to_owned).collect();
        let is_head = line.contains("rate_out_dps");
        for (name, values) in more {
            let cell = match is_head {
                true => (*name).to_owned(),
                false => values[row].to_string(),
            };
            cells.insert(0, cell);
        }
        row += usize::from(!is_head);
        cells.join(",")
    };
    csv.lines().map(line).collect::<Vec<_>>().join("\n") + "\n"
}

/// Neither the order of columns nor four that have nothing to do with the output change a name.
#[test]
fn columns_may_stand_anywhere_and_inert_ones_do_nothing() {
    let design = reader::read(None).expect("the default");
    let of = |csv: &str| -> Vec<String> {
        let record = read(csv, &design);
        let intake = Intake::of(&record, &design, Vec::new()).expect("a thermometer");
        let all = named(&intake.channels, &intake.split);
        all.into_iter().map(|(id, _)| id).collect()
    };
    let csv = make(&Scenario::drawn(Class::Pair, SEED)).csv;
    let before = of(&csv);
    assert!(!before.is_empty());
    assert_eq!(of(&rearranged(&csv, &[])), before);
    let mut rng = Rng::new(SEED);
    let rows = csv.lines().count();
    let mut level = 0.0;
    let mut walk = || {
        level += 0.1 * rng.gauss();
        level
    };
    let walks: Vec<f64> = (0..rows).map(|_| walk()).collect();
    let mut white = || -> Vec<f64> { (0..rows).map(|_| rng.gauss()).collect() };
    let inert = [
        ("pump_w", white()),
        ("door_mm", walks),
        (
            "mains_a",
            (0..rows).map(|k| (0.05 * k as f64).sin()).collect(),
        ),
        ("blower_rpm", white()),
    ];
    assert_eq!(of(&rearranged(&csv, &inert)), before);
}
