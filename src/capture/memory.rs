//! Whether instants that seem random remember each other: an aperture's jitter is another one at every sample, a clock or a
//! phase that wanders is not.
//!
//! Where a sample is late by e, its residual is e slope. The mean product of two residuals, some samples apart, is then the
//! instants' covariance times both slopes, beside a constant that coloured noise of the codes makes of it.

use super::columns::{Model, Rows, chunks};
use super::input::Capture;

/// Most samples apart.
const LAGS: usize = 4;
/// Share of the instants' variance from which on their covariance is no jitter's.
const SHARE: f64 = 0.1;

/// Weights, slopes and residuals of one channel's rows.
struct Series {
    weight: Vec<f64>,
    slope: Vec<f64>,
    residual: Vec<f64>,
}

/// The channel whose instants remember each other most, where that is a part of their variance that counts, with minus the
/// logarithm of its probability by chance.
pub fn remembered(
    capture: &Capture,
    model: &Model,
    residuals: [&[f64]; 2],
) -> Option<(usize, f64)> {
    let mut best: Option<(usize, f64)> = None;
    for (channel, residual) in residuals.into_iter().enumerate() {
        let jitter = model.variance.jitter[channel];
        if jitter <= 0.0 {
            continue;
        }
        let (covariance, std) = covariance(&series(capture, model, channel, residual));
        if covariance < SHARE * jitter {
            continue;
        }
        let surprise = 0.5 * (covariance / std).powi(2);
        if best.is_none_or(|b| surprise > b.1) {
            best = Some((channel, surprise));
        }
    }
    best
}

fn series(capture: &Capture, model: &Model, channel: usize, residual: &[f64]) -> Series {
    let mut out = Series {
        weight: Vec::with_capacity(capture.rows()),
        slope: Vec::with_capacity(capture.rows()),
        residual: residual.to_vec(),
    };
    let mut rows = Rows::new();
    for chunk in chunks(0..capture.rows()) {
        let n = chunk.len();
        rows.fill(capture, model, chunk);
        out.weight.extend_from_slice(&rows.weight[channel][..n]);
        out.slope.extend_from_slice(&rows.slope[channel][..n]);
    }
    out.residual.resize(out.weight.len(), 0.0);
    out
}

/// The instants' covariance over a few samples, samples squared, and its standard deviation for instants without any: weighted
/// least squares of the residuals' products on a constant and the slopes' product, one constant for each distance.
fn covariance(series: &Series) -> (f64, f64) {
    let (mut moment, mut information) = (0.0, 0.0);
    for lag in 1..=LAGS {
        let [mut n, mut of_slopes, mut of_products] = [0.0; 3];
        let [mut squares, mut both] = [0.0; 2];
        for row in 0..series.weight.len().saturating_sub(lag) {
            let pair = |values: &[f64]| values[row] * values[row + lag];
            let (weight, slopes) = (pair(&series.weight), pair(&series.slope));
            let product = pair(&series.residual);
            n += weight;
            of_slopes += weight * slopes;
            of_products += weight * product;
            squares += weight * slopes * slopes;
            both += weight * slopes * product;
        }
        if n > 0.0 {
            moment += both - of_slopes * of_products / n;
            information += squares - of_slopes * of_slopes / n;
        }
    }
    match information > 0.0 {
        true => (moment / information, information.sqrt().recip()),
        false => (0.0, f64::INFINITY),
    }
}

#[cfg(test)]
mod tests {
    use super::super::synthetic_rows::{ROWS, WORDS, capture, codes, late, meta, names};
    use super::super::{analyse, report::Findings};
    use crate::thermal::synthetic::Random;
    use std::f64::consts::TAU;

    fn found(word: u32, codes: [Vec<i32>; 2]) -> Findings {
        analyse(&capture(codes, meta(word))).unwrap()
    }

    #[test]
    fn another_instant_at_every_sample_is_jitter_and_nothing_is_left() {
        for (seed, word) in [(1, WORDS[1]), (2, 0x1234_5671), (3, 0x3c00_0001)] {
            let found = found(word, late(seed, word, 0.02, |_, _, x| x));
            assert_eq!(names(&found), ["aperture_jitter"], "{seed}");
            assert!(!found.structure.left, "{seed}: {:?}", found.structure);
        }
    }

    #[test]
    fn instants_that_wander_are_not_all_that_jitter_is() {
        for (seed, word, rho) in [
            (1, WORDS[1], 0.9),
            (2, 0x1234_5671, 0.99),
            (3, 0x0734_5679, 0.998),
        ] {
            let wander_rad = Random::new(seed + 10).coloured(ROWS, rho);
            let made = codes(seed, word, |channel, row, x| {
                let angle = TAU * f64::from(word.wrapping_mul(row as u32)) / 4_294_967_296.0;
                let slope = match channel {
                    0 => 1500.0 * angle.sin(),
                    _ => 300.0 * (angle + 0.3).cos() - 90.0 * (angle + 0.3).sin(),
                };
                x + 0.004 * wander_rad[row] * slope
            });
            let found = found(word, made);
            assert_eq!(names(&found), ["aperture_jitter"], "{seed}");
            let left = found.structure.strongest_channel.unwrap();
            assert!(left.ends_with("remember each other"), "{seed}: {left}");
        }
    }
}
