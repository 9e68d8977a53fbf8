//! The thermal record: one row per averaged reading (`docs/manual.md`, "Thermal records").

use super::cells;
use super::columns::{self, Line};
use super::lines::Lines;
pub use super::thermal_record::ThermalRecord;
use super::thermal_rows;
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

/// So many rows are enough for `run` and, as a rule, for `close`, which holds a stretch of them out: what is asked for where
/// there are too few.
pub const ENOUGH_ROWS: usize = 20;

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
    let (values, rows) = thermal_rows::cells(lines, &roles, source)?;
    if rows.is_empty() {
        return Err(header
            .error(
                1,
                "the record has a header row and nothing after it".to_owned(),
                format!("record {ENOUGH_ROWS} rows or more"),
            )
            .into());
    }
    let first = rows.first().map_or(header, |n| source.at(*n));
    let (values, mut warnings) = thermal_rows::usable(values, first, &roles)?;
    warnings.splice(0..0, roles.warnings.iter().cloned());
    warnings.extend(thermal_rows::cut_cell(source, &rows, &roles));
    if mapping.instance_at.is_some() {
        warnings.push(Warning::general(
            "record_keys_unused",
            "`instance` in [record] chooses a gyro of an autopilot's log; this record is none, and it was not used",
        ));
    }
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
    shorten::rows(&mut record, mapping, &mut warnings)?;
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

/// Enough rows with a rate, and a word on those without.
fn enough(record: &ThermalRecord, last: Line<'_>, warnings: &mut Vec<Warning>) -> Result<()> {
    let measured = record.measured("rate_out_dps");
    if measured < LEAST_ROWS {
        return Err(last
            .error(
                1,
                format!("only {measured} rows have a time and a rate_out_dps"),
                format!("record {ENOUGH_ROWS} rows or more, or average less"),
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
