//! What `gyrogen approx` does: a function in fixed point, by the form that was asked for or the cheapest that keeps a bound.
//!
//! [`coefficients`] puts the mathematics of [`crate::approx`] together for a polynomial, [`choice`] among all forms at their
//! [`crate::cost`]; [`job`] does what is asked, [`outcome`] is what comes of it.

mod check;
pub mod choice;
pub mod coefficients;
mod datapath;
pub(crate) mod describe;
pub mod ideal;
pub mod job;
pub mod outcome;
pub mod priced;
mod refused;
pub mod request;
pub mod selection;
mod shortest;
