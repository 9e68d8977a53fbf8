//! The files of a command: all of them appear in their folder, or none.
//!
//! [`Results::claim`] is called before the work: it refuses what would be written over an input, and finds a folder that
//! cannot be written. Files are collected in a temporary folder on the same disk; [`Results::finish`] moves them to their
//! names. Until then nothing has changed, whatever fails or ends the process.

use super::known::{self, Known};
use super::{OutputFile, same, target, write_failed};
use crate::digest::sha256;
use crate::error::{Error, InputError, Result, cause, io_error};
use crate::leftovers::{TemporaryFolder, undisturbed};
use std::fs;
use std::io;
use std::path::{Component, Path, PathBuf};

/// Remedy for a folder that cannot be used.
const ANOTHER: &str = "name another folder with --out";

/// Results on the way to their folder.
#[derive(Debug)]
pub struct Results {
    /// The folder as the user named it.
    out: PathBuf,
    inputs: Vec<PathBuf>,
    _staged: TemporaryFolder,
    /// Where the files are collected, inside the temporary folder.
    collected: PathBuf,
    /// For a folder that does not exist yet: what is moved (in the temporary folder), and where to.
    new: Option<(PathBuf, PathBuf)>,
    /// Names below the folder, in the order in which they came.
    names: Vec<PathBuf>,
    /// Names of an earlier run's files that would contradict this one's.
    removed: Vec<PathBuf>,
    /// Beginnings of the names of what an earlier run of the same command has listed.
    outdated: Vec<String>,
    /// What of the user's is written over, as that was asked for.
    lost: Vec<String>,
    /// What earlier commands have put there; none where results are not listed.
    known: Option<Known>,
}

impl Results {
    /// Claims `out` for results, of which `planned` are known by name. `inputs` are the files that the command reads.
    ///
    /// # Errors
    /// An input that would be written over, a file that the user wrote or edited; a folder or a file in it that cannot
    /// be written.
    pub fn claim(out: &Path, planned: &[&str], inputs: &[PathBuf]) -> Result<Self> {
        Self::claim_forced(out, planned, inputs, false)
    }

    /// As [`Results::claim`]; with `forced`, what the user wrote or edited is written over, which [`Results::lost`]
    /// names.
    ///
    /// # Errors
    /// As [`Results::claim`], but for that.
    pub fn claim_forced(
        out: &Path,
        planned: &[&str],
        inputs: &[PathBuf],
        forced: bool,
    ) -> Result<Self> {
        let failed = |e: &io::Error| io_error(out, "make the folder", e);
        let (existing, missing) = existing(out).map_err(|e| failed(&e))?;
        let is_there = missing == Path::new("");
        let shown = existing.display();
        if !existing.is_dir() {
            let message = match is_there {
                true => "this is a file, and a folder is wanted for the results".to_owned(),
                false => format!("cannot make the folder: `{shown}` is a file"),
            };
            return Err(InputError::new(message).in_file(out).help(ANOTHER).into());
        }
        for name in planned {
            let path = out.join(name);
            same::refuse(&path, inputs)?;
            super::check_writable(&path)?;
        }
        let known = Known::of(out);
        let lost = known.refuse(out, planned, forced)?;
        let staged = TemporaryFolder::new(&existing).map_err(|e| {
            let (why, help) = match e.kind() {
                // The folder is there: the system keeps its own files in it, as in /proc.
                io::ErrorKind::NotFound => (
                    format!("the system takes no new files in `{shown}`"),
                    ANOTHER.to_owned(),
                ),
                _ => (
                    cause(&e),
                    format!("check the permissions of `{shown}` and the disk, or {ANOTHER}"),
                ),
            };
            let what = match is_there {
                true => "write into this folder",
                false => "make the folder",
            };
            let error = InputError::new(format!("cannot {what}: {why}"));
            error.in_file(out).help(help)
        })?;
        let collected = staged.path().join(&missing);
        fs::create_dir_all(&collected).map_err(|e| failed(&e))?;
        let new = missing.components().next().map(|first| {
            let first = Path::new(first.as_os_str());
            (staged.path().join(first), existing.join(first))
        });
        Ok(Results {
            out: out.to_path_buf(),
            inputs: inputs.to_vec(),
            _staged: staged,
            collected,
            new,
            names: Vec::new(),
            removed: Vec::new(),
            outdated: planned.iter().map(|name| (*name).to_owned()).collect(),
            lost,
            known: known::are_listed(planned).then_some(known),
        })
    }

    /// The folder as the user named it.
    pub fn folder(&self) -> &Path {
        &self.out
    }

    /// What of the user's will be written over, as that was asked for.
    pub fn lost(&self) -> &[String] {
        &self.lost
    }

    /// Whose listed names begin so was made by an earlier run of this command, as the planned files were: what this run
    /// does not make goes, but an edited file, which is no longer listed.
    pub fn replaces(&mut self, beginning: &str) {
        self.outdated.push(beginning.to_owned());
    }

    /// Adds a file.
    ///
    /// # Errors
    /// A failed write; a name that would be written over an input.
    pub fn write(&mut self, name: impl AsRef<Path>, bytes: &[u8]) -> Result<()> {
        self.write_with(name, |path| {
            fs::write(path, bytes).map_err(|e| write_failed(path, &e))
        })
    }

    /// Adds a file that `write` makes where it is told.
    ///
    /// # Errors
    /// As [`Results::write`], and those of `write`.
    pub fn write_with(
        &mut self,
        name: impl AsRef<Path>,
        write: impl FnOnce(&Path) -> Result<()>,
    ) -> Result<()> {
        let name = name.as_ref();
        let path = self.out.join(name);
        same::refuse(&path, &self.inputs)?;
        super::check_writable(&path)?;
        let collected = self.collected.join(name);
        if let Some(parent) = collected.parent() {
            fs::create_dir_all(parent).map_err(|e| write_failed(&path, &e))?;
        }
        write(&collected).map_err(|e| match e {
            // Told of where it will be.
            Error::Input(e) if e.file.as_ref() == Some(&collected) => (*e).in_file(&path).into(),
            other => other,
        })?;
        self.names.push(name.to_path_buf());
        Ok(())
    }

    /// Adds several.
    ///
    /// # Errors
    /// As [`Results::write`].
    pub fn write_all<'a, P: AsRef<Path>>(
        &mut self,
        files: impl IntoIterator<Item = (P, &'a [u8])>,
    ) -> Result<()> {
        files
            .into_iter()
            .try_for_each(|(name, bytes)| self.write(name, bytes))
    }

    /// Takes away a file of an earlier run that would contradict this one's, if there is one.
    pub fn remove(&mut self, name: impl AsRef<Path>) {
        self.removed.push(name.as_ref().to_path_buf());
    }

    /// Puts all files under their names, and the list of them.
    ///
    /// # Errors
    /// A file that cannot be put there; then none is, but for a name that became unusable at this very moment.
    pub fn finish(mut self) -> Result<()> {
        if let Some(known) = self.known.take() {
            let digest = |name: &PathBuf| {
                let bytes =
                    fs::read(self.collected.join(name)).map_err(|e| write_failed(name, &e))?;
                Ok((sha256(&bytes), name.clone()))
            };
            let written: Result<Vec<_>> = self.names.iter().map(digest).collect();
            let gone = self.gone(&known);
            let whole = gone.iter().filter(|name| known.is_whole(&self.out, name));
            let whole: Vec<PathBuf> = whole.cloned().collect();
            let list = known.after(&written?, &[&self.removed[..], &gone].concat());
            self.removed.extend(whole);
            self.write(known::SUMS, list.as_bytes())?;
        }
        if let Some((from, to)) = &self.new
            && to.symlink_metadata().is_err()
        {
            // The whole folder in one step.
            let _held = undisturbed();
            return fs::rename(from, to).map_err(|e| io_error(&self.out, "make the folder", &e));
        }
        let mut moved = Vec::new();
        let mut others = Vec::new();
        for name in &self.names {
            let (from, named) = (self.collected.join(name), self.out.join(name));
            let failed = |e: io::Error| write_failed(&named, &e);
            if let Some(parent) = named.parent() {
                fs::create_dir_all(parent).map_err(failed)?;
            }
            let to = target(&named).map_err(failed)?;
            match fs::metadata(&to) {
                Ok(found) if found.is_file() => {
                    fs::set_permissions(&from, found.permissions()).map_err(failed)?;
                }
                // A pipe or a device is written, not replaced.
                Ok(_) => {
                    copy(&from, &to, &mut others)?;
                    continue;
                }
                Err(_) => {}
            }
            if same::device(&from) == to.parent().and_then(same::device) {
                moved.push((from, to, named));
            } else {
                copy(&from, &to, &mut others)?;
            }
        }
        for file in others {
            file.finish(None)?;
        }
        let _held = undisturbed();
        for (from, to, named) in &moved {
            fs::rename(from, to).map_err(|e| write_failed(named, &e))?;
        }
        for name in &self.removed {
            let path = self.out.join(name);
            if path.symlink_metadata().is_ok() {
                fs::remove_file(&path).map_err(|e| io_error(&path, "remove", &e))?;
            }
            // Only what is empty can be removed so.
            let above = path.ancestors().skip(1);
            _ = above
                .take_while(|folder| *folder != self.out)
                .try_for_each(fs::remove_dir);
        }
        Ok(())
    }

    /// Listed results of an earlier run of this command which this one does not make. An input stays.
    fn gone(&self, known: &Known) -> Vec<PathBuf> {
        if !known.has_earlier(&self.names) {
            return Vec::new();
        }
        let is_outdated = |name: &&PathBuf| {
            let text = name.to_string_lossy();
            self.outdated.iter().any(|o| text.starts_with(o.as_str()))
                // A list is a file that anybody may have changed.
                && name.components().all(|c| matches!(c, Component::Normal(_)))
                && !self.names.contains(name)
                && same::refuse(&self.out.join(name), &self.inputs).is_ok()
        };
        known.names().filter(is_outdated).cloned().collect()
    }
}

/// The bytes of a file into another that lies on another disk or is no regular one.
fn copy(from: &Path, to: &Path, others: &mut Vec<OutputFile>) -> Result<()> {
    let mut file = OutputFile::open(to)?;
    file.write_all(&fs::read(from).map_err(|e| write_failed(to, &e))?)?;
    others.push(file);
    Ok(())
}

/// The deepest folder on the way to `out` that exists, and what is missing below it.
fn existing(out: &Path) -> io::Result<(PathBuf, PathBuf)> {
    let mut missing = PathBuf::new();
    let mut folder = out;
    loop {
        let here = if folder == Path::new("") {
            Path::new(".")
        } else {
            folder
        };
        match here.metadata() {
            Ok(_) => return Ok((here.to_path_buf(), missing)),
            Err(e) if e.kind() == io::ErrorKind::NotFound && here.symlink_metadata().is_err() => {}
            // A file in the middle, which is found above.
            Err(e) if e.kind() == io::ErrorKind::NotADirectory => {}
            // A link to nothing, a folder that may not be entered.
            Err(e) => return Err(e),
        }
        let (Some(parent), Some(name)) = (folder.parent(), folder.file_name()) else {
            return Err(io::ErrorKind::InvalidInput.into());
        };
        missing = if missing == Path::new("") {
            PathBuf::from(name)
        } else {
            Path::new(name).join(missing)
        };
        folder = parent;
    }
}

#[cfg(test)]
#[path = "results_tests.rs"]
mod tests;
