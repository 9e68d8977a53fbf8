//! The bit-accurate circuit against the float model, node by node.
//!
//! One run of the circuit in [`Paired`](crate::numeric::paired::Paired) gives for every node the error
//! fixed - float of every sample, a bound on it that is computed beside it, and what overflowed
//! ([`run`], [`probe`], [`node`], [`layout`]). [`polar`] bounds the CORDIC, [`loops`] the closed phase loop.
//! [`overflow`] finds the smallest format that removes the first overflow. [`outcome`] is `equiv.json`.

pub mod activity;
pub mod against;
mod cordic_noise;
mod front_noise;
mod horner;
pub mod job;
pub mod layout;
pub mod loops;
pub mod node;
pub mod outcome;
pub mod overflow;
pub mod polar;
pub mod predicted;
pub mod probe;
pub mod quantisation;
pub mod run;
pub mod shrink;
mod slow_noise;
pub mod table_noise;
