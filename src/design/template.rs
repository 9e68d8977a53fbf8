//! The embedded default design, which is also what `gyrogen init` writes.

use super::reader;
use super::schema::Design;
use crate::error::Result;

/// The default design, every key commented.
pub const DEFAULT: &str = include_str!("default.toml");

/// The default design as the program sees it. Every key is in its text.
pub fn default_design() -> Result<Design> {
    reader::parse_default(DEFAULT)
}

#[cfg(test)]
#[path = "template_tests.rs"]
mod tests;
