//! The correction as C and Rust: emitted, built, compared with the model on a record's readings.

use super::firmware;
use crate::correction::{Correction, Reading};
use crate::emit::views::{self, Language};
use crate::error::Result;
use crate::firmware::correction::{Origin, emit};
use crate::firmware::files::EmittedFile;
use crate::firmware::stepped;
use crate::numeric::rows::WordRows;
use crate::verify::compare::{self, Compared};

/// Both languages' bundles, with the test drivers of those that were built.
#[derive(Debug)]
pub struct Firmware(firmware::Firmware);

impl Firmware {
    /// Emits both and builds those of `languages`.
    ///
    /// # Errors
    /// No compiler; sources that do not compile.
    pub fn make(correction: &Correction, origin: &Origin, languages: &[Language]) -> Result<Self> {
        let c = emit(correction, origin, Language::C)?;
        let rust = emit(correction, origin, Language::Rust)?;
        Firmware::of_files(correction, origin.prefix, [c, rust], languages)
    }

    /// Builds emitted files, C and Rust.
    ///
    /// # Errors
    /// As [`Firmware::make`].
    pub fn of_files(
        correction: &Correction,
        prefix: &str,
        [c, rust]: [Vec<EmittedFile>; 2],
        languages: &[Language],
    ) -> Result<Self> {
        let bundle = stepped::bundle(prefix, &correction.trace());
        firmware::Firmware::of_files(bundle, c, rust, languages).map(Firmware)
    }

    /// Compiler and flags of a language.
    pub fn toolchain(&self, language: Language) -> &str {
        self.0.toolchain(language)
    }

    /// Compares what was built with the model on these readings, call by call and bit for bit, and the tables: C
    /// first.
    ///
    /// # Errors
    /// A driver that cannot be run.
    pub fn compare(&self, correction: &Correction, readings: &[Reading]) -> Result<Vec<Compared>> {
        let (calls, _) = correction.calls(readings);
        let mut expected = WordRows::new(2);
        for word in correction.run_words(&calls) {
            expected.push([i128::from(word), 0]);
        }
        self.0.each(|built| {
            let (language, harness) = (built.language, &built.harness);
            let mut all = Vec::new();
            for table in views::tables(&self.0.bundle, language) {
                all.push(compare::table(
                    language,
                    harness,
                    &table.name,
                    &table.entries,
                )?);
            }
            let name = crate::correction::block::STEP;
            all.push(compare::sequence(
                language, harness, name, &calls, &expected,
            )?);
            Ok(all)
        })
    }
}
