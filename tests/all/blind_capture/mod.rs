//! Captures with a cause that only the bank knows: two ADC channels from own physics, sharing nothing with
//! `plant` or `closure`. [`bench`] is the bench (tone, noise, converter), [`faults`] what can be wrong with it,
//! [`score`] the scorer.

pub mod bench;
pub mod faults;
pub mod score;
