//! Temporary files and folders that are recognised as left over when their process has ended.

use super::{Leftover, Ticket, is_removed, undisturbed};
use std::fs::{self, File};
use std::io;
use std::path::{Path, PathBuf};
use tempfile::{NamedTempFile, TempDir};

/// How the name of each begins and ends.
const NAME: (&str, &str) = (".gyrogen-", ".tmp");

/// A file that is gone when this is dropped, or when the process ends.
#[derive(Debug)]
pub struct TemporaryFile {
    /// The open file; it has to be kept so that the lock is.
    pub file: NamedTempFile,
    _ticket: Ticket,
}

/// A folder that is gone with all that is in it when this is dropped, or when the process ends.
#[derive(Debug)]
pub struct TemporaryFolder {
    folder: TempDir,
    _lock: Option<File>,
    _ticket: Ticket,
}

impl TemporaryFile {
    /// Makes a file in `folder` with the permissions of any new file, after removing what other runs left there.
    ///
    /// # Errors
    /// A folder that cannot be written.
    pub fn new(folder: &Path) -> io::Result<Self> {
        sweep(folder);
        let mut builder = tempfile::Builder::new();
        builder.prefix(NAME.0).suffix(NAME.1);
        #[cfg(unix)]
        {
            // What the umask leaves of 0666.
            use std::os::unix::fs::PermissionsExt;
            builder.permissions(fs::Permissions::from_mode(0o666));
        }
        loop {
            let mut registry = undisturbed();
            let file = builder.tempfile_in(folder)?;
            let ticket = registry.register(Leftover::Path(file.path().to_path_buf()));
            drop(registry);
            if is_kept(file.as_file(), file.path()) {
                return Ok(TemporaryFile {
                    file,
                    _ticket: ticket,
                });
            }
        }
    }

    /// Puts the file under its name.
    ///
    /// # Errors
    /// A name that cannot be written; then the file is gone.
    pub fn persist(self, path: &Path) -> io::Result<()> {
        // Under the lock, so that a signal finds it either temporary or in its place.
        let registry = undisturbed();
        let done = self.file.persist(path);
        drop(registry);
        done.map(drop).map_err(|e| e.error)
    }
}

impl TemporaryFolder {
    /// Makes a folder in `parent`, after removing what other runs left there.
    ///
    /// # Errors
    /// A folder that cannot be written.
    pub fn new(parent: &Path) -> io::Result<Self> {
        sweep(parent);
        loop {
            let mut registry = undisturbed();
            let folder = tempfile::Builder::new()
                .prefix(NAME.0)
                .suffix(NAME.1)
                .tempdir_in(parent)?;
            let ticket = registry.register(Leftover::Path(folder.path().to_path_buf()));
            drop(registry);
            let handle = File::open(folder.path()).ok();
            let is_ours = match &handle {
                Some(handle) => is_kept(handle, folder.path()),
                None => folder.path().exists(),
            };
            if is_ours {
                return Ok(TemporaryFolder {
                    folder,
                    _lock: handle,
                    _ticket: ticket,
                });
            }
        }
    }

    /// Makes a folder where the system keeps temporary files (`TMPDIR`).
    ///
    /// # Errors
    /// As [`TemporaryFolder::new`].
    pub fn of_the_system() -> io::Result<Self> {
        TemporaryFolder::new(&std::env::temp_dir())
    }

    /// Where it is.
    pub fn path(&self) -> &Path {
        self.folder.path()
    }
}

/// Removes the temporary files and folders of gyrogen in a folder that no process holds.
pub fn sweep(folder: &Path) {
    let Ok(entries) = fs::read_dir(folder) else {
        return;
    };
    for entry in entries.flatten() {
        let name = entry.file_name();
        let name = name.as_encoded_bytes();
        if name.starts_with(NAME.0.as_bytes()) && name.ends_with(NAME.1.as_bytes()) {
            remove_if_left(&entry.path());
        }
    }
}

fn remove_if_left(path: &PathBuf) {
    // A link is none of ours.
    let is_ours = path
        .symlink_metadata()
        .is_ok_and(|found| found.is_dir() || found.is_file());
    if !is_ours {
        return;
    }
    let Ok(handle) = File::open(path) else {
        return;
    };
    if lock(&handle) == Lock::Ours {
        is_removed(path);
    }
}

/// Whether a new file or folder belongs to this process: between its making and its lock another one's [`sweep`] may
/// have taken it, and removes it a moment later.
fn is_kept(file: &File, path: &Path) -> bool {
    lock(file) != Lock::Others && path.exists()
}

/// What came of asking for a lock.
#[derive(Debug, PartialEq, Eq)]
enum Lock {
    Ours,
    Others,
    /// There are no locks on this system or file system.
    Unknown,
}

/// Takes the lock that ends with its process.
fn lock(file: &File) -> Lock {
    #[cfg(unix)]
    {
        use rustix::fs::{FlockOperation, flock};
        match flock(file, FlockOperation::NonBlockingLockExclusive) {
            Ok(()) => Lock::Ours,
            Err(rustix::io::Errno::WOULDBLOCK) => Lock::Others,
            Err(_) => Lock::Unknown,
        }
    }
    #[cfg(not(unix))]
    {
        let _ = file;
        Lock::Unknown
    }
}
