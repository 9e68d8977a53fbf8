//! The lines of a record that is held as text, with their numbers.

use super::columns::Line;
use std::path::Path;

/// A text and how its lines end. Lines are found again when a message needs them, not kept: a
/// million of them would weigh as much as half of the numbers in them.
#[derive(Debug, Clone, Copy)]
pub(super) struct Lines<'a> {
    text: &'a str,
    path: &'a Path,
    ending: char,
}

impl<'a> Lines<'a> {
    /// Lines end with LF or CR LF, or, in a text without any LF, with CR.
    pub(super) fn new(text: &'a str, path: &'a Path) -> Self {
        let ending = if text.contains('\n') { '\n' } else { '\r' };
        Lines { text, path, ending }
    }

    /// Those that are not blank.
    pub(super) fn iter(self) -> impl Iterator<Item = Line<'a>> {
        self.all().filter(|line| !line.text.trim().is_empty())
    }

    /// The line of that 1-based number; an empty one beyond the end.
    pub(super) fn at(self, number: usize) -> Line<'a> {
        let found = number.checked_sub(1).and_then(|i| self.all().nth(i));
        found.unwrap_or(Line {
            path: self.path,
            number,
            text: "",
        })
    }

    /// How many there are, blank ones included.
    pub(super) fn count(self) -> usize {
        let ending = self.ending as u8;
        self.text.bytes().filter(|b| *b == ending).count() + 1
    }

    /// True for the last line of a text that does not end with the end of a line.
    pub(super) fn is_cut(self, line: Line<'_>) -> bool {
        !self.text.ends_with(self.ending) && line.number == self.count()
    }

    fn all(self) -> impl Iterator<Item = Line<'a>> {
        let path = self.path;
        let lines = self.text.split(self.ending).enumerate();
        lines.map(move |(i, line)| Line {
            path,
            number: i + 1,
            text: line.trim_end_matches('\r'),
        })
    }
}
