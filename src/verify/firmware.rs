//! The firmware in both languages: emitted, built, compared.

use crate::design::Design;
use crate::emit::bundle::{Bundle, Part};
use crate::emit::views::Language;
use crate::error::{Result, io_error};
use crate::firmware::files;
use crate::firmware::files::{Emission, EmittedFile};
use crate::firmware::replace;
use crate::leftovers::TemporaryFolder;
use crate::numeric::rows::WordRows;
use crate::parallel::both;
use crate::verify::compare::{self, Compared};
use crate::verify::toolchain::{self, Harness};
use std::path::Path;

/// Both languages' bundles, with the test drivers of those that were built.
#[derive(Debug)]
pub struct Firmware {
    /// What was traced.
    pub bundle: Bundle,
    /// C, Rust.
    emitted: [Vec<EmittedFile>; 2],
    /// C first.
    built: Vec<Built>,
}

/// Names of the folders of both languages' bundles.
const FOLDERS: [&str; 2] = ["firmware/c", "firmware/rust"];

/// One language's bundle, built.
#[derive(Debug)]
pub struct Built {
    /// Which.
    pub language: Language,
    /// The built driver.
    pub harness: Harness,
    // Holds the sources while the driver is built.
    _folder: TemporaryFolder,
}

impl Firmware {
    /// Emits both and builds those of `languages`.
    ///
    /// # Errors
    /// No compiler; sources that do not compile.
    pub fn make(design: &Design, command: &str, languages: &[Language]) -> Result<Self> {
        let on_phase = design
            .compensation
            .as_ref()
            .is_none_or(|c| c.input.is_of_chain());
        let part = if on_phase {
            Part::Chain
        } else {
            Part::Compensation
        };
        let emission = Emission::new(design, part, command)?;
        let print = |language| emission.print(language);
        let (c, rust) = both(|| print(Language::C), || print(Language::Rust));
        let (c, rust) = (c?, rust?);
        // The drivers need the sources alone: they are built while the vectors are made.
        let build = || built([&c.sources, &rust.sources], emission.prefix(), languages);
        let (built, vectors) = std::thread::scope(|scope| {
            let built = scope.spawn(build);
            let vectors = emission.vectors();
            match built.join() {
                Ok(built) => (built, vectors),
                Err(panic) => std::panic::resume_unwind(panic),
            }
        });
        let emitted = [c, rust].map(|printed| emission.files(printed, &vectors));
        Ok(Firmware {
            bundle: Bundle::new(design, part),
            built: built?,
            emitted,
        })
    }

    /// Builds emitted files.
    ///
    /// # Errors
    /// No compiler; sources that do not compile.
    pub fn of_files(
        bundle: Bundle,
        c: Vec<EmittedFile>,
        rust: Vec<EmittedFile>,
        languages: &[Language],
    ) -> Result<Self> {
        let built = built([&c, &rust], &bundle.prefix, languages)?;
        Ok(Firmware {
            bundle,
            built,
            emitted: [c, rust],
        })
    }

    /// Those that were built, C first.
    pub fn all(&self) -> &[Built] {
        &self.built
    }

    /// The drivers of those, with their languages.
    pub fn drivers(&self) -> Vec<(Language, &Harness)> {
        self.built
            .iter()
            .map(|b| (b.language, &b.harness))
            .collect()
    }

    /// A language's, if it was built.
    pub fn built(&self, language: Language) -> Option<&Built> {
        self.built.iter().find(|b| b.language == language)
    }

    /// Compiler and flags of a language.
    pub fn toolchain(&self, language: Language) -> &str {
        self.built(language)
            .map_or("not built", |b| b.harness.toolchain.as_str())
    }

    /// Does something with each that was built, side by side; what comes of it, C first.
    ///
    /// # Errors
    /// Those of `work`.
    pub fn each<T: Send>(&self, work: impl Fn(&Built) -> Result<Vec<T>> + Sync) -> Result<Vec<T>> {
        let one = |language| self.built(language).map_or(Ok(Vec::new()), &work);
        let (c, rust) = both(|| one(Language::C), || one(Language::Rust));
        let mut all = c?;
        all.extend(rust?);
        Ok(all)
    }

    /// Compares what was built with the model: C first.
    ///
    /// # Errors
    /// A driver that cannot be run.
    pub fn compare(&self, design: &Design) -> Result<Vec<Compared>> {
        let drivers = self.drivers();
        let compared = compare::with_model(design, &self.bundle, &drivers, drivers.len())?;
        Ok(compared.concat())
    }

    /// The bundles, each with its folder among the results.
    pub fn bundles(&self) -> impl Iterator<Item = (&[EmittedFile], &'static str)> {
        self.emitted.iter().map(Vec::as_slice).zip(FOLDERS)
    }
}

/// The drivers of both languages' sources, those that are among `languages`: C first.
fn built(
    [c, rust]: [&[EmittedFile]; 2],
    prefix: &str,
    languages: &[Language],
) -> Result<Vec<Built>> {
    let build = |language, files: &[EmittedFile]| match languages.contains(&language) {
        true => Built::of_files(files, language, prefix).map(Some),
        false => Ok(None),
    };
    let (c, rust) = both(|| build(Language::C, c), || build(Language::Rust, rust));
    Ok(c?.into_iter().chain(rust?).collect())
}

/// Refuses a folder of results whose firmware was edited: to be asked before work begins.
///
/// # Errors
/// Edited files of a bundle, and files that are none of it.
pub fn refuse_edited(out: &Path) -> Result<()> {
    FOLDERS
        .iter()
        .try_for_each(|name| replace::refuse(&[], &out.join(name)))
}

impl Built {
    /// Builds the driver of a bundle.
    ///
    /// # Errors
    /// No compiler; sources that do not compile.
    pub fn of_files(files: &[EmittedFile], language: Language, prefix: &str) -> Result<Self> {
        let folder = TemporaryFolder::of_the_system()
            .map_err(|e| io_error(std::env::temp_dir(), "make a folder for the firmware", &e))?;
        files::write(files, folder.path())?;
        let sources: Vec<String> = files.iter().map(|f| f.path.clone()).collect();
        let harness = toolchain::build(language, prefix, folder.path(), &sources)?;
        Ok(Built {
            language,
            harness,
            _folder: folder,
        })
    }

    /// The output of a function of one output for each input, the fault left out.
    ///
    /// # Errors
    /// A driver that cannot be run.
    pub fn call(&self, name: &str, inputs: &WordRows) -> Result<Vec<i64>> {
        let mut results = Vec::with_capacity(inputs.len());
        let arguments = ["call".to_owned(), name.to_owned()];
        let size = (2, inputs.len() as u64);
        self.harness
            .run(&arguments, inputs.to_bytes(), size, &mut |words| {
                results.push(words[0] as i64);
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
            (columns + 1, drive.len() as u64),
            &mut |words| {
                rows.extend(words[..columns].iter().map(|w| *w as i64));
            },
        )?;
        Ok(rows)
    }
}
