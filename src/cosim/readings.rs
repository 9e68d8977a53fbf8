//! Averaged readings, each warm-started by itself from the analytic steady state: a thermal run of
//! hours in seconds, its readings in any order and on any number of threads with the same bits.

use super::path::{Path, RealRow};
use super::scale::full_scale_dps;
use super::surroundings::{Moment, World};
use crate::circuit::engine::ArithmeticKind;
use crate::design::Design;
use crate::error::Result;
use crate::parallel::in_parallel;
use crate::plant::noise::{Noise, Pairs, Shared};
use crate::plant::profile::{Profile, Reading};
use serde::Serialize;

/// The mean of a reading's rows.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, schemars::JsonSchema)]
pub struct Mean {
    /// Drive phase, rad.
    pub phase_rad: f64,
    /// Drive frequency, Hz.
    pub freq_hz: f64,
    /// Drive gain relative to nominal.
    pub agc: f64,
    /// Drive magnitude, as a value of the decimator's output.
    pub magnitude: f64,
    /// Rate before compensation, deg/s.
    pub rate_out_dps: f64,
    /// Compensated rate, deg/s; NaN without compensation in the chain.
    pub rate_dps: f64,
    /// Quadrature, deg/s.
    pub quad_dps: f64,
    /// Standard deviation of the phase over the rows, rad.
    pub phase_std_rad: f64,
    /// Standard deviation of the frequency over the rows, Hz.
    pub freq_std_hz: f64,
    /// Standard deviation of the rate before compensation over the rows, deg/s.
    pub rate_std_dps: f64,
}

/// A reading and where it was taken.
#[derive(Debug, Clone, PartialEq)]
pub struct Taken {
    /// Which.
    pub reading: Reading,
    /// Temperatures and what surrounds the gyro.
    pub moment: Moment,
    /// Bit-accurate.
    pub fixed: Mean,
    /// Without quantisation.
    pub float: Mean,
}

/// How readings are taken.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Options {
    /// Decimated samples in a reading.
    pub rows: usize,
    /// Threads; the result does not depend on it.
    pub threads: usize,
}

/// The moments of readings along a profile.
pub fn moments(design: &Design, profile: &Profile, readings: &[Reading]) -> Vec<Moment> {
    let mut world = World::new(design, profile.clone());
    let times = readings.iter().map(|r| r.time_s);
    times.map(|time_s| world.advance_to(time_s)).collect()
}

/// Takes every reading, float and fixed. `said` is told how many are done.
///
/// # Errors
/// A circuit that stops on an overflow, a phase loop that cannot lock: that of the first reading that has one.
pub fn take(
    design: &Design,
    readings: &[Reading],
    moments: &[Moment],
    options: Options,
    said: &(dyn Fn(usize) + Sync),
) -> Result<Vec<Taken>> {
    let jobs: Vec<(&Reading, &Moment)> = readings.iter().zip(moments).collect();
    let taken = in_parallel(&jobs, options.threads, said, |(reading, moment)| {
        let noise = Shared::new(Noise::new(design.thermal_run.seed, reading.index));
        let by = |kind| mean_under(design, kind, moment, options.rows, &noise.walk());
        Ok(Taken {
            reading: **reading,
            moment: **moment,
            fixed: by(ArithmeticKind::Fixed)?,
            float: by(ArithmeticKind::Float)?,
        })
    });
    taken.into_iter().collect()
}

/// One reading by one arithmetic. Float and fixed see the same noise.
///
/// # Errors
/// As [`take`].
pub fn mean(
    design: &Design,
    kind: ArithmeticKind,
    reading: &Reading,
    moment: &Moment,
    rows: usize,
) -> Result<Mean> {
    let noise = Noise::new(design.thermal_run.seed, reading.index);
    mean_under(design, kind, moment, rows, &noise)
}

fn mean_under(
    design: &Design,
    kind: ArithmeticKind,
    moment: &Moment,
    rows: usize,
    noise: &impl Pairs,
) -> Result<Mean> {
    let mut path = Path::new(design, kind);
    path.warm_start(design, moment.conditions, noise)?;
    let mut averager = Averager::new(design);
    for _ in 0..rows {
        let row = path.period(noise)?;
        averager.add(&row, path.relative_gain(&row));
    }
    Ok(averager.mean())
}

/// Adds up rows.
#[derive(Debug, Clone)]
pub struct Averager {
    scale_dps: f64,
    /// The first row's values, which the sums are relative to.
    origin: Option<[f64; 7]>,
    sums: [f64; 7],
    squares: [f64; 7],
    count: f64,
}

impl Averager {
    /// No rows yet.
    pub fn new(design: &Design) -> Self {
        Averager {
            scale_dps: full_scale_dps(design),
            origin: None,
            sums: [0.0; 7],
            squares: [0.0; 7],
            count: 0.0,
        }
    }

    /// One more row.
    pub fn add(&mut self, row: &RealRow, relative_gain: f64) {
        let [_, _, sense_i, sense_q] = row.channels;
        let values = [
            row.phase_rad,
            row.freq_hz,
            relative_gain,
            row.magnitude,
            sense_i * self.scale_dps,
            row.rate_dps,
            sense_q * self.scale_dps,
        ];
        let origin = *self.origin.get_or_insert(values);
        for (k, value) in values.iter().enumerate() {
            let from_first = value - origin[k];
            self.sums[k] += from_first;
            self.squares[k] += from_first * from_first;
        }
        self.count += 1.0;
    }

    /// Rows so far.
    pub fn rows(&self) -> usize {
        self.count as usize
    }

    /// Their mean; NaN without rows.
    pub fn mean(&self) -> Mean {
        let origin = self.origin.unwrap_or([f64::NAN; 7]);
        let at = |k: usize| origin[k] + self.sums[k] / self.count;
        let std = |k: usize| {
            let mean = self.sums[k] / self.count;
            (self.squares[k] / self.count - mean * mean).max(0.0).sqrt()
        };
        Mean {
            phase_rad: at(0),
            freq_hz: at(1),
            agc: at(2),
            magnitude: at(3),
            rate_out_dps: at(4),
            rate_dps: at(5),
            quad_dps: at(6),
            phase_std_rad: std(0),
            freq_std_hz: std(1),
            rate_std_dps: std(4),
        }
    }
}
