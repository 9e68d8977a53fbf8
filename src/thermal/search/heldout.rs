//! Rows that no fit used, and that models are compared on.

use super::otherwise::stand_together;
use super::{Model, Search};
use crate::statistics::noise::Timeline;
use crate::statistics::reml::whitener_of;
use crate::statistics::robust::are_accidents;
use crate::statistics::stats;
use crate::thermal::channels::Channels;

/// Most that one row's innovation counts.
const MOST: f64 = 16.0;

/// Robust deviations from which on a row that no model explains is an accident, and the share of the rows above which such
/// rows are no accidents. In a record of a few dozen rows each is something by itself.
const ACCIDENT: f64 = 6.0;
const FEW: f64 = 0.05;
const LEAST: usize = 60;

/// Whether so many of the rows are far off that they are no accidents.
fn is_riddled(far: &[bool]) -> bool {
    let count = far.iter().filter(|f| **f).count();
    count as f64 > FEW * far.len() as f64
}

/// Rows by which a step's place may be off.
const ASTRAY: usize = 3;

/// By how much a model's residual would change, deg/s, if a step that a row is near to came on its other side: of what
/// the neighbours have, what suits the row best. 0 where no step is near.
fn across_steps(c: &Channels, model: &Model) -> Vec<f64> {
    let mut by_dps = vec![0.0; c.len()];
    let residual = model.residual(c);
    let parts = model.contributions(c);
    let steps = model.terms.iter().zip(&parts);
    for (_, part) in steps.filter(|(t, _)| t.candidate.is_local()) {
        for row in 0..part.len() {
            let near = row.saturating_sub(ASTRAY)..(row + ASTRAY + 1).min(part.len());
            for neighbour in near {
                let by = part[row] - part[neighbour];
                if (residual[row] + by).abs() < (residual[row] + by_dps[row]).abs() {
                    by_dps[row] = by;
                }
            }
        }
    }
    by_dps
}

/// What is said of the rows that are meant, in their order.
fn in_order(of: &[bool], rows: &[bool]) -> Vec<bool> {
    let rows = of.iter().zip(rows).filter(|(_, row)| **row);
    rows.map(|(of, _)| *of).collect()
}

impl Search<'_> {
    /// Sum of squares over held-out rows of the residual's innovations under the noise of `judge`, in units of their
    /// variance, each at most 16: slow noise, which no model predicts, counts little. Of one judge, comparable.
    pub fn surprise(&self, model: &Model, judge: &Model) -> f64 {
        let residual = model.residual(self.channels);
        let innovations = self.innovations(&residual, judge);
        innovations.unwrap_or_else(|| {
            let rows = residual.iter().zip(&self.heldout).filter(|(_, h)| **h);
            rows.map(|(r, _)| r * r).sum()
        })
    }

    /// Rows, fitted or held out, that are accidents to all models that are compared: few, far off, and each by itself or with a
    /// few neighbours. One of them may outweigh whatever the models differ by, so that errors are of the other rows.
    pub fn accidents<const N: usize>(&self, models: [&Model; N]) -> Vec<bool> {
        self.accidents_among(self.channels, &self.seen_rows(), models)
    }

    /// The same of other rows of the same record, whose output `c` has.
    pub fn accidents_among<const N: usize>(
        &self,
        c: &Channels,
        rows: &[bool],
        models: [&Model; N],
    ) -> Vec<bool> {
        let far = self.far(c, rows, models);
        let in_order = in_order(&far, rows);
        let few = in_order.len() >= LEAST && !is_riddled(&in_order);
        if few && (!stand_together(&in_order) || are_accidents(&in_order)) {
            return far;
        }
        vec![false; far.len()]
    }

    /// Rows that a model leaves far off, where they are too many for accidents.
    pub fn riddled(&self, model: &Model) -> Option<Vec<usize>> {
        let seen = self.seen_rows();
        let far = self.far(self.channels, &seen, [model]);
        let in_order = in_order(&far, &seen);
        let rows = || (0..far.len()).filter(|row| far[*row]).collect();
        (in_order.len() >= LEAST && is_riddled(&in_order)).then(rows)
    }

    /// Rows that are fitted or held out.
    fn seen_rows(&self) -> Vec<bool> {
        let rows = self.train.iter().zip(&self.heldout);
        rows.map(|(train, held)| *train || *held).collect()
    }

    /// Of these rows, those that are far off of all models that are compared. A row next to a step, on whose other side it would be
    /// none, is an error of the model.
    fn far<const N: usize>(&self, c: &Channels, rows: &[bool], models: [&Model; N]) -> Vec<bool> {
        let residuals = models.map(|m| m.residual(c));
        let switched = models.map(|m| across_steps(c, m));
        let least = |row: usize| {
            let of_model = residuals.iter().zip(&switched);
            let of_row = of_model.map(|(r, by)| (r[row] + by[row]).abs().min(r[row].abs()));
            of_row.fold(f64::INFINITY, f64::min)
        };
        let deviation_dps = residuals.iter().map(|r| {
            let of_rows = r.iter().zip(rows).filter(|(_, row)| **row);
            let sizes: Vec<f64> = of_rows.map(|(r, _)| r.abs()).collect();
            stats::MAD_TO_STD * stats::median(&sizes)
        });
        let far_dps = ACCIDENT * deviation_dps.fold(f64::INFINITY, f64::min);
        let far_dps = far_dps.max(self.nothing_dps());
        let rows = rows.iter().enumerate();
        rows.map(|(k, row)| *row && least(k) > far_dps).collect()
    }

    /// Mean squares over the held-out rows, (deg/s)^2, of models that are compared, without accidents.
    pub fn heldout_squares<const N: usize>(&self, models: [&Model; N]) -> [f64; N] {
        let accidents = self.accidents(models);
        let rows = self.heldout.iter().zip(&accidents).enumerate();
        let rows: Vec<usize> = rows
            .filter(|(_, (held, accident))| **held && !**accident)
            .map(|(row, _)| row)
            .collect();
        models.map(|m| {
            let residual = m.residual(self.channels);
            let sum: f64 = rows.iter().map(|row| residual[*row].powi(2)).sum();
            sum / rows.len().max(1) as f64
        })
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

#[cfg(test)]
#[path = "heldout_tests.rs"]
mod tests;
