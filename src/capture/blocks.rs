//! Constant and tone of both channels, block by block: what wrong codes and breaks of the sample clock are seen in, as
//! a median over blocks is moved by neither.

use super::input::Capture;
use super::tone::{Tone, fold};
use crate::statistics::normal::median;
use nalgebra::{Matrix3, Vector3};
use std::f64::consts::TAU;
use std::ops::Range;

/// Periods of the tone in a block: enough to tell the constant from it.
const PERIODS: f64 = 1.5;
/// Rows of a block, at least.
const LEAST_ROWS: usize = 32;

/// Constant, sine and cosine of a block, of both channels, codes.
#[derive(Debug, Clone, PartialEq)]
pub struct Block {
    /// First row and the one after the last.
    pub rows: Range<usize>,
    /// By channel.
    pub tone: [[f64; 3]; 2],
    /// Mean square of what is left, by channel, codes squared.
    pub rest: [f64; 2],
}

impl Block {
    /// The middle of its rows.
    pub fn middle(&self) -> f64 {
        0.5 * (self.rows.start + self.rows.end) as f64
    }
}

/// The blocks of a capture in the order of their rows, all of the same length but the last; those of which less than
/// a quarter is used are not among them.
pub fn blocks(capture: &Capture, tone: &Tone) -> Vec<Block> {
    let edge = (0.5 - tone.folded()).min(tone.folded()).max(1e-9);
    let length = LEAST_ROWS.max((PERIODS / edge).ceil().min(1e12) as usize);
    let rows = capture.rows();
    (0..rows / length)
        .filter_map(|k| {
            let end = if (k + 2) * length > rows {
                rows
            } else {
                (k + 1) * length
            };
            block(capture, tone, k * length..end)
        })
        .collect()
}

/// Constant 1, sine and cosine of a row's phase.
pub fn at(tone: &Tone, row: usize) -> [f64; 3] {
    let (sin, cos) = (TAU * tone.phase(row)).sin_cos();
    [1.0, sin, cos]
}

/// Code of a row.
fn code(capture: &Capture, channel: usize, row: usize) -> f64 {
    f64::from(capture.codes[channel].get(row).copied().unwrap_or(0))
}

/// Least squares in the used rows of a block; `None` if less than a quarter of them are.
fn block(capture: &Capture, tone: &Tone, rows: Range<usize>) -> Option<Block> {
    let mut sums = Matrix3::<f64>::zeros();
    let mut right = [Vector3::<f64>::zeros(); 2];
    let (mut used, mut squares) = (0usize, [0.0; 2]);
    for row in rows.clone().filter(|row| !capture.is_left_out(*row)) {
        let x = Vector3::from(at(tone, row));
        sums += x * x.transpose();
        used += 1;
        for (channel, right) in right.iter_mut().enumerate() {
            let y = code(capture, channel, row);
            *right += x * y;
            squares[channel] += y * y;
        }
    }
    if 4 * used < rows.len() {
        return None;
    }
    let inverse = sums.try_inverse()?;
    let tones = right.map(|right| inverse * right);
    let free = used.saturating_sub(3).max(1) as f64;
    let rest = [0, 1].map(|c: usize| (squares[c] - tones[c].dot(&right[c])).max(0.0) / free);
    Some(Block {
        rows,
        tone: tones.map(|t| [t.x, t.y, t.z]),
        rest,
    })
}

/// The median of each figure of a channel's tone over blocks; zeros of none.
pub fn median_tone(blocks: &[Block], channel: usize) -> [f64; 3] {
    [0, 1, 2].map(|k: usize| {
        let mut values: Vec<f64> = blocks.iter().map(|b| b.tone[channel][k]).collect();
        median(&mut values).unwrap_or(0.0)
    })
}

/// Variance of the noise about the tone in a channel: the median over blocks, codes squared, not below that of rounding.
pub fn noise(blocks: &[Block], channel: usize) -> f64 {
    let mut values: Vec<f64> = blocks.iter().map(|b| b.rest[channel]).collect();
    median(&mut values).unwrap_or(0.0).max(1.0 / 12.0)
}

/// Phase of a channel's tone against the oscillator's, turns in -1/2 .. 1/2.
pub fn phase(tone: &[f64; 3]) -> f64 {
    let [_, sin, cos] = tone;
    (-sin).atan2(*cos) / TAU
}

/// A difference of phases in -1/2 .. 1/2 turn.
pub fn wrapped(turns: f64) -> f64 {
    turns - turns.round()
}

/// Least phase of a tone that a whole number of samples makes, turns: that of one sample.
pub fn of_a_sample(tone: &Tone) -> f64 {
    fold(tone.turns)
}
