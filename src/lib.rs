//! gyrogen: from a MEMS vibratory gyroscope's thermal drift to trusted fixed-point firmware.
//!
//! In reading order: [`numeric`] (formats and arithmetics), [`circuit`] (the detection circuit,
//! written once), [`design`] (what a user writes), [`record`] (what was measured).

pub mod circuit;
pub mod cli;
pub mod closure;
pub mod design;
pub mod emit;
pub mod error;
pub mod job;
pub mod numeric;
pub mod output;
pub mod plant;
pub mod record;
pub mod report;
pub mod spectrum;
pub mod trace_file;
pub mod verify;
