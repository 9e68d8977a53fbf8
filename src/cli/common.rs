//! What the subcommands share: lines and tables on the terminal, progress, JSON, the design that was named.

use crate::emit::views::Language;
use crate::error::Result;
use crate::firmware::files::EmittedFile;
use crate::firmware::replace;
use crate::output::Results;
use crate::verify::compare::{Compared, language_name};
use clap::ValueEnum;
use std::io::IsTerminal;
use std::path::Path;
use std::sync::Mutex;

/// A line on stdout; what cannot be written is an error at the end, for what is written to files is.
macro_rules! say {
    ($($words:tt)*) => {
        crate::output::standard::line(format_args!($($words)*))
    };
}

/// A line on stderr.
macro_rules! talk {
    ($($words:tt)*) => {
        crate::output::standard::talk(format_args!($($words)*))
    };
}

/// How results are printed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, ValueEnum)]
pub(super) enum OutputFormat {
    /// Tables and sentences.
    #[default]
    Text,
    /// The JSON that is written to the file.
    Json,
}

/// Reads the design named on the command line, or the embedded default.
pub(super) fn design(path: Option<&Path>) -> Result<crate::design::Design> {
    if let Some(path) = path {
        refuse_record(path)?;
    }
    let design = crate::design::reader::read(path)?;
    crate::correction::refuse_unbuildable(&design)?;
    Ok(design)
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
        (Ok(_), Some(what)) => Err(crate::error::InputError::new(format!(
            "this is no design: it looks like {what}"
        ))
        .in_file(path)
        .help(format!(
            "give it with --record {}, and a design (TOML, as `gyrogen init` writes one) or none",
            path.display()
        ))
        .into()),
        // What cannot be read is the reader's to say.
        _ => Ok(()),
    }
}

/// The threads that were asked for, or as many as the machine has.
pub(super) fn threads(asked: Option<u16>) -> usize {
    asked.map_or_else(
        || std::thread::available_parallelism().map_or(1, usize::from),
        usize::from,
    )
}

/// Something with a bar of its progress (done, in all) on a terminal, gone when it ends.
pub(super) fn with_bar<T>(work: impl FnOnce(crate::selftest::Progress<'_>) -> T) -> T {
    let bar: Mutex<Option<indicatif::ProgressBar>> = Mutex::new(None);
    let loud = std::io::stderr().is_terminal();
    let progress = |done: usize, total: usize| {
        if let Ok(mut bar) = bar.lock()
            && loud
        {
            let bar = bar.get_or_insert_with(|| indicatif::ProgressBar::new(total as u64));
            bar.set_position(done as u64);
        }
    };
    let out = work(&progress);
    if let Ok(Some(bar)) = bar.into_inner() {
        bar.finish_and_clear();
    }
    out
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

/// A bundle among the results, in `folder` below theirs and in the place of the bundle that is there; says what was in
/// the way where that was forced.
pub(super) fn bundle(
    files: &[EmittedFile],
    folder: &str,
    results: &mut Results,
    force: bool,
) -> Result<()> {
    let in_the_way = replace::collect(files, folder, results, force)?;
    if !in_the_way.is_empty() {
        talk!("in the way: {}", replace::listed(&in_the_way));
    }
    Ok(())
}

/// A table of numbers for the terminal.
pub(super) fn table(header: &[&str]) -> comfy_table::Table {
    let mut table = comfy_table::Table::new();
    table.load_style(comfy_table::presets::UTF8_HORIZONTAL_ONLY);
    table.set_header(header);
    table
}

/// Emitted code against the model, a line each.
pub(super) fn comparison_table(compared: &[Compared]) -> comfy_table::Table {
    let mut table = table(&[
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
            c.mismatches.to_string(),
        ]);
    }
    for column in table.column_iter_mut().skip(2) {
        column.set_cell_alignment(comfy_table::CellAlignment::Right);
    }
    table
}
