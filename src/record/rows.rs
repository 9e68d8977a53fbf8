//! The output of `replay` (`docs/manual.md`, "Replay and captures"): rows of numbers
//! to CSV or NPY, in the file whole or not at all.

use super::npy_header;
use crate::error::{InputError, Result};
use crate::output::{OutputFile, write_failed};
use std::io::Write;
use std::path::{Path, PathBuf};

/// Bytes gathered before they are written.
const BUFFER_BYTES: usize = 1 << 18;

/// Below it a whole number is exact in an f64 and written without a point.
const WHOLE_LIMIT: u64 = 1 << 53;

/// What the numbers of a file are.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// Raw integers; NPY holds them modulo 2^64 as int64.
    Integer,
    /// Reals; NPY holds float64, CSV the shortest text that reads back as the same f64.
    Float,
}

/// Writes rows to a file that appears under its name only by [`RowWriter::finish`]; dropped
/// before, it leaves nothing, and an existing file as it was. A path that ends in `.npy` gets an
/// NPY array (rows x columns, C order), any other CSV with one header line.
///
/// What is no regular file (`/dev/stdout`, a pipe) is written straight.
pub struct RowWriter {
    path: PathBuf,
    target: OutputFile,
    kind: Kind,
    npy: bool,
    columns: usize,
    rows: u64,
    buffer: Vec<u8>,
}

impl RowWriter {
    /// Opens the output with these column names.
    ///
    /// # Errors
    /// A folder that is missing or cannot be written, an existing file that cannot be written, a
    /// folder of that name, NPY to what is no regular file. Nothing is left behind.
    pub fn create(path: &Path, columns: &[&str], kind: Kind) -> Result<Self> {
        let npy = path
            .extension()
            .is_some_and(|e| e.eq_ignore_ascii_case("npy"));
        let target = OutputFile::open(path)?;
        if npy && target.is_straight() {
            return Err(InputError::new("an NPY file must be a regular file")
                .in_file(path)
                .help("write it into a folder, or write CSV (a name without `.npy`)")
                .into());
        }
        let mut writer = RowWriter {
            path: path.to_path_buf(),
            target,
            kind,
            npy,
            columns: columns.len(),
            rows: 0,
            buffer: Vec::with_capacity(BUFFER_BYTES + 4096),
        };
        if npy {
            writer.buffer = writer.npy_header();
        } else {
            writer.buffer.extend(columns.join(",").bytes());
            writer.buffer.push(b'\n');
        }
        Ok(writer)
    }

    /// Writes one row of raw integers, one a column. A value is written as given, so an unsigned
    /// word is passed as the non-negative number that it is; NPY keeps the lowest 64 bits.
    ///
    /// # Errors
    /// A failed write; a row of the wrong kind or length.
    pub fn write_integers(&mut self, values: &[i128]) -> Result<()> {
        self.check(Kind::Integer, values.len())?;
        if self.npy {
            for &value in values {
                self.buffer.extend((value as i64).to_le_bytes());
            }
            return self.end_row();
        }
        let mut digits = itoa::Buffer::new();
        for &value in values {
            // 64 bits are much faster than 128, and nearly always enough.
            let text = match i64::try_from(value) {
                Ok(value) => digits.format(value),
                Err(_) => digits.format(value),
            };
            self.buffer.extend_from_slice(text.as_bytes());
            self.buffer.push(b',');
        }
        self.end_csv_row()
    }

    /// Writes rows of `columns` raw integers, each after its number from `first` on, as
    /// [`write_integers`](Self::write_integers) does; gives the next row's number.
    ///
    /// # Errors
    /// As [`write_integers`](Self::write_integers).
    pub fn write_numbered_integers(
        &mut self,
        first: u64,
        rows: &[impl Copy + Into<i128>],
        columns: usize,
    ) -> Result<u64> {
        let mut index = first;
        let mut line = Vec::with_capacity(columns + 1);
        for row in rows.chunks_exact(columns.max(1)) {
            if self.npy {
                self.check(Kind::Integer, columns + 1)?;
                self.buffer.reserve(8 * row.len() + 8);
                self.buffer.extend_from_slice(&index.to_le_bytes());
                for &word in row {
                    self.buffer
                        .extend_from_slice(&(word.into() as i64).to_le_bytes());
                }
                self.end_row()?;
            } else {
                line.clear();
                line.push(i128::from(index));
                line.extend(row.iter().map(|&word| word.into()));
                self.write_integers(&line)?;
            }
            index += 1;
        }
        Ok(index)
    }

    /// Writes one row of reals, one a column. In CSV a value is the shortest decimal that reads
    /// back as the same f64; a whole number has no point, a very small or large one an exponent.
    ///
    /// # Errors
    /// A failed write; a row of the wrong kind or length.
    pub fn write_floats(&mut self, values: &[f64]) -> Result<()> {
        self.check(Kind::Float, values.len())?;
        if self.npy {
            for value in values {
                self.buffer.extend(value.to_le_bytes());
            }
            return self.end_row();
        }
        self.put_floats(values)?;
        self.end_csv_row()
    }

    /// The same with a word in the last column. NPY has NaN there.
    ///
    /// # Errors
    /// As [`write_floats`](Self::write_floats).
    pub fn write_floats_and(&mut self, values: &[f64], word: &str) -> Result<()> {
        if self.npy {
            return self.write_floats(&[values, &[f64::NAN]].concat());
        }
        self.check(Kind::Float, values.len() + 1)?;
        self.put_floats(values)?;
        self.buffer.extend_from_slice(word.as_bytes());
        self.buffer.push(b',');
        self.end_csv_row()
    }

    /// Values with a comma behind each.
    fn put_floats(&mut self, values: &[f64]) -> Result<()> {
        let mut digits = itoa::Buffer::new();
        for &value in values {
            let whole = value as i64;
            if whole as f64 == value && whole.unsigned_abs() < WHOLE_LIMIT && whole != 0 {
                self.buffer
                    .extend_from_slice(digits.format(whole).as_bytes());
            } else if value.is_finite() && value != 0.0 {
                // JSON's numbers are the shortest that read back, and made fast.
                serde_json::to_writer(&mut self.buffer, &value)
                    .map_err(|e| write_failed(&self.path, &e.into()))?;
            } else {
                write!(self.buffer, "{value}").map_err(|e| write_failed(&self.path, &e))?;
            }
            self.buffer.push(b',');
        }
        Ok(())
    }

    /// Writes what is left and puts the file under its name.
    ///
    /// # Errors
    /// A failed write; then nothing is left and an existing file stays.
    pub fn finish(mut self) -> Result<()> {
        self.flush()?;
        let header = self.npy.then(|| self.npy_header());
        self.target.finish(header.as_deref())
    }

    fn npy_header(&self) -> Vec<u8> {
        let descr = match self.kind {
            Kind::Integer => "<i8",
            Kind::Float => "<f8",
        };
        npy_header::write(descr, self.rows, self.columns)
    }

    /// Refuses a row that the file cannot have: a mistake of the program.
    fn check(&self, kind: Kind, count: usize) -> Result<()> {
        if kind == self.kind && count == self.columns {
            return Ok(());
        }
        Err(InputError::new(format!(
            "internal mistake: a row of {count} values ({kind:?}) for {} columns ({:?})",
            self.columns, self.kind
        ))
        .in_file(&self.path)
        .into())
    }

    fn end_csv_row(&mut self) -> Result<()> {
        match self.buffer.last_mut() {
            Some(comma) if self.columns > 0 => *comma = b'\n',
            _ => self.buffer.push(b'\n'),
        }
        self.end_row()
    }

    fn end_row(&mut self) -> Result<()> {
        self.rows += 1;
        if self.buffer.len() >= BUFFER_BYTES {
            self.flush()?;
        }
        Ok(())
    }

    fn flush(&mut self) -> Result<()> {
        self.target.write_all(&self.buffer)?;
        self.buffer.clear();
        Ok(())
    }
}
