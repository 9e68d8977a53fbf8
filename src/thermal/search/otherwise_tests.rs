use super::*;
use crate::thermal::channels::Channels;
use crate::thermal::effects::Candidate;
use crate::thermal::search::{Effort, Search};
use crate::thermal::synthetic::{Random, triangle};
use std::collections::BTreeMap;

/// Names, and the channel of what is left, of a large effect of the acceleration's square, read with noise.
fn of_noisy_squares(seed: u64, reading_g: f64) -> (Vec<String>, Option<String>) {
    let (rows, mut random) = (1100, Random::new(seed));
    let degc = [triangle(rows / 2), triangle(rows / 2)].concat();
    // Tumbled, a dozen rows in each position.
    let places = [1.0, 0.0, -1.0, 0.71, -0.71, 0.5];
    let accel = |k: usize| places[k / 12 * 5 % 6];
    let output = (0..rows).map(|k| {
        let bias = 0.3 - 0.002 * degc[k];
        bias - 0.067 * accel(k) * accel(k) + 0.002 * random.normal()
    });
    let output = output.collect();
    let read = (0..rows).map(|k| accel(k) + reading_g * random.normal());
    let columns = BTreeMap::from([
        ("rate_out_dps".to_owned(), output),
        ("accel_g".to_owned(), read.collect()),
        ("die_degc".to_owned(), degc),
    ]);
    let time_s: Vec<f64> = (0..rows).map(|k| 8.0 * k as f64).collect();
    let c = Channels::new(&time_s, &columns, "die_degc", |t| t).unwrap();
    let search = Search::new(&c, &c.split().unwrap(), Effort::default(), Vec::new());
    let found = search.run().unwrap();
    (found.terms.iter().map(Term::id).collect(), found.left)
}

#[test]
fn a_large_effect_of_a_noisy_channel_has_its_name_and_leaves_a_little() {
    let name = || vec!["g_squared_sensitivity".to_owned()];
    for (seed, reading_g) in [(1, 0.03), (2, 0.04), (3, 0.04)] {
        let (names, left) = of_noisy_squares(seed, reading_g);
        assert_eq!(
            (names, left),
            (name(), Some("accel_g".to_owned())),
            "{seed}"
        );
    }
    assert_eq!(of_noisy_squares(4, 0.0), (name(), None));
}

#[test]
fn one_name_that_looks_like_the_sum_of_two_gives_its_place_to_them() {
    let rows = 1600;
    for seed in 0..3 {
        let mut random = Random::new(seed);
        let time_s: Vec<f64> = (0..rows).map(|k| 20.0 * k as f64).collect();
        let turn = std::f64::consts::TAU / 9000.0;
        let degc = |t: f64| 30.0 - 44.0 * (turn * t).cos();
        let output = time_s.iter().map(|t| {
            let rate = 44.0 * turn * (turn * t).sin();
            let ageing = 0.1 * (1.0 + t / 3700.0).ln();
            0.3 - 0.004 * degc(*t) - 0.9 * rate + ageing + 0.0067 * random.normal()
        });
        let columns = BTreeMap::from([
            ("rate_out_dps".to_owned(), output.collect::<Vec<f64>>()),
            (
                "die_degc".to_owned(),
                time_s.iter().map(|t| degc(*t)).collect(),
            ),
        ]);
        let c = Channels::new(&time_s, &columns, "die_degc", |t| t).unwrap();
        let search = Search::new(&c, &c.split().unwrap(), Effort::default(), Vec::new());
        let found = search.run().unwrap();
        let mut names: Vec<String> = found.terms.iter().map(Term::id).collect();
        names.sort();
        assert_eq!(names, ["ageing_drift", "temperature_rate"], "{seed}");
    }
}

#[test]
fn white_noise_is_hardly_ever_as_rough_as_what_is_left() {
    let mut random = Random::new(6);
    for rows in [16, 25, 40, 200] {
        let rough = |random: &mut Random| {
            let noise: Vec<f64> = (0..rows).map(|_| random.normal()).collect();
            stats::rms(&noise) / stats::difference_noise(&noise) > ROUGH.max(rough_by_chance(rows))
        };
        let count = (0..4000).filter(|_| rough(&mut random)).count();
        assert!(count < 20, "{rows}: {count}");
    }
    assert!(rough_by_chance(60) < ROUGH && rough_by_chance(20) > ROUGH);
}

#[test]
fn accidents_stand_alone() {
    let marked = |rows: &[usize]| {
        let mut out = vec![false; 300];
        for row in rows {
            out[*row] = true;
        }
        stand_together(&out)
    };
    assert!(!marked(&[]));
    let alone: Vec<usize> = (0..60).map(|k| 5 * k).collect();
    assert!(!marked(&alone));
    assert!(!marked(&[10, 11, 90, 91, 200, 201]));
    assert!(marked(&[40, 41, 42, 43, 44, 45]));
    // Half of all rows, at random, have neighbours.
    let mut random = crate::thermal::synthetic::Random::new(5);
    let half: Vec<usize> = (0..300).filter(|_| random.normal() > 0.0).collect();
    assert!(!marked(&half));
}

/// A bias that falls with temperature, and a supply's effect.
fn of_a_supply() -> Channels {
    let (rows, mut random) = (300, Random::new(11));
    let degc = [triangle(rows / 2), triangle(rows / 2)].concat();
    let supply = |k: usize| f64::from(u8::from(k / 11 % 3 == 1));
    let output =
        (0..rows).map(|k| 0.3 - 0.002 * degc[k] + 0.05 * supply(k) + 0.01 * random.normal());
    let columns = BTreeMap::from([
        ("rate_out_dps".to_owned(), output.collect::<Vec<f64>>()),
        ("supply_v".to_owned(), (0..rows).map(supply).collect()),
        ("die_degc".to_owned(), degc.clone()),
    ]);
    let time_s: Vec<f64> = (0..rows).map(|k| 8.0 * k as f64).collect();
    Channels::new(&time_s, &columns, "die_degc", |t| t).unwrap()
}

fn owned(names: &[&str]) -> Vec<String> {
    names.iter().map(|name| (*name).to_owned()).collect()
}

/// What is due after a first run with these names, which explain everything.
fn due(net: f64, names: &[&str]) -> Due {
    Due {
        whole: net,
        all_but: net,
        names: owned(names),
        refuted: Vec::new(),
        visited: Vec::new(),
    }
}

#[test]
fn a_run_ends_where_its_steps_cannot_come_to_what_is_due() {
    let c = of_a_supply();
    let search = Search::new(&c, &c.split().unwrap(), Effort::default(), Vec::new());
    let none = search.model(&[]).unwrap();
    let round = search.round(&none, 0);
    let is_best = |j: &&Judged| j.is_named();
    let best = round.judged.iter().find(is_best).unwrap().net;
    assert!(best > 2.0 * UNSEEN, "{best}");
    let with = |more: f64, names: &[&str]| {
        let due = due(search.net(&none) + more, names);
        (
            search.falls_short(&none, &round, &due),
            search.is_beyond(&none, &due),
        )
    };
    let step = best + UNSEEN;
    // Where the first run left something, as many steps as a run has; else one more than it has names.
    assert!(!with(4.9 * step, &[]).0);
    assert!(with(5.1 * step, &[]).0);
    assert!(!with(1.9 * step, &["a"]).0);
    assert!(with(2.1 * step, &["a"]).0);
    assert!(!with(3.1 * step, &["a", "b", "c"]).0);
    // The best beside a model, and a little.
    assert!(!with(best + 0.9 * HOPE, &[]).1);
    assert!(with(best + 1.1 * HOPE, &[]).1);
}

#[test]
fn a_run_that_was_opened_is_back_with_all_names_of_the_first() {
    let c = of_a_supply();
    let search = Search::new(&c, &c.split().unwrap(), Effort::default(), Vec::new());
    let back = |own: &[&str], first: &[&str]| search.is_back(&owned(own), &due(0.0, first));
    assert!(!back(&["a", "b"], &["a", "b"]), "nothing was opened");
    search.begin(Beginning {
        opening: Some("b".to_owned()),
        ..Beginning::default()
    });
    assert!(back(&["b", "a"], &["a", "b"]) && back(&["b", "c", "a"], &["a", "b"]));
    assert!(!back(&["b", "c"], &["a", "b"]));
    assert!(!back(&["b"], &[]), "the first run left something");
}

#[test]
fn a_run_that_was_opened_has_to_be_better_where_the_first_one_was() {
    let c = of_a_supply();
    let search = Search::new(&c, &c.split().unwrap(), Effort::default(), Vec::new());
    let at = |ids: &[&str], net: f64| Visited {
        ids: owned(ids),
        net,
    };
    let due = Due {
        visited: vec![at(&[], 0.0), at(&["a"], 30.0), at(&["a", "b"], 50.0)],
        ..due(0.0, &[])
    };
    let here = at(&["a", "b"], 50.0 + 0.9 * BETTER);
    assert!(!search.was_there(&here, &due), "nothing was opened");
    search.begin(Beginning {
        opening: Some("b".to_owned()),
        ..Beginning::default()
    });
    assert!(search.was_there(&here, &due));
    assert!(!search.was_there(&at(&["a", "b"], 50.0 + 1.1 * BETTER), &due));
    assert!(!search.was_there(&at(&["b"], 20.0), &due));
    assert!(
        !search.was_there(&at(&[], 0.0), &due),
        "where every run begins"
    );
    let model = search.model(&[]).unwrap();
    let here = search.visited(&model);
    assert!(here.ids.is_empty() && here.net == search.net(&model));
}

#[test]
fn where_a_shape_without_a_name_came_first_it_alone_is_left_out() {
    let c = of_a_supply();
    let search = Search::new(&c, &c.split().unwrap(), Effort::default(), Vec::new());
    let term = |is: &dyn Fn(&dyn Candidate) -> bool, beside: &[&str]| {
        let candidate = search.candidates().iter().find(|k| is(k.as_ref())).unwrap();
        let point = candidate.points(&c).remove(0);
        Term {
            beside: owned(beside),
            ..Term::new(candidate.clone(), point)
        }
    };
    let stranger = |beside: &[&str]| term(&|k| !k.named(), beside);
    let jump = |beside: &[&str]| term(&|k| k.id() == "stress_jump", beside);
    let supply = term(&|k| k.id() == "supply_sensitivity", &[]);
    let barred = |terms: &[Term]| -> Vec<String> {
        let others = beginnings(terms, &Found::default(), &due(0.0, &[]));
        others.into_iter().flat_map(|b| b.barred).collect()
    };
    let strange = stranger(&[]).id();
    assert_eq!(
        barred(&[stranger(&[]), jump(&[&strange])]),
        std::slice::from_ref(&strange)
    );
    let after = [
        supply,
        jump(&["supply_sensitivity"]),
        stranger(&["stress_jump"]),
    ];
    assert_eq!(barred(&after), ["stress_jump".to_owned(), strange]);
}
