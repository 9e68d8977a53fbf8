//! Noise of the bank: white, 1/f in two constructions, rate random walk, outliers.

use super::dice::Dice;
use super::linear::{deviation, rms};
use crate::rng::Rng;

/// What a record's noise is like; sizes are relative to the white part's standard deviation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Flavour {
    White,
    /// White with 1/f of this rms over the record.
    Pink(f64),
    /// White with a random walk that ends this far away (one sigma).
    Walk(f64),
}

/// Noise on the regular grid.
pub struct Noise {
    /// deg/s.
    pub values: Vec<f64>,
    /// The part that is not white, deg/s.
    pub slow: Vec<f64>,
    /// deg/s; rms of first differences over the square root of 2.
    pub short_term: f64,
}

/// Noise with white standard deviation `sigma` (deg/s) on `n` rows.
pub fn make(n: usize, sigma: f64, flavour: Flavour, rng: &mut Rng) -> Noise {
    let mut values: Vec<f64> = (0..n).map(|_| sigma * rng.gauss()).collect();
    let slow = match flavour {
        Flavour::White => vec![0.0; n],
        Flavour::Pink(size) => {
            let raw = if rng.odds(0.5) {
                kasdin(n, rng)
            } else {
                relaxations(n, rng)
            };
            let unit = deviation(&raw).max(1e-300);
            raw.iter().map(|x| size * sigma * x / unit).collect()
        }
        Flavour::Walk(size) => walk(n, rng)
            .iter()
            .map(|x| size * sigma * x / (n as f64).sqrt())
            .collect(),
    };
    values.iter_mut().zip(&slow).for_each(|(v, s)| *v += s);
    let steps: Vec<f64> = values.windows(2).map(|w| w[1] - w[0]).collect();
    Noise {
        short_term: rms(&steps) / 2f64.sqrt(),
        values,
        slow,
    }
}

/// 1/f noise as white noise through a half integration: h_0 = 1, h_k = h_(k-1) (k - 1/2) / k
/// (Kasdin, Proc. IEEE 83, 1995, with alpha = 1), after a run-in of 512 rows.
pub fn kasdin(n: usize, rng: &mut Rng) -> Vec<f64> {
    let run_in = 512;
    let total = n + run_in;
    let white: Vec<f64> = (0..total).map(|_| rng.gauss()).collect();
    let mut h = vec![1.0; total];
    for k in 1..total {
        h[k] = h[k - 1] * (k as f64 - 0.5) / k as f64;
    }
    (run_in..total)
        .map(|i| (0..=i).map(|k| h[k] * white[i - k]).sum())
        .collect()
}

/// 1/f noise as a sum of relaxations with time constants 1, 4, 16, ... rows and equal variance
/// (Ornstein-Uhlenbeck processes, McWhorter's picture).
pub fn relaxations(n: usize, rng: &mut Rng) -> Vec<f64> {
    let mut total = vec![0.0; n];
    let mut tau = 1.0;
    while tau < 2.0 * n as f64 {
        let keep = (-1.0f64 / tau).exp();
        let mut x = rng.gauss();
        for out in &mut total {
            *out += x;
            x = keep * x + (1.0 - keep * keep).sqrt() * rng.gauss();
        }
        tau *= 4.0;
    }
    total
}

/// Sum of unit steps: after n rows, sigma is sqrt(n).
pub fn walk(n: usize, rng: &mut Rng) -> Vec<f64> {
    let mut x = 0.0;
    (0..n)
        .map(|_| {
            x += rng.gauss();
            x
        })
        .collect()
}

/// Puts outliers of 8 to 40 sigma on a share of the rows; returns which rows.
pub fn outliers(values: &mut [f64], sigma: f64, share: f64, rng: &mut Rng) -> Vec<bool> {
    values
        .iter_mut()
        .map(|v| {
            let hit = rng.odds(share);
            if hit {
                *v += rng.sign() * rng.between(8.0, 40.0) * sigma;
            }
            hit
        })
        .collect()
}
