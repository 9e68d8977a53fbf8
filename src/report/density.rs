//! Many points as the number of them in each cell of the frame.
//!
//! Dots that cover one another hide how many there are, and the extremes of every stretch alone make two clouds of white
//! noise. The number in each cell is what an eye would see of dots of a fine pen.

use super::marks::number;
use std::collections::BTreeMap;
use std::fmt::Write as _;

/// Edge of a cell, px.
const CELL: f64 = 3.0;
/// Area of the frame that a dot has to itself, px², below which dots are no longer drawn one by one.
const ROOM: f64 = 80.0;
/// Shades: a cell of a shade holds about four times as many as one of the shade below.
const SHADES: usize = 4;

/// Points in a cell.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Cell {
    /// Its middle, px.
    pub x: f64,
    /// Its middle, px.
    pub y: f64,
    /// How many.
    pub count: u64,
    /// Column and row.
    place: (i64, i64),
}

/// Whether so many dots would cover one another in a frame of this area, px².
pub fn is_crowded(points: usize, area: f64) -> bool {
    points as f64 * ROOM > area
}

/// The cells with at least one of the points (px), column by column from the top.
pub fn cells(points: impl Iterator<Item = (f64, f64)>) -> Vec<Cell> {
    let mut counts: BTreeMap<(i64, i64), u64> = BTreeMap::new();
    for (x, y) in points {
        let place = ((x / CELL).floor() as i64, (y / CELL).floor() as i64);
        *counts.entry(place).or_insert(0) += 1;
    }
    let middle = |k: i64| (k as f64 + 0.5) * CELL;
    let cell = |(place, count): ((i64, i64), u64)| Cell {
        x: middle(place.0),
        y: middle(place.1),
        count,
        place,
    };
    counts.into_iter().map(cell).collect()
}

/// Path commands for the cells of each shade, lightest first; cells of a shade one below the other are one mark.
pub fn paths(cells: &[Cell]) -> [String; SHADES] {
    let most = cells.iter().map(|c| c.count).max().unwrap_or(1) as f64;
    let shade = |c: &Cell| {
        let below = (most / c.count as f64).log2() / 2.0;
        (SHADES - 1).saturating_sub(below as usize)
    };
    let mut out = [const { String::new() }; SHADES];
    let is_next =
        |a: &Cell, b: &Cell| (a.place.0, a.place.1 + 1) == b.place && shade(a) == shade(b);
    for run in cells.chunk_by(is_next) {
        let (Some(first), high) = (run.first(), CELL * run.len() as f64) else {
            continue;
        };
        if let Some(d) = out.get_mut(shade(first)) {
            let (x, y) = (number(first.x - 0.5 * CELL), number(first.y - 0.5 * CELL));
            // Writing to a string cannot fail.
            let _ = write!(d, "M{x} {y}h{CELL}v{high}h-{CELL}z");
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_point_is_counted_once_and_shades_follow_the_counts() {
        let mut points = vec![(1.0, 1.0); 64];
        points.extend([(1.5, 4.0), (1.5, 7.0), (100.0, 7.0)]);
        let cells = cells(points.into_iter());
        assert_eq!(cells.iter().map(|c| c.count).sum::<u64>(), 67);
        assert_eq!((cells[0].x, cells[0].y, cells[0].count), (1.5, 1.5, 64));
        let paths = paths(&cells);
        assert_eq!(paths[3], "M0.00 0.00h3v3h-3z");
        // Two cells in one mark; a lone point far off is there.
        assert_eq!(paths[0], "M0.00 3.00h3v6h-3zM99.00 6.00h3v3h-3z");
        assert!(paths[1].is_empty() && paths[2].is_empty());
    }

    #[test]
    fn few_dots_are_drawn_one_by_one() {
        let area = 860.0 * 210.0;
        assert!(!is_crowded(2000, area) && is_crowded(3000, area));
    }
}
