//! A word and a residue of [`Paired`](super::paired::Paired): fixed, float, and the bound on their distance.

use super::arithmetic::Ring;
use super::lane::Lane;

/// Rounding of one `f64` operation, relative, with a factor 2 to spare.
pub(super) const UNIT: f64 = f64::EPSILON;

/// Turns in phase bounds are counted in 2^-124.
pub(super) const TURN_STEP_EXPONENT: i32 = 124;

/// 2^exponent for the exponents of formats, without a library call.
#[inline(always)]
pub fn exp2i(exponent: i32) -> f64 {
    f64::from_bits(((1023 + exponent.clamp(-1022, 1023)) as u64) << 52)
}

/// A word in both arithmetics.
#[derive(Debug, Clone, Copy)]
pub struct Pair<W> {
    /// The integer that `Fixed` has.
    pub raw: W,
    /// What `Float` has.
    pub real: f64,
    /// |raw * 2^-fraction_bits - real| is at most `bound + phase_bound`: this is what quantisation
    /// adds if both oscillators have the same phase.
    pub bound: f64,
    /// What a difference between the oscillators' phases adds.
    pub phase_bound: f64,
    /// One LSB is 2^-fraction_bits in the unit of `real`.
    pub fraction_bits: i32,
    /// The distance is taken on a circle of circumference 1 (a phase in turns).
    pub cyclic: bool,
}

impl<W: Lane> Pair<W> {
    /// A word that both have exactly.
    #[inline(always)]
    pub fn exact(raw: W, real: f64, fraction_bits: i32) -> Self {
        Pair {
            raw,
            real,
            bound: 0.0,
            phase_bound: 0.0,
            fraction_bits,
            cyclic: false,
        }
    }

    /// The bound on the distance. The factor covers the rounding of the bounds themselves.
    #[inline(always)]
    pub fn total_bound(&self) -> f64 {
        (self.bound + self.phase_bound) * (1.0 + 1e-12)
            + (self.real.abs() + self.value().abs()) * UNIT
    }

    /// The raw word's value.
    #[inline(always)]
    pub fn value(&self) -> f64 {
        self.raw.real() * exp2i(-self.fraction_bits)
    }

    /// Raw minus real, in the unit of `real`; the shorter way for a phase.
    #[inline(always)]
    pub fn error(&self) -> f64 {
        let error = self.value() - self.real;
        if self.cyclic {
            error - error.round()
        } else {
            error
        }
    }

    /// The same word for an operation that does not know of the circle: where the two values lie on
    /// both sides of the cut, they are almost a turn apart.
    #[inline(always)]
    pub fn straight(self) -> Self {
        if !self.cyclic {
            return self;
        }
        let mut word = self;
        word.cyclic = false;
        let distance = (self.value() - self.real).abs();
        if distance > 0.5 {
            (word.bound, word.phase_bound) = (distance, 0.0);
        }
        word
    }
}

/// An element of a ring in both arithmetics.
#[derive(Debug, Clone, Copy)]
pub struct PairResidue<R> {
    /// `Fixed`'s residue.
    pub raw: R,
    /// `Float`'s residue, on its grid of 2^-128 of the circle.
    pub grid: i128,
    /// The bound as an integer, in steps of `bound_exponent`; modulo 2^128 between the
    /// integrators and the combs of a CIC, as the sums themselves are.
    pub bound: u128,
    /// The same of what the oscillators' difference adds.
    pub phase_bound: u128,
}

/// The exponent of the step in which a ring's bounds are counted, and whether it is a turn.
///
/// In a CIC the sums of bounds must stay below 2^128: a bound is at most the sum of both
/// arithmetics' ranges (beyond them, overflow has been counted by its actual distance), so that
/// 2^128 is given to 16 times the larger range of the ring.
#[inline(always)]
pub(super) fn bound_exponent(ring: &Ring) -> i32 {
    if is_turn(ring) {
        return TURN_STEP_EXPONENT;
    }
    let fixed_reach = ring.bits as i32 - 1 - ring.fraction_bits;
    127 - (ring.reach.max(fixed_reach) + 4)
}

/// A phase: the whole circle is one turn. (A CIC's ring has bits above the unit.)
#[inline(always)]
pub(super) fn is_turn(ring: &Ring) -> bool {
    ring.bits as i32 == ring.fraction_bits
}

/// Rounded up, plus one step for the rounding of what goes into the real ring.
#[inline(always)]
pub(super) fn steps(bound: f64, exponent: i32) -> u128 {
    (bound * exp2i(exponent)).ceil() as u128 + 1
}
