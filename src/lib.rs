//! gyrogen: from a MEMS vibratory gyroscope's thermal drift to trusted fixed-point firmware.
//!
//! In reading order: [`numeric`] (formats and arithmetics), [`circuit`] (the detection circuit,
//! written once), [`design`] (what a user writes), [`plant`] (the simulated gyro), [`cosim`] (both in closed loop),
//! [`record`] (what was measured), [`thermal`] and [`capture`] (what a record and a capture say), [`job`] (the main job), [`emit`] and [`verify`]
//! (C and Rust, and that they are the model), [`report`]; [`selftest`] says what [`thermal`] finds and what not.

pub mod approx;
pub mod base_name;
pub mod capture;
pub mod check;
pub mod circuit;
pub mod cli;
pub mod compensation;
pub mod correction;
pub mod cosim;
pub mod cost;
pub mod design;
pub mod digest;
pub mod emit;
pub mod equivalence;
pub mod error;
pub mod firmware;
pub mod input;
pub mod job;
pub mod leftovers;
pub mod nearest;
pub mod nodes;
pub mod numeric;
pub mod output;
pub mod parallel;
pub mod plant;
pub mod record;
pub mod report;
pub mod schemas;
pub mod selftest;
pub mod simulation;
pub mod spectrum;
pub mod statistics;
pub mod study;
pub mod tabulate;
pub mod text;
pub mod thermal;
pub mod timing;
pub mod trace_file;
pub mod vectors;
pub mod verdict;
pub mod verify;
