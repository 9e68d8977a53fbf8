//! What a bundle says and tests about the compensation's calibrated range.

use crate::design::{Compensation, Design, Outside};
use crate::error::{InputError, Result};
use crate::vectors::model::Model;
use serde::{Deserialize, Serialize};

/// The calibrated range in a manifest.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, schemars::JsonSchema)]
pub struct Calibrated {
    /// The first calibrated input, raw.
    pub low: i128,
    /// The last one.
    pub high: i128,
    /// What happens outside: `clamp`, `hold_slope` or `flag`.
    pub outside: String,
}

impl Calibrated {
    /// Of a design's compensation; `None` where no range is known.
    pub fn of(design: &Design) -> Option<Self> {
        let compensation = design.compensation.as_ref()?;
        let (low, high) = compensation.clamp_raw?;
        Some(Calibrated {
            low,
            high,
            outside: compensation.outside.name().to_owned(),
        })
    }
}

/// Without a calibrated range there is nothing that a flag could tell.
///
/// # Errors
/// `flag` without a range.
pub(super) fn refuse_flag_without_range(design: &Design) -> Result<()> {
    let Some(c) = &design.compensation else {
        return Ok(());
    };
    if c.outside != Outside::Flag || c.clamp_raw.is_some() {
        return Ok(());
    }
    Err(
        InputError::new("`compensation.outside = \"flag\"` needs a calibrated range, and there is none")
            .help("give `clamp_raw = [low, high]`, or emit the design that `gyrogen run` writes, which has it")
            .into(),
    )
}

/// Words at both ends of the calibrated range and beside them, of the functions that know it.
pub(super) fn about_the_ends(design: &Design, model: &Model) -> Vec<Vec<i128>> {
    let range = design
        .compensation
        .as_ref()
        .and_then(|c: &Compensation| c.clamp_raw);
    let (Some((low, high)), [input], "bias" | "in_range") =
        (range, model.inputs.as_slice(), model.name.as_str())
    else {
        return Vec::new();
    };
    let words = [low, high].into_iter().flat_map(|end| end - 1..=end + 1);
    let inside = words.filter(|word| input.low <= *word && *word <= input.high);
    inside.map(|word| vec![word]).collect()
}
