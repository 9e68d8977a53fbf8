//! `drive_feedthrough`: part of the drive signal is added to the sense channel.
//!
//! Its tone lies in the span of the rate's and the quadrature's carriers, so it shows in two ways only:
//! as an in-phase amplitude that the known rate does not account for (a gain error or a latency of
//! the sense channel alone would look the same), or, whatever is known, as drive noise in the sense codes.

use super::candidates::{Effect, Known, Variant};
use super::columns::{Model, OTHER, Rows, chunks};
use super::gram::Combo;
use super::input::{Capture, Part};
use std::f64::consts::TAU;

/// In-phase excess, noise that is common (if `coupled`), both.
pub fn variants(known: &Known, coupled: bool) -> Vec<Variant> {
    let noise = || Combo::one("drive_to_sense", 1, OTHER);
    let mut out = Vec::new();
    if coupled {
        out.push(Variant::new(Effect::Feedthrough, vec![noise()], 0.0));
    }
    if let Some(excess) = known.carrier("in_phase_codes", 1.0) {
        let both = vec![excess.clone(), noise()];
        out.push(Variant::new(Effect::Feedthrough, vec![excess], 0.0));
        if coupled {
            out.push(Variant::new(Effect::Feedthrough, both, 0.0));
        }
    }
    out
}

/// Rows over which constant and tone of both residuals are taken off, at least.
const LOCAL_ROWS: usize = 64;
/// Standard deviations from which on noise is common.
const COMMON: f64 = 4.8;

/// Whether the drive's noise is in the sense codes: the product of both residuals has a mean that
/// neither a common jitter (it goes with the product of the slopes) nor a common amplitude noise (with
/// the product of the signals) explains. Slow wander of the tones is taken off block by block.
pub fn is_coupled(capture: &Capture, model: &Model, residuals: [&[f64]; 2]) -> bool {
    let periods = 6.0 / model.tone.folded();
    let block = LOCAL_ROWS.max(periods as usize + 1);
    let mut rows = Rows::new();
    // Sums of products of 1, slopes, signals and the product of residuals p: then p^2 times the same.
    let mut points: Vec<[f64; 3]> = Vec::new();
    for segment in capture.segments.iter().filter(|s| s.part != Part::HeldOut) {
        let mut start = segment.rows.start;
        while start + block <= segment.rows.end {
            let local = [0, 1].map(|c: usize| detrended(residuals[c], model, start..start + block));
            for chunk in chunks(start..start + block) {
                let first = chunk.start - start;
                let n = chunk.len();
                rows.fill(capture, model, chunk);
                for i in 0..n {
                    let r = |c: usize| local[c].get(first + i).copied().unwrap_or(0.0);
                    if rows.weight[0][i] > 0.0 && rows.weight[1][i] > 0.0 {
                        let slopes = rows.slope[0][i] * rows.slope[1][i];
                        let signals = rows.signal[0][i] * rows.signal[1][i];
                        points.push([r(0) * r(1), slopes, signals]);
                    }
                }
            }
            start += block;
        }
    }
    surely_constant(&points, 1) && surely_constant(&points, 2)
}

/// Whether the mean of `p[0]` is not 0 when it is regressed on 1 and `p[with]`.
fn surely_constant(points: &[[f64; 3]], with: usize) -> bool {
    let n = points.len() as f64;
    if n < 200.0 {
        return false;
    }
    let mean = |f: &dyn Fn(&[f64; 3]) -> f64| points.iter().map(f).sum::<f64>() / n;
    let (mp, mx) = (mean(&|p| p[0]), mean(&|p| p[with]));
    let xx = mean(&|p| (p[with] - mx).powi(2));
    let slope = if xx > 0.0 {
        mean(&|p| (p[with] - mx) * p[0]) / xx
    } else {
        0.0
    };
    let constant = mp - slope * mx;
    // The constant is a weighted mean of p; its variance from the residuals themselves.
    let weight = |p: &[f64; 3]| {
        1.0 - if xx > 0.0 {
            mx * (p[with] - mx) / xx
        } else {
            0.0
        }
    };
    let rest = |p: &[f64; 3]| p[0] - constant - slope * p[with];
    let variance = mean(&|p| (weight(p) * rest(p)).powi(2)) / n;
    constant.abs() > COMMON * variance.sqrt()
}

/// A stretch of a residual without its own constant and tone.
fn detrended(residual: &[f64], model: &Model, rows: std::ops::Range<usize>) -> Vec<f64> {
    let mut sums = nalgebra::Matrix3::<f64>::identity() * 1e-9;
    let mut right = nalgebra::Vector3::<f64>::zeros();
    let row = |r: usize| {
        let (sin, cos) = (TAU * model.tone.phase(r)).sin_cos();
        nalgebra::Vector3::new(1.0, sin, cos)
    };
    let value = |r: usize| residual.get(r).copied().unwrap_or(0.0);
    for r in rows.clone() {
        sums += row(r) * row(r).transpose();
        right += row(r) * value(r);
    }
    let fit = sums
        .try_inverse()
        .map_or(right * 0.0, |inverse| inverse * right);
    rows.map(|r| value(r) - row(r).dot(&fit)).collect()
}
