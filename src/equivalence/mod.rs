//! The bit-accurate circuit against the float model, node by node.
//!
//! [`job`] runs the circuit with every node watched ([`crate::nodes`]) and compares with the emitted code; [`predicted`] is the
//! theory of each node's rms error; [`outcome`] is `equiv.json`.

pub mod against;
mod cordic_noise;
mod front_noise;
mod horner;
pub mod job;
pub mod outcome;
pub mod predicted;
pub mod shrink;
mod slow_noise;
pub mod table_noise;
