//! The declared bias by least squares, before any noise is known.

use super::Search;
use super::judge::Judged;
use crate::statistics::linear::{Basis, add_scaled, dot};
use crate::thermal::channels::{Channels, range};
use crate::thermal::effects::Bias;

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

/// Share of a shape's square about its mean from which on the declared model does not have it all.
const INSIDE: f64 = 0.01;

impl Search<'_> {
    /// The rows of a column that take part in the fit.
    pub(super) fn of_used(&self, column: &[f64]) -> Vec<f64> {
        let rows = column.iter().zip(&self.used).filter(|(_, u)| **u);
        rows.map(|(v, _)| *v).collect()
    }

    /// Whether next to all of a shape is in the declared model: what makes it goes with the temperature in this record, and
    /// what it does was taken for the temperature's doing.
    pub fn is_declared(&self, judged: &Judged) -> bool {
        let c = self.channels;
        let of_used = |column: &Vec<f64>| self.of_used(column);
        let declared: Vec<Vec<f64>> = declared(c).iter().map(of_used).collect();
        let (constant, all) = (Basis::new(&declared[..1]), Basis::new(&declared));
        let left = |basis: &Basis, column: &[f64]| {
            let mut rest = column.to_vec();
            basis.project_off(&mut rest);
            dot(&rest, &rest)
        };
        let bias = self.plain_bias();
        let columns = judged.candidate.columns(c, &bias, &judged.point);
        let is_inside = |column: &Vec<f64>| {
            let column = of_used(column);
            left(&all, &column) < INSIDE * left(&constant, &column)
        };
        declared.len() > 1 && !columns.is_empty() && columns.iter().all(is_inside)
    }
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
