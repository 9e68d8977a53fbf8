//! Names that another one's shape called for when it was off.

use super::*;
use crate::closure::effects::Candidate;
use crate::closure::search::{Effort, Search};
use crate::closure::synthetic::Pull;
use std::sync::Arc;

/// What stays of a large pull whose shape is a fifth too small and of two names beside it: a supply that is there (or not),
/// and damping, which mends what the pull is off.
fn stay(supply_dps: f64) -> Vec<String> {
    let pull = Pull {
        supply_dps,
        ..Pull::default()
    };
    let pulled = pull.made();
    let c = &pulled.channels;
    let split = c.split().expect("enough rows");
    let search = Search::new(c, &split, Effort::default(), Vec::new());
    let term = |id: &str, point: Point| {
        let is_it = |c: &&Arc<dyn Candidate>| c.id() == id;
        let candidate = search.candidates().iter().find(is_it).expect(id).clone();
        Term::new(candidate, point)
    };
    let terms = [
        term(
            "amplitude_phase_coupling",
            Point::at(0, &[0.8 * pulled.most_u]),
        ),
        term("damping_bias", Point::form(0)),
        term("supply_sensitivity", Point::form(0)),
    ];
    let model = search.model(&terms).expect("enough rows");
    let spared = search.spared(model).expect("enough rows");
    spared.terms.iter().map(Term::id).collect()
}

#[test]
fn a_name_that_mended_anothers_shape_is_taken_back_and_a_cause_is_not() {
    assert_eq!(stay(0.0), ["amplitude_phase_coupling"]);
    assert_eq!(
        stay(0.1),
        ["amplitude_phase_coupling", "supply_sensitivity"]
    );
}
