//! Columns without meaning: the spectrum of something that a record has, with phases drawn anew.
//!
//! Surrogates by Fourier transform (Theiler et al. 1992, "Testing for nonlinearity in time series"), over the
//! rows as if they were evenly spaced: as slow, as periodic and as large as what they copy, and about nothing.

use crate::statistics::random::Stream;
use crate::thermal::channels::range;
use crate::thermal::close::Closed;
use rustfft::FftPlanner;
use rustfft::num_complex::Complex;
use std::f64::consts::TAU;

/// How many a record is given.
pub const COUNT: usize = 8;

/// Of all phases.
const SEED: u64 = 0xfa4e;

/// A fake column.
#[derive(Debug, Clone, PartialEq)]
pub struct Fake {
    /// Its column.
    pub name: String,
    /// What has its spectrum.
    pub like: String,
    /// One value a row, in the unit of what it is like.
    pub values: Vec<f64>,
}

/// [`COUNT`] columns for a closed record: like what the declared model leaves, what the causes leave, the thermometer, and
/// the other columns that move, in turn. Fewer only where nothing moves.
pub fn of(closed: &Closed) -> Vec<Fake> {
    let sources = sources(closed);
    let taken = |prefix: &str| {
        let mut names = closed.channels.columns.keys();
        names.any(|name| name.starts_with(prefix))
    };
    let mut prefix = "fake_".to_owned();
    while taken(&prefix) {
        prefix += "fake_";
    }
    let turns = sources.iter().cycle().take(COUNT);
    let made = turns.enumerate().map(|(k, (like, values))| Fake {
        name: format!("{prefix}{}", k + 1),
        like: like.clone(),
        values: surrogate(values, &Stream::new(SEED, k as u64 + 1)),
    });
    made.collect()
}

/// What moves in a record, with what it is called.
fn sources(closed: &Closed) -> Vec<(String, Vec<f64>)> {
    let c = &closed.channels;
    let residual = |model: &crate::thermal::search::Model| whole(&model.residual(c));
    let mut out = vec![(
        "what the polynomial leaves".to_owned(),
        residual(&closed.before),
    )];
    if !closed.after.terms.is_empty() {
        out.push(("what the causes leave".to_owned(), residual(&closed.after)));
    }
    out.push((c.thermometer.clone(), c.u.clone()));
    let columns = c.columns.iter();
    out.extend(columns.map(|(name, values)| (name.clone(), values.clone())));
    out.retain(|(_, values)| {
        let (low, high) = range(values);
        high > low
    });
    out
}

/// A residual without holes: the value before one stands in it.
fn whole(values: &[f64]) -> Vec<f64> {
    let mut last = 0.0;
    let each = values.iter().map(|v| {
        if v.is_finite() {
            last = *v;
        }
        last
    });
    each.collect()
}

/// The same magnitudes and the same mean, all other phases drawn from a stream.
pub fn surrogate(values: &[f64], stream: &Stream) -> Vec<f64> {
    let n = values.len();
    let mut lines: Vec<Complex<f64>> = values.iter().map(|v| Complex::new(*v, 0.0)).collect();
    let mut planner = FftPlanner::new();
    planner.plan_fft_forward(n).process(&mut lines);
    for k in 1..=n / 2 {
        let mirrored = n - k;
        let turn = if mirrored == k {
            // The line at half the row rate is real.
            Complex::new(
                if stream.uniform(k as u64) < 0.5 {
                    -1.0
                } else {
                    1.0
                },
                0.0,
            )
        } else {
            Complex::from_polar(1.0, TAU * stream.uniform(k as u64))
        };
        let turned = lines[k] * turn;
        lines[k] = turned;
        lines[mirrored] = turned.conj();
    }
    planner.plan_fft_inverse(n).process(&mut lines);
    lines.iter().map(|z| z.re / n as f64).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn magnitudes(values: &[f64]) -> Vec<f64> {
        let mut lines: Vec<Complex<f64>> = values.iter().map(|v| Complex::new(*v, 0.0)).collect();
        FftPlanner::new()
            .plan_fft_forward(lines.len())
            .process(&mut lines);
        lines.iter().map(|z| z.norm()).collect()
    }

    #[test]
    fn a_fake_has_the_spectrum_and_nothing_else() {
        for n in [1, 2, 255, 256] {
            let noise = Stream::new(3, 1).normals(n);
            let values: Vec<f64> = (0..n).map(|k| noise[k] + 0.1 * k as f64).collect();
            let fake = surrogate(&values, &Stream::new(7, 1));
            for (a, b) in magnitudes(&values).iter().zip(magnitudes(&fake)) {
                assert!((a - b).abs() < 1e-9 * n as f64, "{n}: {a} {b}");
            }
            assert_eq!(fake, surrogate(&values, &Stream::new(7, 1)));
            if n > 2 {
                let other = surrogate(&values, &Stream::new(7, 2));
                let apart = |a: &[f64], b: &[f64]| {
                    let pairs = a.iter().zip(b);
                    pairs.map(|(a, b)| (a - b).powi(2)).sum::<f64>() / n as f64
                };
                assert!(apart(&fake, &values) > 0.5 && apart(&fake, &other) > 0.5);
            }
        }
    }
}
