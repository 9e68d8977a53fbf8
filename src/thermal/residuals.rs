//! `residuals.csv`: what is left of every row, for whoever wants to judge it by other means.

use super::close::Closed;
use crate::error::Result;
use crate::record::rows::{Kind, RowWriter};
use std::path::Path;

/// Writes a row for each one that was closed: `time_s`, the thermometer as the model sees it, `held_out` and `outlier` (0 or 1),
/// the error, deg/s, of the declared model (`before_dps`), with the steps (`after_dps`) and of the firmware
/// (`firmware_dps`), and `role` (`fit`, `choose`, `judge`). NaN: no reading, or no firmware. `held_out` is 1 in rows that judge or,
/// where there are none, in those that choose.
///
/// The held-out errors of `closure.json` are over the rows with `held_out` = 1 and `outlier` = 0.
///
/// # Errors
/// A file that cannot be written.
pub fn write(closed: &Closed, path: &Path) -> Result<()> {
    let c = &closed.channels;
    let names = [
        "time_s",
        &c.thermometer,
        "held_out",
        "outlier",
        "before_dps",
        "after_dps",
        "firmware_dps",
        "role",
    ];
    let (before, after) = (closed.before.residual(c), closed.after.residual(c));
    let flag = |on: bool| f64::from(u8::from(on));
    let held_out = closed.split.judging();
    let mut writer = RowWriter::create(path, &names, Kind::Float)?;
    for row in 0..c.len() {
        let values = [
            c.time_s[row],
            c.centre + c.half * c.u[row],
            flag(held_out[row]),
            flag(closed.accidents[row]),
            before[row],
            after[row],
            closed.firmware_dps.as_ref().map_or(f64::NAN, |f| f[row]),
        ];
        writer.write_floats_and(&values, closed.split.roles[row].word())?;
    }
    writer.finish()
}
