//! Errors of a model over the rows, row by row and in figures, and what its steps change of them.

use super::columns::{Model, Rows, chunks};
use super::input::{Capture, Part};
use crate::verdict::Errors;

/// Errors in codes over both columns, and the held-out chi-square (weights one over the variances).
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Judged {
    /// As reported.
    pub errors: Errors,
    /// Sum of squares over variances, held-out rows.
    pub heldout_chi: f64,
    /// The same of the training rows.
    pub train_chi: f64,
}

/// With the model's own coefficients.
pub fn judge(capture: &Capture, model: &Model) -> Judged {
    let mut rows = Rows::new();
    let mut out = Judged::default();
    // Train, held out: count and sum of squares.
    let mut sums = [[0.0f64; 2]; 2];
    for segment in &capture.segments {
        let held = usize::from(segment.part == Part::HeldOut);
        for chunk in chunks(segment.rows.clone()) {
            let (start, n) = (chunk.start, chunk.len());
            rows.fill(capture, model, chunk);
            for channel in 0..2 {
                let base = model.variance.base[channel];
                for i in (0..n).filter(|i| !capture.is_left_out(start + i)) {
                    let error = rows.error(model, channel, i);
                    sums[held][0] += 1.0;
                    sums[held][1] += error * error;
                    let slope = rows.slope[channel][i];
                    let variance = base + model.variance.jitter[channel] * slope * slope;
                    if held == 0 {
                        out.train_chi += error * error / variance;
                    } else {
                        out.heldout_chi += error * error / variance;
                        let largest = &mut out.errors.heldout_max_abs;
                        *largest = largest.max(error.abs());
                    }
                }
            }
        }
    }
    let rms = |[n, sum]: [f64; 2]| (sum / n.max(1.0)).sqrt();
    out.errors.train_rms = rms(sums[0]);
    out.errors.heldout_rms = rms(sums[1]);
    out
}

/// Residuals at coefficients, 0 where limited; of all rows, or of the training rows alone.
pub fn residuals(
    capture: &Capture,
    model: &Model,
    coefficients: &[Vec<f64>; 2],
    all: bool,
) -> [Vec<f64>; 2] {
    let n = capture.rows();
    let mut out = [vec![0.0; n], vec![0.0; n]];
    let mut rows = Rows::new();
    let wanted = |p: Part| all || p != Part::HeldOut;
    for segment in capture.segments.iter().filter(|s| wanted(s.part)) {
        for chunk in chunks(segment.rows.clone()) {
            let start = chunk.start;
            let count = chunk.len();
            rows.fill(capture, model, chunk);
            for (channel, out) in out.iter_mut().enumerate() {
                for (i, out) in out.iter_mut().skip(start).take(count).enumerate() {
                    if rows.weight[channel][i] > 0.0 {
                        let value = rows.value(channel, i, &coefficients[channel]);
                        *out = rows.target[channel][i] - value;
                    }
                }
            }
        }
    }
    out
}
