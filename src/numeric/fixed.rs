//! The bit-accurate arithmetic: a word is its raw two's-complement integer in a lane that the
//! chain's ranges fit into.

use super::arithmetic::{Arithmetic, IndexTable, LoopBody, Ring, SineTable, StateVisitor, Table};
use super::cast::{Cast, HasKernel, Label, form};
use super::lane::Lane;
use std::cell::{Cell, OnceCell};
use std::marker::PhantomData;

/// An overflow where the design says `error`: the run stops here.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Overflowed {
    /// 0-based ADC sample; at the slow rate the last sample of the period.
    pub sample: u64,
    /// The node.
    pub label: Label,
    /// Number of the cast in its chain.
    pub cast: usize,
    /// The exact word before the overflow step, raw.
    pub value: i128,
    /// What went into the node, raw; see `docs/manual.md`.
    pub operands: [Option<i128>; 2],
    /// The first operand is a coefficient, aligned by this many bits.
    pub coefficient_shift: Option<u32>,
}

impl std::fmt::Display for Overflowed {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "overflow at sample {} in {}", self.sample, self.label)?;
        let operands: Vec<String> = self
            .operands
            .iter()
            .flatten()
            .map(i128::to_string)
            .collect();
        write!(
            f,
            ": the raw word {} does not fit (it was made of the raw words {}",
            self.value,
            operands.join(" and ")
        )?;
        if let (Some(shift @ 1..), Some(first)) = (self.coefficient_shift, self.operands[0]) {
            let raw = first >> shift;
            write!(f, "; {first} is coefficient {raw} aligned by {shift} bits")?;
        }
        write!(f, ")")
    }
}

/// Integers with run-time formats: words in lanes `W`, residues in lanes `R`.
///
/// Remembers the first overflow of a cast whose mode is `error`; the word saturates and the run
/// goes on until its owner looks. `FORM`, of [`form`], is the most that a cast of the part of a chain has to do that this runs:
/// with less than `ANY` the ranges have proved that no word overflows there.
#[derive(Debug, Default)]
pub struct Fixed<W, R, const FORM: u8 = { form::ANY }> {
    sample: Cell<u64>,
    overflowed: OnceCell<Overflowed>,
    lanes: PhantomData<(W, R)>,
}

impl<W, R, const FORM: u8> Fixed<W, R, FORM> {
    /// An arithmetic that has seen no overflow.
    pub fn new() -> Self {
        Fixed {
            sample: Cell::new(0),
            overflowed: OnceCell::new(),
            lanes: PhantomData,
        }
    }

    /// The sample that an overflow from now on is reported at.
    #[inline(always)]
    pub fn at_sample(&self, sample: u64) {
        self.sample.set(sample);
    }

    /// The first overflow so far.
    pub fn overflowed(&self) -> Option<Overflowed> {
        self.overflowed.get().copied()
    }
}

impl<W: Lane, R, const FORM: u8> Fixed<W, R, FORM> {
    #[cold]
    #[inline(never)]
    fn report(&self, cast: &Cast, value: W, operands: &[W]) {
        let operand = |k: usize| operands.get(k).map(|w| w.wide());
        self.overflowed.get_or_init(|| Overflowed {
            sample: self.sample.get(),
            label: cast.label,
            cast: cast.id,
            value: value.wide(),
            operands: [operand(0), operand(1)],
            coefficient_shift: cast.coefficient_shift,
        });
    }
}

impl<W: HasKernel, R: Lane, const FORM: u8> Arithmetic for Fixed<W, R, FORM> {
    type Word = W;
    type Residue = R;
    type Truth = bool;
    type Index = u32;
    type Radius = ();

    #[inline(always)]
    fn constant(&self, raw: i128, _fraction_bits: i32) -> W {
        W::low(raw)
    }
    #[inline(always)]
    fn add(&self, a: W, b: W) -> W {
        a.plus(b)
    }
    #[inline(always)]
    fn sub(&self, a: W, b: W) -> W {
        a.minus(b)
    }
    #[inline(always)]
    fn mul(&self, a: W, b: W) -> W {
        a.times(b)
    }
    #[inline(always)]
    fn neg(&self, a: W) -> W {
        W::default().minus(a)
    }
    #[inline(always)]
    fn read_as(&self, a: W, _exponent: i32) -> W {
        a
    }
    #[inline(always)]
    fn cast(&self, a: W, cast: &Cast, operands: &[W]) -> W {
        let kernel = cast.kernel::<W>();
        debug_assert!(kernel.form() <= FORM);
        match FORM {
            form::IDLE => a,
            form::ROUNDED => kernel.rounded(a),
            _ => kernel.apply(a, |value| self.report(cast, value, operands)),
        }
    }
    #[inline(always)]
    fn wrap(&self, a: W, bits: u32, _fraction_bits: i32) -> W {
        a.sign_extend(bits.min(W::BITS))
    }
    #[inline(always)]
    fn wrap_unless(&self, idle: bool, a: W, bits: u32, fraction_bits: i32) -> W {
        if idle {
            return a;
        }
        self.wrap(a, bits, fraction_bits)
    }
    #[inline(always)]
    fn wrap_in_sum(&self, a: W, _bits: u32, _fraction_bits: i32) -> W {
        // A lane has at least as many bits, and sums keep the low ones.
        a
    }
    #[inline(always)]
    fn settled(&self, a: W, bits: u32) -> W {
        self.wrap(a, bits, 0)
    }
    #[inline(always)]
    fn limit(&self, a: W, low: i128, high: i128, _fraction_bits: i32) -> W {
        a.clamp(W::saturated(low), W::saturated(high))
    }
    #[inline(always)]
    fn is_negative(&self, a: W) -> bool {
        a < W::default()
    }
    #[inline(always)]
    fn select(&self, test: bool, yes: W, no: W) -> W {
        if test { yes } else { no }
    }

    #[inline(always)]
    fn residue(&self, a: W, _ring: &Ring) -> R {
        R::low(a.wide())
    }
    #[inline(always)]
    fn residue_constant(&self, raw: i128, _ring: &Ring) -> R {
        R::low(raw)
    }
    #[inline(always)]
    fn residue_add(&self, a: R, b: R, _ring: &Ring) -> R {
        a.plus(b)
    }
    #[inline(always)]
    fn residue_sub(&self, a: R, b: R, _ring: &Ring) -> R {
        a.minus(b)
    }
    #[inline(always)]
    fn centered(&self, a: R, ring: &Ring) -> W {
        W::low(a.sign_extend(ring.bits).wide())
    }
    #[inline(always)]
    fn sine(&self, phase: R, table: &SineTable) -> W {
        let dropped = table.phase_bits - table.address_bits;
        let phase = if table.half_step && dropped > 0 {
            phase.plus(R::low(1i128 << (dropped - 1)))
        } else {
            phase
        };
        // `field` masks to address_bits and the table has 2^address_bits entries.
        W::low(i128::from(
            table.entries[phase.field(dropped, table.address_bits)],
        ))
    }

    #[inline(always)]
    fn lookup(&self, address: W, table: &Table) -> W {
        // The address is proved to be inside when the block is traced.
        W::low(i128::from(table.entries[address.wide() as usize]))
    }
    #[inline(always)]
    fn shift_right_by(&self, a: W, index: u32) -> W {
        a.shr(index)
    }
    #[inline(always)]
    fn entry(&self, table: &IndexTable, index: u32) -> W {
        W::low(i128::from(table.entries[index as usize]))
    }
    #[inline(always)]
    fn repeat<const S: usize, B: LoopBody<Self, S>>(
        &self,
        count: u32,
        mut state: [W; S],
        mut radius: (),
        body: &B,
    ) -> [W; S] {
        for index in 0..count {
            state = body.step(self, index, state, &mut radius);
        }
        state
    }
    #[inline(always)]
    fn within(&self, a: W, _low: i128, _high: i128) -> W {
        a
    }
    #[inline(always)]
    fn radius(&self, _x: W, _y: W) {}
    #[inline(always)]
    fn bounded(&self, a: W, _radius: ()) -> W {
        a
    }
    #[inline(always)]
    fn rotated(&self, _radius: (), _index: u32) {}
    #[inline(always)]
    fn wrapped_radius(&self, _radius: (), _width: u32) {}
}

/// Gathers a state's words, of residues the low bits of their ring.
#[derive(Debug, Default)]
pub struct Words(pub Vec<i128>);

impl StateVisitor<Fixed<i128, i128>> for Words {
    fn word(&mut self, _: &'static str, word: &mut i128, _: i128, _: i128) {
        self.0.push(*word);
    }

    fn residues(&mut self, _: &'static str, residues: &mut [i128], ring: &Ring) {
        let mask = i128::MAX >> (127 - ring.bits);
        self.0.extend(residues.iter().map(|residue| residue & mask));
    }
}
