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

/// Passes of [`beside_white`].
const PASSES: usize = 3;

/// Most accidents of a short record, and of how many rows one may begin; of how many rows all of them may spoil one.
const FEW: usize = 2;
const RARELY: usize = 50;
const LITTLE: usize = 20;

/// Most rows that one accident spoils.
pub const LONGEST: usize = 7;

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

/// Weights beside white noise, if the spikes then are accidents: more of them may be what a cause does now and then.
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
    (spikes.contains(&true) && are_accidents(&spikes)).then_some(own)
}

/// Whether marked rows are accidents: a shock or a lost word spoils a row or a few in a row, once in a while.
pub fn are_accidents(marked: &[bool]) -> bool {
    let runs = marked.chunk_by(|a, b| a == b).filter(|run| run[0]);
    let lengths: Vec<usize> = runs.map(<[bool]>::len).collect();
    let few = lengths.len() <= (marked.len() / RARELY).max(FEW);
    // In a short record a few rows in a row are a good part of it.
    let little = lengths.iter().sum::<usize>() <= (marked.len() / LITTLE).max(FEW);
    few && little && lengths.iter().all(|rows| *rows <= LONGEST)
}

/// White variance factors for weights; rows of weight 0 are not used.
pub fn factors(plain: &[f64], weights: &[f64]) -> Vec<f64> {
    plain
        .iter()
        .zip(weights)
        .map(|(f, w)| if *w > 0.0 { f / w } else { f64::INFINITY })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn few_short_runs_are_accidents() {
        let marked = |runs: &[(usize, usize)]| {
            let mut out = vec![false; 300];
            for (from, rows) in runs {
                out[*from..from + rows].fill(true);
            }
            are_accidents(&out)
        };
        assert!(marked(&[]));
        assert!(marked(&[(0, 7), (100, 1), (102, 3), (296, 4)]));
        // Eight in a row are a cause, and so is what comes again and again.
        assert!(!marked(&[(40, 8)]));
        let often: Vec<(usize, usize)> = (0..7).map(|k| (40 * k, 1)).collect();
        assert!(marked(&often[..6]) && !marked(&often));
        // One row in twenty, or two in a record of few rows: what a clip holds of these is more.
        assert!(!marked(&[(0, 7), (100, 1), (102, 3), (295, 5)]));
        let clipped: Vec<bool> = (0..33).map(|k| (14..19).contains(&k)).collect();
        assert!(!are_accidents(&clipped));
        assert!(are_accidents(&[true, false, true, false]));
        assert!(!are_accidents(&[true, false, true, false, true]));
    }
}
