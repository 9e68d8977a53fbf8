//! The emitted correction, built with the host's compilers, beside the model's block on the record.

use super::stream;
use crate::emit::views::Language;
use crate::error::Result;
use crate::firmware::files::EmittedFile;
use crate::record::{ThermalRecord, condensed};
use crate::thermal::close::Closed;
use crate::verdict::Closure;
use crate::verify::compare::Compared;
use crate::verify::correction::Firmware;
use serde::Serialize;

/// What came of the comparison. Where nothing differs, the held-out errors of
/// [`FirmwareErrors`](crate::verdict::FirmwareErrors) are those of the emitted code.
#[derive(Debug, Clone, PartialEq, Serialize, schemars::JsonSchema)]
pub struct Emitted {
    /// Readings of the record, held out or not.
    pub readings: u64,
    /// Words of both languages: of every call its result and its fault, of every table its entries.
    pub words_compared: u64,
    /// Calls and entries with a difference.
    pub mismatches: u64,
    /// Compiler and flags: C, Rust.
    pub toolchains: [String; 2],
    /// One by one: tables and the step, C first.
    pub functions: Vec<Compared>,
}

impl Emitted {
    /// What was compared with what outcome.
    pub fn sentence(&self) -> String {
        format!(
            "{} words compared, {} mismatches",
            self.words_compared, self.mismatches
        )
    }

    /// The first difference of each table and function that has one; empty if the check holds.
    pub fn differences(&self) -> Vec<String> {
        let differing = self.functions.iter().filter(|f| f.mismatches > 0);
        differing.map(Compared::sentence).collect()
    }
}

/// `closure.json` with the comparison, if there was one.
#[derive(Debug, Clone, Serialize)]
pub struct Told<'a> {
    /// The closure.
    #[serde(flatten)]
    pub closure: &'a Closure,
    /// The comparison.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub emitted: Option<&'a Emitted>,
}

/// Builds emitted sources and runs the whole of a closed record through them, with the readings between
/// its rows where the correction has a memory. `record` is what was closed; of a long one the means are
/// run, as they were closed. `None` if firmware cannot carry the closure.
///
/// # Errors
/// No compiler (exit 2); sources that do not compile (exit 1).
pub fn check(
    closed: &Closed,
    record: &ThermalRecord,
    prefix: &str,
    files: [Vec<EmittedFile>; 2],
) -> Result<Option<Emitted>> {
    let Some(correction) = &closed.correction else {
        return Ok(None);
    };
    let condensed = condensed(record);
    let record = condensed.as_ref().map_or(record, |(short, _)| short);
    let (readings, places) = stream(&correction.plan, record, &closed.channels)?;
    let languages = [Language::C, Language::Rust];
    let firmware = Firmware::of_files(correction, prefix, files, &languages)?;
    let functions = firmware.compare(correction, &readings)?;
    Ok(Some(Emitted {
        readings: places.len() as u64,
        words_compared: functions.iter().map(|f| f.compared).sum(),
        mismatches: functions.iter().map(|f| f.mismatches).sum(),
        toolchains: languages.map(|language| firmware.toolchain(language).to_owned()),
        functions,
    }))
}
