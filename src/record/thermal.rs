//! The thermal record: one row per averaged reading (`docs/manual.md`, "Thermal records").

use super::cells::{self, BadNumber};
use super::columns::{self, Line, Roles};
use super::lines::Lines;
pub use super::thermal_record::ThermalRecord;
use super::warning::Warning;
use super::{
    applied, clock, dead, error_values, frozen, plausibility, shorten, stopped, temperature,
};
use crate::design::RecordMapping;
use crate::error::{Error, InputError, Result};
use crate::input;
use std::collections::BTreeMap;
use std::path::Path;

/// Fewer rows with a rate than this are no record.
pub const LEAST_ROWS: usize = 10;

/// Reads a thermal record.
///
/// # Errors
/// What `docs/manual.md` calls unusable, with line, column and remedy; see the table in the
/// tests. What is usable but implausible comes back as warnings.
pub fn read(path: &Path, mapping: &RecordMapping) -> Result<(ThermalRecord, Vec<Warning>)> {
    let bytes = input::text_bytes(
        input::open(path, "record")?,
        path,
        "record",
        input::MOST_OF_A_RECORD,
    )?;
    parse(&bytes, path, mapping)
}

/// As [`read`], from bytes; `path` is for the messages.
///
/// # Errors
/// As [`read`].
pub fn parse(
    bytes: &[u8],
    path: &Path,
    mapping: &RecordMapping,
) -> Result<(ThermalRecord, Vec<Warning>)> {
    if let Some(period) = mapping.row_period_s
        && !(period.is_finite() && period > 0.0)
    {
        return Err(
            InputError::new(format!("row_period_s = {period} is no period"))
                .help("give the seconds from one row to the next, such as row_period_s = 15")
                .into(),
        );
    }
    if mapping.undo_correction {
        return Err(InputError::new(
            "`--undo-correction` has nothing to go by here: a CSV record does not hold the coefficients of a correction",
        )
        .in_file(path)
        .help("give the autopilot's own log (PX4 .ulg, ArduPilot .bin), or leave `--undo-correction` out")
        .into());
    }
    let text = decode(bytes, path)?;
    let Some((commas, told)) = with_commas(text) else {
        return parse_text(text, path, mapping);
    };
    // Places are the same; the line that is shown is the file's own.
    let read = parse_text(&commas, path, mapping).map_err(|e| match e {
        Error::Input(mut e) => {
            let number = e.line.filter(|_| e.file.as_deref() == Some(path));
            if let (Some(number), true) = (number, e.source_line.is_some()) {
                e.source_line = Some(Lines::new(text, path).at(number).text.to_owned());
            }
            Error::Input(e)
        }
        other => other,
    });
    read.map(|(record, mut warnings)| {
        warnings.insert(0, told);
        (record, warnings)
    })
}

/// A text whose header is separated by semicolons, with commas in their places, and with points for the commas in its
/// cells; what is said of that. `None` for any other text.
fn with_commas(text: &str) -> Option<(String, Warning)> {
    let mut lines = text.split(['\n', '\r']).map(str::trim);
    let header = lines.find(|line| !line.is_empty() && !line.starts_with('#'))?;
    if !header.contains(';') || header.contains(',') {
        return None;
    }
    let has_commas = lines.any(|line| line.contains(','));
    let read = match has_commas {
        true => {
            "semicolons separate the cells, and a comma in a number is read as its decimal point"
        }
        false => "semicolons separate the cells",
    };
    let commas = text.chars().map(|c| match c {
        ';' => ',',
        ',' => '.',
        other => other,
    });
    let told = Warning::general("semicolons", format!("the record is read so: {read}"));
    Some((commas.collect(), told))
}

/// As [`parse`], from text whose cells commas separate.
fn parse_text(
    text: &str,
    path: &Path,
    mapping: &RecordMapping,
) -> Result<(ThermalRecord, Vec<Warning>)> {
    let source = Lines::new(text, path);
    let mut lines = source.iter();
    let header = lines
        .find(|line| !line.text.trim_start().starts_with('#'))
        .ok_or_else(|| {
            InputError::new("the record is empty")
                .in_file(path)
                .at(1, 1)
                .help("a record is a header row, such as time_s,rate_out_dps,die_degc, and rows")
        })?;
    let before = source
        .iter()
        .take_while(|l| l.number < header.number)
        .last();
    if is_of_channels(header.text, mapping) {
        return Err(header
            .error(1, CAPTURE.0.to_owned(), CAPTURE.1.to_owned())
            .into());
    }
    let roles = columns::resolve(header, mapping).map_err(|e| commented(e, header, before))?;
    let (values, rows) = cells(lines, &roles, source)?;
    if rows.is_empty() {
        return Err(header
            .error(
                1,
                "the record has a header row and nothing after it".to_owned(),
                format!("at least {LEAST_ROWS} rows are needed"),
            )
            .into());
    }
    let first = rows.first().map_or(header, |n| source.at(*n));
    let (values, mut warnings) = usable(values, first, &roles)?;
    warnings.splice(0..0, roles.warnings.iter().cloned());
    warnings.extend(cut_cell(source, &rows, &roles));
    let mut record = ThermalRecord {
        source: path.to_path_buf(),
        time_s: Vec::new(),
        columns: BTreeMap::new(),
        lines: rows,
        renamed: BTreeMap::new(),
        units: roles.units.iter().cloned().collect(),
    };
    for ((file_name, names), column) in roles.columns.iter().zip(values) {
        let Some(column) = column else { continue };
        for name in names {
            if name != file_name {
                record.renamed.insert(name.clone(), file_name.clone());
            }
        }
        if let Some((last, others)) = names.split_last() {
            for name in others {
                record.columns.insert(name.clone(), column.clone());
            }
            record.columns.insert(last.clone(), column);
        }
    }
    for (name, unit) in &roles.units {
        if let Some(values) = record.columns.get_mut(name) {
            values.iter_mut().for_each(|v| *v = unit.convert(*v));
        }
    }
    let last = record.lines.last().map_or(header, |n| source.at(*n));
    clock::take(&mut record, &source, &roles, mapping, &mut warnings)?;
    applied::take(&mut record, &mut warnings);
    error_values::take(&mut record, &mut warnings);
    stopped::take(&mut record, &mut warnings);
    clock::merge_repeated(&mut record, &mut warnings);
    shorten::rows(&mut record, mapping.average_s, &mut warnings);
    enough(&record, last, &mut warnings)?;
    dead::refuse(&record, path, record.lines.first().copied())?;
    temperature::refuse(&record, header, &roles, mapping)?;
    let says_rate = mapping.units.contains_key("rate_out_dps");
    plausibility::check(&record, says_rate, &mut warnings);
    frozen::check(&record, &mut warnings);
    Ok((record, warnings))
}

/// What a capture in a record's place is told: what it is, and what takes it.
pub(super) const CAPTURE: (&str, &str) = (
    "this is a capture of ADC codes, and no thermal record",
    "give it with `close --capture`, `replay --capture` or `equiv --capture`",
);

/// Names of a capture's two channels, and none that a record has.
fn is_of_channels(header: &str, mapping: &RecordMapping) -> bool {
    const OF_RECORDS: [&str; 6] = ["time_s", "rate", "gyro", "dps", "deg", "temp"];
    let lower = header.to_lowercase();
    if lower.contains("drive_code") && lower.contains("sense_code") {
        return true;
    }
    let begins = |word: &str| {
        let mut names = lower.split([',', '\t']);
        names.any(|n| n.trim_matches([' ', '"']).starts_with(word))
    };
    // A design's names for a record's columns are none of a capture's.
    let is_mapped = |name: &str| {
        mapping
            .columns
            .values()
            .any(|c| c.eq_ignore_ascii_case(name))
    };
    let mut names = lower.split([',', '\t']);
    !names.any(|n| is_mapped(n.trim_matches([' ', '"', '\r'])))
        && begins("drive")
        && begins("sense")
        && !OF_RECORDS.iter().any(|word| lower.contains(word))
}

/// A header behind `#`, as `numpy.savetxt` writes it, said to be one.
fn commented(error: Error, header: Line<'_>, before: Option<Line<'_>>) -> Error {
    let Some(line) = before else {
        return error;
    };
    let text = line.text.trim_start().trim_start_matches('#').trim();
    let names = text.split(',').map(str::trim);
    let named = names.clone().filter(|n| cells::number(n).is_err()).count();
    let numbers = header
        .text
        .split(',')
        .all(|c| cells::number(c.trim()).is_ok());
    if !numbers || named < 2 || names.count() != header.text.split(',').count() {
        return error;
    }
    line.error(
        1,
        "the record has no header row; this line, behind #, looks like it".to_owned(),
        "remove the # in front of the names: # makes it a comment (numpy.savetxt: comments=\"\")"
            .to_owned(),
    )
    .into()
}

/// UTF-8, with or without a byte order mark.
fn decode<'a>(bytes: &'a [u8], path: &Path) -> Result<&'a str> {
    if bytes.starts_with(&[0xFF, 0xFE]) || bytes.starts_with(&[0xFE, 0xFF]) {
        return Err(InputError::new("the record is UTF-16, not UTF-8")
            .in_file(path)
            .at(1, 1)
            .help("export it as UTF-8 (\"CSV UTF-8\")")
            .into());
    }
    let bytes = bytes.strip_prefix(&[0xEF, 0xBB, 0xBF]).unwrap_or(bytes);
    std::str::from_utf8(bytes).map_err(|e| {
        let good = std::str::from_utf8(&bytes[..e.valid_up_to()]).unwrap_or("");
        let byte = bytes.get(e.valid_up_to()).copied().unwrap_or(0);
        let mut error = InputError::new(format!("byte 0x{byte:02X} is not UTF-8"))
            .in_file(path)
            .at_offset(good, good.len())
            .help("export the record as UTF-8; a degree sign in Latin-1 is a frequent cause");
        error.source_line = None;
        error.into()
    })
}

/// Reads all cells: the numbers by column of the file, with what is wrong with the first bad one;
/// and the number of each row's line.
fn cells<'a>(
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
struct ReadColumn {
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
type Values = Vec<Option<Vec<f64>>>;

/// Leaves out what holds no numbers. `first` is the first row.
fn usable(read: Vec<ReadColumn>, first: Line<'_>, roles: &Roles) -> Result<(Values, Vec<Warning>)> {
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
fn cut_cell(source: Lines<'_>, rows: &[usize], roles: &Roles) -> Option<Warning> {
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
    let (column, help) = match cells.get(width) {
        Some(extra) => (
            extra.column,
            "remove what is too much; if it is a decimal comma, export with decimal points"
                .to_owned(),
        ),
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

/// Enough rows with a rate, and a word on those without.
fn enough(record: &ThermalRecord, last: Line<'_>, warnings: &mut Vec<Warning>) -> Result<()> {
    let measured = record.measured("rate_out_dps");
    if measured < LEAST_ROWS {
        return Err(last
            .error(
                1,
                format!("only {measured} rows have a time and a rate_out_dps"),
                format!("at least {LEAST_ROWS} are needed; record longer, or average less"),
            )
            .into());
    }
    let without = record.len() - measured;
    if without > 0 {
        warnings.push(Warning::on(
            "rows_without_rate",
            "rate_out_dps",
            format!(
                "{without} of {} rows have no rate_out_dps; they take no part in any fit",
                record.len()
            ),
        ));
    }
    Ok(())
}
