//! Elementary functions of intervals, from series with their remainders.
//!
//! Every function is first enclosed at a point (argument reduction, then a Taylor polynomial whose
//! last coefficient encloses Lagrange's remainder), then over an interval by monotonic pieces.
//! Library functions in double precision only propose where a Newton step starts: their
//! error cannot make a result wrong.

use super::constants::{HALF_PI, INVERSE_FACTORIALS, INVERSES, LOG_2, PI};
use super::interval::Interval;
use super::wide::{Toward, Wide};

/// Terms of exp for |r| <= 0.6: 0.6^28 / 28! < 2^-110.
const EXP_TERMS: usize = 28;
/// Terms of sine and cosine for |r| <= 1: 1 / 31! < 2^-110.
const TURN_TERMS: usize = 15;
/// Terms of atan and atanh for |s| <= 2^-9: 2^-18*7 < 2^-110.
const SMALL_TERMS: usize = 7;

fn inverse_factorial(n: usize) -> Interval {
    INVERSE_FACTORIALS
        .get(n)
        .copied()
        .unwrap_or(Interval::WHOLE)
}

fn inverse(n: usize) -> Interval {
    INVERSES.get(n).copied().unwrap_or(Interval::WHOLE)
}

fn interval(low: f64, high: f64) -> Interval {
    Interval::new(Wide::from(low), Wide::from(high))
}

/// From the enclosures at both ends of a rising function.
fn rising(x: Interval, at: impl Fn(Wide) -> Interval) -> Interval {
    let low = at(x.low);
    if x.is_point() {
        return low;
    }
    Interval::new(low.low, at(x.high).high)
}

fn exp_at(x: Wide) -> Interval {
    let start = x.to_f64();
    if start > 700.0 {
        return Interval::new(Wide::from(1e300), Wide::INFINITY);
    }
    if start < -650.0 {
        return interval(0.0, 1e-280);
    }
    if x.is_zero() {
        return Interval::ONE;
    }
    let k = (start / std::f64::consts::LN_2).round();
    let r = Interval::from(x) - Interval::from(k) * *LOG_2;
    if r.magnitude() > 0.6 {
        return Interval::new(Wide::ZERO, Wide::INFINITY);
    }
    // Lagrange: the last coefficient times exp of something within +-0.6.
    let mut sum = inverse_factorial(EXP_TERMS) * interval(0.5, 2.0);
    for n in (0..EXP_TERMS).rev() {
        sum = sum * r + inverse_factorial(n);
    }
    sum.scaled(k as i32)
}

/// Sine and cosine of something within +-1.
fn small_turn(r: Interval) -> (Interval, Interval) {
    let z = r.square();
    // The remainders are at most the next terms in magnitude.
    let mut sine = inverse_factorial(2 * TURN_TERMS + 1) * interval(-1.0, 1.0);
    let mut cosine = inverse_factorial(2 * TURN_TERMS) * interval(-1.0, 1.0);
    for j in (0..TURN_TERMS).rev() {
        sine = inverse_factorial(2 * j + 1) - sine * z;
        cosine = inverse_factorial(2 * j) - cosine * z;
    }
    (sine * r, cosine)
}

/// Sine and cosine at a point.
fn turn_at(x: Wide) -> (Interval, Interval) {
    let all = interval(-1.0, 1.0);
    let start = x.to_f64();
    if start.is_nan() || start.abs() >= 1e9 {
        return (all, all);
    }
    let k = (start / std::f64::consts::FRAC_PI_2).round();
    let r = Interval::from(x) - Interval::from(k) * *HALF_PI;
    if r.magnitude() > 1.0 {
        return (all, all);
    }
    let (sine, cosine) = small_turn(r);
    let (sine, cosine) = match (k as i64).rem_euclid(4) {
        0 => (sine, cosine),
        1 => (cosine, -sine),
        2 => (-sine, -cosine),
        _ => (-cosine, sine),
    };
    (sine.meet(all), cosine.meet(all))
}

/// `atan s` (alternating) or `atanh s` for |s| <= 2^-9.
fn small_arc(s: Interval, alternating: bool) -> Interval {
    let z = if alternating { -s.square() } else { s.square() };
    // What follows is between 0 and the next term times 1 / (1 - s^2).
    let mut sum = inverse(2 * SMALL_TERMS + 1) * interval(0.0, 1.01);
    for j in (0..SMALL_TERMS).rev() {
        sum = sum * z + inverse(2 * j + 1);
    }
    sum * s
}

const SMALL: f64 = 1.0 / 512.0;

fn log_at(x: Wide) -> Interval {
    if x <= Wide::ZERO {
        return Interval::new(Wide::NEGATIVE_INFINITY, Wide::INFINITY);
    }
    if !x.is_finite() {
        return Interval::new(Wide::from(700.0), Wide::INFINITY);
    }
    let bits = x.to_f64().to_bits();
    let exponent = ((bits >> 52) & 0x7ff) as i32 - 1023;
    let top = f64::from_bits((bits & ((1 << 52) - 1)) | (1023 << 52));
    let exponent = exponent + i32::from(top > 1.4);
    if exponent < -1000 {
        return Interval::new(Wide::NEGATIVE_INFINITY, Wide::from(-690.0));
    }
    let m = Interval::from(x).scaled(-exponent);
    let start = match m.low.to_f64() {
        near if (near - 1.0).abs() < SMALL => 0.0,
        other => other.ln(),
    };
    // log m = start + log(m exp(-start)), the latter from log v = 2 atanh((v - 1) / (v + 1)).
    let v = match start {
        0.0 => m,
        start => m * exp_at(Wide::from(-start)),
    };
    let s = (v - Interval::ONE) / (v + Interval::ONE);
    if s.magnitude() > SMALL {
        return Interval::WHOLE;
    }
    Interval::from(start)
        + small_arc(s, false).scaled(1)
        + Interval::from_integer(exponent) * *LOG_2
}

fn atan_at(x: Wide) -> Interval {
    let quarter = Interval::new(-HALF_PI.high, HALF_PI.high);
    if !x.is_finite() {
        return quarter;
    }
    let x = Interval::from(x);
    if x.magnitude() <= SMALL {
        return small_arc(x, true);
    }
    // atan x = start + atan d with d = tan(atan x - start): no other branch, because
    // cos(atan x - start) > 0 is checked.
    let start = x.low.to_f64().atan();
    let (sine, cosine) = turn_at(Wide::from(start));
    let below = cosine + x * sine;
    if below.low <= Wide::ZERO {
        return quarter;
    }
    let d = (x * cosine - sine) / below;
    if d.magnitude() > SMALL {
        return quarter;
    }
    (Interval::from(start) + small_arc(d, true)).meet(quarter)
}

impl Interval {
    /// The exponential.
    pub fn exp(self) -> Interval {
        rising(self, exp_at).meet(Interval::new(Wide::ZERO, Wide::INFINITY))
    }

    /// The natural logarithm of what is positive in it; the whole line if nothing is.
    pub fn log(self) -> Interval {
        if self.high <= Wide::ZERO {
            return Interval::WHOLE;
        }
        rising(self, log_at)
    }

    /// Sine and cosine at once.
    pub fn sine_and_cosine(self) -> (Interval, Interval) {
        let (sine, cosine) = turn_at(self.low);
        if self.is_point() {
            return (sine, cosine);
        }
        let all = interval(-1.0, 1.0);
        let (low, high) = (self.low.floor_f64(), self.high.ceil_f64());
        if !(high - low < 6.0 && low.abs() < 1e8 && high.abs() < 1e8) {
            return (all, all);
        }
        let (sine_too, cosine_too) = turn_at(self.high);
        let (mut sine, mut cosine) = (sine.hull(sine_too), cosine.hull(cosine_too));
        // Extrema of sine at odd, of cosine at even multiples of pi / 2.
        let first = (low / std::f64::consts::FRAC_PI_2).floor() - 1.0;
        let last = (high / std::f64::consts::FRAC_PI_2).ceil() + 1.0;
        let mut k = first;
        while k <= last {
            let place = Interval::from(k) * *HALF_PI;
            if place.high >= self.low && place.low <= self.high {
                match (k as i64).rem_euclid(4) {
                    0 => cosine.high = Wide::ONE,
                    1 => sine.high = Wide::ONE,
                    2 => cosine.low = -Wide::ONE,
                    _ => sine.low = -Wide::ONE,
                }
            }
            k += 1.0;
        }
        (sine.meet(all), cosine.meet(all))
    }

    /// The sine.
    pub fn sin(self) -> Interval {
        self.sine_and_cosine().0
    }

    /// The cosine.
    pub fn cos(self) -> Interval {
        self.sine_and_cosine().1
    }

    /// The tangent; the whole line if a pole may lie in it.
    pub fn tan(self) -> Interval {
        let width = self.high.sub(self.low, Toward::Up).to_f64();
        if self.cos().contains_zero() || width.is_nan() || width >= 3.0 {
            return Interval::WHOLE;
        }
        rising(self, |x| {
            let (sine, cosine) = turn_at(x);
            sine / cosine
        })
    }

    /// The arc tangent.
    pub fn atan(self) -> Interval {
        rising(self, atan_at)
    }

    /// The arc sine of what lies within +-1; the whole line if nothing does.
    pub fn asin(self) -> Interval {
        let Some(x) = self.within_one() else {
            return Interval::WHOLE;
        };
        rising(x, |x| {
            if x.abs() == Wide::ONE {
                let side = if x < Wide::ZERO { -*HALF_PI } else { *HALF_PI };
                return side;
            }
            let x = Interval::from(x);
            let rest = (Interval::ONE - x) * (Interval::ONE + x);
            (x / rest.sqrt()).atan()
        })
    }

    /// The arc cosine of what lies within +-1; the whole line if nothing does.
    pub fn acos(self) -> Interval {
        let Some(x) = self.within_one() else {
            return Interval::WHOLE;
        };
        // Falling: of the negative, rising.
        rising(-x, |minus| {
            let x = Interval::from(-minus);
            if x.low == -Wide::ONE {
                return *PI;
            }
            ((Interval::ONE - x) / (Interval::ONE + x))
                .sqrt()
                .atan()
                .scaled(1)
        })
    }

    /// What lies within +-1.
    fn within_one(self) -> Option<Interval> {
        let inside = Interval::new(self.low.max(-Wide::ONE), self.high.min(Wide::ONE));
        (inside.low <= inside.high).then_some(inside)
    }

    /// `self^exponent = exp(exponent log self)` for what is positive in it, and 0^e = 0 for e > 0.
    pub fn real_power(self, exponent: Interval) -> Interval {
        if self.low > Wide::ZERO {
            return (self.log() * exponent).exp();
        }
        if exponent.low <= Wide::ZERO || self.high < Wide::ZERO {
            return Interval::WHOLE;
        }
        if self.high.is_zero() {
            return Interval::ZERO;
        }
        // Rising in the base: from 0 to the power of the upper end.
        let top = (Interval::from(self.high).log() * exponent).exp();
        Interval::new(Wide::ZERO, top.high)
    }
}
