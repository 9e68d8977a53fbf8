//! A search for sinusoids of its own: thousands of frequencies would drown every other candidate in
//! multiplicity, and their null distribution is known without surrogates.

use crate::closure::channels::Channels;
use crate::closure::likelihood::candidates::Grid;
use crate::closure::likelihood::linear::{Basis, dot};
use crate::closure::likelihood::null::bartlett;
use crate::closure::likelihood::reml::Fit;
use crate::closure::likelihood::tail::chi_square_surprise;
use crate::closure::likelihood::whiten::Whitener;
use std::f64::consts::TAU;

/// The strongest sinusoid.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Tone {
    /// Hz.
    pub frequency_hz: f64,
    /// Chance that the strongest of all frequencies is as strong in noise.
    pub p_value: f64,
}

/// Fewest periods over the record: below them a tone is a drift.
const LEAST_PERIODS: f64 = 3.0;

/// Frequencies per independent one.
const OVERSAMPLING: f64 = 2.0;

/// A noise of less posterior weight is not looked at.
const LIGHT: f64 = 0.1;

/// Turns (sine, cosine) pairs by the angles of others.
fn turn(pair: &mut [Vec<f64>], step: &[Vec<f64>]) {
    let [sines, cosines] = pair else { return };
    let [step_sines, step_cosines] = step else {
        return;
    };
    let steps = step_sines.iter().zip(step_cosines);
    for ((s, c), (ds, dc)) in sines.iter_mut().zip(cosines).zip(steps) {
        (*s, *c) = (*s * dc + *c * ds, *c * dc - *s * ds);
    }
}

/// Scans frequencies from three periods over the record to the rows' Nyquist frequency, under the
/// likeliest noises of the grid.
pub fn strongest(c: &Channels, fit: &Fit, grid: &Grid) -> Option<Tone> {
    let rows = fit.problem.y.len();
    let times = fit.reduce(&c.time_s);
    let span = c.span_s();
    if rows < 16 || span <= 0.0 {
        return None;
    }
    let highest = 0.5 * rows as f64;
    let count = ((highest - LEAST_PERIODS) * OVERSAMPLING) as usize;
    let frequency = |k: usize| (LEAST_PERIODS + k as f64 / OVERSAMPLING) / span;
    let mut p_value = 0.0;
    let mut best: Option<(f64, f64)> = None;
    for (shape, weight) in grid.shapes.iter().zip(&grid.weights).take(4) {
        if *weight < LIGHT {
            continue;
        }
        let whitener = Whitener::new(&fit.problem.line, *shape);
        let (mut y, declared) = fit.problem.whiten(&whitener);
        declared.project_off(&mut y);
        let contrasts = whitener.used.saturating_sub(declared.rank());
        let rss = dot(&y, &y).max(f64::MIN_POSITIVE);
        let mut greatest = 0.0f64;
        // Each frequency is the one before, turned by a constant step.
        let angles = |w: f64| -> Vec<Vec<f64>> {
            [
                times.iter().map(|t| (w * t).sin()).collect(),
                times.iter().map(|t| (w * t).cos()).collect(),
            ]
            .into()
        };
        let mut pair = angles(TAU * frequency(0));
        let step = angles(TAU / (OVERSAMPLING * span));
        for k in 0..count {
            if k > 0 {
                turn(&mut pair, &step);
            }
            let mut own = Basis::default();
            for mut column in whitener.apply_all(&pair) {
                declared.project_off(&mut column);
                own.push(&column);
            }
            let explained: f64 = own.q.iter().map(|q| dot(q, &y).powi(2)).sum();
            let ratio = -(-(explained / rss).clamp(0.0, 1.0 - 1e-12)).ln_1p();
            let surprise = chi_square_surprise(2, bartlett(contrasts, 2) * ratio);
            if surprise > greatest {
                greatest = surprise;
                if best.is_none_or(|b| surprise > b.1) {
                    best = Some((frequency(k), surprise));
                }
            }
        }
        // Half the frequencies are independent, and a little more by the finer grid.
        let independent = 1.4 * count as f64 / OVERSAMPLING;
        let one = (-greatest).exp();
        let any = 1.0 - (independent * (-one).ln_1p()).exp();
        p_value += weight * any.max(independent * one * 0.5);
    }
    let weights: f64 = grid.weights.iter().take(4).filter(|w| **w >= LIGHT).sum();
    best.map(|(frequency_hz, _)| Tone {
        frequency_hz,
        p_value: (p_value / weights.max(f64::MIN_POSITIVE)).min(1.0),
    })
}
