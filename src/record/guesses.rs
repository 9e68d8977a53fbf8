//! Which columns of a file are likely meant, as names of columns go; and what of a design would say so.

use crate::design::record_columns::{THERMOMETERS, unit_of};
use crate::design::{RecordMapping, units};

/// Ends of names that say that a column holds an ADC's or a register's codes.
const CODES: [&str; 6] = ["lsb", "raw", "counts", "count", "codes", "code"];

/// The name says that the column is in no unit but in codes.
pub(super) fn is_of_codes(name: &str) -> bool {
    let lower = name.trim().to_lowercase();
    let mut words = lower
        .rsplit(|c: char| !c.is_alphanumeric())
        .filter(|w| !w.is_empty());
    words.next().is_some_and(|last| CODES.contains(&last)) && words.next().is_some()
}

/// The column among `names` that is likely meant for `role`, as names of columns go.
pub fn guess<'a>(role: &str, names: &[&'a str]) -> Option<&'a str> {
    guesses(role, names).first().copied()
}

/// All that would do as well as the one that [`guess`] gives, which is the first.
pub(super) fn guesses<'a>(role: &str, names: &[&'a str]) -> Vec<&'a str> {
    const HEAT: [&str; 5] = ["temp", "degc", "\u{b0}c", "die", "celsius"];
    let hints: &[&str] = match role {
        "time_s" => &["time", "sec", "clock"],
        "rate_out_dps" => &["gyro", "rate", "omega", "dps", "gx", "gz"],
        "rate_dps" => &["table", "rate", "truth"],
        "phase_rad" => &["phase", "phi"],
        "freq_hz" => &["freq", "hz"],
        "agc" => &["agc", "gain"],
        "quad_dps" => &["quad"],
        "supply_v" => &["supply", "vdd", "volt"],
        "accel_g" => &["acc"],
        _ => &HEAT,
    };
    // "gyro" before "rate": the order of the hints is their strength.
    let is_heat = |name: &str| {
        let stated = units::stated(name, "die_degc").is_some_and(|u| u.of == "degC");
        stated || HEAT.iter().any(|hint| name.contains(hint))
    };
    let is_time = |name: &str| units::stated(name, "time_s").is_some_and(|u| u.of == "s");
    // `t_ms` has its unit alone to say that it is a time; a rate in deg/sec has one that says it is none.
    let of_time = |name: &str| is_time(name) || name == "t";
    let others = |name: &&&str| {
        **name != "time_since_power_on_s"
            && !is_of_codes(name)
            && (role != "time_s" || is_time(name) || units::stated(name, role).is_none())
            && (unit_of(role) != "deg/s" || !is_heat(&name.to_lowercase()))
    };
    let of = |hint: &&str| -> Vec<&'a str> {
        let fit = names.iter().filter(|n| n.to_lowercase().contains(hint));
        fit.filter(others).copied().collect()
    };
    let by_unit = || -> Vec<&'a str> {
        let fit = names.iter().filter(|n| role == "time_s" && of_time(n));
        fit.filter(others).copied().collect()
    };
    hints
        .iter()
        .map(of)
        .find(|found| !found.is_empty())
        .unwrap_or_else(by_unit)
}

/// The file's columns, for a message.
pub(super) fn listed(names: &[&str]) -> String {
    let named: Vec<&str> = names.iter().copied().filter(|n| !n.is_empty()).collect();
    let listed: Vec<&str> = named.iter().copied().take(40).collect();
    let more = named.len() - listed.len();
    let mut text = format!("the file has: {}", listed.join(", "));
    if more > 0 {
        text.push_str(&format!(" and {more} more"));
    }
    text
}

/// Stands for a column of which nothing is known.
const PLACEHOLDER: &str = "NAME_IN_THE_FILE";

/// True where the column's name does not say the unit that the quantity has.
pub(super) fn is_without_unit(role: &str, column: &str) -> bool {
    column != PLACEHOLDER && unit_of(role) != "1" && units::stated(column, role).is_none()
}

/// The line of a design that maps `role` to a column, with the unit where the column's name does not state the contract's:
/// the one that it states, or the contract's, which is a guess then.
pub fn mapped(role: &str, column: &str) -> String {
    let with = |unit: &str| format!("{role} = {{ column = \"{column}\", unit = \"{unit}\" }}");
    match units::stated(column, role) {
        Some(unit) if unit.of == unit_of(role) && !unit.is_own() => with(unit.name),
        None if is_without_unit(role, column) => with(unit_of(role)),
        _ => format!("{role} = \"{column}\""),
    }
}

/// [`mapped`], with a remark where the unit is a guess: which others can be written.
pub fn mapped_with_remark(role: &str, column: &str) -> String {
    let line = mapped(role, column);
    if !is_without_unit(role, column) {
        return line;
    }
    let others: Vec<&str> = units::names_of(unit_of(role))
        .into_iter()
        .filter(|name| *name != unit_of(role))
        .collect();
    match others.is_empty() {
        true => line,
        false => format!("{line} # a guess: or {}", others.join(", ")),
    }
}

/// Lists the file's columns and shows the part of a design file that would map `role`, and what else it lacks beside what
/// `mapping` has.
pub(super) fn suggestion(role: &str, names: &[&str], mapping: &RecordMapping) -> String {
    let named: Vec<&str> = names.iter().copied().filter(|n| !n.is_empty()).collect();
    let mut text = listed(names);
    let has = |role: &str| {
        let in_file = |n: &&str| *n == role || units::meant(n) == Some(role);
        let by_design = mapping.columns.contains_key(role);
        let is_counted = role == "time_s" && mapping.row_period_s.is_some();
        named.iter().any(in_file) || by_design || is_counted
    };
    let line = |role| {
        let column = guess(role, &named).unwrap_or(PLACEHOLDER);
        mapped_with_remark(role, column)
    };
    let mut lines = vec![line(role)];
    // What would be asked for next.
    let others = ["time_s", "rate_out_dps"];
    let others = others.into_iter().filter(|o| *o != role && !has(o));
    lines.extend(others.map(line));
    if !THERMOMETERS.iter().any(|t| *t == role || has(t)) {
        let remark = match guess("die_degc", &named) {
            Some(_) => "",
            None => "# where a column is a thermometer: ",
        };
        lines.push(format!("{remark}{}", line("die_degc")));
    }
    let where_to = match mapping.places.is_empty() && mapping.row_period_at.is_none() {
        true => {
            "say in the design which one it is. These lines are a whole design file, say gyro.toml: `gyrogen run gyro.toml --record ...` \
             and `gyrogen close gyro.toml --record ...` take it:\n    [record.columns]"
        }
        false => "add to [record.columns] of the design:",
    };
    text.push_str(&format!("\n  {where_to}\n    {}", lines.join("\n    ")));
    let axes = guesses("rate_out_dps", &named);
    if let [first @ .., last] = axes.as_slice()
        && !first.is_empty()
        && (role == "rate_out_dps" || !has("rate_out_dps"))
    {
        text.push_str(&format!(
            "\n  {} and {last} would do as rate_out_dps; take the axis you want",
            first.join(", ")
        ));
    }
    if lines.iter().any(|line| line.contains(" # a guess")) {
        text.push_str(
            "\n  a unit with \"a guess\" behind it is not in the column's name: check it, and write the one that the file has",
        );
    }
    if role == "time_s" {
        text.push_str(
            "\n  or, if the rows are evenly spaced and the file has no clock:\n    [record]\n    \
             row_period_s = 1.0",
        );
    }
    text
}
