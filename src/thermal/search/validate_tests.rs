//! Records whose residual only resembles an effect, and the effect itself beside each.

use super::*;
use crate::statistics::blocks::{Role, Split};
use crate::thermal::channels::Channels;
use crate::thermal::effects::{Candidate, Point};
use crate::thermal::search::Effort;
use crate::thermal::synthetic::{Random, triangle};
use std::collections::BTreeMap;
use std::f64::consts::TAU;

const ROWS: usize = 300;

/// What is named, and what is left.
type Names = (Vec<String>, Option<String>);

/// Two heatings from -35 to 35 degC around 20, with more columns, and what the output has beside the declared
/// model, in units of its noise.
fn closed(seed: u64, more: &[(&str, Vec<f64>)], added: impl Fn(usize, f64) -> f64) -> Names {
    limited(seed, more, added, f64::INFINITY)
}

/// The same with an output that ends at `limit_dps`: the rate's first peak alone, of 80 deg/s, is beyond 61.
fn limited(
    seed: u64,
    more: &[(&str, Vec<f64>)],
    added: impl Fn(usize, f64) -> f64,
    limit_dps: f64,
) -> Names {
    let mut random = Random::new(seed);
    let degc: Vec<f64> = [triangle(ROWS / 2), triangle(ROWS / 2)].concat();
    let rate_dps = |k: usize| {
        let peak = if k < 19 { 80.0 } else { 60.0 };
        peak * (TAU * k as f64 / 37.0).sin()
    };
    let noise_dps = 0.01;
    let output = (0..ROWS).map(|k| {
        let u = degc[k] / 35.0 - 1.0;
        let total = rate_dps(k) + 0.3 - 0.2 * u + noise_dps * added(k, degc[k]);
        total.min(limit_dps) + noise_dps * random.normal()
    });
    let mut columns = BTreeMap::from([
        ("rate_out_dps".to_owned(), output.collect()),
        ("rate_dps".to_owned(), (0..ROWS).map(rate_dps).collect()),
        ("die_degc".to_owned(), degc.clone()),
    ]);
    for (name, values) in more {
        columns.insert((*name).to_owned(), values.clone());
    }
    let time_s: Vec<f64> = (0..ROWS).map(|k| 10.0 * k as f64).collect();
    let c = Channels::new(&time_s, &columns, "die_degc", |t| t).unwrap();
    let split = c.split().unwrap();
    let found = Search::new(&c, &split, Effort::default(), Vec::new())
        .run()
        .unwrap();
    (found.terms.iter().map(Term::id).collect(), found.left)
}

#[test]
fn a_wave_of_three_periods_is_left_and_one_of_eleven_is_a_tone() {
    let wave = |periods: f64| {
        move |k: usize, _| 5.0 * (TAU * periods * k as f64 / ROWS as f64 + 0.4).sin()
    };
    for seed in 0..3 {
        let (names, left) = closed(seed, &[], wave(3.3));
        assert!(
            names.is_empty() && left.is_some(),
            "{seed}: {names:?}, {left:?}"
        );
        let (names, left) = closed(seed, &[], wave(11.3));
        assert_eq!(
            (names, left),
            (vec!["periodic_pickup".to_owned()], None),
            "{seed}"
        );
    }
}

#[test]
fn a_phase_error_that_hardly_drifts_is_leakage() {
    let quadrature: Vec<f64> = (0..ROWS)
        .map(|k| 40.0 + 9.0 * (k as f64 / 7.0).sin())
        .collect();
    let columns = [("quad_dps", quadrature.clone())];
    // A zero far outside of all temperatures: most of the error is constant, whatever else is seen; and one within.
    for (zero_degc, unit_k, name) in [
        (400.0, 400.0, "quadrature_leakage"),
        (30.0, 15.0, "demod_phase_drift"),
    ] {
        for seed in 0..3 {
            let drift = |k: usize, degc| 0.7 * quadrature[k] * (degc - zero_degc) / unit_k;
            let (names, _) = closed(seed, &columns, drift);
            let first = names.first().map(String::as_str);
            assert_eq!(first, Some(name), "{zero_degc} degC, {seed}: {names:?}");
        }
    }
}

#[test]
fn a_tone_of_a_channels_own_frequency_is_that_channels() {
    let wave = |k: usize, periods: f64| (TAU * periods * k as f64 / ROWS as f64 + 0.7).sin();
    for seed in 0..3 {
        let tilt: Vec<f64> = (0..ROWS).map(|k| 0.4 * wave(k, 11.0)).collect();
        let more = [("heater_w", tilt)];
        // A quarter of a period late: no function of the column.
        let late = |k: usize, _: f64| 8.0 * (TAU * 11.0 * k as f64 / ROWS as f64 + 2.3).sin();
        let (names, left) = closed(seed, &more, late);
        assert_eq!(
            (names, left.as_deref()),
            (vec![], Some("heater_w")),
            "{seed}"
        );
        // Twice as often: what answers to both signs alike.
        let twice = |k: usize, _: f64| 8.0 * (TAU * 22.0 * k as f64 / ROWS as f64 + 2.3).sin();
        let (names, left) = closed(seed, &more, twice);
        assert_eq!(
            (names, left.as_deref()),
            (vec![], Some("heater_w")),
            "{seed}"
        );
        let (names, _) = closed(seed, &more, |k, _| 8.0 * wave(k, 17.0));
        assert_eq!(names, ["periodic_pickup"], "{seed}");
    }
}

#[test]
fn what_repeats_but_has_overtones_is_no_sinusoid() {
    // In units of the noise: an overtone that is seen beside the tone, and one that chance may make.
    let wave = |of_third: f64| {
        move |k: usize, _: f64| {
            let angle = TAU * k as f64 / 42.0;
            6.0 * angle.sin() + of_third * (3.0 * angle + 1.0).sin()
        }
    };
    for seed in 0..3 {
        for (of_third, names, left) in [
            (1.0, vec![], Some("time_s")),
            (0.45, vec![], Some("time_s")),
            (0.0, vec!["periodic_pickup"], None),
        ] {
            let (found, rest) = closed(seed, &[], wave(of_third));
            assert_eq!(
                (found, rest.as_deref()),
                (names.iter().map(|n: &&str| (*n).to_owned()).collect(), left),
                "{seed}, {of_third}"
            );
        }
    }
}

#[test]
fn a_clip_that_no_held_out_row_shows_stands() {
    for seed in 0..3 {
        let (names, _) = limited(seed, &[], |_, _| 0.0, f64::INFINITY);
        assert!(names.is_empty(), "{seed}: {names:?}");
        let (names, _) = limited(seed, &[], |_, _| 0.0, 70.0);
        assert_eq!(names, ["output_saturation"], "{seed}");
    }
}

/// Noise alone beside a thermometer.
fn quiet(seed: u64, degc: Vec<f64>) -> Channels {
    let mut random = Random::new(seed);
    let columns = BTreeMap::from([
        (
            "rate_out_dps".to_owned(),
            (0..ROWS).map(|_| 0.01 * random.normal()).collect(),
        ),
        ("die_degc".to_owned(), degc),
    ]);
    let time_s: Vec<f64> = (0..ROWS).map(|k| 10.0 * k as f64).collect();
    Channels::new(&time_s, &columns, "die_degc", |t| t).unwrap()
}

#[test]
fn a_transient_of_one_row_is_an_accident_and_one_of_twelve_is_none() {
    let c = quiet(2, [triangle(ROWS / 2), triangle(ROWS / 2)].concat());
    let split = c.split().unwrap();
    let search = Search::new(&c, &split, Effort::default(), Vec::new());
    let is_it = |c: &&Arc<dyn Candidate>| c.id() == "warmup_transient";
    let candidate = search.candidates().iter().find(is_it).unwrap();
    for (tau_s, once) in [(4.4, true), (11.0, true), (14.0, false), (120.0, false)] {
        let term = Term::new(candidate.clone(), Point::at(0, &[f64::ln(tau_s)]));
        let model = search.model(std::slice::from_ref(&term)).unwrap();
        assert_eq!(search.shows_once(&term, &model), once, "{tau_s}");
    }
}

#[test]
fn a_step_after_the_first_row_is_that_rows_accident_and_one_after_twelve_is_none() {
    let c = quiet(4, triangle(2 * ROWS + 1)[..ROWS].to_vec());
    let search = Search::new(&c, &c.split().unwrap(), Effort::default(), Vec::new());
    let is_it = |c: &&Arc<dyn Candidate>| c.id() == "stress_jump";
    let candidate = search.candidates().iter().find(is_it).unwrap();
    for (rows, once) in [(1, true), (12, false), (ROWS - 1, true), (ROWS - 12, false)] {
        let centre = 0.5 * (c.smooth_u[rows - 1] + c.smooth_u[rows]);
        let term = Term::new(candidate.clone(), Point::at(0, &[centre]));
        let model = search.model(std::slice::from_ref(&term)).unwrap();
        assert_eq!(search.shows_once(&term, &model), once, "{rows}");
    }
}

#[test]
fn a_clip_of_one_row_is_an_accident_and_one_of_two_is_none() {
    let mut random = Random::new(3);
    // Peaks of 100, 97, 94, ... deg/s, each of one row.
    let rate_dps = |k: usize| {
        if k % 40 == 20 {
            100.0 - k as f64 * 3.0 / 40.0
        } else {
            0.0
        }
    };
    let degc = [triangle(ROWS / 2), triangle(ROWS / 2)].concat();
    let output = (0..ROWS).map(|k| rate_dps(k) + 0.01 * random.normal());
    let columns = BTreeMap::from([
        ("rate_out_dps".to_owned(), output.collect()),
        ("rate_dps".to_owned(), (0..ROWS).map(rate_dps).collect()),
        ("die_degc".to_owned(), degc),
    ]);
    let time_s: Vec<f64> = (0..ROWS).map(|k| 10.0 * k as f64).collect();
    let c = Channels::new(&time_s, &columns, "die_degc", |t| t).unwrap();
    let split = Split {
        roles: vec![Role::Fit; ROWS],
        ..c.split().unwrap()
    };
    let search = Search::new(&c, &split, Effort::default(), Vec::new());
    let is_it = |c: &&Arc<dyn Candidate>| c.id() == "output_saturation";
    let candidate = search.candidates().iter().find(is_it).unwrap();
    // Between the first two peaks of 98.5 and 95.5 deg/s; both, the second by little; far below the noise.
    for (level_dps, once) in [(96.0, true), (95.4, false), (95.0, false), (98.499, true)] {
        let term = Term::new(candidate.clone(), Point::at(1, &[level_dps]));
        let model = search.model(std::slice::from_ref(&term)).unwrap();
        assert_eq!(search.shows_once(&term, &model), once, "{level_dps}");
    }
}

#[test]
fn a_spike_is_no_transient_and_twelve_rows_are_one() {
    for seed in 0..3 {
        let first_row = |k: usize, _| if k == 0 { 12.0 } else { 0.0 };
        let (names, _) = closed(seed, &[], first_row);
        assert!(names.is_empty(), "{seed}: {names:?}");
        let decay = |k: usize, _| 12.0 * (-(k as f64) / 12.0).exp();
        let (names, _) = closed(seed, &[], decay);
        assert_eq!(names, ["warmup_transient"], "{seed}");
    }
}

#[test]
fn a_law_takes_a_names_place_if_it_is_as_good_or_beyond_chance_by_itself() {
    let supply: Vec<f64> = (0..ROWS)
        .map(|k| f64::from(u8::from(k / 11 % 3 == 1)))
        .collect();
    let degc = [triangle(ROWS / 2), triangle(ROWS / 2)].concat();
    // The supply's part and that of a step at 30 degC, in units of the noise: alone, less than the step but beyond chance
    // beside it, not so, and absent.
    for (of_supply, of_step, expected) in [
        (4.0, 0.0, Some(("supply_sensitivity", true))),
        (4.0, 9.0, Some(("supply_sensitivity", false))),
        (3.0, 9.0, None),
        (0.0, 6.0, None),
    ] {
        let mut random = Random::new(21);
        let output = (0..ROWS).map(|k| {
            let jump = if degc[k] > 30.0 { of_step } else { 0.0 };
            0.3 + 0.01 * (of_supply * supply[k] + jump + random.normal())
        });
        let columns = BTreeMap::from([
            ("rate_out_dps".to_owned(), output.collect()),
            ("supply_v".to_owned(), supply.clone()),
            ("die_degc".to_owned(), degc.clone()),
        ]);
        let time_s: Vec<f64> = (0..ROWS).map(|k| 10.0 * k as f64).collect();
        let c = Channels::new(&time_s, &columns, "die_degc", |t| t).unwrap();
        let search = Search::new(&c, &c.split().unwrap(), Effort::default(), Vec::new());
        let model = search.model(&[]).unwrap();
        let round = search.round(&model, 0);
        let jump = round
            .judged
            .iter()
            .find(|j| j.candidate.id() == "stress_jump");
        let own = Term::of(jump.unwrap(), Vec::new());
        let law = search.law_instead(&[], &own).unwrap();
        let law = law.map(|(term, good)| (term.id(), good));
        let expected = expected.map(|(id, good)| (id.to_owned(), good));
        assert_eq!(law, expected, "{of_supply}, {of_step}");
    }
}

#[test]
fn a_dropped_name_leaves_something_if_it_was_beyond_what_chance_makes() {
    let supply: Vec<f64> = (0..ROWS)
        .map(|k| f64::from(u8::from(k / 11 % 3 == 1)))
        .collect();
    let degc = [triangle(ROWS / 2), triangle(ROWS / 2)].concat();
    let time_s: Vec<f64> = (0..ROWS).map(|k| 10.0 * k as f64).collect();
    let channels = |of_supply: &dyn Fn(usize) -> f64| {
        let mut random = Random::new(21);
        let output = (0..ROWS).map(|k| 0.3 + 0.01 * (of_supply(k) * supply[k] + random.normal()));
        let columns = BTreeMap::from([
            ("rate_out_dps".to_owned(), output.collect()),
            ("supply_v".to_owned(), supply.clone()),
            ("die_degc".to_owned(), degc.clone()),
        ]);
        Channels::new(&time_s, &columns, "die_degc", |t| t).unwrap()
    };
    // The held-out rows have it the other way round.
    let held = channels(&|_| 0.0).split().unwrap().rows(Role::Choose);
    let c = channels(&|k| if held[k] { -4.0 } else { 4.0 });
    let search = Search::new(&c, &c.split().unwrap(), Effort::default(), Vec::new());
    let is_it = |c: &&Arc<dyn Candidate>| c.id() == "supply_sensitivity";
    let candidate = search.candidates().iter().find(is_it).unwrap();
    for (p_value, before, after) in [
        (2.0 * BEYOND, None, None),
        (2.0 * BEYOND, Some("accel_g"), Some("accel_g")),
        (0.5 * BEYOND, None, Some("supply_v")),
        (0.5 * BEYOND, Some("accel_g"), Some("accel_g")),
    ] {
        let mut found = Found {
            left: before.map(str::to_owned),
            ..Found::default()
        };
        let term = Term {
            p_value,
            ..Term::new(candidate.clone(), candidate.points(&c).remove(0))
        };
        let model = search.model(std::slice::from_ref(&term)).unwrap();
        let model = search.validated(model, &mut found).unwrap();
        assert!(model.terms.is_empty());
        assert_eq!(found.left.as_deref(), after, "{p_value}, {before:?}");
    }
}

/// A tone beside a slow wave that quickens, which no name has: a larger one, and one of its size.
#[test]
fn a_tone_beside_more_that_is_not_known_is_a_part_of_that() {
    let both = |slow: f64| {
        move |k: usize, _: f64| {
            let x = k as f64 / ROWS as f64;
            let tone = (TAU * 13.3 * x + 0.4).sin();
            6.0 * tone + slow * (TAU * (1.3 * x + 0.6 * x * x)).sin()
        }
    };
    let (names, left) = closed(2, &[], both(9.6));
    assert!(names.is_empty() && left.is_some(), "{names:?}, {left:?}");
    // The half of it: it is most of what there is.
    let (names, left) = closed(1, &[], both(3.6));
    assert!(
        names == ["periodic_pickup"] && left.is_some(),
        "{names:?}, {left:?}"
    );
}

#[test]
fn a_line_that_is_no_neighbour_and_no_harmonic_does_not_take_a_tones_name() {
    let wave = |periods: f64| move |k: usize| (TAU * periods * k as f64 / ROWS as f64).sin();
    let with = |second: f64| {
        let (own, other) = (wave(67.0), wave(second));
        closed(3, &[], move |k, _| 4.0 * own(k) + 1.8 * other(k))
    };
    let (names, left) = with(30.3);
    assert_eq!(names, ["periodic_pickup"], "{left:?}");
    assert_eq!(left.as_deref(), Some("time_s"));
    for second in [134.0, 33.5, 71.0] {
        let (names, left) = with(second);
        assert!(names.is_empty() && left.is_some(), "{second} {names:?}");
    }
}

#[test]
fn a_load_that_comes_and_goes_is_no_tone() {
    for seed in 0..4 {
        let mut random = Random::new(50 + seed);
        // On for four rows of every eleven, give or take two.
        let mut next = 0.0;
        let mut load = vec![0.0; ROWS];
        while next < ROWS as f64 {
            let from = (next + 2.0 * random.normal()).max(0.0) as usize;
            load[from.min(ROWS)..(from + 4).min(ROWS)].fill(1.0);
            next += 11.0;
        }
        let (names, left) = closed(seed, &[], |k, _| 12.0 * load[k]);
        assert!(names.is_empty(), "{seed} {names:?}");
        assert_eq!(left.as_deref(), Some("time_s"), "{seed}");
    }
}

#[test]
fn a_tone_with_what_it_leaves_on_two_levels_is_a_loads() {
    let on_two = |of: &dyn Fn(f64) -> f64| {
        let mut random = Random::new(4);
        let degc = [triangle(ROWS / 2), triangle(ROWS / 2)].concat();
        let periods = 41.0;
        let output = (0..ROWS).map(|k| {
            let wave = of((TAU * periods * k as f64 / ROWS as f64).sin());
            0.3 + 0.1 * wave + 0.01 * random.normal()
        });
        let columns = BTreeMap::from([
            ("rate_out_dps".to_owned(), output.collect()),
            ("die_degc".to_owned(), degc.clone()),
        ]);
        let time_s: Vec<f64> = (0..ROWS).map(|k| 10.0 * k as f64).collect();
        let c = Channels::new(&time_s, &columns, "die_degc", |t| t).unwrap();
        let split = c.split().unwrap();
        let search = Search::new(&c, &split, Effort::default(), Vec::new());
        let frequency_hz = periods / (10.0 * ROWS as f64);
        let candidate: Arc<dyn Candidate> = Arc::new(Pickup {
            frequency_hz,
            further: false,
        });
        let term = Term::new(candidate, Point::at(0, &[frequency_hz]));
        search.is_of_two_levels(&search.model(&[term]).unwrap(), 0)
    };
    assert!(on_two(&|sine| f64::from(u8::from(sine > 0.3))));
    assert!(!on_two(&|sine| sine));
}
