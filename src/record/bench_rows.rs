//! Where the rows of a bench capture begin, and which lines before or in place of them are refused: a damaged row must not end
//! as part of a preamble.

use super::bench_cells::{WORDS, cells, number, numbers, separator};
use crate::error::InputError;
use std::path::Path;

/// Rows of numbers in a row that make the first of them the first row (convention: a preamble has single ones).
pub(super) const ROWS_OF_A_TABLE: usize = 3;

/// The first row of the table, and the cells that its rows have.
pub(super) fn first_row(lines: &[&str], separator: u8) -> Option<(usize, usize)> {
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

/// A refused line, on line `number` of the file.
fn refused(
    (path, number): (&Path, usize),
    line: &str,
    message: impl Into<String>,
    help: &str,
) -> InputError {
    let mut error = InputError::new(message)
        .in_file(path)
        .at(number, 1)
        .help(help);
    error.source_line = Some(line.trim_end().to_owned());
    error
}

/// A row, on line `number`, with another count of cells than the others.
fn wrong_count(at: (&Path, usize), line: &str, count: usize, width: usize) -> InputError {
    let cells = match count {
        1 => "1 cell".to_owned(),
        n => format!("{n} cells"),
    };
    let message = format!("this row has {cells}, where {width} are wanted");
    refused(at, line, message, "repair the row or take it away")
}

/// What is wrong with the lines before the first whole row, which is the last of `lines`; the first of them is on line `number`.
pub(super) fn damage(
    (path, number): (&Path, usize),
    lines: &[&str],
    separator: u8,
    width: usize,
) -> Option<InputError> {
    let (row, before) = lines.split_last()?;
    let at = |k: usize| (path, number + k);
    if let Some((k, mark)) = overloaded_row(before, separator, width) {
        let message = format!(
            "this row holds \"{mark}\", which is no code: the instrument was overloaded there, or had no reading"
        );
        let help = "take the rows with such marks away at the capture's beginning; where they stand further on, capture again with a \
                    larger range. The names of the columns stand on the line before the first row";
        return Some(refused(at(k), before[k], message, help));
    }
    if let Some((k, count)) = ragged_row(before, separator, width) {
        return Some(wrong_count(at(k), before[k], count, width));
    }
    let k = damaged_row(before, row, separator)?;
    let message = "this line stands among the rows, right before the first whole one, and is none: some of its cells hold \
                   numbers, and others do not";
    let help = "repair the row or take it away; if it is the header, let no name in it be a number";
    Some(refused(at(k), before[k], message, help))
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
pub(super) fn row_before(
    at: (&Path, usize),
    before: &[&str],
    separator: u8,
    width: usize,
    used: [usize; 2],
) -> Option<InputError> {
    let wide = |k: &usize| cells(before[*k], separator).len() >= width;
    let last = (0..before.len()).rev().find(wide);
    let k = (0..before.len()).find(|k| {
        let cells = cells(before[*k], separator);
        let values = used.map(|u| cells.get(u).and_then(|c| number(c, separator)));
        let is_row = numbers(&cells, separator).is_some_and(|n| n.len() == width);
        is_row || (Some(*k) == last && values.iter().all(Option::is_some))
    })?;
    let message = "this line is like a row, and what follows it is no table yet";
    let help = "repair this line or the next ones, or take them away";
    Some(refused((at.0, at.1 + k), before[k], message, help))
}
