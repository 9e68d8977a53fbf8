//! The design: everything a run depends on, read from one TOML file.
//!
//! [`schema`] is what the rest of the program sees; [`reader`] turns a file into it, with the
//! place of every mistake; [`limits`] refuses formats whose exact intermediates the engine cannot
//! hold; [`template`] holds the embedded default and what `gyrogen init` writes.

pub mod limits;
pub mod reader;
pub mod schema;
pub mod template;

pub use schema::*;
