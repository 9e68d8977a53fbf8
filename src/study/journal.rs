//! What has run so far, in a file beside the results: a study that was killed goes on where it was, and gives the
//! bytes of one that was not. The file goes away with the end of the study.
//!
//! A line is a design: its lengths, and the bits of its figures. Its first line is the plan's hash; a journal of
//! another plan, or of another version, is not looked at. A last line without its end was being written: it is dropped.

use super::bench::Trial;
use super::figures::Figures;
use super::space::Lengths;
use crate::error::{Result, io_error};
use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::fs::{File, OpenOptions};
use std::io::Write as _;
use std::path::{Path, PathBuf};

/// The file's name.
pub const NAME: &str = "study.journal";

/// An open journal.
#[derive(Debug)]
pub struct Journal {
    path: PathBuf,
    file: File,
}

/// Numbers of a figure line.
const NUMBERS: usize = 9;

impl Journal {
    /// Opens the journal of a plan in a folder; with it what it knows.
    ///
    /// # Errors
    /// A file that cannot be read or written.
    pub fn open(folder: &Path, hash: &str) -> Result<(Journal, BTreeMap<Lengths, Trial>)> {
        let path = folder.join(NAME);
        let head = format!("gyrogen.study.journal/1 {hash}\n");
        let text = std::fs::read_to_string(&path).unwrap_or_default();
        let mut known = BTreeMap::new();
        let mut kept = head.clone();
        if let Some(lines) = text.strip_prefix(&head) {
            for line in lines.split_inclusive('\n') {
                match line.strip_suffix('\n').and_then(read) {
                    Some((lengths, trial)) => known.insert(lengths, trial),
                    None => break,
                };
                kept += line;
            }
        }
        let failed = |e: std::io::Error| io_error(&path, "write", &e);
        if kept != text {
            crate::output::write_whole(&path, kept.as_bytes())?;
        }
        let file = OpenOptions::new()
            .append(true)
            .open(&path)
            .map_err(failed)?;
        Ok((Journal { path, file }, known))
    }

    /// Adds trials.
    ///
    /// # Errors
    /// A file that cannot be written.
    pub fn append(&mut self, lengths: &[Lengths], trials: &[Trial]) -> Result<()> {
        let lines: String = lengths
            .iter()
            .zip(trials)
            .map(|(l, t)| line(l, t))
            .collect();
        let failed = |e: std::io::Error| io_error(&self.path, "write", &e);
        self.file.write_all(lines.as_bytes()).map_err(failed)?;
        self.file.sync_data().map_err(failed)
    }
}

/// Removes the journal of a folder, if there is one.
///
/// # Errors
/// A file that cannot be removed.
pub fn remove(folder: &Path) -> Result<()> {
    let path = folder.join(NAME);
    match std::fs::remove_file(&path) {
        Err(e) if e.kind() != std::io::ErrorKind::NotFound => Err(io_error(&path, "remove", &e)),
        _ => Ok(()),
    }
}

/// A trial as a line.
pub fn line(lengths: &[u32], trial: &Trial) -> String {
    let mut line = String::new();
    for length in lengths {
        _ = write!(line, "{length} ");
    }
    line.push(':');
    if let Some(f) = trial {
        for number in numbers(f) {
            _ = write!(line, " {:016x}", number.to_bits());
        }
    }
    line.push('\n');
    line
}

/// A line's trial; `None` if it is none.
pub fn read(line: &str) -> Option<(Lengths, Trial)> {
    let (lengths, figures) = line.split_once(':')?;
    let lengths = lengths.split_whitespace().map(|l| l.parse().ok());
    let lengths: Lengths = lengths.collect::<Option<_>>()?;
    let numbers = figures.split_whitespace();
    let bits = numbers.map(|n| u64::from_str_radix(n, 16).ok().map(f64::from_bits));
    let bits: Vec<f64> = bits.collect::<Option<_>>()?;
    match bits.len() {
        0 => Some((lengths, None)),
        NUMBERS => Some((lengths, Some(of_numbers(&bits)?))),
        _ => None,
    }
}

fn numbers(f: &Figures) -> [f64; NUMBERS] {
    [
        f.bias_dps,
        f.drift_dps,
        f.noise_dps_rthz,
        f.arw_deg_rth,
        f.scale_factor_ppm,
        f.spur_dps,
        f.spur_hz,
        f64::from(u8::from(f.spur_detuned)),
        f.spur_floor_dps,
    ]
}

fn of_numbers(numbers: &[f64]) -> Option<Figures> {
    let [
        bias_dps,
        drift_dps,
        noise_dps_rthz,
        arw_deg_rth,
        scale_factor_ppm,
        spur_dps,
        spur_hz,
        spur_detuned,
        spur_floor_dps,
    ] = *numbers
    else {
        return None;
    };
    Some(Figures {
        bias_dps,
        drift_dps,
        noise_dps_rthz,
        arw_deg_rth,
        scale_factor_ppm,
        spur_dps,
        spur_hz,
        spur_detuned: spur_detuned != 0.0,
        spur_floor_dps,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_reads_back_and_a_cut_one_does_not_count() {
        let figures = Figures {
            bias_dps: -0.1,
            spur_hz: 5.1,
            spur_detuned: true,
            ..Figures::default()
        };
        for trial in [Some(figures), None] {
            let text = line(&[3, 14], &trial);
            assert_eq!(read(text.trim_end()), Some((vec![3, 14], trial)));
        }
        let text = line(&[3, 14], &Some(figures));
        assert_eq!(read(&text[..text.len() - 30]), None);
        let folder = tempfile::tempdir().expect("a folder");
        let (mut journal, known) = Journal::open(folder.path(), "a").expect("opens");
        assert!(known.is_empty());
        journal.append(&[vec![1]], &[None]).expect("writes");
        journal.file.write_all(b"2 : 00").expect("writes");
        let (_, known) = Journal::open(folder.path(), "a").expect("opens");
        assert_eq!(known.len(), 1);
        let (_, known) = Journal::open(folder.path(), "b").expect("opens");
        assert!(known.is_empty());
    }
}
