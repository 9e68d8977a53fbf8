//! A bundle in the place of an older one: what nobody edited is replaced whole, what somebody edited or put there is
//! not touched unless that is asked for.

use super::emitted::EmittedFile;
use super::folder::{Folder, is_plain};
use super::manifest::{self, Manifest};
use crate::digest::sha256;
use crate::error::{InputError, Result};
use crate::output::Results;
use std::path::Path;

/// What `verify` writes into a bundle's folder.
const VERIFIED: [&str; 2] = ["verify.json", crate::timing::NAME];
/// What a build leaves there.
const BUILT: &str = "Cargo.lock";
/// Files that a message names.
const NAMED: usize = 8;

/// What stands in a folder that a bundle goes into.
#[derive(Debug, Default, PartialEq, Eq)]
struct Found {
    /// Files of the bundle that is there.
    old: Vec<String>,
    /// Those of them that are not as they were written.
    edited: Vec<String>,
    /// What `verify` wrote.
    verified: Vec<String>,
    /// Files that are none of the bundle's.
    foreign: Vec<String>,
}

impl Found {
    fn in_folder(path: &Path) -> Result<Self> {
        let mut found = Found::default();
        if path.symlink_metadata().is_err() {
            return Ok(found);
        }
        let folder = Folder::open(path)?;
        let text = folder.read_text(manifest::NAME).unwrap_or_default();
        // Of an older schema as well.
        let value: serde_json::Value = serde_json::from_str(&text).unwrap_or_default();
        let files = value["files"].as_array().cloned().unwrap_or_default();
        for file in &files {
            let (Some(name), Some(due)) = (file["path"].as_str(), file["sha256"].as_str()) else {
                continue;
            };
            if !is_plain(name) || !folder.holds(name) {
                continue;
            }
            found.old.push(name.to_owned());
            let bytes = folder.read(name);
            if bytes.map_or(true, |b| sha256(&b) != due) {
                found.edited.push(name.to_owned());
            }
        }
        if !files.is_empty() {
            found.old.push(manifest::NAME.to_owned());
            let whole: Option<Manifest> = serde_json::from_str(&text).ok();
            if whole.is_some_and(|m| m.seal != m.sealed()) {
                found.edited.push(manifest::NAME.to_owned());
            }
        }
        let others = folder.files()?.into_iter();
        // A product's parts are bundles in folders of their own.
        let is = |path: &str, name: &str| path.rsplit('/').next() == Some(name);
        let others = others.filter(|f| !found.old.contains(f) && !is(f, BUILT));
        let (verified, foreign) = others.partition(|f| VERIFIED.iter().any(|name| is(f, name)));
        (found.verified, found.foreign) = (verified, foreign);
        Ok(found)
    }

    /// What somebody would lose or find beside the new bundle.
    fn in_the_way(&self, files: &[EmittedFile]) -> Vec<String> {
        let edited = self.edited.iter().map(|name| format!("{name} (edited)"));
        // Where there is no bundle yet, only what would be overwritten.
        let is_new = |name: &String| files.iter().any(|f| f.path == *name);
        let foreign = self
            .foreign
            .iter()
            .filter(|name| !self.old.is_empty() || is_new(name));
        edited
            .chain(foreign.map(|name| format!("{name:?} (not of the bundle)")))
            .collect()
    }
}

/// Refuses a folder with files that writing the bundle would overwrite or leave beside it: to be asked before work
/// begins (then without files), and before writing.
///
/// # Errors
/// Edited files of a bundle, and files that are none of it.
pub fn refuse(files: &[EmittedFile], folder: &Path) -> Result<()> {
    let in_the_way = Found::in_folder(folder)?.in_the_way(files);
    if in_the_way.is_empty() {
        return Ok(());
    }
    let what = "files here were edited, or are none of the bundle";
    Err(InputError::new(format!("{what}: {}. Nothing was written", listed(&in_the_way)))
        .in_file(folder)
        .help("name another folder, or `--force`: it overwrites edited files and leaves what is not of the bundle")
        .into())
}

/// Refuses a folder with the firmware of another design than that of `command`, which goes there.
///
/// # Errors
/// Such a folder. A design is known by its file's name, which an edit leaves.
pub fn refuse_another(folder: &Path, command: &str) -> Result<()> {
    if folder.symlink_metadata().is_err() {
        return Ok(());
    }
    let text = Folder::open(folder)?
        .read_text(manifest::NAME)
        .unwrap_or_default();
    let value: serde_json::Value = serde_json::from_str(&text).unwrap_or_default();
    let Some(before) = value["command"].as_str() else {
        return Ok(());
    };
    let old = design_of(before);
    if old.is_some() && old == design_of(command) {
        return Ok(());
    }
    Err(InputError::new(format!(
        "this folder holds the firmware that another command made: `{before}`. Nothing was written"
    ))
    .in_file(folder)
    .help("name another folder with --out, or remove this one; `--force` replaces it. Firmware of the same design file is replaced without being asked")
    .into())
}

/// The name of the design file that a recorded command emits firmware of, empty for the embedded default; `None` for a
/// command without a design.
fn design_of(command: &str) -> Option<&str> {
    let mut words = command.splitn(3, ' ').skip(1);
    let (verb, rest) = (words.next().unwrap_or(""), words.next().unwrap_or(""));
    let given = match (rest.split_once("--design"), rest.split_once("-- ")) {
        _ if !rest.starts_with("--") => rest,
        (Some((_, name)), _) | (None, Some((_, name))) => name.trim_start_matches([' ', '=']),
        (None, None) => "",
    };
    match verb {
        // A name with blanks is quoted, and may be cut here: in both commands alike.
        "emit" => given.split(" --").next(),
        // They write the design that their firmware is of.
        "run" | "close" => Some("design.toml"),
        _ => None,
    }
}

/// What a bundle took the place of.
#[derive(Debug, Default, PartialEq, Eq)]
pub struct Replaced {
    /// What was in the way, where that was forced.
    pub in_the_way: Vec<String>,
    /// Files of the bundle that was there which the new one does not have.
    pub gone: usize,
}

/// Adds a bundle's files to the results, in `folder` below theirs and in the place of the bundle that is there.
///
/// # Errors
/// As [`refuse`] unless `forced`; a link where a file goes; a folder that cannot be written.
pub fn collect(
    files: &[EmittedFile],
    folder: &str,
    results: &mut Results,
    forced: bool,
) -> Result<Replaced> {
    let path = results.folder().join(folder);
    if !forced {
        refuse(files, &path)?;
    }
    let found = Found::in_folder(&path)?;
    for file in files {
        let name = path.join(&file.path);
        if name.symlink_metadata().is_ok_and(|m| m.is_symlink()) {
            return Err(InputError::new(
                "this is a link, and no file of a bundle is written through one",
            )
            .in_file(name)
            .help("remove it, or name another folder")
            .into());
        }
    }
    let below = Path::new(folder);
    results.write_all(
        files
            .iter()
            .map(|file| (below.join(&file.path), file.text.as_bytes())),
    )?;
    let gone = |name: &&String| !files.iter().any(|f| f.path == **name);
    let gone: Vec<&String> = found.old.iter().filter(gone).collect();
    for name in &gone {
        results.remove(below.join(name));
    }
    // Of another bundle, which is gone.
    for name in &found.verified {
        if !found.old.is_empty() && path.join(name).is_file() {
            results.remove(below.join(name));
        }
    }
    Ok(Replaced {
        in_the_way: found.in_the_way(files),
        gone: gone.len(),
    })
}

/// The first of some names, and how many more there are.
pub fn listed(names: &[String]) -> String {
    let shown = names
        .iter()
        .take(NAMED)
        .cloned()
        .collect::<Vec<_>>()
        .join(", ");
    match names.len().saturating_sub(NAMED) {
        0 => shown,
        more => format!("{shown} and {more} more"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn bundle(names: &[&str]) -> Vec<EmittedFile> {
        let file = |path: &str, text: String| EmittedFile {
            path: path.to_owned(),
            text,
        };
        let mut files: Vec<EmittedFile> = names
            .iter()
            .map(|n| file(n, format!("text of {n}\n")))
            .collect();
        let entry = |f: &EmittedFile| {
            format!(
                "{{\"path\": \"{}\", \"sha256\": \"{}\"}}",
                f.path,
                sha256(f.text.as_bytes())
            )
        };
        let entries: Vec<String> = files.iter().map(entry).collect();
        files.push(file(
            manifest::NAME,
            format!("{{\"files\": [{}]}}", entries.join(", ")),
        ));
        files
    }

    fn write(files: &[EmittedFile], folder: &Path, forced: bool) -> Result<Vec<String>> {
        let mut results = Results::claim(folder, &[], &[])?;
        let replaced = collect(files, "", &mut results, forced)?;
        results.finish()?;
        Ok(replaced.in_the_way)
    }

    #[test]
    fn an_unedited_bundle_is_replaced_whole() {
        let made = tempfile::tempdir().expect("a folder");
        let folder = made.path().join("c");
        write(&bundle(&["a.c", "vectors/a.csv"]), &folder, false).expect("written");
        write(&bundle(&["b.c"]), &folder, false).expect("written");
        assert!(folder.join("b.c").exists() && !folder.join("a.c").exists());
        assert!(!folder.join("vectors/a.csv").exists());
    }

    #[test]
    fn edited_and_foreign_files_are_named_and_need_to_be_forced() {
        let made = tempfile::tempdir().expect("a folder");
        let folder = made.path().join("c");
        write(&bundle(&["a.c", "b.c"]), &folder, false).expect("written");
        std::fs::write(folder.join("a.c"), "mine").expect("written");
        std::fs::write(folder.join("notes.txt"), "mine").expect("written");
        let refused = write(&bundle(&["a.c"]), &folder, false)
            .expect_err("refused")
            .to_string();
        assert!(
            refused.contains("a.c (edited)") && refused.contains("notes.txt"),
            "{refused}"
        );
        assert_eq!(
            std::fs::read_to_string(folder.join("a.c")).expect("read"),
            "mine"
        );
        let named = write(&bundle(&["a.c"]), &folder, true).expect("forced");
        assert_eq!(named.len(), 2);
        assert!(folder.join("notes.txt").exists() && !folder.join("b.c").exists());
        assert_ne!(
            std::fs::read_to_string(folder.join("a.c")).expect("read"),
            "mine"
        );
    }

    #[test]
    fn the_firmware_of_another_design_stays() {
        let made = tempfile::tempdir().expect("a folder");
        let says = |old: &str, new: &str| {
            let text = format!("{{\"command\": \"gyrogen {old}\"}}");
            std::fs::write(made.path().join(manifest::NAME), text).expect("written");
            refuse_another(made.path(), &format!("gyrogen {new}"))
        };
        for (old, new) in [
            ("emit a.toml --lang c", "emit a.toml --lang rust"),
            ("emit a.toml --lang c", "emit --lang c --design a.toml"),
            ("emit --lang c --design a.toml", "emit a.toml --lang c"),
            ("emit --lang c -- -a.toml", "emit --lang rust -- -a.toml"),
            ("emit --lang c", "emit --lang c --part tables"),
            ("run a.toml --record r.csv", "emit design.toml --lang c"),
            ("close --record r.csv", "emit design.toml --lang c"),
        ] {
            says(old, new).unwrap_or_else(|e| panic!("{old}, {new}: {e}"));
        }
        for (old, new) in [
            ("emit a.toml --lang c", "emit b.toml --lang c"),
            ("emit --lang c", "emit b.toml --lang c"),
            ("emit a.toml --lang c", "emit --lang c"),
            // Its firmware has the fit, which is in its design.toml alone.
            ("run a.toml --record r.csv", "emit a.toml --lang c"),
            ("approx --function x^2 --degree 2", "emit --lang c"),
        ] {
            let refused = says(old, new).expect_err(old).to_string();
            assert!(refused.contains(old), "{refused}");
        }
        refuse_another(&made.path().join("none"), "gyrogen emit").expect("nothing is there");
    }

    #[test]
    fn beside_other_files_a_first_bundle_overwrites_nothing() {
        let made = tempfile::tempdir().expect("a folder");
        std::fs::write(made.path().join("design.toml"), "mine").expect("written");
        refuse(&bundle(&["a.c"]), made.path()).expect("beside them");
        std::fs::write(made.path().join("a.c"), "mine").expect("written");
        refuse(&bundle(&["a.c"]), made.path()).expect_err("it would be overwritten");
    }
}
