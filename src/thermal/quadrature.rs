//! Whether a record's quadrature contains the output.
//!
//! A demodulator of fixed frequency turns against the gyro as the drive's phase moves, so that part of the rate's signal and noise
//! stands in the quadrature. What is in the output then is in the quadrature as well, and any cause looks like a leakage: the
//! channel is no cause but a second, worse output. From row to row it shows: the slope of the output's noise over the quadrature's is then
//! more than the sine of any phase error. A leakage may have such a slope where the phase error is no demodulator's that is in use, but
//! then the applied rate does not stand in the quadrature.

use super::channels::Channels;
use super::search::declared_by;
use crate::record::Warning;
use crate::statistics::linear::dot;
use crate::statistics::stats;

/// The channel.
pub const NAME: &str = "quad_dps";

/// Sine of a phase error that no demodulator has which is in use, 17 degrees: the contract's leakages are a few
/// hundredths of a radian.
const NO_PHASE_ERROR: f64 = 0.3;

/// Standard deviations that a slope has to be beyond it.
const SURELY: f64 = 4.0;

/// Second differences beyond so many robust deviations are not noise (spikes, steps, a course that bends).
const OUTLYING: f64 = 4.0;

/// Share of the quadrature's noise by which the applied rate may bend.
const STEADY: f64 = 0.5;

/// Fewest second differences that a slope is trusted from.
const FEWEST: usize = 30;

/// Factor of a product's variance that its neighbours' correlation makes, for second differences of white noise: 1 + 2 (2/3)^2 + 2 (1/6)^2.
const NEIGHBOURS: f64 = 1.0 + 2.0 * (4.0 / 9.0 + 1.0 / 36.0);

/// Slope of the output's noise over the quadrature's, with its standard deviation; `None` where either has too little. Where the
/// applied rate bends by more than half of the quadrature's noise, both may follow it, the output by an error of its scale.
fn slope(error_dps: &[f64], quad_dps: &[f64], rate_dps: &[f64]) -> Option<(f64, f64)> {
    let bend = |w: &[f64]| w[2] - 2.0 * w[1] + w[0];
    let bends = |v: &[f64]| v.windows(3).map(bend).collect::<Vec<f64>>();
    let (x, y, applied) = (bends(quad_dps), bends(error_dps), bends(rate_dps));
    let noise = stats::mad_std(&x);
    let (most_x, most_y) = (OUTLYING * noise, OUTLYING * stats::mad_std(&y));
    let steady = |k: usize| applied.get(k).is_none_or(|r| r.abs() < STEADY * noise);
    let pairs = x.iter().zip(&y).enumerate();
    let kept: Vec<(f64, f64)> = pairs
        .filter(|(k, (x, y))| steady(*k) && x.abs() < most_x && y.abs() < most_y)
        .map(|(_, (x, y))| (*x, *y))
        .collect();
    let xx: f64 = kept.iter().map(|(x, _)| x * x).sum();
    if kept.len() < FEWEST || xx <= 0.0 {
        return None;
    }
    let slope = kept.iter().map(|(x, y)| x * y).sum::<f64>() / xx;
    let rest: f64 = kept.iter().map(|(x, y)| (y - slope * x).powi(2)).sum();
    let variance = NEIGHBOURS * rest / kept.len() as f64 / xx;
    Some((slope, variance.sqrt()))
}

/// Factor of the slope that the applied rate in a quadrature lets its noise have, from which on it is another one's.
const BY_FAR: f64 = 2.0;

/// Rows in a row that tell the same of a slow course.
const TOGETHER: f64 = 10.0;

/// Whether a slope that is the sine of no phase error in use is a leakage's all the same, by what the declared bias leaves of the
/// output, the quadrature and the applied rate: what a quadrature contains of the rate it contains of the output's noise. Where the
/// rate does not move, nothing is known.
fn leaks(slope: f64, output: &[f64], quad: &[f64], rate: &[f64]) -> bool {
    let square = dot(rate, rate);
    if square <= 0.0 {
        return false;
    }
    let contained = dot(rate, quad) / square;
    let left: Vec<f64> = quad
        .iter()
        .zip(rate)
        .map(|(q, r)| q - contained * r)
        .collect();
    let std = (TOGETHER * dot(&left, &left) / left.len() as f64 / square).sqrt();
    let most = contained.abs() + SURELY * std;
    let ratio = stats::curvature_noise(output) / stats::curvature_noise(quad);
    contained.abs() <= SURELY * std && slope.abs() > BY_FAR * most * ratio * ratio
}

/// What is said of a quadrature that contains the output; `None`: it does not, or is not there.
pub fn contains_output(c: &Channels) -> Option<Warning> {
    let (_, rest) = declared_by(&c.u, &c.error_dps);
    let measured = |column: &[f64]| -> Vec<f64> {
        let rows = c.error_dps.iter().zip(column);
        let rows = rows.filter(|(e, _)| e.is_finite());
        rows.map(|(_, v)| *v).collect()
    };
    let quad_dps = measured(c.moving(NAME)?);
    let rate_dps = c.moving("rate_dps").map(measured).unwrap_or_default();
    let (slope, std) = slope(&rest, &quad_dps, &rate_dps)?;
    let beyond = slope.abs() - SURELY * std > NO_PHASE_ERROR;
    let beside = |name: &str| {
        let column = c.moving(name)?.iter().zip(&c.error_dps);
        let measured = column.map(|(v, e)| if e.is_finite() { *v } else { f64::NAN });
        Some(declared_by(&c.u, &measured.collect::<Vec<f64>>()).1)
    };
    let rate = || beside("rate_dps").unwrap_or_default();
    let leaks = || beside(NAME).is_some_and(|quad| leaks(slope, &rest, &quad, &rate()));
    (beyond && !leaks()).then(|| {
        Warning::on(
            "quadrature_contains_output",
            NAME,
            format!(
                "from row to row the output follows {NAME} with a slope of {slope:.2} +- {std:.2}, which is the sine of no \
                 phase error: the quadrature contains part of the output (a demodulator that the drive's phase has turned). It is \
                 left out, so that a leakage cannot be seen: align the demodulator, or let it follow the drive's phase"
            ),
        )
    })
}

#[cfg(test)]
#[path = "quadrature_tests.rs"]
mod tests;
