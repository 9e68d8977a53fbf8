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
use crate::vectors::model;
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
    let banner = manifest::banner(&design.source.sha256, command);
    let facts = manifest::facts(design, &bundle);
    let every: Vec<Option<Checked>> = match part {
        Part::Tables => Vec::new(),
        _ => models.iter().map(vectors::every_of).collect(),
    };
    let view = View::new(&bundle, &models, &every, language, banner, facts);
    let view = match part {
        Part::Tables => view.tables_alone(),
        _ => view.with_chain(design, &bundle, language),
    };
    let mut files = sources(&view, part, language)?;
    if part != Part::Tables {
        files.extend(vectors::of_design(design, &bundle, &models));
    }
    files.push(vectors::of_tables(&view.tables));
    if part != Part::Tables {
        files.push(sums(&files));
    }
    let header = Header {
        design_sha256: &design.source.sha256,
        command,
        language,
        part: match part {
            Part::Chain if !bundle.has_chain => "compensation",
            Part::Chain => "chain",
            Part::Tables => "tables",
            _ => "compensation",
        },
        has_code: part != Part::Tables,
        columns: &chain::columns(design),
    };
    let mut manifest = Manifest::new(&header, &bundle, &view, &files);
    manifest.calibrated = calibrated::Calibrated::of(design);
    files.push(EmittedFile {
        path: manifest::NAME.into(),
        text: manifest.to_json(),
    });
    Ok(files)
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
