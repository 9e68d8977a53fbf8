//! `approx.json` (`gyrogen.approx/1`): what was made and how accurate it is.

use crate::approx::form::polynomial::{Monomials, Scheme};
use crate::approx::form::split::{Spacing, Symmetry};
use crate::cost::function::FunctionCost;
use serde::Serialize;

/// The whole result. Errors and values are in the function's own unit.
#[derive(Debug, Clone, PartialEq, Serialize, schemars::JsonSchema)]
pub struct Outcome {
    /// `gyrogen.approx/1`.
    pub schema: &'static str,
    /// Of the tool.
    pub version: &'static str,
    /// Of the canonical text of the request (there is no design file).
    pub design_sha256: String,
    /// The command that makes the same result again.
    pub command: String,
    /// The function, as it was written.
    pub function: String,
    /// The domain, as it was written.
    pub domain: String,
    /// First and last input code of the domain, raw; inputs outside are limited to them.
    pub input_codes: [i128; 2],
    /// `polynomial`, `table` or `piecewise`.
    pub form: &'static str,
    /// The form in words.
    pub detail: String,
    /// Of a polynomial: which orders it has.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub monomials: Option<Monomials>,
    /// Of a polynomial: the order of its steps.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub evaluation: Option<Scheme>,
    /// Formats, as given or chosen.
    pub formats: Formats,
    /// Of a polynomial: from order 0 to the degree; zeros where the monomials have none.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub coefficients: Option<Vec<Word>>,
    /// Of a table or piecewise polynomial.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub table: Option<TableData>,
    /// How far the result is from the function.
    pub error: ErrorBounds,
    /// Codes that were run.
    pub inputs_checked: u64,
    /// They were all codes of the domain.
    pub exhaustive: bool,
    /// What it costs.
    #[serde(flatten)]
    pub cost: FunctionCost,
    /// The processor of the estimate.
    pub target: crate::design::target::Target,
    /// How the coefficients were found.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub search: Option<Search>,
    /// The coefficients that are best by themselves.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub ideal: Option<super::ideal::Ideal>,
    /// Where a bound was given: each form that meets it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub alternatives: Option<Vec<Alternative>>,
    /// The bound that was asked for.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub bound: Option<f64>,
    /// The bound, if any, is met.
    pub holds: bool,
}

/// Formats by their place.
#[derive(Debug, Clone, PartialEq, Serialize, schemars::JsonSchema)]
pub struct Formats {
    /// Of the input.
    pub input: String,
    /// Of the output.
    pub output: String,
    /// Of coefficients or entries.
    pub coefficients: String,
    /// Of the cast after each step; null where there is none.
    pub intermediate: Option<String>,
}

/// A raw word with its value.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, schemars::JsonSchema)]
pub struct Word {
    /// The integer.
    pub raw: i128,
    /// What it stands for.
    pub value: f64,
}

/// A table's data.
#[derive(Debug, Clone, PartialEq, Serialize, schemars::JsonSchema)]
pub struct TableData {
    /// `plain`, `linear`, `quadratic`, `bipartite`, `piecewise`.
    pub kind: &'static str,
    /// Length of segments.
    pub spacing: Spacing,
    /// Number of segments.
    pub segments: usize,
    /// Of a bipartite table: the logarithm of the number of segments that share corrections.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub middle_bits: Option<u32>,
    /// The symmetry that is used.
    pub symmetry: Option<Symmetry>,
    /// Fraction bits of every entry.
    pub fraction_bits: i32,
    /// The tables under their names in the sources.
    pub entries: std::collections::BTreeMap<&'static str, Vec<i64>>,
}

/// Errors in the function's unit.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, schemars::JsonSchema)]
pub struct ErrorBounds {
    /// Proved over the real domain: approximation + coefficients + evaluation + output rounding.
    pub certified_max_abs: f64,
    /// Over every input code; null if not every code was run.
    pub exhaustive_max_abs: Option<f64>,
    /// Over the codes that were run, where these are not all.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub sampled_max_abs: Option<f64>,
    /// The rounded coefficients or entries under ideal evaluation; proved.
    pub coefficients_only_max_abs: f64,
    /// Evaluation and output rounding.
    pub rounding_max_abs: f64,
    /// The first code with the greatest error, raw.
    pub at_input_raw: i128,
}

/// How a polynomial's coefficients were found.
#[derive(Debug, Clone, PartialEq, Serialize, schemars::JsonSchema)]
pub struct Search {
    /// The error of the best real coefficients.
    pub minimax_error: f64,
    /// Why the coefficients were taken that were taken.
    pub reason: super::selection::Reason,
    /// What evaluation and output may round, as a part of the whole error of the ideally best coefficients.
    pub rounding_part: f64,
    /// The least error of the whole evaluation that was met.
    pub least_total: f64,
    /// No coefficients in these formats have an error of the whole evaluation below `least_total`.
    pub proved_best: bool,
    /// The compared coefficients that are best under ideal evaluation are proved to be that.
    pub coefficients_proved_best: bool,
    /// By how much the whole error is below that of the lattice heuristic (as fpminimax) in the same datapath,
    /// in per cent; 0 is a tie, and if `proved_best` nothing better exists.
    pub gain_over_nearest_plane_percent: Option<f64>,
    /// Choices that were run.
    pub evaluations: u64,
    /// Choices side by side, the taken one last.
    pub compared: Vec<Compared>,
}

/// One choice of coefficients.
#[derive(Debug, Clone, PartialEq, Serialize, schemars::JsonSchema)]
pub struct Compared {
    /// What it is.
    pub name: &'static str,
    /// Raw coefficients, one a monomial.
    pub raw: Vec<i128>,
    /// Under ideal evaluation.
    pub ideal_max_abs: f64,
    /// Of the whole evaluation, over the codes; null if it was not run.
    pub total_max_abs: Option<f64>,
    /// It is proved that none has a smaller one: an ideal error for the ideally best, of the whole
    /// evaluation for what is taken.
    pub proved: bool,
}

/// A form that meets the bound.
#[derive(Debug, Clone, PartialEq, Serialize, schemars::JsonSchema)]
pub struct Alternative {
    /// `polynomial`, `table` or `piecewise`.
    pub form: &'static str,
    /// In words.
    pub detail: String,
    /// What it costs.
    #[serde(flatten)]
    pub cost: FunctionCost,
    /// Proved.
    pub certified_max_abs: f64,
    /// No other one is at least as good in ROM, multiplications, additions and error.
    pub undominated: bool,
    /// This one was taken.
    pub chosen: bool,
}

/// Coefficients with the least error under ideal evaluation, in the formats of the emitted ones.
#[derive(Debug, Clone, PartialEq, Serialize, schemars::JsonSchema)]
pub struct Ideal {
    /// From order 0 to the degree; zeros where the monomials have none.
    pub coefficients: Vec<Word>,
    /// sup |f - p| over the real domain, proved; the emitted ones' is `error.coefficients_only_max_abs`.
    pub coefficients_only_max_abs: f64,
    /// Error of the whole evaluation with them, over the codes of the search; null if the datapath cannot take them.
    pub total_max_abs: Option<f64>,
    /// No coefficients in these formats have a smaller error under ideal evaluation.
    pub proved_best: bool,
    /// They are the emitted ones.
    pub emitted: bool,
}
