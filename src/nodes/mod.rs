//! Every node of the circuit, fixed and float at once.
//!
//! One run of the circuit in [`Paired`](crate::numeric::paired::Paired) gives for every node the error fixed - float of every
//! sample, a bound on it that is computed beside it, and what overflowed ([`run`], [`probe`], [`node`], [`layout`]). [`polar`]
//! bounds the CORDIC, [`loops`] the closed phase loop; [`quantisation`] are the moments of a rounding, [`activity`] says
//! whether a node's words move enough for them, [`histogram`] counts errors. [`repair`] finds the formats that no word overflows.

pub mod activity;
pub mod histogram;
pub mod layout;
pub mod loops;
pub mod node;
pub mod polar;
pub mod probe;
pub mod quantisation;
pub mod repair;
pub mod run;
