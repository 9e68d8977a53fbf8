//! A break of the sample clock in the first rows, before which there are too few blocks to tell a step of the phase: the
//! tuning word's phase counts from row 0, so all rows after it would look late.

use super::blocks::{self, Block, noise};
use super::clock::Break;
use super::input::Capture;
use super::tone::Tone;
use std::f64::consts::TAU;

/// Blocks in which it is looked for.
const BLOCKS: usize = 2;
/// Blocks after them that tell the tone.
const AFTER: usize = 8;
/// Samples lost, at most.
const MOST: u64 = 512;
/// Squared deviations of a row that count, at most: a wrong code decides nothing.
const MOST_OF_A_ROW: f64 = 25.0;
/// Squared deviations that the break has to explain: no eight wrong codes do.
const LEAST: f64 = 200.0;
/// The same for one number of samples more or less.
const LEAST_OF_A_SAMPLE: f64 = 12.0;
/// Mean square of deviations up to which the rows before the break are those of the tone.
const FITS: f64 = 2.0;

/// The break in the first rows, if there is one.
pub fn first_break(capture: &Capture, tone: &Tone) -> Option<Break> {
    let word = tone.word?;
    let blocks = blocks::blocks(capture, tone);
    let rows = blocks.get(BLOCKS)?.rows.start;
    let near = blocks.get(BLOCKS..(BLOCKS + AFTER).min(blocks.len()))?;
    let after = [0, 1].map(|c: usize| blocks::median_tone(near, c));
    let start = Start::of(capture, tone, &blocks, rows);
    let without = start.least_so_far(&after, near);
    let most = (1u64 << (32 - word.trailing_zeros().min(31))).min(MOST + 1);
    let mut best: Option<(f64, usize, i64)> = None;
    for samples in 1..most as i64 {
        let turns = samples as f64 * tone.turns;
        let with = start.costs(&after.map(|t| turned(&t, -turns)));
        let mut own = 0.0;
        let mut here = (LEAST, 0);
        for (row, (with, without)) in with.iter().zip(&without).enumerate() {
            own += with;
            let sum = without - own;
            // Both channels, one variance each.
            if own <= 2.0 * FITS * (row + 1) as f64 && sum > here.0 {
                here = (sum, row + 1);
            }
        }
        let least = best.map_or(LEAST, |b| b.0 + LEAST_OF_A_SAMPLE);
        if here.0 > least {
            best = Some((here.0, here.1, samples));
        }
    }
    best.map(|(_, row, samples)| Break {
        row,
        turns: blocks::wrapped(samples as f64 * tone.turns),
        samples: Some(samples),
    })
}

/// A channel's tone some turns later.
fn turned([one, sin, cos]: &[f64; 3], turns: f64) -> [f64; 3] {
    let (s, c) = (TAU * turns).sin_cos();
    [*one, sin * c - cos * s, cos * c + sin * s]
}

/// The first rows: constant, sine and cosine of the phase, codes.
struct Start {
    rows: Vec<([f64; 3], [f64; 2])>,
    variances: [f64; 2],
}

impl Start {
    fn of(capture: &Capture, tone: &Tone, blocks: &[Block], rows: usize) -> Self {
        let code =
            |c: usize, row: usize| f64::from(capture.codes[c].get(row).copied().unwrap_or(0));
        let row = |row: usize| (blocks::at(tone, row), [code(0, row), code(1, row)]);
        Start {
            rows: (0..rows).map(row).collect(),
            variances: [0, 1].map(|c: usize| noise(blocks, c)),
        }
    }

    /// Squared deviations of the rows up to each from the tone after them, or from that of any of the blocks `near`
    /// if it fits better: where the tone differs from block to block (a coarse phase truncation), a start that
    /// differs as much is no break.
    fn least_so_far(&self, after: &[[f64; 3]; 2], near: &[Block]) -> Vec<f64> {
        let mut least = vec![f64::INFINITY; self.rows.len()];
        for tone in std::iter::once(after).chain(near.iter().map(|b| &b.tone)) {
            let mut sum = 0.0;
            for (least, cost) in least.iter_mut().zip(self.costs(tone)) {
                sum += cost;
                *least = least.min(sum);
            }
        }
        least
    }

    /// Squared deviations of each row from a tone of both channels.
    fn costs(&self, tone: &[[f64; 3]; 2]) -> Vec<f64> {
        let of = |(x, codes): &([f64; 3], [f64; 2])| -> f64 {
            let channels = tone.iter().zip(codes).zip(self.variances);
            let squares = channels.map(|((tone, code), variance)| {
                let value: f64 = tone.iter().zip(x).map(|(a, b)| a * b).sum();
                ((code - value).powi(2) / variance).min(MOST_OF_A_ROW)
            });
            squares.sum()
        };
        self.rows.iter().map(of).collect()
    }
}
