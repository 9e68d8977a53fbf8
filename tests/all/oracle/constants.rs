//! Constants "nearest integer to", decided in 192-bit fixed point.
//!
//! None of them can be a tie (sines and arc tangents at these arguments are
//! whole multiples of the unit or irrational), so "nearest" is decided by the
//! sign of a remainder; `nearest` checks that the series leave no doubt.

use std::sync::OnceLock;

use num_bigint::BigInt;

use super::number::Format;

/// Fraction bits of the fixed-point numbers in this file.
const FRACTION: u32 = 192;

/// Address bits of the finest sine table; every other one is a part of it.
const FINEST: u32 = 16;

fn one() -> BigInt {
    BigInt::from(1) << FRACTION
}

fn multiply(a: &BigInt, b: &BigInt) -> BigInt {
    (a * b) >> FRACTION
}

/// The nearest integer to `numerator / denominator` (both > 0), where the
/// fraction is known to about 2^-150; an undecidable case is a bug.
fn nearest(numerator: &BigInt, denominator: &BigInt) -> BigInt {
    let floor = numerator / denominator;
    let remainder = numerator - &floor * denominator;
    let twice: BigInt = &remainder * 2;
    let distance = (&twice - denominator).magnitude().clone();
    let doubt = denominator.magnitude() >> 60u32;
    assert!(distance > doubt, "undecided rounding of a constant");
    if twice > *denominator {
        floor + 1
    } else {
        floor
    }
}

/// atan(1 / q) by its power series.
fn atan_inverse(q: u64) -> BigInt {
    let mut power = one() / q;
    let mut sum = power.clone();
    let square = BigInt::from(q) * q;
    let mut k = 1u64;
    while power != BigInt::from(0) {
        power /= &square;
        let term = &power / (2 * k + 1);
        if k % 2 == 1 {
            sum -= term;
        } else {
            sum += term;
        }
        k += 1;
    }
    sum
}

/// pi by Machin's formula, 16 atan(1/5) - 4 atan(1/239).
fn pi() -> BigInt {
    atan_inverse(5) * 16 - atan_inverse(239) * 4
}

/// sin and cos of a small angle (fixed point) by their power series.
pub fn sin_cos_series(angle: &BigInt) -> (BigInt, BigInt) {
    let (mut sin, mut cos) = (BigInt::from(0), BigInt::from(0));
    let mut term = one(); // angle^k / k!
    let mut k = 0u64;
    while term != BigInt::from(0) {
        match k % 4 {
            0 => cos += &term,
            1 => sin += &term,
            2 => cos -= &term,
            _ => sin -= &term,
        }
        k += 1;
        term = multiply(&term, angle) / k;
    }
    (sin, cos)
}

/// The angle of step `k` of the finest table, 2 pi k / 2^16, in fixed point.
pub fn finest_angle(k: u64) -> BigInt {
    (pi() * 2 * k) >> FINEST
}

/// sin(2 pi k / 2^16) for k = 0 ..= 2^14, in fixed point, by rotating in single
/// steps (16384 steps lose less than 2^-176).
pub fn finest_quarter() -> &'static [BigInt] {
    static QUARTER: OnceLock<Vec<BigInt>> = OnceLock::new();
    QUARTER.get_or_init(|| {
        let (step_sin, step_cos) = sin_cos_series(&finest_angle(1));
        let (mut sin, mut cos) = (BigInt::from(0), one());
        let steps = 1usize << (FINEST - 2);
        let mut quarter = Vec::with_capacity(steps + 1);
        for _ in 0..steps {
            let next_sin = multiply(&sin, &step_cos) + multiply(&cos, &step_sin);
            cos = multiply(&cos, &step_cos) - multiply(&sin, &step_sin);
            quarter.push(std::mem::replace(&mut sin, next_sin));
        }
        quarter.push(one());
        quarter
    })
}

/// `nco.table`: entry k = nearest integer to (2^(bits-1)-1) * sin(2 pi k / 2^a).
pub fn sine_table(format: Format, address_bits: u32) -> Vec<i128> {
    let amplitude = format.greatest();
    let stride = 1usize << (FINEST - address_bits);
    let quarter = finest_quarter();
    let quarter_size = (1usize << address_bits) / 4;
    let first: Vec<i128> = (0..=quarter_size)
        .map(|k| {
            let scaled = &quarter[k * stride] * amplitude;
            i128::try_from(nearest(&scaled, &one())).expect("at most 40 bits")
        })
        .collect();
    (0..4 * quarter_size)
        .map(|k| {
            let (turn, at) = (k / quarter_size, k % quarter_size);
            match turn {
                0 => first[at],
                1 => first[quarter_size - at],
                2 => -first[at],
                _ => -first[quarter_size - at],
            }
        })
        .collect()
}

/// `atan_i`: nearest integer to atan(2^-i) / (2 pi) * 2^angle_bits, i = 0 .. n-1.
pub fn atan_table(iterations: u32, angle_bits: u32) -> Vec<i128> {
    let two_pi = pi() * 2;
    (0..iterations)
        .map(|i| {
            if i == 0 {
                return 1i128 << (angle_bits - 3); // atan(1) is an eighth of a turn
            }
            let scaled = atan_inverse(1u64 << i) << angle_bits;
            i128::try_from(nearest(&scaled, &two_pi)).expect("at most 64 bits")
        })
        .collect()
}

/// The magnitude constant: nearest integer to
/// 2^gain_bits / prod over i = 0..n-1 of sqrt(1 + 4^-i), in integers alone.
pub fn magnitude_constant(iterations: u32, gain_bits: u32) -> i128 {
    // The square of the constant is 4^gain_bits * prod 4^i / prod (4^i + 1).
    let mut numerator = BigInt::from(1) << (2 * gain_bits);
    let mut denominator = BigInt::from(1);
    for i in 0..iterations {
        numerator <<= 2 * i;
        denominator *= (BigInt::from(1) << (2 * i)) + 1;
    }
    // floor(2 c) of the real constant c; it is irrational or not a tie.
    let square: BigInt = numerator * 4 / denominator;
    let twice = square.sqrt();
    i128::try_from((twice + 1) / 2).expect("at most 63 bits")
}
