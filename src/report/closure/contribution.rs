//! What each step of a closure adds to the output, row by row, and how sure that is.

use crate::statistics::linear::add_scaled;
use crate::thermal::channels::Channels;
use crate::thermal::search::Model;
use crate::thermal::search::estimate::{Covariance, Tangent, tangents};

/// A step's part of the output, one value a row.
#[derive(Debug, Clone, PartialEq)]
pub struct Contribution {
    /// deg/s.
    pub value_dps: Vec<f64>,
    /// Its standard deviation, deg/s: of coefficients and, linearised, non-linear parameters, the
    /// declared coefficients and all other steps estimated with them.
    pub std_dps: Vec<f64>,
}

/// The contribution of each term of a model.
pub fn all(c: &Channels, model: &Model) -> Vec<Contribution> {
    let tangents = tangents(c, model);
    let covariance = Covariance::new(c, model, &tangents);
    let pairs = tangents.iter().zip(&covariance.first);
    pairs
        .map(|(tangent, first)| {
            let mut value_dps = vec![0.0; c.len()];
            let own = model.columns.iter().zip(&model.beta);
            for (column, beta) in own.skip(tangent.own.start).take(tangent.own.len()) {
                add_scaled(&mut value_dps, *beta, column);
            }
            Contribution {
                value_dps,
                std_dps: deviation(tangent, &covariance, *first, c.len()),
            }
        })
        .collect()
}

/// sqrt(j' V j) a row, V the term's block of the covariance, which begins at `first`.
fn deviation(tangent: &Tangent, covariance: &Covariance, first: usize, rows: usize) -> Vec<f64> {
    let inverse = &covariance.inverse;
    let of_row = |i: usize| {
        let mut sum = 0.0;
        for (a, left) in tangent.columns().enumerate() {
            for (b, right) in tangent.columns().enumerate() {
                sum += left[i] * right[i] * inverse[(first + a, first + b)];
            }
        }
        (covariance.white_variance * sum).max(0.0).sqrt()
    };
    match tangent.columns().next() {
        Some(_) => (0..rows).map(of_row).collect(),
        None => Vec::new(),
    }
}
