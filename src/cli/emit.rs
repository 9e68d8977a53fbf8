//! `gyrogen emit`: a firmware bundle in one language.
//!
//! A design that carries a `[correction]` is there for its correction: that is the part which is emitted unless
//! another one is asked for, and then it is said what is missing.

use super::recorded::Recorded;
use super::terminal::{self, OutputFormat};
use crate::design::{Compensation, Design};
use crate::emit::bundle::Part;
use crate::emit::views::Language;
use crate::error::{InputError, Result};
use crate::firmware::another::{self, Whose};
use crate::firmware::correction::Origin;
use crate::firmware::files::EmittedFile;
use crate::firmware::{conversion, correction, files, manifest, product, replace};
use crate::output::Results;
use std::path::PathBuf;

/// Write a firmware bundle: sources, self-test, test vectors and a manifest of its files.
#[derive(Debug, clap::Args)]
pub struct Arguments {
    #[command(flatten)]
    design: super::common::DesignFile,
    /// Language of the sources.
    #[arg(long, value_enum)]
    lang: Language,
    /// Which part of the firmware; if left out, `correction` for a design that has a `[correction]`, else `chain`.
    #[arg(long, value_enum)]
    part: Option<Part>,
    /// Folder for the bundle; made if it does not exist.
    #[arg(long, value_name = "DIR", default_value = "gyrogen-emit")]
    out: PathBuf,
    /// Replace a bundle of another design or language, or one whose files were edited; files that are none of a bundle's
    /// stay.
    #[arg(long)]
    force: bool,
    /// How the result is printed: in words on stderr, or the bundle's manifest on stdout.
    #[arg(long, value_enum, default_value = "text")]
    format: OutputFormat,
}

/// Runs the command.
///
/// # Errors
/// An unusable design, a folder that cannot be written.
pub fn run(arguments: &Arguments, recorded: &Recorded) -> Result<()> {
    let design = arguments.design.read()?;
    let part = arguments.part.unwrap_or(match design.correction {
        Some(_) => Part::Correction,
        None => Part::Chain,
    });
    another::refuse_inside(&arguments.out)?;
    let mut results = Results::claim(&arguments.out, &[manifest::NAME], &recorded.inputs)?;
    let coming = Whose::of(&design, arguments.lang, &recorded.command);
    let earlier = Whose::in_folder(&arguments.out)?;
    if !arguments.force {
        replace::refuse(&[], &arguments.out)?;
        if let Some(earlier) = &earlier {
            earlier.refuse(&coming, &arguments.out)?;
        }
    }
    let bundle = emitted(&design, part, arguments.lang, &recorded.command)?;
    super::common::bundle(&bundle, "", &mut results, arguments.force)?;
    results.finish()?;
    let note = earlier.and_then(|earlier| earlier.replaced_by(&coming));
    note.iter().for_each(|note| talk!("{note}"));
    if arguments.format == OutputFormat::Json {
        let manifest = bundle.iter().find(|f| f.path == manifest::NAME);
        terminal::give(manifest.map_or("", |f| &f.text));
    }
    for remark in remarks(&design, part, arguments.part.is_some()) {
        talk!("{remark}");
    }
    talk!(
        "wrote {} files to {}",
        bundle.len(),
        arguments.out.display()
    );
    talk!("digest {}", manifest::digest(&bundle));
    Ok(())
}

/// The bundle of a part of a design, as files in memory.
///
/// # Errors
/// A design without what the part needs.
pub(super) fn emitted(
    design: &Design,
    part: Part,
    language: Language,
    command: &str,
) -> Result<Vec<EmittedFile>> {
    match part {
        Part::Correction => correction(design, language, command),
        Part::Conversion => conversion(design, language, command),
        Part::All => product::emit(design, language, command),
        part => files::emit(design, part, language, command),
    }
}

/// A part as the command line names it.
fn part_name(part: Part) -> String {
    format!("{part:?}").to_lowercase()
}

/// Whose the compensation's coefficients are where no record was fitted, and what fits them; ends in a design file.
pub(super) fn unfitted(design: &Design) -> Option<String> {
    let is_unfitted = |c: &&Compensation| c.fitted.is_none();
    design.compensation.as_ref().filter(is_unfitted)?;
    let whose = match design.compensation_is_own {
        true => "those that the design states",
        false => "the embedded default's, published for its simulated gyro",
    };
    Some(format!(
        "the coefficients of [compensation] are {whose}, not fitted to a record: `gyrogen run` fits them and writes a design.toml"
    ))
}

/// What somebody who ships the part has to know of it: what was chosen, what it lacks, what was not fitted.
fn remarks(design: &Design, part: Part, asked: bool) -> Vec<String> {
    let mut remarks = Vec::new();
    let compensates = matches!(part, Part::Chain | Part::Compensation);
    match &design.correction {
        Some(_) if compensates => remarks.push(lacks_correction(&part_name(part))),
        Some(_) if part == Part::Correction && !asked => remarks.push(
            "part: correction, since the design has a [correction]; `--part chain` emits the circuit without it"
                .to_owned(),
        ),
        _ => {}
    }
    if part == Part::Chain && design.compensation.is_none() {
        remarks.push(lacks_compensation(&design.source.text));
    }
    match unfitted(design) {
        Some(said) if compensates => remarks.push(format!("warning: {said} to emit from")),
        // A correction takes the rate before the compensation.
        Some(said) if part == Part::All => remarks.push(format!(
            "note: {said} to emit from. Only the chain's own rate (`row.rate`) uses these coefficients. The corrected rate is made of \
             `sense_i`, before the compensation"
        )),
        _ => {}
    }
    remarks
}

/// The warning that a firmware gives raw rates alone, for a design with this text: a copy that was cut is one that still reads.
fn lacks_compensation(text: &str) -> String {
    let cut = match text.ends_with(['\n', '\r']) || text.is_empty() {
        true => "",
        false => {
            ", and the file ends without the end of a line: if a copy was cut short, copy it again"
        }
    };
    format!(
        "warning: this design has no [compensation]: the firmware gives no compensated rate{cut}"
    )
}

/// The warning that a firmware has not what the design's `[correction]` corrects.
pub(super) fn lacks_correction(what: &str) -> String {
    format!(
        "warning: the design has a [correction], which the firmware written here ({what}) does not contain: \
         `gyrogen emit --part correction`, with the same design and language, emits it"
    )
}

/// The bundle of what makes the words of the design's `[correction]` of its chain's rows.
fn conversion(design: &Design, language: Language, command: &str) -> Result<Vec<EmittedFile>> {
    let (converted, _) = product::of_design(design)?;
    let origin = Origin {
        prefix: &conversion::prefix(&design.name),
        sha256: &design.source.sha256,
        command,
    };
    conversion::emit(&converted, &origin, language)
}

/// The bundle of the design's `[correction]`.
fn correction(design: &Design, language: Language, command: &str) -> Result<Vec<EmittedFile>> {
    let planned = design.correction.as_ref().ok_or_else(|| {
        InputError::new("the design has no [correction] to emit")
            .help("take the design.toml that `gyrogen close` writes, or emit another part")
    })?;
    let origin = Origin {
        prefix: &correction::prefix(&design.name),
        sha256: &design.source.sha256,
        command,
    };
    correction::emit(&planned.compile()?, &origin, language)
}

#[cfg(test)]
mod tests {
    use super::lacks_compensation;

    #[test]
    fn a_design_that_was_cut_is_told_from_one_without_compensation() {
        let whole = lacks_compensation("name = \"a\"\n");
        assert!(whole.ends_with("no compensated rate"), "{whole}");
        let cut = lacks_compensation("name = \"a\"");
        assert!(cut.contains("copy it again"), "{cut}");
    }
}
