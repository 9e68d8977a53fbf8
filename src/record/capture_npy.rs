//! A capture in NPY: `<i2` or `<i4`, shape (n, 2), C or Fortran order, read in chunks.

use super::capture::{COLUMNS, Codes};
use super::npy_header::{Header, HeaderError};
use crate::error::{InputError, Result, io_error};
use std::fs::File;
use std::io::{Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};

/// Rows decoded at a time: the chunk stays in the second-level cache.
const CHUNK_ROWS: usize = 1 << 15;

/// What helps with items that are not read.
pub(super) fn item_help(descr: &str, otherwise: &str) -> String {
    match descr.trim_start_matches(['<', '>', '|', '=']) {
        "u2" => "unsigned 16-bit codes are offset binary, as a rule: `numpy.save(file, (codes.astype('<i4') - 32768).astype('<i2'))` \
                 (take the code of 0 V in place of 32768)"
            .to_owned(),
        "u4" | "u1" => format!(
            "unsigned codes are offset binary, as a rule: take the code of 0 V (half of the range) off first: \
             `numpy.save(file, (codes.astype('<i8') - {}).astype('<i4'))`",
            if descr.ends_with('4') { 2_147_483_648u32 } else { 128 }
        ),
        _ => otherwise.to_owned(),
    }
}

/// The rows of an NPY capture.
pub(super) struct NpySource {
    path: PathBuf,
    file: File,
    /// Bytes of an item: 2 or 4.
    item: usize,
    fortran_order: bool,
    /// Bytes before the first item.
    start: u64,
    rows: u64,
    /// Rows read so far.
    next: u64,
    codes: Codes,
    chunk: Vec<u8>,
}

impl NpySource {
    /// Reads the header of `file` and checks it and the file's length (`None` = no regular file,
    /// which is refused: the length could not be checked, nor the second column found).
    pub(super) fn open(
        path: &Path,
        mut file: File,
        length: Option<u64>,
        codes: Codes,
    ) -> Result<Self> {
        let refuse = |message: String| {
            InputError::new(format!("this capture cannot be used: {message}"))
                .in_file(path)
                .help(
                    "save a little-endian 16-bit or 32-bit array of shape (n, 2), columns drive \
                     and sense: `numpy.save(file, codes.astype('<i2'))`",
                )
        };
        let failed = |e: std::io::Error| io_error(path, "read the capture", &e);
        let Some(length) = length else {
            return Err(refuse("an NPY capture must be a regular file".into()).into());
        };
        file.rewind().map_err(failed)?;
        let header = Header::read(&mut file).map_err(|e| match e {
            HeaderError::Io(e) => failed(e),
            HeaderError::Wrong(message) => refuse(message).into(),
        })?;
        let item = match header.descr.as_str() {
            "<i2" => 2,
            "<i4" => 4,
            other => {
                let shown = other.escape_debug();
                let mut error = refuse(format!("its items are `{shown}`, not `<i2` or `<i4`"));
                error.help = error.help.map(|help| item_help(other, &help));
                return Err(error.into());
            }
        };
        let [rows, 2] = header.shape[..] else {
            let message = format!("its shape is {:?}, not (n, 2)", header.shape);
            return Err(refuse(message).into());
        };
        let needed = u128::from(rows) * 2 * item as u128;
        let held = u128::from(length.saturating_sub(header.bytes));
        if held != needed {
            let message = match held < needed {
                true => format!("{rows} rows need {needed} bytes, and the file holds {held}"),
                false => format!("{} bytes follow after its {rows} rows", held - needed),
            };
            return Err(refuse(message).into());
        }
        Ok(NpySource {
            path: path.to_path_buf(),
            file,
            item,
            fortran_order: header.fortran_order,
            start: header.bytes,
            rows,
            next: 0,
            codes,
            chunk: Vec::new(),
        })
    }

    /// Rows in the file.
    pub(super) fn rows(&self) -> u64 {
        self.rows
    }

    /// Appends up to `max_rows` rows; fewer = the end, or the error that follows them.
    pub(super) fn read(
        &mut self,
        drive: &mut Vec<i32>,
        sense: &mut Vec<i32>,
        max_rows: usize,
    ) -> Result<()> {
        while drive.len() < max_rows && self.next < self.rows {
            let left = usize::try_from(self.rows - self.next).unwrap_or(usize::MAX);
            let count = CHUNK_ROWS.min(max_rows - drive.len()).min(left);
            let had = drive.len();
            if self.fortran_order {
                let row = self.start + self.next * self.item as u64;
                self.fill(Some(row), count)?;
                self.decode_column(drive);
                self.fill(Some(row + self.rows * self.item as u64), count)?;
                self.decode_column(sense);
            } else {
                self.fill(None, 2 * count)?;
                self.decode_rows(drive, sense);
            }
            self.check(drive, sense, had)?;
            self.next += count as u64;
        }
        Ok(())
    }

    /// Reads `items` items into the chunk, from byte `at` of the file or from where it stands.
    fn fill(&mut self, at: Option<u64>, items: usize) -> Result<()> {
        let bytes = items * self.item;
        if self.chunk.len() != bytes {
            self.chunk.resize(bytes, 0);
        }
        let (file, chunk) = (&mut self.file, &mut self.chunk);
        at.map_or(Ok(0), |at| file.seek(SeekFrom::Start(at)))
            .and_then(|_| file.read_exact(chunk))
            .map_err(|e| io_error(&self.path, "read the capture", &e))
    }

    /// Appends a chunk that holds one column.
    fn decode_column(&self, column: &mut Vec<i32>) {
        match self.item {
            2 => {
                let (items, _) = self.chunk.as_chunks::<2>();
                column.extend(items.iter().map(|&b| i32::from(i16::from_le_bytes(b))));
            }
            _ => {
                let (items, _) = self.chunk.as_chunks::<4>();
                column.extend(items.iter().map(|&b| i32::from_le_bytes(b)));
            }
        }
    }

    /// Appends a chunk that holds rows.
    fn decode_rows(&self, drive: &mut Vec<i32>, sense: &mut Vec<i32>) {
        match self.item {
            2 => {
                // One 32-bit word a row: both codes come out of it by sign-extending shifts.
                let (rows, _) = self.chunk.as_chunks::<4>();
                let words = || rows.iter().map(|&b| i32::from_le_bytes(b));
                drive.extend(words().map(|w| (w << 16) >> 16));
                sense.extend(words().map(|w| w >> 16));
            }
            _ => {
                let (rows, _) = self.chunk.as_chunks::<8>();
                let words = || rows.iter().map(|&b| i64::from_le_bytes(b));
                drive.extend(words().map(|w| w as i32));
                sense.extend(words().map(|w| (w >> 32) as i32));
            }
        }
    }

    /// Refuses the first row from `had` on that has a code outside the range, and takes it and all
    /// after it away.
    fn check(&self, drive: &mut Vec<i32>, sense: &mut Vec<i32>, had: usize) -> Result<()> {
        let Codes { min, max, .. } = self.codes;
        if self.item == 2 && min <= i32::from(i16::MIN) && max >= i32::from(i16::MAX) {
            return Ok(());
        }
        let outside = |&code: &i32| (code < min) | (code > max);
        let fresh = |column: &[i32]| column[had..].iter().fold(false, |any, c| any | outside(c));
        if !fresh(drive) && !fresh(sense) {
            return Ok(());
        }
        let first = |column: &[i32]| {
            let codes = column.iter().copied().enumerate().skip(had);
            codes.into_iter().find(|(_, code)| outside(code))
        };
        // The earliest row; within it drive before sense.
        let found = [first(drive), first(sense)].into_iter().zip(COLUMNS);
        let found = found.filter_map(|(hit, name)| hit.map(|(at, code)| (at, code, name)));
        let Some((at, code, name)) = found.min_by_key(|&(at, ..)| at) else {
            return Ok(());
        };
        drive.truncate(at);
        sense.truncate(at);
        let mut error = self.codes.refuse(&code.to_string(), name);
        let column = usize::from(name != COLUMNS[0]);
        let row = self.next + (at - had) as u64;
        error.message = format!("row {row}, column {column} (from 0): {}", error.message);
        Err(error.in_file(&self.path).into())
    }
}
