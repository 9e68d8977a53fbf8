//! Rows of CSV, averaged to the length that the design gives (`average_s` in `[record]`).

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
    let ends = ends(record, start, average_s);
    if ends.len() == before {
        return;
    }
    record.time_s = means(&record.time_s, &ends);
    for column in record.columns.values_mut() {
        *column = means(column, &ends);
    }
    let starts = std::iter::once(0).chain(ends.iter().copied());
    record.lines = starts
        .filter_map(|start| record.lines.get(start).copied())
        .collect();
    warnings.push(Warning::general(
        "rows_averaged",
        format!(
            "{before} rows were averaged into {} of {average_s} s",
            ends.len()
        ),
    ));
}

/// One past the last row of each stretch.
fn ends(record: &ThermalRecord, start: f64, average_s: f64) -> Vec<usize> {
    let applied = record.column("rate_dps");
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
