//! What the figures show of a capture: one pass over the rows for each model.

use super::histogram::Histogram;
use crate::capture::Closed;
use crate::capture::columns::{Model, Rows, chunks};
use crate::capture::input::{Capture, Part};
use rustfft::FftPlanner;
use rustfft::num_complex::Complex;

/// Cells over the codes of a channel.
pub const CELLS: usize = 128;
/// Cells over the slopes.
pub const SLOPES: usize = 32;
/// Longest transform: longer captures are averaged over stretches.
const LONGEST: usize = 1 << 18;

/// Rows that fell into a cell: number, sum and sum of squares of residuals.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Cell {
    /// Number of rows.
    pub rows: f64,
    /// Sum.
    pub sum: f64,
    /// Sum of squares.
    pub squares: f64,
}

impl Cell {
    fn add(&mut self, residual: f64) {
        self.rows += 1.0;
        self.sum += residual;
        self.squares += residual * residual;
    }
}

/// What one model leaves of one channel.
#[derive(Debug, Clone)]
pub struct Left {
    /// Row and residual, rows that are left out not among them.
    pub over_time: Vec<(f64, f64)>,
    /// Square of a line's amplitude over that of a full-scale sine, by bin from zero frequency to half the rate.
    pub spectrum: Vec<f64>,
    /// By the model's signal, from -reach to reach.
    pub by_code: Vec<Cell>,
    /// By the size of its slope, from 0 to [`Left::steepest`].
    pub by_slope: Vec<Cell>,
    /// Largest slope, codes a sample.
    pub steepest: f64,
    /// Codes counted and expected.
    pub histogram: Histogram,
}

/// A closed capture with what is drawn of it.
pub struct View<'a> {
    /// The closure.
    pub closed: &'a Closed,
    /// With the declared model alone, by channel.
    pub before: [Left; 2],
    /// With the steps.
    pub after: [Left; 2],
    /// Largest code of each channel.
    pub reach: [f64; 2],
}

impl<'a> View<'a> {
    /// Goes over the rows.
    pub fn new(closed: &'a Closed) -> Self {
        let capture = &closed.capture;
        let reach = [0, 1].map(|c: usize| {
            let largest = capture.used_codes(c).map(i32::unsigned_abs).max();
            f64::from(largest.unwrap_or(1).max(1))
        });
        let [before, after] = &closed.findings.models;
        View {
            closed,
            before: left(capture, before, reach),
            after: left(capture, after, reach),
            reach,
        }
    }

    /// Whether there is anything to tell before from after.
    pub fn has_steps(&self) -> bool {
        !self.closed.closure.steps.is_empty()
    }

    /// The held-out stretches, rows.
    pub fn held_out(&self) -> impl Iterator<Item = (f64, f64)> + '_ {
        let segments = self.closed.capture.segments.iter();
        let held = segments.filter(|s| s.part == Part::HeldOut);
        held.map(|s| (s.rows.start as f64 - 0.5, s.rows.end as f64 - 0.5))
    }
}

fn left(capture: &Capture, model: &Model, reach: [f64; 2]) -> [Left; 2] {
    let rows = capture.rows();
    let mut residuals = [Vec::with_capacity(rows), Vec::with_capacity(rows)];
    // The tone's largest slope is its amplitude times the angle a sample.
    let steepest = reach.map(|r| 1.02 * r * model.tone.angle().abs());
    let mut by_code = [(); 2].map(|()| vec![Cell::default(); CELLS]);
    let mut by_slope = [(); 2].map(|()| vec![Cell::default(); SLOPES]);
    let mut histograms = [0, 1].map(|c: usize| Histogram::new(capture.used_codes(c)));
    let mut chunk_rows = Rows::new();
    for chunk in chunks(0..rows) {
        let (start, n) = (chunk.start, chunk.len());
        chunk_rows.fill(capture, model, chunk);
        for channel in 0..2 {
            let signals = &chunk_rows.signal[channel];
            let slopes = &chunk_rows.slope[channel];
            for (i, (signal, slope)) in signals.iter().zip(slopes).take(n).enumerate() {
                if capture.is_left_out(start + i) {
                    residuals[channel].push(0.0);
                    continue;
                }
                let residual = chunk_rows.error(model, channel, i);
                residuals[channel].push(residual);
                histograms[channel].add(chunk_rows.code(channel, i), *signal);
                let place = 0.5 + 0.5 * signal / reach[channel];
                if let Some(cell) = cell(&mut by_code[channel], place) {
                    cell.add(residual);
                }
                if let Some(cell) = cell(&mut by_slope[channel], slope.abs() / steepest[channel]) {
                    cell.add(residual);
                }
            }
        }
    }
    let mut spectra = spectra(&residuals, capture.full_scale_codes);
    [0, 1].map(|c: usize| {
        let residual = &residuals[c];
        let mut histogram = std::mem::take(&mut histograms[c]);
        histogram.expect(model, c);
        let kept = (0..rows)
            .zip(residual)
            .filter(|(i, _)| !capture.is_left_out(*i));
        Left {
            over_time: kept.map(|(i, r)| (i as f64, *r)).collect(),
            spectrum: std::mem::take(&mut spectra[c]),
            by_code: std::mem::take(&mut by_code[c]),
            by_slope: std::mem::take(&mut by_slope[c]),
            steepest: steepest[c],
            histogram,
        }
    })
}

/// The cell at a place of 0 to 1; the outermost cells take what is beyond.
fn cell(cells: &mut [Cell], place: f64) -> Option<&mut Cell> {
    let last = cells.len().saturating_sub(1);
    let k = (place * cells.len() as f64).max(0.0) as usize;
    cells.get_mut(k.min(last))
}

/// Hann-windowed periodograms of both channels, averaged over half-overlapping stretches.
fn spectra(residuals: &[Vec<f64>; 2], full_scale: f64) -> [Vec<f64>; 2] {
    let rows = residuals[0].len();
    let length = LONGEST.min(1 << rows.max(2).ilog2());
    let window: Vec<f64> = (0..length)
        .map(|i| 0.5 - 0.5 * (std::f64::consts::TAU * (i as f64 + 0.5) / length as f64).cos())
        .collect();
    let transform = FftPlanner::new().plan_fft_forward(length);
    let mut out = [vec![0.0; length / 2 + 1], vec![0.0; length / 2 + 1]];
    let step = length / 2;
    let stretches = 1 + (rows - length) / step.max(1);
    // The last stretch ends where the capture does.
    let starts = (0..stretches).map(|k| k * step);
    let starts = starts.chain((!(rows - length).is_multiple_of(step)).then_some(rows - length));
    let mut count = 0.0;
    for start in starts {
        let pairs = residuals[0].iter().zip(&residuals[1]).skip(start);
        let mut buffer: Vec<Complex<f64>> = pairs
            .zip(&window)
            .map(|((d, s), w)| Complex::new(d * w, s * w))
            .collect();
        transform.process(&mut buffer);
        for k in 0..=length / 2 {
            // Two real sequences in one transform.
            let (Some(a), Some(b)) = (buffer.get(k), buffer.get((length - k) % length)) else {
                continue;
            };
            for (out, part) in out.iter_mut().zip([a + b.conj(), a - b.conj()]) {
                if let Some(out) = out.get_mut(k) {
                    *out += 0.25 * part.norm_sqr();
                }
            }
        }
        count += 1.0;
    }
    let sum: f64 = window.iter().sum();
    let scale = (2.0 / (sum * full_scale)).powi(2) / count;
    out.map(|power| power.into_iter().map(|p| p * scale).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_stands_at_its_amplitude_in_the_spectrum() {
        // 8 codes of 128 at 1/8 of the rate in the drive, nothing in sense: -24.08 dBFS.
        let wave = |i: usize| 8.0 * (std::f64::consts::TAU * 0.125 * i as f64).sin();
        let residuals = [(0..3000).map(wave).collect(), vec![0.0; 3000]];
        let [drive, sense] = spectra(&residuals, 128.0);
        assert_eq!(drive.len(), 1025);
        let db = 10.0 * drive[256].log10();
        assert!((db + 24.08).abs() < 0.05, "{db}");
        assert!(10.0 * drive[300].log10() < -100.0);
        assert!(sense.iter().all(|p| *p < 1e-20));
    }
}
