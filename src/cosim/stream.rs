//! A thermal run as one unbroken stream of ADC codes: what firmware would see, so that every
//! implementation of the chain can be run on it. The loops are not set but settle by themselves
//! after each change of temperature.

use super::path::Path;
use super::rest;
use super::surroundings::{Moment, World};
use crate::circuit::engine::ArithmeticKind;
use crate::design::Design;
use crate::error::{InputError, Result};
use crate::plant::noise::Noise;
use crate::plant::profile::{self, Profile};

/// The most ADC samples that a stream may have.
const LIMIT: usize = 1 << 28;

/// Temperatures of [`stimulus`], and rates at each of them.
pub const STEPS: usize = 24;

/// Codes of the closed loop for comparisons, `samples` of them: the run's temperatures from its start to its
/// top and back in steps, at rest and at the table's rate both ways in turn. The loops follow by
/// themselves; an overflow saturates where the design says `error`.
///
/// # Errors
/// None that is known: no cast of such a design stops.
pub fn stimulus(design: &Design, samples: usize) -> Result<(Vec<i32>, Vec<i32>)> {
    let dwells = profile::dwells(&design.thermal_run);
    let ratio = design.circuit.decimator.ratio as usize;
    let rows = samples.div_ceil(ratio * STEPS).max(1);
    let uncompensated = Design {
        compensation: None,
        ..design.without_stops()
    };
    let mut path = Path::new(&uncompensated, ArithmeticKind::Fixed);
    let (mut drive, mut sense) = (Vec::new(), Vec::new());
    for step in 0..STEPS {
        let (degc, _) = dwells
            .get(step * dwells.len() / STEPS)
            .copied()
            .unwrap_or((design.thermal_run.start_degc, true));
        let mut moment = World::new(design, Profile::constant(degc)).advance_to(0.0);
        let rates = [0.0, 1.0, -1.0, 0.5];
        moment.conditions.rate_dps = rates[step % rates.len()] * design.thermal_run.scale_rate_dps;
        if step == 0 {
            path.start(moment.conditions);
        } else {
            path.gyroscope.set(moment.conditions);
        }
        let noise = Noise::new(design.thermal_run.seed, step as u64);
        for _ in 0..rows {
            path.period(&noise)?;
            let [d, s] = path.codes();
            drive.extend_from_slice(d);
            sense.extend_from_slice(s);
        }
    }
    drive.truncate(samples);
    sense.truncate(samples);
    Ok((drive, sense))
}

/// Codes, and where the readings are in them.
#[derive(Debug, Clone, PartialEq)]
pub struct Stream {
    /// Drive codes.
    pub drive: Vec<i32>,
    /// Sense codes.
    pub sense: Vec<i32>,
    /// Decimated samples of a reading, its settling included.
    pub rows_per_reading: usize,
    /// Of which these are dropped.
    pub settling_rows: usize,
}

/// Decimated samples of a reading in a stream, its settling included.
///
/// # Errors
/// A loop that does not settle.
pub fn rows_per_reading(design: &Design) -> Result<usize> {
    Ok(rest::settling_rows(design)? + design.thermal_run.samples_per_reading as usize)
}

/// The codes of readings at these moments, by the bit-accurate circuit.
///
/// # Errors
/// A circuit that stops on an overflow, a loop that does not settle, more samples than fit.
pub fn stream(design: &Design, moments: &[Moment]) -> Result<Stream> {
    let settling_rows = rest::settling_rows(design)?;
    let rows_per_reading = rows_per_reading(design)?;
    let samples = rows_per_reading * design.circuit.decimator.ratio as usize;
    if samples.saturating_mul(moments.len()) > LIMIT {
        return Err(InputError::new(format!(
            "the thermal run has {} readings of {samples} ADC samples, more than {LIMIT} in all",
            moments.len()
        ))
        .help("lower thermal_run.samples_per_reading or readings_per_dwell, or raise step_k")
        .into());
    }
    let mut path = Path::new(design, ArithmeticKind::Fixed);
    let (mut drive, mut sense) = (Vec::new(), Vec::new());
    for (index, moment) in moments.iter().enumerate() {
        let noise = Noise::new(design.thermal_run.seed, index as u64);
        if index == 0 {
            path.start(moment.conditions);
        } else {
            path.gyroscope.set(moment.conditions);
        }
        for _ in 0..rows_per_reading {
            path.period(&noise)?;
            let [d, s] = path.codes();
            drive.extend_from_slice(d);
            sense.extend_from_slice(s);
        }
    }
    Ok(Stream {
        drive,
        sense,
        rows_per_reading,
        settling_rows,
    })
}
