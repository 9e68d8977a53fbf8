//! A CSV capture whose columns have other names than the contract's: an oscilloscope's preamble, columns by name, volts.
//!
//! Nothing is guessed that decides a result: a column is the drive's or the sense's by its key or because its name says
//! so, volts become codes by a scale that is given. What the file does not say is asked for, with the keys to write.

use super::bench_keys::{BenchKeys, Column, Scale};
use super::bench_scale::{between, in_unit, no_scale, sample_rate, shown};
use super::capture_meta::CaptureMeta;
use crate::error::{InputError, Result};
use std::path::Path;

/// Rows of numbers in a row that make the first of them the first row (convention: a preamble has single ones).
pub(super) const ROWS_OF_A_TABLE: usize = 3;
/// What the names of the drive's and of the sense's column contain.
const WORDS: [[&str; 2]; 2] = [["drive", "drv"], ["sense", "sns"]];
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
    if let Some((k, mark)) = overloaded_row(&lines[..before], separator, width) {
        let mut error = InputError::new(format!(
            "this row holds \"{mark}\", which is no code: the instrument was overloaded there, or had no reading"
        ))
        .in_file(path)
        .at(number + k, 1)
        .help(
            "take the rows with such marks away at the capture's beginning; where they stand further on, capture again with a larger \
             range. The names of the columns stand on the line before the first row",
        );
        error.source_line = lines.get(k).map(|l| l.trim_end().to_owned());
        return Err(error.into());
    }
    if let Some((k, count)) = ragged_row(&lines[..before], separator, width) {
        return Err(wrong_count((path, number + k), lines[k], count, width).into());
    }
    if let Some(k) = damaged_row(&lines[..before], lines[before], separator) {
        let mut error = InputError::new(
            "this line stands among the rows, right before the first whole one, and is none: some of its cells hold numbers, and \
             others do not",
        )
        .in_file(path)
        .at(number + k, 1)
        .help("repair the row or take it away; if it is the header, let no name in it be a number");
        error.source_line = lines.get(k).map(|l| l.trim_end().to_owned());
        return Err(error.into());
    }
    let named = names(&lines[..before], separator, width);
    let used = used((path, number), &named, width, keys)?;
    if let Some(k) = row_before(&lines[..before], separator, width, used) {
        let mut error =
            InputError::new("this line is like a row, and what follows it is no table yet")
                .in_file(path)
                .at(number + k, 1)
                .help("repair this line or the next ones, or take them away");
        error.source_line = lines.get(k).map(|l| (*l).to_owned());
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
            let is_none = |k: &usize| rows[row].get(*k).is_some_and(|v| v.fract() != 0.0);
            let cell = used.into_iter().find(is_none).unwrap_or(used[0]);
            let line = lines.get(before + row).map_or("", |l| l.trim_end());
            let left = line.split(char::from(separator)).take(cell);
            let column = left.map(|c| c.chars().count() + 1).sum::<usize>() + 1;
            let mut error = no_scale(path, &named, used, &rows).at(number + before + row, column);
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

/// Names and units of the columns.
pub(super) struct Named {
    pub(super) names: Vec<String>,
    units: Vec<String>,
}

impl Named {
    pub(super) fn shown(&self, column: usize) -> String {
        match self.names.get(column).filter(|n| !n.is_empty()) {
            Some(name) => format!("column {column}, \"{name}\""),
            None => format!("column {column}"),
        }
    }

    /// The unit of a column, from the line of units or from its name: `CH1 (mV)`, `drive_mv`.
    pub(super) fn unit(&self, column: usize) -> Option<String> {
        let own = self.units.get(column).map(|u| bare(u));
        let name = self.names.get(column).map_or("", String::as_str);
        let inside = name
            .trim_end_matches([')', ']'])
            .rsplit_once(['(', '['])
            .map(|n| bare(n.1));
        let behind = name.rsplit_once('_').map(|n| bare(n.1));
        own.filter(|u| !u.is_empty()).or(inside).or(behind)
    }

    /// Volts that a column's unit is; `None` where it says no voltage.
    pub(super) fn volts(&self, column: usize) -> Option<f64> {
        Some(match self.unit(column)?.as_str() {
            "v" | "volt" | "volts" => 1.0,
            "mv" | "millivolt" | "millivolts" => 1e-3,
            "uv" | "µv" | "μv" => 1e-6,
            _ => return None,
        })
    }

    /// Seconds that a column of times counts in; `None` where it is no such column.
    pub(super) fn seconds(&self, column: usize) -> Option<f64> {
        let name = self.names.get(column)?.to_lowercase();
        let first = name
            .split(|c: char| !c.is_alphabetic())
            .next()
            .unwrap_or("");
        if !["time", "t", "second", "seconds", "x"].contains(&first) {
            return None;
        }
        Some(match self.unit(column).as_deref() {
            Some("ms") => 1e-3,
            Some("us" | "µs" | "μs") => 1e-6,
            Some("ns") => 1e-9,
            Some("s" | "sec" | "second" | "seconds") => 1.0,
            _ if ["time", "t", "second", "seconds"].contains(&name.as_str()) => 1.0,
            _ => return None,
        })
    }
}

/// A unit without brackets, in small letters.
fn bare(unit: &str) -> String {
    unit.trim()
        .trim_matches(['(', ')', '[', ']'])
        .trim()
        .to_lowercase()
}

/// Whether a line says units and no names.
fn is_units(cells: &[String]) -> bool {
    const WORDS: [&str; 20] = [
        "", "s", "ms", "us", "µs", "ns", "sec", "second", "seconds", "sequence", "v", "mv", "uv",
        "volt", "volts", "value", "ampl", "a", "code", "codes",
    ];
    cells.iter().all(|c| WORDS.contains(&bare(c).as_str()))
}

/// The separator that cuts the middle line into most cells.
fn separator(lines: &[&str]) -> u8 {
    let filled: Vec<&&str> = lines.iter().filter(|l| !l.trim().is_empty()).collect();
    let probe = filled.get(filled.len() / 2).map_or("", |l| **l);
    let count = |s: u8| probe.bytes().filter(|b| *b == s).count();
    // A comma beside semicolons or tabs is a decimal one.
    match (count(b';'), count(b'\t')) {
        (0, 0) => b',',
        (_, 0) => b';',
        (0, _) => b'\t',
        (a, b) => {
            if a >= b {
                b';'
            } else {
                b'\t'
            }
        }
    }
}

/// The cells of a line, trimmed and without quotes; empty ones at the end are none.
pub(super) fn cells(line: &str, separator: u8) -> Vec<String> {
    let own = |c: &str| c.trim().trim_matches('"').trim().to_owned();
    let mut out: Vec<String> = line.split(char::from(separator)).map(own).collect();
    while out.last().is_some_and(String::is_empty) {
        out.pop();
    }
    out
}

/// A number, with a decimal comma where commas do not separate.
pub(super) fn number(cell: &str, separator: u8) -> Option<f64> {
    let value: f64 = match separator {
        b',' => cell.parse().ok()?,
        _ => cell.replace(',', ".").parse().ok()?,
    };
    value.is_finite().then_some(value)
}

fn numbers(cells: &[String], separator: u8) -> Option<Vec<f64>> {
    let all: Option<Vec<f64>> = cells.iter().map(|c| number(c, separator)).collect();
    all.filter(|n| n.len() >= 2)
}

/// The first row of the table, and the cells that its rows have.
fn first_row(lines: &[&str], separator: u8) -> Option<(usize, usize)> {
    let widths: Vec<Option<usize>> = lines
        .iter()
        .map(|l| numbers(&cells(l, separator), separator).map(|n| n.len()))
        .collect();
    (0..widths.len()).find_map(|i| {
        let width = widths[i]?;
        let after = widths[i..].iter().take(ROWS_OF_A_TABLE);
        after
            .clone()
            .all(|w| *w == Some(width))
            .then_some((i, width))
    })
}

/// The first of the damaged rows that stand right before the first whole one, `row`; there they would end as a preamble or
/// as the header. A damaged row has the width of the rows and numbers in some of its cells alone, or begins with a number.
fn damaged_row(before: &[&str], row: &str, separator: u8) -> Option<usize> {
    let width = |line: &str| line.bytes().filter(|b| *b == separator).count();
    let of = |line: &str| {
        let cells = line.split(char::from(separator));
        let bare = cells.map(|c| c.trim().trim_matches('"').trim());
        bare.map(|c| number(c, separator).is_some())
            .collect::<Vec<bool>>()
    };
    let is_part = |numbers: &[bool], line: &str| {
        let any = numbers.contains(&true);
        (any && width(line) == width(row)) || (numbers.len() >= 2 && numbers[0])
    };
    let mut found = None;
    for (k, line) in before.iter().enumerate().rev() {
        if line.trim().is_empty() {
            break;
        }
        let numbers = of(line);
        if !is_part(&numbers, line) {
            break;
        }
        if numbers.contains(&false) || width(line) != width(row) {
            found = Some(k);
        }
    }
    found
}

/// The first of the rows between the names of the columns and the first whole row that has not as many cells, and how many it
/// has: it would end as a part of the preamble. A number under a line with one name, or beside a number, is a preamble's.
fn ragged_row(before: &[&str], separator: u8, width: usize) -> Option<(usize, usize)> {
    let is_number = |c: &String| number(c, separator).is_some();
    let all: Vec<Vec<String>> = before.iter().map(|l| cells(l, separator)).collect();
    let is_row = |c: &&Vec<String>| !c.is_empty() && c.iter().all(is_number);
    let first = all.len() - all.iter().rev().take_while(is_row).count();
    let names = &all[first.checked_sub(1)?];
    if names.len() < 2 || names.iter().any(is_number) {
        return None;
    }
    let ragged = (first..all.len()).find(|k| all[*k].len() != width)?;
    Some((ragged, all[ragged].len()))
}

/// A row, on line `number`, with another count of cells than the others.
fn wrong_count(
    (path, number): (&Path, usize),
    line: &str,
    count: usize,
    width: usize,
) -> InputError {
    let cells = match count {
        1 => "1 cell".to_owned(),
        n => format!("{n} cells"),
    };
    let mut error = InputError::new(format!("this row has {cells}, where {width} are wanted"))
        .in_file(path)
        .at(number, 1)
        .help("repair the row or take it away");
    error.source_line = Some(line.trim_end().to_owned());
    error
}

/// Why a file whose first line (`number`) names the drive's and the sense's column is no table: no row, or one of another width.
pub(super) fn no_rows((path, number): (&Path, usize), text: &str) -> Option<InputError> {
    let lines: Vec<&str> = text.lines().collect();
    let separator = separator(lines.get(..1)?);
    let names = cells(lines[0], separator);
    let says = |words: [&str; 2]| {
        let mut lower = names.iter().map(|n| n.to_lowercase());
        lower.any(|n| words.iter().any(|w| n.contains(w)))
    };
    if names.len() < 2 || !says(WORDS[0]) || !says(WORDS[1]) {
        return None;
    }
    let rows = || (1..lines.len()).filter(|k| !lines[*k].trim().is_empty());
    if rows().next().is_none() {
        let error = InputError::new("the capture has a header and no rows");
        let help = "capture again; each line after the header is a sample of drive and sense";
        return Some(error.in_file(path).at(number, 1).help(help));
    }
    let count = |k: &usize| cells(lines[*k], separator).len();
    let ragged = rows().find(|k| count(k) != names.len())?;
    let at = (path, number + ragged);
    Some(wrong_count(at, lines[ragged], count(&ragged), names.len()))
}

/// What instruments and programs write in place of a number that they do not have: names of no column.
const MARKS: [&str; 12] = [
    "ovl",
    "ovr",
    "ovld",
    "ovf",
    "ovrld",
    "overload",
    "overflow",
    "overrange",
    "over",
    "inf",
    "infinity",
    "nan",
];

/// Whether a cell says that the instrument has no number.
pub(super) fn is_mark(cell: &str) -> bool {
    let bare = cell.trim_start_matches(['+', '-', '<', '>']).to_lowercase();
    MARKS.contains(&bare.as_str())
}

/// The first of the rows right before the first whole one whose cells are marks of an overload and numbers alone; its
/// first mark.
fn overloaded_row(before: &[&str], separator: u8, width: usize) -> Option<(usize, String)> {
    let mark = |line: &&str| {
        let cells = cells(line, separator);
        let is_row = cells.len() == width
            && cells
                .iter()
                .all(|c| is_mark(c) || number(c, separator).is_some());
        cells.into_iter().find(|c| is_mark(c)).filter(|_| is_row)
    };
    let rows = before.iter().enumerate().rev();
    let marked = rows.map_while(|(k, line)| Some((k, mark(line)?)));
    marked.last()
}

/// A line before the first row that is a row itself, or that lacks names where both columns have them: a damaged one
/// must not end as part of a preamble.
fn row_before(before: &[&str], separator: u8, width: usize, used: [usize; 2]) -> Option<usize> {
    let wide = |k: &usize| cells(before[*k], separator).len() >= width;
    let last = (0..before.len()).rev().find(wide);
    (0..before.len()).find(|k| {
        let cells = cells(before[*k], separator);
        let values = used.map(|u| cells.get(u).and_then(|c| number(c, separator)));
        let is_row = numbers(&cells, separator).is_some_and(|n| n.len() == width);
        is_row || (Some(*k) == last && values.iter().all(Option::is_some))
    })
}

/// The names and the units that stand before the first row.
fn names(before: &[&str], separator: u8, width: usize) -> Named {
    let wide: Vec<Vec<String>> = before
        .iter()
        .map(|l| cells(l, separator))
        .filter(|c| c.len() >= width)
        .collect();
    let (units, names) = match wide.as_slice() {
        [.., names, last] if is_units(&last[..width]) && !is_units(&names[..width]) => {
            (last.clone(), names.clone())
        }
        [.., last] => (Vec::new(), last.clone()),
        [] => (Vec::new(), Vec::new()),
    };
    Named { names, units }
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

/// The name of a capture's side-car.
pub(super) fn sidecar_name(path: &Path) -> String {
    let name = super::capture_meta::sidecar_of(path);
    name.file_name()
        .map_or(String::new(), |n| n.to_string_lossy().into_owned())
}
