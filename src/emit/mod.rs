//! Emission.
pub mod lower;
