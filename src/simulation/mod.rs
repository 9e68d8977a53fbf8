//! `gyrogen simulate`: a run of plant and circuit in closed loop, float and fixed; its record, the
//! compensation that it gives, what the loops do, and the published figures beside it.
//!
//! [`readings`] is a thermal run of warm-started readings, [`continuous`] simulates every sample;
//! [`record_csv`] writes the record, [`startup`] switches the gyro on, [`trace`] keeps every node's words of it, [`hunting`] looks at what
//! quantisation leaves of the loops, [`paper`] has the published figures; [`outcome`] is `simulate.json`.

pub mod continuous;
pub mod hunting;
pub mod outcome;
pub mod paper;
pub mod record_csv;
mod request;
pub mod startup;
pub mod trace;

use crate::cosim::readings::{self, Options, Taken};
use crate::design::Design;
use crate::error::Result;
use crate::job::calibration::{self, Calibration};
use crate::output::name_of;
use crate::plant::profile::{Profile, Reading, TEMPERATURES_DEGC};
use crate::record::{self, Warning};
use outcome::Outcome;
pub use request::{Course, Progress, Request, Run};
use std::path::Path;

/// Simulates. Nothing is written.
///
/// # Errors
/// A design or profile that cannot be used; a circuit that stops on an overflow.
pub fn simulate(design: &Design, request: &Request, progress: Progress) -> Result<Outcome> {
    let uncompensated = Design {
        compensation: None,
        ..design.clone()
    };
    let mut warnings = Vec::new();
    let run = match &request.course {
        Course::ThermalRun => {
            let (profile, readings) = Profile::of_run(&design.thermal_run, reading_s(design));
            warnings.extend(beyond(&profile, "[thermal_run]"));
            let taken = warm(
                &uncompensated,
                &profile,
                &readings,
                request.threads,
                progress,
            )?;
            Run {
                taken,
                has: profile.has,
                profile: None,
                continuous: false,
            }
        }
        Course::Profile(path) => {
            let profile = Profile::read(path)?;
            warnings.extend(beyond(&profile, &name_of(path)));
            let readings = profile.even_readings(request.profile_readings);
            let taken = warm(
                &uncompensated,
                &profile,
                &readings,
                request.threads,
                progress,
            )?;
            Run {
                taken,
                has: profile.has,
                profile: Some(path.clone()),
                continuous: false,
            }
        }
        Course::Continuous(seconds) => {
            continuous::run(&uncompensated, *seconds, request.threads, progress)?
        }
    };
    let csv = record_csv::text(design, &run);
    let calibrated = if is_worth_a_fit(&run) {
        match calibrate(design, &csv) {
            Ok(calibrated) => Some(calibrated),
            Err(e) => {
                warnings.push(Warning::general("not_fitted", e.placeless()));
                None
            }
        }
    } else {
        None
    };
    let after = match &calibrated {
        Some((fitted, _)) if !run.continuous => {
            let readings: Vec<Reading> = run.taken.iter().map(|t| t.reading).collect();
            let moments: Vec<_> = run.taken.iter().map(|t| t.moment).collect();
            let rows = rows(fitted);
            let options = Options {
                rows,
                threads: request.threads,
            };
            let total = readings.len() as u64;
            let said = |done: usize| progress("compensated readings", done as u64, total);
            Some(readings::take(fitted, &readings, &moments, options, &said)?)
        }
        _ => None,
    };
    let startup = startup::startup(&uncompensated)?;
    let hunting = hunting::hunting(&uncompensated)?;
    let firmware = calibrated.as_ref().map_or(design, |(fitted, _)| fitted);
    let (drive, sense) = &startup.codes;
    let trace = trace::trace(firmware, (drive, sense), &request.trace)?;
    let scale_factor = if run.continuous {
        Vec::new()
    } else {
        paper::scale_factors(&uncompensated, &run.taken, request.threads)?
    };
    Ok(Outcome::new(outcome::Parts {
        design: design.clone(),
        command: request.command.clone(),
        run,
        record_csv: csv,
        calibrated,
        after,
        startup,
        trace,
        hunting,
        scale_factor,
        warnings,
    }))
}

/// A compensation can be fitted to a run at rest that goes through some temperatures.
fn is_worth_a_fit(run: &Run) -> bool {
    /// K.
    const LEAST_SPAN: f64 = 5.0;
    let degc = || {
        run.taken
            .iter()
            .map(|t| t.moment.temperatures.structure_degc)
    };
    let span = degc().fold(f64::NEG_INFINITY, f64::max) - degc().fold(f64::INFINITY, f64::min);
    let at_rest = run
        .taken
        .iter()
        .all(|t| t.moment.surroundings.rate_dps == 0.0);
    run.taken.len() >= record::thermal::LEAST_ROWS && span >= LEAST_SPAN && at_rest
}

/// Decimated samples of a reading.
fn rows(design: &Design) -> usize {
    design.thermal_run.samples_per_reading as usize
}

/// How long a reading takes, s.
fn reading_s(design: &Design) -> f64 {
    rows(design) as f64 / crate::cosim::rest::rows_per_s(design)
}

fn warm(
    design: &Design,
    profile: &Profile,
    readings: &[Reading],
    threads: usize,
    progress: Progress,
) -> Result<Vec<Taken>> {
    let moments = readings::moments(design, profile, readings);
    let options = Options {
        rows: rows(design),
        threads,
    };
    let total = readings.len() as u64;
    let said = |done: usize| progress("readings", done as u64, total);
    readings::take(design, readings, &moments, options, &said)
}

/// What is said of a chamber at a temperature that no gyro works at; `place` is the file or the table that asks for it.
fn beyond(profile: &Profile, place: &str) -> Option<Warning> {
    let (degc, line) = profile.beyond()?;
    let line = line.map_or(String::new(), |line| format!(":{line}"));
    let (coldest, hottest) = TEMPERATURES_DEGC;
    let said = format!(
        "{place}{line}: the chamber is at {degc} degC, and no gyro works beyond {coldest} to {hottest} degC. The laws of the simulated \
         gyro mean nothing there, and no figure of this run does"
    );
    Some(Warning::general("chamber_beyond", said))
}

/// The compensation that the record gives, through the same door as a measured one.
fn calibrate(design: &Design, csv: &str) -> Result<(Design, Calibration)> {
    // What its reader finds unlikely has remedies for a file, and this one is made here.
    let (record, _) =
        record::thermal::parse(csv.as_bytes(), Path::new("record.csv"), &Default::default())?;
    let mut fitted = design.clone();
    let calibration = calibration::calibrate(&mut fitted, &record, true)?;
    Ok((fitted, calibration))
}
