//! An independent reference of the detection chain, for tests only.
//!
//! Everything below this folder is written from the text of the contract
//! "The detection chain, bit by bit" and shares no line with the tool: it is
//! slow and plain on purpose. `number` has formats and `cast`, `constants` the
//! tables, `fixed` the chain bit for bit, `float` the chain on real numbers,
//! `design` the keys and the rule of 127 bits; `generate`, `toml_text` and
//! `capture` make random inputs, `harness` runs the binary under test.

pub mod bundle;
pub mod capture;
pub mod cases;
pub mod constants;
pub mod design;
pub mod edges;
pub mod fixed;
pub mod float;
pub mod generate;
pub mod golden;
pub mod harness;
pub mod number;
pub mod toml_text;
