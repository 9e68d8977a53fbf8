//! A drive whose gain pulls the measured phase, small and large.

use super::*;
use crate::statistics::blocks::Role;
use crate::thermal::search::{Effort, Search, Term as Step};
use crate::thermal::synthetic::{Pull, Random, triangle};
use std::collections::BTreeMap;

#[test]
fn less_q_does_not_bend_the_phase_back() {
    let c = Pull::default().made().channels;
    for (form, beta, admitted) in [
        (0, vec![-3.0], true),
        (0, vec![1500.0], false),
        (1, vec![0.9], true),
        (1, vec![-0.9], false),
        (1, vec![1.8], true),
        (2, vec![-3.0, 0.9], true),
        (2, vec![3.0, -0.9], false),
    ] {
        assert_eq!(
            Damping.admits(&c, &Point::form(form), &beta),
            admitted,
            "{form}"
        );
    }
    // Beside a resonance of its own, a share of nearly two is another effect.
    for (form, beta, admitted) in [(1, vec![0.9], true), (2, vec![3.0, 1.8], false)] {
        let free = Point::at(form, &[0.2]);
        assert_eq!(Damping.admits(&c, &free, &beta), admitted, "{form}");
    }
}

#[test]
fn the_phase_is_a_channel_of_a_damping_that_bends_it() {
    let pulled = Pull::default().made();
    let c = &pulled.channels;
    assert_eq!(Damping.channels_at(c, &Point::form(0)), ["agc"]);
    let both = ["agc", "phase_rad"];
    assert_eq!(Damping.channels_at(c, &Point::form(2)), both);
}

/// A phase that bends as the damping does, read behind a delay of 0.25 rad: the only name, with its share and the delay.
#[test]
fn damping_behind_a_demodulators_delay_is_the_only_name() {
    const ROWS: usize = 600;
    const DELAY_RAD: f64 = 0.25;
    let resonance = -std::f64::consts::FRAC_PI_2 + DELAY_RAD;
    let mut random = Random::new(12);
    let degc = [triangle(200), triangle(400)].concat();
    // Gas damping follows the temperature, and the pressure of the package besides.
    let gain: Vec<f64> = (0..ROWS)
        .map(|k| 1.0 + 0.12 * (0.05 * k as f64).sin())
        .collect();
    let nominal = |degc: f64| resonance - 0.1 - 0.35 * (degc / 35.0 - 1.0);
    let phase: Vec<f64> = (0..ROWS)
        .map(|k| resonance + ((nominal(degc[k]) - resonance).tan() / gain[k]).atan())
        .collect();
    let output = degc.iter().map(|t| {
        let u = t / 35.0 - 1.0;
        8.0 - 3.0 * u + u * u + 0.01 * random.normal()
    });
    let columns = BTreeMap::from([
        ("rate_out_dps".to_owned(), output.collect()),
        ("phase_rad".to_owned(), phase),
        ("agc".to_owned(), gain),
    ]);
    let time_s: Vec<f64> = (0..ROWS).map(|k| 10.0 * k as f64).collect();
    let degc_of = |rad: f64| 35.0 - (rad - resonance + 0.1) * 100.0;
    let channels = Channels::new(&time_s, &columns, "phase_rad", degc_of).unwrap();
    let split = channels.split().unwrap();
    let search = Search::new(&channels, &split, Effort::default(), Vec::new());
    let found = search.run().unwrap();
    let names: Vec<String> = found.terms.iter().map(Step::id).collect();
    assert_eq!(names, ["damping_bias"]);
    let model = search.model(&found.terms).unwrap();
    let estimate = search.estimates(&model).remove(0);
    let reported = found.terms[0].candidate.report(&channels, &estimate);
    let is = |name: &str, due: f64| {
        let (value, _) = reported[name];
        assert!((value - due).abs() < 0.05, "{name}: {value} for {due}");
    };
    is("share_of_phase_bend", 1.0);
    is("resonance_off_rad", DELAY_RAD);
}

/// A drive off its resonance, three tenths of whose measured phase are the structure's and the rest the electronics': the
/// gain holds the amplitude against the spring as well, and what it does beside 1/Q is no third order of the phase.
#[test]
fn damping_of_a_drive_off_its_resonance_is_the_only_name() {
    const ROWS: usize = 300;
    const STRUCTURAL: f64 = 0.3;
    let degc = [triangle(100), triangle(200)].concat();
    let damping: Vec<f64> = (0..ROWS as u32)
        .map(f64::from)
        .map(|k| 1.0 + 0.024 * (0.05 * k).sin() + 0.012 * (0.13 * k).sin())
        .collect();
    let resonance = -std::f64::consts::FRAC_PI_2;
    // The structure's phase from resonance, were the damping nominal.
    let nominal: Vec<f64> = degc
        .iter()
        .map(|t| 0.02 - 0.08 * (t / 35.0 - 1.0))
        .collect();
    let pairs = || nominal.iter().zip(&damping);
    let electronics = |angle: f64| (1.0 / STRUCTURAL - 1.0) * angle;
    let phase = pairs().map(|(a, d)| resonance + (a.tan() / d).atan() + electronics(*a));
    let gain = pairs().map(|(a, d)| d.hypot(a.tan()));
    let (phase, gain): (Vec<f64>, Vec<f64>) = (phase.collect(), gain.collect());
    for seed in 1..=3 {
        let mut random = Random::new(seed);
        let output = pairs().map(|(a, d)| {
            let p = a / STRUCTURAL;
            65.0 - 187.0 * p + 136.0 * p * p + 20.0 * (d - 1.0) + 0.01 * random.normal()
        });
        let columns = BTreeMap::from([
            ("rate_out_dps".to_owned(), output.collect()),
            ("phase_rad".to_owned(), phase.clone()),
            ("agc".to_owned(), gain.clone()),
        ]);
        let time_s: Vec<f64> = (0..ROWS).map(|k| 10.0 * k as f64).collect();
        let degc_of = |rad: f64| 43.75 - (rad - resonance) * 131.25;
        let channels = Channels::new(&time_s, &columns, "phase_rad", degc_of).unwrap();
        let split = channels.split().unwrap();
        let search = Search::new(&channels, &split, Effort::default(), Vec::new());
        let found = search.run().unwrap();
        let names: Vec<String> = found.terms.iter().map(Step::id).collect();
        assert_eq!(names, ["damping_bias"], "{seed}");
        let model = search.model(&found.terms).unwrap();
        let estimate = search.estimates(&model).remove(0);
        let reported = found.terms[0].candidate.report(&channels, &estimate);
        let is = |name: &str, due: f64, within: f64| {
            let (value, _) = reported[name];
            assert!((value - due).abs() < within, "{seed}, {name}: {value}");
        };
        is("structural_share_of_phase", STRUCTURAL, 0.06);
        is("share_of_phase_bend", 1.0, 0.2);
        is("resonance_off_rad", 0.0, 0.06);
        is("gain_dps", 20.0, 3.0);
    }
}

/// The only name that a pull gets, its pull over the true one, and the held-out error over the noise of the same rows.
fn named(pull: &Pull) -> (f64, f64) {
    let pulled = pull.made();
    let c = &pulled.channels;
    let split = c.split().unwrap();
    let search = Search::new(c, &split, Effort::default(), Vec::new());
    let found = search.run().unwrap();
    let names: Vec<String> = found.terms.iter().map(Step::id).collect();
    assert_eq!(names, ["amplitude_phase_coupling"], "{}", pull.pull_rad);
    let model = search.model(&found.terms).unwrap();
    let estimate = search.estimates(&model).remove(0);
    let reported = found.terms[0].candidate.report(c, &estimate);
    let held = |values: &[f64]| -> f64 {
        let pairs = values.iter().zip(split.rows(Role::Choose));
        pairs.filter(|(_, h)| *h).map(|(v, _)| v * v).sum()
    };
    let square = held(&model.residual(c)) / held(&pulled.noise_dps);
    (reported["pull_rad"].0 / pull.pull_rad, square.sqrt())
}

#[test]
fn a_pull_of_half_the_phases_range_by_the_gains_square_is_the_only_name() {
    for (pull_rad, moved_u) in [(0.3, 0.9..1.1), (-0.3, -1.1..-0.9), (0.1, 0.5..0.8)] {
        let pull = Pull {
            pull_rad,
            power: 2,
            ..Pull::default()
        };
        let most_u = pull.made().most_u;
        assert!(moved_u.contains(&most_u), "{pull_rad}: {most_u}");
        let (ratio, error) = named(&pull);
        assert!((ratio - 1.0).abs() < 0.02, "{pull_rad}: {ratio}");
        assert!(error < 1.05, "{pull_rad}: {error}");
    }
}

#[test]
fn a_small_pull_is_the_only_name() {
    for (pull_rad, power) in [(0.003, 1), (-0.003, 2), (0.001, 2)] {
        let pull = Pull {
            pull_rad,
            power,
            ..Pull::default()
        };
        let most_u = pull.made().most_u;
        assert!(most_u.abs() < 0.05, "{pull_rad}: {most_u}");
        let (ratio, error) = named(&pull);
        assert!((ratio - 1.0).abs() < 0.1, "{pull_rad}: {ratio}");
        assert!(error < 1.05, "{pull_rad}: {error}");
    }
}

#[test]
fn a_small_pull_of_a_million_radians_is_none() {
    let coupling = Coupling { pulls: Vec::new() };
    let c = Pull::default().made().channels;
    assert!(coupling.admits(&c, &Point::form(0), &[30.0]));
    assert!(!coupling.admits(&c, &Point::form(1), &[-3e6]));
    // A large one has its size in its shape.
    assert!(coupling.admits(&c, &Point::at(0, &[0.4]), &[1.0]));
}
