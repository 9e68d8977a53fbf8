//! The simulated gyro: physics and the ADCs' inputs, nothing of the detection circuit.
//!
//! In reading order: [`resonator`] (eq. 1 to 8 of the seed paper), [`device`] (measured phase and
//! bias by eq. 9), [`effects`] (what the device does beyond it), [`converter`] (the ADCs), [`noise`] and
//! [`slow_noise`] (noise that depends on its place alone),
//! [`thermal_run`] (chamber schedule and ADC codes); [`turn`] holds the elementary functions.
//! All that a plant knows of the circuit is [`thermal_run::Sampling`].

pub mod converter;
pub mod device;
pub mod effects;
pub mod noise;
pub mod resonator;
pub mod slow_noise;
pub mod thermal_run;
pub mod turn;

pub use device::Device;
pub use resonator::{Resonator, StiffnessLaw};
pub use thermal_run::{Reading, Sampling, ThermalPlant};

#[cfg(test)]
mod study_tests;
