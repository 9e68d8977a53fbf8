//! A line of comma separated values, with the place of each cell, and the numbers in them.
//!
//! The record's cells are read here rather than with the `csv` crate because every message has to
//! name the character column of a cell, which that crate does not keep. Quotes as in RFC 4180,
//! but a quoted cell ends on the line that it began on.

use std::borrow::Cow;

/// One cell.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Cell<'a> {
    /// Without surrounding blanks and quotes.
    pub text: Cow<'a, str>,
    /// 1-based column of its first character, in characters.
    pub column: usize,
}

/// The cells of a line; on failure the 1-based column of a quote that is not closed.
pub(super) fn split(line: &str) -> Result<Vec<Cell<'_>>, usize> {
    let mut cells = Vec::new();
    let mut rest = line;
    let mut column = 1;
    loop {
        let body = rest.trim_start();
        let mut start = column + rest[..rest.len() - body.len()].chars().count();
        let (text, used) = if let Some(quoted) = body.strip_prefix('"') {
            let (mut text, after) = unquote(quoted).ok_or(start)?;
            let end = after.find(',').unwrap_or(after.len());
            text.push_str(after[..end].trim_end());
            (Cow::Owned(text), rest.len() - after.len() + end)
        } else {
            let end = rest.find(',').unwrap_or(rest.len());
            (Cow::Borrowed(rest[..end].trim()), end)
        };
        if text.is_empty() {
            start = column;
        }
        cells.push(Cell {
            text,
            column: start,
        });
        if used >= rest.len() {
            return Ok(cells);
        }
        column += rest[..used].chars().count() + 1;
        rest = &rest[used + 1..];
    }
}

/// What stands before the closing quote ("" = one quote) and what follows it.
fn unquote(text: &str) -> Option<(String, &str)> {
    let mut out = String::new();
    let mut rest = text;
    loop {
        let at = rest.find('"')?;
        out.push_str(&rest[..at]);
        rest = &rest[at + 1..];
        match rest.strip_prefix('"') {
            Some(more) => {
                out.push('"');
                rest = more;
            }
            None => return Some((out, rest)),
        }
    }
}

/// No reading of an instrument is larger; its square and the sum of many squares are finite.
const LARGEST: f64 = 1e100;
/// What is smaller is 0 as far as any instrument tells; ratios to what is not are finite.
const SMALLEST: f64 = 1e-100;

/// Why a cell cannot be used as a number.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum BadNumber {
    /// Infinite, or too large for a double.
    Infinite,
    /// No instrument reads that much.
    TooLarge,
    /// `1,5`.
    DecimalComma,
    /// A minus sign that is not ASCII.
    Minus,
    /// A number with something after it.
    Unit,
    /// A date or a time of day: `2024-05-01T10:00:00Z`, `10:00:00`.
    Calendar,
    /// Words for "not measured": `NA`, `null`, `-`.
    NotMeasured,
    /// Anything else.
    Other,
}

impl BadNumber {
    /// What to do about it.
    pub(super) fn help(self) -> &'static str {
        match self {
            BadNumber::Infinite => "leave the cell empty, or write nan, if it was not measured",
            BadNumber::TooLarge => {
                "write the reading in the column's unit, or leave the cell empty"
            }
            BadNumber::DecimalComma => {
                "the decimal mark is '.': export the record with decimal points"
            }
            BadNumber::Minus => "write the minus sign as '-' (ASCII)",
            BadNumber::Unit => "the unit belongs in the column's name: leave the number alone here",
            BadNumber::Calendar => {
                "write seconds since the record's start: a time of the calendar is no clock (spreadsheet: (A2-A$2)*86400)"
            }
            BadNumber::NotMeasured => {
                "leave the cell empty, or write nan: empty or nan = not measured"
            }
            BadNumber::Other => "write a number such as -1.5 or 2e-3; empty or nan = not measured",
        }
    }
}

/// What needs no second look: not measured, 0, or of a size that an instrument can tell.
pub(super) fn is_a_reading(value: f64) -> bool {
    value.is_nan() || value == 0.0 || (SMALLEST..=LARGEST).contains(&value.abs())
}

/// The number in a cell; NaN = not measured (empty or `nan`).
pub(super) fn number(text: &str) -> Result<f64, BadNumber> {
    if text.is_empty() {
        return Ok(f64::NAN);
    }
    if let Ok(value) = text.parse::<f64>() {
        return if is_a_reading(value) {
            Ok(value)
        } else if value.abs() < SMALLEST {
            Ok(0.0)
        } else if value.is_infinite() {
            Err(BadNumber::Infinite)
        } else {
            Err(BadNumber::TooLarge)
        };
    }
    let plain = |t: &str| t.parse::<f64>().is_ok();
    Err(if plain(&text.replace(['\u{2212}', '\u{2013}'], "-")) {
        BadNumber::Minus
    } else if text.matches(',').count() == 1 && plain(&text.replace(',', ".")) {
        BadNumber::DecimalComma
    } else if text
        .char_indices()
        .any(|(i, c)| c.is_whitespace() && plain(&text[..i]))
    {
        BadNumber::Unit
    } else if is_of_calendar(text) {
        BadNumber::Calendar
    } else if ["na", "n/a", "null", "none", "-", "--", "#n/a"].contains(&&*text.to_lowercase()) {
        BadNumber::NotMeasured
    } else {
        BadNumber::Other
    })
}

/// Whether a text that is no number is the beginning of one, as where a file was cut: `-`, `.`, `1.5e-`.
pub(super) fn begins_a_number(text: &str) -> bool {
    number(&format!("{text}0")).is_ok()
}

/// Digits with at least two colons, dashes or slashes between them, as dates and times of day have.
fn is_of_calendar(text: &str) -> bool {
    let of_time = |c: char| c.is_ascii_digit() || ":-/.TZ+ ".contains(c);
    let marks = |mark: char| text.matches(mark).count();
    text.starts_with(|c: char| c.is_ascii_digit())
        && text.chars().all(of_time)
        && [':', '-', '/'].into_iter().any(|m| marks(m) >= 2)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cells_know_their_columns() {
        let cells = split("a, \"b,\"\"c\" ,, µ d ,").unwrap();
        let seen: Vec<(&str, usize)> = cells.iter().map(|c| (&*c.text, c.column)).collect();
        assert_eq!(
            seen,
            [("a", 1), ("b,\"c", 4), ("", 13), ("µ d", 15), ("", 20)]
        );
        assert_eq!(split("1, \"x"), Err(4));
        assert_eq!(split("").unwrap().len(), 1);
    }

    #[test]
    fn numbers_and_what_is_none() {
        assert_eq!(number("-1.5e-3"), Ok(-1.5e-3));
        for tiny in ["5e-324", "-1e-101"] {
            assert_eq!(number(tiny), Ok(0.0));
        }
        for missing in ["", "nan", "NaN", "-nan"] {
            assert!(number(missing).unwrap().is_nan(), "{missing}");
        }
        for (text, why) in [
            ("2024-05-01T10:00:00Z", BadNumber::Calendar),
            ("10:00:00.5", BadNumber::Calendar),
            ("01/05/2024", BadNumber::Calendar),
            ("NA", BadNumber::NotMeasured),
            ("-", BadNumber::NotMeasured),
            ("inf", BadNumber::Infinite),
            ("1e999", BadNumber::Infinite),
            ("-2e100", BadNumber::TooLarge),
            ("1,5", BadNumber::DecimalComma),
            ("\u{2212}2", BadNumber::Minus),
            ("25 degC", BadNumber::Unit),
            ("N/A", BadNumber::NotMeasured),
            ("0x1F", BadNumber::Other),
        ] {
            assert_eq!(number(text), Err(why), "{text}");
        }
        for text in ["-", "+", ".", "-.", "1.5e", "1.5e-"] {
            assert!(number(text).is_err() && begins_a_number(text), "{text}");
        }
        for text in ["NA", "n", "1,5", "25 degC", "--", "inf"] {
            assert!(!begins_a_number(text), "{text}");
        }
    }
}
