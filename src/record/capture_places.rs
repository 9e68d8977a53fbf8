//! Where the keys and the columns of a capture stand, for what is seen in them later.

use crate::error::{InputError, Position};
use std::collections::BTreeMap;

/// Places by the name of a key or of a column.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Places(BTreeMap<String, Position>);

impl Places {
    /// Keeps a place.
    pub(super) fn keep(&mut self, name: &str, place: Position) {
        self.0.insert(name.to_owned(), place);
    }

    /// Whether a name has a place.
    pub fn knows(&self, name: &str) -> bool {
        self.0.contains_key(name)
    }

    /// The error with file, line and column of a name; as it is where the name has no place (an NPY capture has no
    /// header, a key may be missing).
    pub fn put(&self, name: &str, error: InputError) -> InputError {
        match self.0.get(name) {
            Some(place) => error.at_position(place),
            None => error,
        }
    }
}
