//! SplitMix64 (Steele, Lea, Flood 2014): the one mixing function of every noise, surrogate and test sequence.

/// 2^64 over the golden ratio, odd: the generator's increment.
pub const GOLDEN: u64 = 0x9e37_79b9_7f4a_7c15;

/// The finaliser, a bijection of 64 bits with full avalanche.
#[inline(always)]
pub const fn mix(z: u64) -> u64 {
    let z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The reference implementation's first words for the seed 1234567.
    #[test]
    fn the_generator_is_the_published_one() {
        let mut state = 1_234_567u64;
        let mut next = || {
            state = state.wrapping_add(GOLDEN);
            mix(state)
        };
        assert_eq!(
            [next(), next(), next()],
            [
                6_457_827_717_110_365_317,
                3_203_168_211_198_807_973,
                9_817_491_932_198_370_423
            ]
        );
    }
}
