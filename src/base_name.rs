//! The names of files without their place.

use std::ffi::OsString;
use std::fs;
use std::path::Path;

/// The name of a file or folder without its place, which results name it by: their bytes do not depend on where a command
/// was started. Of `.`, `..` and the like the name of the folder that is meant.
pub fn base_name(path: &Path) -> OsString {
    let real = || Some(fs::canonicalize(path).ok()?.file_name()?.to_owned());
    match path.file_name() {
        Some(name) => name.to_owned(),
        None => real().unwrap_or_else(|| path.as_os_str().to_owned()),
    }
}

/// The same as text for a report.
pub fn name_of(path: &Path) -> String {
    base_name(path).to_string_lossy().into_owned()
}
