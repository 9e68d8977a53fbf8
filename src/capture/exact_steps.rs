//! Coefficients at which the quantiser's steps are where the codes say, where the noise was added after rounding.
//!
//! Such a code is a whole number that jumps where the signal passes a step: each row near a step says on which side of
//! it the signal is. All of them tell it to a code over the number of rows; least squares, for which the jumps are a
//! given column, to the noise over the root of that number. At its answer some rows in a hundred are on the wrong side,
//! and their likelihood would be what sets of effects are judged by.

use super::columns::{HAT, Model, Rows, SAW, SEGMENT, chunks};
use super::gram::Combo;
use super::input::{Capture, Part};
use super::signal::is_undithered;
use super::signal::rest;
use nalgebra::{DMatrix, DVector};

/// Most directions that are searched.
const DIRECTIONS: usize = 16;
/// Deviations of the signal within which a step may be passed.
const REACH: f64 = 6.0;
/// Steps of the search, deviations of least squares.
const STRIDES: [f64; 8] = [2.0, 1.0, 0.5, 0.25, 0.125, 0.06, 0.03, 0.015];
/// Eigenvalue of the sums of products, each column of length one, below which a direction is none.
const LEAST_EIGENVALUE: f64 = 1e-8;
/// Times that all directions are tried with one stride.
const SWEEPS: usize = 4;

/// A row of a channel, at the model.
struct Row {
    /// Before the quantiser, codes.
    signal: f64,
    /// Of the code, codes.
    error: f64,
    weight: f64,
    /// Share of the quantiser's error in the codes.
    saw: f64,
}

/// The search: coefficients are `coefficients + directions z`.
struct Search {
    directions: DMatrix<f64>,
    /// Rows that may come to the other side of a step, with what each direction moves them by, codes.
    near: Vec<(DVector<f64>, Row)>,
    /// What the other rows make of z: -2 slope z + z' curve z.
    slope: DVector<f64>,
    curve: DMatrix<f64>,
}

/// The coefficients of a model with its own steps, by channel and column, moved to where the codes are likeliest:
/// those of `combos` but for the quantiser's own error. Every `stride`-th chunk of the training rows is looked at.
/// `None` where no channel shows its steps undithered, or more than sixteen values are free.
pub fn moved(
    capture: &Capture,
    model: &Model,
    combos: &[&Combo],
    stride: usize,
) -> Option<[Vec<f64>; 2]> {
    if !model.coefficients.iter().any(|c| is_undithered(c)) {
        return None;
    }
    let free: Vec<usize> = (0..combos.len())
        .filter(|k| !matches!(combos[*k].name.as_str(), "saw" | "wave"))
        .collect();
    if free.is_empty() || free.len() > DIRECTIONS {
        return None;
    }
    let combos: Vec<&Combo> = free.iter().map(|k| combos[*k]).collect();
    let search = Search::over(capture, model, &combos, stride)?;
    let change = &search.directions * search.best();
    let mut out = model.coefficients.clone();
    for (combo, change) in combos.iter().zip(change.iter()) {
        for (channel, column, factor) in &combo.parts {
            if let Some(value) = out[*channel].get_mut(*column) {
                *value += factor * change;
            }
        }
    }
    Some(out)
}

/// Value of a combo in a channel at a row.
fn value(rows: &Rows, combo: &Combo, channel: usize, i: usize) -> f64 {
    let parts = combo.parts.iter().filter(|p| p.0 == channel);
    let of = |column: usize| match column {
        SEGMENT.. => f64::from(u8::from(rows.segments[channel][i] == column - SEGMENT)),
        HAT.. => {
            let (at, part) = rows.hats[channel][i];
            match column - HAT {
                k if k == at => 1.0 - part,
                k if k == at + 1 => part,
                _ => 0.0,
            }
        }
        _ => rows.dense[channel][column][i],
    };
    parts.map(|p| p.2 * of(p.1)).sum()
}

/// The training rows of both channels, with what each combo makes of them.
fn rows_of(
    capture: &Capture,
    model: &Model,
    combos: &[&Combo],
    stride: usize,
) -> Vec<(DVector<f64>, Row)> {
    let mut out = Vec::new();
    let mut rows = Rows::new();
    for segment in capture.segments.iter().filter(|s| s.part != Part::HeldOut) {
        for chunk in chunks(segment.rows.clone()).step_by(stride) {
            let n = chunk.len();
            rows.fill(capture, model, chunk);
            for channel in 0..2 {
                let coefficients = &model.coefficients[channel];
                for i in (0..n).filter(|i| rows.weight[channel][*i] > 0.0) {
                    let values = combos.iter().map(|c| value(&rows, c, channel, i));
                    let row = Row {
                        signal: rows.signal[channel][i],
                        error: rows.target[channel][i] - rows.value(channel, i, coefficients),
                        weight: rows.weight[channel][i],
                        saw: coefficients[SAW],
                    };
                    out.push((DVector::from_iterator(combos.len(), values), row));
                }
            }
        }
    }
    out
}

/// Independent directions of the coefficients, each of one deviation of least squares, as columns.
fn directions(rows: &[(DVector<f64>, Row)], count: usize) -> DMatrix<f64> {
    let mut sums = DMatrix::<f64>::zeros(count, count);
    for (x, row) in rows {
        sums.syger(row.weight, x, x, 1.0);
    }
    sums.fill_upper_triangle_with_lower_triangle();
    let scale = DVector::from_fn(count, |k, _| 1.0 / sums[(k, k)].max(1e-300).sqrt());
    let unit = DMatrix::from_fn(count, count, |a, b| scale[a] * scale[b] * sums[(a, b)]);
    let eigen = unit.symmetric_eigen();
    let is_free = |k: &usize| eigen.eigenvalues[*k] > LEAST_EIGENVALUE;
    let kept: Vec<usize> = (0..count).filter(is_free).collect();
    DMatrix::from_fn(count, kept.len(), |a, k| {
        scale[a] * eigen.eigenvectors[(a, kept[k])] / eigen.eigenvalues[kept[k]].sqrt()
    })
}

impl Search {
    fn over(capture: &Capture, model: &Model, combos: &[&Combo], stride: usize) -> Option<Self> {
        let all = rows_of(capture, model, combos, stride);
        let directions = directions(&all, combos.len());
        let dims = directions.ncols();
        if dims == 0 {
            return None;
        }
        let mut slope = DVector::zeros(dims);
        let mut curve = DMatrix::zeros(dims, dims);
        let mut near = Vec::new();
        for (x, row) in all {
            let moves = directions.tr_mul(&x);
            let reach = REACH * moves.norm();
            if row.saw != 0.0 && 0.5 - rest(row.signal).abs() < reach {
                near.push((moves, row));
            } else {
                // Its code stays: what is not the quantiser's moves with the signal.
                let share = 1.0 - row.saw;
                slope.axpy(row.weight * row.error * share, &moves, 1.0);
                curve.syger(row.weight * share * share, &moves, &moves, 1.0);
            }
        }
        curve.fill_upper_triangle_with_lower_triangle();
        Some(Search {
            directions,
            near,
            slope,
            curve,
        })
    }

    /// Chi-square at z, less what it is at 0 in the rows that are not near.
    fn chi(&self, z: &DVector<f64>) -> f64 {
        let error = |(moves, row): &(DVector<f64>, Row)| {
            let change = moves.dot(z);
            let moved = rest(row.signal + change) - rest(row.signal);
            row.weight * (row.error - change - row.saw * moved).powi(2)
        };
        let near: f64 = self.near.iter().map(error).sum();
        near - 2.0 * self.slope.dot(z) + z.dot(&(&self.curve * z))
    }

    /// The best z that steps along one direction at a time find, smaller and smaller.
    fn best(&self) -> DVector<f64> {
        let mut z = DVector::zeros(self.directions.ncols());
        let mut chi = self.chi(&z);
        for stride in STRIDES {
            for _ in 0..SWEEPS {
                let before = chi;
                for k in 0..z.len() {
                    for step in [stride, -stride] {
                        let mut next = z.clone();
                        next[k] += step;
                        let at = self.chi(&next);
                        if at < chi {
                            (z, chi) = (next, at);
                        }
                    }
                }
                if chi >= before {
                    break;
                }
            }
        }
        z
    }
}

#[cfg(test)]
mod tests {
    use super::super::candidates::{base, base_ridge, variants};
    use super::super::columns::COS;
    use super::super::gram::{Detail, Gram, Summed, solve, spread};
    use super::super::synthetic::{AMPLITUDE, Made, model};
    use super::*;

    const UNDITHERED: Made = Made {
        rows: 4_000,
        noise: 0.3,
        after: true,
        ..Made::CLEAN
    };

    /// Drive amplitudes, codes, by least squares and then by the steps; the truth is [`AMPLITUDE`].
    fn amplitudes(made: &Made) -> Option<[f64; 2]> {
        let capture = made.capture();
        let (known, mut model) = model(&capture, made);
        model.variance.base = [0.07; 2];
        let free = [[0.0, -AMPLITUDE], [61.7, 20.2]];
        let gain = variants(&known, &model, free, made.rows, false);
        let gain = gain.iter().find(|v| v.combos[0].name == "relative")?;
        let base = base(&known);
        let combos: Vec<&Combo> = base.iter().chain(&gain.combos).collect();
        let mut ridge = base_ridge(&base);
        ridge.resize(combos.len(), 0.0);
        // As a search does: from steps that are off.
        model.neutral[0][COS] = 0.3;
        for _ in 0..3 {
            let gram = Gram::over(&capture, &model, &Summed::of(&combos, 1));
            let solved = solve(gram.all(), &combos, &ridge, Detail::All);
            model.coefficients = spread(&combos, &solved);
            model.neutral.clone_from(&model.coefficients);
        }
        let moved = moved(&capture, &model, &combos, 1)?;
        Some([model.coefficients[0][COS], moved[0][COS]].map(|c| AMPLITUDE - c))
    }

    #[test]
    fn the_steps_tell_an_amplitude_better_than_least_squares() {
        let [squares, steps] = amplitudes(&UNDITHERED)
            .unwrap()
            .map(|a| (a - AMPLITUDE).abs());
        // Its formal deviation is 0.3 codes over the root of half the training rows, 0.008; an amplitude that is off by d
        // puts 2000 d of the 3000 rows on the wrong side, one for 5e-4.
        assert!(squares > 4e-3, "{squares}");
        assert!(steps < 2e-3, "{squares} {steps}");
    }

    #[test]
    fn codes_with_noise_before_rounding_have_no_steps_to_move_to() {
        let made = Made {
            noise: 1.0,
            after: false,
            ..UNDITHERED
        };
        assert!(amplitudes(&made).is_none());
        let capture = made.capture();
        let (known, model) = model(&capture, &made);
        assert!(!base(&known).is_empty() && model.coefficients[0][SAW].abs() < 0.3);
    }
}
