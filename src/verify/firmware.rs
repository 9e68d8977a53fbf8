//! The firmware in both languages: emitted, built, compared.

use crate::design::Design;
use crate::emit::bundle::{Bundle, Part};
use crate::emit::views::Language;
use crate::error::{Result, io_error};
use crate::firmware::files;
use crate::firmware::files::EmittedFile;
use crate::leftovers::TemporaryFolder;
use crate::parallel::both;
use crate::verify::compare::{self, Compared};
use crate::verify::toolchain::{self, Harness};

/// Both bundles, with their built test drivers.
#[derive(Debug)]
pub struct Firmware {
    /// What was traced.
    pub bundle: Bundle,
    /// C: files and driver.
    pub c: Built,
    /// Rust: files and driver.
    pub rust: Built,
}

/// One language's bundle.
#[derive(Debug)]
pub struct Built {
    /// Which.
    pub language: Language,
    /// The bundle's files.
    pub files: Vec<EmittedFile>,
    /// The built driver.
    pub harness: Harness,
    // Holds the sources while the driver is built.
    _folder: TemporaryFolder,
}

impl Firmware {
    /// Emits and builds both.
    ///
    /// # Errors
    /// No compiler; sources that do not compile.
    pub fn make(design: &Design, command: &str) -> Result<Self> {
        let on_phase = design
            .compensation
            .as_ref()
            .is_none_or(|c| c.input.is_of_chain());
        let part = if on_phase {
            Part::Chain
        } else {
            Part::Compensation
        };
        let (c, rust) = both(
            || build(design, part, Language::C, command),
            || build(design, part, Language::Rust, command),
        );
        Ok(Firmware {
            bundle: Bundle::new(design, part),
            c: c?,
            rust: rust?,
        })
    }

    /// Compares both with the model: C first.
    ///
    /// # Errors
    /// A driver that cannot be run.
    pub fn compare(&self, design: &Design) -> Result<Vec<Compared>> {
        let one = |built: &Built| {
            compare::with_model(design, &self.bundle, built.language, &built.harness)
        };
        let (c, rust) = both(|| one(&self.c), || one(&self.rust));
        let mut all = c?;
        all.extend(rust?);
        Ok(all)
    }

    /// Every emitted file with its path under the output folder.
    pub fn files(&self) -> impl Iterator<Item = (String, &str)> {
        let of = |folder: &'static str, built: &'_ Built| -> Vec<(String, usize)> {
            let files = built.files.iter().enumerate();
            files
                .map(|(k, f)| (format!("firmware/{folder}/{}", f.path), k))
                .collect()
        };
        let c = of("c", &self.c)
            .into_iter()
            .map(|(path, k)| (path, self.c.files[k].text.as_str()));
        let rust = of("rust", &self.rust)
            .into_iter()
            .map(|(path, k)| (path, self.rust.files[k].text.as_str()));
        c.chain(rust)
    }
}

impl Built {
    /// Builds the driver of a bundle.
    ///
    /// # Errors
    /// No compiler; sources that do not compile.
    pub fn of_files(files: Vec<EmittedFile>, language: Language, prefix: &str) -> Result<Self> {
        built(files, language, prefix)
    }

    /// Outputs of a function for each input, the fault left out; `outputs` words each.
    ///
    /// # Errors
    /// A driver that cannot be run.
    pub fn call(&self, name: &str, inputs: &[Vec<i128>], outputs: usize) -> Result<Vec<Vec<i128>>> {
        let words = inputs.iter().flatten().map(|w| *w as i64);
        let bytes: Vec<u8> = words.flat_map(i64::to_ne_bytes).collect();
        let mut results = Vec::with_capacity(inputs.len());
        let arguments = ["call".to_owned(), name.to_owned()];
        self.harness
            .run(&arguments, bytes, outputs + 1, &mut |words| {
                results.push(
                    words[..outputs]
                        .iter()
                        .map(|w| i128::from(*w as i64))
                        .collect(),
                );
            })?;
        Ok(results)
    }

    /// Rows of the chain for captured codes, `columns` words each, the fault left out.
    ///
    /// # Errors
    /// A driver that cannot be run.
    pub fn chain(&self, drive: &[i32], sense: &[i32], columns: usize) -> Result<Vec<i64>> {
        let pairs = drive.iter().zip(sense);
        let bytes = pairs
            .flat_map(|(d, s)| [d.to_ne_bytes(), s.to_ne_bytes()])
            .flatten();
        let mut rows = Vec::new();
        self.harness.run(
            &["chain".to_owned()],
            bytes.collect(),
            columns + 1,
            &mut |words| {
                rows.extend(words[..columns].iter().map(|w| *w as i64));
            },
        )?;
        Ok(rows)
    }
}

fn build(design: &Design, part: Part, language: Language, command: &str) -> Result<Built> {
    let files = files::emit(design, part, language, command)?;
    Built::of_files(files, language, &design.name)
}

fn built(files: Vec<EmittedFile>, language: Language, prefix: &str) -> Result<Built> {
    let folder = TemporaryFolder::of_the_system()
        .map_err(|e| io_error(std::env::temp_dir(), "make a folder for the firmware", &e))?;
    files::write(&files, folder.path())?;
    let sources: Vec<String> = files.iter().map(|f| f.path.clone()).collect();
    let harness = toolchain::build(language, prefix, folder.path(), &sources)?;
    Ok(Built {
        language,
        files,
        harness,
        _folder: folder,
    })
}
