//! The given design's own overflow: a study of word lengths says it first, and does nothing else.

use crate::cosim::stream::stimulus;
use crate::design::Design;
use crate::equivalence::outcome::FirstOverflow;
use crate::error::{Error, Result};
use crate::nodes::repair::repairs;
use crate::nodes::run;

/// ADC samples that are looked at.
const SAMPLES: usize = 120_000;

/// Refuses a design that overflows on its own thermal run.
///
/// # Errors
/// The first overflow with the smallest repair (exit 1).
pub fn refuse(design: &Design) -> Result<()> {
    let (drive, sense) = stimulus(design, SAMPLES)?;
    let seen = run::run(design, &drive, &sense);
    let (repairs, _) = repairs(design, &seen, (&drive, &sense));
    match FirstOverflow::new(design, &seen, repairs.into_iter().next()) {
        Some(first) => Err(Error::Check(format!(
            "{}; a study varies fraction bits, and integer bits have to hold first",
            first.sentence()
        ))),
        None => Ok(()),
    }
}
