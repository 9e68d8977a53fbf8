//! Whether the rows of a capture are what was sampled, before anything is judged by them: samples lost or repeated,
//! wrong codes. Both are accidents on the way to the file, and no effect of the contract.

use super::blocks::of_a_sample;
use super::clock::{self, Break, Retimed};
use super::idle::{without_copies, without_idle};
use super::input::{Capture, LEAST_ROWS};
use super::tone::Tone;
use super::wrong_codes::{self, StandOut};
use super::{LEAST_PERIODS, frequency, keys, periods};
use crate::error::{InputError, Result};
use crate::record::Warning;
use crate::record::capture::COLUMNS;

/// Breaks that a message names.
const NAMED: usize = 4;

/// The capture with its rows where they belong in time and the wrong codes left out, and what is said of it.
///
/// # Errors
/// Keys that cannot be true, columns without a signal, a tone that is not where `ftw` says; a break of the sample clock
/// that no number of samples explains, with too few rows before it; more wrong codes than accidents make.
pub fn examined(capture: Capture) -> Result<(Capture, Vec<Warning>)> {
    let mut warnings = keys::checked(&capture)?;
    let Some(tone) = Tone::of(&capture).filter(|t| periods(&capture, t) >= LEAST_PERIODS) else {
        return Ok((capture, warnings));
    };
    let (mut capture, copies) = without_copies(capture, &tone);
    warnings.extend(copies);
    warnings.extend(without_idle(&mut capture, &tone)?);
    let mut retimed = clock::retimed(capture, &tone);
    if !retimed.breaks.is_empty() {
        warnings.push(broken_clock(&retimed, &tone));
        refuse_short(&retimed, &tone)?;
    }
    frequency::checked(&retimed.capture, &tone)?;
    // Without a tuning word the tone was fitted to rows that were not at their time.
    let tone = Tone::of(&retimed.capture).unwrap_or(tone);
    let found = wrong_codes::find(&retimed.capture, &tone);
    if found.too_many {
        return Err(too_many(&found, &retimed).into());
    }
    if !found.rows.is_empty() {
        warnings.push(wrong_codes(&found, &retimed));
        let rows = retimed.capture.rows();
        let out = &mut retimed.capture.left_out;
        out.resize(rows, false);
        for row in &found.rows {
            if let Some(out) = out.get_mut(*row) {
                *out = true;
            }
        }
    }
    Ok((retimed.capture, warnings))
}

/// Refuses what is left before a break that nothing explains, where it is too short.
fn refuse_short(retimed: &Retimed, tone: &Tone) -> Result<()> {
    let Some(last) = retimed.breaks.iter().find(|b| b.samples.is_none()) else {
        return Ok(());
    };
    let enough = retimed.capture.used_rows() >= LEAST_ROWS
        && periods(&retimed.capture, tone) >= LEAST_PERIODS;
    if enough {
        return Ok(());
    }
    let error = InputError::new(format!(
        "the tone's phase steps by {:+.4} turn at row {}, and the rows before it are too few to judge",
        last.turns, last.row
    ))
    .help("capture again without interruption, or give the rows after it as a capture of their own");
    Err(retimed.capture.places.put(COLUMNS[0], error).into())
}

/// What is said of breaks of the sample clock.
fn broken_clock(retimed: &Retimed, tone: &Tone) -> Warning {
    let breaks = &retimed.breaks;
    let told: Vec<String> = breaks.iter().take(NAMED).map(told).collect();
    let more = match breaks.len().saturating_sub(NAMED) {
        0 => String::new(),
        n => format!("; and {n} more"),
    };
    let period = tone.word.map(|w| 1u64 << (32 - w.trailing_zeros().min(31)));
    let period = period.filter(|p| (*p as usize) < retimed.capture.rows());
    let is_told = breaks.iter().any(|b| b.samples.is_some());
    let or = match period {
        _ if !is_told => String::new(),
        Some(period) => format!(", or any multiple of {period} more, which the tone does not tell"),
        None => " (the fewest that the tone's phase allows)".to_owned(),
    };
    let then = match breaks.iter().any(|b| b.samples.is_none()) {
        true => "the rows after that are left out",
        false => "the rows after that are judged at their own time",
    };
    Warning::general(
        "sample_clock_broken",
        format!(
            "the tone's phase, {:.4} turn a sample, steps {}{more}{or}; {then}",
            of_a_sample(tone),
            told.join("; ")
        ),
    )
}

fn told(b: &Break) -> String {
    let step = format!("by {:+.4} turn at row {}", b.turns, b.row);
    let plural = |n: i64| if n == 1 { "sample" } else { "samples" };
    match b.samples {
        Some(n) if n < 0 => format!("{step}: {} {} came twice", -n, plural(-n)),
        Some(n) => format!("{step}: {n} {} lost", plural(n)),
        None => format!("{step}, as no whole number of samples does"),
    }
}

/// What is said of wrong codes.
fn wrong_codes(found: &StandOut, retimed: &Retimed) -> Warning {
    let count = found.rows.len();
    let (are, codes) = if count == 1 {
        ("stands", "a wrong code")
    } else {
        ("stand", "wrong codes")
    };
    Warning::general(
        "outliers",
        format!(
            "{count} of {} rows ({} held out) {are} out alone by more than ten deviations of the codes at the same phase, \
             and no figure has them in it: {codes}{}",
            retimed.capture.used_rows(),
            found.held,
            farthest(found, retimed)
        ),
    )
}

/// Refuses a capture in which there are more of them than accidents make.
fn too_many(found: &StandOut, retimed: &Retimed) -> InputError {
    let message = format!(
        "{} of {} rows stand out by more than ten deviations of the codes at the same phase{}",
        found.rows.len(),
        retimed.capture.used_rows(),
        farthest(found, retimed)
    );
    let column = found
        .farthest
        .and_then(|f| COLUMNS.get(f.1))
        .unwrap_or(&COLUMNS[0]);
    let error = InputError::new(message).help(
        "look for samples lost in quick succession, a loose line or a bit that flips, and capture again",
    );
    retimed.capture.places.put(column, error)
}

/// The row that is farthest off, of the file.
fn farthest(found: &StandOut, retimed: &Retimed) -> String {
    let told = found.farthest.map(|(row, channel, off)| {
        let name = COLUMNS.get(channel).copied().unwrap_or("");
        let row = retimed.row_in_file(row);
        format!("; the farthest, {name} at row {row}, is off by {off:+.0} codes")
    });
    told.unwrap_or_default()
}
