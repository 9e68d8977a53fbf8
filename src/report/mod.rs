//! The HTML report.

use crate::error::Result;
use crate::job::outcome::Outcome;

/// A page (in the making).
///
/// # Errors
/// None.
pub fn html(_outcome: &Outcome) -> Result<String> {
    Ok(String::from("<!doctype html><title>gyrogen</title>"))
}
