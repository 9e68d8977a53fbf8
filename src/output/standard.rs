//! The standard output: every failed write is an error, but for a reader that has gone away (`| head`).

use super::io_error;
use crate::error::Result;
use std::io::{self, Write};
use std::sync::{Mutex, PoisonError};

/// The first failure.
static FAILED: Mutex<Option<io::Error>> = Mutex::new(None);

/// Prints a line. What fails is kept for [`check`]: what is written to files does not depend on it.
pub fn line(text: &str) {
    keep(writeln!(io::stdout(), "{text}"));
}

/// Says a line on the standard error, where nobody has to listen.
pub fn talk(text: &str) {
    _ = writeln!(io::stderr(), "{text}");
}

/// Everything has been printed, or nobody reads it any more.
///
/// # Errors
/// The first failed write (a full disk).
pub fn check() -> Result<()> {
    keep(io::stdout().flush());
    match &*FAILED.lock().unwrap_or_else(PoisonError::into_inner) {
        Some(e) => Err(io_error("standard output", "write", e)),
        None => Ok(()),
    }
}

/// Keeps the failure of something printed.
pub fn keep(result: io::Result<()>) {
    if let Err(e) = result
        && e.kind() != io::ErrorKind::BrokenPipe
    {
        let mut failed = FAILED.lock().unwrap_or_else(PoisonError::into_inner);
        failed.get_or_insert(e);
    }
}
