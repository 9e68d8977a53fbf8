//! Columns and stretches without a signal, and rows that are all there several times: what a capture tool writes when
//! a line is not connected, a buffer is not filled or the ADC is read too often.

use super::blocks;
use super::input::Capture;
use super::tone::Tone;
use crate::error::{InputError, Result};
use crate::record::Warning;
use crate::record::capture::COLUMNS;
use std::ops::Range;

/// Rows of one code that are no accident, at least.
const LEAST_RUN: usize = 32;
/// Half the range of codes from which on a period of the tone cannot have one code.
const LEAST_AMPLITUDE: f64 = 4.0;
/// Share of a column in such stretches from which on it is idle as a whole.
const IDLE: f64 = 0.75;
/// Changes of code from which on it shows that all rows are repeated: chance has none in 2^32 captures.
const LEAST_CHANGES: usize = 32;

/// Leaves out stretches at one code, longer than a period of the tone; what is said of them.
///
/// # Errors
/// A drive column, or a sense column of which a signal is declared, without any.
pub fn without_idle(capture: &mut Capture, tone: &Tone) -> Result<Vec<Warning>> {
    let period = (1.0 / tone.folded().max(1e-9)).ceil() as usize;
    let mut warnings = Vec::new();
    for channel in 0..2 {
        let runs = idle_runs(capture, channel, LEAST_RUN.max(period + 1));
        let idle: usize = runs.iter().map(Range::len).sum();
        if idle as f64 > IDLE * capture.rows() as f64 {
            warnings.push(whole_column(capture, channel)?);
            continue;
        }
        if idle == 0 || amplitude(capture, channel) < LEAST_AMPLITUDE {
            continue;
        }
        warnings.push(stretches(capture, channel, &runs, idle));
        let rows = capture.rows();
        capture.left_out.resize(rows, false);
        for run in runs {
            if let Some(out) = capture.left_out.get_mut(run) {
                out.fill(true);
            }
        }
    }
    Ok(warnings)
}

/// Half the range of a column's codes.
fn amplitude(capture: &Capture, channel: usize) -> f64 {
    let (low, high) = (
        capture.used_codes(channel).min(),
        capture.used_codes(channel).max(),
    );
    0.5 * (f64::from(high.unwrap_or(0)) - f64::from(low.unwrap_or(0)))
}

/// Stretches of one code, of `least` rows or more.
fn idle_runs(capture: &Capture, channel: usize, least: usize) -> Vec<Range<usize>> {
    let mut out = Vec::new();
    let mut start = 0;
    for run in capture.codes[channel].chunk_by(|a, b| a == b) {
        if run.len() >= least {
            out.push(start..start + run.len());
        }
        start += run.len();
    }
    out
}

/// Refuses an idle column, or says that nothing is in it.
fn whole_column(capture: &Capture, channel: usize) -> Result<Warning> {
    let name = COLUMNS[channel];
    let code = capture.codes[channel].first().copied().unwrap_or(0);
    let message = format!(
        "{name} has no signal: it stands at one code (the first is {code}) in nearly all rows"
    );
    let meta = &capture.meta;
    let declared = meta.rate_dps.zip(meta.sense_codes_per_dps);
    let expected = declared.map_or(0.0, |(rate, scale)| (rate * scale).abs());
    if channel == 1 && expected < 1.0 {
        let message =
            format!("{message}: is it connected? No amplitude is declared, so it may be so");
        return Ok(Warning::on("no_signal", name, message));
    }
    let error = InputError::new(message).help(match channel {
        0 => "connect the drive, and capture again: all phases are measured against its tone",
        _ => "connect the sense channel, or give the rate that was applied in `rate_dps`",
    });
    Err(capture.places.put(name, error).into())
}

/// What is said of stretches that are left out.
fn stretches(capture: &Capture, channel: usize, runs: &[Range<usize>], idle: usize) -> Warning {
    let name = COLUMNS[channel];
    let longest = runs.iter().max_by_key(|r| r.len()).cloned().unwrap_or(0..0);
    let code = capture.codes[channel]
        .get(longest.start)
        .copied()
        .unwrap_or(0);
    let message = format!(
        "{idle} of {} rows are in stretches ({}) of one code that are longer than a period of the tone, and are left \
         out; the longest, from row {} to {}, stands at {code}",
        capture.rows(),
        runs.len(),
        longest.start,
        longest.end - 1
    );
    Warning::on("frozen", name, message)
}

/// The capture with every row once, if all are there several times in a row; what is said of it.
pub fn without_copies(capture: Capture, tone: &Tone) -> (Capture, Option<Warning>) {
    let times = copies(&capture);
    if times < 2 {
        return (capture, None);
    }
    let first = |row: &usize| row.is_multiple_of(times);
    let once = |codes: &Vec<i32>| codes.iter().step_by(times).copied().collect::<Vec<i32>>();
    let [drive, sense] = &capture.codes;
    let closer = capture.with_rows([once(drive), once(sense)], Vec::new());
    let apart = (0..capture.rows()).map(|row| !first(&row)).collect();
    let apart = capture.with_rows(capture.codes.clone(), apart);
    let rest = |c: &Capture| {
        let blocks = blocks::blocks(c, tone);
        if blocks.is_empty() {
            f64::INFINITY
        } else {
            blocks::noise(&blocks, 0)
        }
    };
    // Copies were added, or the ADC held each sample: the tone is at its frequency in one of both only.
    let (out, what) = match rest(&closer) <= rest(&apart) {
        true => (closer, "the copies are taken away"),
        false => (
            apart,
            "the tone is at its frequency with the copies in their time, which are left out",
        ),
    };
    let message = format!("every row is there {times} times in succession; {what}");
    (out, Some(Warning::general("rows_repeated", message)))
}

/// How many times every row is there: the common divisor of all rows at which a code changes.
fn copies(capture: &Capture) -> usize {
    let [drive, sense] = &capture.codes;
    let pairs = || drive.iter().zip(sense);
    let changes = pairs().zip(pairs().skip(1)).enumerate();
    let (mut divisor, mut count) = (0, 0);
    for (row, _) in changes.filter(|(_, (a, b))| a != b) {
        divisor = common(row + 1, divisor);
        count += 1;
        if divisor == 1 {
            return 1;
        }
    }
    if count < LEAST_CHANGES { 1 } else { divisor }
}

fn common(a: usize, b: usize) -> usize {
    if b == 0 { a } else { common(b, a % b) }
}
