//! A bundle in the place of an older one: what nobody edited is replaced whole, what somebody edited or put there is
//! not touched unless that is asked for.

use super::emitted::EmittedFile;
use super::found::Found;
use crate::error::{InputError, Result};
use crate::output::Results;
use std::path::Path;

/// Files that a message names.
const NAMED: usize = 8;

/// Refuses a folder with files that writing the bundle would overwrite or leave beside it: to be asked before work
/// begins (then without files), and before writing.
///
/// # Errors
/// Edited files of a bundle, files that are none of it, and a bundle whose manifest is damaged.
pub fn refuse(files: &[EmittedFile], folder: &Path) -> Result<()> {
    let found = Found::in_folder(folder)?;
    if let Some(error) = found.damaged(folder) {
        return Err(error);
    }
    let in_the_way = [found.lost(files), found.beside(files)].concat();
    if in_the_way.is_empty() {
        return Ok(());
    }
    let what = "files here were edited, or are none of the bundle";
    Err(InputError::new(format!("{what}: {}. Nothing was written", listed(&in_the_way)))
        .in_file(folder)
        .help("name another folder with --out, or `--force`: it overwrites edited files and those that have the name of a new one, and \
               leaves the others")
        .into())
}

/// What a bundle took the place of.
#[derive(Debug, Default, PartialEq, Eq)]
pub struct Replaced {
    /// What is lost, where that was forced.
    pub lost: Vec<String>,
    /// What is none of the bundle's and stays beside it, where that was forced.
    pub beside: Vec<String>,
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
    let path = match folder {
        // Joined, it would end in a `/` that nobody wrote.
        "" => results.folder().to_path_buf(),
        below => results.folder().join(below),
    };
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
        lost: found.lost(files),
        beside: found.beside(files),
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
    use crate::digest::sha256;
    use crate::firmware::{manifest, paths};

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

    fn write(files: &[EmittedFile], folder: &Path, forced: bool) -> Result<Replaced> {
        let mut results = Results::claim(folder, &[], &[])?;
        let replaced = collect(files, "", &mut results, forced)?;
        results.finish()?;
        Ok(replaced)
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
        let place = format!("{}: error: ", folder.display());
        assert!(refused.starts_with(&place), "{refused}");
        assert_eq!(
            std::fs::read_to_string(folder.join("a.c")).expect("read"),
            "mine"
        );
        let replaced = write(&bundle(&["a.c"]), &folder, true).expect("forced");
        assert_eq!(replaced.lost, ["a.c (edited)"]);
        assert_eq!(replaced.beside, ["\"notes.txt\" (not of the bundle)"]);
        assert!(folder.join("notes.txt").exists() && !folder.join("b.c").exists());
        assert_ne!(
            std::fs::read_to_string(folder.join("a.c")).expect("read"),
            "mine"
        );
    }

    #[test]
    fn a_verification_goes_with_its_bundle_and_a_file_of_that_name_is_asked_for() {
        let made = tempfile::tempdir().expect("a folder");
        let folder = made.path().join("c");
        let verify = folder.join("verify.json");
        write(&bundle(&["a.c"]), &folder, false).expect("written");
        std::fs::write(&verify, "{\n  \"schema\": \"gyrogen.verify/2\"\n}\n").expect("written");
        write(&bundle(&["b.c"]), &folder, false).expect("written");
        assert!(!verify.exists());
        std::fs::write(&verify, "mine").expect("written");
        let refused = refuse(&bundle(&["a.c"]), &folder).expect_err("refused");
        assert!(
            refused
                .to_string()
                .contains("\"verify.json\" (not of the bundle)")
        );
    }

    #[test]
    fn beside_other_files_a_first_bundle_overwrites_nothing() {
        let made = tempfile::tempdir().expect("a folder");
        std::fs::write(made.path().join("design.toml"), "mine").expect("written");
        refuse(&bundle(&["a.c"]), made.path()).expect("beside them");
        std::fs::write(made.path().join("a.c"), "mine").expect("written");
        refuse(&bundle(&["a.c"]), made.path()).expect_err("it would be overwritten");
    }

    /// As [`bundle`], of sources that say what wrote them, with checksums of them and of a file of vectors.
    fn generated(names: &[&str]) -> Vec<EmittedFile> {
        let mut files = bundle(names);
        files.pop();
        for file in &mut files {
            file.text = format!(
                "/* {} */\n{}",
                manifest::banner(manifest::DESIGN, "0", "gyrogen emit"),
                file.text
            );
        }
        files.push(EmittedFile {
            path: "vectors/a.csv".into(),
            text: "1\n".into(),
        });
        files.push(crate::firmware::files::sums(&files));
        let entry = |f: &EmittedFile| serde_json::json!({ "path": f.path, "sha256": sha256(f.text.as_bytes()) });
        let entries: Vec<serde_json::Value> = files.iter().map(entry).collect();
        files.push(EmittedFile {
            path: manifest::NAME.into(),
            text: serde_json::json!({ "files": entries }).to_string(),
        });
        files
    }

    fn there(folder: &Path) -> Vec<String> {
        let folder = crate::firmware::folder::Folder::open(folder).expect("a folder");
        folder.files().expect("files")
    }

    #[test]
    fn a_damaged_manifest_is_said_and_forced_replaces_what_was_generated() {
        for (damaged, why) in [
            ("{\"files\": [", "manifest.json:1:1"),
            ("{}", "it lists no files"),
            ("", "EOF"),
        ] {
            let made = tempfile::tempdir().expect("a folder");
            let folder = made.path().join("c");
            write(&generated(&["a.c", "b.c"]), &folder, false).expect("written");
            std::fs::write(folder.join(manifest::NAME), damaged).expect("written");
            std::fs::write(
                folder.join("b.c"),
                manifest::banner(manifest::DESIGN, "0", "mine"),
            )
            .expect("written");
            std::fs::write(folder.join("notes.txt"), "mine").expect("written");
            // A copy that was put by.
            std::fs::copy(folder.join("a.c"), folder.join("old_a.c")).expect("copied");
            let refused = refuse(&[], &folder).expect_err("refused").to_string();
            assert!(
                refused.contains("is damaged (") && refused.contains(why),
                "{refused}"
            );
            assert!(
                refused.contains("--force") && refused.contains("--out"),
                "{refused}"
            );
            let replaced = write(&generated(&["src/c.rs"]), &folder, true).expect("forced");
            assert_eq!(replaced.lost, ["manifest.json (damaged)", "b.c (edited)"]);
            assert_eq!(
                replaced.beside,
                [
                    "\"notes.txt\" (not of the bundle)",
                    "\"old_a.c\" (not of the bundle)"
                ]
            );
            let left = [
                paths::SUMS,
                manifest::NAME,
                "notes.txt",
                "old_a.c",
                "src/c.rs",
                "vectors/a.csv",
            ];
            assert_eq!(there(&folder), left, "{damaged:?}");
        }
    }

    #[test]
    fn without_checksums_a_generated_file_may_be_edited() {
        let made = tempfile::tempdir().expect("a folder");
        let folder = made.path().join("c");
        write(&generated(&["a.c"]), &folder, false).expect("written");
        std::fs::write(folder.join(manifest::NAME), "{}").expect("written");
        std::fs::remove_file(folder.join(paths::SUMS)).expect("removed");
        let replaced = write(&generated(&["b.c"]), &folder, true).expect("forced");
        let lost = &replaced.lost;
        assert!(lost.contains(&"a.c (may be edited)".to_owned()), "{lost:?}");
        assert!(!folder.join("a.c").exists());
    }

    #[test]
    fn a_manifest_of_the_users_own_is_no_damaged_bundle() {
        let made = tempfile::tempdir().expect("a folder");
        let at = made.path();
        std::fs::write(at.join(manifest::NAME), "{\"name\": \"page\"}").expect("written");
        std::fs::write(at.join("a.csv"), "mine").expect("written");
        let sums = format!("{}  a.csv\n", sha256(b"mine"));
        std::fs::write(at.join(paths::SUMS), sums).expect("written");
        let below = at.join("c");
        write(&generated(&["a.c"]), &below, false).expect("a bundle below it");
        let refused = refuse(&bundle(&["b.c"]), at)
            .expect_err("refused")
            .to_string();
        assert!(!refused.contains("damaged"), "{refused}");
        assert!(
            refused.contains("\"manifest.json\" (not of the bundle)"),
            "{refused}"
        );
        write(&bundle(&["b.c"]), at, true).expect("forced");
        let left = |name: &str| at.join(name).exists();
        assert!(left("a.csv") && left(paths::SUMS) && left("c/a.c"));
    }
}
