//! A capture: one row of ADC codes (drive, sense) a sample, read as a stream from CSV or NPY
//! (`docs/manual.md` section 2, `docs/manual.md`).
//!
//! The file is never held whole: a reader needs some hundred KiB and the caller's block.

use super::capture_csv::CsvSource;
pub use super::capture_meta::{CaptureMeta, mismatch_warnings};
use super::capture_npy::NpySource;
use super::capture_places::Places;
use super::npy_header;
use crate::error::{Error, InputError, Result, io_error};
use crate::numeric::format::Format;
use std::fs::File;
use std::io::Read;
use std::path::Path;

/// The two columns that are used, in the order of an NPY capture's columns.
pub(crate) const COLUMNS: [&str; 2] = ["drive_code", "sense_code"];

/// A capture file, read block by block.
pub struct CaptureReader {
    meta: CaptureMeta,
    places: Places,
    source: Source,
    /// What stopped the reading; told again at every further call.
    failed: Option<Error>,
}

enum Source {
    Csv(CsvSource),
    Npy(NpySource),
}

/// A file that calls itself NPY is read as nothing else.
fn is_named_npy(path: &Path) -> bool {
    path.extension()
        .is_some_and(|e| e.eq_ignore_ascii_case("npy"))
}

impl CaptureReader {
    /// Opens a capture and reads its header. The content decides what it is: an NPY magic makes it
    /// NPY (meta from the side-car of the same stem), anything else is read as CSV (meta from the
    /// comment lines). `adc` is the format that every code must fit.
    ///
    /// # Errors
    /// A file that cannot be read, is empty or has no usable header; a broken side-car or comment.
    pub fn open(path: &Path, adc: Format) -> Result<Self> {
        let failed = |e: std::io::Error| io_error(path, "read the capture", &e);
        let mut file = File::open(path).map_err(failed)?;
        let kind = file.metadata().map_err(failed)?;
        if kind.is_dir() {
            return Err(InputError::new("this is a folder, not a capture")
                .in_file(path)
                .help("name the capture's file (CSV or NPY)")
                .into());
        }
        let mut start = Vec::new();
        file.by_ref()
            .take(npy_header::MAGIC.len() as u64)
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
        let (meta, source) = if start.first() == npy_header::MAGIC.first() || is_named_npy(path) {
            let npy = NpySource::open(path, file, kind.is_file().then_some(kind.len()), codes)?;
            (
                CaptureMeta::of_sidecar(path, &mut places)?,
                Source::Npy(npy),
            )
        } else {
            let input = std::io::Cursor::new(start).chain(file);
            let (csv, meta) = CsvSource::open(path, Box::new(input), codes, &mut places)?;
            (meta, Source::Csv(csv))
        };
        Ok(CaptureReader {
            meta,
            places,
            source,
            failed: None,
        })
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

/// The remedy for a CSV file without a usable header.
pub(super) const HEADER_HELP: &str = "a capture is a CSV file with a header line that names the \
    columns `drive_code` and `sense_code`, separated by commas, or an NPY file of shape (n, 2)";

/// The codes that an ADC format allows.
#[derive(Debug, Clone, Copy)]
pub(super) struct Codes {
    /// Smallest code.
    pub(super) min: i32,
    /// Largest code.
    pub(super) max: i32,
    format: Format,
}

impl Codes {
    /// The range of `format`, of which 32 signed bits are used at most.
    pub(super) fn of(format: Format) -> Self {
        let limit = |v: i128| v.clamp(i128::from(i32::MIN), i128::from(i32::MAX)) as i32;
        Codes {
            min: limit(format.min_raw()),
            max: limit(format.max_raw()),
            format,
        }
    }

    /// Says that `code` of column `name` is outside the range; the caller adds the place.
    pub(super) fn refuse(&self, code: &str, name: &str) -> InputError {
        InputError::new(format!(
            "{name} {code} is outside the ADC's format {}, which holds {} ..= {}",
            self.format, self.min, self.max
        ))
        .help(
            "give the design the capture's word length (`circuit.adc.format`), or repair the \
             capture",
        )
    }
}
