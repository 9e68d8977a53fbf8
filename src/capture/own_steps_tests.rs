//! Sets of effects, each judged with its own steps.

use super::super::candidates::{Effect, base, variants};
use super::super::synthetic::{AMPLITUDE, Made, model};
use super::*;

/// Effects that the search takes in the codes of a capture with noise after rounding, best first.
fn found(made: &Made) -> (Vec<Effect>, Own) {
    let capture = made.capture();
    let (known, mut model) = model(&capture, made);
    model.variance.base = [made.noise.powi(2).max(0.07); 2];
    let base = base(&known);
    let free = [[0.0, -AMPLITUDE], [61.7, 20.2]];
    let variants = variants(&known, &model, free, made.rows, false);
    let mut search = OwnSteps::new(&capture, &model, &base, &[], &variants);
    let (set, own) = search.best();
    (set.iter().map(|k| variants[*k].effect).collect(), own)
}

const UNDITHERED: Made = Made {
    noise: 0.3,
    after: true,
    ..Made::CLEAN
};

#[test]
fn an_offset_of_a_part_of_a_code_is_found_and_nothing_else() {
    let made = Made {
        offset: 0.3,
        ..UNDITHERED
    };
    let (effects, own) = found(&made);
    assert_eq!(effects, [Effect::Offset]);
    let offset = own.coefficients[0][super::super::columns::ONE];
    assert!((offset - 0.3).abs() < 0.02, "{offset}");
}

#[test]
fn what_slow_noise_takes_has_its_price() {
    let made = Made {
        offset: 0.3,
        noise: 0.2,
        ..Made::CLEAN
    };
    let capture = made.capture();
    let (known, model) = model(&capture, &made);
    let base = base(&known);
    let free = [[0.0, -AMPLITUDE], [61.7, 20.2]];
    let variants = variants(&known, &model, free, made.rows, false);
    // 0.03 codes rms: the offset is ten times that.
    let wander = [(Combo::one("wander", 0, super::super::columns::ONE), 1e-3)];
    let mut search = OwnSteps::new(&capture, &model, &base, &wander, &variants);
    let is_offset = |v: &Variant| v.combos[0].name == "drive_offset_codes";
    let offset = variants.iter().position(is_offset).unwrap();
    let with = search.fit(&[offset], &model.coefficients);
    // From the same steps, the wander in the offset's place.
    let without = search.fit_from(&[], Some(&with.coefficients));
    assert!(with.objective > without.objective + 10.0);
}

#[test]
fn a_set_is_fitted_again_from_better_steps() {
    let made = Made {
        offset: 0.3,
        ..UNDITHERED
    };
    let capture = made.capture();
    let (known, mut model) = model(&capture, &made);
    model.variance.base = [made.noise.powi(2).max(0.07); 2];
    let base = base(&known);
    let free = [[0.0, -AMPLITUDE], [61.7, 20.2]];
    let variants = variants(&known, &model, free, made.rows, false);
    let mut search = OwnSteps::new(&capture, &model, &base, &[], &variants);
    let poor = Own {
        coefficients: model.coefficients.clone(),
        objective: -1e9,
    };
    search.done.insert(vec![0], poor);
    let own = search.fit(&[0], &model.coefficients);
    assert!(own.objective > -1e6, "{}", own.objective);
}

#[test]
fn nothing_is_found_in_clean_codes_of_few_phases_or_many() {
    for word in [UNDITHERED.word, 5 << 26] {
        let made = Made { word, ..UNDITHERED };
        assert_eq!(found(&made).0, [], "{word}");
    }
}

#[test]
fn phases_are_few_where_each_has_rows() {
    let made = Made {
        word: 5 << 28,
        ..UNDITHERED
    };
    let capture = made.capture();
    let (_, model) = model(&capture, &made);
    assert!(Phases::of(&model, 16 * ROWS_OF_A_PHASE - 1).is_none());
    let phases = Phases::of(&model, 16 * ROWS_OF_A_PHASE).unwrap();
    let mut at: Vec<usize> = (0..16).map(|row| phases.at(row)).collect();
    assert_eq!(phases.at(16), at[0]);
    at.sort_unstable();
    assert_eq!(at, (0..16).collect::<Vec<_>>());
}

#[test]
fn a_phase_gains_what_its_likeliest_variance_gives() {
    assert_eq!(Phases::gain(&[[1e4, 0.0]]), 0.0);
    // Chi-square c of one phase: (c - 1 - ln c) / 2 at the variance (c - 1) / w.
    let (w, mean) = (1e4, 0.5);
    let c = w * mean * mean;
    let gain = Phases::gain(&[[w, w * mean]]);
    let exact = 0.5 * (c - 1.0 - c.ln());
    assert!((gain / exact - 1.0).abs() < 1e-3, "{gain} {exact}");
}
