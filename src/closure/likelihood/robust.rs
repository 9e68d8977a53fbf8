//! Spikes: rows that do not fit to all others, before and after them.
//!
//! The test of a row is its auxiliary residual ([`super::whiten::Whitener::auxiliary`]): how far the row is
//! from what all other rows predict for it under the noise's own memory. A step or a drift, which
//! neighbours share, is no spike.

use super::lattice::{Evaluated, Problem};
use super::noise::Shape;
use super::whiten::Whitener;

/// Deviations, in robust standard deviations, from which a row's weight falls, and at which it is 0.
/// One clean row in 16000 is beyond the first.
pub const SPIKE: (f64, f64) = (4.0, 8.0);

/// Minus the log-density of a spike, in units of the white deviation: it may lie anywhere within some twenty deviations, and
/// happens once in a hundred rows.
pub const ACCIDENT: f64 = 8.0;

/// Passes of [`beside_white`]; most spikes of a short record, and of how many rows one may be a spike.
const PASSES: usize = 3;
const FEW: usize = 2;
const RARELY: usize = 100;

/// The weight of a row `deviation` robust standard deviations off: 1, falling linearly to 0.
pub fn weight(deviation: f64) -> f64 {
    ((SPIKE.1 - deviation) / (SPIKE.1 - SPIKE.0)).clamp(0.0, 1.0)
}

/// Standard deviation from the median of absolute values (for numbers around 0); 0 for none.
pub fn scale(values: impl Iterator<Item = f64>) -> f64 {
    let mut sizes: Vec<f64> = values.map(f64::abs).collect();
    if sizes.is_empty() {
        return 0.0;
    }
    let middle = sizes.len() / 2;
    *sizes.select_nth_unstable_by(middle, f64::total_cmp).1 / 0.674_489_75
}

/// White variance, in units of a row's own, by which a row of no weight says nothing of the others.
const SILENT: f64 = 1e8;

/// The weights of the rows under a fitted shape. `plain` is the problem with every used row at full
/// weight, `weighted` the one that was fitted: its coefficients are taken, so that spikes do not bend them. Each row is
/// tested against what the weighted others predict for it: beside a spike at full weight, where the noise has a memory, its
/// neighbours would be spikes as well.
pub fn weights(plain: &Problem, weighted: &Problem, at: &Evaluated) -> Vec<f64> {
    let (y, basis) = weighted.whiten(&Whitener::new(&weighted.line, at.shape));
    let z: Vec<f64> = basis.q.iter().map(|q| super::linear::dot(q, &y)).collect();
    let beta = basis.solve(&z);
    let mut residual = plain.y.clone();
    for (column, b) in plain.columns.iter().zip(&beta) {
        super::linear::add_scaled(&mut residual, -b, column);
    }
    let own = &plain.line.white_factor;
    let given = own.iter().zip(&weighted.line.white_factor);
    let given: Vec<f64> = given.map(|(own, w)| w.min(SILENT * own)).collect();
    let whitener = Whitener::new(&plain.line.with_white_factor(given.clone()), at.shape);
    let auxiliary = whitener.auxiliary(&whitener.apply(&residual));
    let pairs = auxiliary.iter().zip(own.iter().zip(&given));
    let tests: Vec<f64> = pairs
        .map(|((u, d), (own, given))| {
            // Off by u / d from what the others say, with the variance 1 / d, of which the row has its own as it is.
            let variance = 1.0 / d - (given - own);
            if *d > 0.0 && variance > 0.0 {
                u / d / variance.sqrt()
            } else {
                f64::NAN
            }
        })
        .collect();
    let unit = scale(tests.iter().copied().filter(|t| t.is_finite()));
    tests
        .iter()
        .map(|t| {
            if unit > 0.0 && t.is_finite() {
                weight(t.abs() / unit)
            } else {
                1.0
            }
        })
        .collect()
}

/// Weights beside white noise, if there are few spikes then, each by itself: more of them may be what a cause does now and
/// then.
pub fn beside_white(plain: &Problem) -> Option<Vec<f64>> {
    let mut weighted = plain.clone();
    let mut own = vec![1.0; plain.y.len()];
    for _ in 0..PASSES {
        own = weights(plain, &weighted, &weighted.evaluate(Shape::default()));
        weighted.line = plain
            .line
            .with_white_factor(factors(&plain.line.white_factor, &own));
    }
    let used = own.iter().zip(&plain.line.white_factor);
    let spikes: Vec<bool> = used
        .filter(|(_, factor)| factor.is_finite())
        .map(|(w, _)| *w < 0.5)
        .collect();
    let count = spikes.iter().filter(|s| **s).count();
    let few = count <= (spikes.len() / RARELY).max(FEW);
    let alone = spikes.windows(2).all(|pair| !(pair[0] && pair[1]));
    (count > 0 && few && alone).then_some(own)
}

/// White variance factors for weights; rows of weight 0 are not used.
pub fn factors(plain: &[f64], weights: &[f64]) -> Vec<f64> {
    plain
        .iter()
        .zip(weights)
        .map(|(f, w)| if *w > 0.0 { f / w } else { f64::INFINITY })
        .collect()
}
