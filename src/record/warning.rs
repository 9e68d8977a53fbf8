//! What is usable but unlikely, or was handled in a way that the user should know of.

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

    /// A remark on one column.
    pub fn on(code: &'static str, column: &str, message: impl Into<String>) -> Self {
        Warning {
            code,
            column: Some(column.to_owned()),
            message: message.into(),
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
}
