//! The words of any node of the circuit, sample by sample, in files that other programs open: CSV
//! for tables, NPY for NumPy, VCD for wave viewers.
//!
//! A [`Trace`] holds signals of several rates on one clock, the ADC's. [`Trace::write`] chooses the
//! writer by the file's extension; each of `csv`, `npy` and `vcd` says what its file holds.

mod csv;
mod merge;
mod npy;
mod signal;
mod sink;
mod vcd;

#[cfg(test)]
mod tests;
#[cfg(test)]
mod vcd_tests;

use crate::error::{InputError, Result};
pub use signal::{Signal, Trace, Values};
use sink::Sink;
use std::path::Path;

impl Trace {
    /// Writes the trace to a file that appears whole or not at all, in the format of its extension:
    /// `.csv`, `.npy` or `.vcd` (in any case of letters).
    ///
    /// - CSV: `sample,time_s` and a column a signal; a cell is empty where a signal of a slower rate
    ///   has no value.
    /// - NPY: one array, rows x signals, at the rate of the fastest signal, slower ones held.
    /// - VCD: IEEE 1364-2005, section 18; two's complement for words, `real` for reals.
    ///
    /// # Errors
    /// Another extension; a sample rate that is no positive number; a signal with `every` = 0 or
    /// `bits` outside 1 to 64; a word that does not fit its bits; for NPY an integer that float64
    /// does not hold exactly; for VCD a time beyond 2^64 of its unit; a failed write.
    pub fn write(&self, path: &Path) -> Result<()> {
        let extension = path.extension().and_then(|e| e.to_str()).unwrap_or("");
        let format = extension.to_ascii_lowercase();
        if !matches!(format.as_str(), "csv" | "npy" | "vcd") {
            return Err(InputError::new(match extension {
                "" => "a trace's file needs an extension that says its format".to_owned(),
                _ => format!("`.{extension}` is not a format that traces are written in"),
            })
            .in_file(path)
            .help("name the file `.csv` (table), `.npy` (NumPy array) or `.vcd` (wave viewer)")
            .into());
        }
        self.check(path)?;
        match format.as_str() {
            "npy" => npy::write(self, path),
            "vcd" => vcd::write(self, path),
            _ => csv::write(self, path),
        }
    }

    /// What no format can hold.
    fn check(&self, path: &Path) -> Result<()> {
        let refused = |what: String| Err(InputError::new(what).in_file(path).into());
        if !(self.sample_rate_hz.is_finite() && self.sample_rate_hz > 0.0) {
            return refused(format!(
                "a trace's sample rate is a positive number, not {} Hz",
                self.sample_rate_hz
            ));
        }
        for signal in &self.signals {
            let wrong = |what: String| refused(format!("trace `{}`: {what}", signal.name));
            if signal.every == 0 {
                return wrong("0 samples between values".to_owned());
            }
            let span = u128::from(signal.every) * signal.values.len() as u128;
            if u128::from(self.first_sample) + span > u128::from(u64::MAX) {
                return wrong("a sample's number exceeds 64 bits".to_owned());
            }
            if let Values::Integer { bits, values } = &signal.values {
                if !(1..=64).contains(bits) {
                    return wrong(format!("a word has 1 to 64 bits, not {bits}"));
                }
                let (low, high) = (-(1i128 << (bits - 1)), (1i128 << bits) - 1);
                let misfit = values
                    .iter()
                    .find(|v| !(low..=high).contains(&i128::from(**v)));
                if let Some(value) = misfit {
                    return wrong(format!("{value} does not fit into {bits} bits"));
                }
            }
        }
        Ok(())
    }
}
