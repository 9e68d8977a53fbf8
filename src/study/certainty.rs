//! How certain the figures of a run are: with which confidence they hold for noise that was not drawn.
//!
//! Each figure has a standard error in its own unit, from the scatter inside of the stretches that it was taken from;
//! what differs between the temperatures and rates of a plan is part of the figure and no scatter. An interval is the
//! figure with so many standard errors on either side that all intervals that are given together hold at once with
//! [`JOINT`], by Bonferroni: figures of one run share their noise, and Bonferroni asks for no independence. The
//! normal distribution stands for the figures' own, with at least 100 degrees of freedom.

use super::figures::{Figures, arw_deg_rth, line_factor, rest_powers, scale_pairs};
use super::measure::Output;
use super::scenario::{Plan, Role};
use crate::design::LimitName;
use crate::statistics::normal::below;
use serde::Serialize;

/// Confidence of all intervals at once (convention).
pub const JOINT: f64 = 0.95;

/// Figures of a point that have an interval of their own: bias, drift, noise (with it the angle random walk), scale
/// factor, line, start-up.
pub const FIGURES: usize = 6;

/// Means of so many parts of a stretch show the error of its mean; each is longer than the decimator's memory.
const PARTS: usize = 8;

/// Neighbouring bins under Hann's window have the correlations 2/3 and 1/6: a sum of n powers is as certain as that
/// of n / (1 + 2 (4/9 + 1/36)) independent ones (derived).
const HANN_BINS: f64 = 1.0 + 2.0 * (4.0 / 9.0 + 1.0 / 36.0);

/// With which confidence intervals hold.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, schemars::JsonSchema)]
pub struct Confidence {
    /// Of all intervals at once.
    pub joint: f64,
    /// How many there are.
    pub intervals: usize,
    /// Of each by itself: 1 - (1 - joint) / intervals.
    pub each: f64,
    /// `bonferroni`.
    pub correction: &'static str,
    /// Standard errors on either side of a figure.
    pub standard_errors: f64,
}

impl Confidence {
    /// Of so many intervals that are to hold at once.
    pub fn of(intervals: usize) -> Self {
        let miss = (1.0 - JOINT) / intervals.max(1) as f64;
        Confidence {
            joint: JOINT,
            intervals,
            each: 1.0 - miss,
            correction: "bonferroni",
            standard_errors: two_sided(miss),
        }
    }
}

/// Standard deviations beyond which a normal is with probability `miss`, both sides together; to 1e-9.
fn two_sided(miss: f64) -> f64 {
    let (mut low, mut high) = (0.0, 10.0);
    for _ in 0..40 {
        let middle = 0.5 * (low + high);
        if 2.0 * below(-middle) > miss {
            low = middle;
        } else {
            high = middle;
        }
    }
    high
}

/// Standard errors of figures.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Errors {
    /// deg/s.
    pub bias_dps: f64,
    /// deg/s.
    pub drift_dps: f64,
    /// Of the density's square, in parts of it.
    pub noise_square: f64,
    /// ppm.
    pub scale_factor_ppm: f64,
    /// deg/s.
    pub spur_dps: f64,
}

impl Errors {
    /// Of what [`super::figures::added`] makes of the same outputs.
    pub fn new(plan: &Plan, fixed: &Output, twin: &Output) -> Self {
        let series = super::figures::errors(fixed, twin);
        let pairs = plan.nominal.iter().zip(&series);
        let rest: Vec<&Vec<f64>> = pairs
            .filter(|(s, _)| s.role == Role::Rest)
            .map(|(_, v)| v)
            .collect();
        let scatter: Vec<f64> = rest.iter().map(|v| square_error(v)).collect();
        let count = rest.len().max(1) as f64;
        let pooled = scatter.iter().sum::<f64>() / count;
        // One stretch's own scatter is of few parts; it counts where it is the larger.
        let of_end = |k: Option<usize>| {
            k.and_then(|k| scatter.get(k))
                .map_or(pooled, |s| s.max(pooled))
        };
        let means: Vec<f64> = rest.iter().map(|v| mean(v)).collect();
        let by = |a: &usize, b: &usize| means[*a].total_cmp(&means[*b]);
        let ends = [(0..means.len()).min_by(by), (0..means.len()).max_by(by)];
        let (mut power, mut square) = (0.0, 0.0);
        for (sum, bins) in rest_powers(plan, &series) {
            power += sum;
            square += sum * sum * HANN_BINS / bins;
        }
        let pairs = scale_pairs(plan, &twin.rates_dps);
        let turning = pairs
            .iter()
            .flat_map(|(k, _)| [&series[*k], &series[*k + 1]]);
        let scatter: Vec<f64> = turning.map(|v| square_error(v)).collect();
        let turning = 2.0 * scatter.iter().sum::<f64>() / scatter.len().max(1) as f64;
        let least = pairs.iter().map(|(_, dps)| dps.abs());
        let slope = turning.sqrt() / least.fold(f64::INFINITY, f64::min);
        let floor = super::figures::added(plan, fixed, twin).spur_floor_dps;
        Errors {
            bias_dps: (pooled / count).sqrt(),
            drift_dps: (of_end(ends[0]) + of_end(ends[1])).sqrt(),
            noise_square: if power > 0.0 {
                square.sqrt() / power
            } else {
                0.0
            },
            scale_factor_ppm: 1e6 * slope,
            // A bin of noise of power P moves the amplitude of a line in it by the root of P / 2.
            spur_dps: floor / (2.0 * line_factor(&series, plan)).sqrt(),
        }
    }
}

/// Square of the standard error of a series' mean, from the means of its parts.
pub fn square_error(series: &[f64]) -> f64 {
    let length = series.len() / PARTS;
    if length == 0 {
        return 0.0;
    }
    let means: Vec<f64> = series.chunks_exact(length).take(PARTS).map(mean).collect();
    let middle = mean(&means);
    let sum: f64 = means.iter().map(|m| (m - middle).powi(2)).sum();
    sum / (PARTS * (PARTS - 1)) as f64
}

fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len().max(1) as f64
}

/// Least and largest value that a figure may have with the study's confidence.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, schemars::JsonSchema)]
pub struct Bounds {
    /// deg/s.
    pub bias_dps: [f64; 2],
    /// deg/s.
    pub drift_dps: [f64; 2],
    /// deg/s/sqrt(Hz).
    pub noise_dps_rthz: [f64; 2],
    /// deg/sqrt(h).
    pub arw_deg_rth: [f64; 2],
    /// ppm.
    pub scale_factor_ppm: [f64; 2],
    /// deg/s; without a line from 0 to what would have been seen.
    pub spur_dps: [f64; 2],
    /// deg/s; null without loops.
    pub startup_error_dps: Option<[f64; 2]>,
}

impl Bounds {
    /// Of figures with their errors; `startup` with its standard error, deg/s.
    pub fn new(
        f: &Figures,
        e: &Errors,
        startup: Option<[f64; 2]>,
        confidence: &Confidence,
    ) -> Self {
        let z = confidence.standard_errors;
        let around = |value: f64, error: f64| [value - z * error, value + z * error];
        let size = |value: f64, error: f64| around(value, error).map(|end| end.max(0.0));
        let noise = size(1.0, e.noise_square).map(|part| f.noise_dps_rthz * part.sqrt());
        let [least, most] = size(f.spur_dps, e.spur_dps);
        Bounds {
            bias_dps: around(f.bias_dps, e.bias_dps),
            drift_dps: size(f.drift_dps, e.drift_dps),
            noise_dps_rthz: noise,
            arw_deg_rth: noise.map(arw_deg_rth),
            scale_factor_ppm: around(f.scale_factor_ppm, e.scale_factor_ppm),
            spur_dps: if f.spur_dps > 0.0 {
                [least, most.max(f.spur_floor_dps)]
            } else {
                [0.0, f.spur_floor_dps]
            },
            startup_error_dps: startup.map(|[value, error]| around(value, error)),
        }
    }

    /// The largest size that a limited figure may have; `None` of what is known. A start from power-on is an error of
    /// the bias.
    pub fn most(&self, name: LimitName) -> Option<f64> {
        let own = largest(self.of(name)?);
        let start = self.startup_error_dps.filter(|_| name == LimitName::Bias);
        Some(start.map_or(own, |start| own.max(largest(start))))
    }

    /// The interval of a figure that can be limited; `None` of a cost and of the bandwidth, which are known.
    pub fn of(&self, name: LimitName) -> Option<[f64; 2]> {
        match name {
            LimitName::Bias => Some(self.bias_dps),
            LimitName::Drift => Some(self.drift_dps),
            LimitName::Noise => Some(self.noise_dps_rthz),
            LimitName::Arw => Some(self.arw_deg_rth),
            LimitName::ScaleFactor => Some(self.scale_factor_ppm),
            LimitName::Spur => Some(self.spur_dps),
            LimitName::Bandwidth | LimitName::RomBytes | LimitName::CyclesPerRow => None,
        }
    }
}

/// The largest size in an interval.
pub fn largest(interval: [f64; 2]) -> f64 {
    interval[0].abs().max(interval[1].abs())
}

#[cfg(test)]
#[path = "certainty_tests.rs"]
mod tests;
