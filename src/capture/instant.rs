//! What a random instant of sampling makes of the codes near the peaks of the tone, so that it is not taken for a limit.

use super::columns::{COS, Model, SIN};
use crate::statistics::normal;

/// A random instant of sampling, as it shows near the peaks. There the tone bends: it is never beyond its peak, and
/// its mean is inside of it, so that the codes spread to the inside alone.
pub struct Instant {
    /// Standard deviation of the tone's phase, rad.
    pub spread: f64,
    /// What it leaves of the mean tone, share.
    left: f64,
    /// What it adds to the variance at the peaks, which the fit has in the noise, codes squared.
    pub bent: f64,
}

impl Instant {
    /// Of cos(p + t) with Gaussian t of variance v the mean is e^(-v/2) cos p, the variance (1 - m) (1 - m cos 2p) / 2
    /// with m = e^-v: (1 - m)^2 / 2 and the part that goes with the slope squared of the mean tone, 1 - m of it.
    pub fn of(model: &Model, channel: usize) -> Self {
        let lost = (model.variance.jitter[channel] * model.tone.angle().powi(2)).min(0.9);
        let [sin, cos] = model.declared[channel];
        let at = |k: usize| model.coefficients[channel].get(k).copied().unwrap_or(0.0);
        let square = (sin + at(SIN)).powi(2) + (cos + at(COS)).powi(2);
        Instant {
            spread: (-(-lost).ln_1p()).sqrt(),
            left: (1.0 - lost).sqrt(),
            bent: 0.5 * lost * lost * square / (1.0 - lost),
        }
    }

    /// The chance of a code beyond an outermost one, a quarter of a code given away: `under` codes inside of it is the
    /// signal, of which the tone and its slope a radian are positive outward.
    pub fn beyond(&self, under: f64, [tone, slope]: [f64; 2], noise: f64) -> f64 {
        let beyond = |under: f64| normal::below(-(under + 0.5 + 0.25) / noise);
        if self.spread == 0.0 {
            return beyond(under);
        }
        // Instants a third of a deviation apart, up to three deviations.
        let (mut sum, mut all) = (0.0, 0.0);
        for k in -9..=9 {
            let z = f64::from(k) / 3.0;
            let (sin, cos) = (z * self.spread).sin_cos();
            let moved = (tone * cos + slope * sin) / self.left - tone;
            let weight = normal::density(z);
            sum += weight * beyond(under - moved);
            all += weight;
        }
        sum / all
    }
}
