//! The main job, end to end: a record (measured, or of the design's own thermal run) becomes a bias
//! polynomial, the polynomial becomes coefficients in their formats, the circuit becomes C and
//! Rust, and all of them are run beside each other.
//!
//! [`own_run`] is the design's own thermal run through the circuit, [`from_record`] a measured
//! record through the compensation alone; [`calibration`] fits, [`formats`] chooses formats that the design leaves open,
//! [`coefficients`] rounds the fit into them, [`bound`] keeps to the error that was asked for, [`budget`] adds up what each step of it costs,
//! [`word_lengths`] measures what those of the whole circuit do; [`firmware`]
//! emits, builds and compares; [`fitted_design`] is the
//! design that reproduces it; [`outcome`] is what comes of it.

pub mod bound;
pub mod budget;
pub mod calibration;
pub mod coefficients;
pub mod fitted_design;
pub mod formats;
pub mod from_record;
pub mod outcome;
pub mod own_run;
pub mod word_lengths;

use crate::compensation::certainty;
use crate::design::{Compensation, CompensationInput, Design};
use crate::error::Result;
use crate::record::{self, Warning};
use crate::thermal::BaselineFit;
use outcome::{Outcome, Point};
use std::path::Path;
use word_lengths::WordLengths;

/// What a job says while it runs: a step's name.
pub type Say<'a> = &'a dyn Fn(&str);

/// Runs the main job. Nothing is written but what a temporary folder holds.
///
/// # Errors
/// A design or record that cannot be used; emitted code that does not compile. Differences between
/// model and emitted code are not errors here: they are in the outcome.
pub fn run(
    design: &Design,
    record_path: Option<&Path>,
    command: &str,
    say: Say,
) -> Result<Outcome> {
    let mut design = design.clone();
    let (simulated, (record, mut warnings)) = match record_path {
        Some(path) => (None, record::read_any(path, &design.record)?),
        None => {
            say("simulating the design's own thermal run");
            let run = own_run::OwnRun::simulate(&design)?;
            let (csv, path) = (run.record_csv(), Path::new("record.csv"));
            let read = record::thermal::parse(csv.as_bytes(), path, &Default::default())?;
            (Some(run), read)
        }
    };

    say("fitting the bias polynomial");
    let calibration = calibration::calibrate(&mut design, &record, simulated.is_some())?;
    warnings.extend(calibration.warnings);
    if let Some(run) = &simulated {
        warnings.extend(run.warnings(&design));
    }
    let (fit, chosen, rounded) = (calibration.fit, calibration.chosen, calibration.rounded);
    let certainty = certainty::certainty(&design)?.ok_or_else(no_compensation)?;
    if certainty.saturates {
        warnings.push(warning(
            "bias_saturates",
            format!(
                "the bias leaves its formats inside the calibrated range: at input {} it is {:.4} deg/s from the fit",
                certainty.at_input_raw, certainty.exhaustive_max_dps
            ),
        ));
    }
    if calibration.kept.is_some() {
        bound::refuse_saturation(&certainty)?;
    }
    let budget = budget::budget(&design, &fit, &certainty);

    say("emitting, building and comparing C and Rust");
    let firmware = crate::verify::firmware::Firmware::make(&design, command)?;
    let compared = firmware.compare(&design)?;

    say("running the record through float, fixed, C and Rust");
    let points = match &simulated {
        Some(run) => run.points(&design, &fit, &firmware)?,
        None => from_record::points(&design, &fit, &record, &firmware)?,
    };
    let word_lengths = {
        let (fixed, float): (Vec<f64>, Vec<f64>) =
            points.iter().map(|p| (p.fixed_dps, p.float_dps)).unzip();
        WordLengths::measure(&design, &fit, &fixed, &float, simulated.as_ref())?
    };
    let record_csv = simulated.map(|run| run.record_csv());
    Ok(Outcome::new(outcome::Parts {
        design,
        command: command.to_owned(),
        record_path: record_path.map(Path::to_path_buf),
        record_csv,
        fit,
        warnings,
        chosen,
        rounded,
        budget,
        kept: calibration.kept,
        certainty,
        firmware,
        compared,
        points,
        word_lengths,
    }))
}

/// The compensation of a design that has been filled in.
fn compensation(design: &Design) -> Result<&Compensation> {
    design.compensation.as_ref().ok_or_else(no_compensation)
}

fn no_compensation() -> crate::error::Error {
    crate::error::InputError::new("the design has no [compensation]")
        .help("add one, or leave [circuit] out to use the default's")
        .into()
}

/// Raw input of the compensation for a reading of the thermometer, rounded and limited as a driver
/// of the firmware would: phase in rad, or the channel's own unit.
fn thermometer_raw(design: &Design, compensation: &Compensation, reading: f64) -> i128 {
    let to_raw =
        |value: f64, low: i128, high: i128| ((value + 0.5).floor() as i128).clamp(low, high);
    match &compensation.input {
        CompensationInput::Phase => {
            let bits = design.circuit.cordic.angle_bits;
            let half = 1i128 << (bits - 1);
            let turns = reading / std::f64::consts::TAU;
            to_raw(
                turns * crate::numeric::format::pow2(bits as i32),
                -half,
                half - 1,
            )
        }
        CompensationInput::TuningWord(_) => {
            let steps = reading / coefficients::tuning_step_hz(&design.circuit);
            let half = 1i128 << (design.circuit.nco.phase_bits - 1);
            let given = design.circuit.nco.tuning_word as f64;
            to_raw(steps - given, -half, half - 1)
        }
        CompensationInput::Channel(channel) => {
            let format = channel.format;
            to_raw(reading / format.lsb(), format.min_raw(), format.max_raw())
        }
    }
}

/// Points' drift: greatest minus least of the means over bins of the thermometer.
pub fn drift_pp(points: &[Point], of: impl Fn(&Point) -> f64) -> f64 {
    /// Bins over the thermometer's range.
    const BINS: usize = 24;
    let readings = || points.iter().map(|p| p.thermometer);
    let low = readings().fold(f64::INFINITY, f64::min);
    let high = readings().fold(f64::NEG_INFINITY, f64::max);
    let width = (high - low).max(f64::MIN_POSITIVE) / BINS as f64;
    let mut sums = [(0.0, 0usize); BINS];
    for point in points {
        let bin = (((point.thermometer - low) / width) as usize).min(BINS - 1);
        sums[bin].0 += of(point);
        sums[bin].1 += 1;
    }
    // Bins with a third of the usual number of points and more: the others are noise.
    let filled = sums.iter().filter(|b| b.1 > 0).count().max(1);
    let least = (points.len() / filled / 3).max(1);
    let means: Vec<f64> = sums
        .iter()
        .filter(|b| b.1 >= least)
        .map(|b| b.0 / b.1 as f64)
        .collect();
    let greatest = means.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let smallest = means.iter().copied().fold(f64::INFINITY, f64::min);
    if means.is_empty() {
        0.0
    } else {
        greatest - smallest
    }
}

/// Root mean square.
pub fn rms(points: &[Point], of: impl Fn(&Point) -> f64) -> f64 {
    let sum: f64 = points.iter().map(|p| of(p).powi(2)).sum();
    (sum / points.len().max(1) as f64).sqrt()
}

/// A warning that is not about one column.
fn warning(code: &'static str, message: String) -> Warning {
    Warning::general(code, message)
}

/// The fit's bias at a reading limited to the calibrated range, deg/s.
fn clamped_bias(fit: &BaselineFit, reading: f64) -> f64 {
    fit.bias_dps(reading.clamp(fit.range.0, fit.range.1))
}
