//! What can go wrong, in the two kinds that a user has to tell apart: an input that cannot be
//! used (exit status 2) and a check that does not hold (exit status 1).

use crate::text::{Place, lines, shown};
use std::fmt;
use std::path::{Path, PathBuf};

/// A result of anything that reads what a user wrote.
pub type Result<T> = std::result::Result<T, Error>;

/// Why a command ended without doing all that was asked.
#[derive(Debug, Clone, thiserror::Error)]
pub enum Error {
    /// The input cannot be used: exit status 2.
    #[error(transparent)]
    Input(#[from] Box<InputError>),
    /// Everything was done and a check does not hold: exit status 1. The text says which.
    #[error("{}", lines(.0, Place::Screen))]
    Check(String),
    /// Nobody reads the output any more (`| head`), which is no failure: exit status 0.
    #[error("nobody reads the output any more")]
    ReaderGone,
}

impl Error {
    /// The exit status of the process (`docs/manual.md`): 1 = a check does not hold, 2 = the
    /// input cannot be used.
    pub fn exit_status(&self) -> u8 {
        match self {
            Error::Check(_) => 1,
            Error::Input(_) => 2,
            Error::ReaderGone => 0,
        }
    }

    /// The text with the file's base name alone, for results: their bytes do not depend on where the file lies.
    pub fn placeless(&self) -> String {
        match self {
            Error::Check(text) => text.clone(),
            Error::ReaderGone => self.to_string(),
            Error::Input(e) => InputError {
                file: e
                    .file
                    .as_deref()
                    .map(|f| crate::base_name::base_name(f).into()),
                ..(**e).clone()
            }
            .to_string(),
        }
    }
}

/// Where something stands in an input, kept for what is found wrong with it later.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Position {
    /// The file as the user named it.
    pub file: Option<PathBuf>,
    /// 1-based line.
    pub line: Option<usize>,
    /// 1-based column, in characters.
    pub column: Option<usize>,
    /// The text of the line, for the caret.
    pub source_line: Option<String>,
}

/// One thing wrong with an input: what, where, and what to do.
///
/// Printed as `FILE:LINE:COLUMN: error: MESSAGE`, then the line itself with a caret, then
/// `help: HELP`. Everything but the message may be missing.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct InputError {
    /// The file as the user named it.
    pub file: Option<PathBuf>,
    /// 1-based line.
    pub line: Option<usize>,
    /// 1-based column, in characters.
    pub column: Option<usize>,
    /// What is wrong, with the offending value.
    pub message: String,
    /// What to do about it.
    pub help: Option<String>,
    /// The text of the line, for the caret.
    pub source_line: Option<String>,
}

impl InputError {
    /// An error without a place; add one with the builder methods.
    pub fn new(message: impl Into<String>) -> Self {
        InputError {
            message: message.into(),
            ..Self::default()
        }
    }

    /// Names the file.
    pub fn in_file(mut self, file: impl AsRef<Path>) -> Self {
        self.file = Some(file.as_ref().to_path_buf());
        self
    }

    /// Names the 1-based line and column.
    pub fn at(mut self, line: usize, column: usize) -> Self {
        self.line = Some(line);
        self.column = Some(column);
        self
    }

    /// Names the place that was kept.
    pub fn at_position(mut self, position: &Position) -> Self {
        self.file.clone_from(&position.file);
        (self.line, self.column) = (position.line, position.column);
        self.source_line.clone_from(&position.source_line);
        self
    }

    /// The place alone, to be kept.
    pub fn position(self) -> Position {
        Position {
            file: self.file,
            line: self.line,
            column: self.column,
            source_line: self.source_line,
        }
    }

    /// Finds line, column and the line's text from a byte offset into `text`.
    pub fn at_offset(mut self, text: &str, offset: usize) -> Self {
        let mut offset = offset.min(text.len());
        while !text.is_char_boundary(offset) {
            offset -= 1;
        }
        let start = text[..offset].rfind('\n').map_or(0, |p| p + 1);
        self.line = Some(text[..offset].matches('\n').count() + 1);
        self.column = Some(text[start..offset].chars().count() + 1);
        self.source_line = text[start..].lines().next().map(str::to_owned);
        self
    }

    /// Says what to do.
    pub fn help(mut self, help: impl Into<String>) -> Self {
        self.help = Some(help.into());
        self
    }
}

impl From<InputError> for Error {
    fn from(e: InputError) -> Self {
        Error::Input(Box::new(e))
    }
}

impl std::error::Error for InputError {}

impl fmt::Display for InputError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if let Some(file) = &self.file {
            write!(f, "{}:", shown(&file.to_string_lossy(), Place::Screen))?;
        }
        if let Some(line) = self.line {
            write!(f, "{line}:")?;
            if let Some(column) = self.column {
                write!(f, "{column}:")?;
            }
        }
        if self.file.is_some() || self.line.is_some() {
            write!(f, " ")?;
        }
        write!(f, "error: {}", lines(&self.message, Place::Screen))?;
        if let (Some(text), Some(column)) = (&self.source_line, self.column) {
            // A very long line (a capture, a coefficient list) is cut around the caret.
            let skip = column.saturating_sub(60);
            let cut: String = text.chars().skip(skip).take(100).collect();
            let before: String = cut.chars().take(column - 1 - skip).collect();
            let indent = shown(&before, Place::Screen).chars().count() + column
                - 1
                - skip
                - before.chars().count();
            let cut = shown(&cut, Place::Screen);
            write!(f, "\n  | {cut}\n  | {}^", " ".repeat(indent))?;
        }
        if let Some(help) = &self.help {
            write!(f, "\n  help: {}", lines(help, Place::Screen))?;
        }
        Ok(())
    }
}

/// An [`Error`] for an operating-system failure on `path`, such as a missing file.
pub fn io_error(path: impl AsRef<Path>, doing: &str, e: &std::io::Error) -> Error {
    InputError::new(format!("cannot {doing}: {}", cause(e)))
        .in_file(path)
        .help(match e.kind() {
            std::io::ErrorKind::NotFound => "check the path",
            std::io::ErrorKind::PermissionDenied => "check the permissions",
            std::io::ErrorKind::UnexpectedEof | std::io::ErrorKind::InvalidData => {
                "take another copy of the file"
            }
            std::io::ErrorKind::NotADirectory => {
                "a part of this path is a file, where a folder is needed: give another path"
            }
            _ => "check the path and the disk",
        })
        .into()
}

/// What the system said, without the name of a temporary file that nobody knows.
pub fn cause(e: &std::io::Error) -> String {
    let text = e.to_string();
    match text.split_once(" at path \"") {
        Some((cause, _)) => cause.to_owned(),
        None => text,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_temporary_file_is_not_named() {
        let said = "Permission denied (os error 13) at path \"/data/out/.tmpAbC\"";
        let e = std::io::Error::new(std::io::ErrorKind::PermissionDenied, said);
        assert_eq!(
            io_error("out", "write the file", &e).to_string(),
            "out: error: cannot write the file: Permission denied (os error 13)\n  help: check the permissions"
        );
    }

    #[test]
    fn an_offset_becomes_line_column_and_caret() {
        let text = "a = 1\nµb = 2\n";
        let e = InputError::new("bad")
            .in_file("x.toml")
            .at_offset(text, text.find("= 2").unwrap())
            .help("do this");
        assert_eq!((e.line, e.column), (Some(2), Some(4)));
        assert_eq!(
            e.to_string(),
            "x.toml:2:4: error: bad\n  | µb = 2\n  |    ^\n  help: do this"
        );
        let again = InputError::new("worse").at_position(&e.position());
        assert_eq!(
            again.to_string(),
            "x.toml:2:4: error: worse\n  | µb = 2\n  |    ^"
        );
    }
}
