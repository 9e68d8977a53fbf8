//! The bit-accurate arithmetic over several decimated samples at once: eight raw words of 64 bits side
//! by side, for blocks without state. The compiler makes SIMD of it inside a function that is compiled for it.
//!
//! No cast reports: a chain in which one may stop the run is not given to it.

use super::arithmetic::{Arithmetic, IndexTable, LoopBody, Ring, SineTable, Table};
use super::cast::{Cast, End};
use super::lane::Lane;

/// Samples side by side.
pub const WIDTH: usize = 8;

/// One word of each sample.
pub type Words = [i64; WIDTH];

/// See the module.
#[derive(Debug, Clone, Copy, Default)]
pub struct Batch;

#[inline(always)]
fn each(a: Words, b: Words, f: impl Fn(i64, i64) -> i64) -> Words {
    let mut to = a;
    for k in 0..WIDTH {
        to[k] = f(a[k], b[k]);
    }
    to
}

#[inline(always)]
fn one(mut a: Words, f: impl Fn(i64) -> i64) -> Words {
    for v in &mut a {
        *v = f(*v);
    }
    a
}

impl Arithmetic for Batch {
    type Word = Words;
    type Residue = Words;
    /// All ones where it holds, else 0.
    type Truth = Words;
    type Index = u32;
    type Radius = ();

    #[inline(always)]
    fn constant(&self, raw: i128, _fraction_bits: i32) -> Words {
        [raw as i64; WIDTH]
    }
    #[inline(always)]
    fn add(&self, a: Words, b: Words) -> Words {
        each(a, b, i64::wrapping_add)
    }
    #[inline(always)]
    fn sub(&self, a: Words, b: Words) -> Words {
        each(a, b, i64::wrapping_sub)
    }
    #[inline(always)]
    fn mul(&self, a: Words, b: Words) -> Words {
        each(a, b, i64::wrapping_mul)
    }
    #[inline(always)]
    fn neg(&self, a: Words) -> Words {
        one(a, i64::wrapping_neg)
    }
    #[inline(always)]
    fn read_as(&self, a: Words, _exponent: i32) -> Words {
        a
    }
    /// As [`super::cast::Kernel::apply`] on each word.
    #[inline(always)]
    fn cast(&self, a: Words, cast: &Cast, _operands: &[Words]) -> Words {
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
    fn wrap(&self, a: Words, bits: u32, _fraction_bits: i32) -> Words {
        let bits = bits.min(i64::BITS);
        one(a, |v| v.sign_extend(bits))
    }
    #[inline(always)]
    fn limit(&self, a: Words, low: i128, high: i128, _fraction_bits: i32) -> Words {
        let (low, high) = (i64::saturated(low), i64::saturated(high));
        one(a, |v| v.max(low).min(high))
    }
    #[inline(always)]
    fn is_negative(&self, a: Words) -> Words {
        one(a, |v| v >> 63)
    }
    #[inline(always)]
    fn select(&self, test: Words, yes: Words, no: Words) -> Words {
        each(
            no,
            each(test, each(yes, no, |y, n| y ^ n), |t, d| t & d),
            |n, d| n ^ d,
        )
    }

    #[inline(always)]
    fn residue(&self, a: Words, _ring: &Ring) -> Words {
        a
    }
    #[inline(always)]
    fn residue_constant(&self, raw: i128, _ring: &Ring) -> Words {
        [raw as i64; WIDTH]
    }
    #[inline(always)]
    fn residue_add(&self, a: Words, b: Words, _ring: &Ring) -> Words {
        self.add(a, b)
    }
    #[inline(always)]
    fn residue_sub(&self, a: Words, b: Words, _ring: &Ring) -> Words {
        self.sub(a, b)
    }
    #[inline(always)]
    fn centered(&self, a: Words, ring: &Ring) -> Words {
        one(a, |v| v.sign_extend(ring.bits))
    }
    #[inline(always)]
    fn sine(&self, phase: Words, table: &SineTable) -> Words {
        let dropped = table.phase_bits - table.address_bits;
        let half = i64::from(table.half_step && dropped > 0) << dropped.saturating_sub(1);
        one(phase, |v| {
            table.entries[v.plus(half).field(dropped, table.address_bits)]
        })
    }
    #[inline(always)]
    fn lookup(&self, address: Words, table: &Table) -> Words {
        // The address is proved to be inside when the block is traced; words of no sample are not.
        let last = table.entries.len() - 1;
        one(address, |v| table.entries[(v.max(0) as usize).min(last)])
    }
    #[inline(always)]
    fn shift_right_by(&self, a: Words, index: u32) -> Words {
        one(a, |v| v.shr(index))
    }
    #[inline(always)]
    fn entry(&self, table: &IndexTable, index: u32) -> Words {
        [table.entries[index as usize]; WIDTH]
    }
    #[inline(always)]
    fn repeat<const S: usize, B: LoopBody<Self, S>>(
        &self,
        count: u32,
        mut state: [Words; S],
        mut radius: (),
        body: &B,
    ) -> [Words; S] {
        for index in 0..count {
            state = body.step(self, index, state, &mut radius);
        }
        state
    }
    #[inline(always)]
    fn within(&self, a: Words, _low: i128, _high: i128) -> Words {
        a
    }
    #[inline(always)]
    fn radius(&self, _x: Words, _y: Words) {}
    #[inline(always)]
    fn bounded(&self, a: Words, _radius: ()) -> Words {
        a
    }
    #[inline(always)]
    fn rotated(&self, _radius: (), _index: u32) {}
    #[inline(always)]
    fn wrapped_radius(&self, _radius: (), _width: u32) {}
}
