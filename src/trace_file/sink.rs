//! A file that a trace is written to.

use crate::error::Result;
use crate::output::OutputFile;
use std::path::Path;

/// Bytes gathered before they are written.
const BUFFER_BYTES: usize = 1 << 18;

/// Text on its way to a file.
pub(super) struct Sink {
    pub(super) file: OutputFile,
    pub(super) buffer: Vec<u8>,
}

impl Sink {
    pub(super) fn open(path: &Path) -> Result<Self> {
        Ok(Sink {
            file: OutputFile::open(path)?,
            buffer: Vec::with_capacity(BUFFER_BYTES + 4096),
        })
    }

    pub(super) fn text(&mut self, text: &str) {
        self.buffer.extend_from_slice(text.as_bytes());
    }

    pub(super) fn integer(&mut self, value: impl itoa::Integer) {
        self.text(itoa::Buffer::new().format(value));
    }

    /// The shortest decimal that reads back as the same f64, with an exponent if very small or
    /// large; `NaN`, `inf`, `-inf`.
    pub(super) fn real(&mut self, value: f64) {
        self.text(&format!("{value:?}"));
    }

    /// Called now and then: writes what has gathered, if it is much.
    pub(super) fn pass_on(&mut self) -> Result<()> {
        if self.buffer.len() >= BUFFER_BYTES {
            self.file.write_all(&self.buffer)?;
            self.buffer.clear();
        }
        Ok(())
    }

    pub(super) fn finish(mut self) -> Result<()> {
        self.file.write_all(&self.buffer)?;
        self.file.finish(None)
    }
}
