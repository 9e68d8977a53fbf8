//! Real-valued draws on top of the oracle's integer generator.

use crate::rng::Rng;
use std::f64::consts::TAU;

/// Draws that a record needs.
pub trait Dice {
    /// Uniform in `low..high`.
    fn between(&mut self, low: f64, high: f64) -> f64;
    /// Log-uniform in `low..high`, both positive.
    fn spread(&mut self, low: f64, high: f64) -> f64;
    /// Standard normal (Box and Muller, one of the pair).
    fn gauss(&mut self) -> f64;
    /// True with probability `p`.
    fn odds(&mut self, p: f64) -> bool;
    /// -1 or 1.
    fn sign(&mut self) -> f64;
}

impl Dice for Rng {
    fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.unit()
    }

    fn spread(&mut self, low: f64, high: f64) -> f64 {
        (self.between(low.ln(), high.ln())).exp()
    }

    fn gauss(&mut self) -> f64 {
        let radius = (-2.0 * (1.0 - self.unit()).ln()).sqrt();
        radius * (TAU * self.unit()).cos()
    }

    fn odds(&mut self, p: f64) -> bool {
        self.unit() < p
    }

    fn sign(&mut self) -> f64 {
        if self.odds(0.5) { 1.0 } else { -1.0 }
    }
}

/// One seed out of several parts (FNV-1a over their bytes), so that no two scenarios share a stream.
pub fn seed_of(parts: &[u64]) -> u64 {
    parts
        .iter()
        .flat_map(|p| p.to_le_bytes())
        .fold(0xcbf2_9ce4_8422_2325, |h, byte| {
            (h ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3)
        })
}
