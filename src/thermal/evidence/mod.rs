//! One method for the causes of a thermal record: the set of effects with the greatest evidence.
//!
//! A hypothesis is a *set* of terms: effects of the catalogue, effects of the design's user, nonparametric terms (smooth functions,
//! products and histories of channels, changes in time) and spectral lines. The error of the fitted rows is
//!
//! y = B b + Z c + n,  b flat,  c ~ N(0, n s0^2),  n ~ N(0, sigma^2 V),  p(sigma) ~ 1 / sigma
//!
//! with B the declared bias and what the thermometer's readings err by (errors in variables), Z the columns of the terms,
//! orthonormal beyond B, s0^2 the mean square that the declared model leaves, and V white and 1/f noise with a random walk or a smooth
//! (integrated) one. With the coefficients and sigma integrated out the likelihood is in closed form ([`score`]); a term's non-linear
//! parameters have a prior over their grid, which costs it its Occam factor; and every named term costs the same prior odds
//! ([`PRIOR_ODDS`]), a nonparametric one those of [`NAMELESS`] for as many laws as it has columns. A smooth walk is such a hypothesis too:
//! something that nobody recorded. Spectral lines and events (a level that changes, a bump) are part of the noise: a record may have several.
//!
//! The search ([`beam`]) keeps the best few sets of each size, looks beside each of them at every shape of every
//! candidate, and ends with the nearest exchanges. The answer ([`posterior`]) is the best set: a name stands where its posterior
//! odds against the set without it are [`NAMED_ODDS`] or more, and whatever replaces it at less is its rival; if that is a nonparametric term, the
//! name stands and something is left. Where the noise has to walk, a name must also lower the error of stretches that it is not fitted to. No step depends on the order of an earlier one, and
//! nothing is kept between calls: all functions are of record, rows and options.
//!
//! Rows have one of two roles so far: *fit* (training blocks; everything here sees them alone) and *judge* (held-out blocks: the
//! error that is reported, which steers nothing: `tests/evidence.rs`). No row chooses but the stretches that are left out of the fit in turn.

pub mod beam;
pub mod columns;
pub mod lines;
pub mod posterior;
pub mod refine;
pub mod score;

/// Prior odds of any one term (convention): of some fifty hypotheses that a record has one is expected to be true.
pub const PRIOR_ODDS: f64 = 0.02;

/// Share of that for a term without a name (convention: of four causes the catalogue has three; not calibrated).
pub const NAMELESS: f64 = 0.3;

/// Posterior odds from which on a name is given, and below which an exchange is a rival (convention: "decisive" in Jeffreys 1961).
pub const NAMED_ODDS: f64 = 100.0;

/// Most terms of a set, spectral lines apart (of `design`: more have not been seen in one record).
pub const MOST_TERMS: usize = 5;
