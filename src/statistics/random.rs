//! Numbers that are functions of (seed, stream, index): surrogates that are the same in every run.

use crate::numeric::splitmix::{GOLDEN, mix};

/// One stream of numbers.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Stream {
    key: u64,
}

impl Stream {
    /// The stream `stream` of `seed`.
    pub const fn new(seed: u64, stream: u64) -> Self {
        let key = mix(mix(seed.wrapping_add(GOLDEN)).wrapping_add(stream.wrapping_mul(GOLDEN)));
        Stream { key }
    }

    /// Uniform within (0, 1).
    pub fn uniform(&self, index: u64) -> f64 {
        let bits = mix(mix(index.wrapping_mul(GOLDEN).wrapping_add(self.key)) ^ self.key);
        ((bits >> 12) as f64 + 0.5) / (1u64 << 52) as f64
    }

    /// `count` independent standard normal numbers (Box and Muller 1958).
    pub fn normals(&self, count: usize) -> Vec<f64> {
        let mut out = Vec::with_capacity(count + 1);
        let mut index = 0;
        while out.len() < count {
            let radius = (-2.0 * self.uniform(index).ln()).sqrt();
            let (sine, cosine) = (std::f64::consts::TAU * self.uniform(index + 1)).sin_cos();
            out.push(radius * cosine);
            out.push(radius * sine);
            index += 2;
        }
        out.truncate(count);
        out
    }
}
