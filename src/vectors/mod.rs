//! What emitted functions are tested with: the bit-accurate [`model`] of each, and the inputs ([`stimulus`]).

pub mod model;
pub mod stimulus;
