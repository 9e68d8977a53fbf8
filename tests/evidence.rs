//! The search by evidence (`thermal::evidence`), on records whose cause only the bank knows (`blind`).

mod blind;

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
    let split = intake.channels.split().expect("blocks");
    let all = named(&intake.channels, &split);
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

#[test]
fn judge_rows_steer_nothing() {
    let design = reader::read(None).expect("the default");
    let record = read(&make(&Scenario::drawn(Class::Pair, SEED)).csv, &design);
    let intake = Intake::of(&record, &design, Vec::new()).expect("a thermometer");
    let mut channels = intake.channels.clone();
    let split = channels.split().expect("blocks");
    let before = named(&channels, &split);
    assert!(!before.is_empty());
    let mut high = 1.0;
    for (error, _) in channels
        .error_dps
        .iter_mut()
        .zip(&split.heldout)
        .filter(|(_, h)| **h)
    {
        high = -high;
        *error += 0.1 * high;
    }
    assert_eq!(named(&channels, &split), before);
}
