//! A thermal record: rows of averaged readings.

use super::warning::Warning;
use crate::design::RecordMapping;
use crate::design::record_columns;
use crate::design::units::{self, Unit};
use crate::statistics::stats;
use crate::text::{constant, number};
use std::collections::BTreeMap;
use std::path::PathBuf;

/// A distance of rows that is longer than so many usual ones parts two groups (convention).
const GAP_STEPS: f64 = 5.0;

/// "42 s", "50 min", "9.57 h".
fn duration(s: f64) -> String {
    let (value, unit) = match s {
        s if s < 120.0 => (s, "s"),
        s if s < 7200.0 => (s / 60.0, "min"),
        s => (s / 3600.0, "h"),
    };
    format!("{} {unit}", constant(value, 3))
}

/// A thermal record, read and checked. All columns have [`ThermalRecord::len`] rows.
#[derive(Debug, Clone, PartialEq)]
pub struct ThermalRecord {
    /// The file as the user named it.
    pub source: PathBuf,
    /// s; always measured, never decreasing, and strictly increasing unless a warning
    /// `repeated_times` says that rows were kept.
    pub time_s: Vec<f64>,
    /// All other columns by contract name (auxiliary ones by the file's name), in the unit that
    /// the name carries; NaN = not measured.
    pub columns: BTreeMap<String, Vec<f64>>,
    /// 1-based line of the file for each row (of the first where rows were averaged).
    pub lines: Vec<usize>,
    /// Contract name -> column of the file, where they differ.
    pub renamed: BTreeMap<String, String>,
    /// Contract name -> the unit that the file has the column in, where it is another one than the name's.
    pub units: BTreeMap<String, Unit>,
}

impl ThermalRecord {
    /// Where a row is, for messages: "line 5", or "12.3 s since power-on" of a log, which has no lines.
    pub(crate) fn place(&self, row: usize) -> String {
        match self.log_time(row) {
            Some(s) => format!("{s:.1} s since power-on"),
            None => format!("line {}", self.lines.get(row).copied().unwrap_or(0)),
        }
    }

    /// "on line 5", "at 12.3 s since power-on".
    pub(crate) fn at_place(&self, row: usize) -> String {
        let word = if self.log_time(row).is_some() {
            "at"
        } else {
            "on"
        };
        format!("{word} {}", self.place(row))
    }

    /// "line 5, 7, 9 and 5 more", "5.5, 7.5 s since power-on".
    pub(crate) fn places(&self, rows: &[usize]) -> String {
        const MOST: usize = 8;
        let shown = rows.iter().take(MOST);
        let more = match rows.len().saturating_sub(MOST) {
            0 => String::new(),
            n => format!(" and {n} more"),
        };
        let times: Option<Vec<String>> = shown
            .clone()
            .map(|row| Some(format!("{:.1}", self.log_time(*row)?)))
            .collect();
        match times {
            Some(times) => format!("{} s since power-on{more}", times.join(", ")),
            None => {
                let lines = shown.filter_map(|row| self.lines.get(*row));
                let lines: Vec<String> = lines.map(usize::to_string).collect();
                format!("line {}{more}", lines.join(", "))
            }
        }
    }

    fn log_time(&self, row: usize) -> Option<f64> {
        let times = self.columns.get("time_since_power_on_s");
        times.filter(|_| self.is_of_log())?.get(row).copied()
    }

    /// Number of rows.
    pub fn len(&self) -> usize {
        self.time_s.len()
    }

    /// The file's unit of a column whose values, as they were understood, look like `unit`. `None`: none that is known.
    pub(super) fn unit_in_file(&self, column: &str, unit: &'static str) -> Option<&'static str> {
        match self.units.get(column) {
            None => Some(unit),
            Some(taken) => units::product(*taken, units::parse(unit)?),
        }
    }

    /// How a column's unit is said in the design, with the file's own name of the column; `unit` as in [`Self::unit_in_file`].
    pub(super) fn unit_in_design(&self, column: &str, unit: &'static str) -> String {
        let named = self.renamed.get(column).map_or(column, String::as_str);
        let Some(unit) = self.unit_in_file(column, unit) else {
            let taken = self.units.get(column).map_or("", |u| u.name);
            return format!(
                "column {named} is taken as {taken}: correct that in [record.columns] or in its name"
            );
        };
        self.line_for(column, unit)
    }

    /// The line of the design that says that the file has a column in `unit`, or what to rename first.
    pub(super) fn line_for(&self, column: &str, unit: &str) -> String {
        let named = self.renamed.get(column).map_or(column, String::as_str);
        match units::stated(named, column) {
            // Two statements that contradict each other are refused.
            Some(said) if said.name != unit => format!(
                "its name says {}, so rename the column in the file, such as to \"x\", and write [record.columns] {column} = \
                 {{ column = \"x\", unit = \"{unit}\" }}",
                said.name
            ),
            _ => format!("[record.columns] {column} = {{ column = {named:?}, unit = \"{unit}\" }}"),
        }
    }

    /// True without rows; [`super::read`] gives no such record.
    pub fn is_empty(&self) -> bool {
        self.time_s.is_empty()
    }

    /// A column by contract name, `time_s` included; `None` if the file lacks it.
    pub fn column(&self, name: &str) -> Option<&[f64]> {
        if name == "time_s" {
            return Some(&self.time_s);
        }
        self.columns.get(name).map(Vec::as_slice)
    }

    /// True for a record of an autopilot's log, whose topics state their units.
    pub fn is_of_log(&self) -> bool {
        let source = self.renamed.get("rate_out_dps");
        source.is_some_and(|s| s.contains('.')) && !self.columns.contains_key("rate_dps")
    }

    /// The columns, the contract's first and in its order, with what the file calls them where that is another name: for a user to
    /// see how the file was understood. A unit is told where it was assumed; `mapping` is what the file was read with.
    pub fn understood(&self, mapping: &RecordMapping) -> String {
        let names = std::iter::once("time_s").chain(self.columns.keys().map(String::as_str));
        let known = record_columns::KNOWN;
        let place = |name: &&str| known.iter().position(|(k, _)| k == name);
        let mut names: Vec<&str> = names.collect();
        names.sort_by_key(|name| place(name).unwrap_or(known.len()));
        // A log's topics state their units.
        let assumed = |name: &str, file: &str| {
            let is_said = mapping.units.contains_key(name) || units::stated(file, name).is_some();
            !is_said && !self.is_of_log() && record_columns::unit_of(name) != "1"
        };
        let tell = |name: &str| match self.renamed.get(name) {
            Some(file) if assumed(name, file) => {
                format!(
                    "{name} from {file} ({} assumed)",
                    record_columns::unit_of(name)
                )
            }
            Some(file) => format!("{name} from {file}"),
            None => name.to_owned(),
        };
        let (known, others): (Vec<&str>, Vec<&str>) = names
            .into_iter()
            .partition(|name| record_columns::is_known(name));
        let listed = |names: &[&str]| {
            let told: Vec<String> = names.iter().map(|name| tell(name)).collect();
            told.join(", ")
        };
        let mut text = listed(&known);
        if let Some(other) = others.first() {
            text.push_str(&format!(
                "; further measured quantities, which `close` tries as causes: {} (to leave a column out: ignore = [\"{other}\"] in \
                 [record])",
                listed(&others)
            ));
        }
        if !mapping.ignore.is_empty() {
            let names: Vec<&str> = mapping.ignore.keys().map(String::as_str).collect();
            text.push_str(&format!("; left out: {}", names.join(", ")));
        }
        text
    }

    /// How many rows there are, over what time and how far apart, and whether they are means of the file's, as `warnings` of the same record say;
    /// `average_s` is what the design asks for.
    pub fn rows_understood(&self, warnings: &[Warning], average_s: Option<f64>) -> String {
        let averaged: Vec<&str> = warnings
            .iter()
            .filter(|w| matches!(w.code, "rows_averaged" | "log_averaged"))
            .filter_map(|w| w.message.split(": ").next())
            .collect();
        if !averaged.is_empty() {
            return averaged.join("; ");
        }
        let why = match average_s {
            None => "to average, set `average_s` in [record]".to_owned(),
            Some(s) => format!("`average_s` = {s} s joins no two of them"),
        };
        format!("{} {}not averaged ({why})", self.len(), self.spacing())
    }

    /// Over what time the rows are and how far apart, up to the comma or semicolon behind it.
    fn spacing(&self) -> String {
        let steps: Vec<f64> = self.time_s.windows(2).map(|w| w[1] - w[0]).collect();
        let usual = stats::median(&steps);
        let span: f64 = steps.iter().sum();
        let gaps: Vec<f64> = steps
            .into_iter()
            .filter(|s| *s > GAP_STEPS * usual)
            .collect();
        let between = gaps.iter().fold(0.0, |m: f64, s| m.max(*s));
        let (time, usual_s) = (duration(span), number(usual, 4));
        // Else most of the time has rows, and a gap is no part of the plan.
        match gaps.iter().sum::<f64>() > 0.5 * span {
            true => format!(
                "over {time}, in {} groups: {usual_s} s between the rows of a group, up to {} s between groups; ",
                gaps.len() + 1,
                number(between, 4)
            ),
            false => format!("over {time}, one every {usual_s} s, "),
        }
    }

    /// How many rows of a column are measured; 0 if there is none of that name.
    pub fn measured(&self, name: &str) -> usize {
        self.column(name)
            .map_or(0, |c| c.iter().filter(|v| !v.is_nan()).count())
    }

    /// The error signal, deg/s: `rate_out_dps - rate_dps`, an absent column or cell of applied
    /// rate counting as 0 (at rest). NaN where the output was not measured.
    pub fn error_dps(&self) -> Vec<f64> {
        let applied = self.column("rate_dps").unwrap_or(&[]);
        self.column("rate_out_dps")
            .unwrap_or(&[])
            .iter()
            .enumerate()
            .map(|(i, out)| match applied.get(i) {
                Some(rate) if !rate.is_nan() => out - rate,
                _ => *out,
            })
            .collect()
    }
}
