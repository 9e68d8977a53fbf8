//! The codes of a capture as its readers give them.

use crate::error::InputError;
use crate::numeric::format::Format;

/// The two columns that are used, in the order of an NPY capture's columns.
pub(crate) const COLUMNS: [&str; 2] = ["drive_code", "sense_code"];

/// The remedy for a CSV file without a usable header.
pub(super) const HEADER_HELP: &str = "a capture is a CSV file with a header line that names the \
    columns `drive_code` and `sense_code`, separated by commas, or an NPY file of shape (n, 2)";

/// The codes that an ADC format allows.
#[derive(Debug, Clone, Copy)]
pub(super) struct Codes {
    /// Smallest code.
    pub(super) min: i32,
    /// Largest code.
    pub(super) max: i32,
    format: Format,
}

impl Codes {
    /// The range of `format`, of which 32 signed bits are used at most.
    pub(super) fn of(format: Format) -> Self {
        let limit = |v: i128| v.clamp(i128::from(i32::MIN), i128::from(i32::MAX)) as i32;
        Codes {
            min: limit(format.min_raw()),
            max: limit(format.max_raw()),
            format,
        }
    }

    /// Says that `code` of column `name` is outside the range; the caller adds the place.
    pub(super) fn refuse(&self, code: &str, name: &str) -> InputError {
        InputError::new(format!(
            "{name} {code} is outside the ADC's format {}, which holds {} ..= {}",
            self.format, self.min, self.max
        ))
        .help(
            "give the design the capture's word length (`circuit.adc.format`), or repair the \
             capture",
        )
    }
}
