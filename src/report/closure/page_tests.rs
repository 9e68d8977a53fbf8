//! The page of records that are made up.

use super::*;
use crate::design::reader;
use crate::record::Warning;
use crate::thermal::close::close;
use crate::thermal::search::Effort;
use crate::thermal::synthetic::{Random, record, triangle};
use crate::verdict::Structure;

const EFFORT: Effort = Effort {
    rows: 400,
    surrogates: 40,
    steps: 2,
};

/// Two heatings with a parabola, 0.02 deg/s of noise, and `gain` times the supply, which steps.
fn closed(gain_dps_per_v: f64, rows: usize) -> Closed {
    let mut random = Random::new(5);
    let degc: Vec<f64> = [triangle(rows / 2), triangle(rows - rows / 2)].concat();
    let supply: Vec<f64> = (0..rows)
        .map(|i| 5.0 + f64::from(u8::from(i / 17 % 3 == 1)))
        .collect();
    let output: Vec<f64> = degc
        .iter()
        .zip(&supply)
        .map(|(t, v)| {
            let u = (t - 35.0) / 35.0;
            0.5 - 0.8 * u + 0.3 * u * u + gain_dps_per_v * v + 0.02 * random.normal()
        })
        .collect();
    let mut record = record("die_degc", &degc, &output);
    record.columns.insert("supply_v".to_owned(), supply);
    record.columns.insert("still_v".to_owned(), vec![1.0; rows]);
    let design = reader::parse("", None).unwrap();
    close(&record, Vec::new(), &design, "gyrogen close <x>", EFFORT).unwrap()
}

#[test]
fn the_page_shows_the_step_and_needs_nothing_else() {
    let closed = closed(0.4, 300);
    let page = html(&closed, "made<up>.csv").unwrap();
    assert_eq!(closed.closure.steps[0].effect, "supply_sensitivity");
    assert!(
        page.contains("Explained by supply_sensitivity"),
        "{}",
        page.len()
    );
    assert!(page.contains("made&#60;up&#62;.csv") || page.contains("made&lt;up&gt;.csv"));
    for absent in [
        "<script", "http://", "https://", "<up>", "<x>", "NaN", "inf ",
    ] {
        let bare = page.replace("http://www.w3.org/2000/svg", "");
        assert!(!bare.contains(absent), "{absent}");
    }
    // In the order that the reader is told: figures, evidence, Allan deviation.
    let places: Vec<usize> = [
        "id=\"headline\"",
        "id=\"errors\"",
        "id=\"steps\"",
        "Residual over time, before and after",
        "Residual against every channel",
        "Cause 1: supply_sensitivity over supply_v",
        "id=\"evidence\"",
        "Allan deviation of the residual</h3>",
        "id=\"warnings\"",
    ]
    .iter()
    .map(|what| {
        page.find(what)
            .unwrap_or_else(|| panic!("{what} is missing"))
    })
    .collect();
    assert!(places.is_sorted(), "{places:?}");
    assert!(page.contains("Constant in this record: still_v"));
    for candidate in &closed.closure.evidence {
        assert!(page.contains(&candidate.effect), "{}", candidate.effect);
    }
    assert_eq!(page, html(&closed, "made<up>.csv").unwrap());
}

#[test]
fn contributions_are_the_models_with_the_reported_deviations() {
    let closed = closed(0.4, 300);
    let all = contribution::all(&closed.channels, &closed.after);
    assert_eq!(all.len(), 1);
    let view = View::new(&closed);
    // Declared model, contribution and residual add up to the error.
    let order = 3;
    for (i, error) in closed.channels.error_dps.iter().enumerate() {
        let declared: f64 = (0..order)
            .map(|k| closed.after.beta[k] * closed.after.columns[k][i])
            .sum();
        let sum = declared + all[0].value_dps[i] + view.after[i];
        assert!((sum - error).abs() < 1e-9, "{i}: {sum} {error}");
    }
    // k V: between two rows the contribution and its deviation are in the ratio of the gain and its own.
    let step = &closed.closure.steps[0];
    let (gain, std) = (
        step.parameters["gain_dps_per_v"],
        step.parameter_std["gain_dps_per_v"],
    );
    assert!((gain - 0.4).abs() < 5.0 * std && std > 0.0, "{gain} {std}");
    let supply = closed.channels.column("supply_v").unwrap();
    let high = supply.iter().position(|v| *v > 5.5).unwrap();
    let rise = all[0].value_dps[high] - all[0].value_dps[0];
    assert!((rise / gain - 1.0).abs() < 1e-6, "{rise} {gain}");
    for i in [0, high] {
        let expected = (all[0].value_dps[i] * std / gain).abs();
        assert!(expected > 0.0);
        assert!((all[0].std_dps[i] / expected - 1.0).abs() < 1e-6, "{i}");
    }
}

#[test]
fn a_record_without_anything_left_is_shown_as_complete() {
    let closed = closed(0.0, 120);
    let page = html(&closed, "r.csv").unwrap();
    assert!(page.contains("Complete: the polynomial leaves"));
    assert!(page.contains("No effect was added to the polynomial."));
    // What the user did not declare is not called so.
    assert!(!page.contains("declared model"));
    assert!(!page.contains("Cause 1"));
    assert!(!page.contains("NaN"));
}

#[test]
fn held_out_blocks_are_those_of_the_split() {
    let closed = closed(0.0, 120);
    let view = View::new(&closed);
    let blocks = view.blocks();
    assert!(blocks.len() >= 4);
    for (t, held) in closed.channels.time_s.iter().zip(closed.split.judging()) {
        let inside = blocks.iter().any(|(a, b)| a < t && t < b);
        assert_eq!(inside, held, "{t}");
    }
}

#[test]
fn a_channel_is_to_be_changed_by_itself_only_beside_another() {
    let mut closed = closed(0.0, 120);
    closed.closure.residual_structure = Structure {
        left: true,
        strongest_channel: Some("die_degc".to_owned()),
    };
    let said = |closed: &Closed| html(closed, "r.csv").unwrap().contains("changed by itself");
    assert!(said(&closed));
    closed.channels.columns.clear();
    assert!(!said(&closed));
    // Where heating and cooling differ, the experiment is another one.
    let reverses = |closed: &Closed| {
        let page = html(closed, "r.csv").unwrap();
        page.contains("To tell a lag from a hysteresis, reverse the chamber")
    };
    assert!(!reverses(&closed));
    let found = Warning::on("heating_cooling_loop", "die_degc", String::new());
    closed.closure.warnings.push(found);
    assert!(reverses(&closed));
}
