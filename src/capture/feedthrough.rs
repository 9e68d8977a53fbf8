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

/// Whether the drive's noise is in the sense codes: the product of both residuals has a mean that neither a common
/// jitter nor a common amplitude noise (it goes with the product of the signals) explains. Slow wander of the tones is
/// taken off block by block, and with it a part of every product, which is taken off what these would make too.
pub fn is_coupled(capture: &Capture, model: &Model, residuals: [&[f64]; 2]) -> bool {
    let periods = 6.0 / model.tone.folded();
    let block = LOCAL_ROWS.max(periods as usize + 1);
    // A random instant of variance t leaves cos(a) - (1 - t w^2) cos(b) of two tones, the slopes' product
    // cos(a) - cos(b), the signals' cos(a) + cos(b), as their amplitudes are those that the random instant leaves.
    // Instants that are not of both channels make no product.
    let [drive, sense] = model.variance.jitter;
    let lost = (drive * sense).sqrt() * model.tone.angle().powi(2);
    let bent = 0.5 * lost / (1.0 - 0.5 * lost.min(1.0)) * model.tone.angle().powi(2);
    let mut rows = Rows::new();
    let mut points: Vec<Point> = Vec::new();
    for segment in capture.segments.iter().filter(|s| s.part != Part::HeldOut) {
        let mut start = segment.rows.start;
        while start + block <= segment.rows.end {
            let mut local: Vec<Point> = Vec::with_capacity(block);
            let mut is_used: Vec<bool> = Vec::with_capacity(block);
            for chunk in chunks(start..start + block) {
                let (first, n) = (chunk.start, chunk.len());
                rows.fill(capture, model, chunk);
                for i in 0..n {
                    let r = |c: usize| residuals[c].get(first + i).copied().unwrap_or(0.0);
                    let signals = rows.signal[0][i] * rows.signal[1][i];
                    let slopes = rows.slope[0][i] * rows.slope[1][i];
                    local.push(Point {
                        residuals: [r(0), r(1)],
                        expected: [1.0, slopes + bent * signals, signals],
                    });
                    is_used.push(rows.weight[0][i] > 0.0 && rows.weight[1][i] > 0.0);
                }
            }
            detrend(&mut local, model, start);
            let used = local.into_iter().zip(is_used).filter(|(_, used)| *used);
            points.extend(used.map(|(p, _)| p));
            start += block;
        }
    }
    surely_constant(&points, 1) && surely_constant(&points, 2)
}

/// A row of both residuals, and the mean product that a constant covariance, a common jitter and a common amplitude
/// noise would make of them.
struct Point {
    residuals: [f64; 2],
    expected: [f64; 3],
}

impl Point {
    fn product(&self) -> f64 {
        self.residuals[0] * self.residuals[1]
    }
}

/// Whether the mean product has a part that goes with a constant covariance when it is regressed on that and on
/// another one.
fn surely_constant(points: &[Point], with: usize) -> bool {
    let n = points.len() as f64;
    if n < 200.0 {
        return false;
    }
    let sum = |f: &dyn Fn(&Point) -> f64| points.iter().map(f).sum::<f64>();
    let one = |p: &Point| p.expected[0];
    let other = |p: &Point| p.expected[with];
    // What of the constant is not in the other (Frisch and Waugh 1933).
    let square = sum(&|p| other(p).powi(2));
    let share = if square > 0.0 {
        sum(&|p| one(p) * other(p)) / square
    } else {
        0.0
    };
    let own = |p: &Point| one(p) - share * other(p);
    let size = sum(&|p| own(p).powi(2));
    if size <= 1e-9 * n {
        return false;
    }
    let constant = sum(&|p| own(p) * p.product()) / size;
    let slope = if square > 0.0 {
        sum(&|p| other(p) * (p.product() - constant * one(p))) / square
    } else {
        0.0
    };
    // Its variance from the rests themselves, whatever the noise's spread is at each phase (White 1980).
    let rest = |p: &Point| p.product() - constant * one(p) - slope * other(p);
    let variance = sum(&|p| (own(p) * rest(p)).powi(2)) / (size * size);
    constant.abs() > COMMON * variance.sqrt()
}

/// Takes constant and tone of a stretch off its residuals, and what that takes of them off the expected products: of
/// independent rows with covariances c the projection I - H leaves c (1 - 2 H_ii) + sum of H_ij^2 c_j at row i.
fn detrend(points: &mut [Point], model: &Model, start: usize) {
    let row = |i: usize| {
        let (sin, cos) = (TAU * model.tone.phase(start + i)).sin_cos();
        nalgebra::Vector3::new(1.0, sin, cos)
    };
    let mut sums = nalgebra::Matrix3::<f64>::identity() * 1e-9;
    let mut right = [nalgebra::Vector3::<f64>::zeros(); 2];
    let mut expected = [nalgebra::Matrix3::<f64>::zeros(); 3];
    for (i, point) in points.iter().enumerate() {
        let x = row(i);
        let square = x * x.transpose();
        sums += square;
        for (right, r) in right.iter_mut().zip(point.residuals) {
            *right += x * r;
        }
        for (sum, e) in expected.iter_mut().zip(point.expected) {
            *sum += square * e;
        }
    }
    let Some(inverse) = sums.try_inverse() else {
        return;
    };
    let fits = right.map(|right| inverse * right);
    let spread = expected.map(|sum| inverse * sum * inverse);
    for (i, point) in points.iter_mut().enumerate() {
        let x = row(i);
        let own = x.dot(&(inverse * x));
        for (r, fit) in point.residuals.iter_mut().zip(&fits) {
            *r -= x.dot(fit);
        }
        for (e, spread) in point.expected.iter_mut().zip(&spread) {
            *e = *e * (1.0 - 2.0 * own) + x.dot(&(spread * x));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::synthetic_rows::{ROWS, capture, late, meta};
    use super::super::{fit, known, tone::Tone};
    use super::*;
    use crate::thermal::synthetic::Random;

    /// Whether the noise of a capture of this jitter (samples rms), and a part of the drive's noise in the sense
    /// channel, is taken for coupled.
    fn coupled(seed: u64, jitter: f64, part: f64) -> bool {
        let word = 0x38e9_1b2b;
        let mut random = Random::new(seed ^ 0xabc);
        let common: Vec<f64> = (0..ROWS).map(|_| random.normal()).collect();
        let share = [1.0, part];
        let codes = late(seed, word, jitter, |c, row, x| x + share[c] * common[row]);
        let capture = capture(codes, meta(word));
        let tone = Tone::of(&capture).unwrap();
        let (known, _) = known(&capture, tone);
        let start = fit::declared(&capture, &known, tone);
        let fitted = fit::rounds(&capture, &known, &start);
        let [drive, sense] = &fitted.residuals;
        is_coupled(&capture, &fitted.model, [drive, sense])
    }

    #[test]
    fn common_jitter_is_no_feedthrough() {
        for jitter in [0.02, 0.06, 0.2] {
            let taken = (1..9).filter(|seed| coupled(*seed, jitter, 0.0)).count();
            assert_eq!(taken, 0, "{jitter}");
        }
    }

    #[test]
    fn drive_noise_in_the_sense_codes_is() {
        for jitter in [0.0, 0.002] {
            assert!(coupled(1, jitter, 0.3), "{jitter}");
        }
    }
}
