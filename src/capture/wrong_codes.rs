//! Rows with a wrong code: a bit that flipped on its way, a word of zeros. Such a code stands out alone: of the codes
//! at the same phase, before and after it, none is near.
//!
//! What an effect makes is no such row. A bend, a limit or missing codes move all codes of a phase alike, also where
//! they make a step (a row beside it has its like on one side), and a random instant of sampling spreads the rows
//! about a phase, which is the measure.

use super::blocks::{self, Block};
use super::input::{Capture, Part};
use super::tone::Tone;
use crate::statistics::normal::median;

/// Deviations from which on a code stands out: Gaussian noise makes none in a million captures, and a code that is less
/// apart moves no fit by more than it knows.
const APART: f64 = 10.0;
/// Least deviation, codes: that of rounding, and some.
const LEAST_SPREAD: f64 = 0.35;
/// Rows of a cell of phases, at most and at least.
const CELL: (usize, usize) = (16, 128);
/// Cells to each side of which the widest spread counts, as a share of all: a random instant moves a peak's codes in
/// the second order only, by its spread beside the peak at most.
const BESIDE: f64 = 1.0 / 32.0;
/// Rows next in phase, on each side, that a code is held against.
const NEXT: usize = 8;
/// Share of the rows up to which they may be accidents.
const MOST: f64 = 0.1;

/// Rows that stand out.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct StandOut {
    /// Ascending.
    pub rows: Vec<usize>,
    /// How many of them are held out.
    pub held: usize,
    /// Row, channel and distance in codes of the farthest.
    pub farthest: Option<(usize, usize, f64)>,
    /// Whether they are so many that they are no accidents.
    pub too_many: bool,
}

/// Looks for wrong codes in both channels.
pub fn find(capture: &Capture, tone: &Tone) -> StandOut {
    let blocks = blocks::blocks(capture, tone);
    let order = by_phase(capture, tone);
    let mut out = StandOut::default();
    if blocks.len() < 3 || order.len() < 2 * CELL.0 {
        return out;
    }
    for channel in 0..2 {
        for (row, off) in of_channel(capture, tone, &blocks, &order, channel) {
            if out.farthest.is_none_or(|f| off.abs() > f.2.abs()) {
                out.farthest = Some((row, channel, off));
            }
            out.rows.push(row);
        }
    }
    out.rows.sort_unstable();
    out.rows.dedup();
    let held = capture.segments.iter().filter(|s| s.part == Part::HeldOut);
    let within = |row: &&usize| held.clone().any(|s| s.rows.contains(*row));
    out.held = out.rows.iter().filter(within).count();
    out.too_many = out.rows.len() as f64 > MOST * order.len() as f64;
    out
}

/// The used rows in the order of their phase.
fn by_phase(capture: &Capture, tone: &Tone) -> Vec<usize> {
    let rows = (0..capture.rows()).filter(|row| !capture.is_left_out(*row));
    let phase = |row: usize| (tone.phase(row) * 4_294_967_296.0) as u32;
    let mut keys: Vec<(u32, usize)> = rows.map(|row| (phase(row), row)).collect();
    keys.sort_unstable();
    keys.into_iter().map(|k| k.1).collect()
}

/// Rows of a channel that stand out, and by how much.
fn of_channel(
    capture: &Capture,
    tone: &Tone,
    blocks: &[Block],
    order: &[usize],
    channel: usize,
) -> Vec<(usize, f64)> {
    let own = blocks::median_tone(blocks, channel);
    let rest = |row: &usize| -> f64 {
        let x = blocks::at(tone, *row);
        let code = capture.codes[channel].get(*row).copied().unwrap_or(0);
        f64::from(code) - own.iter().zip(x).map(|(a, b)| a * b).sum::<f64>()
    };
    let rests: Vec<f64> = order.iter().map(rest).collect();
    let size = (rests.len() / 32).clamp(CELL.0, CELL.1);
    let cells: Vec<(f64, f64)> = rests.chunks(size).map(middle_and_spread).collect();
    let reach = (BESIDE * cells.len() as f64).ceil() as i64;
    let widest = |cell: usize| -> f64 {
        let near = (-reach..=reach).map(|d| (cell as i64 + d).rem_euclid(cells.len() as i64));
        let spreads = near.filter_map(|k| cells.get(k as usize)).map(|c| c.1);
        spreads.fold(LEAST_SPREAD, f64::max)
    };
    let mut out = Vec::new();
    for (cell, values) in rests.chunks(size).enumerate() {
        let Some((middle, _)) = cells.get(cell).copied() else {
            continue;
        };
        let apart = APART * widest(cell);
        for (i, value) in values.iter().enumerate() {
            if (value - middle).abs() <= apart {
                continue;
            }
            let at = cell * size + i;
            let off = nearest(&rests, at, *value);
            if let Some(row) = order.get(at).filter(|_| off.abs() > apart) {
                out.push((*row, off));
            }
        }
    }
    out
}

/// Median, and the deviation that Gaussian noise of the same median distance has.
fn middle_and_spread(values: &[f64]) -> (f64, f64) {
    let middle = median(&mut values.to_vec()).unwrap_or(0.0);
    let mut distances: Vec<f64> = values.iter().map(|v| (v - middle).abs()).collect();
    (middle, 1.4826 * median(&mut distances).unwrap_or(0.0))
}

/// By how much a value is off the medians of the rows before and after it in phase, the nearer of both.
fn nearest(rests: &[f64], at: usize, value: f64) -> f64 {
    let n = rests.len();
    let side = |forward: bool| -> f64 {
        let place = |k: usize| {
            if forward {
                (at + k) % n
            } else {
                (at + n - k) % n
            }
        };
        let mut near: Vec<f64> = (1..=NEXT)
            .filter_map(|k| rests.get(place(k)).copied())
            .collect();
        value - median(&mut near).unwrap_or(value)
    };
    let (before, after) = (side(false), side(true));
    if before.abs() < after.abs() {
        before
    } else {
        after
    }
}
