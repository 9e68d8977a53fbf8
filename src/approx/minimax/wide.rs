//! Double-double arithmetic: a number as the unevaluated sum of two doubles, some 106 bits.
//!
//! T. J. Dekker, "A floating-point technique for extending the available precision", Numerische
//! Mathematik 18 (1971); D. E. Knuth, TAOCP vol. 2, 4.2.2 (the two-sum). Relative errors are a few
//! 2^-104. Range and special values are those of a double; results above 1e290 are not to be trusted.

use std::cmp::Ordering;
use std::ops::{Add, AddAssign, Div, Mul, Neg, Sub, SubAssign};

/// `hi + lo`, with `|lo|` at most half a unit in the last place of `hi`.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Wide {
    /// The nearest double.
    pub hi: f64,
    /// What it lacks.
    pub lo: f64,
}

/// Sum and its exact error.
fn two_sum(a: f64, b: f64) -> (f64, f64) {
    let s = a + b;
    let t = s - a;
    (s, (a - (s - t)) + (b - t))
}

/// The same where `|a| >= |b|`.
fn quick_two_sum(a: f64, b: f64) -> (f64, f64) {
    let s = a + b;
    (s, b - (s - a))
}

/// A double as the sum of two with 26 bits each.
fn split(a: f64) -> (f64, f64) {
    const FACTOR: f64 = 134_217_729.0; // 2^27 + 1
    let t = FACTOR * a;
    let hi = t - (t - a);
    (hi, a - hi)
}

/// Product and its exact error. Not by `mul_add`, which is slow where the processor lacks it.
fn two_product(a: f64, b: f64) -> (f64, f64) {
    let p = a * b;
    let (ah, al) = split(a);
    let (bh, bl) = split(b);
    (p, ((ah * bh - p) + ah * bl + al * bh) + al * bl)
}

impl Wide {
    /// 0.
    pub const ZERO: Wide = Wide { hi: 0.0, lo: 0.0 };
    /// 1.
    pub const ONE: Wide = Wide { hi: 1.0, lo: 0.0 };

    /// The exact sum of two doubles, rounded to this type.
    pub fn sum(a: f64, b: f64) -> Wide {
        let (hi, lo) = two_sum(a, b);
        Wide { hi, lo }
    }

    /// The exact product of two doubles.
    pub fn product(a: f64, b: f64) -> Wide {
        let (hi, lo) = two_product(a, b);
        Wide { hi, lo }
    }

    /// An integer, exact up to 106 bits.
    pub fn from_integer(n: i128) -> Wide {
        let hi = n as f64;
        // `hi` may be 2^127, which an i128 does not hold: the cast saturates, one unit off at 127 bits.
        Wide::sum(hi, (n.wrapping_sub(hi as i128)) as f64)
    }

    /// The nearest double.
    pub fn to_f64(self) -> f64 {
        self.hi
    }

    /// True if it is a number.
    pub fn is_finite(self) -> bool {
        self.hi.is_finite() && self.lo.is_finite()
    }

    /// Magnitude.
    pub fn abs(self) -> Wide {
        if self.hi < 0.0 { -self } else { self }
    }

    /// Square root; 0 of what is not positive.
    pub fn sqrt(self) -> Wide {
        if self.hi <= 0.0 {
            return Wide::ZERO;
        }
        // One Newton step from the double (Karp's).
        let root = Wide::from(self.hi.sqrt());
        let correction = (self - root * root).hi / (2.0 * root.hi);
        root + Wide::from(correction)
    }

    /// Integer power.
    pub fn powi(self, exponent: u32) -> Wide {
        let (mut result, mut base, mut e) = (Wide::ONE, self, exponent);
        while e > 0 {
            if e & 1 == 1 {
                result = result * base;
            }
            base = base * base;
            e >>= 1;
        }
        result
    }

    /// Times a power of two (or any factor whose products are exact).
    pub fn scaled(self, power_of_two: f64) -> Wide {
        Wide {
            hi: self.hi * power_of_two,
            lo: self.lo * power_of_two,
        }
    }

    /// The nearest integer, ties to even of the leading part; None outside 2^120.
    pub fn round(self) -> Option<i128> {
        if !self.is_finite() || self.hi.abs() > 2f64.powi(120) {
            return None;
        }
        let whole = self.hi.round();
        let rest = (self.hi - whole) + self.lo;
        (whole as i128).checked_add(rest.round() as i128)
    }
}

impl From<f64> for Wide {
    fn from(hi: f64) -> Wide {
        Wide { hi, lo: 0.0 }
    }
}

impl Add for Wide {
    type Output = Wide;
    fn add(self, b: Wide) -> Wide {
        let (s, e) = two_sum(self.hi, b.hi);
        let (t, f) = two_sum(self.lo, b.lo);
        let (s, e) = quick_two_sum(s, e + t);
        let (hi, lo) = quick_two_sum(s, e + f);
        Wide { hi, lo }
    }
}

impl Sub for Wide {
    type Output = Wide;
    fn sub(self, b: Wide) -> Wide {
        self + -b
    }
}

impl Neg for Wide {
    type Output = Wide;
    fn neg(self) -> Wide {
        Wide {
            hi: -self.hi,
            lo: -self.lo,
        }
    }
}

impl Mul for Wide {
    type Output = Wide;
    fn mul(self, b: Wide) -> Wide {
        let (p, e) = two_product(self.hi, b.hi);
        let (hi, lo) = quick_two_sum(p, e + (self.hi * b.lo + self.lo * b.hi));
        Wide { hi, lo }
    }
}

impl Div for Wide {
    type Output = Wide;
    fn div(self, b: Wide) -> Wide {
        let first = self.hi / b.hi;
        let rest = self - b * Wide::from(first);
        let second = rest.hi / b.hi;
        let rest = rest - b * Wide::from(second);
        Wide::sum(first, second) + Wide::from(rest.hi / b.hi)
    }
}

impl AddAssign for Wide {
    fn add_assign(&mut self, b: Wide) {
        *self = *self + b;
    }
}

impl SubAssign for Wide {
    fn sub_assign(&mut self, b: Wide) {
        *self = *self - b;
    }
}

impl PartialOrd for Wide {
    fn partial_cmp(&self, b: &Wide) -> Option<Ordering> {
        match self.hi.partial_cmp(&b.hi) {
            Some(Ordering::Equal) => self.lo.partial_cmp(&b.lo),
            other => other,
        }
    }
}

/// Inner product.
pub fn dot(a: &[Wide], b: &[Wide]) -> Wide {
    a.iter()
        .zip(b)
        .fold(Wide::ZERO, |sum, (x, y)| sum + *x * *y)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Exact value of a double as an integer times 2^-200 (the arguments below are moderate).
    fn exact(x: Wide) -> dashu_int::IBig {
        let part = |v: f64| -> dashu_int::IBig {
            let bits = v.to_bits();
            let exponent = ((bits >> 52) & 0x7ff) as i32;
            if exponent == 0 {
                return dashu_int::IBig::ZERO;
            }
            let mantissa = dashu_int::IBig::from((bits & ((1 << 52) - 1)) | (1 << 52));
            let shift = exponent - 1075 + 400;
            let magnitude = mantissa << usize::try_from(shift).unwrap();
            if v < 0.0 { -magnitude } else { magnitude }
        };
        part(x.hi) + part(x.lo)
    }

    fn close(found: Wide, truth: dashu_int::IBig, shift: usize) -> bool {
        let difference = (exact(found) << shift) - truth.clone();
        let size = |v: &dashu_int::IBig| {
            if *v < dashu_int::IBig::ZERO {
                -v
            } else {
                v.clone()
            }
        };
        (size(&difference) << 100) <= size(&truth)
    }

    proptest! {
        #[test]
        fn operations_are_good_to_100_bits(a in 1e-3..1e3f64, b in 1e-3..1e3f64, c in -1.0..1.0f64, d in -1.0..1.0f64) {
            let x = Wide::sum(a, a * c * 1e-17);
            let y = Wide::sum(-b, b * d * 1e-17);
            prop_assert!(close(x * y, exact(x) * exact(y), 400));
            prop_assert!(close(x - y, exact(x) - exact(y), 0));
            let q = x / y;
            prop_assert!(((q * y - x).hi / x.hi).abs() < 1e-30);
            let s = x.sqrt();
            prop_assert!(((s * s - x).hi / x.hi).abs() < 1e-30);
        }
    }

    #[test]
    fn integers_and_rounding() {
        let n = (1i128 << 100) + 12_345_678_901;
        assert_eq!(Wide::from_integer(n).round(), Some(n));
        assert_eq!(Wide::sum(2f64.powi(60), -0.25).round(), Some(1 << 60));
        assert_eq!(Wide::from(1e40).round(), None);
        assert_eq!(Wide::from(3.0).powi(5).hi, 243.0);
    }
}
