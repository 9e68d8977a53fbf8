//! Verifies a bundle from its own files alone: checksums, build, self-test, tables, vectors.

use super::compare::{self, Compared};
use super::expected;
use super::product;
use super::target::{self, Target};
use super::toolchain::{self, Harness};
use crate::digest::{sha256, with_lf};
use crate::emit::views::Language;
use crate::error::{Error, InputError, Result, io_error};
use crate::firmware::files::EmittedFile;
use crate::firmware::folder::{AGAIN, Folder};
use crate::firmware::manifest::{self, Manifest};
use crate::leftovers::TemporaryFolder;
use crate::numeric::rows::WordRows;
use serde::Serialize;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// `verify.json` (`gyrogen.verify/2`).
#[derive(Debug, Clone, Serialize, schemars::JsonSchema)]
pub struct Verification {
    /// `gyrogen.verify/2`.
    pub schema: &'static str,
    /// Of the tool that verified.
    pub version: &'static str,
    /// As the manifest has it: of the design that the bundle is emitted from, or of the request of `approx`.
    pub design_sha256: String,
    /// SHA-256 of the manifest, which holds those of all other files.
    pub digest: String,
    /// The command that verified.
    pub command: String,
    /// Where the code ran.
    pub target: String,
    /// Compiler and flags.
    pub toolchain: String,
    /// Files that are not what the manifest says.
    pub changed_files: Vec<String>,
    /// Those of them that differ in their line ends alone.
    #[serde(skip)]
    pub other_line_ends: Vec<String>,
    /// What a bundle of this part and language has to hold and does not, what it holds and must not, and what is
    /// not as the digest or the design says.
    pub problems: Vec<String>,
    /// All files are those of the manifest, and the bundle is not the one whose digest or design was given.
    #[serde(skip)]
    pub is_another: bool,
    /// There are sources in the folder that are none of the bundle's.
    #[serde(skip)]
    pub has_foreign: bool,
    /// The command that made the bundle, as its manifest has it.
    #[serde(skip)]
    pub made_by: String,
    /// The code was not built, and why: as the rest of "not run: ...".
    #[serde(skip)]
    pub not_built: Option<&'static str>,
    /// The built-in start-up check passed; null for a bundle of tables alone, which has none.
    pub selftest: Option<bool>,
    /// Over all vectors.
    pub vectors: Vectors,
    /// By function, table and chain.
    pub functions: Vec<Compared>,
    /// Everything agrees.
    pub holds: bool,
}

/// Words compared and inputs that differ.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, schemars::JsonSchema)]
pub struct Vectors {
    /// Output words.
    pub compared: u64,
    /// Inputs with a difference.
    pub mismatches: u64,
}

/// What a bundle is held against beside itself.
#[derive(Debug, Default)]
pub struct Against {
    /// The digest that `emit` printed.
    pub digest: Option<String>,
    /// The design's file.
    pub design: Option<PathBuf>,
}

/// Emits the design's bundle of that part and language, for that command.
pub type Emit<'a> = &'a dyn Fn(&Path, &Manifest) -> Result<Vec<EmittedFile>>;

/// Verifies the bundle in `folder` on this machine, or for another processor under emulation. It builds the bundle's
/// code and runs it.
///
/// # Errors
/// A folder that holds no bundle, vectors that cannot be read, no compiler or emulator; a bundle in Rust for another
/// processor; code that does not compile or does not end.
pub fn verify(
    path: &Path,
    target: Target,
    against: &Against,
    emit: Emit,
    command: &str,
) -> Result<Verification> {
    let folder = Folder::open(path)?;
    let (manifest, digest, as_it_is) = read_manifest(&folder, path)?;
    let language = expected::language(&manifest);
    if language == Language::Rust && target != Target::Host {
        return Err(InputError::new(format!(
            "this bundle is in Rust, and {} is verified with the C bundle",
            target.name()
        ))
        .help("verify the C bundle for this target (both are the same operations), or this one with `--target host`")
        .into());
    }
    let mut problems = expected::problems(&manifest, &folder)?;
    let own = problems.len();
    let has_foreign = problems.iter().any(|p| expected::is_of_foreign(p));
    if let Some(due) = &against.digest
        && ![&digest, &as_it_is]
            .iter()
            .any(|known| due.eq_ignore_ascii_case(known))
    {
        problems.push(format!("the bundle's digest is {digest}, not {due}"));
    }
    if let Some(design) = &against.design {
        problems.extend(other_than(&emit(design, &manifest)?, &folder));
    }
    let changed_files = changed(&manifest, &folder);
    let other_line_ends = in_line_ends(&manifest, &folder, &changed_files);
    let is_another = changed_files.is_empty() && own == 0 && !problems.is_empty();
    let mut run = Run {
        language,
        manifest: &manifest,
        folder: &folder,
        named: path,
        functions: Vec::new(),
    };
    let mut toolchain_name = String::from("none: the part `tables` has nothing to run");
    let mut selftest = None;
    let mut not_built = None;
    let is_product = manifest.part == expected::PRODUCT;
    let is_unlike = is_product && !changed_files.is_empty();
    if !problems.is_empty() || !other_line_ends.is_empty() || is_unlike {
        // What is not what it must be is not run.
        not_built = Some(match is_another {
            true => "nothing was built",
            false => "the files are not those of the bundle, and nothing was built",
        });
        toolchain_name = String::from("none: nothing was built");
    } else if is_product {
        let product = product::Product {
            language,
            manifest: &manifest,
            folder: &folder,
            path,
            target,
        };
        let found = product.verified(command)?;
        (toolchain_name, selftest) = (found.toolchain, Some(found.selftest));
        problems.extend(found.problems);
        run.functions = found.functions;
    } else if manifest.part != "tables" {
        // Built from copies: no name of the folder's reaches a compiler.
        let made = TemporaryFolder::of_the_system()
            .map_err(|e| io_error(std::env::temp_dir(), "make a folder for the build", &e))?;
        let sources = crate::firmware::paths::sources(&manifest.prefix, false, language);
        for source in &sources {
            let to = made.path().join(source);
            if let Some(parent) = to.parent() {
                std::fs::create_dir_all(parent)
                    .map_err(|e| io_error(parent, "make the folder", &e))?;
            }
            crate::output::write_whole(&to, &folder.read(source)?)?;
        }
        let built =
            target::build(target, made.path(), &sources).and_then(|emulated| match emulated {
                Some(emulated) => Ok(emulated),
                None => toolchain::build(language, &manifest.prefix, made.path(), &sources),
            });
        match built {
            Ok(harness) => {
                let status =
                    harness.run(&["selftest".to_owned()], Vec::new(), (1, 64), &mut |_| ())?;
                selftest = Some(status == Some(0));
                toolchain_name = harness.toolchain.clone();
                run.all(&harness)?;
                let empty = run.functions.iter().filter(|f| f.compared == 0);
                problems.extend(empty.map(|f| format!("nothing of `{}` was compared", f.name)));
            }
            // Which file was changed says more than what a compiler thinks of it.
            Err(Error::Check(said)) if !changed_files.is_empty() => {
                let why = "the changed files do not compile";
                not_built = Some(why);
                toolchain_name = format!("none: {why}");
                // The folder of the build has another name each time.
                let place = format!("{}{}", made.path().display(), std::path::MAIN_SEPARATOR);
                let error = said.lines().skip(1).find(|line| line.contains("error"));
                let error = error.unwrap_or_default().replace(&place, "");
                problems.push(format!("{why}: {error}"));
            }
            Err(error) => return Err(error),
        }
    } else {
        run.tables_alone(&mut problems)?;
    }
    let functions = run.functions;
    let vectors = Vectors {
        compared: functions.iter().map(|f| f.compared).sum(),
        mismatches: functions.iter().map(|f| f.mismatches).sum(),
    };
    Ok(Verification {
        schema: "gyrogen.verify/2",
        version: env!("CARGO_PKG_VERSION"),
        holds: changed_files.is_empty()
            && problems.is_empty()
            && selftest != Some(false)
            && vectors.mismatches == 0,
        design_sha256: manifest.design_sha256,
        digest,
        command: command.to_owned(),
        target: target.name().into(),
        toolchain: toolchain_name,
        changed_files,
        other_line_ends,
        is_another,
        has_foreign,
        made_by: manifest.command,
        not_built,
        problems,
        selftest,
        vectors,
        functions,
    })
}

/// The manifest; its digest, as `emit` printed it, whatever git made of its line ends since; and that of the file as it is.
fn read_manifest(folder: &Folder, path: &Path) -> Result<(Manifest, String, String)> {
    let named = path.join(manifest::NAME);
    let text = folder.read_text(manifest::NAME)?;
    let manifest: Manifest = serde_json::from_str(&text).map_err(|e| {
        InputError::new(format!("this is no manifest of a bundle: {e}"))
            .in_file(&named)
            .at(e.line().max(1), e.column().max(1))
            .help(format!(
                "{AGAIN}, with `--force` where it refuses the damaged manifest"
            ))
    })?;
    if let Some(why) = expected::unusable(&manifest) {
        return Err(
            InputError::new(format!("the manifest cannot be used: {why}"))
                .in_file(&named)
                .help(AGAIN)
                .into(),
        );
    }
    let digest = sha256(with_lf(&text).as_bytes());
    Ok((manifest, digest, sha256(text.as_bytes())))
}

/// Files that are missing or not what the manifest says.
fn changed(manifest: &Manifest, folder: &Folder) -> Vec<String> {
    let differs = |file: &&manifest::FileEntry| {
        let bytes = folder.read(&file.path);
        bytes.map_or(true, |b| sha256(&b) != file.sha256)
    };
    let files = manifest.files.iter().filter(differs);
    files.map(|file| file.path.clone()).collect()
}

/// Those of the changed files that are the manifest's once CR LF is LF again, as git may have changed it.
fn in_line_ends(manifest: &Manifest, folder: &Folder, changed: &[String]) -> Vec<String> {
    let is_same = |file: &&manifest::FileEntry| {
        let text = folder.read_text(&file.path);
        text.is_ok_and(|t| sha256(with_lf(&t).as_bytes()) == file.sha256)
    };
    let files = manifest.files.iter().filter(|f| changed.contains(&f.path));
    let files = files.filter(is_same);
    files.map(|file| file.path.clone()).collect()
}

/// How the folder differs from what a design emits, in a sentence.
fn other_than(due: &[EmittedFile], folder: &Folder) -> Option<String> {
    let differs = |file: &&EmittedFile| {
        let bytes = folder.read(&file.path);
        bytes.map_or(true, |bytes| bytes != file.text.as_bytes())
    };
    let files: Vec<&str> = due
        .iter()
        .filter(differs)
        .map(|f| f.path.as_str())
        .collect();
    match files[..] {
        [] => None,
        [one] => Some(format!("{one} is not what the design emits")),
        _ => Some(format!(
            "{} of {} files are not what the design emits: {}",
            files.len(),
            due.len(),
            files.join(", ")
        )),
    }
}

/// The comparisons of one bundle.
struct Run<'a> {
    language: Language,
    manifest: &'a Manifest,
    folder: &'a Folder,
    named: &'a Path,
    functions: Vec<Compared>,
}

impl Run<'_> {
    fn all(&mut self, harness: &Harness) -> Result<()> {
        let language = self.language;
        let tables = self.tables()?;
        for table in &self.manifest.tables {
            let expected = tables.get(&table.name).cloned().unwrap_or_default();
            self.functions
                .push(compare::table(language, harness, &table.name, &expected)?);
        }
        for function in &self.manifest.functions {
            let (inputs, outputs) = self.split(function)?;
            let name = &function.name;
            self.functions
                .push(compare::calls(language, harness, name, &inputs, &outputs)?);
            if let Some(due) = &function.every_input {
                let words = function.outputs + 1;
                self.functions
                    .push(compare::every_input(language, harness, name, words, due)?);
            }
        }
        if let Some(sequence) = &self.manifest.sequence {
            let (inputs, outputs) = self.split(sequence)?;
            let name = &sequence.name;
            self.functions.push(compare::sequence(
                language, harness, name, &inputs, &outputs,
            )?);
        }
        if let Some(chain) = &self.manifest.chain {
            let codes = self.words("chain_input", 2)?;
            let rows = self.words("chain_output", chain.columns.len() + 1)?;
            let column = |k: usize| codes.iter().map(|row| row[k] as i32).collect::<Vec<_>>();
            let (drive, sense) = (column(0), column(1));
            let mut compared = compare::chain_rows(language, harness, &drive, &sense, &rows)?;
            if codes.len() as u64 != rows.len() as u64 * u64::from(chain.ratio) {
                compared.mismatches += 1;
                let what = format!(
                    "{} samples are no {} rows of {}",
                    codes.len(),
                    rows.len(),
                    chain.ratio
                );
                compared.first.get_or_insert(what);
            }
            self.functions.push(compared);
        }
        if let Some(due) = &self.manifest.long_run {
            let words = self.manifest.sequence.as_ref().map(|s| s.outputs + 1);
            self.functions.push(compare::long_run(
                language,
                harness,
                words.unwrap_or(1),
                due,
            )?);
        }
        Ok(())
    }

    /// Of a bundle of tables alone: the files hold the entries of the vectors.
    fn tables_alone(&self, problems: &mut Vec<String>) -> Result<()> {
        let tables = self.tables()?;
        for table in &self.manifest.tables {
            let entries = tables.get(&table.name).map_or(0, Vec::len);
            if entries == 0 || entries != table.entries {
                problems.push(format!(
                    "the vectors have {entries} entries of `{}`, not {}",
                    table.name, table.entries
                ));
            }
        }
        Ok(())
    }

    /// The vectors of a function: inputs and outputs.
    fn split(&self, function: &manifest::FunctionEntry) -> Result<(WordRows, WordRows)> {
        let columns = function
            .inputs
            .saturating_add(function.outputs)
            .saturating_add(1);
        Ok(split(
            &self.words(&function.name, columns)?,
            function.inputs,
        ))
    }

    /// Rows of integers under one header line, `columns` each.
    fn words(&self, name: &str, columns: usize) -> Result<WordRows> {
        let name = format!("vectors/{name}.csv");
        let text = self.folder.read_text(&name)?;
        let mut rows = WordRows::new(columns);
        for (number, line) in text.lines().enumerate() {
            let cells = line.split(',');
            if number == 0 && cells.clone().count() == columns {
                continue;
            }
            let words: std::result::Result<Vec<i128>, _> = cells.map(str::parse).collect();
            match words {
                Ok(words) if words.len() == columns && number > 0 => rows.push(words),
                _ => {
                    return Err(InputError::new(format!(
                        "line {} has not {columns} columns of integers",
                        number + 1
                    ))
                    .in_file(self.named.join(&name))
                    .at(number + 1, 1)
                    .help(format!("the vectors were damaged; {AGAIN}"))
                    .into());
                }
            }
        }
        Ok(rows)
    }

    fn tables(&self) -> Result<BTreeMap<String, Vec<i64>>> {
        let name = "vectors/tables.csv";
        let text = self.folder.read_text(name)?;
        let mut tables: BTreeMap<String, Vec<i64>> = BTreeMap::new();
        for (number, line) in text.lines().enumerate().skip(1) {
            let cells: Vec<&str> = line.split(',').collect();
            let parsed = match cells.as_slice() {
                [name, entry, value] => {
                    let entries = tables.entry((*name).to_owned()).or_default();
                    let counted = entry.parse() == Ok(entries.len());
                    counted
                        .then(|| value.parse::<i64>().ok())
                        .flatten()
                        .map(|v| entries.push(v))
                }
                _ => None,
            };
            if parsed.is_none() {
                return Err(
                    InputError::new(format!("line {} is no entry of a table", number + 1))
                        .in_file(self.named.join(name))
                        .at(number + 1, 1)
                        .help(format!("the vectors were damaged; {AGAIN}"))
                        .into(),
                );
            }
        }
        Ok(tables)
    }
}

/// Rows as inputs and outputs.
fn split(rows: &WordRows, inputs: usize) -> (WordRows, WordRows) {
    let mut parts = (
        WordRows::new(inputs),
        WordRows::new(rows.columns() - inputs),
    );
    for row in rows.iter() {
        let (given, due) = row.split_at(inputs);
        parts.0.push(given.iter().map(|word| i128::from(*word)));
        parts.1.push(due.iter().map(|word| i128::from(*word)));
    }
    parts
}
