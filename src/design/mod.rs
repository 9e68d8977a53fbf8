//! The design: everything a run depends on, read from one TOML file.
//!
//! [`schema`] is what the rest of the program sees; [`reader`] turns a file into it, with the
//! place of every mistake (`table` keeps the places, `keys` knows every key, `suggest` what was
//! meant, `circuit_tables`, `device_tables`, `record_table` and [`bound`] read the tables); [`effects`] are those of the simulated
//! gyro, by name, [`user_effects`] those that the user suspects in a record; [`limits`] refuses formats whose exact intermediates the engine cannot hold; [`template`] holds the embedded default and what `gyrogen init` writes.

pub mod bound;
mod circuit;
mod circuit_tables;
mod compensation;
pub mod correction;
mod correction_table;
mod device_tables;
mod effect_catalogue;
pub mod effects;
mod json_schema;
mod keys;
pub mod limits;
mod log_axis;
mod ranges;
pub mod reader;
pub mod record_columns;
mod record_mapping;
mod record_table;
pub mod schema;
mod study_tables;
pub(crate) mod suggest;
mod table;
pub mod target;
pub mod template;
pub mod units;
pub mod user_effects;
pub mod word;

pub use effects::Effects;
pub use json_schema::json_schema;
pub use schema::*;
pub use study_tables::{Limit, LimitName, Limits, StudyOptions};
pub use user_effects::UserEffect;
