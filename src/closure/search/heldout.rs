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

/// Most that one row's innovation counts.
const MOST: f64 = 16.0;

impl Search<'_> {
    /// Over held-out rows; the noise is that of `judge`, so that models can be compared.
    pub fn heldout_error(&self, model: &Model, judge: &Model) -> HeldOut {
        let residual = model.residual(self.channels);
        let rows = || residual.iter().zip(&self.heldout).filter(|(_, h)| **h);
        let count = rows().count().max(1) as f64;
        let square = rows().map(|(r, _)| r * r).sum::<f64>() / count;
        HeldOut {
            square,
            innovations: self.innovations(&residual, judge).unwrap_or(count * square),
        }
    }

    /// What a term says of the held-out rows: the same sum for what two models differ by. Where it is
    /// a few units, the rows cannot speak for the term or against it.
    pub fn said(&self, with: &Model, without: &Model, judge: &Model) -> f64 {
        let (with, without) = (
            with.residual(self.channels),
            without.residual(self.channels),
        );
        let apart: Vec<f64> = with.iter().zip(&without).map(|(a, b)| a - b).collect();
        self.innovations(&apart, judge).unwrap_or(f64::INFINITY)
    }

    /// Sum over held-out rows of the squares of a signal's innovations under a model's noise; `None` without a line.
    fn innovations(&self, signal: &[f64], judge: &Model) -> Option<f64> {
        let missing = |v: &f64| match v.is_finite() {
            true => 1.0,
            false => f64::INFINITY,
        };
        let factors = signal.iter().map(missing).collect();
        let line = Timeline::new(&self.channels.time_s, factors).ok()?;
        let (whitener, unit) = whitener_of(&judge.fit.noise, &line);
        let white = whitener.apply(signal);
        let pairs = white.iter().zip(&self.heldout).filter(|(_, h)| **h);
        Some(pairs.map(|(w, _)| (w / unit).powi(2).min(MOST)).sum())
    }
}
