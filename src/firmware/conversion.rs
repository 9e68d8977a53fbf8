//! The conversion from the chain's rows to the correction's words as a bundle.

use super::correction::Origin;
use super::files::EmittedFile;
use super::stepped::{self, Stepped};
use crate::correction::Conversion;
use crate::emit::views::Language;
use crate::error::Result;
use crate::vectors::stimulus::SEGMENT;

/// The prefix of the conversion in a product of this name.
pub fn prefix(name: &str) -> String {
    super::paths::prefix_of(name, "conversion")
}

/// Emits a conversion in one language, as files in memory: sources, self-test, driver, vectors, manifest.
///
/// # Errors
/// A template that cannot be printed (a fault of the tool).
pub fn emit(
    conversion: &Conversion,
    origin: &Origin,
    language: Language,
) -> Result<Vec<EmittedFile>> {
    let what = Stepped {
        prefix: origin.prefix,
        program: &conversion.trace(),
        model: &|| Box::new(conversion.stepper()),
        // Two whole readings, and one that is broken off after a row.
        long_restart: SEGMENT.max(2 * u64::from(conversion.rows()) + 1),
        part: "conversion",
        called: "once a row",
        restart: "is 1 at a row that begins a reading anew, after power-on and after rows that are missing, and 0 at every other one",
        facts: conversion.facts(),
        design_sha256: origin.sha256,
        command: origin.command,
    };
    stepped::emit(&what, language)
}
