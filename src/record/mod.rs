//! Measured records: thermal records and captures (`contracts/record.md`).
//!
//! [`capture`] streams captured ADC codes from CSV or NPY; [`capture_meta`] is what a capture says
//! of itself; [`rows`] writes one row a decimated sample.

pub mod capture;
mod capture_csv;
mod capture_lines;
pub mod capture_meta;
mod capture_npy;
#[cfg(test)]
mod capture_random_tests;
#[cfg(test)]
mod capture_tests;
mod npy_header;
pub mod rows;
#[cfg(test)]
mod rows_tests;
