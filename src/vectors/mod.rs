//! What emitted functions are tested with: the bit-accurate [`model`] of each ([`form`]: of an approximation), the chain's
//! [`rows`], and the inputs ([`stimulus`]).

pub mod form;
pub mod model;
pub mod rows;
pub mod stimulus;
