//! pi, log 2 and the inverse factorials, from integer series with counted errors.

use std::sync::LazyLock;

use dashu_int::IBig;

use super::interval::Interval;

/// Fraction bits of the integer series.
const BITS: usize = 256;

/// pi.
pub static PI: LazyLock<Interval> = LazyLock::new(|| {
    // Machin: pi = 16 atan(1/5) - 4 atan(1/239).
    let (fifth, error) = inverse_series(5, true);
    let (rest, more) = inverse_series(239, true);
    enclosing(&(fifth * 16 - rest * 4), error * 16 + more * 4)
});
/// pi / 2.
pub static HALF_PI: LazyLock<Interval> = LazyLock::new(|| PI.scaled(-1));
/// log 2.
pub static LOG_2: LazyLock<Interval> = LazyLock::new(|| {
    // log 2 = 2 atanh(1/3).
    let (sum, error) = inverse_series(3, false);
    enclosing(&(sum * 2), error * 2)
});
/// `1 / n!` for n = 0..=40.
pub static INVERSE_FACTORIALS: LazyLock<Vec<Interval>> = LazyLock::new(|| {
    let mut factorial = IBig::ONE;
    (0..=40)
        .map(|n| {
            factorial *= IBig::from(if n == 0 { 1 } else { n });
            Interval::from_ratio(&IBig::ONE, &factorial)
        })
        .collect()
});
/// `1 / n` for n = 0..=40 (0 for n = 0).
pub static INVERSES: LazyLock<Vec<Interval>> = LazyLock::new(|| {
    (0..=40)
        .map(|n| match n {
            0 => Interval::ZERO,
            n => Interval::from_ratio(&IBig::ONE, &IBig::from(n)),
        })
        .collect()
});

/// `atan(1/q)` (alternating) or `atanh(1/q)` in units of 2^-BITS, and the bound of its error.
///
/// Every term is cut by less than 1 twice (the power and the quotient); what is left out after the
/// last term that is not 0 is below 1, because the terms fall by at least 1/9 each.
fn inverse_series(q: i32, alternating: bool) -> (IBig, i64) {
    let mut power = (IBig::ONE << BITS) / q;
    let (mut sum, mut n, mut error) = (IBig::ZERO, 1i64, 2i64);
    while power != IBig::ZERO {
        let term = &power / n;
        if alternating && n % 4 == 3 {
            sum -= term;
        } else {
            sum += term;
        }
        power /= q * q;
        n += 2;
        // A cut power is less than 9/8 below the true one: each cut is divided by q^2 at every step.
        error += 3;
    }
    (sum, error)
}

/// All numbers within `error` of `sum`, in units of 2^-BITS.
fn enclosing(sum: &IBig, error: i64) -> Interval {
    let unit = IBig::ONE << BITS;
    let low = Interval::from_ratio(&(sum - error), &unit);
    let high = Interval::from_ratio(&(sum + error), &unit);
    Interval::new(low.low, high.high)
}
