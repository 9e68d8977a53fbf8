//! A CSV capture whose columns have other names than the contract's: an oscilloscope's preamble, columns by name, volts.
//!
//! Nothing is guessed that decides a result: a column is the drive's or the sense's by its key or because its name says
//! so, volts become codes by a scale that is given. What the file does not say is asked for, with the keys to write.

use super::bench_cells::{Named, WORDS, cells, names, numbers, separator};
use super::bench_keys::{BenchKeys, Column, Scale};
use super::bench_rows::{damage, first_row, row_before};
use super::bench_scale::{between, in_unit, no_scale, sample_rate, shown};
use super::capture_meta::{CaptureMeta, sidecar_name};
use crate::error::{InputError, Result};
use std::path::Path;

/// Most columns that are listed in a message (convention).
const MOST_LISTED: usize = 20;

/// How the rows of such a file are read.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Table {
    /// Lines of the text that stand before the first row.
    pub before: usize,
    /// Most cells of a row.
    pub cells: usize,
    /// 0-based cells of drive and sense.
    pub used: [usize; 2],
    /// Between cells.
    pub separator: u8,
    /// Volts to codes; `None` = the cells are codes.
    pub scale: Option<Scale>,
    /// What was chosen, and from what.
    pub notes: Vec<String>,
}

/// Finds the table in `text`, the file's first lines from the one on that is no comment (`number`, from 1). Sets `fs_hz` of `meta` from a
/// column of times where it is missing.
///
/// # Errors
/// Columns or a scale that are not given, with the keys to write. `None`: no table of two columns or more.
pub(super) fn table(
    (path, number): (&Path, usize),
    text: &str,
    keys: &BenchKeys,
    meta: &mut CaptureMeta,
) -> Result<Option<Table>> {
    let lines: Vec<&str> = text.lines().collect();
    let separator = separator(&lines);
    let cut = |line: &str| cells(line, separator);
    let found = first_row(&lines, separator);
    let Some((before, width)) = found else {
        return Ok(None);
    };
    if let Some(error) = damage((path, number), &lines[..=before], separator, width) {
        return Err(error.into());
    }
    let named = names(&lines[..before], separator, width);
    let used = used((path, number), &named, width, keys)?;
    if let Some(error) = row_before((path, number), &lines[..before], separator, width, used) {
        return Err(error.into());
    }
    let rows: Vec<Vec<f64>> = lines[before..]
        .iter()
        .map_while(|l| numbers(&cut(l), separator))
        .collect();
    let mut notes = Vec::new();
    let says_volts = used.iter().any(|k| named.volts(*k).is_some());
    let whole = |row: &Vec<f64>| {
        used.iter()
            .all(|k| row.get(*k).is_none_or(|v| v.fract() == 0.0))
    };
    let scale = match keys.scale() {
        Some(scale) => Some(in_unit(path, scale, &named, used)?),
        None if says_volts || !rows.iter().all(whole) => {
            // In whole volts the first row is as good as any.
            let row = rows.iter().position(|r| !whole(r)).unwrap_or(0);
            let is_none = |k: &usize| {
                named.volts(*k).is_some() || rows[row].get(*k).is_some_and(|v| v.fract() != 0.0)
            };
            let cell = used.into_iter().find(is_none).unwrap_or(used[0]);
            let line = lines.get(before + row).map_or("", |l| l.trim_end());
            let left = line.split(char::from(separator)).take(cell);
            let column = left.map(|c| c.chars().count() + 1).sum::<usize>() + 1;
            let shown = named.shown(cell);
            let what = match rows[row].get(cell) {
                Some(value) if named.volts(cell).is_none() => {
                    format!("{value} in {shown} is no integer")
                }
                _ => format!("{shown} is a voltage"),
            };
            let mut error =
                no_scale((path, &what), &named, used, &rows).at(number + before + row, column);
            error.source_line = Some(line.to_owned());
            return Err(error.into());
        }
        None => None,
    };
    let name = |k: usize| named.shown(used[k]);
    notes.push(format!("the drive is {}, the sense {}", name(0), name(1)));
    if before > 1 {
        notes.push(format!("{before} lines stand before the first row"));
    }
    if let Some(scale) = scale {
        let [per, zero] = [scale.volts_per_code, scale.volts_at_code_0].map(shown);
        notes.push(format!(
            "a code is {per} of the column's unit, code 0 at {zero}; the nearest code is taken"
        ));
        notes.extend(between(scale, used, &rows));
    }
    if meta.fs_hz.is_none()
        && let Some((hz, from)) = sample_rate(&named, &rows)
    {
        meta.fs_hz = Some(hz);
        notes.push(format!("`fs_hz` is {hz}, from {from}"));
    }
    Ok(Some(Table {
        before,
        cells: width.max(named.names.len()),
        used,
        separator,
        scale,
        notes,
    }))
}

/// Which columns are the drive's and the sense's.
fn used(
    (path, number): (&Path, usize),
    named: &Named,
    width: usize,
    keys: &BenchKeys,
) -> Result<[usize; 2]> {
    let mut out = [0; 2];
    let parts = out
        .iter_mut()
        .zip(&keys.columns)
        .zip(BenchKeys::KEYS)
        .zip(WORDS);
    for (((place, asked), key), words) in parts {
        let is_meant = |name: &String| {
            let name = name.to_lowercase();
            words.iter().any(|w| name.contains(w))
        };
        let hits: Vec<usize> = named
            .names
            .iter()
            .enumerate()
            .filter(|(_, name)| match asked {
                Some(Column::Name(wanted)) => *name == wanted,
                Some(Column::Number(_)) => false,
                None => is_meant(name),
            })
            .map(|(k, _)| k)
            .collect();
        *place = match (asked, hits.as_slice()) {
            (Some(Column::Number(n)), _) if *n < width => *n,
            (_, [only]) if *only < width => *only,
            (Some(Column::Number(n)), _) => {
                return Err(which(
                    path,
                    named,
                    width,
                    format!("`{key}` is {n}, and the columns are 0 to {}", width - 1),
                )
                .into());
            }
            (Some(Column::Name(name)), []) => {
                return Err(which(
                    path,
                    named,
                    width,
                    format!("the capture has no column \"{name}\", which `{key}` names"),
                )
                .into());
            }
            (Some(Column::Name(name)), _) => {
                return Err(which(
                    path,
                    named,
                    width,
                    format!("several columns are \"{name}\", which `{key}` names"),
                )
                .into());
            }
            (None, _) => {
                let part = words[0];
                let column = super::capture::COLUMNS.iter().find(|c| c.starts_with(part));
                let message = format!(
                    "the header has no column `{}`, and no name in it says which is the {part}'s",
                    column.unwrap_or(&part)
                );
                return Err(which(path, named, width, message).at(number, 1).into());
            }
        };
    }
    if out[0] == out[1] {
        return Err(which(
            path,
            named,
            width,
            "drive and sense are the same column".to_owned(),
        )
        .into());
    }
    Ok(out)
}

/// An error that asks for the columns, with the keys to write.
fn which(path: &Path, named: &Named, width: usize, message: String) -> InputError {
    let listed: Vec<String> = (0..width.min(MOST_LISTED))
        .map(|k| named.shown(k))
        .collect();
    let not_time: Vec<usize> = (0..width).filter(|k| named.seconds(*k).is_none()).collect();
    let guess = |k: usize| {
        let column = not_time.get(k).copied().unwrap_or(k);
        let name = named.names.get(column).filter(|n| !n.is_empty());
        let alone = name.filter(|n| named.names.iter().filter(|m| m == n).count() == 1);
        alone.map_or(column.to_string(), |n| format!("{n:?}"))
    };
    let scale = match not_time.iter().any(|k| named.volts(*k).is_some()) {
        true => "\n    volts_per_code = 0.0001",
        false => "",
    };
    InputError::new(message).in_file(path).help(format!(
        "the file has: {}\n  write the columns that they are into {} beside it (or `# key = value` lines before the header):\n    \
         drive_column = {}\n    sense_column = {}{scale}",
        listed.join("; "),
        sidecar_name(path),
        guess(0),
        guess(1),
    ))
}
