//! The integers nearest to sines, arc tangents and the CORDIC gain, decided in 256-bit arithmetic.
//!
//! Double precision alone would leave some 40-bit table entries and most 64-bit angles undecided.
//! No tie can occur: at dyadic fractions of a turn the sine is 0, +-1 or irrational (Niven), and
//! atan(2^-i) / 2 pi is 1/8 for i = 0 and irrational else.

use dashu_float::FBig;
use dashu_float::round::mode::HalfEven;
use dashu_int::IBig;
use std::collections::BTreeMap;
use std::sync::{Mutex, PoisonError};

type Real = FBig<HalfEven, 2>;

/// Bits of the working precision.
const PRECISION: usize = 256;

/// Constants that have been decided, by what they depend on.
type Decided = Mutex<BTreeMap<(u32, u32), i64>>;

/// The constant of `key`, decided at its first use: a search asks for the same few with every design, and each
/// takes about 0.1 ms.
fn once(decided: &Decided, key: (u32, u32), decide: impl FnOnce() -> i64) -> i64 {
    let known = || decided.lock().unwrap_or_else(PoisonError::into_inner);
    if let Some(constant) = known().get(&key) {
        return *constant;
    }
    let constant = decide();
    known().insert(key, constant);
    constant
}

fn real(value: i128) -> Real {
    Real::from(IBig::from(value))
        .with_precision(PRECISION)
        .value()
}

fn nearest(value: &Real) -> i128 {
    let rounded: IBig = value.round().to_int().value();
    // Every constant of a design has at most 64 bits.
    i128::try_from(rounded).unwrap_or(0)
}

fn power_of_two(exponent: u32) -> Real {
    Real::from_parts(IBig::ONE, exponent as isize)
        .with_precision(PRECISION)
        .value()
}

/// pi to the working precision.
fn pi() -> Real {
    Real::pi(PRECISION)
}

/// One turn of a sine: entry k is the integer nearest to `(2^(bits-1) - 1) * sin(2 pi k / 2^a)`.
///
/// `address_bits` is a (2..=16), `bits` the width of an entry (2..=40).
pub fn sine_table(address_bits: u32, bits: u32) -> Vec<i64> {
    let peak = (1i64 << (bits - 1)) - 1;
    let count = 1usize << address_bits;
    let quarter: Vec<i64> = (0..=count / 4)
        .map(|k| sine_entry(k, count, peak))
        .collect();
    (0..count)
        .map(|k| {
            let (half, rest) = (k / (count / 2), k % (count / 2));
            let folded = rest.min(count / 2 - rest);
            if half == 0 {
                quarter[folded]
            } else {
                -quarter[folded]
            }
        })
        .collect()
}

/// The entry in the first quarter: double precision where that decides it, else 256 bits.
fn sine_entry(k: usize, count: usize, peak: i64) -> i64 {
    let estimate = peak as f64 * (std::f64::consts::TAU * k as f64 / count as f64).sin();
    // The estimate is within a few parts in 2^52 of the peak.
    let doubt = peak as f64 * f64::EPSILON * 8.0 + f64::EPSILON;
    let to_tie = ((estimate - estimate.floor()) - 0.5).abs();
    if to_tie > doubt {
        return estimate.round() as i64;
    }
    let angle = pi() * real(2 * k as i128) / real(count as i128);
    nearest(&(real(i128::from(peak)) * angle.sin())) as i64
}

/// Entry i is the integer nearest to `atan(2^-i) / (2 pi) * 2^angle_bits`.
pub fn arc_tangents(iterations: u32, angle_bits: u32) -> Vec<i64> {
    static DECIDED: Decided = Mutex::new(BTreeMap::new());
    let decide = |i| {
        if i == 0 {
            return 1i64 << (angle_bits - 3);
        }
        let tangent = real(1) / power_of_two(i);
        nearest(&(tangent.atan() * power_of_two(angle_bits) / (pi() * real(2)))) as i64
    };
    (0..iterations)
        .map(|i| once(&DECIDED, (i, angle_bits), || decide(i)))
        .collect()
}

/// The integer nearest to `2^gain_bits / prod over i = 0..n-1 of sqrt(1 + 4^-i)`: what a CORDIC
/// magnitude after n iterations is multiplied by.
pub fn cordic_gain(iterations: u32, gain_bits: u32) -> i64 {
    static DECIDED: Decided = Mutex::new(BTreeMap::new());
    once(&DECIDED, (iterations, gain_bits), || {
        let mut square = real(1);
        for i in 0..iterations {
            square *= real(1) + real(1) / power_of_two(2 * i);
        }
        let root = dashu_float::ops::SquareRoot::sqrt(&square);
        nearest(&(power_of_two(gain_bits) / root)) as i64
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_table_is_symmetric_and_near_the_sine() {
        for (a, bits) in [(2, 2), (4, 16), (10, 16), (12, 40)] {
            let table = sine_table(a, bits);
            let n = table.len();
            let peak = ((1i64 << (bits - 1)) - 1) as f64;
            assert_eq!((table[0], table[n / 4] as f64), (0, peak));
            for k in 0..n {
                assert_eq!(table[k], -table[(k + n / 2) % n]);
                let exact = peak * (std::f64::consts::TAU * k as f64 / n as f64).sin();
                assert!(
                    (table[k] as f64 - exact).abs() < 0.5 + peak * 1e-15,
                    "{a} {bits} {k}"
                );
            }
        }
    }

    /// The estimate's shortcut never decides against the long arithmetic.
    #[test]
    fn the_shortcut_agrees_with_the_long_arithmetic() {
        let count = 1 << 8;
        for bits in [8, 16, 33, 40] {
            let peak = (1i64 << (bits - 1)) - 1;
            for k in 0..=count / 4 {
                let angle = pi() * real(2 * k as i128) / real(count as i128);
                let long = nearest(&(real(i128::from(peak)) * angle.sin())) as i64;
                assert_eq!(sine_entry(k, count, peak), long, "{bits} {k}");
            }
        }
    }

    /// Known values: atan(1/2)/2pi and atan(1/4)/2pi in 64 bits (Machin-like sums cross-check them),
    /// and the CORDIC gain 0.607252935008881256...
    #[test]
    fn angles_and_gain_are_right_to_the_last_bit() {
        let angles = arc_tangents(30, 64);
        assert_eq!(angles[0], 1 << 61);
        // pi/4 = atan(1/2) + atan(1/3) = 2 atan(1/2) - atan(1/7); compare through doubles first.
        for (i, a) in angles.iter().enumerate() {
            let exact =
                f64::powi(2.0, -(i as i32)).atan() / std::f64::consts::TAU * f64::powi(2.0, 64);
            assert!((*a as f64 - exact).abs() <= exact * 4e-16 + 1.0, "{i}");
        }
        // pi/4 = 12 atan(1/18) + 8 atan(1/57) - 5 atan(1/239) needs no table angle; the duplication
        // atan(1/2) = pi/4 - atan(1/3) in long arithmetic gives the same integer.
        let third = (real(1) / real(3)).atan();
        let half = pi() / real(4) - third;
        let integer = nearest(&(half * power_of_two(64) / (pi() * real(2))));
        assert_eq!(i128::from(angles[1]), integer);
        let gain = cordic_gain(30, 62) as f64 / f64::powi(2.0, 62);
        assert!((gain - 0.607_252_935_008_881_2).abs() < 1e-15, "{gain}");
        assert_eq!(cordic_gain(16, 16), 39797);
    }
}
