//! `[record]` and `[record.columns]`: how a measured record is read.

use super::keys::THERMOMETERS;
use super::schema::*;
use super::table::{Real, Table, Value};
use super::units;
use crate::error::{Position, Result};
use std::collections::BTreeMap;

/// Reads `[record]`.
pub(super) fn record(t: &Table, base: Option<&RecordMapping>) -> Result<RecordMapping> {
    let base = base.cloned().unwrap_or_default();
    let row_period_s = match t.get("row_period_s") {
        Some(v) => Some(v.real(Real::Positive, "s from row to row")?),
        None => base.row_period_s,
    };
    let thermometer = match t.get("thermometer") {
        Some(v) => {
            let words: Vec<(&str, &str)> = THERMOMETERS.iter().map(|w| (*w, *w)).collect();
            Some(v.choice(&words)?.to_owned())
        }
        None => base.thermometer,
    };
    let axis = t.take("axis", Some(base.axis), |v| {
        v.choice(&[("x", LogAxis::X), ("y", LogAxis::Y), ("z", LogAxis::Z)])
    })?;
    let instance = match t.get("instance") {
        Some(v) => Some(v.integer(0..=255, "the number of the gyro in a log")?),
        None => base.instance,
    };
    let average_s = match t.get("average_s") {
        Some(v) => Some(v.real(Real::Within(1e-3, 86_400.0), "s of samples in a row")?),
        None => base.average_s,
    };
    let mut columns = base.columns;
    let mut units = base.units;
    let ignore = match t.get("ignore") {
        Some(v) => ignored(&v)?,
        None => base.ignore,
    };
    let given = t.section("columns")?;
    let (named, stated) = record_columns(&given)?;
    for role in named.keys() {
        units.remove(role);
    }
    columns.extend(named);
    units.extend(stated);
    refuse_ignored(&given, &columns, &ignore)?;
    let mut places = base.places;
    let entries = given.entries().into_iter();
    places.extend(entries.map(|(role, value)| (role.to_owned(), value.error("").position())));
    let at = |key: &str| t.get(key).map(|value| value.error("").position());
    Ok(RecordMapping {
        columns,
        units,
        places,
        row_period_at: at("row_period_s").or(base.row_period_at),
        thermometer_at: at("thermometer").or(base.thermometer_at),
        average_at: at("average_s").or(base.average_at),
        instance_at: at("instance").or(base.instance_at),
        ignore,
        row_period_s,
        thermometer,
        axis,
        instance,
        average_s,
        undo_correction: base.undo_correction,
    })
}

/// The file's columns that are left out, each with its place.
fn ignored(list: &Value) -> Result<BTreeMap<String, Position>> {
    let mut found = BTreeMap::new();
    for value in list.array(IGNORED)? {
        let name = value.text("the name in the file of a column that is left out")?;
        if name.trim().is_empty() {
            return Err(value
                .error("names no column")
                .help("write the column's name as the file's header spells it, or delete it from the list")
                .into());
        }
        found.insert(name.to_owned(), value.error("").position());
    }
    Ok(found)
}

/// An example of `ignore`.
const IGNORED: &str = "[\"gyro_x\", \"gyro_y\"]";

/// Refuses a column that the design reads and leaves out.
fn refuse_ignored(
    given: &Table,
    columns: &BTreeMap<String, String>,
    ignore: &BTreeMap<String, Position>,
) -> Result<()> {
    let both = columns
        .iter()
        .find(|(_, column)| ignore.contains_key(*column));
    let Some((role, column)) = both else {
        return Ok(());
    };
    let message = format!("`{role}` is read from \"{column}\", which `ignore` leaves out");
    let error = match given.get(role) {
        Some(value) => value.error(format!("is \"{column}\", which `ignore` leaves out")),
        None => given.error(message),
    };
    Err(error
        .help("delete the column from `ignore`, or the key here")
        .into())
}

/// The columns of the file, and their units where they are stated, by contract column.
type Named = (BTreeMap<String, String>, BTreeMap<String, String>);

fn record_columns(t: &Table) -> Result<Named> {
    let (mut columns, mut units) = (BTreeMap::new(), BTreeMap::new());
    let mut taken: BTreeMap<&str, &str> = BTreeMap::new();
    for (role, value) in t.entries() {
        let column = if value.is_table() {
            let table = value.table()?;
            table.only(&["column", "unit"])?;
            if let Some(unit) = table.get("unit") {
                units.insert(role.to_owned(), unit_of(role, &unit)?);
            }
            match table.get("column") {
                Some(column) => column.text("the column's name in the file")?,
                None => role,
            }
        } else {
            value.text(
                "the column's name in the file, or { column = \"gyro_z\", unit = \"rad/s\" },",
            )?
        };
        if column.trim().is_empty() {
            return Err(value
                .error("names no column")
                .help("write the column's name as the file's header spells it, or delete the key")
                .into());
        }
        if let Some(other) = taken.insert(column, role) {
            return Err(value
                .error(format!(
                    "is {}, the column that `{other}` is read from already",
                    value.shown()
                ))
                .help("give each quantity a column of its own, or delete one of the two keys")
                .into());
        }
        columns.insert(role.to_owned(), column.to_owned());
    }
    Ok((columns, units))
}

/// The unit in which the file has a contract column.
fn unit_of(role: &str, value: &Value) -> Result<String> {
    let text = value.text("the unit")?;
    let of = super::record_columns::unit_of(role);
    match units::parse(text) {
        Some(unit) if unit.of == of => Ok(text.to_owned()),
        Some(unit) => Err(value
            .error(format!(
                "is {}, which is no unit of {role} ({of})",
                unit.name
            ))
            .help(format!("{role} can be in {}", units::accepted(role)))
            .into()),
        None => Err(value
            .error(format!("is {}, a unit that is not known", value.shown()))
            .help(format!("{role} can be in {}", units::accepted(role)))
            .into()),
    }
}
