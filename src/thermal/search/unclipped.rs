//! The declared bias beside a clip, of the rows that it does not hold.
//!
//! A clip that holds much of a bias bends what least squares finds over all rows, and where that bias passes the level no longer
//! tells which rows are held. The bias of the free rows and the rows that it does not hold are found in turns, from the rows
//! whose reading is within the levels.

use super::{Model, Search, Term, declared};
use crate::statistics::linear::{add_scaled, dots, normal};
use crate::thermal::channels::{Channels, range};
use crate::thermal::effects::{Bias, Candidate, Point};
use nalgebra::DMatrix;

/// Most turns.
const TURNS: usize = 12;

/// Free rows that each coefficient needs.
const ROWS_EACH: usize = 4;

/// Share of the output's range from which on a bias is what a clip is of, rather than the rate.
const MUCH: f64 = 0.2;

/// What is fitted beside a clip.
pub(super) struct Unclipped<'a> {
    c: &'a Channels,
    /// The declared columns, and those of other effects.
    columns: Vec<Vec<f64>>,
    order: usize,
    /// The same and what they explain, each row by the root of its weight, and their products over all rows: a clip takes
    /// out the few that it holds.
    weighted: Vec<Vec<f64>>,
    products: DMatrix<f64>,
    weights: Vec<f64>,
    /// What effects without a free coefficient add, deg/s, every row.
    fixed_dps: Vec<f64>,
}

impl<'a> Unclipped<'a> {
    /// `columns` are the declared ones and those of other effects.
    fn new(
        c: &'a Channels,
        columns: Vec<Vec<f64>>,
        fixed_dps: Vec<f64>,
        weights: Vec<f64>,
    ) -> Self {
        let mut y = c.error_dps.clone();
        add_scaled(&mut y, -1.0, &fixed_dps);
        let by_root = |column: &Vec<f64>| -> Vec<f64> {
            let rows = column.iter().zip(&weights);
            rows.map(|(v, w)| if *w > 0.0 { v * w.sqrt() } else { 0.0 })
                .collect()
        };
        let weighted: Vec<Vec<f64>> = columns.iter().chain([&y]).map(by_root).collect();
        let count = weighted.len();
        let products = DMatrix::from_row_slice(count, count, &dots(&weighted, &weighted));
        Unclipped {
            c,
            order: declared(c).len(),
            columns,
            weighted,
            products,
            weights,
            fixed_dps,
        }
    }

    /// The bias beside a clip, and what else is there in [`Bias::others_dps`]; `None` where it leaves too few rows.
    pub(super) fn bias(&self, clip: &dyn Candidate, point: &Point) -> Option<Bias> {
        // The total that readings alone tell.
        let mut bias = Bias {
            coefficients_dps: Vec::new(),
            others_dps: self.c.error_dps.clone(),
        };
        let mut held = Vec::new();
        for _ in 0..TURNS {
            let column = clip.columns(self.c, &bias, point).pop()?;
            let now: Vec<bool> = column.iter().map(|v| *v != 0.0).collect();
            if now == held {
                break;
            }
            held = now;
            let rows = self.weights.iter().zip(&held);
            let count = rows.filter(|(w, held)| **w > 0.0 && !**held).count();
            if count < ROWS_EACH * self.columns.len() {
                return None;
            }
            bias = self.fitted(&held);
        }
        Some(bias)
    }

    /// Least squares of the rows that are not held.
    fn fitted(&self, held: &[bool]) -> Bias {
        let mut products = self.products.clone();
        for row in (0..held.len()).filter(|row| held[*row]) {
            for (i, a) in self.weighted.iter().enumerate() {
                for (j, b) in self.weighted.iter().enumerate() {
                    products[(i, j)] -= a[row] * b[row];
                }
            }
        }
        let count = self.columns.len();
        let with = products.column(count).rows(0, count).into_owned();
        let mut beta = normal(&products.view((0, 0), (count, count)).into_owned(), &with);
        let mut others_dps = self.fixed_dps.clone();
        for (b, column) in beta.iter().zip(&self.columns).skip(self.order) {
            add_scaled(&mut others_dps, *b, column);
        }
        beta.truncate(self.order);
        Bias {
            coefficients_dps: beta,
            others_dps,
        }
    }
}

impl<'a> Search<'a> {
    /// Beside what a model has.
    pub(super) fn unclipped_beside(&self, model: &Model) -> Unclipped<'a> {
        let c = self.channels;
        let mut fixed_dps = model.bias.others_dps.clone();
        fixed_dps.resize(c.len(), 0.0);
        Unclipped::new(c, declared(c), fixed_dps, model.free_weights())
    }

    /// The bias of terms with a clip among them, for a start: nothing is known yet of rows that stand out.
    pub(super) fn unclipped(&self, terms: &[Term], start: &Bias) -> Option<Bias> {
        let c = self.channels;
        let clip = terms.iter().find(|t| t.candidate.is_last())?;
        let mut fixed_dps = vec![0.0; c.len()];
        let mut columns = declared(c);
        for term in terms.iter().filter(|t| !t.candidate.is_last()) {
            for column in term.candidate.columns(c, start, &term.point) {
                match term.candidate.is_sized(&term.point) {
                    true => add_scaled(&mut fixed_dps, 1.0, &column),
                    false => columns.push(column),
                }
            }
        }
        let unclipped = Unclipped::new(c, columns, fixed_dps, self.weights());
        unclipped.bias(clip.candidate.as_ref(), &clip.point)
    }

    /// Whether a clip would be one of the bias, for the most part.
    pub(super) fn moves_by_bias(&self, model: &Model) -> bool {
        let c = self.channels;
        let bias: Vec<f64> = c.u.iter().map(|u| model.bias.at(*u)).collect();
        let width = |(low, high): (f64, f64)| high - low;
        width(range(&bias)) > MUCH * width(range(&c.output_dps()))
    }
}

#[cfg(test)]
#[path = "unclipped_tests.rs"]
mod tests;
