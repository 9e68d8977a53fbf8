//! What stands in a folder that a bundle goes into: the files of an older bundle, and files of the user's.

use super::emitted::EmittedFile;
use super::folder::{Folder, is_plain};
use super::manifest::{self, Manifest};
use super::paths;
use crate::digest::sha256;
use crate::error::{Error, InputError, Result};
use std::path::Path;

/// What `verify` writes into a bundle's folder.
const VERIFIED: [&str; 2] = ["verify.json", crate::timing::NAME];
/// What a build leaves there.
const BUILT: &str = "Cargo.lock";

/// What stands in a folder that a bundle goes into.
#[derive(Debug, Default, PartialEq, Eq)]
pub(super) struct Found {
    /// Files of the bundle that is there.
    pub old: Vec<String>,
    /// Those of them that are not as they were written.
    edited: Vec<String>,
    /// Those of them of which nothing says how they were written.
    unknown: Vec<String>,
    /// What `verify` wrote.
    pub verified: Vec<String>,
    /// Files that are none of the bundle's.
    foreign: Vec<String>,
    /// What is wrong with the manifest of the bundle that is there.
    damage: Option<Damage>,
}

/// What is wrong with a manifest that does not name the bundle's files.
#[derive(Debug, Clone, PartialEq, Eq)]
struct Damage {
    why: String,
    /// Line and column.
    place: Option<(usize, usize)>,
}

impl Damage {
    fn new(why: &str) -> Self {
        Damage {
            why: why.to_owned(),
            place: None,
        }
    }

    fn of_json(e: &serde_json::Error) -> Self {
        let text = e.to_string();
        // The place is told at the head of the message.
        let why = text.split(" at line ").next().unwrap_or(&text);
        Damage {
            why: why.to_owned(),
            place: Some((e.line().max(1), e.column().max(1))),
        }
    }
}

/// A file's path and the SHA-256 that it was written with.
type Entry = (String, String);

impl Found {
    /// Looks at a folder, which may be missing.
    ///
    /// # Errors
    /// A folder that cannot be read.
    pub fn in_folder(path: &Path) -> Result<Self> {
        let mut found = Found::default();
        if path.symlink_metadata().is_err() {
            return Ok(found);
        }
        let folder = Folder::open(path)?;
        let files = folder.files()?;
        if folder.holds(manifest::NAME) {
            let text = folder.read_text(manifest::NAME);
            match text.as_deref().map_or_else(
                |_| Err(Damage::new("it is no regular file with text")),
                listed,
            ) {
                Ok(entries) => found.by_manifest(&folder, &entries, &text.unwrap_or_default()),
                Err(damage) => found.by_first_lines(&folder, &files, damage),
            }
        }
        // A product's parts are bundles in folders of their own.
        let is = |path: &str, name: &str| path.rsplit('/').next() == Some(name);
        let others = files.into_iter();
        let others = others.filter(|f| !found.old.contains(f) && !is(f, BUILT));
        let (verified, foreign) = others.partition(|f| {
            let is_own = |bytes: Vec<u8>| crate::output::is_own(f, &bytes) == Some(true);
            VERIFIED.iter().any(|name| is(f, name)) && folder.read(f).is_ok_and(is_own)
        });
        (found.verified, found.foreign) = (verified, foreign);
        Ok(found)
    }

    /// The files that a manifest names.
    fn by_manifest(&mut self, folder: &Folder, entries: &[Entry], text: &str) {
        for (name, due) in entries {
            if !is_plain(name) || !folder.holds(name) {
                continue;
            }
            self.old.push(name.clone());
            if digest(folder, name).as_ref() != Some(due) {
                self.edited.push(name.clone());
            }
        }
        self.old.push(manifest::NAME.to_owned());
        let whole: Option<Manifest> = serde_json::from_str(text).ok();
        if whole.is_some_and(|m| m.seal != m.sealed()) {
            self.edited.push(manifest::NAME.to_owned());
        }
    }

    /// The files that a bundle with a damaged manifest has: those that say in their first lines that they were
    /// generated, of those that the checksums name where there are any; the checksums, and the data that these name.
    /// None where no file says so: then the manifest is the user's own.
    fn by_first_lines(&mut self, folder: &Folder, files: &[String], damage: Damage) {
        let sums = sums(folder);
        // A copy under another name is the user's.
        let is_listed = |name: &str| sums.is_empty() || sums.iter().any(|(n, _)| n == name);
        let is_own = |name: &&String| {
            let text = folder.read_text(name);
            is_listed(name)
                && !is_in_another(folder, name)
                && text.is_ok_and(|t| manifest::is_generated(&t))
        };
        let own: Vec<String> = files.iter().filter(is_own).cloned().collect();
        if own.is_empty() {
            return;
        }
        for name in own {
            match sums.iter().find(|(listed, _)| *listed == name) {
                None => self.unknown.push(name.clone()),
                Some((_, due)) if digest(folder, &name).as_ref() == Some(due) => {}
                Some(_) => self.edited.push(name.clone()),
            }
            self.old.push(name);
        }
        for (name, due) in &sums {
            let is_whole = || digest(folder, name).as_ref() == Some(due);
            if is_data(name) && !self.old.contains(name) && is_whole() {
                self.old.push(name.clone());
            }
        }
        self.old.push(manifest::NAME.to_owned());
        if !sums.is_empty() {
            self.old.push(paths::SUMS.to_owned());
        }
        self.damage = Some(damage);
    }

    /// What somebody would lose by the new bundle.
    pub fn lost(&self, files: &[EmittedFile]) -> Vec<String> {
        let edited = self.edited.iter().map(|name| format!("{name} (edited)"));
        let unknown = self.unknown.iter();
        let unknown = unknown.map(|name| format!("{name} (may be edited)"));
        let damaged = self.damage.iter();
        let damaged = damaged.map(|_| format!("{} (damaged)", manifest::NAME));
        let overwritten = self.foreign.iter().filter(|name| is_new(name, files));
        damaged
            .chain(edited)
            .chain(unknown)
            .chain(overwritten.map(|name| foreign(name)))
            .collect()
    }

    /// What somebody would find beside the new bundle, where there is one already.
    pub fn beside(&self, files: &[EmittedFile]) -> Vec<String> {
        let beside = self.foreign.iter();
        let beside = beside.filter(|name| !self.old.is_empty() && !is_new(name, files));
        beside.map(|name| foreign(name)).collect()
    }

    /// The error for a manifest that does not say which files are the bundle's.
    pub fn damaged(&self, folder: &Path) -> Option<Error> {
        let damage = self.damage.as_ref()?;
        let what = format!(
            "the manifest of the bundle here is damaged ({}), so that it does not say which files are the bundle's. Nothing \
             was written",
            damage.why
        );
        let error = InputError::new(what)
            .in_file(folder.join(manifest::NAME))
            .help(
                "name another folder with --out, or `--force`: it replaces the files that say in their first lines that gyrogen \
                 wrote them, edited ones too, and leaves all others",
            );
        Some(match damage.place {
            Some((line, column)) => error.at(line, column).into(),
            None => error.into(),
        })
    }
}

/// The bundle's files as its manifest has them, one of an older schema as well.
fn listed(text: &str) -> std::result::Result<Vec<Entry>, Damage> {
    let value: serde_json::Value = serde_json::from_str(text).map_err(|e| Damage::of_json(&e))?;
    let files = value["files"].as_array().into_iter().flatten();
    let entries: Vec<Entry> = files
        .filter_map(|file| Some((file["path"].as_str()?, file["sha256"].as_str()?)))
        .map(|(path, due)| (path.to_owned(), due.to_owned()))
        .collect();
    match entries.is_empty() {
        true => Err(Damage::new("it lists no files")),
        false => Ok(entries),
    }
}

/// The entries of a bundle's checksums; none where there is no such file.
fn sums(folder: &Folder) -> Vec<Entry> {
    let text = folder.read_text(paths::SUMS).unwrap_or_default();
    let lines = text.lines().filter_map(|line| line.split_once("  "));
    let plain = lines.filter(|(_, name)| is_plain(name));
    plain
        .map(|(digest, name)| (name.to_owned(), digest.to_owned()))
        .collect()
}

/// A file of a bundle that does not say what wrote it.
fn is_data(name: &str) -> bool {
    let mut parts = name.rsplit('/');
    let file = parts.next().unwrap_or("");
    parts.next() == Some("vectors") || [manifest::NAME, paths::SUMS].contains(&file)
}

/// True for a file of a bundle of its own below the folder; a product's parts are none.
fn is_in_another(folder: &Folder, name: &str) -> bool {
    let first = name.split('/').next().unwrap_or("");
    let above = name.match_indices('/').map(|(end, _)| &name[..end]);
    let mut above = above.filter(|_| !paths::PARTS.contains(&first));
    above.any(|part| folder.holds(&format!("{part}/{}", manifest::NAME)))
}

fn digest(folder: &Folder, name: &str) -> Option<String> {
    folder.read(name).ok().map(|bytes| sha256(&bytes))
}

fn is_new(name: &str, files: &[EmittedFile]) -> bool {
    files.iter().any(|f| f.path == name)
}

fn foreign(name: &str) -> String {
    format!("{name:?} (not of the bundle)")
}
