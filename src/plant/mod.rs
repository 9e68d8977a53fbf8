//! The simulated gyro: physics and the ADCs' inputs, nothing of the detection circuit.
//!
//! In reading order: [`resonator`] (eq. 1 to 8 of the seed paper), [`device`] (measured phase and
//! bias, eq. 9 and the effects beyond it), [`noise`] (noise that depends on its place alone),
//! [`thermal_run`] (chamber schedule and ADC codes); [`turn`] holds the elementary functions.
//! All that a plant knows of the circuit is [`thermal_run::Sampling`].

pub mod device;
pub mod gyroscope;
pub mod noise;
pub mod profile;
pub mod resonator;
pub mod thermal;
pub mod thermal_run;
pub mod turn;

pub use device::Device;
pub use resonator::{Resonator, StiffnessLaw};
pub use thermal_run::{Reading, Sampling, ThermalPlant};

#[cfg(test)]
mod study_tests;
