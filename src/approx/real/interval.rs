//! Rigorous intervals: ends of about 106 bits, every operation rounded outwards.
//!
//! An end that is not known is infinite; an operation that is not defined on all of its arguments
//! returns the whole line, so that a bound is never too small. Whoever needs the reason asks first
//! ([`super::jet`]).

use std::ops::{Add, Div, Mul, Neg, Sub};

use dashu_int::IBig;

use super::wide::{Toward, Wide};

/// All real numbers from `low` to `high`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Interval {
    /// The lower end, at most the upper one.
    pub low: Wide,
    /// The upper end.
    pub high: Wide,
}

impl From<f64> for Interval {
    /// The point; the whole line if it is not finite.
    fn from(value: f64) -> Self {
        Interval::from(Wide::from(value))
    }
}

impl From<Wide> for Interval {
    fn from(value: Wide) -> Self {
        if value.is_finite() {
            Interval {
                low: value,
                high: value,
            }
        } else {
            Interval::WHOLE
        }
    }
}

impl Interval {
    /// The point 0.
    pub const ZERO: Interval = Interval {
        low: Wide::ZERO,
        high: Wide::ZERO,
    };
    /// The point 1.
    pub const ONE: Interval = Interval {
        low: Wide::ONE,
        high: Wide::ONE,
    };
    /// Nothing is known.
    pub const WHOLE: Interval = Interval {
        low: Wide::NEGATIVE_INFINITY,
        high: Wide::INFINITY,
    };

    /// From `low` to `high`, in this order.
    pub fn new(low: Wide, high: Wide) -> Interval {
        Interval { low, high }
    }

    /// `[-radius, radius]`.
    pub fn symmetric(radius: f64) -> Interval {
        Interval::new(Wide::from(-radius.abs()), Wide::from(radius.abs()))
    }

    /// `numerator / denominator` to 104 bits; exact where 104 bits suffice. The denominator is positive.
    pub fn from_ratio(numerator: &IBig, denominator: &IBig) -> Interval {
        if *numerator < IBig::ZERO {
            return -Interval::from_ratio(&-numerator, denominator);
        }
        let bits = |n: &IBig| dashu_int::ops::BitTest::bit_len(n) as i64;
        if *numerator == IBig::ZERO || *denominator <= IBig::ZERO {
            return match *denominator > IBig::ZERO {
                true => Interval::ZERO,
                false => Interval::WHOLE,
            };
        }
        let shift = 104 - (bits(numerator) - bits(denominator));
        let (top, bottom) = match shift >= 0 {
            true => (numerator << shift as usize, denominator.clone()),
            false => (numerator.clone(), denominator << (-shift) as usize),
        };
        let quotient = &top / &bottom;
        let exact = &quotient * &bottom == top;
        let Ok(quotient) = u128::try_from(&quotient) else {
            return Interval::WHOLE;
        };
        let Ok(exponent) = i32::try_from(-shift) else {
            return Interval::WHOLE;
        };
        if !(-1950..=1950).contains(&exponent) {
            return Interval::WHOLE;
        }
        let end = |n: u128, toward| of_105_bits(n).scaled(exponent, toward);
        Interval::new(
            end(quotient, Toward::Down),
            end(quotient + u128::from(!exact), Toward::Up),
        )
    }

    /// `raw * 2^-fraction_bits`.
    pub fn from_dyadic(raw: i128, fraction_bits: i32) -> Interval {
        let magnitude = raw.unsigned_abs();
        let drop = (128 - magnitude.leading_zeros()).saturating_sub(104);
        let kept = magnitude >> drop;
        let more = u128::from(kept << drop != magnitude);
        let exponent = drop as i32 - fraction_bits.clamp(-1800, 1800);
        let value = Interval::new(
            of_105_bits(kept).scaled(exponent, Toward::Down),
            of_105_bits(kept + more).scaled(exponent, Toward::Up),
        );
        if raw < 0 { -value } else { value }
    }

    /// A small integer.
    pub fn from_integer(value: i32) -> Interval {
        Interval::from(f64::from(value))
    }

    /// Whether both ends are finite.
    pub fn is_bounded(self) -> bool {
        self.low.is_finite() && self.high.is_finite()
    }

    /// Whether it is one number.
    pub fn is_point(self) -> bool {
        self.low == self.high
    }

    /// Whether `value` lies in it.
    pub fn contains(self, value: Wide) -> bool {
        self.low <= value && value <= self.high
    }

    /// Whether all of `other` lies in it.
    pub fn encloses(self, other: Interval) -> bool {
        self.low <= other.low && other.high <= self.high
    }

    /// Whether 0 lies in it.
    pub fn contains_zero(self) -> bool {
        self.low <= Wide::ZERO && Wide::ZERO <= self.high
    }

    /// A number in the middle (rounded, but inside); 0 if an end is infinite.
    pub fn middle(self) -> Wide {
        if !self.is_bounded() {
            return Wide::ZERO;
        }
        if self.is_point() {
            return self.low;
        }
        let half = |w: Wide| w.scaled(-1, Toward::Down);
        half(self.low)
            .add(half(self.high), Toward::Down)
            .max(self.low)
            .min(self.high)
    }

    /// At least half the width, as a double; infinite if an end is.
    pub fn radius(self) -> f64 {
        let middle = self.middle();
        let up = self.high.sub(middle, Toward::Up).ceil_f64();
        up.max(middle.sub(self.low, Toward::Up).ceil_f64())
    }

    /// At least every magnitude in it, as a double.
    pub fn magnitude(self) -> f64 {
        self.low.abs().max(self.high.abs()).ceil_f64()
    }

    /// At most every magnitude in it, as a double.
    pub fn mignitude(self) -> f64 {
        if self.contains_zero() {
            0.0
        } else {
            self.low.abs().min(self.high.abs()).floor_f64()
        }
    }

    /// The smallest interval with both.
    pub fn hull(self, other: Interval) -> Interval {
        Interval::new(self.low.min(other.low), self.high.max(other.high))
    }

    /// What both have in common; `self` if nothing (two enclosures of one number always meet).
    pub fn meet(self, other: Interval) -> Interval {
        let both = Interval::new(self.low.max(other.low), self.high.min(other.high));
        if both.low <= both.high { both } else { self }
    }

    /// All magnitudes.
    pub fn abs(self) -> Interval {
        if self.low >= Wide::ZERO {
            self
        } else if self.high <= Wide::ZERO {
            -self
        } else {
            Interval::new(Wide::ZERO, (-self.low).max(self.high))
        }
    }

    /// All squares.
    pub fn square(self) -> Interval {
        let a = self.abs();
        Interval::new(
            a.low.mul(a.low, Toward::Down).max(Wide::ZERO),
            a.high.mul(a.high, Toward::Up),
        )
    }

    /// The roots of what is not negative in it; the whole line if nothing is.
    pub fn sqrt(self) -> Interval {
        if self.high >= Wide::ZERO {
            Interval::new(
                self.low.max(Wide::ZERO).sqrt(Toward::Down),
                self.high.sqrt(Toward::Up),
            )
        } else {
            Interval::WHOLE
        }
    }

    /// All numbers times 2^exponent.
    pub fn scaled(self, exponent: i32) -> Interval {
        Interval::new(
            self.low.scaled(exponent, Toward::Down),
            self.high.scaled(exponent, Toward::Up),
        )
    }

    /// All n-th powers; the whole line for n < 0 if it contains 0.
    pub fn power(self, n: i32) -> Interval {
        if n < 0 {
            return Interval::ONE / self.power_of(n.unsigned_abs());
        }
        self.power_of(n.unsigned_abs())
    }

    fn power_of(self, n: u32) -> Interval {
        let mut base = if n.is_multiple_of(2) {
            self.abs()
        } else {
            self
        };
        // Of one sign, or odd: the power is monotonic in both ends.
        if n % 2 == 1 && self.low < Wide::ZERO && self.high > Wide::ZERO {
            let (low, high) = (Interval::from(self.low), Interval::from(self.high));
            return Interval::new(low.power_of(n).low, high.power_of(n).high);
        }
        let mut n = n;
        let mut product = Interval::ONE;
        while n > 0 {
            if n % 2 == 1 {
                product = product * base;
            }
            n /= 2;
            if n > 0 {
                base = base.square();
            }
        }
        product
    }
}

/// A number of at most 105 bits: two doubles hold it exactly.
fn of_105_bits(n: u128) -> Wide {
    let (upper, lower) = ((n >> 53) as f64, (n & ((1 << 53) - 1)) as f64);
    Wide::of_sum(upper * 9_007_199_254_740_992.0, lower)
}

impl Neg for Interval {
    type Output = Interval;
    fn neg(self) -> Interval {
        Interval::new(-self.high, -self.low)
    }
}

impl Add for Interval {
    type Output = Interval;
    fn add(self, other: Interval) -> Interval {
        Interval::new(
            self.low.add(other.low, Toward::Down),
            self.high.add(other.high, Toward::Up),
        )
    }
}

impl Sub for Interval {
    type Output = Interval;
    fn sub(self, other: Interval) -> Interval {
        self + -other
    }
}

impl Mul for Interval {
    type Output = Interval;
    fn mul(self, other: Interval) -> Interval {
        let (a, b) = (self, other);
        if a.low >= Wide::ZERO {
            let below = if b.low >= Wide::ZERO { a.low } else { a.high };
            let above = if b.high >= Wide::ZERO { a.high } else { a.low };
            return Interval::new(
                below.mul(b.low, Toward::Down),
                above.mul(b.high, Toward::Up),
            );
        }
        if a.high <= Wide::ZERO {
            return -(-a * b);
        }
        if b.low >= Wide::ZERO || b.high <= Wide::ZERO {
            return b * a;
        }
        let low = a.low.mul(b.high, Toward::Down);
        let high = a.low.mul(b.low, Toward::Up);
        Interval::new(
            low.min(a.high.mul(b.low, Toward::Down)),
            high.max(a.high.mul(b.high, Toward::Up)),
        )
    }
}

impl Div for Interval {
    type Output = Interval;
    /// The whole line if `other` contains 0.
    fn div(self, other: Interval) -> Interval {
        if other.low > Wide::ZERO && self.is_bounded() && other.is_bounded() {
            let below = if self.low >= Wide::ZERO {
                other.high
            } else {
                other.low
            };
            let above = if self.high >= Wide::ZERO {
                other.low
            } else {
                other.high
            };
            Interval::new(
                self.low.div(below, Toward::Down),
                self.high.div(above, Toward::Up),
            )
        } else if other.high < Wide::ZERO {
            -(self / -other)
        } else {
            Interval::WHOLE
        }
    }
}
