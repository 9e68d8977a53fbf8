//! A trace as one NPY array, rows x signals in the order of the trace (NPY has no names), at the
//! rate of the fastest signal: row i is sample `first_sample + (i + 1) * every - 1`, `every` the
//! smallest of all. A slower signal's value is held until its next one, NaN before its first.
//!
//! The items are int64 if all signals are integers of one rate and length, so that no bit is lost,
//! else float64; an integer that float64 does not hold exactly is then refused.

use super::{Signal, Trace, Values};
use crate::error::{InputError, Result};
use crate::record::rows::{Kind, RowWriter};
use std::path::Path;

pub(super) fn write(trace: &Trace, path: &Path) -> Result<()> {
    let names: Vec<&str> = trace.signals.iter().map(|s| s.name.as_str()).collect();
    match integers(trace) {
        Some(columns) => {
            let mut writer = RowWriter::create(path, &names, Kind::Integer)?;
            let rows = columns.first().map_or(0, |c| c.len());
            for i in 0..rows {
                let row: Vec<i128> = columns
                    .iter()
                    .filter_map(|c| c.get(i).map(|v| i128::from(*v)))
                    .collect();
                writer.write_integers(&row)?;
            }
            writer.finish()
        }
        None => {
            let held = trace.signals.iter().find_map(not_held_exactly);
            if let Some((name, value)) = held {
                return Err(InputError::new(format!(
                    "trace `{name}`: float64 does not hold {value} exactly"
                ))
                .in_file(path)
                .help("write `.csv` or `.vcd`, or this signal without reals and other rates")
                .into());
            }
            let mut writer = RowWriter::create(path, &names, Kind::Float)?;
            let every = trace.signals.iter().map(|s| s.every).min().unwrap_or(1);
            let span = |s: &Signal| s.values.len() as u64 * u64::from(s.every);
            let samples = trace.signals.iter().map(span).max().unwrap_or(0);
            for i in 0..samples / u64::from(every) {
                // Samples from the trace's start up to this one, and it.
                let passed = (i + 1) * u64::from(every);
                let row: Vec<f64> = trace.signals.iter().map(|s| held_at(s, passed)).collect();
                writer.write_floats(&row)?;
            }
            writer.finish()
        }
    }
}

/// All columns, if they are integers of one rate and length.
fn integers(trace: &Trace) -> Option<Vec<&[i64]>> {
    let first = trace.signals.first()?;
    let same = |s: &Signal| s.every == first.every && s.values.len() == first.values.len();
    trace
        .signals
        .iter()
        .map(|s| match &s.values {
            Values::Integer { values, .. } if same(s) => Some(values.as_slice()),
            _ => None,
        })
        .collect()
}

/// The first integer that changes on its way through an f64.
fn not_held_exactly(signal: &Signal) -> Option<(&str, i64)> {
    let Values::Integer { values, .. } = &signal.values else {
        return None;
    };
    let changes = |v: &&i64| (**v as f64) as i128 != i128::from(**v);
    let value = values.iter().find(changes)?;
    Some((&signal.name, *value))
}

/// The latest value after `passed` samples of the trace; the last one stays.
fn held_at(signal: &Signal, passed: u64) -> f64 {
    let count = (passed / u64::from(signal.every)).min(signal.values.len() as u64);
    let Some(k) = (count as usize).checked_sub(1) else {
        return f64::NAN;
    };
    match &signal.values {
        Values::Integer { values, .. } => values.get(k).map_or(f64::NAN, |v| *v as f64),
        Values::Real(values) => values.get(k).copied().unwrap_or(f64::NAN),
    }
}
