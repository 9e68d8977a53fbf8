//! Designs.

use gyrogen::design::{Design, reader};

/// A design from its text.
pub fn design(text: &str) -> Design {
    reader::parse(text, None).expect("a design")
}
