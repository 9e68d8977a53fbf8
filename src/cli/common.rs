//! What the subcommands share: lines and tables on the terminal, progress, JSON, the design that was named.

use super::terminal;
use crate::design::{CompensationInput, Design};
use crate::emit::views::Language;
use crate::error::Result;
use crate::firmware::files::EmittedFile;
use crate::firmware::replace;
use crate::output::Results;
use crate::record::Warning;
use crate::verify::compare::{Compared, language_name};
use std::path::{Path, PathBuf};

/// The design, as every command takes it.
#[derive(Debug, clap::Args)]
pub struct DesignFile {
    /// Design file (TOML); the embedded default if left out.
    #[arg(value_name = "DESIGN", conflicts_with = "design_option")]
    design: Option<PathBuf>,
    /// The same design file, as an option.
    #[arg(long = "design", id = "design_option", value_name = "FILE")]
    option: Option<PathBuf>,
}

impl DesignFile {
    /// The file that was named.
    pub(super) fn path(&self) -> Option<&Path> {
        self.design.as_deref().or(self.option.as_deref())
    }

    /// As [`design`].
    ///
    /// # Errors
    /// A design that cannot be read or used.
    pub(super) fn read(&self) -> Result<crate::design::Design> {
        design(self.path())
    }
}

/// `--force`, as every command with a folder of results takes it.
#[derive(Debug, Clone, Copy, clap::Args)]
pub struct Force {
    /// Overwrite files in the folder that you wrote or edited, where a result has their name; other files stay.
    #[arg(long)]
    pub(super) force: bool,
}

/// Reads the design named on the command line, or the embedded default.
pub(super) fn design(path: Option<&Path>) -> Result<crate::design::Design> {
    if let Some(path) = path {
        refuse_record(path)?;
    }
    let design = crate::design::reader::read(path)?;
    if let Some(path) = path.filter(|_| sets_nothing(&design.source.text)) {
        talk!(
            "note: {} sets nothing: every value is the embedded default's",
            path.display()
        );
    }
    crate::correction::refuse_unbuildable(&design)?;
    Ok(design)
}

/// Claims a command's folder. What `look` finds wrong with the measured data is said before what is wrong with the folder,
/// but for data that would be written over.
pub(super) fn claim_after(
    out: &Path,
    planned: &[&str],
    inputs: &[PathBuf],
    force: Force,
    look: impl FnOnce() -> Result<()>,
) -> Result<Results> {
    for name in planned {
        crate::output::refuse_inputs(&out.join(name), inputs)?;
    }
    claim(out, planned, inputs, force).or_else(|e| look().and(Err(e)))
}

/// Claims a command's folder; says what of the user's is written over where that is forced.
pub(super) fn claim(
    out: &Path,
    planned: &[&str],
    inputs: &[PathBuf],
    force: Force,
) -> Result<Results> {
    let results = Results::claim_forced(out, planned, inputs, force.force)?;
    if !results.lost().is_empty() {
        talk!("--force overwrites: {}", replace::listed(results.lost()));
    }
    Ok(results)
}

/// Whether a design's text is empty, or has nothing but comments.
fn sets_nothing(text: &str) -> bool {
    let mut lines = text.trim_start_matches('\u{feff}').lines().map(str::trim);
    lines.all(|line| line.is_empty() || line.starts_with('#'))
}

/// A record in a design's place is named as what it is.
fn refuse_record(path: &std::path::Path) -> Result<()> {
    use std::io::Read;
    // A pipe can be read only once.
    if !std::fs::metadata(path).is_ok_and(|m| m.is_file()) {
        return Ok(());
    }
    let mut start = Vec::new();
    let read = std::fs::File::open(path).and_then(|f| f.take(1 << 16).read_to_end(&mut start));
    match (read, crate::record::is_a_record(&start)) {
        (Ok(_), Some((what, is_record))) => {
            let beside = path.with_file_name("design.toml");
            let help = match is_record {
                true => format!(
                    "`gyrogen run --record {0}` fits it, `gyrogen close --record {0}` looks for causes; captured ADC codes are given \
                     with `--capture {0}` (`replay`, `equiv`, `close`); a design is a TOML file, as `gyrogen init` writes one",
                    path.display()
                ),
                // Of results, which have their design beside them.
                false if beside.is_file() => format!(
                    "did you mean {}, which lies beside it? A design is a TOML file",
                    beside.display()
                ),
                false => "a design is a TOML file, as `gyrogen init` writes one".to_owned(),
            };
            Err(
                crate::error::InputError::new(format!("this is no design: it looks like {what}"))
                    .in_file(path)
                    .help(help)
                    .into(),
            )
        }
        // What cannot be read is the reader's to say.
        _ => Ok(()),
    }
}

/// A design in a record's or a capture's place is named as what it is; `option` is the one of `command` that it was given
/// with, `design` the file in the design's place.
pub(super) fn refuse_design(
    (command, option): (&str, &str),
    path: &Path,
    design: Option<&Path>,
) -> Result<()> {
    if is_toml(path) != Some(true) {
        return Ok(());
    }
    let message = format!("this is a design (TOML), and `{option}` takes measured data");
    let help = match design.filter(|d| is_toml(d) == Some(false)) {
        Some(other) => format!(
            "the two look swapped: `gyrogen {command} {} {option} {}`",
            path.display(),
            other.display()
        ),
        None => "give the design before the options, or with --design where there is that option"
            .to_owned(),
    };
    Err(crate::error::InputError::new(message)
        .in_file(path)
        .help(help)
        .into())
}

/// Whether a file is TOML with a key or a table. `None`: it is no file; that is the reader's to say.
fn is_toml(path: &Path) -> Option<bool> {
    use std::io::Read;
    if !std::fs::metadata(path).is_ok_and(|m| m.is_file()) {
        return None;
    }
    let mut text = String::new();
    let read = std::fs::File::open(path).and_then(|f| f.take(1 << 20).read_to_string(&mut text));
    let parsed = read.ok().map(|_| text.parse::<toml_edit::DocumentMut>());
    let is_filled =
        |d: toml_edit::DocumentMut| d.iter().any(|(_, item)| item.is_table() || item.is_value());
    Some(parsed.is_some_and(|p| p.is_ok_and(is_filled)))
}

/// The threads that were asked for, or as many as the machine has.
pub(super) fn threads(asked: Option<u16>) -> usize {
    asked.map_or_else(
        || std::thread::available_parallelism().map_or(1, usize::from),
        usize::from,
    )
}

/// Indented JSON with a final newline: what is written and what `--format json` prints.
pub(super) fn json<T: serde::Serialize>(value: &T) -> String {
    crate::text::json(value)
}

/// The languages that emitted code is built in, of those asked for; says for which there is no compiler.
pub(super) fn languages(asked: Option<Language>) -> Result<Vec<Language>> {
    let (found, lacking) = crate::verify::toolchain::languages(asked)?;
    for why in lacking {
        let other = found.first().map_or("", |l| language_name(*l));
        talk!("note: only the emitted code of one language ({other}) is built and compared: {why}");
    }
    Ok(found)
}

/// Warnings that stand before the results, for what makes these mean something else: those of the file as it was read,
/// `of_record`, of a thermometer that is none, and of a circuit that overflows. Then the others.
pub(super) fn parted(all: &[Warning], of_record: &[Warning]) -> (Vec<Warning>, Vec<Warning>) {
    const FIRST: [&str; 3] = ["no_thermometer", "thermometer_constant", "cordic_width"];
    let is_first = |w: &Warning| of_record.contains(w) || FIRST.contains(&w.code);
    all.iter().cloned().partition(is_first)
}

/// What the user should know of, a line each on stderr.
pub(super) fn warnings(all: &[Warning]) {
    for warning in all {
        talk!(
            "{}: {} [{}]",
            warning.label(),
            warning.message,
            warning.code
        );
    }
}

/// A bundle among the results, in `folder` below theirs and in the place of the bundle that is there; says what was in
/// the way where that was forced.
pub(super) fn bundle(
    files: &[EmittedFile],
    folder: &str,
    results: &mut Results,
    force: bool,
) -> Result<()> {
    let replaced = replace::collect(files, folder, results, force)?;
    for (what, names) in [
        ("replaced, as asked for", &replaced.lost),
        ("left beside the bundle", &replaced.beside),
    ] {
        if !names.is_empty() {
            talk!("{what}: {}", replace::listed(names));
        }
    }
    if replaced.gone > 0 {
        let count = replaced.gone;
        talk!("note: the bundle that was here is gone, {count} of its files removed");
    }
    Ok(())
}

/// Emitted code against the model, a line each.
pub(super) fn comparison_table(compared: &[Compared]) -> comfy_table::Table {
    let mut table = terminal::table(&[
        "emitted",
        "language",
        "inputs",
        "words compared",
        "mismatches",
    ]);
    for c in compared {
        let inputs = if c.exhaustive {
            format!("{} (all)", c.inputs)
        } else {
            c.inputs.to_string()
        };
        table.add_row([
            c.name.clone(),
            c.language.to_owned(),
            inputs,
            c.compared.to_string(),
            c.shown_mismatches(),
        ]);
    }
    super::terminal::numbers(&mut table, 2..);
    table
}

/// The line that ends a command: its folder, and those of its files that a person opens next, as far as they are there.
pub(super) fn wrote(out: &Path, next: &[&str]) {
    say!("{}", wrote_line(out, next));
}

fn wrote_line(out: &Path, next: &[&str]) -> String {
    let is_there = |name: &&str| out.join(name).exists();
    let there: Vec<&str> = next.iter().copied().filter(is_there).collect();
    let colon = if there.is_empty() { "" } else { ": " };
    format!("wrote {}{colon}{}", out.display(), there.join(", "))
}

/// Says so where the firmware has no circuit, though its words are checked.
pub(super) fn say_what_is_emitted(design: &Design) {
    let input = design.compensation.as_ref().map(|c| &c.input);
    if let Some(CompensationInput::Channel(channel)) = input {
        say!(
            "The firmware of this design is the compensation alone: its input, {}, is no word of the circuit. What is said of circuit.* \
             below is about the design's [circuit], which is not in that firmware.",
            channel.column
        );
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_design_without_a_key_or_a_table_sets_nothing() {
        for text in ["", "\u{feff}", "\n  \n", "# name = \"a\"\n\n  # more\n"] {
            assert!(sets_nothing(text), "{text:?}");
        }
        for text in ["name = \"a\"", "# a\n[record]\n"] {
            assert!(!sets_nothing(text), "{text:?}");
        }
    }

    #[test]
    fn the_last_line_names_the_files_that_are_there() {
        let folder = tempfile::tempdir().unwrap();
        let out = folder.path();
        std::fs::write(out.join("report.html"), "").unwrap();
        std::fs::create_dir_all(out.join("firmware/c")).unwrap();
        let line = |next: &[&str]| wrote_line(out, next);
        let at = out.display();
        assert_eq!(
            line(&["report.html", "design.toml", "firmware/c"]),
            format!("wrote {at}: report.html, firmware/c")
        );
        assert_eq!(line(&["design.toml"]), format!("wrote {at}"));
    }
}
