//! A bundle's folder, which may come from anybody: only regular files in it are read, none through a link, none
//! of any size.

use crate::error::{InputError, Result, io_error};
use std::io::Read;
use std::path::{Component, Path, PathBuf};

/// The longest file that is read, bytes.
const MOST_BYTES: u64 = 1 << 28;
/// Most files of a folder that are looked at.
const MOST_FILES: usize = 10_000;

/// What mends a bundle that is not whole.
pub const AGAIN: &str = "write the bundle again with the command that made it: `gyrogen run`, `close`, `emit` or `approx`";

/// A folder with the files that it may be asked for.
#[derive(Debug)]
pub struct Folder {
    /// As the user gave it, for messages.
    named: PathBuf,
    root: PathBuf,
}

impl Folder {
    /// Opens a folder.
    ///
    /// # Errors
    /// No folder of that name.
    pub fn open(path: &Path) -> Result<Self> {
        let root = std::fs::canonicalize(path);
        let root = root.map_err(|e| io_error(path, "open the bundle's folder", &e))?;
        if !root.is_dir() {
            return Err(InputError::new("this is no folder with a bundle")
                .in_file(path)
                .help("name the folder of sources that `run`, `close`, `emit` or `approx` wrote")
                .into());
        }
        Ok(Folder {
            named: path.to_path_buf(),
            root,
        })
    }

    /// A file's bytes.
    ///
    /// # Errors
    /// A name that leaves the folder; what is missing, a link, no regular file (a pipe, a device) or too long.
    pub fn read(&self, name: &str) -> Result<Vec<u8>> {
        let path = self.confined(name)?;
        let failed =
            |e: std::io::Error| io_error(self.named.join(name), "read the bundle's file", &e);
        let file = std::fs::File::open(&path).map_err(|e| self.unread(name, &e))?;
        let mut bytes = Vec::new();
        file.take(MOST_BYTES + 1)
            .read_to_end(&mut bytes)
            .map_err(failed)?;
        if bytes.len() as u64 > MOST_BYTES {
            return Err(self.refused(name, "it is longer than any file of a bundle"));
        }
        Ok(bytes)
    }

    /// The same as text.
    ///
    /// # Errors
    /// As [`Folder::read`]; what is no UTF-8.
    pub fn read_text(&self, name: &str) -> Result<String> {
        String::from_utf8(self.read(name)?)
            .map_err(|_| self.refused(name, "it is no text in UTF-8"))
    }

    /// True if there is anything of that name, whatever it is.
    pub fn holds(&self, name: &str) -> bool {
        is_plain(name) && self.root.join(name).symlink_metadata().is_ok()
    }

    /// The path of a regular file in the folder.
    fn confined(&self, name: &str) -> Result<PathBuf> {
        if !is_plain(name) {
            return Err(self.refused(name, "it is no plain path inside the folder"));
        }
        let mut path = self.root.clone();
        for part in Path::new(name).components() {
            path.push(part);
            let found = path.symlink_metadata();
            let found = found.map_err(|e| self.unread(name, &e))?;
            if found.file_type().is_symlink() {
                return Err(self.refused(name, "it is a link"));
            }
        }
        let found = path.symlink_metadata();
        if !found.is_ok_and(|m| m.is_file()) {
            return Err(self.refused(name, "it is no regular file"));
        }
        Ok(path)
    }

    /// The error for a file that is missing or cannot be read.
    fn unread(&self, name: &str, e: &std::io::Error) -> crate::error::Error {
        if e.kind() != std::io::ErrorKind::NotFound {
            return io_error(self.named.join(name), "read the bundle's file", e);
        }
        InputError::new(format!("the bundle's file {name:?} is missing"))
            .in_file(self.named.join(name))
            .help(AGAIN)
            .into()
    }

    fn refused(&self, name: &str, why: &str) -> crate::error::Error {
        InputError::new(format!("the bundle's file {name:?} is not read: {why}"))
            .in_file(&self.named)
            .help(format!("a bundle is a folder of regular files; {AGAIN}"))
            .into()
    }

    /// Every file below the folder but for what builds leave (`target`, `build`) and hidden ones, with `/`, in
    /// order; links and pipes too.
    ///
    /// # Errors
    /// A folder that cannot be read or that holds more files than any bundle.
    pub fn files(&self) -> Result<Vec<String>> {
        let mut files = Vec::new();
        let mut folders = vec![(self.root.clone(), String::new())];
        while let Some((folder, before)) = folders.pop() {
            let failed = |e: std::io::Error| io_error(&folder, "read the folder", &e);
            for entry in std::fs::read_dir(&folder).map_err(failed)? {
                let entry = entry.map_err(failed)?;
                let name = entry.file_name().to_string_lossy().into_owned();
                let is_folder = entry.file_type().is_ok_and(|t| t.is_dir());
                let of_builds = is_folder && (name == "target" || name == "build");
                if name.starts_with('.') || of_builds {
                    continue;
                }
                let name = format!("{before}{name}");
                if is_folder {
                    folders.push((entry.path(), format!("{name}/")));
                } else {
                    files.push(name);
                }
                if files.len() + folders.len() > MOST_FILES {
                    let what = format!("the folder holds more than {MOST_FILES} files");
                    return Err(InputError::new(what).in_file(&self.named).into());
                }
            }
        }
        files.sort();
        Ok(files)
    }
}

/// A relative path of letters, digits, `_`, `-`, `.` and `/` that goes down only and names no option.
pub fn is_plain(name: &str) -> bool {
    let letter = |c: char| c.is_ascii_alphanumeric() || "_-./".contains(c);
    let path = Path::new(name);
    !name.is_empty()
        && name.len() < 256
        && name.chars().all(letter)
        && path.components().all(|c| matches!(c, Component::Normal(_)))
        && !name
            .split('/')
            .any(|part| part.is_empty() || part.starts_with('-'))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_that_leave_the_folder_or_name_options_are_refused() {
        for name in [
            "a",
            "gyro.c",
            "vectors/bias.csv",
            "src/bin/harness.rs",
            "a-b.c",
        ] {
            assert!(is_plain(name), "{name}");
        }
        for name in [
            "",
            "/etc/passwd",
            "../a",
            "a/../b",
            "-o",
            "a/-x",
            "a b",
            "a\n",
            "a//b",
            "a\\b",
            ".",
        ] {
            assert!(!is_plain(name), "{name}");
        }
    }

    #[cfg(unix)]
    #[test]
    fn links_and_devices_are_not_read() {
        let made = tempfile::tempdir().expect("a folder");
        std::fs::write(made.path().join("plain"), "text").expect("written");
        std::os::unix::fs::symlink("plain", made.path().join("link")).expect("a link");
        std::os::unix::fs::symlink("/dev", made.path().join("dev")).expect("a link");
        let folder = Folder::open(made.path()).expect("a folder");
        assert_eq!(folder.read_text("plain").expect("a file"), "text");
        for name in ["link", "dev/zero", "absent", "../plain"] {
            assert!(folder.read(name).is_err(), "{name}");
        }
        let said = folder.read("absent").expect_err("missing").to_string();
        assert!(said.contains("\"absent\" is missing"), "{said}");
        assert!(said.contains("`gyrogen run`, `close`"), "{said}");
    }
}
