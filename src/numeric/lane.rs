//! The machine integers that [`super::fixed::Fixed`] computes in. Every operation wraps: a chain is
//! given lanes that its ranges fit into, and where a wrap follows anyway the high bits do not matter.

/// A two's-complement machine integer: `i64` or `i128`.
pub trait Lane: Copy + Ord + Default + std::fmt::Debug + Send + Sync + 'static {
    /// Width in bits.
    const BITS: u32;
    /// The low bits of `value`.
    fn low(value: i128) -> Self;
    /// The nearest lane value to `value`.
    fn saturated(value: i128) -> Self;
    /// Sign-extended.
    fn wide(self) -> i128;
    /// The nearest `f64`.
    fn real(self) -> f64;
    /// From a captured code.
    fn from_i32(value: i32) -> Self;
    /// Sum modulo 2^BITS.
    fn plus(self, other: Self) -> Self;
    /// Difference modulo 2^BITS.
    fn minus(self, other: Self) -> Self;
    /// Product modulo 2^BITS.
    fn times(self, other: Self) -> Self;
    /// Floor of self / 2^count; `count < BITS`.
    fn shr(self, count: u32) -> Self;
    /// self * 2^count modulo 2^BITS; `count < BITS`.
    fn shl(self, count: u32) -> Self;
    /// Bitwise and.
    fn and(self, other: Self) -> Self;
    /// The low `bits` bits as a two's-complement number; 1..=BITS.
    #[inline(always)]
    fn sign_extend(self, bits: u32) -> Self {
        let spare = Self::BITS - bits;
        self.shl(spare).shr(spare)
    }
    /// Bits `shift .. shift + width` as an unsigned number; `width` < 32.
    fn field(self, shift: u32, width: u32) -> usize;
}

macro_rules! lane {
    ($int:ty, $unsigned:ty) => {
        impl Lane for $int {
            const BITS: u32 = <$int>::BITS;
            #[inline(always)]
            fn low(value: i128) -> Self {
                value as $int
            }
            #[inline(always)]
            fn saturated(value: i128) -> Self {
                value.clamp(<$int>::MIN as i128, <$int>::MAX as i128) as $int
            }
            #[inline(always)]
            fn wide(self) -> i128 {
                self as i128
            }
            #[inline(always)]
            fn real(self) -> f64 {
                self as f64
            }
            #[inline(always)]
            fn from_i32(value: i32) -> Self {
                value as $int
            }
            #[inline(always)]
            fn plus(self, other: Self) -> Self {
                self.wrapping_add(other)
            }
            #[inline(always)]
            fn minus(self, other: Self) -> Self {
                self.wrapping_sub(other)
            }
            #[inline(always)]
            fn times(self, other: Self) -> Self {
                self.wrapping_mul(other)
            }
            #[inline(always)]
            fn shr(self, count: u32) -> Self {
                self.wrapping_shr(count)
            }
            #[inline(always)]
            fn shl(self, count: u32) -> Self {
                self.wrapping_shl(count)
            }
            #[inline(always)]
            fn and(self, other: Self) -> Self {
                self & other
            }
            #[inline(always)]
            fn field(self, shift: u32, width: u32) -> usize {
                ((self as $unsigned).wrapping_shr(shift) as usize) & ((1usize << width) - 1)
            }
        }
    };
}

lane!(i64, u64);
lane!(i128, u128);
