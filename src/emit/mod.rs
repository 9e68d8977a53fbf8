//! Firmware from the traced circuit: [`lower`] makes typed [`machine`] operations of the program,
//! [`bundle`] gathers what is printed, [`c`] and [`rust`] spell it, [`crate::firmware`] makes the bundle.

pub mod bundle;
pub mod c;
mod guard;
pub mod lower;
mod lower_cast;
mod lower_steps;
pub mod machine;
mod modular;
mod names;
mod notes;
pub mod rust;
pub mod tidy;
pub mod views;
