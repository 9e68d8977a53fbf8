//! Whether the bundle in a folder is of the design and the language that are to be written there.
//!
//! A design is known by its file's name and its own name, which edits leave. Two designs may have both in common, as
//! those have that two calls of `run` write: the bundle of the one is then replaced by that of the other, which is said.

use super::folder::Folder;
use super::{manifest, paths};
use crate::design::Design;
use crate::emit::views::Language;
use crate::error::{InputError, Result};
use crate::text::{Place, shown};
use std::path::{Path, PathBuf};

/// Digits of a design's SHA-256 that a message shows.
const SHOWN_DIGITS: usize = 12;

/// Whose a bundle is, and in which language.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Whose {
    command: String,
    /// As the manifest has it.
    language: String,
    /// The design's name.
    name: String,
    /// SHA-256 of the text of the design that it is emitted from.
    sha256: String,
}

impl Whose {
    /// Of the bundle that `command` makes of a design.
    pub fn of(design: &Design, language: Language, command: &str) -> Self {
        Whose {
            command: command.to_owned(),
            language: manifest::language_key(language).to_owned(),
            name: design.name.clone(),
            sha256: design.source.sha256.clone(),
        }
    }

    /// Of the bundle in a folder; `None` where no manifest says it.
    ///
    /// # Errors
    /// What is no folder.
    pub fn in_folder(folder: &Path) -> Result<Option<Self>> {
        if folder.symlink_metadata().is_err() {
            return Ok(None);
        }
        let text = Folder::open(folder)?.read_text(manifest::NAME);
        // Of an older schema as well.
        let value: serde_json::Value =
            serde_json::from_str(&text.unwrap_or_default()).unwrap_or_default();
        let of = |key: &str| value[key].as_str().unwrap_or("").to_owned();
        let name = paths::name_of(&of("prefix"), &of("part")).to_owned();
        Ok(value["command"].as_str().map(|command| Whose {
            command: command.to_owned(),
            language: of("language"),
            name,
            sha256: of("design_sha256"),
        }))
    }

    /// Refuses to put `coming` in the place of this bundle, which is in `folder`.
    ///
    /// # Errors
    /// A bundle of another design, or in another language.
    pub fn refuse(&self, coming: &Whose, folder: &Path) -> Result<()> {
        if self.is_of_the_design_of(coming) && self.language == coming.language {
            return Ok(());
        }
        Err(InputError::new(format!(
            "this folder holds other firmware, {self}, and {coming} was to be written. Nothing was written"
        ))
        .in_file(folder)
        .help(
            "name another folder with --out, or remove this one; `--force` replaces it. Firmware of the same design file and \
             design name in the same language is replaced without being asked",
        )
        .into())
    }

    /// What is lost where `coming` has taken this bundle's place; `None` where it is made of the same design.
    pub fn replaced_by(&self, coming: &Whose) -> Option<String> {
        let is_same_text = self.is_of_the_design_of(coming) && self.sha256 == coming.sha256;
        if is_same_text && self.language == coming.language {
            return None;
        }
        let sha256: String = self.sha256.chars().take(SHOWN_DIGITS).collect();
        let text = format!(
            "note: this replaced other firmware, {self}, of a design with the SHA-256 {sha256}...; if that was no earlier state of \
             this design, write it again into a folder of its own with --out"
        );
        Some(shown(&text, Place::Screen))
    }

    fn is_of_the_design_of(&self, other: &Whose) -> bool {
        let file = design_of(&self.command);
        file.is_some() && file == design_of(&other.command) && self.name == other.name
    }
}

impl std::fmt::Display for Whose {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let language = match self.language.as_str() {
            "c" => "C",
            "rust" => "Rust",
            _ => "an unknown language",
        };
        let Whose { command, name, .. } = self;
        write!(
            f,
            "that of `{command}` (design name `{name}`, in {language})"
        )
    }
}

/// Refuses a folder that lies in that of a bundle and is none of the bundle's own parts: the bundle would have foreign sources.
///
/// # Errors
/// A folder in a bundle.
pub fn refuse_inside(folder: &Path) -> Result<()> {
    let Some(bundle) = bundle_above(folder) else {
        return Ok(());
    };
    let here = std::env::current_dir().and_then(|at| at.canonicalize());
    let named = here
        .ok()
        .and_then(|here| bundle.strip_prefix(here).ok())
        .filter(|named| !named.as_os_str().is_empty())
        .unwrap_or(&bundle);
    let what = format!(
        "this folder lies in the bundle {}, which would hold files that are not its own. Nothing was written",
        named.display()
    );
    Err(InputError::new(what)
        .in_file(folder)
        .help("name a folder outside of that bundle with --out")
        .into())
}

/// The bundle that a folder lies in, of which it is no part.
fn bundle_above(folder: &Path) -> Option<PathBuf> {
    let absolute = std::path::absolute(folder).ok()?;
    // A folder that is to be made lies in the first one above it that is there.
    let mut there = absolute
        .ancestors()
        .filter_map(|at| Some((at.canonicalize().ok()?, absolute.strip_prefix(at).ok()?)));
    let (existing, missing) = there.next()?;
    let whole = existing.join(missing);
    let is_bundle = |at: &Path| matches!(Whose::in_folder(at), Ok(Some(_)));
    let mut above = existing.ancestors().filter(|at| *at != whole);
    let bundle = above.find(|at| is_bundle(at))?;
    let below = whole.strip_prefix(bundle).ok()?;
    let is_part = paths::PARTS.iter().any(|part| below.starts_with(part));
    (!is_part).then(|| bundle.to_path_buf())
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

#[cfg(test)]
mod tests {
    use super::*;

    fn whose(command: &str) -> Whose {
        Whose {
            command: format!("gyrogen {command}"),
            language: "c".to_owned(),
            name: "gyro".to_owned(),
            sha256: "0".repeat(64),
        }
    }

    fn says(old: &Whose, new: &Whose) -> Result<()> {
        old.refuse(new, Path::new("fw"))
    }

    #[test]
    fn the_firmware_of_another_design_file_stays() {
        for (old, new) in [
            ("emit a.toml --lang c", "emit a.toml --lang c --part tables"),
            ("emit a.toml --lang c", "emit --lang c --design a.toml"),
            ("emit --lang c --design a.toml", "emit a.toml --lang c"),
            ("emit --lang c -- -a.toml", "emit --lang c -- -a.toml"),
            ("emit --lang c", "emit --lang c --part tables"),
            ("run a.toml --record r.csv", "emit design.toml --lang c"),
            ("close --record r.csv", "emit design.toml --lang c"),
        ] {
            says(&whose(old), &whose(new)).unwrap_or_else(|e| panic!("{old}, {new}: {e}"));
        }
        for (old, new) in [
            ("emit a.toml --lang c", "emit b.toml --lang c"),
            ("emit --lang c", "emit b.toml --lang c"),
            ("emit a.toml --lang c", "emit --lang c"),
            // Its firmware has the fit, which is in its design.toml alone.
            ("run a.toml --record r.csv", "emit a.toml --lang c"),
            ("approx --function x^2 --degree 2", "emit --lang c"),
        ] {
            let refused = says(&whose(old), &whose(new)).expect_err(old).to_string();
            assert!(refused.contains(old) && refused.contains(new), "{refused}");
        }
    }

    #[test]
    fn a_file_of_the_same_name_with_another_design_name_or_language_is_refused() {
        let old = whose("emit design.toml --lang c");
        let named = Whose {
            name: "other".to_owned(),
            ..old.clone()
        };
        let rust = Whose {
            language: "rust".to_owned(),
            command: "gyrogen emit design.toml --lang rust".to_owned(),
            ..old.clone()
        };
        for (new, what) in [(named, "design name `other`"), (rust, "in Rust")] {
            let refused = says(&old, &new).expect_err(what).to_string();
            assert!(refused.starts_with("fw: error: "), "{refused}");
            assert!(
                refused.contains(what) && refused.contains("--out"),
                "{refused}"
            );
        }
    }

    #[test]
    fn another_text_under_the_same_names_is_replaced_with_a_note() {
        let old = whose("emit design.toml --lang c");
        assert_eq!(
            old.replaced_by(&whose("emit design.toml --lang c --part tables")),
            None
        );
        let new = Whose {
            sha256: "1".repeat(64),
            ..old.clone()
        };
        says(&old, &new).expect("an edited design");
        // The fit of `run` is not in the text that it was given.
        let fitted = whose("run a.toml --record r.csv");
        assert!(fitted.replaced_by(&whose("emit a.toml --lang c")).is_some());
        let note = old.replaced_by(&new).expect("a note");
        assert!(
            note.contains("`gyrogen emit design.toml --lang c`"),
            "{note}"
        );
        assert!(
            note.contains("000000000000...") && note.contains("--out"),
            "{note}"
        );
    }

    #[test]
    fn whose_a_bundle_is_stands_in_its_manifest() {
        let made = tempfile::tempdir().expect("a folder");
        let at = made.path();
        assert_eq!(Whose::in_folder(&at.join("none")).expect("nothing"), None);
        assert_eq!(Whose::in_folder(at).expect("no manifest"), None);
        let manifest = serde_json::json!({
            "command": "gyrogen emit a.toml --lang c",
            "language": "c",
            "part": "correction",
            "prefix": "gyro_correction",
            "design_sha256": "0".repeat(64),
        });
        std::fs::write(at.join(manifest::NAME), manifest.to_string()).expect("written");
        let found = Whose::in_folder(at).expect("a manifest");
        assert_eq!(found, Some(whose("emit a.toml --lang c")));
    }

    #[test]
    fn a_folder_in_a_bundle_is_refused_and_a_part_of_it_is_not() {
        let made = tempfile::tempdir().expect("a folder");
        let two = made.path().join("two");
        std::fs::create_dir(&two).expect("a folder");
        let manifest = serde_json::json!({ "command": "gyrogen emit a.toml --lang c" });
        std::fs::write(two.join(manifest::NAME), manifest.to_string()).expect("written");
        let refused = refuse_inside(&two.join("rust")).expect_err("refused");
        let said = refused.to_string();
        assert!(
            said.contains("lies in the bundle") && said.contains("--out"),
            "{said}"
        );
        for folder in [
            &two,
            &two.join("chain"),
            &made.path().join("three"),
            &two.join("../three"),
        ] {
            refuse_inside(folder).expect("outside, or the bundle's own");
        }
    }
}
