//! Cells of a channel that hold one value in a row, and how far from it the cells beside them are.

use crate::statistics::stats;
use std::ops::Range;

/// Cells in a row that hold one value, and how far from it the cells before and after them are.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Visit {
    pub(super) value: f64,
    /// Into the cells that were looked at.
    pub(super) cells: Range<usize>,
    /// The lesser distance.
    pub(super) distance: f64,
    /// The same for a step of usual length in time.
    pub(super) per_row: f64,
    /// Time of the shorter way there, s.
    pub(super) way_s: f64,
    /// Whether there are neighbours on both sides.
    pub(super) inner: bool,
}

/// The visits of some cells. Each is made when it is looked at: a long record has as many as rows.
pub(super) struct Visits<'a> {
    time_s: &'a [f64],
    values: &'a [f64],
    pub(super) cells: &'a [usize],
    /// Step of usual length in time, s.
    pub(super) usual_s: f64,
}

impl<'a> Visits<'a> {
    pub(super) fn of(time_s: &'a [f64], values: &'a [f64], cells: &'a [usize]) -> Self {
        let steps: Vec<f64> = cells
            .windows(2)
            .map(|w| time_s[w[1]] - time_s[w[0]])
            .filter(|s| *s > 0.0)
            .collect();
        Visits {
            time_s,
            values,
            cells,
            usual_s: stats::median(&steps),
        }
    }

    /// In order of time.
    pub(super) fn iter(&self) -> impl Iterator<Item = Visit> {
        let alike = |a: &usize, b: &usize| self.values[*a] == self.values[*b];
        self.cells.chunk_by(alike).scan(0, |start, same| {
            let cells = *start..*start + same.len();
            *start = cells.end;
            Some(self.visit(cells))
        })
    }

    /// Distance and time between two cells: value, value in a step of usual length, s.
    pub(super) fn way(&self, a: usize, b: usize) -> (f64, f64, f64) {
        let (a, b) = (self.cells[a], self.cells[b]);
        let (distance, time_s) = (
            (self.values[b] - self.values[a]).abs(),
            self.time_s[b] - self.time_s[a],
        );
        let rows = time_s / self.usual_s;
        let per_row = if rows > 1.0 {
            distance / rows
        } else {
            distance
        };
        (distance, per_row, time_s)
    }

    pub(super) fn visit(&self, cells: Range<usize>) -> Visit {
        let before = cells.start.checked_sub(1).map(|a| self.way(a, cells.start));
        let after = (cells.end < self.cells.len()).then(|| self.way(cells.end - 1, cells.end));
        let sides = || before.iter().chain(&after);
        let least = |of: fn(&(f64, f64, f64)) -> f64| sides().map(of).fold(f64::INFINITY, f64::min);
        Visit {
            value: self.values[self.cells[cells.start]],
            cells,
            distance: least(|s| s.0),
            per_row: least(|s| s.1),
            way_s: least(|s| s.2),
            inner: before.is_some() && after.is_some(),
        }
    }
}
