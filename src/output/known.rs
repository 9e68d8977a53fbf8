//! What earlier commands have put into a folder of results, by its `SHA256SUMS`.

use super::marks;
use crate::digest::sha256;
use crate::error::{Error, InputError, Result};
use std::fs;
use std::path::{Path, PathBuf};

/// The list of results with their digests, as `sha256sum --check` reads it.
pub const SUMS: &str = "SHA256SUMS";

/// Longest list that is read, bytes.
const MOST_BYTES: u64 = 1 << 22;

/// The wall times of the last command, whichever it was: no result, and not listed.
const WALL_TIMES: &str = "timing.json";

/// Files of which each command has one, and which say whose results a folder has. First those that share names with
/// each other.
const RESULTS: [&str; 8] = [
    "summary.json",
    "closure.json",
    "simulate.json",
    "approx.json",
    "study.json",
    "equiv.json",
    "selftest.json",
    "check.json",
];

/// True if these results are listed.
pub fn are_listed(planned: &[&str]) -> bool {
    planned.iter().any(|name| RESULTS.contains(name))
}

/// Digest and name of each result of earlier commands.
#[derive(Debug, Default)]
pub struct Known {
    lines: Vec<(String, PathBuf)>,
}

impl Known {
    /// What the folder's list says; nothing where there is none.
    pub fn of(folder: &Path) -> Self {
        let path = folder.join(SUMS);
        if !fs::metadata(&path).is_ok_and(|m| m.is_file() && m.len() <= MOST_BYTES) {
            return Known::default();
        }
        let text = fs::read_to_string(path).unwrap_or_default();
        let lines = text.lines().filter_map(|line| line.split_once("  "));
        Known {
            lines: lines
                .map(|(digest, name)| (digest.to_owned(), PathBuf::from(name)))
                .collect(),
        }
    }

    fn digest(&self, name: &Path) -> Option<&str> {
        let line = self.lines.iter().find(|(_, listed)| listed == name);
        line.map(|(digest, _)| digest.as_str())
    }

    /// The listed names.
    pub fn names(&self) -> impl Iterator<Item = &PathBuf> {
        self.lines.iter().map(|(_, name)| name)
    }

    /// Whether a result of the command that writes these files is listed.
    pub fn has_earlier(&self, written: &[PathBuf]) -> bool {
        let is_result = |name: &&str| written.iter().any(|w| w == Path::new(name));
        let mut own = RESULTS.iter().filter(|name| is_result(name));
        own.any(|name| self.digest(Path::new(name)).is_some())
    }

    /// Whether a listed file is there as it was written.
    pub fn is_whole(&self, folder: &Path, name: &Path) -> bool {
        let bytes = fs::read(folder.join(name)).ok();
        bytes.is_some_and(|bytes| self.digest(name) == Some(&sha256(&bytes)))
    }

    /// Refuses to write over what no command of the kind has written (a user's own file), and over what was edited
    /// since. What is written over where that is `forced`.
    ///
    /// # Errors
    /// Such a file among the planned ones; results of another command, forced or not.
    pub fn refuse(&self, folder: &Path, planned: &[&str], forced: bool) -> Result<Vec<String>> {
        let is_own = |name: &&str| RESULTS.contains(name) && self.digest(Path::new(name)).is_some();
        let has_own = planned.iter().any(is_own);
        let others = RESULTS.into_iter().find(|name| is_own(name));
        let mut lost = Vec::new();
        for name in planned {
            let path = folder.join(name);
            if !path.is_file() {
                continue;
            }
            let bytes = fs::read(&path).unwrap_or_default();
            let due = self.digest(Path::new(name));
            let listed = due.is_some();
            let (short, why) = match (marks::is_own(name, &bytes), others) {
                (Some(true), _) => continue,
                (Some(false), _) => (
                    "not as gyrogen wrote it",
                    "gyrogen did not write it, or it was edited since".to_owned(),
                ),
                // A bundle's files are judged by its manifest.
                (None, _) if !are_listed(planned) => continue,
                (None, Some(other)) if listed && !has_own => {
                    let why = format!(
                        "it belongs to the results of another command: {other} lies beside it"
                    );
                    let help = "give these results a folder of their own with --out";
                    return Err(in_the_way(path, &why, help));
                }
                _ if due == Some(&sha256(&bytes)) => continue,
                _ if listed => ("edited", "it was edited since it was written".to_owned()),
                _ => (
                    "no result of an earlier run",
                    format!("it is no result of an earlier run: no {SUMS} beside it lists it"),
                ),
            };
            if !forced {
                let help =
                    "move it away, give another place with --out, or overwrite it with `--force`";
                return Err(in_the_way(path, &why, help));
            }
            lost.push(format!("{name} ({short})"));
        }
        let sums = folder.join(SUMS);
        if are_listed(planned) && sums.is_file() && others.is_none() {
            let help = "move it away, or give another place with --out";
            return Err(in_the_way(sums, "it is no list of results", help));
        }
        Ok(lost)
    }

    /// The list after a command: its own files, and those of others that it has neither replaced nor outdated.
    pub fn after(&self, written: &[(String, PathBuf)], gone: &[PathBuf]) -> String {
        let is_new = |name: &PathBuf| written.iter().any(|(_, w)| w == name);
        let kept = self.lines.iter();
        let kept = kept.filter(|(_, name)| !is_new(name) && !gone.contains(name));
        let mut all: Vec<&(String, PathBuf)> = written.iter().chain(kept).collect();
        all.retain(|(_, name)| name.as_os_str() != WALL_TIMES);
        all.sort_by(|a, b| a.1.cmp(&b.1));
        let lines = all
            .iter()
            .map(|(digest, name)| format!("{digest}  {}\n", name.display()));
        lines.collect()
    }
}

/// The error for a file that stays.
fn in_the_way(path: PathBuf, why: &str, help: &str) -> Error {
    let what = format!("this file would be written over, and {why}");
    InputError::new(what).in_file(path).help(help).into()
}
