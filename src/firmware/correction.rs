//! The correction's step as a bundle.

use super::files::EmittedFile;
use super::stepped::{self, Stepped};
use crate::correction::{Correction, sentences};
use crate::emit::views::Language;
use crate::error::Result;

/// Where an emitted correction comes from.
#[derive(Debug, Clone, Copy)]
pub struct Origin<'a> {
    /// Prefix of every name in C, the crate in Rust: a C identifier.
    pub prefix: &'a str,
    /// SHA-256 of the text of the design that it is emitted from.
    pub sha256: &'a str,
    /// The command that makes it again.
    pub command: &'a str,
}

/// The prefix of the correction in a product of this name, whose chain has the name itself: both link together.
pub fn prefix(name: &str) -> String {
    super::paths::prefix_of(name, "correction")
}

/// Emits a correction in one language, as files in memory: sources, self-test, driver, vectors, manifest.
///
/// # Errors
/// A template that cannot be printed (a fault of the tool).
pub fn emit(
    correction: &Correction,
    origin: &Origin,
    language: Language,
) -> Result<Vec<EmittedFile>> {
    let what = Stepped {
        prefix: origin.prefix,
        program: &correction.trace(),
        model: &|| Box::new(correction.stepper()),
        long_restart: crate::vectors::stimulus::SEGMENT,
        part: "correction",
        called: "once a reading",
        restart: "is 1 at the first reading after power-on and 0 at every other one: 1 says that the power was off before this reading",
        facts: sentences::facts(correction),
        design_sha256: origin.sha256,
        command: origin.command,
    };
    stepped::emit(&what, language)
}
