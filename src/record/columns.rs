//! Which column of a file plays which part (`docs/manual.md`, "Thermal records").

use super::cells::{self, Cell};
use super::guesses::{self, suggestion};
use super::ignored;
use super::warning::Warning;
use crate::design::RecordMapping;
pub use crate::design::record_columns::{KNOWN, THERMOMETERS, is_known, unit_of};
use crate::design::units::{self, Unit};
use crate::error::{InputError, Result};
use crate::nearest::nearest;
use std::collections::BTreeMap;
use std::path::Path;

/// A line of the file, for messages.
#[derive(Debug, Clone, Copy)]
pub(super) struct Line<'a> {
    /// The record's path.
    pub path: &'a Path,
    /// 1-based.
    pub number: usize,
    /// Without its line ending.
    pub text: &'a str,
}

impl Line<'_> {
    /// An error at a character column of this line.
    pub(super) fn error(&self, column: usize, message: String, help: String) -> InputError {
        let mut e = InputError::new(message)
            .in_file(self.path)
            .at(self.number, column.max(1))
            .help(help);
        // A caret under control characters or at the end of a megabyte helps nobody.
        if self.text.len() < 4096 && !self.text.contains(char::is_control) {
            e.source_line = Some(self.text.to_owned());
        }
        e
    }
}

/// The parts that the columns of a file play.
#[derive(Debug, Clone)]
pub(super) struct Roles {
    /// By column of the file: its name there, and the contract or auxiliary names it serves.
    pub columns: Vec<(String, Vec<String>)>,
    /// The contract's columns that the file has in another unit.
    pub units: Vec<(String, Unit)>,
    /// What was decided on the way.
    pub warnings: Vec<Warning>,
}

impl Roles {
    /// The file's column that serves `name`.
    pub(super) fn index_of(&self, name: &str) -> Option<usize> {
        self.columns
            .iter()
            .position(|(_, names)| names.iter().any(|n| n == name))
    }
}

/// Reads the header and gives each column its part.
///
/// # Errors
/// No header, a column without a name, twice the same name, a mapping to a column that the file
/// lacks, no clock, no rate.
pub(super) fn resolve(line: Line<'_>, mapping: &RecordMapping) -> Result<Roles> {
    let header = header_cells(line)?;
    let names: Vec<&str> = header.iter().map(|c| &*c.text).collect();
    let mut seen: BTreeMap<&str, usize> = BTreeMap::new();
    for (i, cell) in header.iter().enumerate() {
        if cell.text.is_empty() {
            continue;
        }
        if let Some(first) = seen.insert(&cell.text, i) {
            return Err(line
                .error(
                    cell.column,
                    format!(
                        "two columns are called \"{}\": the {} and the {}",
                        cell.text,
                        ordinal(first + 1),
                        ordinal(i + 1)
                    ),
                    "rename or remove one of them".to_owned(),
                )
                .into());
        }
    }
    ignored::check(mapping, line.path, &names)?;
    let is_kept = |name: &&&str| !mapping.ignore.contains_key(**name);
    let kept: Vec<&str> = names.iter().filter(is_kept).copied().collect();
    let mut columns: Vec<(String, Vec<String>)> = names
        .iter()
        .map(|n| ((*n).to_owned(), Vec::new()))
        .collect();
    for (role, wanted) in &mapping.columns {
        match names.iter().position(|n| n == wanted) {
            Some(i) if !wanted.is_empty() => columns[i].1.push(role.clone()),
            _ => return Err(lacking(line, mapping, role, wanted, &names).into()),
        }
    }
    refuse_swapped(line, mapping, &names)?;
    let mut warnings = Vec::new();
    for (name, roles) in &mut columns {
        if !roles.is_empty() || name.is_empty() || mapping.ignore.contains_key(name) {
            continue;
        }
        if let Some(other) = mapping.columns.get(name.as_str()) {
            warnings.push(Warning::on(
                "shadowed_column",
                name,
                format!(
                    "[record.columns] takes {name} from \"{other}\"; the file's own column {name} \
                     is left out"
                ),
            ));
        } else {
            roles.push(name.clone());
        }
    }
    in_other_units(&mut columns, &kept, mapping);
    warnings.extend(twice(&columns, mapping));
    let units = converted(line, &columns, mapping)?;
    warnings.extend(told(&units, &columns));
    warnings.extend(assumed(&columns, mapping));
    let roles = Roles {
        columns,
        units,
        warnings,
    };
    for role in ["time_s", "rate_out_dps"] {
        let clocked = role == "time_s" && mapping.row_period_s.is_some();
        if roles.index_of(role).is_none() && !clocked {
            return Err(line
                .error(
                    1,
                    format!("the record has no column {role}, which is required"),
                    suggestion(role, &kept, mapping),
                )
                .into());
        }
    }
    Ok(roles)
}

/// The error for a column that the design names and the file lacks: in the design, where its place is known.
fn lacking(
    line: Line<'_>,
    mapping: &RecordMapping,
    role: &str,
    wanted: &str,
    names: &[&str],
) -> InputError {
    let Some(place) = mapping.places.get(role) else {
        let message = format!(
            "the record has no column \"{wanted}\", which [record.columns] names for {role}"
        );
        return line.error(1, message, suggestion(role, names, mapping));
    };
    let meant = nearest(wanted, names).or_else(|| guesses::guess(role, names));
    let meant = meant.map_or(String::new(), |m| format!("did you mean \"{m}\"? "));
    InputError::new(format!(
        "the record {} has no column \"{wanted}\"",
        line.path.display()
    ))
    .at_position(place)
    .help(format!(
        "{meant}{}\n  name one of these in [record.columns]{}",
        guesses::listed(names),
        match role {
            "time_s" | "rate_out_dps" => "",
            _ if THERMOMETERS.contains(&role) =>
                ", or take the line away; a record without a thermometer: `gyrogen close --record` does without",
            _ => ", or take the line away",
        }
    ))
}

/// A place in a row in words: `2nd`.
fn ordinal(n: usize) -> String {
    let end = match (n % 10, n % 100) {
        (1, k) if k != 11 => "st",
        (2, k) if k != 12 => "nd",
        (3, k) if k != 13 => "rd",
        _ => "th",
    };
    format!("{n}{end}")
}

/// Refuses two quantities of the design that each name the column which looks like the other's.
///
/// # Errors
/// That, in the design.
fn refuse_swapped(line: Line<'_>, mapping: &RecordMapping, names: &[&str]) -> Result<()> {
    let rate = "rate_out_dps";
    // By the unit in its name, or else as names of columns go.
    let is_of = |column: &str, role: &str| match units::stated(column, role) {
        Some(unit) => unit.of == unit_of(role),
        None => guesses::guess(role, names) == Some(column),
    };
    for other in THERMOMETERS {
        let (Some(a), Some(b)) = (mapping.columns.get(rate), mapping.columns.get(other)) else {
            continue;
        };
        // A unit that the design states says that the column is meant.
        let is_stated = mapping.units.contains_key(rate) || mapping.units.contains_key(other);
        if is_stated || !(is_of(a, other) && is_of(b, rate)) {
            continue;
        }
        let message = format!(
            "{rate} is read from \"{a}\" and {other} from \"{b}\", and each name is that of the other quantity: the two look \
             swapped"
        );
        let help = format!(
            "write {rate} = \"{b}\" and {other} = \"{a}\"; if the design is right, say the unit: {rate} = {{ column = \"{a}\", \
             unit = \"deg/s\" }}"
        );
        return Err(in_design(line, mapping, rate, message, help).into());
    }
    Ok(())
}

/// An error about what the design says of a role: there, where its place is known.
pub(super) fn in_design(
    line: Line<'_>,
    mapping: &RecordMapping,
    role: &str,
    message: String,
    help: String,
) -> InputError {
    match mapping.places.get(role) {
        Some(place) => InputError::new(format!("record {}: {message}", line.path.display()))
            .at_position(place)
            .help(help),
        None => line.error(1, message, help),
    }
}

/// Gives the contract's column to a file's column that has it in another unit (`time_ms`), where nothing else does.
fn in_other_units(columns: &mut [(String, Vec<String>)], names: &[&str], mapping: &RecordMapping) {
    let mut taken: Vec<&str> = Vec::new();
    for (name, roles) in columns {
        let Some(meant) = units::meant(name) else {
            continue;
        };
        let free = !names.contains(&meant)
            && !mapping.columns.contains_key(meant)
            && !taken.contains(&meant);
        if free && roles.len() == 1 && roles[0] == *name && !is_known(name) {
            *roles = vec![meant.to_owned()];
            taken.push(meant);
        }
    }
}

/// What is said of a column that has in another unit what another column has as well, as `time_ms` beside `time_s`.
fn twice(columns: &[(String, Vec<String>)], mapping: &RecordMapping) -> Vec<Warning> {
    let serves = |role: &str| columns.iter().find(|c| c.1.iter().any(|r| r == role));
    let others = columns
        .iter()
        .filter(|(name, roles)| roles.len() == 1 && roles.first() == Some(name) && !is_known(name));
    others
        .filter_map(|(name, _)| {
            let role = units::meant(name).filter(|r| !mapping.columns.contains_key(*r))?;
            let (taken, _) = serves(role)?;
            Some(Warning::on(
                "two_columns_of_one",
                role,
                format!(
                    "the file has {role} twice, as \"{taken}\" and as \"{name}\": \"{taken}\" is taken. [record.columns] says otherwise: \
                     {role} = \"{name}\""
                ),
            ))
        })
        .collect()
}

/// The units of the contract's columns where they are others than the contract's.
///
/// # Errors
/// Two statements that contradict each other; a unit of another quantity.
fn converted(
    line: Line<'_>,
    columns: &[(String, Vec<String>)],
    mapping: &RecordMapping,
) -> Result<Vec<(String, Unit)>> {
    let mut out = Vec::new();
    for (name, roles) in columns {
        for role in roles.iter().filter(|r| is_known(r)) {
            let asked = mapping.units.get(role).map(|text| {
                units::parse(text).ok_or_else(|| -> crate::error::Error {
                    in_design(
                        line,
                        mapping,
                        role,
                        format!("\"{text}\" is no unit that is known for {role}"),
                        format!("{role} can be in {}", units::accepted(role)),
                    )
                    .into()
                })
            });
            let asked = asked.transpose()?;
            let stated = units::stated(name, role);
            if let (Some(a), Some(b)) = (asked, stated)
                && a != b
            {
                return Err(in_design(
                    line,
                    mapping,
                    role,
                    format!(
                        "the design says that column \"{name}\" is in {}, and its name says {}",
                        a.name, b.name
                    ),
                    format!(
                        "if the name is right, write unit = \"{}\" or leave the unit out; if the design is, rename the column in the file's \
                         header, such as to \"x\", and write {role} = {{ column = \"x\", unit = \"{}\" }}",
                        b.name, a.name
                    ),
                )
                .into());
            }
            if asked.is_none() && stated.is_none() && guesses::is_of_codes(name) {
                return Err(in_design(
                    line,
                    mapping,
                    role,
                        format!("column \"{name}\" holds raw codes by its name, and {role} is in {}", unit_of(role)),
                        format!(
                            "multiply it by the sensor's scale first; if it is no code, say its unit: {role} = {{ column = \"{name}\", \
                             unit = \"{}\" }}",
                            unit_of(role)
                        ),
                    )
                    .into());
            }
            let Some(unit) = asked.or(stated) else {
                continue;
            };
            if unit.of != unit_of(role) {
                return Err(in_design(
                    line,
                    mapping,
                    role,
                    format!(
                        "column \"{name}\" is in {}, which is no unit of {role} ({})",
                        unit.name,
                        unit_of(role)
                    ),
                    format!(
                        "map another column to {role}; it can be in {}",
                        units::accepted(role)
                    ),
                )
                .into());
            }
            let own = name.strip_suffix(']').or(name.strip_suffix(')'));
            let own = own
                .and_then(|n| n.rsplit_once(['[', '(']))
                .map(|n| n.0.trim());
            if own.is_some_and(is_known) && !unit.is_own() {
                return Err(line
                    .error(
                        1,
                        format!("column \"{name}\" says {} and {}", unit_of(role), unit.name),
                        "let its name say one unit".to_owned(),
                    )
                    .into());
            }
            if !unit.is_own() {
                out.push((role.clone(), unit));
            }
        }
    }
    Ok(out)
}

/// What is said of columns that were converted.
fn told(units: &[(String, Unit)], columns: &[(String, Vec<String>)]) -> Option<Warning> {
    let each = units.iter().map(|(role, unit)| {
        let serves = |c: &&(String, Vec<String>)| c.1.contains(role);
        let file = columns.iter().find(serves).map_or("", |c| c.0.as_str());
        format!(
            "{role} is \"{file}\" in {}, converted to {} ({})",
            unit.name,
            unit_of(role),
            unit.rule()
        )
    });
    let each: Vec<String> = each.collect();
    (!each.is_empty()).then(|| Warning::general("units_converted", each.join("; ")))
}

/// What is said of columns whose unit neither their names nor the design say.
fn assumed(columns: &[(String, Vec<String>)], mapping: &RecordMapping) -> Option<Warning> {
    let mut each = Vec::new();
    let mut lines = Vec::new();
    for (name, roles) in columns {
        for role in roles.iter().filter(|r| is_known(r)) {
            if !mapping.units.contains_key(role) && guesses::is_without_unit(role, name) {
                each.push(format!("\"{name}\" in {}", unit_of(role)));
                lines.push(guesses::mapped(role, name));
            }
        }
    }
    (!each.is_empty()).then(|| {
        Warning::general(
            "unit_assumed",
            format!(
                "units are assumed, since neither the columns' names nor the design say them: {}. Say in [record.columns] which they \
                 are: {}",
                each.join(", "),
                lines.join(", ")
            ),
        )
    })
}

/// The header's cells, refused where the line cannot be a header.
fn header_cells(line: Line<'_>) -> Result<Vec<Cell<'_>>> {
    let header = match cells::split(line.text) {
        Ok(header) => header,
        Err(column) => return Err(open_quote(line, column).into()),
    };
    if let [only] = header.as_slice() {
        for (mark, name) in [('\t', "tabs"), ('|', "bars")] {
            if only.text.contains(mark) {
                return Err(line
                    .error(
                        1,
                        format!("the columns are separated by {name}"),
                        "separate them with commas or semicolons".to_owned(),
                    )
                    .into());
            }
        }
    }
    if header.iter().all(|c| cells::number(&c.text).is_ok()) {
        return Err(line
            .error(
                1,
                "the record has no header row: its first line holds numbers only".to_owned(),
                "write the columns' names on the first line, with units, such as \
                 time_s,rate_out_dps,die_degc"
                    .to_owned(),
            )
            .into());
    }
    Ok(header)
}

/// The error for a quote that is not closed.
pub(super) fn open_quote(line: Line<'_>, column: usize) -> InputError {
    line.error(
        column,
        "this quote is not closed on its line".to_owned(),
        "close it, or remove it: numbers need no quotes, and a row is one line".to_owned(),
    )
}

#[cfg(test)]
#[path = "columns_tests.rs"]
mod tests;
