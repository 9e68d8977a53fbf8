//! The arithmetic without quantisation: `f64` words, and rings on a grid of 128 bits.
//!
//! What the contract's `--arith float` states: no cast and no limit but those that belong to the
//! circuit's function; sin, cos, atan2 and hypot exact. Accumulators must not grow: a residue is a
//! 128-bit integer, so that an integrator wraps exactly and its only error is the rounding of what
//! goes in, at most 2^-129 of the circle.

use super::arithmetic::{Arithmetic, IndexTable, LoopBody, Ring, SineTable, Table};
use super::cast::Cast;
use super::format::pow2;

/// `f64`, no quantisation.
#[derive(Debug, Default, Clone, Copy)]
pub struct Float;

/// Steps of the 128-bit grid in one unit of a ring's words: half the circle, 2^127, is 2^reach.
fn grid(ring: &Ring) -> f64 {
    pow2(127 - ring.reach)
}

/// The nearest integer, ties to even, of a value within [-2^127, 2^127): by its bits where it has no fraction.
#[inline]
fn nearest(value: f64) -> i128 {
    const FRACTION_BITS: u32 = 52;
    let bits = value.to_bits();
    let exponent = (bits >> FRACTION_BITS) as i32 & 0x7ff;
    let shift = exponent - 1023 - FRACTION_BITS as i32;
    match shift {
        ..0 => i128::from(value.round_ties_even() as i64),
        0..76 => {
            let mantissa = (bits & ((1 << FRACTION_BITS) - 1)) | (1 << FRACTION_BITS);
            // Of -2^127 the magnitude does not fit, its negative does.
            let magnitude = i128::from(mantissa).wrapping_shl(shift as u32);
            if value.is_sign_negative() {
                magnitude.wrapping_neg()
            } else {
                magnitude
            }
        }
        // Not a number.
        _ => 0,
    }
}

impl Arithmetic for Float {
    type Word = f64;
    type Residue = i128;
    type Truth = bool;
    type Index = u32;
    type Radius = ();

    fn constant(&self, raw: i128, fraction_bits: i32) -> f64 {
        raw as f64 * pow2(-fraction_bits)
    }
    fn add(&self, a: f64, b: f64) -> f64 {
        a + b
    }
    fn sub(&self, a: f64, b: f64) -> f64 {
        a - b
    }
    fn mul(&self, a: f64, b: f64) -> f64 {
        a * b
    }
    fn neg(&self, a: f64) -> f64 {
        -a
    }
    fn read_as(&self, a: f64, exponent: i32) -> f64 {
        a * pow2(exponent)
    }
    fn cast(&self, a: f64, cast: &Cast, _operands: &[f64]) -> f64 {
        a * pow2(cast.gain)
    }
    fn wrap(&self, a: f64, bits: u32, fraction_bits: i32) -> f64 {
        let circle = pow2(bits as i32 - fraction_bits);
        let wrapped = a - circle * (a / circle + 0.5).floor();
        // The division rounds: a value just below the upper end may land on it.
        if wrapped >= circle / 2.0 {
            wrapped - circle
        } else {
            wrapped
        }
    }
    fn limit(&self, a: f64, low: i128, high: i128, fraction_bits: i32) -> f64 {
        let lsb = pow2(-fraction_bits);
        a.max(low as f64 * lsb).min(high as f64 * lsb)
    }
    fn is_negative(&self, a: f64) -> bool {
        a < 0.0
    }
    fn select(&self, test: bool, yes: f64, no: f64) -> f64 {
        if test { yes } else { no }
    }

    fn residue(&self, a: f64, ring: &Ring) -> i128 {
        // Round to the grid; a float's remainder modulo the circle is exact.
        let steps = a * grid(ring);
        let half = pow2(127);
        if (-half..half).contains(&steps) {
            return nearest(steps);
        }
        let circle = pow2(128);
        let mut inside = steps % circle;
        if inside >= half {
            inside -= circle;
        } else if inside < -half {
            inside += circle;
        }
        nearest(inside)
    }
    fn residue_constant(&self, raw: i128, ring: &Ring) -> i128 {
        // One step of the ring is 2^-fraction_bits; exact wherever the grid is finer.
        let shift = 127 - ring.reach - ring.fraction_bits;
        if shift >= 0 {
            raw.wrapping_shl(shift as u32)
        } else {
            raw >> -shift
        }
    }
    fn residue_add(&self, a: i128, b: i128, _ring: &Ring) -> i128 {
        a.wrapping_add(b)
    }
    fn residue_sub(&self, a: i128, b: i128, _ring: &Ring) -> i128 {
        a.wrapping_sub(b)
    }
    fn centered(&self, a: i128, ring: &Ring) -> f64 {
        a as f64 / grid(ring)
    }
    fn sine(&self, phase: i128, table: &SineTable) -> f64 {
        // Reduced to an eighth of a turn in exact integers, so that the argument keeps all its
        // bits near the zeros of the sine.
        let octant = (phase as u128).wrapping_add(1 << 124) >> 125;
        let rest = phase.wrapping_sub((octant << 125) as i128);
        let angle = rest as f64 * pow2(-128) * std::f64::consts::TAU;
        let (sin, cos) = angle.sin_cos();
        let value = match octant & 7 {
            0 => sin,
            1 => (sin + cos) * std::f64::consts::FRAC_1_SQRT_2,
            2 => cos,
            3 => (cos - sin) * std::f64::consts::FRAC_1_SQRT_2,
            4 => -sin,
            5 => -(sin + cos) * std::f64::consts::FRAC_1_SQRT_2,
            6 => -cos,
            _ => (sin - cos) * std::f64::consts::FRAC_1_SQRT_2,
        };
        value * table.amplitude
    }

    fn lookup(&self, address: f64, table: &Table) -> f64 {
        // A conversion to an integer saturates at 0.
        let last = table.entries.len().saturating_sub(1);
        let entry = table.entries[(address.floor() as usize).min(last)];
        entry as f64 * pow2(-table.fraction_bits)
    }
    fn shift_right_by(&self, a: f64, index: u32) -> f64 {
        a * pow2(-(index as i32))
    }
    fn entry(&self, table: &IndexTable, index: u32) -> f64 {
        table.entries[index as usize] as f64 * pow2(-(table.fraction_bits as i32))
    }
    fn repeat<const S: usize, B: LoopBody<Self, S>>(
        &self,
        count: u32,
        mut state: [f64; S],
        mut radius: (),
        body: &B,
    ) -> [f64; S] {
        for index in 0..count {
            state = body.step(self, index, state, &mut radius);
        }
        state
    }
    fn within(&self, a: f64, _low: i128, _high: i128) -> f64 {
        a
    }
    fn radius(&self, _x: f64, _y: f64) {}
    fn bounded(&self, a: f64, _radius: ()) -> f64 {
        a
    }
    fn rotated(&self, _radius: (), _index: u32) {}
    fn wrapped_radius(&self, _radius: (), _width: u32) {}

    fn ideal_polar(&self, i: f64, q: f64) -> Option<[f64; 2]> {
        let turns = q.atan2(i) / std::f64::consts::TAU;
        // atan2 gives +pi on the negative axis; the phase is in [-1/2, 1/2).
        Some([if turns >= 0.5 { turns - 1.0 } else { turns }, i.hypot(q)])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cyclic_word_stays_in_its_half_open_interval() {
        for (a, expected) in [
            (0.5, -0.5),
            (-0.5, -0.5),
            (0.75, -0.25),
            (-0.75, 0.25),
            (7.25, 0.25),
            (0.49, 0.49),
        ] {
            assert_eq!(Float.wrap(a, 16, 16), expected, "{a}");
        }
        let just_below = 0.5 - f64::EPSILON / 4.0;
        assert!(Float.wrap(just_below, 16, 16) < 0.5);
    }

    #[test]
    fn the_sine_is_exact_at_any_phase() {
        let table = SineTable {
            entries: Vec::new().into(),
            address_bits: 10,
            phase_bits: 32,
            half_step: false,
            fraction_bits: 15,
            amplitude: 1.0,
        };
        for k in 0..4096u32 {
            let phase = ((u128::from(k) << 116) | 0x1234_5678) as i128;
            let expected = (f64::from(k) / 4096.0 * std::f64::consts::TAU).sin();
            assert!((Float.sine(phase, &table) - expected).abs() < 1e-15, "{k}");
        }
        assert_eq!(Float.sine(0, &table), 0.0);
        assert_eq!(Float.sine(1 << 127, &table), 0.0);
        assert_eq!(Float.sine(1 << 126, &table), 1.0);
    }

    #[test]
    fn a_ring_wraps_without_growing() {
        let ring = Ring {
            bits: 40,
            fraction_bits: 30,
            reach: 9,
        };
        let mut sum = Float.residue_constant(0, &ring);
        let step = Float.residue(300.3, &ring);
        for _ in 0..1_000_000 {
            sum = Float.residue_add(sum, step, &ring);
        }
        for _ in 0..1_000_000 {
            sum = Float.residue_sub(sum, step, &ring);
        }
        assert_eq!(sum, 0);
        let value = Float.centered(step, &ring);
        assert!((value - 300.3).abs() < 1e-13);
    }
}
