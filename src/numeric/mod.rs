//! Formats, rounding, overflow, and the arithmetics that the circuit is written over.
//!
//! [`mod@format`] and [`cast`] say what a quantiser does; [`arithmetic`] is the interface of the
//! blocks; [`float`], [`fixed`], [`batch`], [`trace`] and [`paired`] implement it; [`rows`] holds many words; [`constants`] decides the integers
//! nearest to sines, arc tangents and the CORDIC gain; [`turn`] holds elementary functions with the same bits on every
//! machine.

pub mod arithmetic;
pub mod batch;
pub mod cast;
pub mod constants;
pub mod fixed;
pub mod float;
pub mod format;
pub mod lane;
pub mod paired;
mod paired_word;
pub mod polynomial;
pub mod rows;
pub mod splitmix;
pub mod trace;
pub mod turn;
