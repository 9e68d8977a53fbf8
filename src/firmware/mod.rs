//! Firmware bundles, as files in memory: sources with self-test, harness, vectors and manifest.
//!
//! [`files`] assembles ([`view`]: what its templates see, `example` and `recipe` among it) the chain or its compensation, [`function`] one function alone, [`stepped`] one with a state,
//! [`correction`] the step of a correction, [`conversion`] what makes its words of the chain's rows, [`product`] these three together, [`approximation`] what `gyrogen approx` found; [`manifest`] says what is in a bundle, [`calibrated`] where it holds,
//! [`vectors`] and [`tested`] how it is compared; [`replace`] puts it in the place of an older one, of whose [`folder`] only plain files are read.

pub mod another;
pub mod approximation;
pub mod calibrated;
pub mod conversion;
pub mod correction;
mod emitted;
mod example;
pub mod files;
pub mod folder;
mod found;
pub mod function;
pub mod manifest;
mod outside;
pub mod paths;
pub mod product;
mod recipe;
pub mod replace;
pub mod stepped;
pub mod tested;
pub mod vectors;
pub mod view;
