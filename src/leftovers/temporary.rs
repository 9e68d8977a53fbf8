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
            lock(file.as_file());
            // Another process may have swept it away before it was locked.
            if file.path().exists() {
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
            if let Some(handle) = &handle {
                lock(handle);
            }
            if folder.path().exists() {
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
    if lock(&handle) {
        is_removed(path);
    }
}

/// Takes the lock that ends with its process; false if another process holds it, or if there are none here.
fn lock(file: &File) -> bool {
    #[cfg(unix)]
    {
        use rustix::fs::{FlockOperation, flock};
        flock(file, FlockOperation::NonBlockingLockExclusive).is_ok()
    }
    #[cfg(not(unix))]
    {
        let _ = file;
        false
    }
}
