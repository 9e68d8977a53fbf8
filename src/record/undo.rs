//! A temperature correction that an autopilot had subtracted, taken off again.

use super::thermal::ThermalRecord;
use super::warning::Warning;
use crate::error::{InputError, Result};
use std::path::Path;

/// A cubic in the temperature that was subtracted.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Cubic {
    /// deg/s per K^k, lowest first.
    pub(super) coefficients_dps: [f64; 4],
    pub(super) reference_degc: f64,
    pub(super) range_degc: (f64, f64),
    /// deg/s that were added beside it.
    pub(super) added_dps: f64,
}

impl Cubic {
    pub(super) fn at(&self, degc: f64) -> f64 {
        let limited = degc.max(self.range_degc.0).min(self.range_degc.1);
        let t = limited - self.reference_degc;
        let [a, b, c, d] = self.coefficients_dps;
        a + (b + (c + d * t) * t) * t
    }
}

/// What was subtracted, and when.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Undo {
    /// From when on: us since power-on; `None` while the correction was off.
    pub(super) pieces: Vec<(u64, Option<Cubic>)>,
    /// The parameters that it is from.
    pub(super) name: String,
}

impl Undo {
    fn cubic(&self, time_us: f64) -> Option<&Cubic> {
        let mut before = self.pieces.iter().filter(|p| p.0 as f64 <= time_us);
        before.next_back()?.1.as_ref()
    }

    /// Adds what was subtracted to every row in which it was.
    ///
    /// # Errors
    /// A record without a temperature.
    pub(super) fn take_off(
        &self,
        record: &mut ThermalRecord,
        path: &Path,
    ) -> Result<Option<Warning>> {
        let since = record
            .column("time_since_power_on_s")
            .map(<[f64]>::to_vec)
            .unwrap_or_default();
        let cubics: Vec<Option<&Cubic>> = since.iter().map(|s| self.cubic(s * 1e6)).collect();
        let rows = cubics.iter().flatten().count();
        if rows == 0 {
            return Ok(None);
        }
        let Some(degc) = record.column("die_degc").map(<[f64]>::to_vec) else {
            return Err(InputError::new(format!(
                "the correction by {} cannot be taken off: the log has no temperature of its gyro",
                self.name
            ))
            .in_file(path)
            .help("leave --undo-correction out, or log the temperature")
            .into());
        };
        let mut largest = 0.0f64;
        if let Some(rate) = record.columns.get_mut("rate_out_dps") {
            for ((rate, degc), cubic) in rate.iter_mut().zip(degc).zip(&cubics) {
                let Some(cubic) = cubic else { continue };
                let off = cubic.at(degc) - cubic.added_dps;
                *rate += off;
                largest = largest.max(off.abs());
            }
        }
        let of = match rows == cubics.len() {
            true => String::new(),
            false => format!(" in the {rows} of {} rows in which it was on", cubics.len()),
        };
        Ok(Some(Warning::on(
            "correction_undone",
            "rate_out_dps",
            format!(
                "the temperature correction of {} was taken off again{of}: up to {largest:.4} deg/s",
                self.name
            ),
        )))
    }
}
