//! A capture: one row of ADC codes (drive, sense) a sample, read as a stream from CSV or NPY
//! (`docs/manual.md` section 2, `docs/manual.md`).
//!
//! The file is never held whole: a reader needs some hundred KiB and the caller's block.

pub(crate) use super::capture_codes::COLUMNS;
pub(super) use super::capture_codes::{Codes, HEADER_HELP};
use super::capture_csv::CsvSource;
pub use super::capture_meta::{CaptureMeta, mismatch_warnings};
use super::capture_npy::NpySource;
use super::capture_places::Places;
use super::npy_header;
use crate::error::{Error, InputError, Result, io_error};
use crate::input;
use crate::numeric::format::Format;
use std::io::Read;
use std::path::Path;

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
        let mut file = input::open(path, "capture")?;
        let kind = file.metadata().map_err(failed)?;
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
