//! What `replay` did, for machines (`gyrogen.replay/1`).

use serde::Serialize;

/// What `replay --format json` prints; the rows themselves are in the file.
#[derive(Debug, Clone, PartialEq, Serialize, schemars::JsonSchema)]
pub struct Replayed {
    /// `gyrogen.replay/1`.
    pub schema: &'static str,
    /// Of the tool.
    pub version: &'static str,
    /// Of the design's text.
    pub design_sha256: String,
    /// `fixed` (raw integers) or `float` (real values).
    pub arithmetic: &'static str,
    /// ADC samples of each channel that were read.
    pub samples: u64,
    /// Rows that were written: one a decimation period.
    pub rows: u64,
    /// Names of the file's columns, in order.
    pub columns: Vec<String>,
    /// Of warnings on the capture, what each says.
    pub warnings: Vec<String>,
    /// The file, by its base name.
    pub file: String,
}
