//! Minimax polynomials, and the best coefficients that their formats allow.
//!
//! In reading order: [`wide`] (arithmetic of some 32 digits), [`basis`] (which monomials), [`samples`]
//! (function, interval and weight at points), [`extrema`], [`remez`] (real coefficients), [`fit`] (measured data),
//! [`lattice`] (reduction and enumeration), [`problem`] (formats), [`coefficients`] (the best integers under ideal
//! evaluation; `pins` where they are many), [`mod@search`] (the best integers under the evaluation that will run).
//!
//! Everything here is deterministic: budgets count steps, never seconds. Maxima are found on dense points
//! with refinement, to about 1e-9 of their size; they are not proofs.

pub mod basis;
pub mod coefficients;
mod cuts;
mod ellipsoid;
mod exchange;
pub mod extrema;
pub mod fit;
pub mod lattice;
mod pins;
pub mod problem;
pub mod proof;
pub mod remez;
pub mod samples;
pub mod search;
pub mod wide;

pub use basis::{Basis, Monomials};
pub use coefficients::{Best, Budget, Enumeration};
pub use extrema::Extremum;
pub use fit::{PointFit, fit_points};
pub use problem::{Candidate, CoefficientFormat, Problem};
pub use proof::{Slab, Slabs};
pub use remez::{Minimax, minimax};
pub use samples::{Samples, Target, Weight};
pub use search::{Datapath, Effort, Found, Judged, search, search_from};
pub use wide::Wide;
