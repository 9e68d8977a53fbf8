//! What is printed: sentences wrapped to the terminal, tables fitted to it, colour where it asks for that, as much of
//! it as was asked for. Where nobody looks (a pipe, a file) a sentence is one line, a table as wide as it is, and
//! nothing is coloured.

use crate::output::standard;
use crate::text::{Place, lines};
use clap::ValueEnum;
use comfy_table::{CellAlignment, ColumnConstraint, ContentArrangement, Table, Width};
use console::Style;
use std::fmt;
use std::ops::RangeBounds;
use std::sync::atomic::{AtomicU8, Ordering};

/// A line on stdout; what cannot be written is an error at the end, for what is written to files is.
macro_rules! say {
    ($($words:tt)*) => {
        $crate::cli::terminal::say(format_args!($($words)*))
    };
}

/// A line on stderr.
macro_rules! talk {
    ($($words:tt)*) => {
        $crate::cli::terminal::talk(format_args!($($words)*))
    };
}

/// How results are printed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, ValueEnum)]
pub enum OutputFormat {
    /// Tables and sentences.
    #[default]
    Text,
    /// The JSON that is written to the file.
    Json,
}

/// How much is said.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
#[repr(u8)]
pub enum Loudness {
    /// Errors, and what was asked for by name (JSON, a schema, a design).
    Quiet,
    /// Results, warnings and notes.
    Usual,
    /// Each stage of the work too.
    Verbose,
}

static LOUDNESS: AtomicU8 = AtomicU8::new(Loudness::Usual as u8);

/// Sets how much is said from here on.
pub fn set_loudness(loudness: Loudness) {
    LOUDNESS.store(loudness as u8, Ordering::Relaxed);
}

/// Whether as much as this is said.
pub fn is_said(loudness: Loudness) -> bool {
    LOUDNESS.load(Ordering::Relaxed) >= loudness as u8
}

/// Sentences are no wider than this, columns: longer lines are hard to read (convention).
const WIDEST_SENTENCE_COLUMNS: usize = 100;

/// A terminal narrower than this is written to as if it were this wide, columns (convention).
const NARROWEST_TERMINAL_COLUMNS: usize = 24;

/// Columns of the terminal that reads a stream, or those that `COLUMNS` says; `None` where no terminal reads it.
fn columns(terminal: &console::Term) -> Option<usize> {
    let stated = std::env::var("COLUMNS").ok().and_then(|c| c.parse().ok());
    let found = || {
        terminal
            .size_checked()
            .map(|(_, columns)| usize::from(columns))
    };
    let columns = stated.filter(|c| *c > 0).or_else(found)?;
    Some(columns.max(NARROWEST_TERMINAL_COLUMNS))
}

/// The words as a terminal may have them, each line wrapped, what is left of it set in under its beginning.
fn wrapped(words: fmt::Arguments<'_>, terminal: &console::Term) -> String {
    let text = lines(&words.to_string(), Place::Screen);
    let Some(columns) = columns(terminal) else {
        return text;
    };
    let width = columns.min(WIDEST_SENTENCE_COLUMNS);
    let one = |line: &str| {
        let indent = line.len() - line.trim_start().len();
        let next = " ".repeat((indent + 2).min(width / 2));
        let options = textwrap::Options::new(width)
            .subsequent_indent(&next)
            .break_words(false);
        textwrap::fill(line, options)
    };
    text.split('\n').map(one).collect::<Vec<_>>().join("\n")
}

/// The line with the word coloured that says what kind of line it is, where colours are `on`.
fn coloured(line: String, on: bool) -> String {
    let marks = [
        ("error:", Style::new().red()),
        ("check failed:", Style::new().red()),
        ("does not hold", Style::new().red()),
        ("warning:", Style::new().yellow()),
        ("note:", Style::new().cyan()),
        ("holds", Style::new().green()),
    ];
    let first = line.lines().next().unwrap_or_default();
    // `FILE:LINE:COLUMN: error: ...`
    let at = |mark: &str| {
        first
            .find(mark)
            .filter(|k| *k == 0 || first[..*k].ends_with(": "))
    };
    let found = marks
        .iter()
        .find_map(|(mark, style)| Some((at(mark)?, mark, style)));
    match found.filter(|_| on) {
        Some((k, mark, style)) => {
            let styled = style.clone().bold().force_styling(true).apply_to(mark);
            format!("{}{styled}{}", &line[..k], &line[k + mark.len()..])
        }
        None => line,
    }
}

/// A line of a result.
pub fn say(words: fmt::Arguments<'_>) {
    if is_said(Loudness::Usual) {
        let terminal = console::Term::stdout();
        let text = coloured(wrapped(words, &terminal), console::colors_enabled());
        super::stages::aside(|| standard::line(&text));
    }
}

/// A line beside the results: a warning, a note.
pub fn talk(words: fmt::Arguments<'_>) {
    if is_said(Loudness::Usual) {
        complain(words);
    }
}

/// A line that is said however quiet it was to be: an error.
pub fn complain(words: fmt::Arguments<'_>) {
    let terminal = console::Term::stderr();
    let text = coloured(wrapped(words, &terminal), console::colors_enabled_stderr());
    super::stages::aside(|| standard::talk(&text));
}

/// Text that was asked for by name, for a machine or a file: as it is, without its last line end.
pub fn give(text: &str) {
    super::stages::aside(|| standard::line(text.trim_end()));
}

/// A table with a rule under its header.
pub fn table(header: &[&str]) -> Table {
    let rule = comfy_table::LineStyle::none().fill('─').junction('─');
    let mut table = Table::new();
    table.load_style(comfy_table::presets::NOTHING.header_separator(rule));
    table.set_header(header);
    table
}

/// Aligns the columns of numbers to the right.
pub fn numbers(table: &mut Table, columns: impl RangeBounds<usize>) {
    for (k, column) in table.column_iter_mut().enumerate() {
        if columns.contains(&k) {
            column.set_cell_alignment(CellAlignment::Right);
        }
    }
}

/// Prints a table: as wide as it is where that fits, wrapped within its cells where that leaves the columns room, else
/// line by line, a value under its title.
pub fn show(table: &Table) {
    if is_said(Loudness::Usual) {
        let text = fitted(table, columns(&console::Term::stdout()));
        super::stages::aside(|| standard::line(&lines(&text, Place::Screen)));
    }
}

fn widest(text: &str) -> usize {
    text.lines()
        .map(console::measure_text_width)
        .max()
        .unwrap_or(0)
}

fn fitted(table: &Table, columns: Option<usize>) -> String {
    let mut table = table.clone();
    table.set_content_arrangement(ContentArrangement::Disabled);
    let whole = without_blank_ends(&table.to_string());
    let Some(columns) = columns.filter(|c| widest(&whole) > *c) else {
        return whole;
    };
    // No word and no number is broken.
    let words = words_columns(&table);
    if words.iter().sum::<usize>() <= columns {
        for (column, least) in table.column_iter_mut().zip(words) {
            column.set_constraint(ColumnConstraint::LowerBoundary(Width::Fixed(least as u16)));
        }
        table.set_content_arrangement(ContentArrangement::Dynamic);
        table.set_width(columns.min(usize::from(u16::MAX)) as u16);
        return without_blank_ends(&table.to_string());
    }
    by_line(&table)
}

/// Of each column its longest word with a blank on both sides, columns of the terminal.
fn words_columns(table: &Table) -> Vec<usize> {
    let mut longest = vec![0; table.header().map_or(0, |h| h.cell_count())];
    for row in table.header().into_iter().chain(table.row_iter()) {
        for (least, cell) in longest.iter_mut().zip(row.cell_iter()) {
            let content = cell.content();
            let words = content.split_whitespace().map(console::measure_text_width);
            *least = words.chain([*least]).max().unwrap_or(0);
        }
    }
    longest.iter().map(|w| w + 2).collect()
}

fn without_blank_ends(text: &str) -> String {
    let trimmed: Vec<&str> = text.lines().map(str::trim_end).collect();
    trimmed.join("\n")
}

/// Each row by itself: its first cell, below it title and value of the others that have one.
fn by_line(table: &Table) -> String {
    let titles: Vec<String> = table
        .header()
        .into_iter()
        .flat_map(|h| h.cell_iter())
        .map(|c| c.content().replace('\n', ", "))
        .collect();
    let mut out = Vec::new();
    for row in table.row_iter() {
        for (k, cell) in row.cell_iter().enumerate() {
            let content = cell.content();
            let title = titles.get(k).map_or("", String::as_str);
            match (k, content.trim()) {
                (0, content) => out.push(content.to_owned()),
                (_, "") => {}
                (_, content) if title.is_empty() => out.push(format!("  {content}")),
                (_, content) => {
                    let (title, content) = (title.replace('\n', " "), content.replace('\n', "; "));
                    out.push(format!("  {title}: {content}"));
                }
            }
        }
    }
    out.join("\n")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn example() -> Table {
        let mut table = table(&["node", "max error", "bound", "flags"]);
        table.add_row([
            "circuit.demodulator.product sense_i",
            "41.412",
            "41.507",
            "",
        ]);
        numbers(&mut table, 1..3);
        table
    }

    #[test]
    fn a_table_is_as_wide_as_it_is_where_nobody_looks_and_has_one_rule() {
        let text = fitted(&example(), None);
        assert_eq!(text.lines().count(), 3, "{text}");
        assert_eq!(text.lines().filter(|l| l.contains('─')).count(), 1);
        assert!(text.lines().all(|l| l.trim_end() == l));
    }

    #[test]
    fn a_table_is_never_wider_than_the_terminal_and_breaks_no_word() {
        for columns in [40, 50, 60, 80, 200] {
            let text = fitted(&example(), Some(columns));
            assert!(widest(&text) <= columns, "{columns}: {text}");
            for word in ["circuit.demodulator.product", "sense_i", "41.412", "41.507"] {
                assert!(text.contains(word), "{columns}: {text}");
            }
        }
        assert!(fitted(&example(), Some(40)).contains("  bound: 41.507"));
        assert!(fitted(&example(), Some(60)).contains('─'));
        // A title of two lines is one before its value.
        let mut two = table(&["node", "bound\ndeg/s"]);
        two.add_row(["circuit.demodulator.product", "41.507"]);
        assert!(fitted(&two, Some(30)).contains("  bound, deg/s: 41.507"));
    }

    #[test]
    fn the_word_that_names_a_line_is_coloured_where_colours_are_on() {
        let line = "a.toml:3:1: error: no warning: here".to_owned();
        assert_eq!(coloured(line.clone(), false), line);
        let shown = coloured(line.clone(), true);
        assert!(shown.starts_with("a.toml:3:1: \u{1b}["), "{shown:?}");
        assert_eq!(console::strip_ansi_codes(&shown), line);
        let plain = "a terror: none".to_owned();
        assert_eq!(coloured(plain.clone(), true), plain);
    }
}
