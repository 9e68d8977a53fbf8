//! A thermometer that is read less often than the output: its course between the readings.
//!
//! A log repeats the last reading until there is a new one. Where the bias is steep in the temperature, what the repeated
//! readings are behind by comes back in the output, and looks like a lag of a row or two. Between two new readings the
//! temperature goes straight.

use super::channels::Channels;
use super::search::declared_by;
use crate::statistics::smooth::averaged;
use crate::statistics::stats;

/// A thermometer's course between new readings.
#[derive(Debug, Clone, PartialEq)]
pub struct Course {
    /// Rows from one new reading to the next, on average.
    pub rows: f64,
    /// The course, one value a row, in the reading's unit.
    pub reading: Vec<f64>,
    /// What the repeated readings make of the declared bias, rms, deg/s.
    pub artefact_rms_dps: f64,
}

/// Fewest new readings that show a rhythm.
const FEWEST: usize = 20;

/// Rows from one new reading to the next, at most: beyond, somebody sets a temperature.
const MOST_ROWS: usize = 12;

/// Share of the new readings that keep the rhythm: after so many rows, or one more.
const IN_RHYTHM: f64 = 0.9;

/// Share of the rows that repeat a reading.
const REPEATED: f64 = 0.25;

/// Steps of the reading between one new reading and the next: with fewer, readings repeat because they are coarse.
const STEPS: f64 = 4.0;

/// First rows of the runs of equal readings.
fn new_readings(readings: &[f64]) -> Vec<usize> {
    let is_new = |i: &usize| *i == 0 || readings[*i] != readings[*i - 1];
    (0..readings.len()).filter(is_new).collect()
}

/// Whether readings come in a rhythm of their own.
fn repeats(readings: &[f64], new: &[usize]) -> bool {
    let lengths: Vec<usize> = new.windows(2).map(|w| w[1] - w[0]).collect();
    let within = |rows: usize| {
        let kept = lengths.iter().filter(|l| (rows..=rows + 1).contains(*l));
        kept.count() as f64 >= IN_RHYTHM * lengths.len() as f64
    };
    let repeated = readings.len() - new.len();
    let jumps: Vec<f64> = new
        .windows(2)
        .map(|w| (readings[w[1]] - readings[w[0]]).abs())
        .collect();
    let step = stats::lattice_step(readings).unwrap_or(0.0);
    new.len() >= FEWEST
        && repeated as f64 >= REPEATED * readings.len() as f64
        && (1..=MOST_ROWS).any(within)
        && stats::median(&jumps) > STEPS * step
}

/// Straight lines through the new readings; after the last one it stands.
fn straight(time_s: &[f64], readings: &[f64], new: &[usize]) -> Vec<f64> {
    let mut out = readings.to_vec();
    for w in new.windows(2) {
        let (from, to) = (w[0], w[1]);
        let whole = time_s[to] - time_s[from];
        for row in from + 1..to {
            let part = (time_s[row] - time_s[from]) / whole.max(f64::MIN_POSITIVE);
            out[row] += part * (readings[to] - readings[from]);
        }
    }
    out
}

/// The course of a record's thermometer, if it repeats its readings and the output follows the course rather than the readings.
pub fn course(c: &Channels) -> Option<Course> {
    let new = new_readings(&c.u);
    if !repeats(&c.u, &new) {
        return None;
    }
    let u = straight(&c.time_s, &c.u, &new);
    let left = |u: &[f64]| stats::rms(&declared_by(u, &c.error_dps).1);
    let (bias, _) = declared_by(&u, &c.error_dps);
    let pairs = c.u.iter().zip(&u);
    let artefact: Vec<f64> = pairs
        .map(|(read, u)| bias.at(*read) - bias.at(*u))
        .collect();
    (left(&u) < left(&c.u).min(left(&averaged(&c.time_s, &c.u)))).then(|| Course {
        rows: c.len() as f64 / new.len() as f64,
        reading: u.iter().map(|u| c.centre + c.half * u).collect(),
        artefact_rms_dps: stats::rms(&artefact),
    })
}

#[cfg(test)]
#[path = "repeated_tests.rs"]
mod tests;
