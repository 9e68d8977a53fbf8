//! A capture in CSV: its own byte parser, a line at a time out of one bounded buffer.

use super::bench_cells;
use super::bench_csv;
use super::bench_keys::{BenchKeys, Scale};
use super::bench_rows;
use super::capture::{COLUMNS, Codes, HEADER_HELP};
use super::capture_header::{Layout, names_a_column, read_comment, read_header, refuse_thermal};
use super::capture_lines::{Line, Lines};
use super::capture_meta::CaptureMeta;
use super::capture_places::Places;
use crate::error::{Error, InputError, Result};
use std::io::Read;
use std::path::{Path, PathBuf};

const BOM: &[u8] = b"\xef\xbb\xbf";

/// The rows of a CSV capture.
pub(super) struct CsvSource {
    path: PathBuf,
    lines: Lines,
    layout: Layout,
    codes: Codes,
    /// How the rows of a bench's file are read; `None`: as those of the contract.
    bench: Option<Bench>,
    /// The first of the empty lines just passed: fine at the end, refused before a row.
    empty_line: Option<usize>,
}

/// What differs in a bench's file.
#[derive(Debug, Clone, Copy)]
struct Bench {
    separator: u8,
    /// Of volts; `None`: the cells are codes.
    scale: Option<Scale>,
}

impl CsvSource {
    /// Reads comments and header from `input`, which stands at the start of the file. A header without the contract's
    /// columns is read as a bench's file: the third says what was chosen.
    pub(super) fn open(
        path: &Path,
        input: Box<dyn Read + Send>,
        codes: Codes,
        places: &mut Places,
    ) -> Result<(Self, CaptureMeta, Vec<String>)> {
        let mut lines = Lines::new(path, input);
        let mut meta = CaptureMeta::default();
        let mut keys = BenchKeys::default();
        let (header, number) = loop {
            let number = lines.number;
            let Some(bytes) = lines.next()? else {
                return Err(InputError::new("the capture has no header line")
                    .in_file(path)
                    .help(HEADER_HELP)
                    .into());
            };
            let line = Line {
                path,
                number,
                bytes: match number {
                    1 => bytes.strip_prefix(BOM).unwrap_or(bytes),
                    _ => bytes,
                },
            };
            match line.bytes.trim_ascii_start().first() {
                None => {}
                Some(b'#') => read_comment(line, &mut meta, &mut keys, places)?,
                Some(_) => break (line.bytes.to_vec(), number),
            }
        };
        let line = Line {
            path,
            number,
            bytes: &header,
        };
        let (layout, bench, notes) = match read_header(line, places) {
            Ok(layout) => (layout, None, Vec::new()),
            Err(e) if names_a_column(&header) || header.contains(&0) => return Err(e),
            Err(e) => {
                let (beside, beside_keys) = CaptureMeta::of_sidecar(path, places)?;
                let keys = keys.or(beside_keys);
                if keys.columns == [None, None] {
                    refuse_thermal(line)?;
                }
                meta = meta.or(beside);
                let mut bytes = header.clone();
                bytes.push(b'\n');
                bytes.extend_from_slice(lines.ahead()?);
                // A unit may be in Latin-1, and names are for messages.
                let text = String::from_utf8_lossy(&bytes);
                let found = bench_csv::table((path, number), &text, &keys, &mut meta)?;
                let Some(table) = found.filter(|table| table.before > 0) else {
                    let why = bench_rows::no_rows((path, number), &text);
                    return Err(why.map_or(e, Error::from));
                };
                // The header's own line is taken already.
                let skipped: Vec<usize> = bytes
                    .split_inclusive(|b| *b == b'\n')
                    .take(table.before)
                    .skip(1)
                    .map(<[u8]>::len)
                    .collect();
                lines.take(skipped.iter().sum(), skipped.len());
                let layout = Layout {
                    cells: table.cells,
                    used: table.used,
                };
                let bench = Bench {
                    separator: table.separator,
                    scale: table.scale,
                };
                (layout, Some(bench), table.notes)
            }
        };
        let source = CsvSource {
            path: path.to_path_buf(),
            lines,
            layout,
            codes,
            bench,
            empty_line: None,
        };
        Ok((source, meta, notes))
    }

    /// Appends up to `max_rows` rows; fewer = the end, or the error that follows them.
    pub(super) fn read(
        &mut self,
        drive: &mut Vec<i32>,
        sense: &mut Vec<i32>,
        max_rows: usize,
    ) -> Result<()> {
        while drive.len() < max_rows {
            let bytes = self.lines.whole_lines()?;
            if bytes.is_empty() {
                return Ok(());
            }
            let (mut used, mut rows) = (0, 0);
            if self.empty_line.is_none() && self.bench.is_none() {
                while drive.len() < max_rows {
                    let Some((d, s, next)) = fast_row(bytes, used, self.layout, self.codes) else {
                        break;
                    };
                    drive.push(d);
                    sense.push(s);
                    used = next;
                    rows += 1;
                }
            }
            let at_end = used == bytes.len();
            self.lines.take(used, rows);
            if at_end || drive.len() == max_rows {
                continue;
            }
            // A row with any peculiarity, or an error: one line the slow way.
            let number = self.lines.number;
            let Some(bytes) = self.lines.next()? else {
                return Ok(());
            };
            if bytes.iter().all(|&b| is_blank(b)) {
                self.empty_line.get_or_insert(number);
                continue;
            }
            let path = self.path.as_path();
            if let Some(number) = self.empty_line {
                let bytes = b"".as_slice();
                return Err(Line {
                    path,
                    number,
                    bytes,
                }
                .refuse(0, "an empty line between rows")
                .help("take the line away, or put the row there that is missing")
                .into());
            }
            let line = Line {
                path,
                number,
                bytes,
            };
            let codes = match self.bench {
                None => slow_row(line, self.layout, self.codes),
                Some(bench) => bench_row(line, self.layout, self.codes, bench),
            };
            let [d, s] = match codes {
                Err(Error::Input(e)) if self.lines.is_unfinished() => {
                    return Err(e.help(CUT_HELP).into());
                }
                codes => codes?,
            };
            drive.push(d);
            sense.push(s);
        }
        Ok(())
    }
}

fn is_blank(b: u8) -> bool {
    b == b' ' || b == b'\t'
}

/// Reads the row that starts at `at`: both codes and the start of the next line. `None` = the row
/// has something that [`slow_row`] must look at, such as an error.
#[inline]
fn fast_row(bytes: &[u8], at: usize, layout: Layout, codes: Codes) -> Option<(i32, i32, usize)> {
    let [drive, sense] = layout.used;
    let (first, second) = (drive.min(sense), drive.max(sense));
    let at = skip_cells(bytes, at, first)?;
    let (a, at) = fast_integer(bytes, at)?;
    if bytes.get(at) != Some(&b',') {
        return None;
    }
    let at = skip_cells(bytes, at, second - first)?;
    let (b, mut at) = fast_integer(bytes, at)?;
    if second + 1 < layout.cells {
        if bytes.get(at) != Some(&b',') {
            return None;
        }
        at = skip_cells(bytes, at, layout.cells - 1 - second)?;
        while !matches!(bytes.get(at)?, b',' | b'\n' | b'\r') {
            at += 1;
        }
    }
    if bytes.get(at) == Some(&b'\r') {
        at += 1;
    }
    if bytes.get(at) != Some(&b'\n') {
        return None;
    }
    let range = i64::from(codes.min)..=i64::from(codes.max);
    if !range.contains(&a) || !range.contains(&b) {
        return None;
    }
    let (d, s) = if drive < sense { (a, b) } else { (b, a) };
    Some((d as i32, s as i32, at + 1))
}

/// The position after `count` more commas; `None` if the line has not so many.
#[inline]
fn skip_cells(bytes: &[u8], mut at: usize, count: usize) -> Option<usize> {
    for _ in 0..count {
        loop {
            match bytes.get(at)? {
                b',' => break,
                b'\n' => return None,
                _ => at += 1,
            }
        }
        at += 1;
    }
    Some(at)
}

/// Blanks, `-?[0-9]{1,18}`, blanks: the number and the position after.
#[inline]
fn fast_integer(bytes: &[u8], mut at: usize) -> Option<(i64, usize)> {
    while is_blank(*bytes.get(at)?) {
        at += 1;
    }
    let negative = *bytes.get(at)? == b'-';
    at += usize::from(negative);
    let start = at;
    let mut value = 0i64;
    loop {
        let digit = bytes.get(at)?.wrapping_sub(b'0');
        if digit > 9 {
            break;
        }
        if at - start >= 18 {
            return None;
        }
        value = value * 10 + i64::from(digit);
        at += 1;
    }
    if at == start {
        return None;
    }
    while is_blank(*bytes.get(at)?) {
        at += 1;
    }
    Some((if negative { -value } else { value }, at))
}

/// Reads any row (without its line end), or says what is wrong with it.
fn slow_row(line: Line<'_>, layout: Layout, codes: Codes) -> Result<[i32; 2]> {
    let mut found = [0; 2];
    let (mut start, mut cells, mut surplus) = (0, 0, 0);
    let mut problem: Option<Error> = None;
    for cell in line.bytes.split(|&b| b == b',') {
        if cells == layout.cells {
            surplus = start;
        }
        if let Some(column) = layout.used.iter().position(|&used| used == cells) {
            match read_cell(line, start, cell, COLUMNS[column], codes) {
                Ok(code) => found[column] = code,
                Err(e) => problem = problem.or(Some(e)),
            }
        }
        cells += 1;
        start += cell.len() + 1;
    }
    if cells != layout.cells {
        let at = match cells > layout.cells {
            true => surplus,
            false => line.bytes.len(),
        };
        let plural = if cells == 1 { "" } else { "s" };
        return Err(line
            .refuse(
                at,
                &format!(
                    "this row has {cells} cell{plural}, the header has {}",
                    layout.cells
                ),
            )
            .help(format!(
                "every row has as many cells as the header; {ROW_HELP}"
            ))
            .into());
    }
    problem.map_or(Ok(found), Err)
}

/// Reads a row of a bench's file: blank cells at its end are none, and of the others there are no more than the header
/// has.
fn bench_row(line: Line<'_>, layout: Layout, codes: Codes, bench: Bench) -> Result<[i32; 2]> {
    let text = String::from_utf8_lossy(line.bytes);
    let cells = bench_cells::cells(&text, bench.separator);
    let start = |cell: usize| -> usize {
        let cells = line.bytes.split(|b| *b == bench.separator).take(cell);
        cells.map(|c| c.len() + 1).sum()
    };
    if cells.len() > layout.cells {
        let message = format!(
            "this row has {} cells, the table {}",
            cells.len(),
            layout.cells
        );
        return Err(line
            .refuse(start(layout.cells), &message)
            .help(ROW_HELP)
            .into());
    }
    let mut found = [0; 2];
    for ((out, column), name) in found.iter_mut().zip(layout.used).zip(COLUMNS) {
        let cell = cells.get(column).map_or("", String::as_str);
        let shown = shorten(cell.as_bytes());
        let refuse = |message: &str| line.refuse(start(column).min(line.bytes.len()), message);
        let Some(value) = bench_cells::number(cell, bench.separator) else {
            let (message, help) = no_reading(cell, name, "finite number");
            return Err(refuse(&message).help(help).into());
        };
        let code = match bench.scale {
            Some(scale) => scale.code(value),
            None if value.fract() != 0.0 => {
                let message = format!("{name} `{shown}` is no integer");
                let help = "a code is a whole number; for volts write `volts_per_code` into the side-car or a comment line";
                return Err(refuse(&message).help(help).into());
            }
            None => Some(value)
                .filter(|v| v.abs() <= f64::from(i32::MAX))
                .map(|v| v as i32),
        };
        let told = match (bench.scale, code) {
            (Some(_), Some(code)) => format!("{shown} (code {code})"),
            _ => shown,
        };
        *out = code
            .filter(|code| (codes.min..=codes.max).contains(code))
            .ok_or_else(|| line.place(start(column), codes.refuse(&told, name)))?;
    }
    Ok(found)
}

/// Remedy for a row of a capture that cannot be read.
const ROW_HELP: &str = "repair the row. The rows are samples at one rate, so that none in the middle can be left out: else use the \
                        part before it, or the part behind it, as a capture of its own";

/// Remedy for a number that is no code, below a name that says that there are codes.
const VOLTS_HELP: &str = "a code is written in digits alone, with a `-` where it is negative. If the columns hold volts, call them `drive` and `sense` and write \
                          `volts_per_code` into the side-car or a comment line";

/// A cell that holds no `wanted`: message and remedy.
fn no_reading(cell: &str, name: &str, wanted: &str) -> (String, String) {
    if bench_rows::is_mark(cell) {
        return (
            format!("{name} is `{cell}`: the instrument was overloaded here, or had no reading"),
            "capture again with a larger range. The rows are samples at one rate, so that none in the middle can be left out: else \
             use the part before this row, or the part behind the last such row, as a capture of its own"
                .to_owned(),
        );
    }
    let message = match cell.is_empty() {
        true => format!("the cell of {name} is empty"),
        false => format!("{name} `{cell}` is no {wanted}"),
    };
    let help = match cell.parse().is_ok_and(f64::is_finite) {
        true => VOLTS_HELP,
        false => ROW_HELP,
    };
    (message, help.to_owned())
}

/// Remedy for a last row that cannot be read and lacks the end of its line.
const CUT_HELP: &str = "the file ends here, in the middle of a line: if copying or recording was cut short, do it again; else repair \
                        this last row or take it away";

/// Reads one cell that is used; `start` is its byte offset in the line.
fn read_cell(line: Line<'_>, start: usize, cell: &[u8], name: &str, codes: Codes) -> Result<i32> {
    let lead = cell.iter().take_while(|&&b| is_blank(b)).count();
    let tail = cell.iter().rev().take_while(|&&b| is_blank(b)).count();
    let text = cell
        .get(lead..cell.len().saturating_sub(tail))
        .unwrap_or(b"");
    let shown = shorten(text);
    let digits = text.strip_prefix(b"-").unwrap_or(text);
    if digits.is_empty() || !digits.iter().all(u8::is_ascii_digit) {
        let (message, help) = no_reading(&shown, name, "integer (`-?[0-9]+`)");
        let at = if text.is_empty() { start } else { start + lead };
        return Err(line.refuse(at, &message).help(help).into());
    }
    let size = digits.iter().fold(0i64, |v, b| {
        v.saturating_mul(10).saturating_add(i64::from(b - b'0'))
    });
    let value = if digits.len() < text.len() {
        -size
    } else {
        size
    };
    i32::try_from(value)
        .ok()
        .filter(|code| (codes.min..=codes.max).contains(code))
        .ok_or_else(|| line.place(start + lead, codes.refuse(&shown, name)).into())
}

/// Text for a message, cut to a readable length.
fn shorten(text: &[u8]) -> String {
    let text = String::from_utf8_lossy(text);
    let mut shown: String = text.chars().take(40).collect();
    if shown.len() < text.len() {
        shown.push('…');
    }
    shown
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::numeric::format::Format;
    use proptest::prelude::*;

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(4000))]

        #[test]
        fn what_the_fast_way_accepts_the_slow_way_reads_the_same(
            bytes in prop::collection::vec(
                prop::sample::select(b"0123456789012345678999,,,,,--  \t\rx".as_slice()), 0..14),
            cells in 2usize..5, first in 0usize..5, second in 0usize..4,
        ) {
            let used = [first % cells, (first + 1 + second % (cells - 1)) % cells];
            let (layout, codes) = (Layout { cells, used }, Codes::of(Format::q(1, 15)));
            let whole = [bytes.as_slice(), b"\n1,2,3,4,5\n"].concat();
            let line = Line {
                path: Path::new("x.csv"),
                number: 2,
                bytes: bytes.strip_suffix(b"\r").unwrap_or(&bytes),
            };
            let slow = slow_row(line, layout, codes).ok();
            if let Some((d, s, next)) = fast_row(&whole, 0, layout, codes) {
                prop_assert_eq!(slow, Some([d, s]));
                prop_assert_eq!(next, bytes.len() + 1);
            } else if !bytes.contains(&b'\r') {
                // No number here is too long for the fast way.
                prop_assert_eq!(slow, None);
            }
        }
    }
}
