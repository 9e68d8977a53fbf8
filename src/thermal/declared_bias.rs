//! The declared bias model as columns, and its least-squares fit.

use super::channels::{Channels, range};
use super::effects::Bias;
use crate::statistics::linear::{Basis, add_scaled, dot};

/// The regressors of the declared model: 1, u, u^2.
pub fn declared(c: &Channels) -> Vec<Vec<f64>> {
    powers(&c.u)
}

/// The same of any scaled reading; 1 alone if it does not move.
pub fn powers(u: &[f64]) -> Vec<Vec<f64>> {
    let (low, high) = range(u);
    let order = if high > low { 3 } else { 1 };
    (0..order)
        .map(|k| u.iter().map(|u| u.powi(k)).collect())
        .collect()
}

/// The declared bias in a scaled reading by ordinary least squares, and what it leaves of the rows that are measured.
pub fn declared_by(u: &[f64], error_dps: &[f64]) -> (Bias, Vec<f64>) {
    let measured = |e: &f64| f64::from(u8::from(e.is_finite()));
    let weights: Vec<f64> = error_dps.iter().map(measured).collect();
    let columns = powers(u);
    let coefficients_dps = weighted(&columns, error_dps, &weights);
    let mut rest = error_dps.to_vec();
    for (b, column) in coefficients_dps.iter().zip(&columns) {
        add_scaled(&mut rest, -b, column);
    }
    rest.retain(|r| r.is_finite());
    let bias = Bias {
        coefficients_dps,
        others_dps: Vec::new(),
    };
    (bias, rest)
}

/// Weighted least squares; rows of weight 0 may hold anything.
pub fn weighted(columns: &[Vec<f64>], y: &[f64], weights: &[f64]) -> Vec<f64> {
    let scaled = |c: &[f64]| -> Vec<f64> {
        let pairs = c.iter().zip(weights);
        pairs
            .map(|(v, w)| if *w > 0.0 { v * w.sqrt() } else { 0.0 })
            .collect()
    };
    let columns: Vec<Vec<f64>> = columns.iter().map(|c| scaled(c)).collect();
    let basis = Basis::new(&columns);
    let y = scaled(y);
    let z: Vec<f64> = basis.q.iter().map(|q| dot(q, &y)).collect();
    basis.solve(&z)
}
