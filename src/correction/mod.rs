//! The correction of averaged readings: causes that a record called for, carried into firmware.
//!
//! [`Plan`] says in real numbers what is subtracted (declared bias, lags, slopes, decays, curves, steps, laws of
//! the rate); [`Formats`] chooses the words; [`Correction`] runs the one step that both make, [`block::Step`],
//! bit-accurately and without quantisation; [`crate::firmware::correction`] emits it, [`crate::verify::correction`] compares.
//! [`Conversion`] makes a reading's words of the chain's [`rows`].

pub mod block;
mod bound;
pub mod conversion;
mod curve;
mod formats;
mod gain;
mod names;
mod plan;
mod rate_terms;
pub mod rows;
mod run;
pub mod sentences;
mod states;
mod terms;
mod text;

pub use conversion::Conversion;
pub use formats::{Formats, NOISE_PER_FULL_SCALE};
pub use plan::{
    HIGHEST_POWER, Input, LONGEST_TAU_PERIODS, MOST_INPUTS, MOST_KNOTS, MOST_OF_A_KIND,
    MOST_SLOPE_ROWS, Plan, SHORTEST_TAU_PERIODS, Term,
};
pub use run::{Calls, Correction, MOST_STEPS, Reading, Steps, readings, schedule};
pub use text::{Planned, refuse_unbuildable};

#[cfg(test)]
mod emission_tests;
#[cfg(test)]
mod lag_tests;
#[cfg(test)]
mod sample;
#[cfg(test)]
mod tests;
