//! `gyrogen init`: a commented design file to start from.

use crate::error::{InputError, Result};
use std::path::PathBuf;

/// Write a commented design file: the embedded default, every key explained.
#[derive(Debug, clap::Args)]
pub struct Arguments {
    /// File to write (TOML); stdout if left out. A file that exists is never overwritten.
    file: Option<PathBuf>,
    /// The same file, as an option.
    #[arg(long, value_name = "FILE", conflicts_with = "file")]
    out: Option<PathBuf>,
}

/// Runs the command.
///
/// # Errors
/// A file that exists already, a folder that cannot be written.
pub fn run(arguments: &Arguments) -> Result<()> {
    let text = crate::design::template::DEFAULT;
    let Some(path) = arguments.file.as_ref().or(arguments.out.as_ref()) else {
        super::terminal::give(text);
        return Ok(());
    };
    if path.symlink_metadata().is_ok() {
        return Err(InputError::new("this exists already and is left as it is")
            .in_file(path)
            .help("name another file, or move this one away first")
            .into());
    }
    crate::output::write_whole(path, text.as_bytes())?;
    talk!("wrote {}", path.display());
    Ok(())
}
