//! The correction as C and Rust: emitted, built, compared with the model on a record's readings.

use crate::correction::{Correction, Reading};
use crate::emit::bundle::Bundle;
use crate::emit::views::{self, Language};
use crate::error::Result;
use crate::firmware::correction::{Origin, emit};
use crate::firmware::files;
use crate::firmware::files::EmittedFile;
use crate::firmware::stepped;
use crate::parallel::both;
use crate::verify::compare::{self, Compared};
use crate::verify::firmware::Built;
use std::path::Path;

/// Both languages' bundles, with their built test drivers.
#[derive(Debug)]
pub struct Firmware {
    /// What was traced.
    pub bundle: Bundle,
    /// C: files and driver.
    pub c: Built,
    /// Rust: files and driver.
    pub rust: Built,
}

impl Firmware {
    /// Emits and builds both.
    ///
    /// # Errors
    /// No compiler; sources that do not compile.
    pub fn make(correction: &Correction, origin: &Origin) -> Result<Self> {
        let c = emit(correction, origin, Language::C)?;
        let rust = emit(correction, origin, Language::Rust)?;
        Firmware::of_files(correction, origin.prefix, c, rust)
    }

    /// Builds both from emitted files.
    ///
    /// # Errors
    /// As [`Firmware::make`].
    pub fn of_files(
        correction: &Correction,
        prefix: &str,
        c: Vec<EmittedFile>,
        rust: Vec<EmittedFile>,
    ) -> Result<Self> {
        let (c, rust) = both(
            || Built::of_files(c, Language::C, prefix),
            || Built::of_files(rust, Language::Rust, prefix),
        );
        Ok(Firmware {
            bundle: stepped::bundle(prefix, &correction.trace()),
            c: c?,
            rust: rust?,
        })
    }

    /// Compares both with the model on these readings, call by call and bit for bit, and their tables: C
    /// first.
    ///
    /// # Errors
    /// A driver that cannot be run.
    pub fn compare(&self, correction: &Correction, readings: &[Reading]) -> Result<Vec<Compared>> {
        let (calls, _) = correction.calls(readings);
        let words = correction.run_words(&calls);
        let expected: Vec<Vec<i128>> = words.into_iter().map(|word| vec![word, 0]).collect();
        let one = |built: &Built| -> Result<Vec<Compared>> {
            let (language, harness) = (built.language, &built.harness);
            let mut all = Vec::new();
            for table in views::tables(&self.bundle, language) {
                let entries: Vec<i128> = table.entries.iter().map(|v| i128::from(*v)).collect();
                all.push(compare::table(language, harness, &table.name, &entries)?);
            }
            let name = crate::correction::block::STEP;
            all.push(compare::stream(language, harness, name, &calls, &expected)?);
            Ok(all)
        };
        let (c, rust) = both(|| one(&self.c), || one(&self.rust));
        let mut all = c?;
        all.extend(rust?);
        Ok(all)
    }

    /// Writes `firmware/c` and `firmware/rust` under `folder`.
    ///
    /// # Errors
    /// A folder that cannot be written.
    pub fn write(&self, folder: &Path) -> Result<()> {
        files::write(&self.c.files, &folder.join("firmware/c"))?;
        files::write(&self.rust.files, &folder.join("firmware/rust"))
    }
}
