//! Tests of the library and of the program as a user meets them, by task. One crate, so that all cores are busy until
//! the last test and it is linked once: `cargo test --test all judge_rows::` runs one part.
//!
//! None stands apart: what a test changes of a process (variables, folder, limits, signals) it changes of a child, and
//! what it writes stands in a temporary folder of its own. One that changes its own process needs a crate of its own.
//!
//! `blind`, `blind_capture`, `common`, `mutation`, `oracle` and `rng` hold what the parts use. `oracle`, `blind` and
//! `blind_capture` share no code with `src` nor with each other, except the random numbers in `rng`.

mod approx;
mod approx_bound;
mod approx_figures;
mod approx_refusals;
mod approx_statistics;
mod architecture;
mod bias_bound;
mod blind;
mod blind_bank;
mod blind_capture;
mod blind_physics;
mod blind_score;
mod bundle_check;
mod calibrated_flag;
mod capture_blind;
mod capture_refusals;
mod close;
mod close_controls;
mod close_own_gyro;
mod close_residuals;
mod close_verify;
mod common;
mod correction_command;
mod cost_model;
mod design_limits;
mod emission_random;
mod emit_again;
mod emitted_code;
mod equiv_command;
mod equivalence;
mod from_file_to_firmware;
mod generated;
mod hostile_text;
mod judge_rows;
mod main_job;
mod mutants;
mod mutation;
#[cfg(unix)]
mod nothing_lost;
mod one_compiler;
mod oracle;
mod oracle_self;
mod own_effects;
mod product;
mod readme;
mod recorded_command;
mod replay_contract;
mod rng;
mod schema;
mod self_test;
mod simulate;
mod study;
mod study_slow;
mod study_spaces;
mod trace;
mod verify_damage;
mod verify_foreign;
mod verify_line_ends;
mod verify_targets;
