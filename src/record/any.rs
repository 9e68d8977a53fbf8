//! A thermal record from whatever file it is in.

use super::thermal::{self, ThermalRecord};
use super::unpack;
use super::warning::Warning;
use super::{dataflash, ulog};
use crate::design::RecordMapping;
use crate::error::{InputError, Result, io_error};
use crate::input;
use std::io::{BufReader, Cursor, Read};
use std::path::Path;

/// Bytes that are asked of a log at a time.
const BUFFER_BYTES: usize = 1 << 18;

/// Reads a thermal record: PX4 ULog, ArduPilot DataFlash or CSV, as the file's first bytes say; packed with gzip or zstd, or
/// as it is. Of a log, `mapping` chooses axis, gyro and rows.
///
/// # Errors
/// As [`thermal::read`], `ulog::read` and `dataflash::read`; a file that is named as a log and
/// is none; one of a kind that holds no record.
pub fn read_any(path: &Path, mapping: &RecordMapping) -> Result<(ThermalRecord, Vec<Warning>)> {
    let failed = |e: std::io::Error| io_error(path, "read the record", &e);
    let file = input::open(path, "record")?;
    let (head, input) = headed(Box::new(file)).map_err(failed)?;
    let (input, packed) = unpack::unpacked(&head, input).map_err(failed)?;
    let (head, input) = match packed {
        true => headed(input).map_err(failed)?,
        false => (head, input),
    };
    if let Some(error) = unpack::packed_twice(path, &head).filter(|_| packed) {
        return Err(error.into());
    }
    if let Some((what, help)) = unpack::foreign(&head) {
        return Err(InputError::new(what).in_file(path).help(help).into());
    }
    if head.starts_with(&ulog::MAGIC) {
        return ulog::read(BufReader::with_capacity(BUFFER_BYTES, input), path, mapping);
    }
    if head.starts_with(&dataflash::MAGIC) {
        return dataflash::read(BufReader::with_capacity(BUFFER_BYTES, input), path, mapping);
    }
    if !packed {
        refuse_by_name(path, &head)?;
    }
    let bytes = input::text_bytes(input, path, "record", input::MOST_OF_A_RECORD)?;
    thermal::parse(&bytes, path, mapping)
}

/// The first bytes of a stream, and the stream with them.
fn headed(mut input: Box<dyn Read + Send>) -> std::io::Result<(Vec<u8>, Box<dyn Read + Send>)> {
    let mut head = Vec::new();
    input
        .by_ref()
        .take(unpack::HEAD as u64)
        .read_to_end(&mut head)?;
    let whole = Cursor::new(head.clone()).chain(input);
    Ok((head, Box::new(whole)))
}

/// A file that calls itself a log, or is one as text, and does not begin as one.
fn refuse_by_name(path: &Path, start: &[u8]) -> Result<()> {
    let extension = path.extension().and_then(|e| e.to_str()).unwrap_or("");
    let (what, help) = match extension.to_ascii_lowercase().as_str() {
        "ulg" | "ulog" | "bin" | "tlog" | "mavlink" if start.is_empty() => (
            "the log is empty: the file has no byte",
            "take another copy of it: the disk may have been full, or the copy broken off",
        ),
        "ulg" | "ulog" => (
            "the file is named as a PX4 ULog and does not begin as one",
            "a ULog begins with `ULog`: was the file truncated, packed, or downloaded in part?",
        ),
        "bin" => (
            "the file is named as an ArduPilot log and does not begin as one",
            "a DataFlash log begins with the bytes A3 95: was it packed, or downloaded in part?",
        ),
        "tlog" | "mavlink" => (
            "the file is named as a telemetry log (MAVLink)",
            "its IMU messages are few and scaled; give the log that the vehicle itself wrote (ArduPilot: .bin, PX4: .ulg)",
        ),
        "raw" | "pcm" | "i16" | "s16" | "int16" | "i32" => (
            "the file is named as raw samples, which are a capture of ADC codes and no thermal record",
            thermal::CAPTURE.1,
        ),
        _ if start.starts_with(b"FMT, ") || start.starts_with(b"FMT,1") => (
            "this is an ArduPilot log in its text form",
            "give the .bin file that it was made from",
        ),
        _ => return Ok(()),
    };
    Err(InputError::new(what).in_file(path).help(help).into())
}

/// What kind of a file these first bytes are of, and whether it can be a record; `None` if they are of neither a record
/// nor of a kind that is known and holds none.
pub fn is_a_record(bytes: &[u8]) -> Option<(&'static str, bool)> {
    if bytes.starts_with(&ulog::MAGIC) {
        return Some(("a PX4 log", true));
    }
    if bytes.starts_with(&dataflash::MAGIC) {
        return Some(("an ArduPilot log", true));
    }
    if unpack::is_packed(bytes) {
        return Some(("a packed file", true));
    }
    if let Some((what, _)) = unpack::foreign(bytes.get(..unpack::HEAD.min(bytes.len()))?) {
        return Some((what.strip_prefix("this is ")?, false));
    }
    // A header of several names, and a row of as many numbers.
    let start = bytes.get(..bytes.len().min(1 << 16))?;
    let text = std::str::from_utf8(start)
        .or_else(|e| std::str::from_utf8(start.get(..e.valid_up_to()).unwrap_or(&[])));
    let mut lines = text.ok()?.lines().map(str::trim);
    let header = lines.find(|l| !l.is_empty() && !l.starts_with('#'))?;
    let row = lines.next()?;
    let is_table = |separator: char| {
        let count = header.split(separator).count();
        let cells = || row.split(separator);
        let numbers = cells().filter(|c| c.trim().parse::<f64>().is_ok()).count();
        count >= 2 && numbers >= 2 && cells().count() == count
    };
    ([',', ';', '\t'].into_iter().any(is_table) && !header.contains('='))
        .then_some(("a record (CSV)", true))
}
