//! The main job, end to end: a record (measured, or of the design's own thermal run) becomes a bias
//! polynomial, the polynomial becomes coefficients in their formats, the circuit becomes C and
//! Rust, and all of them are run beside each other.
//!
//! [`own_run`] is the design's own thermal run through the circuit, [`from_record`] a measured
//! record through the compensation alone; [`calibration`] fits, [`formats`] chooses formats that the design leaves open,
//! [`coefficients`] rounds the fit into them, [`bound`] keeps to the error that was asked for, [`budget`] adds up what each step of it costs,
//! [`word_lengths`] measures what those of the whole circuit do; [`crate::verify::firmware`]
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
mod points;
mod reading;
pub mod word_lengths;

use crate::compensation::certainty;
use crate::design::Design;
use crate::digest::sha256;
use crate::emit::views::Language;
use crate::error::Result;
use crate::record::{self, Warning};
use outcome::Outcome;
use own_run::Overflowing;
pub use points::{DRIFT_BINS, Point, Points, drift_pp, rms};
use reading::{clamped_bias, compensation, no_compensation, thermometer_raw, warning};
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
    languages: &[Language],
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

    let of_record = warnings.clone();
    say("fitting the bias polynomial");
    let calibration = calibration::calibrate(&mut design, &record, simulated.is_some())?;
    let of_run = simulated
        .as_ref()
        .map_or(Vec::new(), |run| run.warnings(&design));
    warnings = own_run::all_warnings(warnings, calibration.warnings, of_run);
    // Without the circuit in the firmware its loops matter to a simulated run alone.
    let input = design.compensation.as_ref().map(|c| &c.input);
    if simulated.is_some() || input.is_some_and(|i| i.is_of_chain()) {
        warnings.extend(Warning::of_setpoint(&design));
    }
    let (fit, chosen, rounded) = (calibration.fit, calibration.chosen, calibration.rounded);
    let certainty = certainty::certainty(&design)?.ok_or_else(no_compensation)?;
    if calibration.kept.is_some() {
        bound::refuse_saturation(&certainty)?;
    }
    let budget = budget::budget(&design, &fit, &certainty);

    say("emitting the firmware, building and comparing it");
    // What is emitted names the design that it can be emitted from again.
    let mut stamped = design.clone();
    stamped.source.sha256 = sha256(fitted_design::text(&design).as_bytes());
    let firmware = crate::verify::firmware::Firmware::make(&stamped, command, languages)?;
    let compared = firmware.compare(&design)?;

    say("running the record through float, fixed and emitted code");
    let understood = record_path.map(|_| {
        let rows = record.rows_understood(&warnings, design.record.average_s);
        [record.understood(&design.record), rows]
    });
    let points = match &simulated {
        Some(run) => run.points(&design, &fit, &firmware)?,
        None => from_record::points(&design, &fit, record, &firmware)?,
    };
    let word_lengths = {
        let (fixed, float): (Vec<f64>, Vec<f64>) =
            points.iter().map(|p| (p.fixed_dps, p.float_dps)).unzip();
        WordLengths::measure(&design, &fit, &fixed, &float, simulated.as_ref())?
    };
    if certainty.saturates {
        let of_bias =
            |o: &&Overflowing| o.repairs.iter().any(|r| r.key.starts_with("compensation."));
        let overflow = word_lengths.overflow.as_ref().filter(of_bias);
        let mend = match overflow.and_then(Overflowing::mend) {
            Some(mend) => Some(mend),
            None => certainty::mend(&design, &certainty)?
                .map(|r| format!("The smallest change that mends it: {}", r.change())),
        };
        let mend = mend.unwrap_or_else(|| {
            "Give compensation.accumulator or compensation.output more integer bits: `gyrogen check` says which of them can \
             overflow"
                .to_owned()
        });
        warnings.push(warning(
            "bias_saturates",
            format!(
                "the bias leaves its formats inside the calibrated range: at input {} it is {:.4} deg/s from the fit. {mend}",
                certainty.at_input_raw, certainty.exhaustive_max_dps
            ),
        ));
    }
    let record_csv = simulated.map(|run| run.record_csv());
    Ok(Outcome::new(outcome::Parts {
        design,
        command: command.to_owned(),
        record_path: record_path.map(Path::to_path_buf),
        understood,
        record_csv,
        fit,
        of_record,
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
