//! Fixed and float side by side: a word holds its raw integer, the real number that [`Float`]
//! computes in its place, and a bound on the distance between the two.
//!
//! The raw part is [`Fixed`]'s and the real part [`Float`]'s, operation by operation and bit for
//! bit: both are delegated to. The bound is a running error analysis (Wilkinson 1963; Higham,
//! Accuracy and Stability of Numerical Algorithms, 2nd ed., section 3.3): every operation says
//! by how much its result can be off, given how far its operands are. With fa, fb the real values and
//! ea, eb the bounds:
//!
//! | operation | bound |
//! |---|---|
//! | sum, difference | ea + eb |
//! | product | \|fa\| eb + \|fb\| ea + ea eb |
//! | cast | 2^gain ea + half an LSB (nearest) or one LSB (directed), if bits are dropped; and, where the overflow step acted, the distance by which it moved the word |
//! | limit to low .. high | ea, at most high - low (a limit is 1-Lipschitz) |
//! | wrap of a turn | ea, as a distance on the circle |
//! | table | the entry's own error, known exactly, + amplitude * 2 pi * phase not addressed |
//! | CIC | sum of h * bound: every tap h of the equivalent FIR is positive, so the bounds go through the same integrators and combs, as integers |
//!
//! Every real operation adds its rounding, at most 2^-52 of the result. A loop that moves the
//! oscillator makes its phase differ between the two; what that can add is carried apart
//! (`phase_bound`), because a loop's own analysis bounds it better than a sum over time ([`Watch`]).

pub use super::paired_word::{Pair, PairResidue, exp2i};

use super::arithmetic::{Arithmetic, IndexTable, LoopBody, Ring, SineTable, Table};
use super::cast::{Cast, HasKernel};
use super::fixed::Fixed;
use super::float::Float;
use super::format::Rounding;
use super::lane::Lane;
use super::paired_word::{TURN_STEP_EXPONENT, UNIT, bound_exponent, is_turn, steps};
use std::f64::consts::TAU;

/// Who looks on, and knows what an arithmetic alone cannot.
pub trait Watch {
    /// A cast was made. `rounded` is the raw word before the overflow step. May lower the bound
    /// of the result (a loop's integral).
    fn cast<W: Lane>(
        &self,
        cast: &Cast,
        input: &Pair<W>,
        rounded: W,
        operands: &[Pair<W>],
        output: Pair<W>,
    ) -> Pair<W>;
    /// The table was read.
    fn sine<W: Lane>(&self, word: &Pair<W>);
    /// |entry - sine| of the table's entry at an address, in the table's unit.
    fn table_error(&self, address: usize) -> f64;
    /// The phases of both oscillators differ by no more than this, turns.
    fn phase_cap_turns(&self) -> f64;
    /// The tuning words differ by no more than this, turns a sample.
    fn tuning_cap_turns(&self) -> f64;
    /// Phase and magnitude.
    fn polar<W: Lane>(&self, i: &Pair<W>, q: &Pair<W>) -> [Pair<W>; 2];
}

/// [`Fixed`] and [`Float`] at once: words in lanes `W`, residues in lanes `R`.
///
/// An overflow never stops it: where the design says `error`, the word saturates.
#[derive(Debug)]
pub struct Paired<'a, W, R, P> {
    fixed: Fixed<W, R>,
    watch: &'a P,
}

impl<'a, W, R, P: Watch> Paired<'a, W, R, P> {
    /// An arithmetic that `watch` looks at.
    pub fn new(watch: &'a P) -> Self {
        Paired {
            fixed: Fixed::new(),
            watch,
        }
    }
}

impl<W: HasKernel, R: Lane, P: Watch> Paired<'_, W, R, P> {
    /// A captured code.
    #[inline(always)]
    pub fn code(&self, code: i32, fraction_bits: i32) -> Pair<W> {
        let real = f64::from(code) * exp2i(-fraction_bits);
        Pair::exact(W::from_i32(code), real, fraction_bits)
    }

    /// A sum or difference whose raw and real parts are given.
    #[inline(always)]
    fn sum(a: Pair<W>, b: Pair<W>, raw: W, real: f64) -> Pair<W> {
        Pair {
            raw,
            real,
            bound: a.bound + b.bound + real.abs() * UNIT,
            phase_bound: a.phase_bound + b.phase_bound,
            fraction_bits: a.fraction_bits,
            cyclic: a.cyclic || b.cyclic,
        }
    }
}

/// The greatest rounding error of a cast, in LSB of its target.
#[inline(always)]
pub fn rounding_bound_lsb(cast: &Cast) -> f64 {
    match (cast.shift > 0, cast.rounding) {
        (false, _) => 0.0,
        (true, Rounding::HalfUp | Rounding::HalfEven | Rounding::HalfAway) => 0.5,
        (true, Rounding::Floor | Rounding::Ceil | Rounding::TowardZero) => 1.0,
    }
}

impl<W: HasKernel, R: Lane, P: Watch> Arithmetic for Paired<'_, W, R, P> {
    type Word = Pair<W>;
    type Residue = PairResidue<R>;
    type Truth = bool;
    type Index = u32;
    type Radius = ();

    #[inline(always)]
    fn constant(&self, raw: i128, fraction_bits: i32) -> Pair<W> {
        let real = Float.constant(raw, fraction_bits);
        let word = self.fixed.constant(raw, fraction_bits);
        Pair {
            bound: real.abs() * UNIT,
            ..Pair::exact(word, real, fraction_bits)
        }
    }
    #[inline(always)]
    fn add(&self, a: Pair<W>, b: Pair<W>) -> Pair<W> {
        Self::sum(
            a,
            b,
            self.fixed.add(a.raw, b.raw),
            Float.add(a.real, b.real),
        )
    }
    #[inline(always)]
    fn sub(&self, a: Pair<W>, b: Pair<W>) -> Pair<W> {
        Self::sum(
            a,
            b,
            self.fixed.sub(a.raw, b.raw),
            Float.sub(a.real, b.real),
        )
    }
    #[inline(always)]
    fn mul(&self, a: Pair<W>, b: Pair<W>) -> Pair<W> {
        let (a, b) = (a.straight(), b.straight());
        let real = Float.mul(a.real, b.real);
        let (fa, fb) = (a.real.abs(), b.real.abs());
        let own = fa * b.bound + fb * a.bound + a.bound * b.bound;
        let (ta, tb) = (a.bound + a.phase_bound, b.bound + b.phase_bound);
        let cross = a.phase_bound * tb + ta * b.phase_bound;
        Pair {
            raw: self.fixed.mul(a.raw, b.raw),
            real,
            bound: own + real.abs() * UNIT,
            phase_bound: fa * b.phase_bound + fb * a.phase_bound + cross,
            fraction_bits: a.fraction_bits + b.fraction_bits,
            cyclic: false,
        }
    }
    #[inline(always)]
    fn neg(&self, a: Pair<W>) -> Pair<W> {
        Pair {
            raw: self.fixed.neg(a.raw),
            real: Float.neg(a.real),
            ..a
        }
    }
    #[inline(always)]
    fn read_as(&self, a: Pair<W>, exponent: i32) -> Pair<W> {
        let a = a.straight();
        let factor = exp2i(exponent);
        Pair {
            raw: self.fixed.read_as(a.raw, exponent),
            real: Float.read_as(a.real, exponent),
            bound: a.bound * factor,
            phase_bound: a.phase_bound * factor,
            fraction_bits: a.fraction_bits - exponent,
            cyclic: false,
        }
    }
    #[inline(always)]
    fn cast(&self, a: Pair<W>, cast: &Cast, operands: &[Pair<W>]) -> Pair<W> {
        let a = a.straight();
        let kernel = cast.kernel::<W>();
        let raw = kernel.apply(a.raw, |_| {});
        let rounded = if cast.is_proved() {
            raw
        } else {
            kernel.round(a.raw)
        };
        let lsb = exp2i(-cast.target.fraction_bits);
        let factor = exp2i(cast.gain);
        let mut bound = a.bound * factor + rounding_bound_lsb(cast) * lsb;
        if rounded != raw {
            bound += (rounded.real() - raw.real()).abs() * lsb;
        }
        let output = Pair {
            raw,
            real: Float.cast(a.real, cast, &[]),
            bound,
            phase_bound: a.phase_bound * factor,
            fraction_bits: cast.target.fraction_bits,
            cyclic: false,
        };
        self.watch.cast(cast, &a, rounded, operands, output)
    }
    #[inline(always)]
    fn wrap(&self, a: Pair<W>, bits: u32, fraction_bits: i32) -> Pair<W> {
        let mut word = Pair {
            raw: self.fixed.wrap(a.raw, bits, fraction_bits),
            real: Float.wrap(a.real, bits, fraction_bits),
            cyclic: bits as i32 == fraction_bits,
            ..a
        };
        if word.cyclic {
            // The real wrap rounds its division and its difference.
            word.bound += (a.real.abs() + 1.0) * UNIT;
        } else {
            word.bound = word.error().abs() + word.real.abs() * UNIT;
        }
        word
    }
    #[inline(always)]
    fn limit(&self, a: Pair<W>, low: i128, high: i128, fraction_bits: i32) -> Pair<W> {
        let a = a.straight();
        let span = (high - low) as f64 * exp2i(-fraction_bits);
        let bound = a.bound.min(span);
        Pair {
            raw: self.fixed.limit(a.raw, low, high, fraction_bits),
            real: Float.limit(a.real, low, high, fraction_bits),
            bound,
            phase_bound: a.phase_bound.min(span - bound),
            ..a
        }
    }
    #[inline(always)]
    fn is_negative(&self, a: Pair<W>) -> bool {
        self.fixed.is_negative(a.raw)
    }
    #[inline(always)]
    fn select(&self, test: bool, yes: Pair<W>, no: Pair<W>) -> Pair<W> {
        if test { yes } else { no }
    }

    #[inline(always)]
    fn residue(&self, a: Pair<W>, ring: &Ring) -> PairResidue<R> {
        let exponent = bound_exponent(ring);
        let (mut bound, mut phase_bound) = (a.bound, a.phase_bound);
        if is_turn(ring) {
            // A tuning word: all of its difference moves the phase.
            (bound, phase_bound) = (
                0.0,
                (bound + phase_bound).min(self.watch.tuning_cap_turns()),
            );
        }
        PairResidue {
            raw: self.fixed.residue(a.raw, ring),
            grid: Float.residue(a.real, ring),
            bound: steps(bound, exponent),
            phase_bound: if phase_bound > 0.0 {
                steps(phase_bound, exponent)
            } else {
                0
            },
        }
    }
    #[inline(always)]
    fn residue_constant(&self, raw: i128, ring: &Ring) -> PairResidue<R> {
        PairResidue {
            raw: self.fixed.residue_constant(raw, ring),
            grid: Float.residue_constant(raw, ring),
            bound: 0,
            phase_bound: 0,
        }
    }
    #[inline(always)]
    fn residue_add(&self, a: PairResidue<R>, b: PairResidue<R>, ring: &Ring) -> PairResidue<R> {
        let raw = self.fixed.residue_add(a.raw, b.raw, ring);
        let grid = Float.residue_add(a.grid, b.grid, ring);
        let (bound, phase_bound) = if is_turn(ring) {
            // Both are below 2^124: no sum wraps.
            let whole = a.bound + b.bound + a.phase_bound + b.phase_bound;
            // Without a phase loop there is none, and no cap is asked for.
            let cap =
                |whole: u128| whole.min(steps(self.watch.phase_cap_turns(), TURN_STEP_EXPONENT));
            (0, if whole > 0 { cap(whole) } else { 0 })
        } else {
            (
                a.bound.wrapping_add(b.bound),
                a.phase_bound.wrapping_add(b.phase_bound),
            )
        };
        PairResidue {
            raw,
            grid,
            bound,
            phase_bound,
        }
    }
    /// A comb: with the integrators before it, it makes the positive taps of the equivalent FIR,
    /// so the bounds are *subtracted* as the words are.
    #[inline(always)]
    fn residue_sub(&self, a: PairResidue<R>, b: PairResidue<R>, ring: &Ring) -> PairResidue<R> {
        PairResidue {
            raw: self.fixed.residue_sub(a.raw, b.raw, ring),
            grid: Float.residue_sub(a.grid, b.grid, ring),
            bound: a.bound.wrapping_sub(b.bound),
            phase_bound: a.phase_bound.wrapping_sub(b.phase_bound),
        }
    }
    #[inline(always)]
    fn centered(&self, a: PairResidue<R>, ring: &Ring) -> Pair<W> {
        let step = exp2i(-bound_exponent(ring));
        let real = Float.centered(a.grid, ring);
        Pair {
            raw: self.fixed.centered(a.raw, ring),
            real,
            bound: a.bound as f64 * step + real.abs() * UNIT,
            phase_bound: a.phase_bound as f64 * step,
            fraction_bits: ring.fraction_bits,
            // A turn: the two may lie on both sides of the cut.
            cyclic: *ring == Ring::cyclic(ring.bits, ring.bits as i32),
        }
    }
    /// Entry k stands for the phases that are addressed to it. Its bound is its own error as an
    /// entry, and the amplitude times the phase between the oscillator's and the entry's.
    #[inline(always)]
    fn sine(&self, phase: PairResidue<R>, table: &SineTable) -> Pair<W> {
        let dropped = table.phase_bits - table.address_bits;
        let half = if table.half_step && dropped > 0 {
            R::low(1i128 << (dropped - 1))
        } else {
            R::default()
        };
        let advanced = phase.raw.plus(half);
        let address = advanced.field(dropped, table.address_bits);
        let start = R::low((address as i128) << dropped);
        let rest = phase.raw.minus(start).sign_extend(table.phase_bits).real();
        let rest_turns = rest.abs() * exp2i(-(table.phase_bits as i32));
        let real = Float.sine(phase.grid, table);
        let slope = table.amplitude * TAU;
        let difference = match phase.phase_bound {
            0 => 0.0,
            steps => steps as f64 * exp2i(-TURN_STEP_EXPONENT),
        };
        let word = Pair {
            raw: self.fixed.sine(phase.raw, table),
            real,
            bound: self.watch.table_error(address) + slope * rest_turns + table.amplitude * UNIT,
            phase_bound: (slope * difference).min(2.0 * table.amplitude),
            fraction_bits: table.fraction_bits as i32,
            cyclic: false,
        };
        self.watch.sine(&word);
        word
    }

    /// The raw address and the real one may fall on different entries: then the bound is the distance
    /// between the two entries, which is known exactly.
    fn lookup(&self, address: Pair<W>, table: &Table) -> Pair<W> {
        let word = Pair::exact(
            self.fixed.lookup(address.raw, table),
            Float.lookup(address.real, table),
            table.fraction_bits,
        );
        Pair {
            bound: (word.value() - word.real).abs(),
            ..word
        }
    }
    fn shift_right_by(&self, a: Pair<W>, index: u32) -> Pair<W> {
        let factor = exp2i(-(index as i32));
        Pair {
            raw: self.fixed.shift_right_by(a.raw, index),
            real: Float.shift_right_by(a.real, index),
            bound: a.bound * factor + exp2i(-a.fraction_bits),
            phase_bound: a.phase_bound * factor,
            ..a
        }
    }
    fn entry(&self, table: &IndexTable, index: u32) -> Pair<W> {
        Pair::exact(
            self.fixed.entry(table, index),
            Float.entry(table, index),
            table.fraction_bits as i32,
        )
    }
    fn repeat<const S: usize, B: LoopBody<Self, S>>(
        &self,
        count: u32,
        mut state: [Pair<W>; S],
        mut radius: (),
        body: &B,
    ) -> [Pair<W>; S] {
        for index in 0..count {
            state = body.step(self, index, state, &mut radius);
        }
        state
    }
    #[inline(always)]
    fn within(&self, a: Pair<W>, _low: i128, _high: i128) -> Pair<W> {
        a
    }
    fn radius(&self, _x: Pair<W>, _y: Pair<W>) {}
    fn bounded(&self, a: Pair<W>, _radius: ()) -> Pair<W> {
        a
    }
    fn rotated(&self, _radius: (), _index: u32) {}
    fn wrapped_radius(&self, _radius: (), _width: u32) {}

    /// The CORDIC as one operation: its steps turn the vector by angles that the real numbers do
    /// not have in common with it. `watch` runs the integer loop for the raw part.
    #[inline(always)]
    fn ideal_polar(&self, i: Pair<W>, q: Pair<W>) -> Option<[Pair<W>; 2]> {
        Some(self.watch.polar(&i, &q))
    }
}

#[cfg(test)]
#[path = "paired_tests.rs"]
mod tests;
