//! What earlier commands have put into a folder of results, by its `SHA256SUMS`.

use crate::digest::sha256;
use crate::error::{InputError, Result};
use std::fs;
use std::path::{Path, PathBuf};

/// The list of results with their digests, as `sha256sum --check` reads it.
pub const SUMS: &str = "SHA256SUMS";

/// Longest list that is read, bytes.
const MOST_BYTES: u64 = 1 << 22;

/// The wall times of the last command, whichever it was: no result, and not listed.
const WALL_TIMES: &str = "timing.json";

/// Files of which each command has one, and which say whose results a folder has.
const RESULTS: [&str; 6] = [
    "summary.json",
    "closure.json",
    "simulate.json",
    "equiv.json",
    "selftest.json",
    "approx.json",
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

    /// Refuses to write over what no command of the kind has written (a user's own file), and over what was edited
    /// since.
    ///
    /// # Errors
    /// Such a file among the planned ones.
    pub fn refuse(&self, folder: &Path, planned: &[&str]) -> Result<()> {
        let is_own = |name: &&str| RESULTS.contains(name) && self.digest(Path::new(name)).is_some();
        let has_own = planned.iter().any(is_own);
        let others = RESULTS.into_iter().find(|name| is_own(name));
        for name in planned.iter().filter(|name| **name != WALL_TIMES) {
            let path = folder.join(name);
            if !path.is_file() {
                continue;
            }
            let digest = || fs::read(&path).map(|bytes| sha256(&bytes)).ok();
            let (why, help) = match (self.digest(Path::new(name)), others) {
                (Some(_), Some(other)) if !has_own => (
                    format!("it belongs to the results of another command: {other} lies beside it"),
                    "give these results a folder of their own with --out",
                ),
                (Some(due), _) if digest().as_deref() == Some(due) => continue,
                (Some(_), _) => (
                    "it was edited since it was written".to_owned(),
                    "move it away, or give another place with --out",
                ),
                (None, _) => (
                    format!("it is no result of an earlier run: no {SUMS} beside it lists it"),
                    "move it away, or give another place with --out",
                ),
            };
            let what = format!("this file would be written over, and {why}");
            return Err(InputError::new(what).in_file(path).help(help).into());
        }
        let sums = folder.join(SUMS);
        if sums.is_file() && others.is_none() {
            let what = "this file would be written over, and it is no list of results";
            return Err(InputError::new(what)
                .in_file(sums)
                .help("move it away, or give another place with --out")
                .into());
        }
        Ok(())
    }

    /// The list after a command: its own files, and those of others that it has neither replaced nor taken away.
    pub fn after(&self, written: &[(String, PathBuf)], removed: &[PathBuf]) -> String {
        let is_new = |name: &PathBuf| written.iter().any(|(_, w)| w == name);
        let kept = self.lines.iter();
        let kept = kept.filter(|(_, name)| !is_new(name) && !removed.contains(name));
        let mut all: Vec<&(String, PathBuf)> = written.iter().chain(kept).collect();
        all.retain(|(_, name)| name.as_os_str() != WALL_TIMES);
        all.sort_by(|a, b| a.1.cmp(&b.1));
        let lines = all
            .iter()
            .map(|(digest, name)| format!("{digest}  {}\n", name.display()));
        lines.collect()
    }
}
