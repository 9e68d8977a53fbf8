//! What the noise of the thermometer's readings makes of the output.
//!
//! The bias follows the temperature, the declared model the reading. What a reading errs by comes back in the error,
//! times the slope of the bias, and the fitted slope is too small for it (Fuller 1987, "Measurement error models"): then
//! the declared model leaves a part of the temperature's own course, and any effect of a smooth temperature seems
//! to explain it. Beside what the readings err by, in every fit, it does not. That is no part of the model: nothing is
//! known of the next reading's noise.
//!
//! What a reading errs by is known from its neighbours, where the temperature is smooth, and from other channels that follow the
//! temperature alone and read it with less noise: a curve in such a channel would else explain what the
//! thermometer's noise makes of any bias.

use crate::statistics::linear::Basis;
use crate::statistics::smooth::{averaged, reading_noise};
use crate::statistics::stats;
use crate::thermal::channels::{Channels, range};
use crate::thermal::declared_bias::declared_by;
use crate::thermal::effects::map;

/// Powers of a channel that make the temperature of it.
const POWERS: i32 = 6;

/// Most that the temperature by another channel may differ from the reading, rms in units of the reading's noise: it says what
/// the reading errs by only where most of the difference is the reading's.
const SAME: f64 = 1.25;

/// Share of the rows that may be off by more.
const FEW: f64 = 0.01;

/// Regressors of what the readings err by, times powers of u: those of the declared bias's slope where the neighbours tell, and
/// two more where another channel does, so that what other effects of the temperature make of the noise is among them.
/// None where a fit of all rows would not see them (a likelihood that rises by less than a half).
pub fn errors_of(c: &Channels) -> Vec<Vec<f64>> {
    let (low, high) = range(&c.u);
    if high <= low {
        return Vec::new();
    }
    let mean = averaged(&c.time_s, &c.u);
    let mut out = errors(c, &mean, 2);
    out.extend(by_others(c).iter().flat_map(|truth| errors(c, truth, 4)));
    out
}

/// The first `count` regressors, where `truth` is u without the reading's noise.
fn errors(c: &Channels, truth: &[f64], count: i32) -> Vec<Vec<f64>> {
    if c.u == truth {
        return Vec::new();
    }
    let (bias, rest) = declared_by(truth, &c.error_dps);
    let pairs = c.u.iter().zip(truth);
    let blur: Vec<f64> = pairs.map(|(u, s)| bias.at(*u) - bias.at(*s)).collect();
    let share = stats::rms(&blur) / stats::difference_noise(&rest).max(f64::MIN_POSITIVE);
    if rest.len() as f64 * share.powi(2) <= 1.0 {
        return Vec::new();
    }
    let power = |k: i32| {
        let pairs = c.u.iter().zip(truth);
        pairs.map(|(u, t)| u.powi(k) - t.powi(k)).collect()
    };
    (1..=count).map(power).collect()
}

/// u by all channels that read the temperature as well as the thermometer does: least squares over their powers.
fn by_others(c: &Channels) -> Option<Vec<f64>> {
    let noise = noise_of(c);
    let names = c.columns.keys();
    let thermometers = names.filter_map(|name| read_by(c, name, noise));
    let columns: Vec<Vec<f64>> = thermometers.flat_map(|x| of_powers(&x)).collect();
    (!columns.is_empty()).then(|| least_squares(&columns, &c.u).0)
}

/// Whether a channel reads the temperature as well as the thermometer does.
pub(super) fn reads_temperature(c: &Channels, name: &str) -> bool {
    read_by(c, name, noise_of(c)).is_some()
}

/// A channel, scaled, if it follows the temperature up to the noise of the thermometer.
fn read_by(c: &Channels, name: &str, noise: f64) -> Option<Vec<f64>> {
    if name == c.thermometer {
        return None;
    }
    let x = c.moving(name).and(c.scaled(name))?;
    let (_, off) = least_squares(&of_powers(&x), &c.u);
    let sizes = stats::sorted(&map(&off, f64::abs));
    (stats::rms(all_but_few(&sizes)) <= SAME * noise).then_some(x)
}

/// What the thermometer errs by: its noise or, of which rows in which it stands still say nothing, its rounding.
fn noise_of(c: &Channels) -> f64 {
    let rounding = stats::lattice_step(&c.u).map_or(0.0, |step| step / 12f64.sqrt());
    reading_noise(&c.time_s, &c.u).max(rounding)
}

/// Sizes, in order, without the greatest: a few rows without a reading lie between their neighbours. More of them are not of the
/// reading: a channel that lags is the same in a dwell.
fn all_but_few(sizes: &[f64]) -> &[f64] {
    &sizes[..sizes.len() - (FEW * sizes.len() as f64) as usize]
}

/// A channel's powers from the first one on.
fn of_powers(x: &[f64]) -> Vec<Vec<f64>> {
    (1..POWERS).map(|k| map(x, |x| x.powi(k))).collect()
}

/// A column by others and a constant, and what they leave of it.
fn least_squares(columns: &[Vec<f64>], y: &[f64]) -> (Vec<f64>, Vec<f64>) {
    let constant = [vec![1.0; y.len()]];
    let mut off = y.to_vec();
    Basis::new(&[&constant, columns].concat()).project_off(&mut off);
    let by = y.iter().zip(&off).map(|(y, off)| y - off).collect();
    (by, off)
}

#[cfg(test)]
#[path = "reading_tests.rs"]
mod tests;
