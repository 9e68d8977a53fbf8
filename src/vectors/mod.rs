//! What emitted functions are tested with: the bit-accurate [`model`] of each ([`form`]: of an approximation;
//! [`interpreter`]: of what remembers something), the [`chain`] with its state, and the inputs ([`stimulus`],
//! [`search`]).

pub mod chain;
pub mod damage;
pub mod form;
mod incremental;
pub mod interpreter;
pub mod model;
mod repair;
pub mod search;
pub mod state;
pub mod stimulus;
mod telling;
