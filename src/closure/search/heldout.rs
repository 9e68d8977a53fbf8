//! Rows that no estimate used.

use super::{Model, Search};
use crate::closure::likelihood::noise::Timeline;
use crate::closure::likelihood::reml::whitener_of;

/// The error over held-out rows.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct HeldOut {
    /// Mean square, (deg/s)^2.
    pub square: f64,
    /// Sum of squares of the residual's innovations under the model's noise, in units of their
    /// variance, each at most 16: slow noise, which no model predicts, counts little.
    pub innovations: f64,
}

impl Search<'_> {
    /// Over held-out rows; the noise is that of `judge`, so that models can be compared.
    pub fn heldout_error(&self, model: &Model, judge: &Model) -> HeldOut {
        let c = self.channels;
        let residual = model.residual(c);
        let rows = || residual.iter().zip(&self.heldout).filter(|(_, h)| **h);
        let count = rows().count().max(1) as f64;
        let square = rows().map(|(r, _)| r * r).sum::<f64>() / count;
        let factors = residual
            .iter()
            .map(|r| if r.is_finite() { 1.0 } else { f64::INFINITY })
            .collect();
        let innovations = match Timeline::new(&c.time_s, factors) {
            Ok(line) => {
                let (whitener, unit) = whitener_of(&judge.fit.noise, &line);
                let white = whitener.apply(&residual);
                let pairs = white.iter().zip(&self.heldout).filter(|(_, h)| **h);
                pairs.map(|(w, _)| (w / unit).powi(2).min(16.0)).sum()
            }
            Err(_) => count * square,
        };
        HeldOut {
            square,
            innovations,
        }
    }
}
