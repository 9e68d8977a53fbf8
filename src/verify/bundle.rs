//! Verifies a bundle from its own files alone: checksums, build, self-test, tables, vectors.

use super::compare::{self, Compared};
use super::target::{self, Target};
use super::toolchain;
use crate::emit::views::Language;
use crate::error::{InputError, Result, io_error};
use crate::firmware::manifest;
use crate::firmware::manifest::Manifest;
use serde::Serialize;
use std::collections::BTreeMap;
use std::path::Path;

/// `verify.json` (`gyrogen.verify/1`).
#[derive(Debug, Clone, Serialize, schemars::JsonSchema)]
pub struct Verification {
    /// `gyrogen.verify/1`.
    pub schema: &'static str,
    /// Of the tool that verified.
    pub version: &'static str,
    /// Of the design that the bundle was made from.
    pub design_sha256: String,
    /// The command that verified.
    pub command: String,
    /// Where the code ran.
    pub target: String,
    /// Compiler and flags.
    pub toolchain: String,
    /// Files that are not what the manifest says.
    pub changed_files: Vec<String>,
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

/// Verifies the bundle in `folder` on this machine, or for another processor under emulation.
///
/// # Errors
/// A folder that holds no bundle, vectors that cannot be read, no compiler or emulator; a bundle in Rust for another
/// processor; code that does not compile.
pub fn verify(folder: &Path, target: Target, command: &str) -> Result<Verification> {
    let manifest = read_manifest(folder)?;
    let language = match manifest.language.as_str() {
        "c" => Language::C,
        _ => Language::Rust,
    };
    if language == Language::Rust && target != Target::Host {
        return Err(InputError::new(format!(
            "this bundle is in Rust, and {} is verified with the C bundle",
            target.name()
        ))
        .help("verify the C bundle for this target (both are the same operations), or this one with `--target host`")
        .into());
    }
    let changed_files = changed(&manifest, folder);
    let mut functions = Vec::new();
    let mut toolchain_name = String::from("none: the part `tables` has nothing to run");
    let mut selftest = None;
    let sources: Vec<String> = manifest.files.iter().map(|f| f.path.clone()).collect();
    let harness_source = |path: &String| path.contains("harness");
    if sources.iter().any(harness_source) {
        let harness = match target::build(target, folder, &sources)? {
            Some(emulated) => emulated,
            None => toolchain::build(language, &manifest.prefix, folder, &sources)?,
        };
        let status = harness.run(&["selftest".to_owned()], Vec::new(), 1, &mut |_| ())?;
        selftest = Some(status == Some(0));
        toolchain_name = harness.toolchain.clone();
        let tables = read_tables(folder)?;
        for table in &manifest.tables {
            let expected = tables.get(&table.name).cloned().unwrap_or_default();
            functions.push(compare::table(language, &harness, &table.name, &expected)?);
        }
        for function in &manifest.functions {
            let path = folder.join(format!("vectors/{}.csv", function.name));
            let rows = read_words(&path, function.inputs + function.outputs + 1)?;
            let split = split(rows, function.inputs);
            functions.push(compare::calls(
                language,
                &harness,
                &function.name,
                &split.0,
                &split.1,
            )?);
            if let Some(path) = &function.every_input {
                let blocks = read_words(&folder.join(path), 3)?;
                let words = function.outputs + 1;
                let every =
                    compare::every_input(language, &harness, &function.name, words, &blocks)?;
                functions.push(every);
            }
        }
        if let Some(stream) = &manifest.stream {
            let path = folder.join(format!("vectors/{}.csv", stream.name));
            let rows = read_words(&path, stream.inputs + stream.outputs + 1)?;
            let (inputs, outputs) = split(rows, stream.inputs);
            let name = &stream.name;
            functions.push(compare::stream(
                language, &harness, name, &inputs, &outputs,
            )?);
        }
        if let Some(chain) = &manifest.chain {
            let codes = read_words(&folder.join("vectors/chain_input.csv"), 2)?;
            let path = folder.join("vectors/chain_output.csv");
            let rows = read_words(&path, chain.columns.len() + 1)?;
            let column = |k: usize| codes.iter().map(|row| row[k] as i32).collect::<Vec<_>>();
            functions.push(compare::chain_rows(
                language,
                &harness,
                &column(0),
                &column(1),
                &rows,
            )?);
        }
    }
    let vectors = Vectors {
        compared: functions.iter().map(|f| f.compared).sum(),
        mismatches: functions.iter().map(|f| f.mismatches).sum(),
    };
    Ok(Verification {
        schema: "gyrogen.verify/1",
        version: env!("CARGO_PKG_VERSION"),
        design_sha256: manifest.design_sha256,
        command: command.to_owned(),
        target: target.name().into(),
        toolchain: toolchain_name,
        holds: changed_files.is_empty() && selftest != Some(false) && vectors.mismatches == 0,
        changed_files,
        selftest,
        vectors,
        functions,
    })
}

fn read_manifest(folder: &Path) -> Result<Manifest> {
    let path = folder.join(manifest::NAME);
    let text = std::fs::read_to_string(&path)
        .map_err(|e| io_error(&path, "read the bundle's manifest", &e))?;
    let manifest: Manifest = serde_json::from_str(&text).map_err(|e| {
        InputError::new(format!("this is no manifest of a bundle: {e}"))
            .in_file(&path)
            .at(e.line().max(1), e.column().max(1))
            .help("emit the bundle again with `gyrogen emit`")
    })?;
    let inside = |path: &str| {
        let parts = Path::new(path).components();
        parts
            .into_iter()
            .all(|c| matches!(c, std::path::Component::Normal(_)))
    };
    if manifest.schema != "gyrogen.bundle/1" || !manifest.files.iter().all(|f| inside(&f.path)) {
        return Err(InputError::new(format!(
            "the manifest's schema is `{}`, or it names files outside the bundle",
            manifest.schema
        ))
        .in_file(&path)
        .help("this version verifies `gyrogen.bundle/1`; emit the bundle again")
        .into());
    }
    Ok(manifest)
}

/// Files that are missing or not what the manifest says.
fn changed(manifest: &Manifest, folder: &Path) -> Vec<String> {
    let differs = |file: &&manifest::FileEntry| {
        let bytes = std::fs::read(folder.join(&file.path));
        bytes.map_or(true, |b| crate::digest::sha256(&b) != file.sha256)
    };
    let files = manifest.files.iter().filter(differs);
    files.map(|file| file.path.clone()).collect()
}

/// Rows of integers under one header line, `columns` each.
fn read_words(path: &Path, columns: usize) -> Result<Vec<Vec<i128>>> {
    let text = std::fs::read_to_string(path).map_err(|e| io_error(path, "read the vectors", &e))?;
    let mut rows = Vec::new();
    for (number, line) in text.lines().enumerate().skip(1) {
        let words: std::result::Result<Vec<i128>, _> = line.split(',').map(str::parse).collect();
        match words {
            Ok(words) if words.len() == columns => rows.push(words),
            _ => {
                return Err(
                    InputError::new(format!("`{line}` is no row of {columns} integers"))
                        .in_file(path)
                        .at(number + 1, 1)
                        .help("the vectors were damaged; emit the bundle again")
                        .into(),
                );
            }
        }
    }
    Ok(rows)
}

/// Rows as inputs and outputs.
fn split(rows: Vec<Vec<i128>>, inputs: usize) -> (Vec<Vec<i128>>, Vec<Vec<i128>>) {
    let parts = rows.into_iter().map(|mut row| {
        let outputs = row.split_off(inputs);
        (row, outputs)
    });
    parts.unzip()
}

fn read_tables(folder: &Path) -> Result<BTreeMap<String, Vec<i128>>> {
    let path = folder.join("vectors/tables.csv");
    let text =
        std::fs::read_to_string(&path).map_err(|e| io_error(&path, "read the tables", &e))?;
    let mut tables: BTreeMap<String, Vec<i128>> = BTreeMap::new();
    for (number, line) in text.lines().enumerate().skip(1) {
        let cells: Vec<&str> = line.split(',').collect();
        match (
            cells.as_slice(),
            cells.last().and_then(|v| v.parse::<i128>().ok()),
        ) {
            ([name, _, _], Some(value)) => {
                tables.entry((*name).to_owned()).or_default().push(value)
            }
            _ => {
                return Err(InputError::new(format!("`{line}` is no entry of a table"))
                    .in_file(&path)
                    .at(number + 1, 1)
                    .help("the vectors were damaged; emit the bundle again")
                    .into());
            }
        }
    }
    Ok(tables)
}
