//! The likelihood of a record whose noise has a memory, and tests that stay honest under it.
//!
//! A row of a record is y(t) = x(t)' beta + n(t): regressors of the declared bias model (and of a
//! candidate effect), plus white noise, 1/f noise and rate random walk of unknown strengths. In
//! reading order: [`noise`] writes n as a linear state space on the record's own times; [`whiten`]
//! turns columns into uncorrelated ones, so that generalised least squares is ordinary least
//! squares; [`reml`] estimates the strengths ([`robust`]: spikes; [`decimate`]: long records);
//! [`candidates`] measures a dictionary of candidate effects ([`partial`]: beside the declared model); [`score`] says how
//! often chance alone does as well ([`tail`]: small probabilities); [`blocks`] cuts held-out blocks.
//! [`linear`], [`random`] and `filter` are tools.
//!
//! Nothing here is random: surrogates are functions of a seed and a counter ([`random`]).

pub mod blocks;
pub mod candidates;
pub mod correlation;
pub mod decimate;
mod filter;
pub mod folds;
pub mod lattice;
pub mod linear;
pub mod memory;
pub mod noise;
pub mod normal;
pub mod partial;
pub mod random;
pub mod reml;
pub mod robust;
pub mod score;
pub mod smooth;
pub mod stats;
pub mod tail;
pub mod trend;
pub mod weights;
pub mod whiten;

#[cfg(test)]
mod calibration_tests;
#[cfg(test)]
mod reml_tests;
#[cfg(test)]
mod score_tests;
#[cfg(test)]
mod simulated;
#[cfg(test)]
mod whiten_tests;

/// Why a record cannot be fitted here.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum Unusable {
    /// Fewer used rows than the model and its noise need.
    #[error("{rows} usable rows are too few")]
    TooFewRows {
        /// Rows that are used.
        rows: usize,
        /// Rows that would do.
        least: usize,
    },
    /// A column, the times or the signal is of another length, or not finite in a used row.
    #[error("{0} is not finite in every used row, or of another length than the times")]
    NotFinite(&'static str),
    /// Times decrease, or all are the same.
    #[error("the times decrease or do not advance")]
    Times,
    /// The regressors do not contain a constant, which stands for the unknown start of the walk.
    #[error("the regressors do not contain a constant")]
    NoConstant,
}
