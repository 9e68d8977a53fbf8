//! `gyrogen emit`: a firmware bundle in one language.

use crate::correction::firmware::{self, Origin};
use crate::design::Design;
use crate::emit::bundle::Part;
use crate::emit::files::{self, EmittedFile};
use crate::emit::views::Language;
use crate::error::{InputError, Result};
use std::path::PathBuf;

/// Write firmware sources with their self-test, vectors and manifest.
#[derive(Debug, clap::Args)]
pub struct Arguments {
    /// Design file; the embedded default if left out.
    design: Option<PathBuf>,
    /// The language.
    #[arg(long, value_enum)]
    lang: Language,
    /// Which part of the firmware.
    #[arg(long, value_enum, default_value = "chain")]
    part: Part,
    /// Folder for the bundle; made if it does not exist.
    #[arg(long)]
    out: PathBuf,
}

/// Runs the command.
///
/// # Errors
/// An unusable design, a folder that cannot be written.
pub fn run(arguments: &Arguments) -> Result<()> {
    let design = super::design(arguments.design.as_deref())?;
    let named = match &arguments.design {
        Some(path) => format!("{} ", path.display()),
        None => String::new(),
    };
    let command = format!(
        "gyrogen emit {named}--lang {} --part {}",
        format!("{:?}", arguments.lang).to_lowercase(),
        format!("{:?}", arguments.part).to_lowercase()
    );
    let bundle = match arguments.part {
        Part::Correction => correction(&design, arguments.lang, &command)?,
        part => files::emit(&design, part, arguments.lang, &command)?,
    };
    files::write(&bundle, &arguments.out)?;
    eprintln!(
        "wrote {} files to {}",
        bundle.len(),
        arguments.out.display()
    );
    Ok(())
}

/// The bundle of the design's `[correction]`.
fn correction(design: &Design, language: Language, command: &str) -> Result<Vec<EmittedFile>> {
    let planned = design.correction.as_ref().ok_or_else(|| {
        InputError::new("the design has no [correction] to emit")
            .help("add a [correction] table to the design")
    })?;
    let origin = Origin {
        prefix: &design.name,
        sha256: &design.source.sha256,
        command,
    };
    firmware::emit(&planned.compile()?, &origin, language)
}
