//! Four channels of one ADC sample side by side in 64-bit SIMD lanes: drive I, drive Q, sense I,
//! sense Q. What [`super::block_kernel`] is written over; no word of a lane is ever looked at.
//!
//! Every operation is modulo 2^64, as in [`crate::numeric::lane::Lane`].

/// Lanes of one or two samples.
pub trait SampleLanes: Copy {
    /// A 64-bit word for each lane.
    type Words: Copy;
    /// A factor of a product for each lane: a code or a carrier.
    type Factors: Copy;
    /// Four consecutive codes of both channels.
    type Codes: Copy;
    /// Samples side by side: each is of a part of the block of its own.
    const PARTS: usize;

    /// The same word in every lane.
    fn splat(self, word: i64) -> Self::Words;
    /// Four consecutive codes of drive and sense, of each part. With one part the second is ignored.
    fn codes(self, drive: [&[i32; 4]; 2], sense: [&[i32; 4]; 2]) -> Self::Codes;
    /// The codes of sample `k` of those four, 0 to 3, by channel.
    fn code(self, codes: Self::Codes, k: usize) -> Self::Factors;
    /// Sine and cosine, of each part, by channel.
    fn carriers(self, pairs: [&CarrierPair; 2]) -> Self::Factors;
    /// Carriers of each part by channel; with one part the second is ignored.
    fn of_channels(self, carriers: &[[i64; 4]; 2]) -> Self::Factors;
    /// Exact products of codes and carriers.
    fn products(self, codes: Self::Factors, carriers: Self::Factors) -> Self::Words;
    /// Sum.
    fn plus(self, a: Self::Words, b: Self::Words) -> Self::Words;
    /// Bitwise and.
    fn and(self, a: Self::Words, b: Self::Words) -> Self::Words;
    /// Floor of a / 2^count; `count` is at most 63.
    fn shr(self, a: Self::Words, count: u32) -> Self::Words;
    /// a * 2^count; `count` is at most 63.
    fn shl(self, a: Self::Words, count: u32) -> Self::Words;
    /// The nearest word within `low ..= high`.
    fn clamp(self, a: Self::Words, low: Self::Words, high: Self::Words) -> Self::Words;
    /// Words by part and channel; with one part the second is of no meaning.
    fn by_channel(self, a: Self::Words) -> [[i64; 4]; 2];
}

/// Sine and cosine in the low halves of two 64-bit lanes.
pub type CarrierPair = [i32; 4];

/// A carrier pair of two table entries.
pub fn carrier_pair(sine: i32, cosine: i32) -> CarrierPair {
    [sine, 0, cosine, 0]
}

/// The carriers of a sample of each part by channel.
pub fn by_channel(pairs: [&CarrierPair; 2]) -> [[i64; 4]; 2] {
    pairs.map(|[sine, _, cosine, _]| [sine, cosine, sine, cosine].map(|c| i64::from(*c)))
}

/// Lanes that any processor has; the compiler may use what it finds.
#[derive(Debug, Clone, Copy)]
pub struct Portable;

impl SampleLanes for Portable {
    type Words = [i64; 4];
    type Factors = [i64; 4];
    type Codes = [i64; 4];
    const PARTS: usize = 1;

    #[inline(always)]
    fn splat(self, word: i64) -> [i64; 4] {
        [word; 4]
    }
    #[inline(always)]
    fn codes(self, drive: [&[i32; 4]; 2], sense: [&[i32; 4]; 2]) -> [i64; 4] {
        // Drive in the low half, sense in the high half.
        std::array::from_fn(|k| i64::from(drive[0][k] as u32) | (i64::from(sense[0][k]) << 32))
    }
    #[inline(always)]
    fn code(self, codes: [i64; 4], k: usize) -> [i64; 4] {
        let (drive, sense) = (codes[k], codes[k] >> 32);
        [drive, drive, sense, sense]
    }
    #[inline(always)]
    fn carriers(self, pairs: [&CarrierPair; 2]) -> [i64; 4] {
        let [sine, _, cosine, _] = pairs[0].map(i64::from);
        [sine, cosine, sine, cosine]
    }
    #[inline(always)]
    fn of_channels(self, words: &[[i64; 4]; 2]) -> [i64; 4] {
        words[0]
    }
    #[inline(always)]
    fn products(self, a: [i64; 4], b: [i64; 4]) -> [i64; 4] {
        std::array::from_fn(|k| i64::from(a[k] as i32) * i64::from(b[k] as i32))
    }
    #[inline(always)]
    fn plus(self, a: [i64; 4], b: [i64; 4]) -> [i64; 4] {
        std::array::from_fn(|k| a[k].wrapping_add(b[k]))
    }
    #[inline(always)]
    fn and(self, a: [i64; 4], b: [i64; 4]) -> [i64; 4] {
        std::array::from_fn(|k| a[k] & b[k])
    }
    #[inline(always)]
    fn shr(self, a: [i64; 4], count: u32) -> [i64; 4] {
        a.map(|v| v.wrapping_shr(count))
    }
    #[inline(always)]
    fn shl(self, a: [i64; 4], count: u32) -> [i64; 4] {
        a.map(|v| v.wrapping_shl(count))
    }
    #[inline(always)]
    fn clamp(self, a: [i64; 4], low: [i64; 4], high: [i64; 4]) -> [i64; 4] {
        std::array::from_fn(|k| a[k].max(low[k]).min(high[k]))
    }
    #[inline(always)]
    fn by_channel(self, a: [i64; 4]) -> [[i64; 4]; 2] {
        [a, [0; 4]]
    }
}
