//! Where the keys and the columns of a capture stand, for what is seen in them later.

use crate::error::InputError;
use std::collections::BTreeMap;

/// Places by the name of a key or of a column.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Places(BTreeMap<String, InputError>);

impl Places {
    /// Keeps the place that an error without a message has.
    pub(super) fn keep(&mut self, name: &str, place: InputError) {
        self.0.insert(name.to_owned(), place);
    }

    /// Whether a name has a place.
    pub fn knows(&self, name: &str) -> bool {
        self.0.contains_key(name)
    }

    /// The error with file, line and column of a name; as it is where the name has no place (an NPY capture has no
    /// header, a key may be missing).
    pub fn put(&self, name: &str, mut error: InputError) -> InputError {
        if let Some(place) = self.0.get(name) {
            error.file.clone_from(&place.file);
            (error.line, error.column) = (place.line, place.column);
            error.source_line.clone_from(&place.source_line);
        }
        error
    }
}
