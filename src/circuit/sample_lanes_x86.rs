//! [`SampleLanes`] of x86-64 processors: AVX2 (one sample) and AVX-512 (two samples, of the two
//! halves of a block).

use super::sample_lanes::{CarrierPair, SampleLanes};
use pulp::cast;
use pulp::x86::{V3, V4};

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

impl SampleLanes for V3 {
    type Words = pulp::i64x4;
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
    fn low_products(self, a: pulp::i64x4, b: pulp::i64x4) -> pulp::i64x4 {
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
    fn low_products(self, a: pulp::i64x8, b: pulp::i64x8) -> pulp::i64x8 {
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
