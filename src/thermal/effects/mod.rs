//! The catalogue of candidate effects, one unit each: physics, equation, parameters with units and
//! plausible ranges, the channels it needs, what it is confused with, the experiment that separates
//! them.
//!
//! A candidate gives columns: shapes in time whose multiples, beside the declared model, explain the
//! error. Its non-linear parameters (time constants, thresholds, crossing temperatures) make the
//! shapes; [`Candidate::points`] is where the search for them starts, [`super::search`] ends it.

mod candidate;
pub mod covariate;
mod deadband;
pub mod demodulation;
pub mod drive;
pub mod field;
pub mod heat;
pub mod outside;
mod past;
pub mod rate;
mod saturation;
pub mod step;
pub mod structure;
mod switching;
pub mod time;
pub mod tone;
pub mod user;
mod within_rows;

use super::channels::Channels;
pub(crate) use candidate::UNUSUAL;
pub use candidate::{
    Bias, Candidate, Estimate, MOST_BENT, Missing, Parameter, Point, Reported, Sheet, entry,
    from_log, gain, heated, map, moving, product, spaced,
};

/// Every named candidate of the contract for a record, its auxiliary columns among them.
pub fn catalogue(c: &Channels) -> Vec<Box<dyn Candidate>> {
    let mut out: Vec<Box<dyn Candidate>> = Vec::new();
    out.extend(heat::all());
    out.extend(time::all());
    out.extend(structure::all());
    out.extend(step::all());
    out.extend(drive::all(c));
    out.extend(demodulation::all());
    out.extend(rate::all());
    out.extend(field::all());
    out.extend(covariate::all(c));
    out
}
