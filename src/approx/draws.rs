//! Numbers for the random designs of tests, each a function of seed and place alone.

use crate::numeric::splitmix::{GOLDEN, mix};

/// Of one design.
#[derive(Clone, Copy)]
pub(crate) struct Draws {
    seed: u64,
}

impl Draws {
    pub(crate) fn new(seed: u64) -> Self {
        Draws { seed }
    }

    /// Evenly spread over 0 .. 1 (Steele, Lea, Flood, "Fast splittable pseudorandom number generators", 2014).
    pub(crate) fn uniform(self, place: u64) -> f64 {
        let k = self.seed * 1000 + place;
        (mix((k + 1).wrapping_mul(GOLDEN)) >> 11) as f64 / (1u64 << 53) as f64
    }

    /// One of the whole numbers `from` ..= `to`.
    pub(crate) fn whole(self, place: u64, from: i64, to: i64) -> i64 {
        from + (self.uniform(place) * (to - from + 1) as f64) as i64
    }
}
