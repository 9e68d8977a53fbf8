//! What a thermal record says about the declared model.
//!
//! [`baseline`] fits the bias model, a polynomial in the thermometer's reading; [`order`] chooses its order, [`sweep`] compares
//! heating with cooling, [`checks`] and [`no_gain`] say what a user should know of before believing the fit. Weights, folds and the noise's
//! correlation are in [`crate::statistics`], and so is what tells an effect from noise with a memory.
//!
//! [`close`] answers for a record: [`intake`] takes it in ([`quantised`], [`staircase`]: coarse thermometers; [`repeated`]: slow
//! ones; [`adc_rows`], [`adc_rounding`]: coarse ADCs; [`quadrature`]: one that contains the output) as [`channels`]; candidate
//! [`effects`] and their [`search`] name causes; [`firmware`] carries them. [`crate::verdict`] is the form of the answer,
//! [`crate::capture`] does the same for ADC codes. Nothing here knows the plant (law 4).

pub mod adc_rounding;
pub mod adc_rows;
pub mod baseline;
pub mod channels;
pub mod checks;
pub mod close;
mod declared_bias;
pub mod effects;
pub mod firmware;
mod heats;
mod holes;
pub mod intake;
pub mod no_gain;
pub mod order;
pub mod quadrature;
pub mod quantised;
pub mod rails;
pub mod rate_steps;
pub mod repeated;
pub mod residuals;
pub mod search;
pub mod staircase;
pub mod sweep;

#[cfg(test)]
mod baseline_tests;
#[cfg(test)]
mod channels_tests;
#[cfg(test)]
mod check_tests;
#[cfg(test)]
mod clip_tests;
#[cfg(test)]
mod heats_tests;
#[cfg(test)]
mod intake_tests;
#[cfg(test)]
mod lag_tests;
#[cfg(test)]
mod measured_tests;
#[cfg(test)]
pub(crate) mod synthetic;

pub use baseline::{BaselineFit, fit};
