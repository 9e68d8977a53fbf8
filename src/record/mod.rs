//! Measured records: thermal records and captures (`docs/manual.md`).
//!
//! [`thermal`] reads a thermal record, `thermal_rows` its rows; `cells` cuts its lines and reads its numbers, [`columns`]
//! says which column plays which part, `clock` puts the rows in time, `plausibility` (with `scale`
//! and `timing`) and `frozen` look for what is readable but unlikely; `ulog` and `dataflash` read
//! autopilots' logs, which `averager` makes rows of; `shorten` averages rows; [`read_any`] takes whatever a file is. [`capture`] streams captured ADC codes
//! from CSV, NPY or raw samples, `bench_csv` those whose form `bench_keys` tells; [`capture_meta`] is what a capture says of itself, [`capture_places`] where; [`rows`] writes one row a
//! decimated sample.

mod any;
mod applied;
mod averager;
mod bench_cells;
mod bench_csv;
mod bench_keys;
mod bench_rows;
mod bench_scale;
pub mod capture;
mod capture_codes;
mod capture_csv;
mod capture_header;
mod capture_lines;
pub mod capture_meta;
mod capture_npy;
pub mod capture_places;
mod capture_raw;
mod cells;
mod clock;
pub mod columns;
mod corrections;
mod dataflash;
mod dead;
mod error_values;
mod frozen;
pub mod guesses;
mod ignored;
mod lines;
mod log_bytes;
mod log_clock;
mod log_gyros;
mod log_rows;
mod npy_header;
mod parameters;
mod plausibility;
pub mod replayed;
pub mod rows;
mod scale;
mod shorten;
mod stopped;
mod temperature;
pub mod thermal;
mod thermal_record;
mod thermal_rows;
mod timing;
mod ulog;
mod ulog_fields;
mod ulog_layout;
mod undo;
mod unpack;
mod visits;
mod warning;

#[cfg(test)]
mod bench_binary_tests;
#[cfg(test)]
mod bench_tests;
#[cfg(test)]
mod broken_tests;
#[cfg(test)]
mod capture_mutation_tests;
#[cfg(test)]
mod capture_random_tests;
#[cfg(test)]
mod capture_tests;
#[cfg(test)]
mod dataflash_tests;
#[cfg(test)]
mod log_cases_tests;
#[cfg(test)]
mod log_correction_tests;
#[cfg(test)]
mod mutation_tests;
#[cfg(test)]
mod reading_tests;
#[cfg(test)]
mod rows_tests;
#[cfg(test)]
mod ulog_tests;

pub use any::{is_a_record, read_any};
pub use shorten::condensed;
pub use thermal::{ThermalRecord, read};
pub use warning::Warning;
