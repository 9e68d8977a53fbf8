//! Which of the names that a round found is taken.

use super::*;
use crate::thermal::channels::Channels;
use crate::thermal::effects::tone::Pickup;
use crate::thermal::effects::{Candidate, Point};
use crate::thermal::search::Effort;
use crate::thermal::synthetic::Random;
use std::collections::BTreeMap;
use std::sync::Arc;

/// What is taken of a tone of so many periods and of the temperature's rate, which is worth `behind` less, where the
/// temperature is a sinusoid of six periods.
fn taken(periods: f64, behind: f64) -> String {
    let rows = 300;
    let mut random = Random::new(3);
    let angle = |k: usize| std::f64::consts::TAU * 6.0 * k as f64 / rows as f64;
    let degc: Vec<f64> = (0..rows).map(|k| 20.0 + 35.0 * angle(k).sin()).collect();
    let output = degc
        .iter()
        .map(|degc| 0.3 - 0.002 * degc + 0.01 * random.normal());
    let columns = BTreeMap::from([
        ("rate_out_dps".to_owned(), output.collect()),
        ("die_degc".to_owned(), degc.clone()),
    ]);
    let time_s: Vec<f64> = (0..rows).map(|k| 10.0 * k as f64).collect();
    let c = Channels::new(&time_s, &columns, "die_degc", |t| t).unwrap();
    let search = Search::new(&c, &c.split().unwrap(), Effort::default(), Vec::new());
    let judged = |candidate: Arc<dyn Candidate>, point: Point, net: f64| Judged {
        candidate,
        point,
        gain: net + 2.0,
        net,
        odds_against: 0.0,
        p_value: 1e-9,
    };
    let frequency_hz = periods / c.span_s();
    let tone = Pickup {
        frequency_hz,
        further: false,
    };
    let mut all = search.candidates().iter();
    let rate = all.find(|c| c.id() == "temperature_rate").unwrap().clone();
    let round = Round {
        judged: vec![
            judged(Arc::new(tone), Point::at(0, &[frequency_hz]), 40.0),
            judged(rate, Point::form(0), 40.0 - behind),
        ],
        equal: 4.0,
        missing: Vec::new(),
        leads: None,
    };
    match search
        .next(&search.model(&[]).unwrap(), &round, &mut Found::default())
        .unwrap()
    {
        Next::Add(term) => term.id(),
        Next::Undecided(_) | Next::Stop => "nothing".to_owned(),
    }
}

#[test]
fn a_tone_that_is_the_temperatures_has_to_be_better_than_a_name_by_what_a_stranger_has() {
    assert_eq!(taken(6.0, 3.0), "temperature_rate");
    assert_eq!(taken(6.0, 9.0), "periodic_pickup");
    // Its own frequency: as any other name.
    assert_eq!(taken(17.0, 3.0), "periodic_pickup");
}

#[test]
fn spikes_are_no_concern_of_names_that_would_not_lead_with_all_of_them_explained() {
    let tone = |further: bool, net: f64| Judged {
        candidate: Arc::new(Pickup {
            frequency_hz: 1e-3,
            further,
        }),
        point: Point::at(0, &[1e-3]),
        gain: net + 2.0,
        net,
        odds_against: 0.0,
        p_value: 1e-9,
    };
    let may = |net: f64, spikes: usize| {
        let round = Round {
            judged: vec![tone(false, 1000.0), tone(true, net)],
            equal: 4.0,
            missing: Vec::new(),
            leads: None,
        };
        let [leader, other] = &round.judged[..] else {
            unreachable!()
        };
        let may = may_be(&round, Some(leader), spikes);
        assert!(may(leader.candidate.as_ref()));
        may(other.candidate.as_ref())
    };
    assert!(may(990.0, 2) && !may(970.0, 2) && may(970.0, 6));
    // Only the places of a coarse grid are known of what is far behind.
    assert!(!may(480.0, 2) && may(480.0, 10) && !may(300.0, 10));
    // Nothing is known of what was not judged, and little is enough where nothing leads.
    let nothing = Round {
        judged: Vec::new(),
        equal: 4.0,
        missing: Vec::new(),
        leads: None,
    };
    assert!(may_be(&nothing, None, 2)(
        tone(true, 0.0).candidate.as_ref()
    ));
    let leader = tone(false, 1000.0);
    assert!(!may_be(&nothing, Some(&leader), 2)(
        tone(true, 0.0).candidate.as_ref()
    ));
}

/// Names in a record of a table that turns up to 257 deg/s beside a supply and a scale factor that goes with temperature, the
/// output being clipped a little before that.
fn of_a_small_clip(seed: u64, clip_dps: f64) -> Vec<String> {
    let (rows, mut random) = (790, Random::new(seed));
    let degc: Vec<f64> = (0..rows)
        .map(|k| 22.0 - 35.0 * (std::f64::consts::TAU * k as f64 / 333.0).cos())
        .collect();
    // Every 80 rows the table goes through its rates.
    let turns = [0.2, 0.4, 0.6, 0.8, 1.0, 0.8, 0.6, 0.4, 0.2, 0.0];
    let rate = |k: usize| match k % 80 {
        step @ 0..20 => {
            let sign = if step < 10 { 1.0 } else { -1.0 };
            256.86 * sign * turns[step % 10]
        }
        _ => 0.0,
    };
    let supply = |k: usize| [4.65, 5.0, 5.36][k / 90 * 5 % 3];
    let output = (0..rows).map(|k| {
        let (u, rate) = ((degc[k] - 22.0) / 35.0, rate(k));
        let bias = 0.9 - 1.6 * u + 0.3 * u * u - 0.15 * (supply(k) - 5.0);
        let total = rate * (1.0 - 6.6e-5 * (degc[k] - 35.0)) + bias;
        total.clamp(-clip_dps, clip_dps) + 0.0186 * random.normal()
    });
    let columns = BTreeMap::from([
        ("rate_out_dps".to_owned(), output.collect::<Vec<f64>>()),
        ("rate_dps".to_owned(), (0..rows).map(rate).collect()),
        ("supply_v".to_owned(), (0..rows).map(supply).collect()),
        ("die_degc".to_owned(), degc.clone()),
    ]);
    let time_s: Vec<f64> = (0..rows).map(|k| 80.0 * k as f64).collect();
    let c = Channels::new(&time_s, &columns, "die_degc", |t| t).unwrap();
    let search = Search::new(&c, &c.split().unwrap(), Effort::default(), Vec::new());
    let found = search.run().unwrap();
    let mut names: Vec<String> = found.terms.iter().map(Term::id).collect();
    names.sort();
    names
}

#[test]
fn a_clip_of_a_few_rows_is_found_beside_two_other_causes() {
    let two = ["scale_factor_temperature", "supply_sensitivity"];
    for seed in 0..4 {
        for clip_dps in [255.0, 256.3] {
            let with = of_a_small_clip(seed, clip_dps);
            assert_eq!(with, [&["output_saturation"], &two[..]].concat(), "{seed}");
        }
        assert_eq!(of_a_small_clip(seed, 300.0), two, "{seed}");
    }
}
