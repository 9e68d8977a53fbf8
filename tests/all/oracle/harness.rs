//! Runs the binary under test and reads what it writes.

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use super::design::Design;
use super::fixed::Row;

/// The binary under test: the one of this package, or the file that the
/// environment variable `GYROGEN_BINARY` names.
pub fn binary() -> String {
    let own = option_env!("CARGO_BIN_EXE_gyrogen");
    std::env::var("GYROGEN_BINARY")
        .ok()
        .or(own.map(str::to_owned))
        .expect("integration tests know the path of the binary")
}

/// The result of one run of the tool.
pub struct Run {
    /// Exit status; `None` = killed by a signal.
    pub status: Option<i32>,
    pub stderr: String,
}

impl Run {
    /// Runs `gyrogen replay DESIGN --capture FILE --out FILE [--arith ARITH]`.
    pub fn replay(design: &Path, capture: &Path, out: &Path, arith: Option<&str>) -> Self {
        let mut command = Command::new(binary());
        command.arg("replay").arg(design);
        command.arg("--capture").arg(capture);
        command.arg("--out").arg(out);
        if let Some(arith) = arith {
            command.args(["--arith", arith]);
        }
        Self::of(&command.output().expect("the binary under test starts"))
    }

    fn of(output: &Output) -> Self {
        Self {
            status: output.status.code(),
            stderr: String::from_utf8_lossy(&output.stderr).into_owned(),
        }
    }

    /// Nothing of a panic in the messages.
    pub fn no_panic(&self) -> Result<(), String> {
        if self.stderr.contains("panicked") || self.status.is_none() {
            return Err(format!("a panic:\n{}", self.stderr));
        }
        Ok(())
    }

    /// The exit status is `wanted`, and no panic.
    pub fn expect_status(&self, wanted: i32) -> Result<(), String> {
        self.no_panic()?;
        if self.status == Some(wanted) {
            return Ok(());
        }
        let status = self.status;
        let stderr = &self.stderr;
        Err(format!(
            "exit status {status:?} where {wanted} is due; stderr:\n{stderr}"
        ))
    }

    /// All the integers that stand in stderr.
    pub fn integers(&self) -> Vec<i128> {
        integers_in(&self.stderr)
    }
}

/// Every maximal run of digits, with its minus sign, as an integer. A run that
/// follows a letter, a digit with a point, or a point is read too.
pub fn integers_in(text: &str) -> Vec<i128> {
    let bytes = text.as_bytes();
    let mut found = Vec::new();
    let mut at = 0;
    while at < bytes.len() {
        if !bytes[at].is_ascii_digit() {
            at += 1;
            continue;
        }
        let start = at;
        while at < bytes.len() && bytes[at].is_ascii_digit() {
            at += 1;
        }
        let negative = start > 0 && bytes[start - 1] == b'-';
        let first = if negative { start - 1 } else { start };
        found.extend(text[first..at].parse::<i128>().ok());
    }
    found
}

/// A scratch folder with a design, a capture and the output of one case.
///
/// It removes itself unless `keep` is called.
pub struct Case {
    folder: tempfile::TempDir,
    capture_name: &'static str,
}

impl Case {
    /// Writes the design and the capture.
    pub fn new(design: &str, capture_name: &'static str, capture: &[u8]) -> Self {
        let folder = tempfile::Builder::new()
            .prefix("gyrogen-test-")
            .tempdir()
            .expect("a scratch folder");
        let case = Self {
            folder,
            capture_name,
        };
        std::fs::write(case.design(), design).expect("a writable folder");
        std::fs::write(case.capture(), capture).expect("a writable folder");
        case
    }

    /// A file of this folder.
    pub fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    /// The design file.
    pub fn design(&self) -> PathBuf {
        self.path("design.toml")
    }

    /// The capture file.
    pub fn capture(&self) -> PathBuf {
        self.path(self.capture_name)
    }

    /// Runs the binary; the output is `name` in this folder.
    pub fn run(&self, name: &str, arith: Option<&str>) -> Run {
        Run::replay(&self.design(), &self.capture(), &self.path(name), arith)
    }

    /// The text of an output file.
    pub fn read(&self, name: &str) -> Result<String, String> {
        std::fs::read_to_string(self.path(name)).map_err(|error| format!("{name}: {error}"))
    }

    /// The names of the files in the folder, sorted.
    pub fn files(&self) -> Vec<String> {
        let entries = std::fs::read_dir(self.folder.path()).expect("a readable folder");
        let mut names: Vec<String> = entries
            .map(|entry| entry.expect("a readable folder").file_name())
            .map(|name| name.to_string_lossy().into_owned())
            .collect();
        names.sort();
        names
    }

    /// Only the design and the capture are there: no output, whole or half.
    pub fn expect_no_output(&self) -> Result<(), String> {
        let files = self.files();
        let left: Vec<&String> = files
            .iter()
            .filter(|name| *name != "design.toml" && *name != self.capture_name)
            .collect();
        if left.is_empty() {
            Ok(())
        } else {
            Err(format!("files that should not be there: {left:?}"))
        }
    }

    /// Leaves the folder for inspection and gives its path.
    pub fn keep(self) -> PathBuf {
        self.folder.keep()
    }
}

/// The CSV text that a fixed replay writes.
pub fn expected_csv(design: &Design, rows: &[Row]) -> String {
    let mut text = design.columns().join(",");
    text.push('\n');
    for (index, row) in rows.iter().enumerate() {
        let cells: Vec<String> = row.values(index).iter().map(ToString::to_string).collect();
        text.push_str(&cells.join(","));
        text.push('\n');
    }
    text
}

/// The first difference of two CSV texts, as a message.
pub fn compare_text(expected: &str, found: &str) -> Result<(), String> {
    if expected == found {
        return Ok(());
    }
    let mut names: Vec<&str> = Vec::new();
    let (mut left, mut right) = (expected.split('\n'), found.split('\n'));
    for line in 1.. {
        let (a, b) = match (left.next(), right.next()) {
            (None, None) => break,
            (a, b) => (a.unwrap_or("(end)"), b.unwrap_or("(end)")),
        };
        if line == 1 {
            names = a.split(',').collect();
        }
        if a == b {
            continue;
        }
        let cells = a.split(',').zip(b.split(','));
        let column = cells.into_iter().position(|(x, y)| x != y).unwrap_or(0);
        let name = names.get(column).copied().unwrap_or("?");
        return Err(format!(
            "first difference in line {line}, column {name}:\n  expected {a}\n  found    {b}"
        ));
    }
    Err("the texts differ in their line ends".to_owned())
}

/// Reads a CSV of real numbers, checking its header.
pub fn read_real_csv(text: &str, columns: &[&str]) -> Result<Vec<Vec<f64>>, String> {
    let body = text
        .strip_suffix('\n')
        .ok_or("the last line has no end".to_owned())?;
    let mut lines = body.split('\n');
    let header = lines.next().unwrap_or_default();
    if header != columns.join(",") {
        return Err(format!("header {header:?}"));
    }
    lines
        .map(|line| {
            let cells: Result<Vec<f64>, _> = line.split(',').map(str::parse).collect();
            match cells {
                Ok(cells) if cells.len() == columns.len() => Ok(cells),
                _ => Err(format!("a row that is not readable: {line:?}")),
            }
        })
        .collect()
}

/// An NPY array of 8-byte values.
pub struct Npy {
    pub descr: String,
    pub rows: usize,
    pub columns: usize,
    /// The bits of the values, row by row.
    pub words: Vec<u64>,
}

/// Reads an output NPY: `<i8` or `<f8`, two-dimensional.
pub fn read_npy(bytes: &[u8]) -> Result<Npy, String> {
    let take = |range: std::ops::Range<usize>| bytes.get(range).ok_or("too short".to_owned());
    if take(0..6)? != b"\x93NUMPY" {
        return Err("no magic".to_owned());
    }
    let (start, length) = if take(6..7)? == [1] {
        let field = take(8..10)?;
        (10, u16::from_le_bytes([field[0], field[1]]) as usize)
    } else {
        let field = take(8..12)?;
        let length = u32::from_le_bytes([field[0], field[1], field[2], field[3]]);
        (12, length as usize)
    };
    let header = String::from_utf8_lossy(take(start..start + length)?).into_owned();
    let descr = ["<i8", "<f8"]
        .into_iter()
        .find(|name| header.contains(name))
        .ok_or(format!("dtype in {header:?}"))?;
    let shape = header
        .split_once('(')
        .and_then(|(_, rest)| rest.split_once(')'))
        .map(|(inside, _)| integers_in(inside))
        .unwrap_or_default();
    let &[rows, columns] = shape.as_slice() else {
        return Err(format!("shape in {header:?}"));
    };
    let (rows, columns) = (rows as usize, columns as usize);
    let data = &bytes[start + length..];
    if data.len() != rows * columns * 8 {
        return Err(format!("{} bytes of data for {shape:?}", data.len()));
    }
    let mut words: Vec<u64> = data
        .chunks_exact(8)
        .map(|chunk| u64::from_le_bytes(chunk.try_into().expect("8 bytes")))
        .collect();
    if header.contains("True") {
        let by_column = words.clone();
        for (at, word) in words.iter_mut().enumerate() {
            *word = by_column[(at % columns) * rows + at / columns];
        }
    }
    Ok(Npy {
        descr: descr.to_owned(),
        rows,
        columns,
        words,
    })
}

/// A number from the environment.
pub fn setting(name: &str, default: u64) -> u64 {
    match std::env::var(name) {
        Ok(text) => text
            .trim()
            .parse()
            .unwrap_or_else(|_| panic!("{name} is not a whole number: {text:?}")),
        Err(_) => default,
    }
}
