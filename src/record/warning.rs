//! What is usable but unlikely, or was handled in a way that the user should know of.

use crate::circuit::setpoint::OutOfReach;
use crate::design::Design;
use serde::Serialize;

/// One remark on a record or on a fit; `closure.json` carries it as is.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, schemars::JsonSchema)]
pub struct Warning {
    /// A stable identifier, such as `phase_in_degrees`.
    pub code: &'static str,
    /// The column it is about, by its contract name.
    pub column: Option<String>,
    /// What was seen, with figures and units, and what to do.
    pub message: String,
}

impl Warning {
    /// `note` where something was done as it is always, or as file or design ask for it; else `warning`.
    pub fn label(&self) -> &'static str {
        match self.code {
            "units_converted" | "rows_averaged" | "log_averaged" => "note",
            _ => "warning",
        }
    }

    /// How many there are of each label: "2 warnings, 1 note"; `None` of none.
    pub fn counted(all: &[Warning]) -> Option<String> {
        let counted = ["warning", "note"].into_iter().filter_map(|label| {
            match all.iter().filter(|w| w.label() == label).count() {
                0 => None,
                1 => Some(format!("1 {label}")),
                n => Some(format!("{n} {label}s")),
            }
        });
        let counted: Vec<String> = counted.collect();
        (!counted.is_empty()).then(|| counted.join(", "))
    }

    /// A remark on one column.
    pub fn on(code: &'static str, column: &str, message: impl Into<String>) -> Self {
        Warning {
            code,
            column: Some(column.to_owned()),
            message: message.into(),
        }
    }

    /// Adds the remarks of a fit to those of its record. A thermometer that never moves is told by both: the fit's remark, which
    /// says what follows, stays.
    pub fn add_of_fit(all: &mut Vec<Warning>, of_fit: impl IntoIterator<Item = Warning>) {
        for warning in of_fit {
            let is_same =
                |old: &Warning| old.code == "frozen_channel" && old.column == warning.column;
            if warning.code == "thermometer_constant" {
                all.retain(|old| !is_same(old));
            }
            all.push(warning);
        }
    }

    /// A remark on the record or the fit as a whole.
    pub fn general(code: &'static str, message: impl Into<String>) -> Self {
        Warning {
            code,
            column: None,
            message: message.into(),
        }
    }

    /// Of an amplitude loop that cannot reach its setpoint; `None` of any other.
    pub fn of_setpoint(design: &Design) -> Option<Self> {
        let far = OutOfReach::of(design)?;
        Some(Warning::general("setpoint_out_of_reach", far.sentence()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_constant_thermometer_is_told_once() {
        let frozen = |column| Warning::on("frozen_channel", column, "stands");
        let mut all = vec![frozen("die_degc"), frozen("agc")];
        let constant = Warning::on("thermometer_constant", "die_degc", "never moves");
        Warning::add_of_fit(&mut all, [constant.clone()]);
        assert_eq!(all, [frozen("agc"), constant]);
        let other = Warning::on("one_direction", "agc", "heated alone");
        Warning::add_of_fit(&mut all, [other]);
        assert_eq!(all.len(), 3);
    }
}
