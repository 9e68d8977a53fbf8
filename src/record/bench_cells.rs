//! The cells of a bench capture's lines, and the names and units of its columns.

/// What the names of the drive's and of the sense's column contain.
pub(super) const WORDS: [[&str; 2]; 2] = [["drive", "drv"], ["sense", "sns"]];

/// Names and units of the columns.
pub(super) struct Named {
    pub(super) names: Vec<String>,
    units: Vec<String>,
}

impl Named {
    pub(super) fn shown(&self, column: usize) -> String {
        match self.names.get(column).filter(|n| !n.is_empty()) {
            Some(name) => format!("column {column}, \"{name}\""),
            None => format!("column {column}"),
        }
    }

    /// The unit of a column, from the line of units or from its name: `CH1 (mV)`, `drive_mv`.
    pub(super) fn unit(&self, column: usize) -> Option<String> {
        let own = self.units.get(column).map(|u| bare(u));
        let name = self.names.get(column).map_or("", String::as_str);
        let inside = name
            .trim_end_matches([')', ']'])
            .rsplit_once(['(', '['])
            .map(|n| bare(n.1));
        let behind = name.rsplit_once('_').map(|n| bare(n.1));
        own.filter(|u| !u.is_empty()).or(inside).or(behind)
    }

    /// Volts that a column's unit is; `None` where it says no voltage.
    pub(super) fn volts(&self, column: usize) -> Option<f64> {
        Some(match self.unit(column)?.as_str() {
            "v" | "volt" | "volts" => 1.0,
            "mv" | "millivolt" | "millivolts" => 1e-3,
            "uv" | "µv" | "μv" => 1e-6,
            _ => return None,
        })
    }

    /// Seconds that a column of times counts in; `None` where it is no such column.
    pub(super) fn seconds(&self, column: usize) -> Option<f64> {
        let name = self.names.get(column)?.to_lowercase();
        let first = name
            .split(|c: char| !c.is_alphabetic())
            .next()
            .unwrap_or("");
        if !["time", "t", "second", "seconds", "x"].contains(&first) {
            return None;
        }
        Some(match self.unit(column).as_deref() {
            Some("ms") => 1e-3,
            Some("us" | "µs" | "μs") => 1e-6,
            Some("ns") => 1e-9,
            Some("s" | "sec" | "second" | "seconds") => 1.0,
            _ if ["time", "t", "second", "seconds"].contains(&name.as_str()) => 1.0,
            _ => return None,
        })
    }
}

/// A unit without brackets, in small letters.
fn bare(unit: &str) -> String {
    unit.trim()
        .trim_matches(['(', ')', '[', ']'])
        .trim()
        .to_lowercase()
}

/// Whether a line says units and no names.
fn is_units(cells: &[String]) -> bool {
    const WORDS: [&str; 20] = [
        "", "s", "ms", "us", "µs", "ns", "sec", "second", "seconds", "sequence", "v", "mv", "uv",
        "volt", "volts", "value", "ampl", "a", "code", "codes",
    ];
    cells.iter().all(|c| WORDS.contains(&bare(c).as_str()))
}

/// The names and the units that stand before the first row.
pub(super) fn names(before: &[&str], separator: u8, width: usize) -> Named {
    let wide: Vec<Vec<String>> = before
        .iter()
        .map(|l| cells(l, separator))
        .filter(|c| c.len() >= width)
        .collect();
    let (units, names) = match wide.as_slice() {
        [.., names, last] if is_units(&last[..width]) && !is_units(&names[..width]) => {
            (last.clone(), names.clone())
        }
        [.., last] => (Vec::new(), last.clone()),
        [] => (Vec::new(), Vec::new()),
    };
    Named { names, units }
}

/// The separator that cuts the middle line into most cells.
pub(super) fn separator(lines: &[&str]) -> u8 {
    let filled: Vec<&&str> = lines.iter().filter(|l| !l.trim().is_empty()).collect();
    let probe = filled.get(filled.len() / 2).map_or("", |l| **l);
    let count = |s: u8| probe.bytes().filter(|b| *b == s).count();
    // A comma beside semicolons or tabs is a decimal one.
    match (count(b';'), count(b'\t')) {
        (0, 0) => b',',
        (_, 0) => b';',
        (0, _) => b'\t',
        (a, b) => {
            if a >= b {
                b';'
            } else {
                b'\t'
            }
        }
    }
}

/// The cells of a line, trimmed and without quotes; empty ones at the end are none.
pub(super) fn cells(line: &str, separator: u8) -> Vec<String> {
    let own = |c: &str| c.trim().trim_matches('"').trim().to_owned();
    let mut out: Vec<String> = line.split(char::from(separator)).map(own).collect();
    while out.last().is_some_and(String::is_empty) {
        out.pop();
    }
    out
}

/// A number, with a decimal comma where commas do not separate.
pub(super) fn number(cell: &str, separator: u8) -> Option<f64> {
    let value: f64 = match separator {
        b',' => cell.parse().ok()?,
        _ => cell.replace(',', ".").parse().ok()?,
    };
    value.is_finite().then_some(value)
}

pub(super) fn numbers(cells: &[String], separator: u8) -> Option<Vec<f64>> {
    let all: Option<Vec<f64>> = cells.iter().map(|c| number(c, separator)).collect();
    all.filter(|n| n.len() >= 2)
}
