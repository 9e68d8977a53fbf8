//! A thermal record from whatever file it is in.

use super::thermal::{self, ThermalRecord};
use super::warning::Warning;
use super::{dataflash, ulog};
use crate::design::RecordMapping;
use crate::error::{InputError, Result, io_error};
use crate::input;
use std::io::{BufReader, Cursor, Read};
use std::path::Path;

/// Bytes that are asked of a log at a time.
const BUFFER_BYTES: usize = 1 << 18;

/// Reads a thermal record: PX4 ULog, ArduPilot DataFlash or CSV, as the file's first bytes say.
/// Of a log, `mapping` chooses axis, gyro and rows.
///
/// # Errors
/// As [`thermal::read`], `ulog::read` and `dataflash::read`; a file that is named as a log and
/// is none.
pub fn read_any(path: &Path, mapping: &RecordMapping) -> Result<(ThermalRecord, Vec<Warning>)> {
    let failed = |e: std::io::Error| io_error(path, "read the record", &e);
    let mut file = input::open(path, "record")?;
    let mut start = Vec::new();
    file.by_ref()
        .take(ulog::MAGIC.len() as u64)
        .read_to_end(&mut start)
        .map_err(failed)?;
    let is_ulog = start == ulog::MAGIC;
    let is_dataflash = start.starts_with(&dataflash::MAGIC);
    if !is_ulog && !is_dataflash {
        refuse_by_name(path, &start)?;
    }
    let input = Cursor::new(start).chain(file);
    if is_ulog {
        return ulog::read(BufReader::with_capacity(BUFFER_BYTES, input), path, mapping);
    }
    if is_dataflash {
        return dataflash::read(BufReader::with_capacity(BUFFER_BYTES, input), path, mapping);
    }
    let bytes = input::text_bytes(input, path, "record", input::MOST_OF_A_RECORD)?;
    thermal::parse(&bytes, path, mapping)
}

/// A file that calls itself a log, or is one as text, and does not begin as one.
fn refuse_by_name(path: &Path, start: &[u8]) -> Result<()> {
    let extension = path.extension().and_then(|e| e.to_str()).unwrap_or("");
    let (what, help) = match extension.to_ascii_lowercase().as_str() {
        "ulg" | "ulog" => (
            "the file is named as a PX4 ULog and does not begin as one",
            "a ULog begins with `ULog`: was the file truncated, packed, or downloaded in part?",
        ),
        "bin" => (
            "the file is named as an ArduPilot log and does not begin as one",
            "a DataFlash log begins with the bytes A3 95: was it packed, or downloaded in part?",
        ),
        _ if start.starts_with(b"FMT, ") || start.starts_with(b"FMT,1") => (
            "this is an ArduPilot log in its text form",
            "give the .bin file that it was made from",
        ),
        _ => return Ok(()),
    };
    Err(InputError::new(what).in_file(path).help(help).into())
}
