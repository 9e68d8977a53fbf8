//! Firmware from the traced circuit: [`lower`] makes typed [`machine`] operations of the program,
//! [`bundle`] gathers what is printed, [`c`] and [`rust`] spell it, [`crate::firmware`] makes the bundle.

pub mod bundle;
pub mod c;
pub mod lower;
mod lower_cast;
pub mod machine;
pub mod rust;
pub mod views;
