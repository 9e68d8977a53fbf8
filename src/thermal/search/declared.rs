//! The declared bias by least squares, before any noise is known.

use super::judge::Judged;
use super::{Search, declared};
use crate::statistics::linear::{Basis, dot};

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
