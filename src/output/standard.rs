//! The standard output: every failed write is an error, but for a reader that has gone away (`| head`). What would
//! command a terminal or is not seen is written as what it is ([`crate::text`]).

use super::io_error;
use crate::error::Result;
use crate::text::{Place, lines};
use std::fmt;
use std::io::{self, Write};
use std::sync::{Mutex, PoisonError};

/// The first failure.
static FAILED: Mutex<Option<io::Error>> = Mutex::new(None);

/// Prints a line. What fails is kept for [`check`]: what is written to files does not depend on it.
pub fn line(words: fmt::Arguments<'_>) {
    keep(writeln!(io::stdout(), "{}", on_screen(words)));
}

/// Says a line on the standard error, where nobody has to listen.
pub fn talk(words: fmt::Arguments<'_>) {
    _ = writeln!(io::stderr(), "{}", on_screen(words));
}

/// The words as a terminal may have them, users' names and paths among them.
fn on_screen(words: fmt::Arguments<'_>) -> String {
    lines(&words.to_string(), Place::Screen)
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
