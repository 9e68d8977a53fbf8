//! A capture: one row of ADC codes (drive, sense) a sample, read as a stream from CSV, NPY or raw samples
//! (`docs/manual.md`, "Replay and captures").
//!
//! The file is never held whole: a reader needs some hundred KiB and the caller's block.

use super::bench_keys::BenchKeys;
pub(crate) use super::capture_codes::COLUMNS;
pub(super) use super::capture_codes::{Codes, HEADER_HELP};
use super::capture_csv::CsvSource;
pub use super::capture_meta::{CaptureMeta, mismatch_warnings};
use super::capture_npy::NpySource;
use super::capture_places::Places;
use super::capture_raw::{self, RawSource, is_named_raw};
use super::{npy_header, unpack};
use crate::error::{Error, InputError, Result, io_error};
use crate::input;
use crate::numeric::format::Format;
use std::fs::File;
use std::io::{Read, Seek, SeekFrom};
use std::path::Path;

/// A capture file, read block by block.
pub struct CaptureReader {
    meta: CaptureMeta,
    places: Places,
    notes: Vec<String>,
    source: Source,
    /// What stopped the reading; told again at every further call.
    failed: Option<Error>,
}

enum Source {
    Csv(CsvSource),
    Npy(NpySource),
    Raw(RawSource),
}

/// A file that calls itself NPY is read as nothing else.
fn is_named_npy(path: &Path) -> bool {
    path.extension()
        .is_some_and(|e| e.eq_ignore_ascii_case("npy"))
}

/// Bytes that tell what a file is: text has none below 9 in as many, and 16-bit samples hardly none (convention).
const START_BYTES: u64 = 512;

fn is_text(bytes: &[u8]) -> bool {
    !bytes.iter().any(|b| matches!(b, 0..=8 | 14..=31))
}

/// Whether a file is text from a byte on as well, or cannot be looked at there; it is left where it was.
fn is_text_from(file: &mut File, byte: u64) -> bool {
    let mut look = || -> std::io::Result<bool> {
        let here = file.stream_position()?;
        file.seek(SeekFrom::Start(byte))?;
        let mut bytes = Vec::new();
        file.by_ref().take(START_BYTES).read_to_end(&mut bytes)?;
        file.seek(SeekFrom::Start(here))?;
        Ok(is_text(&bytes))
    };
    look().unwrap_or(true)
}

/// Refuses what is no capture by its first bytes: a log, a page, an archive.
fn refuse_others(path: &Path, start: &[u8]) -> Result<()> {
    let log = [
        (&super::ulog::MAGIC[..], "a PX4 log"),
        (&super::dataflash::MAGIC[..], "an ArduPilot log"),
    ];
    if let Some((_, what)) = log.iter().find(|(magic, _)| start.starts_with(magic)) {
        return Err(InputError::new(format!(
            "this is {what} and holds a thermal record, and no capture of ADC codes"
        ))
        .in_file(path)
        .help("give it with --record (`run`, `close`)")
        .into());
    }
    match unpack::foreign(start) {
        Some((what, help)) if !start.starts_with(npy_header::MAGIC) => {
            Err(InputError::new(what).in_file(path).help(help).into())
        }
        _ => Ok(()),
    }
}

/// The keys of a file of raw samples; `None` for one that is to be read as text.
///
/// # Errors
/// A broken side-car; a file that is named as raw and has no side-car that says what its samples are.
fn raw_keys(
    path: &Path,
    start: &[u8],
    file: &mut File,
    places: &mut Places,
) -> Result<Option<(CaptureMeta, BenchKeys)>> {
    let named = is_named_raw(path);
    if unpack::is_packed(start) {
        return Ok(None);
    }
    if !named && is_text(start) {
        // A header in text may stand before raw samples. A broken side-car is said where it is needed.
        let Ok((_, keys)) = CaptureMeta::of_sidecar(path, &mut Places::default()) else {
            return Ok(None);
        };
        let behind = keys.item.and(keys.skip_bytes).filter(|skip| *skip > 0);
        if behind.is_none_or(|skip| is_text_from(file, skip)) {
            return Ok(None);
        }
    }
    let (meta, keys) = CaptureMeta::of_sidecar(path, places)?;
    match keys.item {
        Some(_) => Ok(Some((meta, keys))),
        None if named => Err(capture_raw::without_keys(path).into()),
        None => Ok(None),
    }
}

/// The text of a packed file; any other stream as it is.
///
/// # Errors
/// A packed file that holds no text, or is none.
fn unpacked_text(
    path: &Path,
    start: &[u8],
    input: Box<dyn Read + Send>,
) -> Result<Box<dyn Read + Send>> {
    let failed = |e: std::io::Error| io_error(path, "read the capture", &e);
    let (mut input, packed) = unpack::unpacked(start, input).map_err(failed)?;
    if !packed {
        return Ok(input);
    }
    let mut head = Vec::new();
    input
        .by_ref()
        .take(START_BYTES)
        .read_to_end(&mut head)
        .map_err(failed)?;
    if let Some(error) = unpack::packed_twice(path, &head) {
        return Err(error.into());
    }
    refuse_others(path, &head)?;
    if head.first() == npy_header::MAGIC.first() || head.contains(&0) {
        return Err(InputError::new("this packed file holds no CSV")
            .in_file(path)
            .help("unpack it: of packed captures CSV alone is read as it is")
            .into());
    }
    Ok(Box::new(std::io::Cursor::new(head).chain(input)))
}

impl CaptureReader {
    /// Opens a capture and reads its header. The content decides what it is: an NPY magic makes it
    /// NPY (meta from the side-car of the same stem), what is no text and has a side-car that says `item` is raw
    /// samples, anything else is read as CSV (meta from the comment lines), packed with gzip or zstd or as it is. `adc`
    /// is the format that every code must fit.
    ///
    /// # Errors
    /// A file that cannot be read, is empty or has no usable header; a broken side-car or comment.
    pub fn open(path: &Path, adc: Format) -> Result<Self> {
        let failed = |e: std::io::Error| io_error(path, "read the capture", &e);
        let mut file = input::open(path, "capture")?;
        let kind = file.metadata().map_err(failed)?;
        let length = kind.is_file().then_some(kind.len());
        let mut start = Vec::new();
        file.by_ref()
            .take(START_BYTES)
            .read_to_end(&mut start)
            .map_err(failed)?;
        if start.is_empty() {
            return Err(InputError::new("the capture is empty")
                .in_file(path)
                .help(HEADER_HELP)
                .into());
        }
        let codes = Codes::of(adc);
        let mut places = Places::default();
        let is_npy = start.first() == npy_header::MAGIC.first() || is_named_npy(path);
        let raw = match is_npy {
            true => None,
            false => raw_keys(path, &start, &mut file, &mut places)?,
        };
        if raw.is_none() {
            refuse_others(path, &start)?;
        }
        let (meta, source, notes) = if is_npy {
            let (meta, keys) = CaptureMeta::of_sidecar(path, &mut places)?;
            if keys.columns == [None, None] && keys.volts_per_code.is_none() {
                let npy = NpySource::open(path, file, length, codes)?;
                (meta, Source::Npy(npy), Vec::new())
            } else {
                let (raw, notes) = RawSource::open_npy(path, file, length, codes, &keys)?;
                (meta, Source::Raw(raw), notes)
            }
        } else if let Some((meta, keys)) = raw {
            let (raw, notes) = RawSource::open(path, file, length, codes, &keys)?;
            (meta, Source::Raw(raw), notes)
        } else {
            let input: Box<dyn Read + Send> =
                Box::new(std::io::Cursor::new(start.clone()).chain(file));
            let input = unpacked_text(path, &start, input)?;
            let (csv, meta, notes) = CsvSource::open(path, input, codes, &mut places)?;
            (meta, Source::Csv(csv), notes)
        };
        Ok(CaptureReader {
            meta,
            places,
            notes,
            source,
            failed: None,
        })
    }

    /// What was chosen to read it, where its form left a choice.
    pub fn notes(&self) -> &[String] {
        &self.notes
    }

    /// What the capture says of itself.
    pub fn meta(&self) -> &CaptureMeta {
        &self.meta
    }

    /// Where its keys and columns stand.
    pub fn places(&self) -> &Places {
        &self.places
    }

    /// The number of rows in the whole file where it is known without reading it (NPY).
    pub fn rows_hint(&self) -> Option<u64> {
        match &self.source {
            Source::Csv(_) => None,
            Source::Npy(npy) => Some(npy.rows()),
            Source::Raw(raw) => Some(raw.rows()),
        }
    }

    /// Clears both vectors and fills them with the next rows, at most `max_rows` (0 counts as 1);
    /// returns their number, 0 = the end. Only the last block before the end or before an error
    /// is shorter than `max_rows`.
    ///
    /// # Errors
    /// The first unusable row, with its place, once all rows before it have been handed out; so
    /// what a caller sees does not depend on the size of its blocks. Told again at further calls.
    pub fn read_block(
        &mut self,
        drive: &mut Vec<i32>,
        sense: &mut Vec<i32>,
        max_rows: usize,
    ) -> Result<usize> {
        drive.clear();
        sense.clear();
        if self.failed.is_none() {
            let max_rows = max_rows.max(1);
            let outcome = match &mut self.source {
                Source::Csv(csv) => csv.read(drive, sense, max_rows),
                Source::Npy(npy) => npy.read(drive, sense, max_rows),
                Source::Raw(raw) => raw.read(drive, sense, max_rows),
            };
            self.failed = outcome.err();
            // A reading that fails between two columns leaves one of them longer.
            let rows = drive.len().min(sense.len());
            drive.truncate(rows);
            sense.truncate(rows);
        }
        match &self.failed {
            Some(e) if drive.is_empty() => Err(e.clone()),
            _ => Ok(drive.len()),
        }
    }
}
