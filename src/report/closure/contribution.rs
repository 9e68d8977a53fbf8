//! What each step of a closure adds to the output, row by row, and how sure that is.

use crate::closure::channels::Channels;
use crate::closure::likelihood::linear::{Basis, add_scaled};
use crate::closure::likelihood::whiten::Whitener;
use crate::closure::search::{Model, Term, declared};

/// Step of a derivative, as a share of the points' distance in that parameter.
const STEP: f64 = 0.05;

/// A step's part of the output, one value a row.
#[derive(Debug, Clone, PartialEq)]
pub struct Contribution {
    /// deg/s.
    pub value_dps: Vec<f64>,
    /// Its standard deviation, deg/s: of coefficients and, linearised, non-linear parameters, the
    /// declared coefficients and all other steps estimated with them.
    pub std_dps: Vec<f64>,
}

/// The derivatives of the output by one term's unknowns.
struct Jacobian {
    columns: Vec<Vec<f64>>,
}

/// The term's columns and the derivatives by its non-linear parameters.
fn jacobian(c: &Channels, model: &Model, term: &Term, beta: &[f64]) -> Jacobian {
    let shape = |by: usize, step: f64| {
        let mut point = term.point.clone();
        if let Some(theta) = point.theta.get_mut(by) {
            *theta += step;
        }
        let mut sum = vec![0.0; c.len()];
        let own = term.candidate.columns(c, &model.bias, &point);
        for (column, b) in own.iter().zip(beta) {
            add_scaled(&mut sum, *b, column);
        }
        sum
    };
    let mut columns = Vec::new();
    if !term.candidate.is_whole() {
        columns = term.candidate.columns(c, &model.bias, &term.point);
    }
    let spacing = term.candidate.spacing(c, &term.point);
    for (k, step) in spacing.iter().map(|s| STEP * s).enumerate() {
        let pairs = shape(k, step).into_iter().zip(shape(k, -step));
        columns.push(pairs.map(|(a, b)| (a - b) / (2.0 * step)).collect());
    }
    Jacobian { columns }
}

/// The contribution of each term of a model.
pub fn all(c: &Channels, model: &Model) -> Vec<Contribution> {
    let order = declared(c).len();
    let mut at = order;
    let mut values = Vec::new();
    let mut jacobians = Vec::new();
    for term in &model.terms {
        let count = term.candidate.columns(c, &model.bias, &term.point).len();
        let own = || at..(at + count).min(model.columns.len());
        let mut value = vec![0.0; c.len()];
        for k in own() {
            add_scaled(&mut value, model.beta[k], &model.columns[k]);
        }
        jacobians.push(jacobian(c, model, term, &model.beta[own()]));
        values.push(value);
        at += count;
    }
    let stds = deviations(model, order, &jacobians);
    let pairs = values.into_iter().zip(stds);
    pairs
        .map(|(value_dps, std_dps)| Contribution { value_dps, std_dps })
        .collect()
}

/// sqrt(j' V j) a row, V the term's block of the covariance by generalised least squares.
fn deviations(model: &Model, order: usize, jacobians: &[Jacobian]) -> Vec<Vec<f64>> {
    let free = model.columns.iter().take(order);
    let all = free.chain(jacobians.iter().flat_map(|j| &j.columns));
    let reduced: Vec<Vec<f64>> = all.map(|c| model.fit.reduce(c)).collect();
    let whitener = Whitener::new(&model.fit.problem.line, model.fit.at.shape);
    let basis = Basis::new(&whitener.apply_all(&reduced));
    let variance = model.fit.at.white_variance();
    let inverse = basis.inverse_gram();
    let mut at = order;
    jacobians
        .iter()
        .map(|j| {
            let first = at;
            at += j.columns.len();
            let rows = j.columns.first().map_or(0, Vec::len);
            (0..rows)
                .map(|i| {
                    let mut sum = 0.0;
                    for (a, left) in j.columns.iter().enumerate() {
                        for (b, right) in j.columns.iter().enumerate() {
                            sum += left[i] * right[i] * inverse[(first + a, first + b)];
                        }
                    }
                    (variance * sum).max(0.0).sqrt()
                })
                .collect()
        })
        .collect()
}
