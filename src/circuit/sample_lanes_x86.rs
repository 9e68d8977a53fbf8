//! [`SampleLanes`] of x86-64 processors: SSE2, which all have, for codes and carriers of 16 bits, AVX2 (one sample each) and AVX-512
//! (two samples, of the two halves of a block).

use super::sample_lanes::{CarrierPair, Portable, SampleLanes};
use pulp::cast;
use pulp::x86::{V1, V3, V4};
use std::arch::x86_64::__m128i;

/// An immediate shuffle that brings 32-bit word `k` of each 128 bits to all four places.
macro_rules! in_all_places {
    ($simd:expr, $shuffle:ident, $words:expr, $k:expr) => {
        match $k {
            0 => $simd.$shuffle::<0x00>($words),
            1 => $simd.$shuffle::<0x55>($words),
            2 => $simd.$shuffle::<0xaa>($words),
            _ => $simd.$shuffle::<0xff>($words),
        }
    };
}

/// A shift count, as the shifts by a register take it.
#[inline(always)]
fn count_of(count: u32) -> [i64; 2] {
    [i64::from(count), 0]
}

/// Drive I and Q, sense I and Q.
type Halves = [__m128i; 2];

/// For codes and carriers of at most 16 bits.
impl SampleLanes for V1 {
    type Words = Halves;
    type Factors = __m128i;
    type Codes = Halves;
    const PARTS: usize = 1;

    #[inline(always)]
    fn splat(self, word: i64) -> Halves {
        cast([word; 4])
    }
    #[inline(always)]
    fn codes(self, drive: [&[i32; 4]; 2], sense: [&[i32; 4]; 2]) -> Halves {
        // Products are made of 16-bit halves, and the upper ones have no part in them.
        let low = cast([0xffff_i32; 4]);
        [drive[0], sense[0]].map(|codes| self.sse2._mm_and_si128(cast(*codes), low))
    }
    #[inline(always)]
    fn code(self, [drive, sense]: Halves, k: usize) -> __m128i {
        let (d, s) = (cast(drive), cast(sense));
        cast(match k {
            0 => self.sse._mm_shuffle_ps::<0x00>(d, s),
            1 => self.sse._mm_shuffle_ps::<0x55>(d, s),
            2 => self.sse._mm_shuffle_ps::<0xaa>(d, s),
            _ => self.sse._mm_shuffle_ps::<0xff>(d, s),
        })
    }
    #[inline(always)]
    fn carriers(self, pairs: [&CarrierPair; 2]) -> __m128i {
        self.sse2._mm_shuffle_epi32::<0x88>(cast(*pairs[0]))
    }
    #[inline(always)]
    fn of_channels(self, carriers: &[[i64; 4]; 2]) -> __m128i {
        let [drive, sense] = cast(carriers[0]);
        cast(self.sse._mm_shuffle_ps::<0x88>(drive, sense))
    }
    #[inline(always)]
    fn products(self, codes: __m128i, carriers: __m128i) -> Halves {
        let products = self.sse2._mm_madd_epi16(codes, carriers);
        let sign = self.sse2._mm_srai_epi32::<31>(products);
        [
            self.sse2._mm_unpacklo_epi32(products, sign),
            self.sse2._mm_unpackhi_epi32(products, sign),
        ]
    }
    #[inline(always)]
    fn plus(self, [a, b]: Halves, [c, d]: Halves) -> Halves {
        [self.sse2._mm_add_epi64(a, c), self.sse2._mm_add_epi64(b, d)]
    }
    #[inline(always)]
    fn and(self, [a, b]: Halves, [c, d]: Halves) -> Halves {
        [self.sse2._mm_and_si128(a, c), self.sse2._mm_and_si128(b, d)]
    }
    #[inline(always)]
    fn shr(self, a: Halves, count: u32) -> Halves {
        // As with AVX2.
        let back = cast([((1u64 << 63) >> count) as i64; 2]);
        let count = cast(count_of(count));
        let up = self.plus(a, self.splat(i64::MIN));
        up.map(|v| {
            let shifted = self.sse2._mm_srl_epi64(v, count);
            self.sse2._mm_sub_epi64(shifted, back)
        })
    }
    #[inline(always)]
    fn shl(self, a: Halves, count: u32) -> Halves {
        let count = cast(count_of(count));
        a.map(|v| self.sse2._mm_sll_epi64(v, count))
    }
    #[inline(always)]
    fn clamp(self, a: Halves, low: Halves, high: Halves) -> Halves {
        // No comparison of 64-bit words.
        cast(Portable.clamp(cast(a), cast(low), cast(high)))
    }
    #[inline(always)]
    fn by_channel(self, a: Halves) -> [[i64; 4]; 2] {
        [cast(a), [0; 4]]
    }
}

impl SampleLanes for V3 {
    type Words = pulp::i64x4;
    type Factors = pulp::i64x4;
    type Codes = pulp::i64x4;
    const PARTS: usize = 1;

    #[inline(always)]
    fn splat(self, word: i64) -> pulp::i64x4 {
        cast([word; 4])
    }
    #[inline(always)]
    fn codes(self, drive: [&[i32; 4]; 2], sense: [&[i32; 4]; 2]) -> pulp::i64x4 {
        cast([*drive[0], *sense[0]])
    }
    #[inline(always)]
    fn code(self, codes: pulp::i64x4, k: usize) -> pulp::i64x4 {
        let codes = cast(codes);
        cast(in_all_places!(self.avx2, _mm256_shuffle_epi32, codes, k))
    }
    #[inline(always)]
    fn carriers(self, pairs: [&CarrierPair; 2]) -> pulp::i64x4 {
        cast(self.avx2._mm256_broadcastsi128_si256(cast(*pairs[0])))
    }
    #[inline(always)]
    fn of_channels(self, words: &[[i64; 4]; 2]) -> pulp::i64x4 {
        cast(words[0])
    }
    #[inline(always)]
    fn products(self, a: pulp::i64x4, b: pulp::i64x4) -> pulp::i64x4 {
        cast(self.avx2._mm256_mul_epi32(cast(a), cast(b)))
    }
    #[inline(always)]
    fn plus(self, a: pulp::i64x4, b: pulp::i64x4) -> pulp::i64x4 {
        cast(self.avx2._mm256_add_epi64(cast(a), cast(b)))
    }
    #[inline(always)]
    fn and(self, a: pulp::i64x4, b: pulp::i64x4) -> pulp::i64x4 {
        cast(self.avx2._mm256_and_si256(cast(a), cast(b)))
    }
    #[inline(always)]
    fn shr(self, a: pulp::i64x4, count: u32) -> pulp::i64x4 {
        // AVX2 shifts 64-bit words logically only: moved up by 2^63, shifted, moved back.
        let up = self.plus(a, self.splat(i64::MIN));
        let shifted = self.avx2._mm256_srl_epi64(cast(up), cast(count_of(count)));
        let back = (1u64 << 63) >> count;
        cast(
            self.avx2
                ._mm256_sub_epi64(shifted, cast(self.splat(back as i64))),
        )
    }
    #[inline(always)]
    fn shl(self, a: pulp::i64x4, count: u32) -> pulp::i64x4 {
        cast(self.avx2._mm256_sll_epi64(cast(a), cast(count_of(count))))
    }
    #[inline(always)]
    fn clamp(self, a: pulp::i64x4, low: pulp::i64x4, high: pulp::i64x4) -> pulp::i64x4 {
        let (a, low, high) = (cast(a), cast(low), cast(high));
        let below = self.avx2._mm256_cmpgt_epi64(low, a);
        let a = self.avx2._mm256_blendv_epi8(a, low, below);
        let above = self.avx2._mm256_cmpgt_epi64(a, high);
        cast(self.avx2._mm256_blendv_epi8(a, high, above))
    }
    #[inline(always)]
    fn by_channel(self, a: pulp::i64x4) -> [[i64; 4]; 2] {
        [cast(a), [0; 4]]
    }
}

impl SampleLanes for V4 {
    type Words = pulp::i64x8;
    type Factors = pulp::i64x8;
    type Codes = pulp::i64x8;
    const PARTS: usize = 2;

    #[inline(always)]
    fn splat(self, word: i64) -> pulp::i64x8 {
        cast([word; 8])
    }
    #[inline(always)]
    fn codes(self, drive: [&[i32; 4]; 2], sense: [&[i32; 4]; 2]) -> pulp::i64x8 {
        cast([*drive[0], *sense[0], *drive[1], *sense[1]])
    }
    #[inline(always)]
    fn code(self, codes: pulp::i64x8, k: usize) -> pulp::i64x8 {
        let codes = cast(codes);
        cast(in_all_places!(self.avx512f, _mm512_shuffle_epi32, codes, k))
    }
    #[inline(always)]
    fn carriers(self, pairs: [&CarrierPair; 2]) -> pulp::i64x8 {
        let first = self.avx512f._mm512_broadcast_i32x4(cast(*pairs[0]));
        let second = cast(*pairs[1]);
        cast(
            self.avx512f
                ._mm512_mask_broadcast_i32x4(first, 0xff00, second),
        )
    }
    #[inline(always)]
    fn of_channels(self, words: &[[i64; 4]; 2]) -> pulp::i64x8 {
        cast(*words)
    }
    #[inline(always)]
    fn products(self, a: pulp::i64x8, b: pulp::i64x8) -> pulp::i64x8 {
        cast(self.avx512f._mm512_mul_epi32(cast(a), cast(b)))
    }
    #[inline(always)]
    fn plus(self, a: pulp::i64x8, b: pulp::i64x8) -> pulp::i64x8 {
        cast(self.avx512f._mm512_add_epi64(cast(a), cast(b)))
    }
    #[inline(always)]
    fn and(self, a: pulp::i64x8, b: pulp::i64x8) -> pulp::i64x8 {
        cast(self.avx512f._mm512_and_epi64(cast(a), cast(b)))
    }
    #[inline(always)]
    fn shr(self, a: pulp::i64x8, count: u32) -> pulp::i64x8 {
        cast(
            self.avx512f
                ._mm512_sra_epi64(cast(a), cast(count_of(count))),
        )
    }
    #[inline(always)]
    fn shl(self, a: pulp::i64x8, count: u32) -> pulp::i64x8 {
        cast(
            self.avx512f
                ._mm512_sll_epi64(cast(a), cast(count_of(count))),
        )
    }
    #[inline(always)]
    fn clamp(self, a: pulp::i64x8, low: pulp::i64x8, high: pulp::i64x8) -> pulp::i64x8 {
        let above = self.avx512f._mm512_max_epi64(cast(a), cast(low));
        cast(self.avx512f._mm512_min_epi64(above, cast(high)))
    }
    #[inline(always)]
    fn by_channel(self, a: pulp::i64x8) -> [[i64; 4]; 2] {
        cast(a)
    }
}
