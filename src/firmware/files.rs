//! The files of a firmware bundle: sources, harness, self-test, vectors, manifest.

use super::calibrated;
pub use super::emitted::EmittedFile;
use super::manifest::{self, Header, Manifest};
use super::paths;
use super::vectors::{self, Checked};
use super::view::View;
use crate::compensation::certainty;
use crate::design::Design;
use crate::digest::sha256;
use crate::emit::bundle::{Bundle, Part};
use crate::emit::views::Language;
use crate::error::{InputError, Result, io_error};
use crate::vectors::chain;
use crate::vectors::model::{self, Model};
use askama::Template;
use std::path::Path;

macro_rules! page {
    ($name:ident, $path:literal) => {
        #[derive(Template)]
        #[template(path = $path, escape = "none")]
        struct $name<'a> {
            v: &'a View,
        }
    };
}

page!(Readme, "bundle/README.md");
page!(CMakefile, "c/Makefile");
page!(CCMake, "c/CMakeLists.txt");
page!(RustVectors, "rust/vectors.rs");
page!(CArith, "c/arith.h");
page!(CHeader, "c/firmware.h");
page!(CSource, "c/firmware.c");
page!(CTablesHeader, "c/tables.h");
page!(CTables, "c/tables.c");
page!(CSelftest, "c/selftest.c");
page!(CHarness, "c/harness.c");
page!(RustLib, "rust/lib.rs");
page!(RustSelftest, "rust/selftest.rs");
page!(RustHarness, "rust/harness.rs");

/// Emits a design's firmware in one language, as files in memory.
///
/// # Errors
/// A design without what the part needs.
pub fn emit(
    design: &Design,
    part: Part,
    language: Language,
    command: &str,
) -> Result<Vec<EmittedFile>> {
    let emission = Emission::new(design, part, command)?;
    let printed = emission.print(language)?;
    Ok(emission.files(printed, &emission.vectors()))
}

/// A design's firmware before it is printed: what both languages share is made once.
pub struct Emission<'a> {
    design: &'a Design,
    part: Part,
    command: &'a str,
    bundle: Bundle,
    models: Vec<Model>,
    /// Of each function over all its inputs.
    every: Vec<Option<Checked>>,
}

/// The sources of one language.
pub struct Printed {
    language: Language,
    view: View,
    /// All that a build needs.
    pub sources: Vec<EmittedFile>,
}

impl<'a> Emission<'a> {
    /// Of a part of a design, for that command.
    ///
    /// # Errors
    /// A design without what the part needs.
    pub fn new(design: &'a Design, part: Part, command: &'a str) -> Result<Self> {
        if part == Part::Compensation && design.compensation.is_none() {
            return Err(InputError::new("the design has no [compensation] to emit")
                .help("add a [compensation] table, or emit `--part chain`")
                .into());
        }
        calibrated::refuse_flag_without_range(design)?;
        let mut bundle = Bundle::new(design, part);
        // Words so long that the polynomial cannot be enclosed have no such line.
        if let Ok(Some(bounds)) = certainty::bounds(design) {
            bundle.accuracy = certainty::sentences(design, &bounds);
        }
        let models = model::models(design, &bundle.program);
        let every = match part {
            Part::Tables => Vec::new(),
            _ => models.iter().map(vectors::every_of).collect(),
        };
        Ok(Emission {
            design,
            part,
            command,
            bundle,
            models,
            every,
        })
    }

    /// What begins every name.
    pub fn prefix(&self) -> &str {
        &self.bundle.prefix
    }

    /// Prints the sources in a language.
    ///
    /// # Errors
    /// A template that cannot be filled.
    pub fn print(&self, language: Language) -> Result<Printed> {
        let (design, bundle) = (self.design, &self.bundle);
        let banner = manifest::banner(manifest::DESIGN, &design.source.sha256, self.command);
        let facts = manifest::facts(design, bundle);
        let view = View::new(bundle, &self.models, &self.every, language, banner, facts);
        let view = match self.part {
            Part::Tables => view.tables_alone(),
            _ => view.with_chain(design, bundle, language),
        };
        Ok(Printed {
            sources: sources(&view, self.part, language)?,
            language,
            view,
        })
    }

    /// The vectors, which are those of every language; none of tables alone.
    pub fn vectors(&self) -> Vec<EmittedFile> {
        match self.part {
            Part::Tables => Vec::new(),
            _ => vectors::of_design(self.design, &self.bundle, &self.models),
        }
    }

    /// All files of a language.
    pub fn files(&self, printed: Printed, vectors: &[EmittedFile]) -> Vec<EmittedFile> {
        let Printed {
            language,
            view,
            sources: mut files,
        } = printed;
        let has_code = self.part != Part::Tables;
        files.extend_from_slice(vectors);
        files.push(vectors::of_tables(&view.tables));
        if has_code {
            files.push(sums(&files));
        }
        let header = Header {
            design_sha256: &self.design.source.sha256,
            command: self.command,
            language,
            part: match self.part {
                Part::Chain if !self.bundle.has_chain => "compensation",
                Part::Chain => "chain",
                Part::Tables => "tables",
                _ => "compensation",
            },
            has_code,
            columns: &chain::columns(self.design),
        };
        let mut manifest = Manifest::new(&header, &self.bundle, &view, &files);
        manifest.calibrated = calibrated::Calibrated::of(self.design);
        files.push(EmittedFile {
            path: manifest::NAME.into(),
            text: manifest.to_json(),
        });
        files
    }
}

/// The checksums of all files so far, for who has no gyrogen.
pub(super) fn sums(files: &[EmittedFile]) -> EmittedFile {
    let line = |file: &EmittedFile| format!("{}  {}\n", sha256(file.text.as_bytes()), file.path);
    EmittedFile {
        path: paths::SUMS.into(),
        text: files.iter().map(line).collect(),
    }
}

/// Writes a bundle's files under `folder`, which is made.
///
/// # Errors
/// A folder that cannot be written.
pub fn write(files: &[EmittedFile], folder: &Path) -> Result<()> {
    for file in files {
        let path = folder.join(&file.path);
        if let Some(parent) = path.parent() {
            std::fs::create_dir_all(parent).map_err(|e| io_error(parent, "make the folder", &e))?;
        }
        crate::output::write_whole(&path, file.text.as_bytes())?;
    }
    Ok(())
}

pub(super) fn sources(view: &View, part: Part, language: Language) -> Result<Vec<EmittedFile>> {
    let p = &view.p;
    let v = view;
    let mut pages: Vec<(String, askama::Result<String>)> = Vec::new();
    match language {
        Language::C => {
            pages.push((format!("{p}_tables.h"), CTablesHeader { v }.render()));
            pages.push((format!("{p}_tables.c"), CTables { v }.render()));
            if part != Part::Tables {
                pages.push((format!("{p}_arith.h"), CArith { v }.render()));
                pages.push((format!("{p}.h"), CHeader { v }.render()));
                pages.push((format!("{p}.c"), CSource { v }.render()));
                pages.push((format!("{p}_selftest.c"), CSelftest { v }.render()));
                pages.push((format!("test/{p}_harness.c"), CHarness { v }.render()));
                pages.push(("Makefile".into(), CMakefile { v }.render()));
                pages.push(("CMakeLists.txt".into(), CCMake { v }.render()));
            }
        }
        Language::Rust => {
            pages.push(("src/lib.rs".into(), RustLib { v }.render()));
            pages.push(("src/selftest.rs".into(), RustSelftest { v }.render()));
            let cargo = format!(
                "# {}\n[package]\nname = \"{p}\"\nversion = \"0.1.0\"\nedition = \"2021\"\nlicense = \"MIT OR Apache-2.0\"\npublish = false\n\n[workspace]\n",
                v.banner
            );
            pages.push(("Cargo.toml".into(), Ok(cargo)));
            pages.push(("src/bin/harness.rs".into(), RustHarness { v }.render()));
            if part != Part::Tables {
                pages.push(("tests/vectors.rs".into(), RustVectors { v }.render()));
            }
        }
    }
    if part != Part::Tables {
        pages.push((paths::README.into(), Readme { v }.render()));
    }
    let mut files = Vec::new();
    for (path, text) in pages {
        let text = text.map_err(|e| InputError::new(format!("cannot print {path}: {e}")))?;
        let text = text.trim_end().to_owned() + "\n";
        files.push(EmittedFile { path, text });
    }
    Ok(files)
}
