//! Parameters of the terms with their standard deviations.

use super::{Model, Search, declared};
use crate::closure::effects::{Estimate, Point};
use crate::closure::likelihood::linear::Basis;
use crate::closure::likelihood::whiten::Whitener;

/// Step of a derivative, as a share of the points' distance in that parameter.
const STEP: f64 = 0.05;

impl Search<'_> {
    /// An estimate for each term. Standard deviations are those of generalised least squares with the
    /// declared coefficients, all terms' coefficients and, linearised, all non-linear parameters in one
    /// covariance; a threshold between two readings gets the distance of the search's last step.
    pub fn estimates(&self, model: &Model) -> Vec<Estimate> {
        let c = self.channels;
        let order = declared(c).len();
        let mut columns: Vec<Vec<f64>> = model.columns[..order]
            .iter()
            .map(|c| model.fit.reduce(c))
            .collect();
        let mut at = order;
        // For each term the places of its coefficients and derivatives among `columns`.
        let mut places = Vec::new();
        for term in &model.terms {
            let own = term.candidate.columns(c, &model.bias, &term.point);
            let beta = model.beta[at..at + own.len()].to_vec();
            at += own.len();
            let mut linear = Vec::new();
            if !term.candidate.is_whole() {
                for column in &own {
                    linear.push(Some(columns.len()));
                    columns.push(model.fit.reduce(column));
                }
            } else {
                linear.resize(own.len(), None);
            }
            let spacing = term.candidate.spacing(c, &term.point);
            let mut derivatives = Vec::new();
            for (k, step) in spacing.iter().map(|s| STEP * s).enumerate() {
                let moved = |by: f64| -> Vec<f64> {
                    let mut point: Point = term.point.clone();
                    point.theta[k] += by;
                    let columns = term.candidate.columns(c, &model.bias, &point);
                    let mut sum = vec![0.0; c.len()];
                    for (column, b) in columns.iter().zip(&beta) {
                        crate::closure::likelihood::linear::add_scaled(&mut sum, *b, column);
                    }
                    sum
                };
                let (up, down) = (moved(step), moved(-step));
                let pairs = up.iter().zip(&down);
                let slope: Vec<f64> = pairs.map(|(a, b)| (a - b) / (2.0 * step)).collect();
                derivatives.push((columns.len(), step));
                columns.push(model.fit.reduce(&slope));
            }
            places.push((linear, derivatives, beta, term.point.clone()));
        }
        let whitener = Whitener::new(&model.fit.problem.line, model.fit.at.shape);
        let basis = Basis::new(&whitener.apply_all(&columns));
        let variance = model.fit.at.white_variance();
        let inverse = basis.inverse_gram();
        let std = |place: usize| {
            // A column in the span of others has no own deviation.
            if basis.kept.contains(&place) && place < inverse.nrows() {
                (variance * inverse[(place, place)]).max(0.0).sqrt()
            } else {
                0.0
            }
        };
        places
            .into_iter()
            .map(|(linear, derivatives, beta, point)| Estimate {
                point,
                beta_std: linear.iter().map(|p| p.map_or(0.0, std)).collect(),
                beta,
                theta_std: derivatives
                    .iter()
                    .map(|(place, step)| match std(*place) {
                        s if s > 0.0 => s,
                        _ => *step,
                    })
                    .collect(),
            })
            .collect()
    }
}
