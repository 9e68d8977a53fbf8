//! Model against emitted code: [`toolchain`] builds a bundle, [`compare`] runs it beside [`crate::vectors`] and finds the first
//! difference; [`firmware`] and [`correction`] emit, build and compare; [`bundle`] does it from a bundle's own files, which it
//! holds against what such a bundle must have; `product` does it with all parts of one, and with these
//! together; [`process`] ends what hangs.

pub mod bundle;
pub mod compare;
pub mod correction;
mod expected;
pub mod firmware;
pub mod process;
mod product;
pub mod target;
pub mod toolchain;
