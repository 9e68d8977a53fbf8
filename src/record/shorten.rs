//! Rows of CSV, averaged: to the length that the design gives (`average_s` in `[record]`), or, for a search over many
//! shapes, to a few thousand. What moves a gyro's bias is slow; rows beyond those show its white noise again and again.

use super::thermal::{ENOUGH_ROWS, LEAST_ROWS, ThermalRecord};
use super::warning::Warning;
use crate::design::RecordMapping;
use crate::error::{InputError, Result};
use crate::text::number;
use std::path::Path;

/// Averages the rows of each stretch of `average_s`; `None`, or rows that are longer, changes
/// nothing. A stretch ends early where the applied rate changes (a mean over rates would be a
/// reading that nobody took) and where the clock since power-on restarts.
///
/// # Errors
/// A record that is long enough, and of which too few rows are left.
pub(super) fn rows(
    record: &mut ThermalRecord,
    mapping: &RecordMapping,
    warnings: &mut Vec<Warning>,
) -> Result<()> {
    let (Some(average_s), Some(start)) = (mapping.average_s, record.time_s.first().copied()) else {
        return Ok(());
    };
    let before = record.len();
    let rows = ends(record, start, average_s, true);
    if rows.len() == before {
        return Ok(());
    }
    let rate = |ends: &[usize]| {
        let means = means(record.column("rate_out_dps").unwrap_or(&[]), ends);
        means.iter().filter(|mean| !mean.is_nan()).count()
    };
    let (left, all) = (rate(&rows), record.measured("rate_out_dps"));
    if left < LEAST_ROWS && all >= LEAST_ROWS {
        let span = record.time_s.last().map_or(0.0, |end| end - start);
        let of = |average_s: f64| rate(&ends(record, start, average_s, true));
        return Err(too_long(mapping, &record.source, (average_s, left), span, of).into());
    }
    average(record, &rows);
    warnings.push(Warning::general(
        "rows_averaged",
        format!(
            "{before} rows were averaged into {} of {average_s} s",
            rows.len()
        ),
    ));
    Ok(())
}

/// The error for an `average_s` that leaves too few rows of a record of `span_s`, in the design where its place is known; `of`
/// tells how many rows another one leaves.
pub(super) fn too_long(
    mapping: &RecordMapping,
    record: &Path,
    (average_s, left): (f64, usize),
    span_s: f64,
    of: impl Fn(f64) -> usize,
) -> InputError {
    let error = InputError::new(format!(
        "average_s = {average_s} s leaves {left} {} of the record {}, which is {} s long; {LEAST_ROWS} rows are the least",
        if left == 1 { "row" } else { "rows" },
        record.display(),
        number(span_s, 4)
    ));
    let error = match &mapping.average_at {
        Some(place) => error.at_position(place),
        None => error.in_file(record),
    };
    // Gaps and changes of the rate make other numbers of rows than the length alone.
    let longest = two_digits(span_s / ENOUGH_ROWS as f64);
    let halves = std::iter::successors(Some(longest), |s| Some(two_digits(s / 2.0)));
    let fit = halves
        .take(HALVINGS)
        .map(|s| (s, of(s)))
        .find(|(s, rows)| *s >= LEAST_AVERAGE_S && *rows >= LEAST_ROWS);
    error.help(match fit {
        Some((s, rows)) => format!(
            "average_s = {s} leaves {rows} rows; without average_s a CSV keeps its rows, and a log has rows of 1 s"
        ),
        None => "delete average_s, or record longer".to_owned(),
    })
}

/// How often a proposed length is halved until enough rows are left. Convention: a thousandth of the first.
const HALVINGS: usize = 10;
/// The least `average_s` that a design may state, s. Convention, as the reader of designs has it.
const LEAST_AVERAGE_S: f64 = 1e-3;

/// A positive number, rounded down to two digits.
fn two_digits(value: f64) -> f64 {
    if value <= 0.0 {
        return 0.0;
    }
    let exponent = value.log10().floor() as i32 - 1;
    // Through decimal text: 0.3 is not 0.30000000000000004 then.
    let digits = (value / 10f64.powi(exponent) * (1.0 + 1e-12)).floor();
    format!("{digits}e{exponent}").parse().unwrap_or(value)
}

/// Rows from which on a record is long, and what it becomes, about.
const LONG: usize = 8000;
const ROWS: usize = 4000;

/// A long record with means in place of rows, and what to tell; `None` for one that is not long. Where
/// the applied rate never stands still, means are taken over short parts of its course.
pub fn condensed(record: &ThermalRecord) -> Option<(ThermalRecord, Warning)> {
    let (start, end) = record.time_s.first().zip(record.time_s.last())?;
    if record.len() < LONG || end <= start {
        return None;
    }
    let average_s = (end - start) / ROWS as f64;
    let mut stretches = ends(record, *start, average_s, true);
    if stretches.len() > 2 * ROWS {
        stretches = ends(record, *start, average_s, false);
    }
    let mut out = record.clone();
    average(&mut out, &stretches);
    let message = format!(
        "{} rows were averaged into {} of {average_s:.4} s: all errors are those of the means; `average_s` in [record] \
         chooses another length",
        record.len(),
        out.len()
    );
    Some((out, Warning::general("rows_averaged", message)))
}

/// Means over stretches in place of rows.
fn average(record: &mut ThermalRecord, ends: &[usize]) {
    record.time_s = means(&record.time_s, ends);
    for column in record.columns.values_mut() {
        *column = means(column, ends);
    }
    let starts = std::iter::once(0).chain(ends.iter().copied());
    record.lines = starts
        .filter_map(|start| record.lines.get(start).copied())
        .collect();
}

/// One past the last row of each stretch; `by_rate`: a stretch is of one applied rate.
fn ends(record: &ThermalRecord, start: f64, average_s: f64, by_rate: bool) -> Vec<usize> {
    let applied = record.column("rate_dps").filter(|_| by_rate);
    let power_on = record.column("time_since_power_on_s");
    let at = |column: Option<&[f64]>, row: usize| column.and_then(|c| c.get(row).copied());
    let stretch = |t: &f64| ((t - start) / average_s).floor();
    let mut ends: Vec<usize> = record
        .time_s
        .windows(2)
        .zip(1..)
        .filter(|(times, row)| {
            let new_rate = match (at(applied, row - 1), at(applied, *row)) {
                (Some(a), Some(b)) => a != b && !(a.is_nan() && b.is_nan()),
                _ => false,
            };
            let restarted = at(power_on, row - 1) > at(power_on, *row);
            let [a, b] = times else { return false };
            stretch(a) != stretch(b) || new_rate || restarted
        })
        .map(|(_, row)| row)
        .collect();
    ends.push(record.len());
    ends
}

/// The mean of what was measured in each stretch.
fn means(values: &[f64], ends: &[usize]) -> Vec<f64> {
    let mut start = 0;
    ends.iter()
        .map(|end| {
            let stretch = values.get(start..*end).unwrap_or(&[]);
            start = *end;
            let measured = stretch.iter().filter(|v| !v.is_nan());
            measured.clone().sum::<f64>() / measured.count() as f64
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::super::thermal::parse;
    use crate::design::RecordMapping;
    use std::path::Path;

    #[test]
    fn a_long_record_becomes_a_few_thousand_means() {
        let made = |rows: usize, rate: &dyn Fn(usize) -> f64| {
            let mut text = String::from("time_s,rate_out_dps,rate_dps\n");
            for k in 0..rows {
                text.push_str(&format!(
                    "{k},{},{}\n",
                    rate(k) + 1.0 + 0.1 * (-1f64).powi(k as i32),
                    rate(k)
                ));
            }
            parse(
                text.as_bytes(),
                Path::new("r.csv"),
                &RecordMapping::default(),
            )
            .unwrap()
            .0
        };
        let stands = |k: usize| if k < 5003 { 10.0 } else { -20.0 };
        assert!(super::condensed(&made(super::LONG - 1, &stands)).is_none());
        let (short, warning) = super::condensed(&made(40_000, &stands)).unwrap();
        assert_eq!(warning.code, "rows_averaged");
        assert!((4000..4010).contains(&short.len()), "{}", short.len());
        for (out, rate) in short.columns["rate_out_dps"]
            .iter()
            .zip(&short.columns["rate_dps"])
        {
            assert!(
                [10.0, -20.0].contains(rate) && (out - rate - 1.0).abs() < 0.04,
                "{out} {rate}"
            );
        }
        // A rate that never stands still.
        let (short, _) = super::condensed(&made(40_000, &|k| (k as f64 / 3000.0).sin())).unwrap();
        assert!((4000..4010).contains(&short.len()), "{}", short.len());
    }

    #[test]
    fn a_length_that_leaves_too_few_rows_is_told_in_the_design_with_one_that_does() {
        let mut text = String::from("time_s,rate_out_dps\n");
        for k in 0..200 {
            text.push_str(&format!("{},0.{}\n", 10 * k, k % 7));
        }
        let read = |average_s: &str| {
            let design = format!("[record]\naverage_s = {average_s}\n");
            let design = crate::design::reader::parse(&design, Some(Path::new("d.toml"))).unwrap();
            parse(text.as_bytes(), Path::new("r.csv"), &design.record)
        };
        let error = read("1000").unwrap_err().to_string();
        assert!(
            error.starts_with(
                "d.toml:2:13: error: average_s = 1000 s leaves 2 rows of the record r.csv, which is 1990 s long"
            ),
            "{error}"
        );
        assert!(error.contains("average_s = 99 leaves 21 rows"), "{error}");
        // What the message says helps.
        assert_eq!(read("99").unwrap().0.len(), 21);
    }

    #[test]
    fn rows_become_means_and_rates_stay_apart() {
        let mut text = String::from("time_s,rate_out_dps,rate_dps,time_since_power_on_s\n");
        for k in 0..120 {
            // The rate changes at 45 s, power is cycled at 90 s; one output is missing.
            let rate = if k < 45 { 0 } else { 50 };
            let out = if k == 7 {
                String::new()
            } else {
                format!("{}", rate + k % 10)
            };
            let on = if k < 90 { k } else { k - 90 };
            text.push_str(&format!("{k},{out},{rate},{on}\n"));
        }
        let mapping = RecordMapping {
            average_s: Some(10.0),
            ..RecordMapping::default()
        };
        let (r, warnings) = parse(text.as_bytes(), Path::new("r.csv"), &mapping).unwrap();
        assert_eq!(warnings[0].code, "rows_averaged");
        assert_eq!(r.len(), 13);
        assert_eq!(r.lines[..6], [2, 12, 22, 32, 42, 47]);
        assert_eq!(r.time_s[..6], [4.5, 14.5, 24.5, 34.5, 42.0, 47.0]);
        let out = &r.columns["rate_out_dps"];
        assert!((out[0] - 38.0 / 9.0).abs() < 1e-12 && out[1] == 4.5);
        assert_eq!((out[4], out[5]), (2.0, 57.0));
        assert_eq!(r.columns["rate_dps"][4..6], [0.0, 50.0]);
        assert_eq!(r.columns["time_since_power_on_s"][9..11], [84.5, 4.5]);
    }
}
