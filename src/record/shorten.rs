//! Rows of CSV, averaged: to the length that the design gives (`average_s` in `[record]`), or, for a search over many
//! shapes, to a few thousand. What moves a gyro's bias is slow; rows beyond those show its white noise again and again.

use super::thermal::ThermalRecord;
use super::warning::Warning;

/// Averages the rows of each stretch of `average_s`; `None`, or rows that are longer, changes
/// nothing. A stretch ends early where the applied rate changes (a mean over rates would be a
/// reading that nobody took) and where the clock since power-on restarts.
pub(super) fn rows(
    record: &mut ThermalRecord,
    average_s: Option<f64>,
    warnings: &mut Vec<Warning>,
) {
    let (Some(average_s), Some(start)) = (average_s, record.time_s.first().copied()) else {
        return;
    };
    let before = record.len();
    let ends = ends(record, start, average_s, true);
    if ends.len() == before {
        return;
    }
    average(record, &ends);
    warnings.push(Warning::general(
        "rows_averaged",
        format!(
            "{before} rows were averaged into {} of {average_s} s",
            ends.len()
        ),
    ));
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
    let number = |t: &f64| ((t - start) / average_s).floor();
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
            number(a) != number(b) || new_rate || restarted
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
