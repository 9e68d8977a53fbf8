//! The simulated gyro: physics and the ADCs' inputs, nothing of the detection circuit.
//!
//! In reading order: [`resonator`] (eq. 1 to 8 of the seed paper), [`device`] (measured phase and
//! bias by eq. 9), [`effects`] (what the device does beyond it), [`profile`] and [`thermal`] (chamber and
//! heat), [`gyroscope`] (the motion at the ADC rate, `modes`: at one temperature, [`motion`]: over a block), [`converter`] (the ADCs), [`noise`] and [`slow_noise`]
//! (noise that depends on its place alone). All that a plant
//! knows of the circuit is [`gyroscope::Reference`] and [`gyroscope::Drive`].

pub mod converter;
pub mod device;
pub mod effects;
pub mod gyroscope;
mod modes;
pub mod motion;
pub mod noise;
pub mod profile;
pub mod resonator;
pub mod slow_noise;
pub mod thermal;

pub use converter::Converter;
pub use device::Device;
pub use gyroscope::Gyroscope;
pub use resonator::{Resonator, StiffnessLaw};
pub use thermal::{Temperatures, Thermal};

#[cfg(test)]
mod study_tests;
