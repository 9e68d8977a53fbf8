//! Firmware bundles, as files in memory: sources with self-test, harness, vectors and manifest.
//!
//! [`files`] assembles the chain or its compensation, [`function`] one function alone, [`stepped`] one with a state,
//! [`correction`] the step of a correction, [`approximation`] what `gyrogen approx` found; [`manifest`] says what is in a bundle, [`calibrated`] where it holds.

pub mod approximation;
pub mod calibrated;
pub mod correction;
pub mod files;
pub mod function;
pub mod manifest;
mod outside;
pub mod stepped;
