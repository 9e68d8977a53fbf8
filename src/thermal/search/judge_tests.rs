//! The declared bias beside an effect that acts on it.

use super::*;
use crate::thermal::search::Effort;
use crate::thermal::search::Term;
use crate::thermal::synthetic::{Pull, Random};
use std::collections::BTreeMap;

/// How far the bias is from the true one without the pull and beside it, and the pull's coefficient.
fn beside(pull: &Pull, sized: bool) -> (f64, f64, f64) {
    let pulled = pull.made();
    let c = &pulled.channels;
    let search = Search::new(c, &c.split().unwrap(), Effort::default(), Vec::new());
    let is_it = |c: &&Arc<dyn Candidate>| c.id() == "amplitude_phase_coupling";
    let candidate = search.candidates().iter().find(is_it).unwrap();
    let model = search.model(&[]).unwrap();
    let form = pull.power as usize - 1;
    let (point, due) = match sized {
        true => (Point::at(form, &[pulled.most_u]), 1.0),
        false => (Point::form(form), pulled.pull_u),
    };
    let off = |bias: &[f64]| {
        let pairs = bias.iter().zip(Pull::BIAS_DPS);
        pairs.fold(0.0, |m: f64, (b, due)| m.max((b - due).abs()))
    };
    let alone = &model.bias.coefficients_dps;
    let settled = search
        .settling_beside(&model)
        .beside(candidate.as_ref(), &point, alone);
    assert_eq!(settled.own.len(), 1);
    (off(alone), off(&settled.bias), settled.own[0] / due)
}

#[test]
fn the_bias_beside_a_strong_pull_is_the_true_one() {
    for along_slope in [true, false] {
        let pull = Pull {
            pull_rad: 0.2,
            power: 2,
            along_slope,
            ..Pull::default()
        };
        let (alone, found, share) = beside(&pull, !along_slope);
        assert!(
            alone > 0.1 && found < 0.1 * alone,
            "{along_slope}: {alone} alone, {found} beside"
        );
        assert!((share - 1.0).abs() < 0.02, "{along_slope}: {share}");
    }
}

/// What is named first, and what does as well, where a drive gain that goes with the temperature pulls the phase by as much as that moves it.
fn of_a_large_pull(seed: u64) -> (Vec<String>, Vec<String>) {
    let rows = 160;
    let mut random = Random::new(seed);
    let mut course = |memory: f64| -> Vec<f64> {
        let course = random.coloured(rows, memory);
        let most = course.iter().fold(0.0, |m: f64, v| m.max(v.abs()));
        course.iter().map(|v| v / most).collect()
    };
    let (heat, own) = (course(0.98), course(0.95));
    let agc: Vec<f64> = (0..rows)
        .map(|k| 1.04 - 0.07 * heat[k] + 0.04 * own[k])
        .collect();
    let phase = (0..rows).map(|k| -1.58 + 0.05 * heat[k] + 0.3 * (agc[k] - 1.0));
    let phase: Vec<f64> = phase.collect();
    let output = heat
        .iter()
        .map(|u| 8.0 - 3.0 * u + u * u + 0.05 * random.normal());
    let columns = BTreeMap::from([
        ("rate_out_dps".to_owned(), output.collect()),
        ("phase_rad".to_owned(), phase),
        ("agc".to_owned(), agc),
    ]);
    let time_s: Vec<f64> = (0..rows).map(|k| 60.0 * k as f64).collect();
    let c = Channels::new(&time_s, &columns, "phase_rad", |t| t).unwrap();
    let search = Search::new(&c, &c.split().unwrap(), Effort::default(), Vec::new());
    let found = search.run().unwrap();
    let rivals = found.terms.first().map(|t| t.rivals.clone());
    let names = found.terms.iter().map(Term::id).collect();
    (names, rivals.unwrap_or_default())
}

#[test]
fn a_pull_as_large_as_the_range_is_named_and_damping_far_from_its_resonance_is_listed() {
    for seed in 0..6 {
        let (names, rivals) = of_a_large_pull(seed);
        assert_eq!(names, ["amplitude_phase_coupling"], "{seed}");
        assert_eq!(rivals, ["damping_bias"], "{seed}");
    }
}
