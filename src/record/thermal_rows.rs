//! The rows of a thermal record: their cells as numbers by column, and the place of a cell that is none.

use super::cells::{self, BadNumber};
use super::columns::{self, Line, Roles};
use super::lines::Lines;
use super::warning::Warning;
use crate::error::{InputError, Result};

/// Reads all cells: the numbers by column of the file, with what is wrong with the first bad one;
/// and the number of each row's line.
pub(super) fn cells<'a>(
    lines: impl Iterator<Item = Line<'a>>,
    roles: &Roles,
    source: Lines<'_>,
) -> Result<(Vec<ReadColumn>, Vec<usize>)> {
    let expected = source.count();
    let mut columns: Vec<ReadColumn> = (0..roles.columns.len())
        .map(|_| ReadColumn {
            values: Vec::with_capacity(expected),
            bad: None,
        })
        .collect();
    let mut rows = Vec::with_capacity(expected);
    for line in lines {
        if !plain_numbers(line.text, &mut columns, rows.len()) {
            any_cells(line, roles, &mut columns, source)?;
        }
        rows.push(line.number);
    }
    Ok((columns, rows))
}

/// A column as it is read.
pub(super) struct ReadColumn {
    values: Vec<f64>,
    /// The first cell that holds no number.
    bad: Option<InputError>,
}

/// Reads a row that holds numbers and nothing else, which nearly all rows do; false, and the
/// columns as they were (`rows` long), if there is anything to look at more closely.
fn plain_numbers(text: &str, columns: &mut [ReadColumn], rows: usize) -> bool {
    let mut cells = text.split(',');
    let whole = columns.iter_mut().all(|column| {
        let Some(cell) = cells.next() else {
            return false;
        };
        let cell = cell.trim();
        let value = match cell.is_empty() {
            true => f64::NAN,
            false => cell.parse().unwrap_or(f64::INFINITY),
        };
        column.values.push(value);
        cells::is_a_reading(value)
    });
    let whole = whole && cells.next().is_none();
    if !whole {
        for column in columns {
            column.values.truncate(rows);
        }
    }
    whole
}

/// Reads any row, and refuses it with the place of what is wrong.
fn any_cells(
    line: Line<'_>,
    roles: &Roles,
    columns: &mut [ReadColumn],
    source: Lines<'_>,
) -> Result<()> {
    let is_first = columns.iter().all(|c| c.values.is_empty());
    if line.text.trim_start().starts_with('#') {
        return Err(line
            .error(
                1,
                "a comment among the rows".to_owned(),
                "comments stand before the header; move or remove it".to_owned(),
            )
            .into());
    }
    let cells = match cells::split(line.text) {
        Ok(cells) => cells,
        Err(column) if source.is_cut(line) => {
            return Err(columns::open_quote(line, column).help(CUT_HELP).into());
        }
        Err(column) => return Err(columns::open_quote(line, column).into()),
    };
    let again = cells.len() == roles.columns.len()
        && cells
            .iter()
            .zip(&roles.columns)
            .all(|(c, (name, _))| c.text.trim_start_matches('\u{feff}') == name.as_str());
    if again {
        return Err(line
            .error(
                1,
                "this is the header row again: the file is two records, one after the other".to_owned(),
                "cut the file here and close the parts one by one; if they are one session with one clock, take this line away"
                    .to_owned(),
            )
            .into());
    }
    if cells.len() != roles.columns.len() {
        return Err(wrong_width(&line, &cells, roles, source).into());
    }
    let is_cut = |cell: &cells::Cell<'_>| {
        let is_last = cells.last().is_some_and(|l| l.column == cell.column);
        is_last && source.is_cut(line) && cells::begins_a_number(&cell.text)
    };
    for ((cell, column), (name, names)) in cells.iter().zip(columns).zip(&roles.columns) {
        let value = cells::number(&cell.text).unwrap_or_else(|why| {
            if column.bad.is_none() {
                let what = match why {
                    BadNumber::Infinite => "is not finite",
                    BadNumber::TooLarge => "is larger than any reading",
                    _ => "is no number",
                };
                let shown: String = cell.text.chars().take(40).collect();
                let help = match is_cut(cell) {
                    true => CUT_HELP,
                    false => why.help(),
                };
                column.bad = Some(line.error(
                    cell.column,
                    format!("\"{shown}\" in column {name} {what}"),
                    help.to_owned(),
                ));
            }
            f64::NAN
        });
        column.values.push(value);
        if names.iter().any(|n| columns::is_known(n))
            && let Some(e) = column.bad.take()
        {
            let is_text =
                |c: &cells::Cell<'_>| !c.text.is_empty() && cells::number(&c.text).is_err();
            if is_first && cells.len() > 1 && cells.iter().all(is_text) {
                return Err(e.help("a line of units or of further names: take it away, units belong into the names (`temp [degC]`)").into());
            }
            return Err(e.into());
        }
    }
    Ok(())
}

/// The numbers, by column of the file; `None` for a column that is left out.
pub(super) type Values = Vec<Option<Vec<f64>>>;

/// Leaves out what holds no numbers. `first` is the first row.
pub(super) fn usable(
    read: Vec<ReadColumn>,
    first: Line<'_>,
    roles: &Roles,
) -> Result<(Values, Vec<Warning>)> {
    let mut warnings = Vec::new();
    let mut kept = Vec::with_capacity(read.len());
    for (ReadColumn { values, bad }, (name, names)) in read.into_iter().zip(&roles.columns) {
        let any = values.iter().any(|v| !v.is_nan());
        if name.is_empty() && (any || bad.is_some()) {
            return Err(first
                .error(
                    1,
                    "a column with values has no name in the header".to_owned(),
                    "name it, with its unit, or remove it".to_owned(),
                )
                .into());
        }
        match bad {
            Some(e) if any || e.message.ends_with("finite") => return Err(e.into()),
            Some(_) => warnings.push(Warning::on(
                "text_column",
                name,
                format!("column {name} holds text, not numbers: left out"),
            )),
            None if !any && !name.is_empty() => {
                for name in names {
                    warnings.push(Warning::on(
                        "empty_column",
                        name,
                        format!("column {name} holds no measured value: left out"),
                    ));
                }
            }
            None => {}
        }
        kept.push((any && !names.is_empty()).then_some(values));
    }
    Ok((kept, warnings))
}

/// Remedy for a last row that cannot be read and lacks the end of its line.
const CUT_HELP: &str = "the file ends in the middle of this row: if copying or recording was cut short, do it again; else repair the \
                        row or take it away";

/// What is said of a last row without the end of its line whose last cell is a number with fewer digits behind the point than
/// any other row has there. Many programs end no last line, so that the row is kept.
pub(super) fn cut_cell(source: Lines<'_>, rows: &[usize], roles: &Roles) -> Option<Warning> {
    let (last, before) = rows.split_last()?;
    let last = source.at(*last);
    if !source.is_cut(last) {
        return None;
    }
    let cell = |line: Line<'_>| {
        let cell = line.text.rsplit(',').next().unwrap_or("");
        cell.trim_matches([' ', '\t', '"']).to_owned()
    };
    let behind = |cell: &str| cell.split_once('.').map_or(0, |(_, digits)| digits.len());
    let first = *before.first()?;
    let others = source
        .iter()
        .filter(|l| (first..last.number).contains(&l.number));
    let least = others.map(|l| behind(&cell(l))).min()?;
    let shown = cell(last);
    let (name, names) = roles.columns.last()?;
    let is_measured = shown.is_empty() || shown.parse().is_ok_and(f64::is_finite);
    (is_measured && behind(&shown) < least).then(|| {
        Warning::on(
            "last_row_may_be_cut",
            names.last().unwrap_or(name),
            format!(
                "line {}, the last one, has no line end, and \"{shown}\" in column {name} has fewer digits behind the point than in any \
                 other row: the row may be cut short, and is taken as it is. If copying or recording was cut short, do it again, or \
                 take the row away; if the row is whole, end its line",
                last.number
            ),
        )
    })
}

/// A row whose number of cells is not the header's.
fn wrong_width(
    line: &Line<'_>,
    cells: &[cells::Cell<'_>],
    roles: &Roles,
    source: Lines<'_>,
) -> InputError {
    let width = roles.columns.len();
    // Numbers that lost their decimal marks to the commas between cells: up to two cells each.
    let is_whole = |cell: &cells::Cell<'_>| {
        !cell.text.contains('.') && cell.text.parse::<f64>().is_ok_and(f64::is_finite)
    };
    let commas = cells.len() <= 2 * width && cells.iter().all(is_whole);
    let (column, help) = match cells.get(width) {
        Some(extra) if commas => (
            extra.column,
            "this looks like decimal commas: export with decimal points, or with semicolons between cells".to_owned(),
        ),
        Some(extra) => (extra.column, "remove what is too much".to_owned()),
        None if source.is_cut(*line) => (line.text.chars().count() + 1, CUT_HELP.to_owned()),
        None => (
            line.text.chars().count() + 1,
            format!(
                "an empty cell still needs its comma; the first missing one is column {}",
                roles.columns[cells.len()].0
            ),
        ),
    };
    line.error(
        column,
        format!(
            "{} cell{}, and the header has {width}",
            cells.len(),
            if cells.len() == 1 { "" } else { "s" }
        ),
        help,
    )
}
