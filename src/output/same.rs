//! Whether two paths name one file: an input is never written over, by whatever name.

use crate::error::{InputError, Result};
use crate::input::in_any_case;
use std::path::{Path, PathBuf};

/// Refuses an output that is one of the inputs, or the side-car of one, under any name: by another path, a link, or a
/// second name of the same file.
///
/// # Errors
/// That.
pub fn refuse(output: &Path, inputs: &[PathBuf]) -> Result<()> {
    let Some(own) = identity(output) else {
        return Ok(());
    };
    let is_own = |path: &Path| identity(path).as_ref() == Some(&own);
    for input in inputs {
        // Of a capture: `c.toml` beside `c.npy`, `c.csv`, `c.csv.gz`, `c.raw`, `c.TOML` too.
        let sidecars = [input.clone(), input.with_extension("")].map(|p| p.with_extension("toml"));
        if let Some(read) = std::iter::once(input.clone())
            .chain(sidecars.iter().flat_map(|p| in_any_case(p)))
            .find(|p| is_own(p))
        {
            let what = format!("{} would be written over this input", output.display());
            return Err(InputError::new(what)
                .in_file(read)
                .help("give another place with --out")
                .into());
        }
    }
    Ok(())
}

/// What a regular file is known by to the system; `None` for what does not exist or is no regular file.
#[cfg(unix)]
fn identity(path: &Path) -> Option<(u64, u64)> {
    use std::os::unix::fs::MetadataExt;
    let found = path.metadata().ok().filter(|found| found.is_file())?;
    Some((found.dev(), found.ino()))
}

#[cfg(not(unix))]
fn identity(path: &Path) -> Option<PathBuf> {
    path.metadata().ok().filter(|found| found.is_file())?;
    std::fs::canonicalize(path).ok()
}

/// The disk that a file or folder lies on.
#[cfg(unix)]
pub fn device(path: &Path) -> Option<u64> {
    use std::os::unix::fs::MetadataExt;
    Some(path.metadata().ok()?.dev())
}

#[cfg(not(unix))]
pub fn device(path: &Path) -> Option<PathBuf> {
    Some(
        std::fs::canonicalize(path)
            .ok()?
            .components()
            .take(1)
            .collect(),
    )
}
