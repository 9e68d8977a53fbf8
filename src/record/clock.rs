//! The clock of a thermal record: required, never backwards, repeated times averaged.

use super::cells;
use super::columns::{Line, Roles};
use super::lines::Lines;
use super::thermal::ThermalRecord;
use super::warning::Warning;
use crate::design::RecordMapping;
use crate::error::{InputError, Result};
use crate::statistics::stats;

/// A stated period and that of the times contradict each other beyond this part of it (convention).
const PERIODS_DIFFER: f64 = 0.01;

/// Takes the clock out of the columns, or makes it, and checks that it never runs backwards.
pub(super) fn take(
    record: &mut ThermalRecord,
    lines: &Lines<'_>,
    roles: &Roles,
    mapping: &RecordMapping,
    warnings: &mut Vec<Warning>,
) -> Result<()> {
    let Some(index) = roles.index_of("time_s") else {
        let period = mapping.row_period_s.unwrap_or(1.0);
        record.time_s = (0..record.lines.len()).map(|i| i as f64 * period).collect();
        return Ok(());
    };
    let Some(time) = record.columns.remove("time_s") else {
        return Err(lines
            .at(record.lines.first().copied().unwrap_or(1))
            .error(
                1,
                "column time_s holds no measured value".to_owned(),
                "a clock is required; without one give row_period_s in [record]".to_owned(),
            )
            .into());
    };
    let last_line = record.lines.last().copied().unwrap_or(1);
    if let Some((row, said)) = wild(&time, &record.lines) {
        let line = lines.at(record.lines.get(row).copied().unwrap_or(1));
        return Err(line
            .error(
                column_of(line, index),
                said,
                "repair this time, or leave the cell empty: its row is left out then".to_owned(),
            )
            .into());
    }
    let mut last: Option<(f64, usize)> = None;
    for (row, (t, number)) in time.iter().zip(&record.lines).enumerate() {
        if t.is_nan() {
            continue;
        }
        if let Some((before, at)) = last
            && *t < before
        {
            let line = lines.at(*number);
            let mut next = time.iter().skip(row + 1).filter(|t| !t.is_nan());
            // The rows after it go on from where the time was.
            let help = match next.next().is_some_and(|next| *next >= before) {
                true => {
                    "only this time is out of order: repair it, or leave the cell empty: its row is left out then"
                }
                false => {
                    "put the rows in order of time; a clock that restarts at power-on is time_since_power_on_s, beside a \
                     time_s that does not"
                }
            };
            return Err(line
                .error(
                    column_of(line, index),
                    format!("time decreases: {t} s after {before} s (line {at})"),
                    help.to_owned(),
                )
                .into());
        }
        last = Some((*t, *number));
    }
    let keep: Vec<bool> = time.iter().map(|t| !t.is_nan()).collect();
    let dropped = keep.iter().filter(|k| !**k).count();
    record.time_s = time;
    if dropped > 0 {
        let first = record
            .lines
            .iter()
            .zip(&keep)
            .find(|(_, k)| !**k)
            .map_or(0, |(number, _)| *number);
        warnings.push(Warning::on(
            "rows_without_time",
            "time_s",
            format!("{dropped} rows without a time are left out (the first is line {first})"),
        ));
        retain(record, &keep);
    }
    if let Some(period) = mapping.row_period_s {
        let steps = record.time_s.windows(2).map(|w| w[1] - w[0]);
        let usual = stats::median(&steps.filter(|s| *s > 0.0).collect::<Vec<f64>>());
        let path = lines.at(last_line).path;
        if (period / usual - 1.0).abs() > PERIODS_DIFFER {
            let message = format!(
                "row_period_s is {period} s, and the times of the record {} are {usual} s apart (median)",
                path.display()
            );
            let error = InputError::new(message);
            let error = match &mapping.row_period_at {
                Some(place) => error.at_position(place),
                None => error.in_file(path),
            };
            return Err(error
                .help("delete row_period_s, which is for records without times; if it is right, take the column of times out of the record, or correct its unit in [record.columns]")
                .into());
        }
        warnings.push(Warning::on(
            "record_keys_unused",
            "time_s",
            format!("row_period_s is not used: the record has times, {usual} s apart (median)"),
        ));
    }
    let advances = record.time_s.first() < record.time_s.last();
    if !advances && record.len() > 1 {
        return Err(lines
            .at(last_line)
            .error(
                1,
                format!(
                    "time_s never advances: it is {} s in every row",
                    last.map_or(0.0, |l| l.0)
                ),
                "map the column that holds the clock to time_s, or give row_period_s in [record] \
                 and map nothing to time_s"
                    .to_owned(),
            )
            .into());
    }
    Ok(())
}

/// Where the cell of this index begins in its line.
fn column_of(line: Line<'_>, index: usize) -> usize {
    let cells = cells::split(line.text).ok();
    cells
        .and_then(|c| c.get(index).map(|c| c.column))
        .unwrap_or(1)
}

/// Times in a row that can be wild, at most (convention); more are a clock that does something else.
const MOST_WILD: usize = 3;

/// A step that is no pause between two rows, in steps of usual length; at the end of a record, where no later row tells, in
/// times of all that was before (both convention: pauses of loggers are shorter).
const LEAP_STEPS: f64 = 10.0;
const LEAP_AT_END_SPANS: f64 = 1000.0;

/// The first row whose time is wild, and what is said of it: the clock leaps there, and the rows after it go on from before the
/// leap. A clock that goes back by itself is none, nor are rows in disorder.
fn wild(time: &[f64], lines: &[usize]) -> Option<(usize, String)> {
    let rows: Vec<usize> = (0..time.len()).filter(|i| !time[*i].is_nan()).collect();
    let at = |k: usize| rows.get(k).map_or(f64::NAN, |i| time[*i]);
    let steps: Vec<f64> = (1..rows.len()).map(|k| at(k) - at(k - 1)).collect();
    let ahead: Vec<f64> = steps.iter().copied().filter(|s| *s > 0.0).collect();
    let usual = stats::median(&ahead);
    let place = |k: usize| -> Option<(usize, usize)> {
        let row = *rows.get(k)?;
        Some((row, lines.get(row).copied().unwrap_or(0)))
    };
    let back = steps.iter().position(|s| *s < 0.0).map(|k| k + 1);
    if let Some(k) = back {
        let start = (0..k).rev().find(|j| at(*j) <= at(k)).map_or(0, |j| j + 1);
        // Of a few rows nothing is usual.
        let goes_on = (k + 1..rows.len())
            .take(MOST_WILD)
            .all(|j| at(j) >= at(j - 1) && at(j) < at(start));
        let leaps = match start {
            0 => at(0) - at(k) > LEAP_STEPS * usual,
            _ => at(start) - at(start - 1) > LEAP_STEPS * usual,
        };
        let few = k - start <= MOST_WILD && 10 * (k - start) <= rows.len();
        if !(goes_on && leaps && few) {
            return None;
        }
        let (row, _) = place(start)?;
        let after = place(k)?.1;
        let before = match start.checked_sub(1).and_then(place) {
            Some((row, line)) => format!("{} s before it (line {line}) and ", time[row]),
            None => String::new(),
        };
        return Some((
            row,
            format!(
                "the time {} s is a wild one: the clock is at {before}{} s after it (line {after})",
                at(start),
                at(k)
            ),
        ));
    }
    let last = rows.len().checked_sub(1)?;
    let before = last.checked_sub(1)?;
    let leap = at(last) - at(before);
    let span = at(before) - at(0);
    let is_wild = rows.len() > 10 && span > 0.0 && leap > LEAP_AT_END_SPANS * span;
    let (row, _) = place(last).filter(|_| is_wild)?;
    Some((
        row,
        format!(
            "the time {} s of the last row is a wild one: the row before it (line {}) is at {} s, and all rows before take {span} s",
            at(last),
            place(before)?.1,
            at(before)
        ),
    ))
}

/// Keeps the rows that are marked.
fn retain(record: &mut ThermalRecord, keep: &[bool]) {
    fn pick<T: Copy>(v: &mut Vec<T>, keep: &[bool]) {
        let mut marks = keep.iter();
        v.retain(|_| marks.next().copied().unwrap_or(true));
    }
    pick(&mut record.time_s, keep);
    pick(&mut record.lines, keep);
    for column in record.columns.values_mut() {
        pick(column, keep);
    }
}

/// Rows with one time are averaged, except where their applied rates differ (a mean over rates
/// would be a reading that nobody took): those are kept. A warning says which.
pub(super) fn merge_repeated(record: &mut ThermalRecord, warnings: &mut Vec<Warning>) {
    let mut keep = vec![true; record.len()];
    let (mut averaged, mut kept, mut first) = (0, 0, None);
    let mut start = 0;
    while start < record.len() {
        let time = record.time_s[start];
        let same = record.time_s[start..].iter().take_while(|t| **t == time);
        let end = start + same.count().max(1);
        if end - start > 1 {
            first = first.or(record.lines.get(start).copied());
            let mut rates = record.columns.get("rate_dps").map_or(Vec::new(), |c| {
                c[start..end]
                    .iter()
                    .copied()
                    .filter(|r| !r.is_nan())
                    .collect()
            });
            rates.dedup();
            if rates.len() > 1 {
                kept += end - start;
            } else {
                averaged += end - start;
                for column in record.columns.values_mut() {
                    let group = column[start..end].iter().filter(|v| !v.is_nan());
                    let n = group.clone().count();
                    if n > 0 {
                        column[start] = group.sum::<f64>() / n as f64;
                    }
                }
                keep[start + 1..end].fill(false);
            }
        }
        start = end;
    }
    if let Some(line) = first {
        retain(record, &keep);
        let mut parts = Vec::new();
        if averaged > 0 {
            parts.push(format!("{averaged} rows with repeated times were averaged"));
        }
        if kept > 0 {
            parts.push(format!(
                "{kept} rows with repeated times were kept, because their applied rates differ"
            ));
        }
        warnings.push(Warning::on(
            "repeated_times",
            "time_s",
            format!("{} (the first is line {line})", parts.join("; ")),
        ));
    }
}
