//! What the subcommands share: lines and tables on the terminal, progress, JSON, the design that was named.

use crate::emit::views::Language;
use crate::error::Result;
use crate::verify::compare::Compared;
use clap::ValueEnum;
use std::io::IsTerminal;
use std::sync::Mutex;

/// A line on stdout. A reader that has gone away (`| head`) is no reason to stop: what is written to files
/// is.
macro_rules! say {
    ($($words:tt)*) => {{
        use std::io::Write as _;
        _ = writeln!(std::io::stdout(), $($words)*);
    }};
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
pub(super) fn design(path: Option<&std::path::Path>) -> Result<crate::design::Design> {
    let design = crate::design::reader::read(path)?;
    crate::correction::refuse_unbuildable(&design)?;
    Ok(design)
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
    // Structures of strings and finite numbers always have a JSON form.
    serde_json::to_string_pretty(value).unwrap_or_default() + "\n"
}

/// The languages that emitted code is built in, of those asked for; says for which there is no compiler.
pub(super) fn languages(asked: Option<Language>) -> Result<Vec<Language>> {
    let (found, lacking) = crate::verify::toolchain::languages(asked)?;
    for why in lacking {
        let other = found
            .first()
            .map_or("", |l| crate::verify::compare::language_name(*l));
        eprintln!(
            "note: only the emitted code of one language ({other}) is built and compared: {why}"
        );
    }
    Ok(found)
}

/// Says which files were in the way of a bundle that was written all the same.
pub(super) fn in_the_way(files: &[String]) {
    if !files.is_empty() {
        eprintln!("in the way: {}", crate::firmware::replace::listed(files));
    }
}

/// Makes a folder for results.
pub(super) fn make_folder(folder: &std::path::Path) -> Result<()> {
    std::fs::create_dir_all(folder)
        .map_err(|e| crate::error::io_error(folder, "make the folder", &e))
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
