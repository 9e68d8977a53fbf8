//! The declared bias beside an effect that acts on it.

use super::*;
use crate::closure::search::Effort;
use crate::closure::synthetic::Pull;

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
    let off = |bias: &Bias| {
        let pairs = bias.coefficients_dps.iter().zip(Pull::BIAS_DPS);
        pairs.fold(0.0, |m: f64, (b, due)| m.max((b - due).abs()))
    };
    let (found, own) = search.bias_beside(&model, candidate.as_ref(), &point);
    assert_eq!(own.len(), 1);
    (off(&model.bias), off(&found), own[0] / due)
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
