//! The bit-accurate arithmetic over several words at once: raw words of 64 bits side by side, of as many decimated
//! samples or as many channels. The compiler makes SIMD of it inside a function that is compiled for it.
//!
//! No cast reports: a chain in which one may stop the run is not given to it.

use super::arithmetic::{Arithmetic, IndexTable, LoopBody, Ring, SineTable, Table};
use super::cast::{Cast, End};
use super::lane::Lane;

/// `W` words side by side; see the module.
#[derive(Debug, Clone, Copy, Default)]
pub struct Batch<const W: usize>;

#[inline(always)]
fn each<const W: usize>(a: [i64; W], b: [i64; W], f: impl Fn(i64, i64) -> i64) -> [i64; W] {
    let mut to = a;
    for k in 0..W {
        to[k] = f(a[k], b[k]);
    }
    to
}

#[inline(always)]
fn one<const W: usize>(mut a: [i64; W], f: impl Fn(i64) -> i64) -> [i64; W] {
    for v in &mut a {
        *v = f(*v);
    }
    a
}

impl<const W: usize> Arithmetic for Batch<W> {
    type Word = [i64; W];
    type Residue = [i64; W];
    /// All ones where it holds, else 0.
    type Truth = [i64; W];
    type Index = u32;
    type Radius = ();

    #[inline(always)]
    fn constant(&self, raw: i128, _fraction_bits: i32) -> [i64; W] {
        [raw as i64; W]
    }
    #[inline(always)]
    fn add(&self, a: [i64; W], b: [i64; W]) -> [i64; W] {
        each(a, b, i64::wrapping_add)
    }
    #[inline(always)]
    fn sub(&self, a: [i64; W], b: [i64; W]) -> [i64; W] {
        each(a, b, i64::wrapping_sub)
    }
    #[inline(always)]
    fn mul(&self, a: [i64; W], b: [i64; W]) -> [i64; W] {
        each(a, b, i64::wrapping_mul)
    }
    #[inline(always)]
    fn neg(&self, a: [i64; W]) -> [i64; W] {
        one(a, i64::wrapping_neg)
    }
    #[inline(always)]
    fn read_as(&self, a: [i64; W], _exponent: i32) -> [i64; W] {
        a
    }
    /// As [`super::cast::Kernel::apply`] on each word.
    #[inline(always)]
    fn cast(&self, a: [i64; W], cast: &Cast, _operands: &[[i64; W]]) -> [i64; W] {
        if cast.is_idle() {
            return a;
        }
        let kernel = cast.kernel::<i64>();
        if !kernel.follows_the_table() {
            return a.map(|v| kernel.apply(v, |_| {}));
        }
        let mut v = a;
        if kernel.left > 0 {
            v = one(v, |v| v.shl(kernel.left));
        } else if kernel.negative == 0 && kernel.odd == 0 {
            v = one(v, |v| v.plus(kernel.base).shr(kernel.right));
        } else {
            v = one(v, |v| kernel.round(v));
        }
        match kernel.end {
            End::Exact => v,
            End::WrapSigned => one(v, |v| v.sign_extend(kernel.bits)),
            End::WrapUnsigned => one(v, |v| v & kernel.high),
            End::Clamp | End::Report => one(v, |v| v.max(kernel.low).min(kernel.high)),
        }
    }
    #[inline(always)]
    fn wrap(&self, a: [i64; W], bits: u32, _fraction_bits: i32) -> [i64; W] {
        let bits = bits.min(i64::BITS);
        one(a, |v| v.sign_extend(bits))
    }
    #[inline(always)]
    fn wrap_unless(&self, idle: bool, a: [i64; W], bits: u32, fraction_bits: i32) -> [i64; W] {
        if idle {
            return a;
        }
        self.wrap(a, bits, fraction_bits)
    }
    #[inline(always)]
    fn wrap_in_sum(&self, a: [i64; W], _bits: u32, _fraction_bits: i32) -> [i64; W] {
        // A lane has at least as many bits, and sums keep the low ones.
        a
    }
    #[inline(always)]
    fn settled(&self, a: [i64; W], bits: u32) -> [i64; W] {
        self.wrap(a, bits, 0)
    }
    #[inline(always)]
    fn limit(&self, a: [i64; W], low: i128, high: i128, _fraction_bits: i32) -> [i64; W] {
        let (low, high) = (i64::saturated(low), i64::saturated(high));
        one(a, |v| v.max(low).min(high))
    }
    #[inline(always)]
    fn is_negative(&self, a: [i64; W]) -> [i64; W] {
        one(a, |v| v >> 63)
    }
    #[inline(always)]
    fn select(&self, test: [i64; W], yes: [i64; W], no: [i64; W]) -> [i64; W] {
        each(
            no,
            each(test, each(yes, no, |y, n| y ^ n), |t, d| t & d),
            |n, d| n ^ d,
        )
    }

    #[inline(always)]
    fn residue(&self, a: [i64; W], _ring: &Ring) -> [i64; W] {
        a
    }
    #[inline(always)]
    fn residue_constant(&self, raw: i128, _ring: &Ring) -> [i64; W] {
        [raw as i64; W]
    }
    #[inline(always)]
    fn residue_add(&self, a: [i64; W], b: [i64; W], _ring: &Ring) -> [i64; W] {
        self.add(a, b)
    }
    #[inline(always)]
    fn residue_sub(&self, a: [i64; W], b: [i64; W], _ring: &Ring) -> [i64; W] {
        self.sub(a, b)
    }
    #[inline(always)]
    fn centered(&self, a: [i64; W], ring: &Ring) -> [i64; W] {
        one(a, |v| v.sign_extend(ring.bits))
    }
    #[inline(always)]
    fn sine(&self, phase: [i64; W], table: &SineTable) -> [i64; W] {
        let dropped = table.phase_bits - table.address_bits;
        let half = i64::from(table.half_step && dropped > 0) << dropped.saturating_sub(1);
        one(phase, |v| {
            table.entries[v.plus(half).field(dropped, table.address_bits)]
        })
    }
    #[inline(always)]
    fn lookup(&self, address: [i64; W], table: &Table) -> [i64; W] {
        // The address is proved to be inside when the block is traced; words of no sample are not.
        let last = table.entries.len() - 1;
        one(address, |v| table.entries[(v.max(0) as usize).min(last)])
    }
    #[inline(always)]
    fn shift_right_by(&self, a: [i64; W], index: u32) -> [i64; W] {
        one(a, |v| v.shr(index))
    }
    #[inline(always)]
    fn entry(&self, table: &IndexTable, index: u32) -> [i64; W] {
        [table.entries[index as usize]; W]
    }
    #[inline(always)]
    fn repeat<const S: usize, B: LoopBody<Self, S>>(
        &self,
        count: u32,
        mut state: [[i64; W]; S],
        mut radius: (),
        body: &B,
    ) -> [[i64; W]; S] {
        for index in 0..count {
            state = body.step(self, index, state, &mut radius);
        }
        state
    }
    #[inline(always)]
    fn within(&self, a: [i64; W], _low: i128, _high: i128) -> [i64; W] {
        a
    }
    #[inline(always)]
    fn radius(&self, _x: [i64; W], _y: [i64; W]) {}
    #[inline(always)]
    fn bounded(&self, a: [i64; W], _radius: ()) -> [i64; W] {
        a
    }
    #[inline(always)]
    fn rotated(&self, _radius: (), _index: u32) {}
    #[inline(always)]
    fn wrapped_radius(&self, _radius: (), _width: u32) {}
}
