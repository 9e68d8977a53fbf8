//! Whole lines out of a stream, with one bounded buffer, and their places for messages.

use super::capture::HEADER_HELP;
use crate::error::{InputError, Result, io_error};
use std::io::Read;
use std::path::{Path, PathBuf};

/// Bytes asked of the file at a time.
const BUFFER_BYTES: usize = 1 << 18;
/// A longer line is no row of a capture.
const MAX_LINE_BYTES: usize = 1 << 20;

/// One line with its place, for messages.
#[derive(Clone, Copy)]
pub(super) struct Line<'a> {
    pub(super) path: &'a Path,
    pub(super) number: usize,
    /// Without the line end (and the BOM).
    pub(super) bytes: &'a [u8],
}

impl Line<'_> {
    /// An error at a byte offset of this line.
    pub(super) fn refuse(&self, offset: usize, message: &str) -> InputError {
        self.place(offset, InputError::new(message))
    }

    /// Puts the place of a byte offset of this line to an error.
    pub(super) fn place(&self, offset: usize, error: InputError) -> InputError {
        let before = String::from_utf8_lossy(self.bytes.get(..offset).unwrap_or(self.bytes));
        let mut error = error
            .in_file(self.path)
            .at(self.number, before.chars().count() + 1);
        error.source_line = Some(String::from_utf8_lossy(self.bytes).into_owned());
        error
    }
}

/// Whole lines out of a stream, with one bounded buffer.
pub(super) struct Lines {
    path: PathBuf,
    input: Box<dyn Read + Send>,
    buffer: Vec<u8>,
    /// `buffer[start..whole]` are lines not taken yet, each with its `\n`.
    start: usize,
    whole: usize,
    /// `buffer[whole..filled]` is the start of a line.
    filled: usize,
    /// 1-based number of the line at `start`.
    pub(super) number: usize,
    ended: bool,
    /// The file's last byte is no line's end, as where copying or recording was cut short.
    unfinished: bool,
}

impl Lines {
    /// Lines of `input`, which stands at the start of the file `path`.
    pub(super) fn new(path: &Path, input: Box<dyn Read + Send>) -> Self {
        Lines {
            path: path.to_path_buf(),
            input,
            buffer: vec![0; BUFFER_BYTES],
            start: 0,
            whole: 0,
            filled: 0,
            number: 1,
            ended: false,
            unfinished: false,
        }
    }

    /// True if the line taken last is the file's last one and has no end.
    pub(super) fn is_unfinished(&self) -> bool {
        self.unfinished && self.start == self.whole
    }

    /// The lines at hand, read from the file if there are none; empty = the end. The last line
    /// gets the `\n` that it may lack.
    pub(super) fn whole_lines(&mut self) -> Result<&[u8]> {
        if self.start == self.whole {
            self.refill()?;
        }
        Ok(&self.buffer[self.start..self.whole])
    }

    /// As [`Lines::whole_lines`], as many as the buffer holds: for what must be seen before it is taken.
    pub(super) fn ahead(&mut self) -> Result<&[u8]> {
        self.whole_lines()?;
        self.buffer.copy_within(self.start..self.filled, 0);
        self.whole -= self.start;
        self.filled -= self.start;
        self.start = 0;
        while !self.ended && self.filled < self.buffer.len() {
            let count = match self.input.read(&mut self.buffer[self.filled..]) {
                Ok(count) => count,
                Err(e) if e.kind() == std::io::ErrorKind::Interrupted => continue,
                Err(e) => return Err(io_error(&self.path, "read the capture", &e)),
            };
            let fresh = self.filled..self.filled + count;
            self.filled = fresh.end;
            if count == 0 {
                self.ended = true;
                if self.filled > self.whole {
                    self.finish();
                }
            } else if let Some(last) = self.buffer[fresh.clone()].iter().rposition(|&b| b == b'\n')
            {
                self.whole = fresh.start + last + 1;
            }
        }
        Ok(&self.buffer[..self.whole])
    }

    /// Passes over lines of [`Lines::whole_lines`].
    pub(super) fn take(&mut self, bytes: usize, lines: usize) {
        self.start += bytes;
        self.number += lines;
    }

    /// The next line without its line end (`\n` or `\r\n`), `None` = the end.
    pub(super) fn next(&mut self) -> Result<Option<&[u8]>> {
        let bytes = self.whole_lines()?;
        if bytes.is_empty() {
            return Ok(None);
        }
        let length = bytes
            .iter()
            .position(|&b| b == b'\n')
            .unwrap_or(bytes.len() - 1);
        let start = self.start;
        self.take(length + 1, 1);
        let line = &self.buffer[start..start + length];
        Ok(Some(line.strip_suffix(b"\r").unwrap_or(line)))
    }

    /// Gives the last line the end that it lacks.
    fn finish(&mut self) {
        self.buffer.truncate(self.filled);
        self.buffer.push(b'\n');
        self.filled += 1;
        self.whole = self.filled;
        self.unfinished = true;
    }

    fn refill(&mut self) -> Result<()> {
        self.buffer.copy_within(self.whole..self.filled, 0);
        self.filled -= self.whole;
        (self.start, self.whole) = (0, 0);
        while !self.ended {
            if self.filled == self.buffer.len() {
                if self.filled >= MAX_LINE_BYTES {
                    return Err(InputError::new("this line is longer than 1 MiB")
                        .in_file(&self.path)
                        .at(self.number, 1)
                        .help(HEADER_HELP)
                        .into());
                }
                self.buffer.resize(2 * self.filled, 0);
            }
            let count = match self.input.read(&mut self.buffer[self.filled..]) {
                Ok(count) => count,
                Err(e) if e.kind() == std::io::ErrorKind::Interrupted => continue,
                Err(e) => return Err(io_error(&self.path, "read the capture", &e)),
            };
            let fresh = self.filled..self.filled + count;
            self.filled = fresh.end;
            if count == 0 {
                self.ended = true;
                if self.filled > 0 {
                    self.finish();
                }
            } else if let Some(last) = self.buffer[fresh.clone()].iter().rposition(|&b| b == b'\n')
            {
                self.whole = fresh.start + last + 1;
                break;
            }
        }
        Ok(())
    }
}
