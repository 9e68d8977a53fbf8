//! Noise with a short memory: beside the white one a first-order Gauss-Markov process (IEEE Std 952, correlated noise), as a
//! filter before the output makes it. 1/f noise that is fitted to it wanders, and it does not.

use super::noise::Timeline;

/// Time constants looked at, in row periods: from the first on, each by this factor longer.
const FIRST: f64 = 0.5;
const LONGER: f64 = 1.5;

/// Time constants that a record at least has for a memory to be short.
const SHORT: f64 = 100.0;

/// Variances of the process looked at, in units of the white one: from the first on, so many, each this many times the
/// one before.
const LEAST: f64 = 0.1;
const VARIANCES: i32 = 10;
const GREATER: f64 = 2.5;

/// A residual under such a noise.
#[derive(Debug, Clone, PartialEq)]
pub struct Memory {
    /// Time constant, in row periods.
    pub tau: f64,
    /// Variance of the process in units of the white one.
    pub variance: f64,
    /// Log-likelihood of the residual, the white variance profiled out, without constants.
    pub loglik: f64,
    /// Its innovations in units of their standard deviation; 0 for rows that are not used.
    pub whitened: Vec<f64>,
}

/// Excess kurtosis of innovations from which on they are not those of a filter's noise, and in units of what chance gives
/// so many normal numbers, sqrt(24 / rows).
const PEAKED: f64 = 1.0;
const BY_CHANCE: f64 = 4.0;

impl Memory {
    /// Whether the innovations are as good as normal, as a filter leaves them. Those of a level that jumps (burst noise, a
    /// contact) are not: most are small, and some as large as the jumps.
    pub fn is_normal(&self) -> bool {
        let used: Vec<f64> = self
            .whitened
            .iter()
            .copied()
            .filter(|v| *v != 0.0)
            .collect();
        let n = used.len().max(1) as f64;
        let mean_of = |power: i32| used.iter().map(|v| v.powi(power)).sum::<f64>() / n;
        let excess = mean_of(4) / mean_of(2).powi(2).max(f64::MIN_POSITIVE) - 3.0;
        excess <= PEAKED.max(BY_CHANCE * (24.0 / n).sqrt())
    }
}

/// The most likely short memory of a residual.
pub fn short_memory(line: &Timeline, residual: &[f64]) -> Option<Memory> {
    let taus = std::iter::successors(Some(FIRST), |t| Some(LONGER * t));
    let taus = taus.take_while(|tau| SHORT * tau <= line.span);
    let variances = (0..VARIANCES).map(|k| LEAST * GREATER.powi(k));
    let pairs = taus.flat_map(|tau| variances.clone().map(move |variance| (tau, variance)));
    let each = pairs.map(|(tau, variance)| {
        let (loglik, whitened) = filtered(line, residual, tau, variance);
        Memory {
            tau,
            variance,
            loglik,
            whitened,
        }
    });
    each.max_by(|a, b| a.loglik.total_cmp(&b.loglik))
}

/// The log-likelihood of innovations in units of a common deviation, with `log_det` of their covariance.
pub fn loglik(whitened: &[f64], used: usize, log_det: f64) -> f64 {
    let n = used.max(1) as f64;
    let square: f64 = whitened.iter().map(|v| v * v).sum();
    -0.5 * (n * (square.max(f64::MIN_POSITIVE) / n).ln() + log_det)
}

/// Kalman filter of one state: the log-likelihood, and the innovations.
fn filtered(line: &Timeline, residual: &[f64], tau: f64, variance: f64) -> (f64, Vec<f64>) {
    let mut whitened = vec![0.0; residual.len()];
    let (mut state, mut uncertain) = (0.0, variance);
    let (mut log_det, mut used) = (0.0, 0);
    let rows = residual.iter().zip(&line.steps).zip(&line.white_factor);
    for (((value, step), factor), white) in rows.zip(&mut whitened) {
        let decay = (-step / tau).exp();
        state *= decay;
        uncertain = variance + decay * decay * (uncertain - variance);
        if !factor.is_finite() {
            continue;
        }
        let of_row = uncertain + factor;
        let innovation = value - state;
        *white = innovation / of_row.sqrt();
        log_det += of_row.ln();
        used += 1;
        let gain = uncertain / of_row;
        state += gain * innovation;
        uncertain *= 1.0 - gain;
    }
    let loglik = loglik(&whitened, used, log_det);
    let square: f64 = whitened.iter().map(|v| v * v).sum();
    let unit = (square / used.max(1) as f64).sqrt().max(f64::MIN_POSITIVE);
    whitened.iter_mut().for_each(|v| *v /= unit);
    (loglik, whitened)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::statistics::noise::Shape;
    use crate::statistics::whiten::Whitener;
    use crate::thermal::synthetic::Random;

    const ROWS: usize = 700;

    fn line() -> Timeline {
        let times_s: Vec<f64> = (0..ROWS).map(|k| k as f64).collect();
        Timeline::new(&times_s, vec![1.0; ROWS]).unwrap()
    }

    /// By how much a short memory is more likely than the likeliest of some 1/f noises and walks.
    fn above(residual: &[f64]) -> (f64, Memory) {
        let line = line();
        let memory = short_memory(&line, residual).unwrap();
        let strengths = [0.0, 0.01, 0.1, 1.0, 10.0, 100.0];
        let shapes = strengths.iter().flat_map(|flicker| {
            strengths.iter().map(|walk| Shape {
                flicker: *flicker,
                walk: *walk,
            })
        });
        let each = shapes.map(|shape| {
            let whitener = Whitener::new(&line, shape);
            loglik(&whitener.apply(residual), ROWS, whitener.log_det)
        });
        (
            memory.loglik - each.fold(f64::NEG_INFINITY, f64::max),
            memory,
        )
    }

    #[test]
    fn a_filters_noise_is_told_from_a_wander() {
        let mut random = Random::new(31);
        for seed in 0..4 {
            let filtered = random.coloured(ROWS, 0.8);
            let noisy: Vec<f64> = filtered.iter().map(|v| v + 0.3 * random.normal()).collect();
            let (above, memory) = above(&noisy);
            assert!(above > 3.0, "{seed}: {above}");
            // exp(-1 / tau) = 0.8.
            assert!((2.5..9.0).contains(&memory.tau), "{seed}: {}", memory.tau);
            let mean_square = memory.whitened.iter().map(|v| v * v).sum::<f64>() / ROWS as f64;
            assert!((mean_square - 1.0).abs() < 1e-9);
            assert!(memory.is_normal(), "{seed}");
        }
    }

    #[test]
    fn a_level_that_jumps_is_no_filters_noise() {
        let mut random = Random::new(33);
        for jump in [6.0, 10.0] {
            let mut level = 0.5 * jump;
            let burst: Vec<f64> = (0..ROWS)
                .map(|_| {
                    // On average it stays for eight rows.
                    if random.normal() > 1.15 {
                        level = -level;
                    }
                    level + random.normal()
                })
                .collect();
            let (above, memory) = above(&burst);
            assert!(above > 3.0 && !memory.is_normal(), "{jump}: {above}");
        }
    }

    #[test]
    fn a_wander_has_no_short_memory() {
        let mut random = Random::new(32);
        let whitener = |flicker, walk| Whitener::new(&line(), Shape { flicker, walk });
        for whitener in [whitener(3.0, 0.0), whitener(100.0, 0.0), whitener(0.0, 0.1)] {
            let white: Vec<f64> = (0..ROWS).map(|_| random.normal()).collect();
            let (above, _) = above(&whitener.colour(&white));
            assert!(above < 0.0, "{:?}: {above}", whitener.shape);
        }
    }
}
