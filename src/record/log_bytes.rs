//! What the two log formats share below their messages: numbers in little-endian bytes, and a
//! file that is read message by message with the place of each byte.
//!
//! Both readers are written here rather than taken from a crate: of those at hand each panics or
//! is silent on some damaged file, and a log that ends where its battery did is the usual one.

use crate::error::{Error, InputError, Result, io_error};
use std::io::Read;
use std::path::Path;

/// A number in a message.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Scalar {
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    I64,
    U64,
    F32,
    F64,
}

impl Scalar {
    /// Bytes that it takes.
    pub(super) fn size(self) -> usize {
        match self {
            Scalar::I8 | Scalar::U8 => 1,
            Scalar::I16 | Scalar::U16 => 2,
            Scalar::I32 | Scalar::U32 | Scalar::F32 => 4,
            Scalar::I64 | Scalar::U64 | Scalar::F64 => 8,
        }
    }

    /// The number at `offset`; `None` beyond the end.
    pub(super) fn read(self, bytes: &[u8], offset: usize) -> Option<f64> {
        let tail = bytes.get(offset..)?;
        Some(match self {
            Scalar::I8 => f64::from(i8::from_le_bytes(*tail.first_chunk()?)),
            Scalar::U8 => f64::from(u8::from_le_bytes(*tail.first_chunk()?)),
            Scalar::I16 => f64::from(i16::from_le_bytes(*tail.first_chunk()?)),
            Scalar::U16 => f64::from(u16::from_le_bytes(*tail.first_chunk()?)),
            Scalar::I32 => f64::from(i32::from_le_bytes(*tail.first_chunk()?)),
            Scalar::U32 => f64::from(u32::from_le_bytes(*tail.first_chunk()?)),
            Scalar::F32 => f64::from(f32::from_le_bytes(*tail.first_chunk()?)),
            Scalar::I64 => i64::from_le_bytes(*tail.first_chunk()?) as f64,
            Scalar::U64 => u64::from_le_bytes(*tail.first_chunk()?) as f64,
            Scalar::F64 => f64::from_le_bytes(*tail.first_chunk()?),
        })
    }
}

/// A log file, read forward.
pub(super) struct Stream<'a, R: Read> {
    /// As the user named it.
    pub path: &'a Path,
    /// Bytes that have been read.
    pub offset: u64,
    input: R,
}

impl<'a, R: Read> Stream<'a, R> {
    /// `input` is best buffered: it is asked for few bytes at a time.
    pub(super) fn new(path: &'a Path, input: R) -> Self {
        Stream {
            path,
            offset: 0,
            input,
        }
    }

    /// Fills `buffer` with the next `count` bytes, or with those that are left.
    ///
    /// # Errors
    /// A failed read; the file's end is none.
    pub(super) fn take(&mut self, buffer: &mut Vec<u8>, count: usize) -> Result<()> {
        buffer.resize(count, 0);
        let mut have = 0;
        while let Some(rest) = buffer.get_mut(have..)
            && !rest.is_empty()
        {
            match self.input.read(rest) {
                Ok(0) => break,
                Ok(n) => have += n,
                Err(e) if e.kind() == std::io::ErrorKind::Interrupted => {}
                Err(e) => return Err(io_error(self.path, "read the log", &e)),
            }
        }
        buffer.truncate(have);
        self.offset += have as u64;
        Ok(())
    }

    /// The next byte; `None` at the end.
    ///
    /// # Errors
    /// A failed read.
    pub(super) fn byte(&mut self) -> Result<Option<u8>> {
        let mut one = [0];
        loop {
            match self.input.read(&mut one) {
                Ok(0) => return Ok(None),
                Ok(_) => {
                    self.offset += 1;
                    return Ok(Some(one[0]));
                }
                Err(e) if e.kind() == std::io::ErrorKind::Interrupted => {}
                Err(e) => return Err(io_error(self.path, "read the log", &e)),
            }
        }
    }

    /// An error that names the byte at which the log cannot be read on.
    pub(super) fn broken(&self, at: u64, what: &str, help: &str) -> Error {
        InputError::new(format!("{what} (byte {at})"))
            .in_file(self.path)
            .help(help)
            .into()
    }
}

/// What could not be read of a log that could be read all the same.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(super) struct Damage {
    /// Byte at which the first unreadable stretch begins.
    pub first: u64,
    /// Number of such stretches.
    pub stretches: u64,
    /// Bytes in them.
    pub bytes: u64,
    /// Whether the file ends within a message.
    pub cut: bool,
}

impl Damage {
    /// Notes the bytes from `from` to `to` as unreadable.
    pub(super) fn note(&mut self, from: u64, to: u64) {
        if self.stretches == 0 {
            self.first = from;
        }
        self.stretches += 1;
        self.bytes += to.saturating_sub(from);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_read_where_they_are_and_nowhere_else() {
        let bytes = [0xFF, 0xFE, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0x7F];
        for (scalar, offset, value) in [
            (Scalar::I8, 1, -2.0),
            (Scalar::U8, 1, 254.0),
            (Scalar::I16, 1, -2.0),
            (Scalar::U16, 0, 65279.0),
            (Scalar::I32, 1, -2.0),
            (Scalar::U32, 1, 4_294_967_294.0),
            (Scalar::I64, 1, 9_223_372_036_854_775_806.0),
        ] {
            assert_eq!(scalar.read(&bytes, offset), Some(value), "{scalar:?}");
            let last = bytes.len() - scalar.size();
            assert!(scalar.read(&bytes, last).is_some());
            assert_eq!(scalar.read(&bytes, last + 1), None);
            assert_eq!(scalar.read(&bytes, usize::MAX), None);
        }
        assert_eq!(Scalar::F32.read(&1.5f32.to_le_bytes(), 0), Some(1.5));
        assert_eq!(Scalar::F64.read(&(-2.5f64).to_le_bytes(), 0), Some(-2.5));
    }
}
