//! Files that appear whole or not at all, and never over an input.
//!
//! [`OutputFile`] is one file, [`Results`] all those of a command; [`refuse_inputs`] keeps what a command reads, and
//! [`standard`] is the standard output, whose failures are found at the end.

mod known;
mod marks;
mod results;
mod same;
pub mod standard;

pub use marks::{is_own, sealed};
pub use results::Results;
pub use same::refuse as refuse_inputs;

pub use crate::base_name::{base_name, name_of};
use crate::error::{Error, InputError, Result, cause, io_error};
use crate::leftovers::TemporaryFile;
use std::fmt;
use std::fs::{self, File, OpenOptions, Permissions};
use std::io::{self, Seek, Write};
use std::path::{Path, PathBuf};

/// A file that appears under its name only by [`OutputFile::finish`]; dropped before, it leaves
/// nothing, and an existing file as it was. What is no regular file is written straight.
#[derive(Debug)]
pub struct OutputFile {
    named: PathBuf,
    target: Target,
}

enum Target {
    /// A temporary file beside `path`, the permissions of the file it replaces.
    Replace {
        temporary: TemporaryFile,
        path: PathBuf,
        permissions: Option<Permissions>,
    },
    /// The file itself, which is no regular one.
    Straight(Box<dyn Write + Send>),
}

impl fmt::Debug for Target {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Target::Replace { path, .. } => write!(f, "beside {}", path.display()),
            Target::Straight(_) => write!(f, "straight"),
        }
    }
}

impl OutputFile {
    /// Opens the output.
    ///
    /// # Errors
    /// A folder that is missing or cannot be written, an existing file that cannot be written, a
    /// folder of that name. Nothing is left behind.
    pub fn open(path: &Path) -> Result<Self> {
        Ok(OutputFile {
            named: path.to_path_buf(),
            target: Target::open(path)?,
        })
    }

    /// True for what is no regular file (`/dev/stdout`, a pipe).
    pub fn is_straight(&self) -> bool {
        matches!(self.target, Target::Straight(_))
    }

    /// Appends bytes.
    ///
    /// # Errors
    /// A failed write; [`Error::ReaderGone`] for a pipe that nobody reads any more.
    pub fn write_all(&mut self, bytes: &[u8]) -> Result<()> {
        match &mut self.target {
            Target::Replace { temporary, .. } => temporary.file.as_file_mut().write_all(bytes),
            Target::Straight(output) => output.write_all(bytes),
        }
        .map_err(|e| write_failed(&self.named, &e))
    }

    /// Overwrites the file's start with `start`, if any, and puts the file under its name.
    ///
    /// # Errors
    /// A failed write; then nothing is left and an existing file stays.
    pub fn finish(self, start: Option<&[u8]>) -> Result<()> {
        let named = self.named;
        let failed = |e: &io::Error| write_failed(&named, e);
        match self.target {
            Target::Straight(mut output) => output.flush().map_err(|e| failed(&e)),
            Target::Replace {
                mut temporary,
                path,
                permissions,
            } => {
                let file = temporary.file.as_file_mut();
                if let Some(start) = start {
                    file.rewind().map_err(|e| failed(&e))?;
                    file.write_all(start).map_err(|e| failed(&e))?;
                }
                if let Some(permissions) = permissions {
                    file.set_permissions(permissions).map_err(|e| failed(&e))?;
                }
                temporary.persist(&path).map_err(|e| failed(&e))
            }
        }
    }
}

/// Writes a file whole or not at all.
///
/// # Errors
/// As [`OutputFile`].
pub fn write_whole(path: &Path, bytes: &[u8]) -> Result<()> {
    let mut file = OutputFile::open(path)?;
    file.write_all(bytes)?;
    file.finish(None)
}

impl Target {
    fn open(path: &Path) -> Result<Target> {
        for (names, stream) in [
            (["/dev/stdout", "/dev/fd/1", "/proc/self/fd/1"], 1),
            (["/dev/stderr", "/dev/fd/2", "/proc/self/fd/2"], 2),
        ] {
            if names.iter().any(|name| path == Path::new(name)) {
                return Ok(Target::Straight(match stream {
                    1 => Box::new(io::stdout()),
                    _ => Box::new(io::stderr()),
                }));
            }
        }
        let real = target(path).map_err(|e| write_failed(path, &e))?;
        let Some((file, existing)) = existing(path)? else {
            return Target::replace(real, path, None);
        };
        if !existing.is_file() {
            return Ok(Target::Straight(Box::new(file)));
        }
        Target::replace(real, path, Some(existing.permissions()))
    }

    /// A temporary file in the folder of `real`; `named` is the path as the user gave it.
    fn replace(real: PathBuf, named: &Path, permissions: Option<Permissions>) -> Result<Target> {
        if real.file_name().is_none() {
            return Err(InputError::new("this names no file to write")
                .in_file(named)
                .help("name a file, such as `rows.csv`")
                .into());
        }
        let folder = match real.parent() {
            Some(parent) if parent != Path::new("") => parent,
            _ => Path::new("."),
        };
        if !folder.is_dir() {
            let message = format!("cannot write: there is no folder `{}`", folder.display());
            return Err(InputError::new(message)
                .in_file(named)
                .help(format!("make it first: `mkdir -p {}`", folder.display()))
                .into());
        }
        let temporary = TemporaryFile::new(folder).map_err(|e| match e.kind() {
            io::ErrorKind::PermissionDenied => {
                let shown = folder.display();
                InputError::new(format!(
                    "cannot write into the folder `{shown}`: {}",
                    cause(&e)
                ))
                .in_file(named)
                .help("check the folder's permissions, or name a file in another one")
                .into()
            }
            // The folder is there: the system keeps its own files in it, as in /proc.
            io::ErrorKind::NotFound => {
                let shown = folder.display();
                InputError::new(format!(
                    "cannot write: the system takes no new files in `{shown}`"
                ))
                .in_file(named)
                .help("name a file in another folder")
                .into()
            }
            _ => write_failed(named, &e),
        })?;
        Ok(Target::Replace {
            temporary,
            path: real,
            permissions,
        })
    }
}

/// What stands at a path already, opened for writing without a change to it.
fn existing(path: &Path) -> Result<Option<(File, fs::Metadata)>> {
    let found = match fs::metadata(path) {
        Ok(found) => found,
        Err(e) if e.kind() == io::ErrorKind::NotFound => return Ok(None),
        Err(e) => return Err(write_failed(path, &e)),
    };
    if found.is_dir() {
        return Err(InputError::new("this is a folder, not a file to write")
            .in_file(path)
            .help("name a file in it, such as `rows.csv`")
            .into());
    }
    let file = OpenOptions::new().write(true).open(path);
    Ok(Some((file.map_err(|e| write_failed(path, &e))?, found)))
}

/// Finds before the work that a regular file of this name cannot be replaced.
///
/// # Errors
/// An existing file that cannot be written, a folder of that name.
fn check_writable(path: &Path) -> Result<()> {
    // Opening a pipe would wait for its reader.
    if fs::metadata(path).is_ok_and(|found| !found.is_file() && !found.is_dir()) {
        return Ok(());
    }
    existing(path).map(drop)
}

/// The file that a path names: a link stays a link, also one to a file that does not exist yet.
fn target(path: &Path) -> io::Result<PathBuf> {
    /// As Linux has it.
    const MOST_LINKS: usize = 40;
    let mut here = path.to_path_buf();
    for _ in 0..MOST_LINKS {
        match fs::read_link(&here) {
            // A relative one is meant from where the link lies; an absolute one replaces the whole path.
            Ok(next) => here = here.parent().unwrap_or(Path::new("")).join(next),
            Err(_) => return Ok(here),
        }
    }
    Err(io::Error::other("too many links, one to another"))
}

/// The error of a failed write.
pub(crate) fn write_failed(path: &Path, e: &io::Error) -> Error {
    if e.kind() == io::ErrorKind::BrokenPipe {
        return Error::ReaderGone;
    }
    io_error(path, "write the file", e)
}
