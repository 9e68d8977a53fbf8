//! Columns of a record that the design leaves out (`ignore` in `[record]`).

use super::guesses::listed;
use crate::design::RecordMapping;
use crate::design::record_columns::unit_of;
use crate::error::{InputError, Result};
use crate::nearest::nearest;
use std::path::Path;

/// Checks that what is left out is there and is not required.
///
/// `names` are those of the record's columns as its file has them.
///
/// # Errors
/// A name that the record lacks; a column that every record needs; each at its place in the design.
pub(super) fn check(mapping: &RecordMapping, record: &Path, names: &[&str]) -> Result<()> {
    for (name, place) in &mapping.ignore {
        let record = record.display();
        let is_clock = name == "time_s" && mapping.row_period_s.is_none();
        let is_needed = is_clock || name == "rate_out_dps";
        if is_needed && names.contains(&name.as_str()) && !mapping.columns.contains_key(name) {
            return Err(InputError::new(format!(
                "`ignore` leaves out {name} of the record {record}, which is required"
            ))
            .at_position(place)
            .help(format!(
                "delete {name} from the list, or say in [record.columns] which other column has it, in {}",
                unit_of(name)
            ))
            .into());
        }
        if names.contains(&name.as_str()) {
            continue;
        }
        let meant =
            nearest(name, names).map_or(String::new(), |m| format!("did you mean \"{m}\"? "));
        return Err(InputError::new(format!(
            "the record {record} has no column \"{name}\", which `ignore` leaves out"
        ))
        .at_position(place)
        .help(format!("{meant}{}", listed(names)))
        .into());
    }
    Ok(())
}
