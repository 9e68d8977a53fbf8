//! `[record]`: how a measured record is read.

use super::log_axis::LogAxis;
use super::record_columns::THERMOMETERS;
use crate::error::{InputError, Position};
use std::collections::BTreeMap;
use std::path::Path;

/// `[record]`: how a measured record is read.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct RecordMapping {
    /// `[record.columns]`: contract column -> column of the file, e.g. `rate_out_dps = "gyro_x_dps"`.
    pub columns: BTreeMap<String, String>,
    /// The unit in which the file has a column, as the design writes it, by contract column:
    /// `rate_out_dps = { column = "gyro_z", unit = "rad/s" }`.
    pub units: BTreeMap<String, String>,
    /// Where the design names a column of the file, by contract column.
    pub places: BTreeMap<String, Position>,
    /// Where `row_period_s` stands, if a design states it.
    pub row_period_at: Option<Position>,
    /// Where `thermometer` stands, if a design states it.
    pub thermometer_at: Option<Position>,
    /// Where `average_s` stands, if a design states it.
    pub average_at: Option<Position>,
    /// Where `instance` stands, if a design states it.
    pub instance_at: Option<Position>,
    /// `ignore`: columns that are left out, by their names in the file, and where the design names each.
    pub ignore: BTreeMap<String, Position>,
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

impl RecordMapping {
    /// The error for a `thermometer` that a record lacks, in the design where its place is known.
    pub fn lacks_thermometer(&self, name: &str, record: &Path, has: &[&str]) -> InputError {
        let record_name = record.display();
        let error = match &self.thermometer_at {
            Some(place) => InputError::new(format!(
                "the record {record_name} has no column {name}, which is named as thermometer here"
            ))
            .at_position(place),
            None => InputError::new(format!(
                "the record has no column {name}, which the design names as thermometer"
            ))
            .in_file(record),
        };
        let usable = THERMOMETERS.into_iter().filter(|t| has.contains(t));
        let usable: Vec<String> = usable.map(|t| format!("`{t}`")).collect();
        error.help(match usable.is_empty() {
            true => format!(
                "the record has no thermometer, only: {}. Say in [record.columns] which column is one, such as \
                 {name} = \"NAME_IN_THE_FILE\"",
                has.join(", ")
            ),
            false => format!("write {}, or delete the line", usable.join(" or ")),
        })
    }
}
