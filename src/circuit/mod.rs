//! The digital detection circuit, one file a block, each written once over
//! [`Arithmetic`](crate::numeric::arithmetic::Arithmetic).
//!
//! ```text
//! drive code ─┬─► demodulate ─► integrate ═╗                       ┌─► phase ─┬─► compensation ─► rate
//!             └─► demodulate ─► integrate ═╬═► decimate ─► cordic ─┤          └─► phase loop ─► NCO
//! sense code ─┬─► demodulate ─► integrate ═╣      (every R)        └─► magnitude ─► amplitude loop ─► gain
//!             └─► demodulate ─► integrate ═╝
//!                     ▲ sin, cos
//!                    NCO
//! ```
//!
//! [`chain`] wires the blocks; [`engine`] runs a chain in the arithmetic and the lanes that fit it,
//! the sample rate by [`block_kernel`] where that applies, without quantisation by `float_kernel`; [`ensemble`] runs many designs
//! over the same codes and does once what they share, after the sample rate by [`followers`].
//! The behaviour is that of `docs/manual.md`, step by step.

pub mod amplitude_loop;
pub mod block_kernel;
pub mod chain;
pub mod compensate;
pub mod compensation;
pub mod cordic;
pub mod decimator;
pub mod demodulator;
mod ends;
pub mod engine;
pub mod ensemble;
mod float_kernel;
pub mod followers;
pub mod in_range;
pub mod nco;
pub mod phase_loop;
mod row_batch;
mod row_blocks;
mod rows;
mod sample_lanes;
#[cfg(target_arch = "x86_64")]
mod sample_lanes_x86;
pub mod scale;
pub mod setpoint;
pub mod vector_width;

/// The four channels, in the contract's order.
pub const CHANNELS: [&str; 4] = ["drive_i", "drive_q", "sense_i", "sense_q"];
