//! What several parts use.

pub mod closing;
pub mod command;
pub mod compiler;
pub mod design;
pub mod dice;
pub mod files;
pub mod json;
pub mod logs;
