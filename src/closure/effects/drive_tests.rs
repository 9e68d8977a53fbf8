//! A drive whose gain pulls the measured phase, small and large.

use super::*;
use crate::closure::search::{Effort, Search, Term as Step};
use crate::closure::synthetic::Pull;

#[test]
fn less_q_does_not_bend_the_phase_back() {
    for (form, beta, admitted) in [
        (0, vec![-3.0], true),
        (1, vec![0.9], true),
        (1, vec![-0.9], false),
        (2, vec![-3.0, 0.9], true),
        (2, vec![3.0, -0.9], false),
    ] {
        assert_eq!(
            Damping.admits(&Point::form(form), &beta),
            admitted,
            "{form}"
        );
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
        let pairs = values.iter().zip(&split.heldout);
        pairs.filter(|(_, h)| **h).map(|(v, _)| v * v).sum()
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
