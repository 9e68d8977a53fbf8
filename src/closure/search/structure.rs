//! Is what is left noise? Tests of the whitened residual that need no candidate.

use super::{Model, Search};
use crate::closure::likelihood::memory;
use crate::closure::likelihood::noise::Shape;
use crate::closure::likelihood::whiten::Whitener;
use rustfft::FftPlanner;
use rustfft::num_complex::Complex;

/// Probability below which a whitened residual is not white.
pub const COLOURED: f64 = 1e-3;

/// Periodogram ordinates that are added up to a band.
const BANDS: [usize; 3] = [4, 10, 24];

/// Probability that the greatest band of a white residual's periodogram is as great: narrow-band
/// structure (a drifting tone, a relaxation that repeats) has no shape in time that a candidate
/// could have, and no spectrum that 1/f noise has.
pub fn band_p_value(whitened: &[f64]) -> f64 {
    let n = whitened.len();
    if n < 64 {
        return 1.0;
    }
    let mut buffer: Vec<Complex<f64>> = whitened.iter().map(|v| Complex::new(*v, 0.0)).collect();
    FftPlanner::new().plan_fft_forward(n).process(&mut buffer);
    let power: Vec<f64> = buffer[1..n / 2].iter().map(|c| c.norm_sqr()).collect();
    let total: f64 = power.iter().sum::<f64>().max(f64::MIN_POSITIVE);
    let mean = total / power.len() as f64;
    let mut least = 1.0f64;
    for width in BANDS {
        if 3 * width > power.len() {
            continue;
        }
        let tests = 2.0 * power.len() as f64 / width as f64;
        let mut sum: f64 = power[..width].iter().sum();
        let mut greatest = sum;
        for k in width..power.len() {
            sum += power[k] - power[k - width];
            greatest = greatest.max(sum);
        }
        // Twice a sum of exponentials over their mean: chi-square with two degrees each.
        let surprise =
            crate::closure::likelihood::tail::chi_square_surprise(2 * width, 2.0 * greatest / mean);
        least = least.min(tests * BANDS.len() as f64 * (-surprise).exp());
    }
    least.min(1.0)
}

/// Slow noise that is not looked into.
const LITTLE: f64 = 1.0;

/// Log-likelihood by which a short memory has to be better than 1/f noise and a walk.
const BETTER: f64 = 3.0;

/// The rms of slow noise over a record, in units of the white one.
fn slowness(shape: Shape, rows: usize) -> f64 {
    let n = rows.max(2) as f64;
    (shape.flicker * n.ln() + shape.walk * n / 6.0).sqrt()
}

fn is_coloured(whitened: &[f64]) -> bool {
    let white: Vec<f64> = whitened.iter().map(|v| v.clamp(-4.0, 4.0)).collect();
    band_p_value(&white) < COLOURED
}

impl Search<'_> {
    /// Slow noise of a model, rms over the record, in units of the white; none where what the model leaves has but a short
    /// memory.
    pub fn wander(&self, model: &Model) -> f64 {
        let slow = slowness(model.fit.at.shape, model.fit.problem.line.used());
        match slow > LITTLE && self.forgets(model) {
            true => 0.0,
            false => slow,
        }
    }

    /// Whether a model leaves structure in time that no candidate has.
    pub fn coloured(&self, model: &Model) -> bool {
        is_coloured(&model.fit.residual_whitened) && !self.forgets(model)
    }

    /// Whether what a model leaves is noise with a short memory: that explains it better than 1/f noise and a walk do, and
    /// all of it, and its innovations are normal.
    pub(super) fn forgets(&self, model: &Model) -> bool {
        let fit = &model.fit;
        let rest = fit.reduce(&model.residual(self.channels));
        let line = &fit.problem.line;
        let whitener = Whitener::new(line, fit.at.shape);
        let slow = memory::loglik(&whitener.apply(&rest), whitener.used, whitener.log_det);
        let memory = memory::short_memory(line, &rest);
        memory
            .is_some_and(|m| m.loglik > slow + BETTER && !is_coloured(&m.whitened) && m.is_normal())
    }
}
