//! `[record]`: how a measured record is read.

use super::log_axis::LogAxis;
use crate::error::InputError;
use std::collections::BTreeMap;

/// `[record]`: how a measured record is read.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct RecordMapping {
    /// `[record.columns]`: contract column -> column of the file, e.g. `rate_out_dps = "gyro_x_dps"`.
    pub columns: BTreeMap<String, String>,
    /// The unit in which the file has a column, as the design writes it, by contract column:
    /// `rate_out_dps = { column = "gyro_z", unit = "rad/s" }`.
    pub units: BTreeMap<String, String>,
    /// Where the design names a column of the file, by contract column: an error there, its message still to be given.
    pub places: BTreeMap<String, InputError>,
    /// `row_period_s`: the clock of a record without `time_s`, s per row.
    pub row_period_s: Option<f64>,
    /// `thermometer`: the column of the bias model; default: the first of phase_rad, freq_hz,
    /// die_degc, chamber_degc that the record has.
    pub thermometer: Option<String>,
    /// `axis`: the gyro's axis that is read from an autopilot's log. Default z.
    pub axis: LogAxis,
    /// `instance`: the number of the gyro in an autopilot's log, from 0; default: the first that it has.
    pub instance: Option<u32>,
    /// `average_s`: s of samples that are averaged into a row; default: 1 s for an autopilot's
    /// log, the rows as they are for CSV.
    pub average_s: Option<f64>,
    /// `undo_correction`: takes a temperature correction off again that an autopilot had applied.
    pub undo_correction: bool,
}
