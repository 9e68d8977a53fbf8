//! Model against emitted code: [`model`] evaluates the bit-accurate blocks one call at a time,
//! [`stimulus`] makes inputs, [`toolchain`] builds a bundle, [`compare`] runs it and finds the first
//! difference, [`bundle`] does all that from a bundle's own files.

pub mod bundle;
pub mod chain;
pub mod compare;
pub mod correction;
mod expected;
pub mod firmware;
pub mod process;
pub mod target;
pub mod toolchain;
