//! `gyrogen schema`: the JSON Schema of the design or of a result.

use crate::error::Result;
use crate::schemas;

/// Print the JSON Schema of the design or of a result.
#[derive(Debug, clap::Args)]
pub struct Arguments {
    /// Of what.
    #[arg(value_parser = names())]
    name: String,
}

fn names() -> clap::builder::PossibleValuesParser {
    let values = schemas::NAMES;
    values
        .map(|(name, what)| clap::builder::PossibleValue::new(name).help(what))
        .into()
}

/// Runs the command.
///
/// # Errors
/// None: the parser lets only known names through.
pub fn run(arguments: &Arguments) -> Result<()> {
    if let Some(schema) = schemas::schema(&arguments.name) {
        super::terminal::give(&super::json(&schema));
    }
    Ok(())
}
