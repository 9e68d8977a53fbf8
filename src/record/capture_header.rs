//! The head of a CSV capture: comment lines with keys, and the header line that names the columns.

use super::bench_keys::{BenchKeys, KeyValue};
use super::capture::{COLUMNS, HEADER_HELP};
use super::capture_lines::Line;
use super::capture_meta::{CaptureMeta, Value, sidecar_name};
use super::capture_places::Places;
use crate::design::record_columns::{is_known, unit_of};
use crate::design::units;
use crate::error::{InputError, Result};

/// Where the two columns stand.
#[derive(Debug, Clone, Copy)]
pub(super) struct Layout {
    /// Cells in every row.
    pub(super) cells: usize,
    /// 0-based cell of `drive_code` and of `sense_code`.
    pub(super) used: [usize; 2],
}

/// Whether a header has the name of one of the contract's columns, in whatever form: then it is meant as one of the
/// contract's.
pub(super) fn names_a_column(header: &[u8]) -> bool {
    let has = |name: &str| header.windows(name.len()).any(|w| w == name.as_bytes());
    COLUMNS.iter().any(|c| has(c))
}

/// Reads one comment line `# key = value`; any other comment, and an unknown key, is passed over.
/// What follows a further `#` is a remark.
pub(super) fn read_comment(
    line: Line<'_>,
    meta: &mut CaptureMeta,
    keys: &mut BenchKeys,
    places: &mut Places,
) -> Result<()> {
    let text = String::from_utf8_lossy(line.bytes);
    let help = "a comment line of a capture reads `# fs_hz = 224000.0`; correct the value, or take \
                the line away";
    let Some((left, right)) = text.split_once('=') else {
        return Ok(());
    };
    let key = left.trim().trim_start_matches('#').trim();
    let mut known = CaptureMeta::KEYS.into_iter().chain(BenchKeys::KEYS);
    let Some(key) = known.find(|&known| known == key) else {
        return Ok(());
    };
    let refuse = |offset: usize, message: String| {
        InputError::new(message)
            .in_file(line.path)
            .at_offset(&text, offset)
            .at(line.number, text[..offset].chars().count() + 1)
            .help(help)
    };
    if places.knows(key) {
        let offset = left.find(key).unwrap_or(0);
        return Err(refuse(offset, format!("`{key}` is given a second time")).into());
    }
    let value = right.split('#').next().unwrap_or("");
    let offset = left.len() + 1 + (value.len() - value.trim_start().len());
    places.keep(key, refuse(offset, String::new()).position());
    let value = value.trim();
    meta.set(key, Value::of_text(value))
        .and_then(|()| keys.set(key, &KeyValue::of_text(value)))
        .map_err(|problem| refuse(offset, problem).into())
}

/// Refuses the header of a thermal record: a name in it is one of the contract's for such a record, or says deg/s or degC,
/// and none is the drive's or the sense's.
pub(super) fn refuse_thermal(line: Line<'_>) -> Result<()> {
    let text = String::from_utf8_lossy(line.bytes);
    let lower = text.to_lowercase();
    if ["drive", "drv", "sense", "sns"]
        .iter()
        .any(|w| lower.contains(w))
    {
        return Ok(());
    }
    let mut names = text
        .split([',', ';', '\t'])
        .map(|n| n.trim().trim_matches('"').trim());
    // A line of a preamble, such as `Temperature (C),25`, is no header.
    if names.clone().any(|n| n.parse::<f64>().is_ok()) || names.clone().count() < 2 {
        return Ok(());
    }
    let is_thermal = |name: &&str| {
        let is_of = |n: &str| is_known(n) && !["time_s", "supply_v", "accel_g"].contains(&n);
        let stated = |column: &str| units::stated(name, column);
        let in_unit = ["rate_out_dps", "die_degc"]
            .into_iter()
            .any(|c| stated(c).is_some_and(|u| u.of == unit_of(c)));
        is_of(name) || units::meant(name).is_some_and(is_of) || in_unit
    };
    let Some(name) = names.find(is_thermal) else {
        return Ok(());
    };
    Err(line
        .refuse(
            0,
            &format!(
                "this is a thermal record (its column \"{name}\"), and no capture of ADC codes"
            ),
        )
        .help("give it with --record (`run`, `close`)")
        .into())
}

/// Finds the two columns in the header line.
pub(super) fn read_header(line: Line<'_>, places: &mut Places) -> Result<Layout> {
    if line.bytes.contains(&0) || line.bytes.starts_with(b"\xff\xfe") {
        let message = "this is neither a CSV file in UTF-8 nor an NPY file (it has binary bytes)";
        let e = InputError::new(message).in_file(line.path);
        let help = format!(
            "{HEADER_HELP}; samples without a header need a side-car: write `item = \"int16\"` into {} beside it",
            sidecar_name(line.path)
        );
        return Err(e.help(help).into());
    }
    let names: Vec<&[u8]> = line
        .bytes
        .split(|&b| b == b',')
        .map(<[u8]>::trim_ascii)
        .collect();
    let mut used = [0; 2];
    for (column, place) in COLUMNS.into_iter().zip(&mut used) {
        let is_it = |name: &&[u8]| *name == column.as_bytes();
        let Some(first) = names.iter().position(is_it) else {
            let message = format!("the header has no column `{column}`");
            return Err(line.refuse(0, &message).help(HEADER_HELP).into());
        };
        let before = |cell: usize| -> usize {
            let cells = line.bytes.split(|&b| b == b',').take(cell);
            cells.map(|cell| cell.len() + 1).sum()
        };
        places.keep(column, line.refuse(before(first), "").position());
        if let Some(again) = names.iter().rposition(is_it).filter(|&last| last > first) {
            return Err(line
                .refuse(before(again), &format!("the header has `{column}` twice"))
                .help("rename one of the two columns")
                .into());
        }
        *place = first;
    }
    Ok(Layout {
        cells: names.len(),
        used,
    })
}
