//! Where the lines are: their frequencies, all at once, beside their amplitudes and phases and a constant (a step of
//! Gauss and Newton on the training rows), with their deviations: the Cramer-Rao bound of sinusoids in noise (Rife &
//! Boorstyn 1974) of the strength that the noise has at each of them.
//!
//! What few periods say of a frequency is less than what is known of the mains: these add that they keep to theirs.

use super::around::{Around, LEAST_VARIANCE};
use super::candidates::Known;
use super::columns::{CHUNK, Model, chunks};
use super::input::{Capture, Part};
use super::mains;
use nalgebra::{DMatrix, DVector};
use std::f64::consts::TAU;

/// Steps below this part of a deviation are none.
const SMALL: f64 = 0.05;
/// Resolutions that a step moves a line by at most: beyond, the sum of sinusoids is not linear in the frequency.
const LONGEST: f64 = 0.5;

/// Moves the lines of a model to where the training rows have them, and notes their deviations, turns a sample; true if
/// none was moved by more than a small part of its own.
pub fn refine(capture: &Capture, known: &Known, model: &mut Model, around: &Around) -> bool {
    let lines = model.lines.len();
    model.line_stds.clear();
    if lines == 0 {
        return true;
    }
    let mut matrix = DMatrix::<f64>::zeros(lines, lines);
    let mut right = DVector::<f64>::zeros(lines);
    for channel in 0..2 {
        let noise = around.noise[channel].max(LEAST_VARIANCE);
        let (square, with) = sums(capture, model, around, channel);
        let Some((own, pull)) = of_frequencies(&square, &with, lines) else {
            return true;
        };
        matrix += own / noise;
        right += pull / noise;
    }
    let rows = capture.rows() as f64;
    for (i, turns) in model.lines.iter().enumerate() {
        // Of a line without amplitude nothing is known but that it was seen at this bin.
        matrix[(i, i)] += rows * rows;
        if let Some(place) = mains::nearest(known, *turns, LONGEST / rows) {
            let weight = (mains::RELATIVE_STD * place).powi(-2);
            matrix[(i, i)] += weight;
            right[i] += weight * (place - turns);
        }
    }
    let Some(inverse) = matrix.try_inverse() else {
        return true;
    };
    moved(capture, model, around, &inverse, &(&inverse * right))
}

/// Takes the step of all lines, and their deviations from its covariance in white noise.
fn moved(
    capture: &Capture,
    model: &mut Model,
    around: &Around,
    covariance: &DMatrix<f64>,
    step: &DVector<f64>,
) -> bool {
    let longest = LONGEST / capture.rows() as f64;
    let spectrum = around.spectrum(capture);
    let mut is_done = true;
    for (i, turns) in model.lines.iter_mut().enumerate() {
        let of_noise = |c: usize| {
            let [sin, cos] = around.lines[c].get(i).copied().unwrap_or([0.0; 2]);
            sin.hypot(cos) / around.noise[c].sqrt()
        };
        let channel = usize::from(of_noise(1) > of_noise(0));
        let excess = spectrum.excess(channel, *turns, &model.tone, around.noise[channel]);
        let std = (covariance[(i, i)] * excess.max(1.0)).sqrt();
        let by = step[i].clamp(-longest, longest);
        is_done &= by.abs() < SMALL * std;
        *turns += by;
        model.line_stds.push(std);
    }
    is_done
}

/// Sums of products of one channel's columns among themselves and with the residual: 1, sine and cosine of each line,
/// what each line's frequency moves.
fn sums(
    capture: &Capture,
    model: &Model,
    around: &Around,
    channel: usize,
) -> (DMatrix<f64>, DVector<f64>) {
    let size = 1 + 3 * model.lines.len();
    let mut square = DMatrix::zeros(size, size);
    let mut with = DVector::zeros(size);
    for segment in capture.segments.iter().filter(|s| s.part != Part::HeldOut) {
        for chunk in chunks(segment.rows.clone()) {
            let columns = columns(capture, model, &around.lines[channel], chunk.clone());
            let residual = around.training[channel].get(chunk).unwrap_or_default();
            let residual = DVector::from_column_slice(residual);
            square += columns.tr_mul(&columns);
            with += columns.tr_mul(&residual);
        }
    }
    (square, with)
}

/// The columns of [`sums`] at some rows, at most [`CHUNK`]; `amplitudes` are sine and cosine of each line, codes.
fn columns(
    capture: &Capture,
    model: &Model,
    amplitudes: &[[f64; 2]],
    rows: std::ops::Range<usize>,
) -> DMatrix<f64> {
    let lines = model.lines.len();
    let middle = 0.5 * capture.rows() as f64;
    let mut out = DMatrix::zeros(rows.len().min(CHUNK), 1 + 3 * lines);
    for (at, row) in rows.enumerate().filter(|r| !capture.is_left_out(r.1)) {
        out[(at, 0)] = 1.0;
        for (i, turns) in model.lines.iter().enumerate() {
            let [a, b] = amplitudes.get(i).copied().unwrap_or([0.0; 2]);
            let (sin, cos) = (TAU * (turns * row as f64).fract()).sin_cos();
            out[(at, 1 + 2 * i)] = sin;
            out[(at, 2 + 2 * i)] = cos;
            // From the middle, where frequency and phase are apart.
            out[(at, 1 + 2 * lines + i)] = TAU * (row as f64 - middle) * (a * cos - b * sin);
        }
    }
    out
}

/// The sums of the frequencies alone, all else fitted beside them.
fn of_frequencies(
    square: &DMatrix<f64>,
    with: &DVector<f64>,
    lines: usize,
) -> Option<(DMatrix<f64>, DVector<f64>)> {
    let rest = with.len() - lines;
    let mut amplitudes = square.view((0, 0), (rest, rest)).into_owned();
    for k in 0..rest {
        // Of lines at the same place the two amplitudes are not told apart.
        amplitudes[(k, k)] = amplitudes[(k, k)] * (1.0 + 1e-9) + 1e-12;
    }
    let mixed = square.view((0, rest), (rest, lines));
    let share = mixed.transpose() * amplitudes.try_inverse()?;
    let own = square.view((rest, rest), (lines, lines)) - &share * mixed;
    let pull = with.rows(rest, lines) - &share * with.rows(0, rest);
    Some((own, pull))
}

#[cfg(test)]
mod tests {
    use super::super::synthetic_rows::{ROWS, WORDS, codes, judged, meta, names};
    use super::*;

    /// Frequency and deviation, Hz, that are told of mains of `hz` and `size` codes at a sample rate.
    fn told(seed: u64, fs_hz: f64, hz: f64, size: f64) -> (f64, f64) {
        let word = WORDS[1];
        let codes = codes(seed, word, |channel, row, x| {
            let wave = (TAU * hz / fs_hz * row as f64 + 0.4).sin();
            x + [size, 0.3 * size][channel] * wave
        });
        let mut meta = meta(word);
        meta.fs_hz = Some(fs_hz);
        let found = judged(codes, meta).2;
        assert_eq!(names(&found), ["mains_pickup"], "{seed}");
        let name = "line1_frequency_hz";
        let step = &found.steps[0];
        (step.parameters[name], step.parameter_std[name])
    }

    #[test]
    fn the_mains_are_where_they_are_and_not_at_their_nominal_frequency() {
        // Four periods. The bound of a known noise (Rife & Boorstyn 1974), training rows only.
        let (fs, size) = (2e5, 3.0);
        let noise = (1.0f64 + 1.0 / 12.0) * (1.0 / (1.0 + 0.09));
        let rows = 0.75 * ROWS as f64;
        let bound = (24.0 * noise / rows).sqrt() / (size * TAU * ROWS as f64 / fs);
        let mut chi = 0.0;
        for (seed, hz) in [49.8, 49.9, 50.1, 50.15, 59.85, 60.15]
            .into_iter()
            .enumerate()
        {
            let (found, std) = told(seed as u64, fs, hz, size);
            // The noise around so slow a line is known to a factor.
            assert!((0.9..1.6).contains(&(std / bound)), "{std} {bound}");
            chi += ((found - hz) / std).powi(2) / 6.0;
        }
        assert!((0.1..2.8).contains(&chi), "{chi}");
    }

    #[test]
    fn where_the_rows_say_little_the_mains_keep_to_their_own() {
        // Four fifths of a period: the smaller, the less its rows say.
        for size in [0.7, 1.0, 3.0] {
            let (found, std) = told(7, 1e6, 50.1, size);
            assert!((0.03..0.19).contains(&std), "{size} {std}");
            assert!((found - 50.1).abs() < 2.0 * std, "{size} {found} {std}");
        }
    }
}
