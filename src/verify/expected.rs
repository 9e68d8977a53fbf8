//! What a bundle has to hold, known from its part and its language and from what its sources declare, not from
//! what its manifest asks for.

use crate::digest::{sha256, with_lf};
use crate::emit::views::Language;
use crate::error::Result;
use crate::firmware::folder::{Folder, is_plain};
use crate::firmware::manifest::{self, Manifest};
use crate::firmware::paths;

/// Functions without which there is no such part.
const FUNCTIONS: [(&str, &[&str]); 7] = [
    (
        "chain",
        &[
            "nco",
            "demodulate",
            "integrate",
            "decimate",
            "cordic",
            "period",
        ],
    ),
    ("compensation", &["bias", "rate", "compensate"]),
    (manifest::FUNCTION, &["evaluate"]),
    ("correction", &["correct"]),
    ("conversion", &["convert"]),
    ("tables", &[]),
    // Its parts have them.
    (PRODUCT, &[]),
];
/// The part that has parts.
pub(super) const PRODUCT: &str = "all";
/// Parts of one function that is called in order.
const SEQUENCES: [&str; 2] = ["correction", "conversion"];
/// Most words of a line of vectors.
const MOST_WORDS: usize = 4096;
/// Endings of files that a build takes.
const SOURCES: [&str; 16] = [
    "c", "h", "cc", "cpp", "cxx", "hh", "hpp", "hxx", "inc", "s", "asm", "rs", "toml", "cmake",
    "mk", "ld",
];

/// What of the manifest has to be right before anything is done with it; the first thing that is not.
pub(super) fn unusable(manifest: &Manifest) -> Option<String> {
    let name = |text: &str| {
        let mut letters = text.chars();
        letters
            .next()
            .is_some_and(|c| c.is_ascii_alphabetic() || c == '_')
            && letters.all(|c| c.is_ascii_alphanumeric() || c == '_')
            && text.len() <= 64
    };
    let entries = manifest.functions.iter().chain(&manifest.sequence);
    if manifest.schema != manifest::SCHEMA {
        return Some(format!(
            "its schema is {:?}, and this version verifies `{}`",
            manifest.schema,
            manifest::SCHEMA
        ));
    }
    if !["c", "rust"].contains(&manifest.language.as_str()) {
        return Some(format!("its language is {:?}", manifest.language));
    }
    if !FUNCTIONS.iter().any(|(part, _)| *part == manifest.part) {
        return Some(format!("its part is {:?}", manifest.part));
    }
    let names = entries.clone().map(|f| &f.name);
    let names = names
        .chain(manifest.tables.iter().map(|t| &t.name))
        .chain([&manifest.prefix]);
    if let Some(wrong) = names.into_iter().find(|text| !name(text)) {
        return Some(format!("{wrong:?} is no name"));
    }
    if let Some(file) = manifest.files.iter().find(|f| !is_plain(&f.path)) {
        return Some(format!(
            "{:?} is no plain path inside the folder",
            file.path
        ));
    }
    let words = |f: &manifest::FunctionEntry| f.inputs.saturating_add(f.outputs);
    if let Some(f) = entries.into_iter().find(|f| words(f) >= MOST_WORDS) {
        return Some(format!("{} has more than {MOST_WORDS} words", f.name));
    }
    let texts = [
        &manifest.version,
        &manifest.command,
        &manifest.design_sha256,
    ];
    let node = manifest.faults.iter().map(|f| &f.node);
    let columns = manifest.chain.iter().flat_map(|c| &c.columns);
    let mut texts = texts.into_iter().chain(node).chain(columns);
    if let Some(text) = texts.find(|text| text.chars().any(char::is_control)) {
        return Some(format!("{text:?} has a control character"));
    }
    None
}

pub(super) fn language(manifest: &Manifest) -> Language {
    match manifest.language.as_str() {
        "c" => Language::C,
        _ => Language::Rust,
    }
}

/// The files of vectors that a manifest's functions need.
fn vectors(manifest: &Manifest) -> Vec<String> {
    let mut names: Vec<&str> = manifest.functions.iter().map(|f| f.name.as_str()).collect();
    names.push("tables");
    if manifest.part == "chain" {
        names.extend(["chain_input", "chain_output"]);
    }
    if SEQUENCES.contains(&manifest.part.as_str()) {
        names.push(crate::firmware::stepped::SEQUENCE);
    }
    names
        .iter()
        .map(|name| format!("vectors/{name}.csv"))
        .collect()
}

/// What is said of a source that is none of the bundle's.
const NOT_LISTED: &str = "is a source that the manifest does not list";

/// True for a problem that is a file of somebody's own.
pub(super) fn is_of_foreign(problem: &str) -> bool {
    problem.ends_with(NOT_LISTED)
}

/// What is missing, what is too much, what does not go together.
///
/// # Errors
/// A folder or source that cannot be read.
pub(super) fn problems(manifest: &Manifest, folder: &Folder) -> Result<Vec<String>> {
    let mut problems = Vec::new();
    let language = language(manifest);
    let only_tables = manifest.part == "tables";
    let is_product = manifest.part == PRODUCT;
    let due = match is_product {
        true => of_product(manifest, folder, &mut problems),
        false => {
            let sources = paths::sources(&manifest.prefix, only_tables, language);
            sources.into_iter().chain(vectors(manifest)).collect()
        }
    };
    let listed: Vec<&str> = manifest.files.iter().map(|f| f.path.as_str()).collect();
    for path in &due {
        match listed.iter().filter(|p| *p == path).count() {
            0 => problems.push(format!("the manifest lacks {path}")),
            1 => {}
            _ => problems.push(format!("the manifest names {path} more than once")),
        }
    }
    let unknown = listed.iter().filter(|path| !due.iter().any(|d| d == *path));
    problems
        .extend(unknown.map(|path| format!("the manifest names {path}, which no such bundle has")));
    for path in folder.files()? {
        let name = path.rsplit('/').next().unwrap_or("");
        let ending = name
            .rsplit_once('.')
            .map(|(_, ending)| ending.to_ascii_lowercase());
        let is_source = ending.is_some_and(|e| SOURCES.contains(&e.as_str()))
            || ["Makefile", "makefile", "GNUmakefile", "CMakeLists.txt"].contains(&name);
        if is_source && !listed.contains(&path.as_str()) {
            problems.push(format!("{path:?} {NOT_LISTED}"));
        }
    }
    entries(manifest, &mut problems);
    if !only_tables && !is_product {
        declared(manifest, language, folder, &mut problems);
    }
    if !only_tables && !has_sums(manifest, folder) {
        problems.push(format!("{} is not of these files", paths::SUMS));
    }
    banners(manifest, folder, &mut problems);
    if manifest.seal != manifest.sealed() {
        problems.push("the manifest is not as it was written (its seal is another)".to_owned());
    }
    Ok(problems)
}

/// The files that a product has: its own, and those of its parts as their manifests name them, of which each is to be
/// of the product's design, command and language.
fn of_product(manifest: &Manifest, folder: &Folder, problems: &mut Vec<String>) -> Vec<String> {
    let mut due = paths::of_product(&manifest.prefix, language(manifest));
    let named = manifest.parts.iter().map(|p| p.part.as_str());
    if !named.eq(paths::PARTS) {
        problems.push(format!("its parts are not {}", paths::PARTS.join(", ")));
    }
    for part in paths::PARTS {
        let path = format!("{part}/{}", manifest::NAME);
        let text = folder.read_text(&path).unwrap_or_default();
        due.push(path.clone());
        let Ok(of_part) = serde_json::from_str::<Manifest>(&text) else {
            problems.push(format!("{path} is no manifest of a bundle"));
            continue;
        };
        let digest = sha256(with_lf(&text).as_bytes());
        let known = |p: &manifest::PartEntry| p.part == part && p.digest == digest;
        if !manifest.parts.iter().any(known) {
            problems.push(format!(
                "the digest of {path} is not that of the product's part"
            ));
        }
        let whole = |m: &Manifest| {
            let texts = [&m.version, &m.design_sha256, &m.command, &m.language];
            texts.map(String::clone)
        };
        let prefix = paths::prefix_of(&manifest.prefix, part);
        if of_part.part != part || of_part.prefix != prefix || whole(&of_part) != whole(manifest) {
            problems.push(format!("{path} is not of this product"));
        }
        due.extend(of_part.files.iter().map(|f| format!("{part}/{}", f.path)));
    }
    due
}

/// Line ends are no part of what is compared here: a file that git changed them in is told of as such.
fn has_sums(manifest: &Manifest, folder: &Folder) -> bool {
    let text = folder.read_text(paths::SUMS);
    text.is_ok_and(|t| with_lf(&t) == sums(manifest))
}

/// The lines of the checksums for who has no gyrogen.
fn sums(manifest: &Manifest) -> String {
    let files = manifest.files.iter().filter(|f| f.path != paths::SUMS);
    files
        .map(|f| format!("{}  {}\n", f.sha256, f.path))
        .collect()
}

/// Functions, tables and chain that the part has to have, and their numbers in the self-test.
fn entries(manifest: &Manifest, problems: &mut Vec<String>) {
    let part = manifest.part.as_str();
    let due = FUNCTIONS
        .iter()
        .find(|(p, _)| *p == part)
        .map_or(&[][..], |(_, f)| f);
    let is = |name: &str, due: &str| {
        name == due
            || name
                .strip_prefix(due)
                .is_some_and(|rest| rest.starts_with('_'))
    };
    for name in due {
        if !manifest.functions.iter().any(|f| is(&f.name, name)) {
            problems.push(format!(
                "the manifest has no vectors of `{name}`, which part {part} has"
            ));
        }
    }
    let is_chain = part == "chain";
    let is_sequence = SEQUENCES.contains(&part);
    let present = [
        ("chain", manifest.chain.is_some(), is_chain),
        ("sequence", manifest.sequence.is_some(), is_sequence),
        (
            "long_run",
            manifest.long_run.is_some(),
            is_chain || is_sequence,
        ),
        ("parts", !manifest.parts.is_empty(), part == PRODUCT),
    ];
    for (key, is, due) in present {
        if is != due {
            let has = if due { "lacks" } else { "has" };
            problems.push(format!(
                "the manifest {has} `{key}`, against its part {part}"
            ));
        }
    }
    if (is_chain || part == "tables") && manifest.tables.is_empty() {
        problems.push("the manifest has no tables".to_owned());
    }
    if part == "tables" && !manifest.functions.is_empty() {
        problems.push("a bundle of tables has no functions".to_owned());
    }
    let numbers = manifest.tables.iter().map(|t| t.number);
    let numbers = numbers.chain(manifest.functions.iter().map(|f| f.number));
    let numbers = numbers.chain(manifest.chain.as_ref().map(|c| c.number));
    let numbers = numbers.chain(manifest.sequence.as_ref().map(|s| s.number));
    let numbers: Vec<u32> = numbers.collect();
    if !numbers.iter().copied().eq(1..=numbers.len() as u32) {
        problems.push("the manifest's numbers of the self-test do not count from 1".to_owned());
    }
    if manifest
        .long_run
        .as_ref()
        .is_some_and(|run| run.steps < crate::firmware::vectors::LONG)
    {
        problems.push(format!(
            "the long run has fewer than {} steps",
            crate::firmware::vectors::LONG
        ));
    }
    let many = 1 << crate::vectors::stimulus::EXHAUSTIVE_BITS;
    let every = manifest
        .functions
        .iter()
        .filter_map(|f| f.every_input.as_ref());
    if every.into_iter().any(|e| e.inputs == 0 || e.inputs > many) {
        problems.push("a function's number of all inputs is none that is run".to_owned());
    }
}

/// What the sources declare has to be what the manifest has entries for.
fn declared(manifest: &Manifest, language: Language, folder: &Folder, problems: &mut Vec<String>) {
    let p = &manifest.prefix;
    let read = |path: &str| folder.read_text(path).unwrap_or_default();
    let (functions, tables) = match language {
        Language::C => {
            let of = |line: &str| -> Option<String> {
                let (before, _) = line.strip_suffix(");")?.split_once('(')?;
                let name = before.rsplit([' ', '*']).next()?;
                Some(name.strip_prefix(&format!("{p}_"))?.to_owned())
            };
            let header = read(&format!("{p}.h"));
            let functions: Vec<String> = header
                .lines()
                .filter(|l| !l.starts_with(' '))
                .filter_map(of)
                .collect();
            let of = |line: &str| -> Option<(String, String)> {
                let (before, len) = line
                    .strip_prefix("extern const ")?
                    .strip_suffix("];")?
                    .split_once('[')?;
                let name = before.rsplit(' ').next()?.strip_prefix(&format!("{p}_"))?;
                Some((name.to_owned(), len.to_owned()))
            };
            let header = read(&format!("{p}_tables.h"));
            (functions, header.lines().filter_map(of).collect::<Vec<_>>())
        }
        Language::Rust => {
            let library = read("src/lib.rs");
            let of = |line: &str| -> Option<String> {
                let (_, after) = line.strip_prefix("pub ")?.split_once("fn ")?;
                Some(after.split_once('(')?.0.to_owned())
            };
            let functions: Vec<String> = library.lines().filter_map(of).collect();
            let of = |line: &str| -> Option<(String, String)> {
                let (name, ty) = line.strip_prefix("pub static ")?.split_once(": [")?;
                let len = ty.split_once("; ")?.1.split_once(']')?.0;
                Some((name.to_lowercase(), len.to_owned()))
            };
            let tables = library.lines().filter_map(of).collect();
            (functions, tables)
        }
    };
    // `push` calls `sample`; their vectors are the chain's.
    let own = ["init", "push", "selftest", "sample"];
    let functions: Vec<&str> = functions
        .iter()
        .map(String::as_str)
        .filter(|f| !own.contains(f))
        .collect();
    for name in &functions {
        if !manifest.functions.iter().any(|f| f.name == *name) {
            problems.push(format!(
                "the sources declare `{name}`, of which the manifest has no vectors"
            ));
        }
    }
    for f in &manifest.functions {
        if !functions.contains(&f.name.as_str()) {
            problems.push(format!("the sources do not declare `{}`", f.name));
        }
    }
    for (name, len) in &tables {
        if !manifest
            .tables
            .iter()
            .any(|t| t.name == *name && t.entries.to_string() == *len)
        {
            problems.push(format!(
                "the sources declare the table `{name}` of {len} entries, the manifest does not"
            ));
        }
    }
    for t in &manifest.tables {
        if !tables.iter().any(|(name, _)| *name == t.name) {
            problems.push(format!("the sources do not declare the table `{}`", t.name));
        }
    }
}

/// Each source says where it comes from, as the manifest does.
fn banners(manifest: &Manifest, folder: &Folder, problems: &mut Vec<String>) {
    let banner = manifest::banner_of(
        &manifest.version,
        manifest.source(),
        &manifest.design_sha256,
        &manifest.command,
    );
    for file in manifest
        .files
        .iter()
        .filter(|f| !f.path.starts_with("vectors/") && f.path != paths::SUMS)
        // Each part is looked at by itself.
        .filter(|f| {
            let folder = f.path.split('/').next().unwrap_or("");
            manifest.part != PRODUCT || !paths::PARTS.contains(&folder)
        })
    {
        // A file that is missing is told as such.
        let Ok(text) = folder.read_text(&file.path) else {
            continue;
        };
        let mut head = text.lines().take(manifest::HEAD_LINES);
        if !head.any(|line| line.contains(&banner)) {
            problems.push(format!(
                "{} does not say that it comes from the manifest's command and design",
                file.path
            ));
        }
    }
}
