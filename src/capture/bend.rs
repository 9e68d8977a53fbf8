//! The bend that a step fits, as a curve over the codes with its standard deviation.

use super::columns::{HAT, HATS, Model, ONE, POWER, SAW, SEGMENT};
use super::gram::{Combo, Solved};
use super::search::Search;
use std::ops::Range;

/// A point of the curve: code, bend and its standard deviation, all in codes.
pub type Point = [f64; 3];

/// What the combos `own` of a set add to each channel as a function of the signal, at 129 codes; `None` for a
/// channel that they do not bend.
pub fn curves(
    search: &Search,
    model: &Model,
    set: &[usize],
    (combos, solved): (&[&Combo], &Solved),
    own: Range<usize>,
) -> [Option<Vec<Point>>; 2] {
    [0, 1].map(|channel: usize| {
        let bends = own.clone().filter_map(|k| combos.get(k)).any(|combo| {
            let of_code = |k: usize| (POWER..SAW).contains(&k) || k >= HAT;
            let parts = combo.parts.iter();
            parts.into_iter().any(|p| p.0 == channel && of_code(p.1))
        });
        if !bends {
            return None;
        }
        let weights: Vec<Vec<f64>> = (0..HATS)
            .map(|knot| {
                let of = |(k, combo): (usize, &&Combo)| match own.contains(&k) {
                    true => at(model, combo, channel, knot),
                    false => 0.0,
                };
                combos.iter().enumerate().map(of).collect()
            })
            .collect();
        let deviations = search.deviations(set, &weights);
        let points = weights.iter().zip(deviations).enumerate();
        let curve = points.map(|(knot, (weights, deviation))| {
            let terms = weights.iter().zip(&solved.coefficients);
            let value = terms.map(|(w, c)| w * c).sum();
            [model.span_codes * place(knot), value, deviation]
        });
        Some(curve.collect())
    })
}

/// Knot as a part of the span, -1 to 1.
fn place(knot: usize) -> f64 {
    2.0 * knot as f64 / (HATS - 1) as f64 - 1.0
}

/// A combo's functions of the code in a channel, at a knot.
fn at(model: &Model, combo: &Combo, channel: usize, knot: usize) -> f64 {
    let segment = model.segment(model.span_codes * place(knot));
    let value = |column: usize| match column {
        ONE => 1.0,
        k if (POWER..SAW).contains(&k) => place(knot).powi((k - POWER + 1) as i32),
        k if k == HAT + knot || k == SEGMENT + segment => 1.0,
        _ => 0.0,
    };
    let parts = combo.parts.iter().filter(|p| p.0 == channel);
    parts
        .map(|(_, column, factor)| factor * value(*column))
        .sum()
}
