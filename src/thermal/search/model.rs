//! The declared model with terms, fitted: what it explains, and what shows beside it.

use super::{Term, declared};
use crate::statistics::linear::add_scaled;
use crate::statistics::reml::Fit;
use crate::thermal::channels::Channels;
use crate::thermal::effects::Bias;

/// The declared model with terms, fitted on training rows.
#[derive(Clone)]
pub struct Model {
    /// Named and nameless terms.
    pub terms: Vec<Term>,
    /// Noise, weights, and coefficients by generalised least squares.
    pub fit: Fit,
    /// The declared coefficients for prediction ([`Model::beta`]).
    pub bias: Bias,
    /// The bias that the columns of the terms act on: that of the last pass but one.
    pub acting: Bias,
    /// Coefficients for prediction: those of the terms are the fit's; the declared ones are ordinary
    /// (weighted) least squares of what the terms leave. Under a walk, generalised least squares
    /// ties the constant to the first rows; a mean over all rows predicts held-out ones.
    pub beta: Vec<f64>,
    /// Regressors over all rows: declared ones, then the terms'.
    pub columns: Vec<Vec<f64>>,
    /// Rows at a clip's level, where no other term shows; empty: none is.
    pub clipped: Vec<bool>,
    /// Log-likelihood of all training rows, spikes included: for models of the same rows.
    pub value: f64,
}

impl Model {
    /// Error less what the model explains, deg/s, every row.
    pub fn residual(&self, c: &Channels) -> Vec<f64> {
        let mut out = c.error_dps.clone();
        for (column, b) in self.columns.iter().zip(&self.beta) {
            add_scaled(&mut out, -b, column);
        }
        out
    }

    /// Columns of a further term as they show beside a clip: not in the rows that it holds.
    pub(super) fn shown(&self, mut columns: Vec<Vec<f64>>) -> Vec<Vec<f64>> {
        if !self.clipped.is_empty() {
            for column in &mut columns {
                let rows = column.iter_mut().zip(&self.clipped);
                rows.filter(|(_, held)| **held).for_each(|(v, _)| *v = 0.0);
            }
        }
        columns
    }

    /// Weights of the fit's rows; 0 where a clip holds the output, which says nothing of the declared bias.
    pub(super) fn free_weights(&self) -> Vec<f64> {
        let mut weights = self.fit.row_weights.clone();
        let rows = weights.iter_mut().zip(&self.clipped);
        rows.filter(|(_, held)| **held).for_each(|(w, _)| *w = 0.0);
        weights
    }

    /// Whether physics admits the coefficients of a term.
    pub(super) fn admits(&self, c: &Channels, k: usize) -> bool {
        let count = |t: &Term| t.candidate.columns(c, &self.acting, &t.point).len();
        let before: usize = self.terms[..k].iter().map(count).sum();
        let from = declared(c).len() + before;
        let term = &self.terms[k];
        let own = &self.beta[from..from + count(term)];
        term.candidate.admits(c, &term.point, own)
    }

    /// What each term adds, deg/s, every row.
    pub(super) fn contributions(&self, c: &Channels) -> Vec<Vec<f64>> {
        let mut from = declared(c).len();
        let own = |term: &Term| {
            let to = from + term.candidate.columns(c, &self.acting, &term.point).len();
            let mut sum = vec![0.0; c.len()];
            for (column, b) in self.columns[from..to].iter().zip(&self.beta[from..to]) {
                add_scaled(&mut sum, *b, column);
            }
            from = to;
            sum
        };
        self.terms.iter().map(own).collect()
    }
}
