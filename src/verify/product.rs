//! A product of several bundles: each part by itself, then all of them together in the product's own check.

use super::bundle::{self, Against};
use super::compare::{Compared, language_name};
use super::target::{self, Target};
use super::toolchain::{self, Harness};
use crate::emit::views::Language;
use crate::error::{Result, io_error};
use crate::firmware::folder::Folder;
use crate::firmware::manifest::Manifest;
use crate::firmware::paths;
use crate::leftovers::TemporaryFolder;
use std::path::Path;

/// A product whose files are those that its manifest names.
pub(super) struct Product<'a> {
    pub language: Language,
    pub manifest: &'a Manifest,
    pub folder: &'a Folder,
    pub path: &'a Path,
    pub target: Target,
}

/// What was found.
pub(super) struct Found {
    pub toolchain: String,
    pub selftest: bool,
    pub problems: Vec<String>,
    pub functions: Vec<Compared>,
}

impl Product<'_> {
    /// Verifies the parts, then builds and runs what joins them.
    ///
    /// # Errors
    /// As [`bundle::verify`].
    pub(super) fn verified(&self, command: &str) -> Result<Found> {
        let mut found = Found {
            toolchain: String::new(),
            selftest: true,
            problems: Vec::new(),
            functions: Vec::new(),
        };
        for part in paths::PARTS {
            let folder = self.path.join(part);
            let nothing = |_: &Path, _: &Manifest| Ok(Vec::new());
            let of_part =
                bundle::verify(&folder, self.target, &Against::default(), &nothing, command)?;
            let changed = of_part.changed_files.into_iter();
            let changed = changed.map(|f| format!("{f} is not what the manifest says"));
            let problems = of_part.problems.into_iter().chain(changed);
            found
                .problems
                .extend(problems.map(|what| format!("{part}: {what}")));
            found.selftest &= of_part.selftest == Some(true);
            let functions = of_part.functions.into_iter().map(|mut compared| {
                compared.name = format!("{part}/{}", compared.name);
                compared
            });
            found.functions.extend(functions);
            found.toolchain = of_part.toolchain;
        }
        if found.problems.is_empty() {
            found.functions.push(self.together()?);
        }
        Ok(found)
    }

    /// The check of all parts together, which compares with a checksum of the model's words.
    fn together(&self) -> Result<Compared> {
        // Built from copies, as each part is.
        let made = TemporaryFolder::of_the_system()
            .map_err(|e| io_error(std::env::temp_dir(), "make a folder for the build", &e))?;
        let at = made.path();
        let name = &self.manifest.prefix;
        let harness = match self.language {
            Language::C => self.of_c(at, name)?,
            Language::Rust => self.of_rust(at, name)?,
        };
        let status = harness.run(&[], Vec::new(), (1, 0), &mut |_| ())?;
        let good = status == Some(0);
        Ok(Compared {
            name: "all parts together".to_owned(),
            language: language_name(self.language),
            inputs: 1,
            exhaustive: false,
            compared: 1,
            mismatches: u64::from(!good),
            first: (!good).then(|| "the checksum of all words is another".to_owned()),
        })
    }

    /// All of C in one folder: every file's name begins with its part's prefix.
    fn of_c(&self, at: &Path, name: &str) -> Result<Harness> {
        let mut copied = Vec::new();
        for part in paths::PARTS {
            let prefix = paths::prefix_of(name, part);
            for source in paths::sources(&prefix, false, Language::C) {
                let is_code = source.ends_with(".c") || source.ends_with(".h");
                if is_code && !source.contains('/') {
                    self.copy(&format!("{part}/{source}"), at, &source)?;
                    copied.push(source);
                }
            }
        }
        let check = format!("{name}_all.c");
        self.copy(&format!("test/{check}"), at, &check)?;
        copied.push(check);
        match target::build(self.target, at, &copied)? {
            Some(emulated) => Ok(emulated),
            None => toolchain::build(Language::C, name, at, &copied),
        }
    }

    fn of_rust(&self, at: &Path, name: &str) -> Result<Harness> {
        let mut crates = Vec::new();
        for part in paths::PARTS {
            for source in ["src/lib.rs", "src/selftest.rs"] {
                let path = format!("{part}/{source}");
                self.copy(&path, at, &path)?;
            }
            let library = at.join(part).join("src/lib.rs");
            crates.push((paths::prefix_of(name, part), library));
        }
        self.copy("src/main.rs", at, "main.rs")?;
        toolchain::build_crates(&crates, &at.join("main.rs"))
    }

    fn copy(&self, from: &str, at: &Path, to: &str) -> Result<()> {
        let to = at.join(to);
        if let Some(parent) = to.parent() {
            std::fs::create_dir_all(parent).map_err(|e| io_error(parent, "make the folder", &e))?;
        }
        crate::output::write_whole(&to, &self.folder.read(from)?)
    }
}
