//! Held-out blocks: contiguous in time, fixed by the number of rows alone.

use super::weights::{self, Bins};
use crate::numeric::polynomial;
use crate::numeric::polynomial::LeastSquares;
use crate::statistics::stats;
use std::ops::Range;

/// Below this many rows there are at most five blocks.
pub const FEW_ROWS: usize = 60;

/// `wanted` contiguous blocks of `n` rows (at most 5 below [`FEW_ROWS`] rows, at most `n`), as
/// equal as can be, the first ones longer: the cut of numpy's `array_split`.
pub fn blocks(n: usize, wanted: u32) -> Vec<Range<usize>> {
    let mut k = (wanted as usize).max(2);
    if n < FEW_ROWS {
        k = k.min(5);
    }
    k = k.min(n);
    let mut out = Vec::with_capacity(k);
    let mut start = 0;
    for i in 0..k {
        let end = start + n / k + usize::from(i < n % k);
        out.push(start..end);
        start = end;
    }
    out
}

/// The rows that a fit uses, in order of time. All vectors have one length.
#[derive(Debug, Clone, PartialEq)]
pub struct Sample {
    /// The thermometer, in its unit.
    pub t: Vec<f64>,
    /// The thermometer scaled to [-1, 1].
    pub x: Vec<f64>,
    /// The error signal, deg/s.
    pub e: Vec<f64>,
    /// [`weights::spike`].
    pub spike: Vec<f64>,
    /// The thermometer's bins.
    pub bins: Bins,
    /// False: dwells keep their weight (ordinary least squares but for spikes), for comparison.
    pub limit_dwells: bool,
}

impl Sample {
    /// The weights of the rows that `used` marks, from those rows alone; 0 for the others.
    pub fn weights(&self, used: impl Fn(usize) -> bool) -> Vec<f64> {
        let share = weights::dwell(
            (0..self.t.len()).filter(|i| used(*i)).map(|i| self.t[i]),
            self.bins,
        );
        let weight = |i: usize| match (used(i), self.limit_dwells) {
            (false, _) => 0.0,
            (true, true) => share(self.t[i]) * self.spike[i],
            (true, false) => self.spike[i],
        };
        (0..self.t.len()).map(weight).collect()
    }

    /// The least-squares problem of the rows that `used` marks, for orders up to `order`.
    pub fn problem(&self, order: usize, used: impl Fn(usize) -> bool) -> LeastSquares {
        LeastSquares::new(&self.x, &self.e, &self.weights(used), order)
    }

    /// What a polynomial in x leaves of the error signal, deg/s.
    pub fn residuals(&self, coefficients: &[f64]) -> Vec<f64> {
        let rows = self.x.iter().zip(&self.e);
        rows.map(|(x, e)| e - polynomial::evaluate(coefficients, *x))
            .collect()
    }
}

/// What comes of predicting every block from the others by a polynomial of one order.
#[derive(Debug, Clone, PartialEq)]
pub struct HeldOut {
    /// What predicts each block.
    coefficients: Vec<Vec<f64>>,
    /// Over all rows, spikes included, each counting once: comparable with figures that others
    /// publish for the same cut.
    pub rms_dps: f64,
    /// The largest, over all rows.
    pub max_abs_dps: f64,
    /// Over the rows that are no spikes.
    pub clean_rms_dps: f64,
    /// The mean square over the rows of each block that are no spikes, (deg/s)^2.
    pub block_mean_square: Vec<f64>,
}

/// The held-out errors of all orders up to `highest`: each block predicted from a fit to the
/// others, whose weights never see the block.
pub fn cross_validate(sample: &Sample, highest: usize, blocks: &[Range<usize>]) -> Vec<HeldOut> {
    let problems: Vec<LeastSquares> = blocks
        .iter()
        .map(|block| sample.problem(highest, |i| !block.contains(&i)))
        .collect();
    (0..=highest)
        .map(|order| {
            let coefficients = problems.iter().map(|p| p.coefficients(order)).collect();
            HeldOut::new(sample, coefficients, blocks)
        })
        .collect()
}

impl HeldOut {
    /// No rows, no errors.
    pub fn nothing() -> Self {
        HeldOut {
            coefficients: Vec::new(),
            rms_dps: f64::NAN,
            max_abs_dps: f64::NAN,
            clean_rms_dps: f64::NAN,
            block_mean_square: Vec::new(),
        }
    }

    /// The figures of blocks that are predicted by `coefficients`.
    fn new(sample: &Sample, coefficients: Vec<Vec<f64>>, blocks: &[Range<usize>]) -> Self {
        let mut out = HeldOut {
            coefficients,
            ..HeldOut::nothing()
        };
        let errors = out.errors(sample, blocks);
        let (mut sum, mut count) = (0.0, 0.0);
        for block in blocks {
            let clean = block.clone().filter(|i| sample.spike[*i] >= 0.5);
            let (block_sum, block_count) =
                clean.fold((0.0, 0.0), |(s, n), i| (s + errors[i] * errors[i], n + 1.0));
            if block_count > 0.0 {
                out.block_mean_square.push(block_sum / block_count);
            }
            sum += block_sum;
            count += block_count;
        }
        out.rms_dps = stats::rms(&errors);
        out.max_abs_dps = errors.iter().fold(0.0, |m, e| m.max(e.abs()));
        if count > 0.0 {
            out.clean_rms_dps = f64::sqrt(sum / count);
        }
        out
    }

    /// Of each row, deg/s: measured minus predicted. `sample` and `blocks` are those of [`cross_validate`].
    pub fn errors(&self, sample: &Sample, blocks: &[Range<usize>]) -> Vec<f64> {
        let mut errors = vec![0.0; sample.e.len()];
        for (block, c) in blocks.iter().zip(&self.coefficients) {
            for i in block.clone() {
                errors[i] = sample.e[i] - polynomial::evaluate(c, sample.x[i]);
            }
        }
        errors
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn blocks_are_those_of_array_split() {
        let lengths = |n, k| -> Vec<usize> { blocks(n, k).iter().map(Range::len).collect() };
        assert_eq!(lengths(320, 10), [32; 10]);
        assert_eq!(lengths(268, 10), [27, 27, 27, 27, 27, 27, 27, 27, 26, 26]);
        assert_eq!(lengths(59, 10), [12, 12, 12, 12, 11]);
        assert_eq!(lengths(3, 10), [1; 3]);
        assert_eq!(blocks(268, 10).last().map(|b| b.end), Some(268));
        assert!(blocks(0, 10).is_empty());
    }
}
