//! The clock of a thermal record: required, never backwards, repeated times averaged.

use super::cells;
use super::columns::Roles;
use super::lines::Lines;
use super::thermal::ThermalRecord;
use super::warning::Warning;
use crate::design::RecordMapping;
use crate::error::Result;

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
    let mut last: Option<(f64, usize)> = None;
    for (t, number) in time.iter().zip(&record.lines) {
        if t.is_nan() {
            continue;
        }
        if let Some((before, at)) = last
            && *t < before
        {
            let line = lines.at(*number);
            let column = cells::split(line.text)
                .ok()
                .and_then(|c| c.get(index).map(|c| c.column))
                .unwrap_or(1);
            return Err(line
                .error(
                    column,
                    format!("time decreases: {t} s after {before} s (line {at})"),
                    "put the rows in order of time; a clock that restarts at power-on is \
                     time_since_power_on_s, beside a time_s that does not"
                        .to_owned(),
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
