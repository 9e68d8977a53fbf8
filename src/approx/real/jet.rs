//! Taylor coefficients over intervals: `f^(k) / k!` for k = 0.. by the usual recurrences
//! (A. Griewank, A. Walther, "Evaluating Derivatives", 2nd ed., SIAM 2008, chapter 13).
//!
//! A jet over an interval X encloses the coefficients at every point of X. It may be shorter than
//! asked: where a derivative is not bounded (the root at 0, the arc sine at 1, a magnitude at its
//! kink) only the value is known, and the jet has one coefficient. Where even the value is not known
//! there is an [`Obstacle`].

use super::constants::INVERSES;
use super::interval::Interval;
use super::wide::Wide;

/// What stands in the way of a value.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Obstacle {
    /// A divisor or the base of a negative power is 0.
    Zero,
    /// The tangent's argument is an odd multiple of pi / 2.
    Pole,
    /// The logarithm's argument, or the base of a power, is not positive.
    NotPositive,
    /// The argument of a root, or the base of a real power, is negative.
    Negative,
    /// The argument of asin or acos is beyond +-1.
    BeyondOne,
}

/// An obstacle, and whether it is there at every point of the interval (else perhaps).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Blocked {
    /// Which.
    pub obstacle: Obstacle,
    /// Everywhere in the interval.
    pub everywhere: bool,
}

/// An enclosure of a domain's end that is not a double may reach over the end of a root's or arc sine's
/// natural domain by rounding. So little is cut off: the enclosure still holds wherever the function
/// is defined.
const SLACK: f64 = f64::from_bits((1023 - 90) << 52);

/// A jet or the reason why there is none.
pub type Jets = Result<Jet, Blocked>;

/// Taylor coefficients, the value first; never empty.
#[derive(Debug, Clone, PartialEq)]
pub struct Jet {
    terms: Vec<Interval>,
}

fn blocked(obstacle: Obstacle, everywhere: bool) -> Blocked {
    Blocked {
        obstacle,
        everywhere,
    }
}

fn integer(n: usize) -> Interval {
    Interval::from(n as f64)
}

fn divided(sum: Interval, n: usize) -> Interval {
    match INVERSES.get(n) {
        Some(inverse) => sum * *inverse,
        None => sum / integer(n),
    }
}

/// `sum over j in from..=to of a_j b_(k-j)`.
fn convolved(a: &[Interval], b: &[Interval], k: usize, from: usize, to: usize) -> Interval {
    (from..=to).fold(Interval::ZERO, |sum, j| sum + a[j] * b[k - j])
}

impl Jet {
    /// A constant.
    pub fn constant(value: Interval, length: usize) -> Jet {
        let mut terms = vec![Interval::ZERO; length.max(1)];
        terms[0] = value;
        Jet { terms }
    }

    /// The variable over `x`.
    pub fn variable(x: Interval, length: usize) -> Jet {
        let mut jet = Jet::constant(x, length);
        if let Some(slope) = jet.terms.get_mut(1) {
            *slope = Interval::ONE;
        }
        jet
    }

    /// The coefficients that are known, at least one.
    pub fn terms(&self) -> &[Interval] {
        &self.terms
    }

    /// The value.
    pub fn value(&self) -> Interval {
        self.terms[0]
    }

    fn value_only(value: Interval) -> Jet {
        Jet { terms: vec![value] }
    }

    fn map2(&self, other: &Jet, f: impl Fn(Interval, Interval) -> Interval) -> Jet {
        let terms = self.terms.iter().zip(&other.terms);
        Jet {
            terms: terms.map(|(a, b)| f(*a, *b)).collect(),
        }
    }

    /// The sum.
    pub fn add(&self, other: &Jet) -> Jet {
        self.map2(other, |a, b| a + b)
    }

    /// The difference.
    pub fn sub(&self, other: &Jet) -> Jet {
        self.map2(other, |a, b| a - b)
    }

    /// The negative.
    pub fn neg(&self) -> Jet {
        self.map2(self, |a, _| -a)
    }

    /// The product.
    pub fn mul(&self, other: &Jet) -> Jet {
        let length = self.terms.len().min(other.terms.len());
        let term = |k| convolved(&self.terms, &other.terms, k, 0, k);
        Jet {
            terms: (0..length).map(term).collect(),
        }
    }

    /// Times a constant.
    pub fn scaled(&self, factor: Interval) -> Jet {
        self.map2(self, |a, _| a * factor)
    }

    /// The square.
    pub fn square(&self) -> Jet {
        let mut jet = self.mul(self);
        jet.terms[0] = self.terms[0].square();
        jet
    }

    /// The quotient.
    pub fn div(&self, other: &Jet) -> Jets {
        let first = other.terms[0];
        if first.contains_zero() {
            return Err(blocked(Obstacle::Zero, first == Interval::ZERO));
        }
        let length = self.terms.len().min(other.terms.len());
        let mut q: Vec<Interval> = Vec::with_capacity(length);
        for k in 0..length {
            let known = (1..=k).fold(Interval::ZERO, |sum, j| sum + other.terms[j] * q[k - j]);
            q.push((self.terms[k] - known) / first);
        }
        Ok(Jet { terms: q })
    }

    /// `j u_j`, what the derivative's recurrences need.
    fn weighted(&self) -> Vec<Interval> {
        let terms = self.terms.iter().enumerate();
        terms.map(|(j, u)| integer(j) * *u).collect()
    }

    /// The exponential.
    pub fn exp(&self) -> Jet {
        let slopes = self.weighted();
        let mut e = vec![self.terms[0].exp()];
        for k in 1..self.terms.len() {
            e.push(divided(convolved(&slopes, &e, k, 1, k), k));
        }
        Jet { terms: e }
    }

    /// The terms of F(u) from its value and `F' = 1 / w` in terms of w: `F'(x) w = u'`.
    fn with_slope(&self, value: Interval, w: &[Interval]) -> Jet {
        let mut a = vec![value];
        // j a_j as they come.
        let mut slopes = vec![Interval::ZERO];
        for k in 1..self.terms.len().min(w.len()) {
            let known = divided(convolved(&slopes, w, k, 1, k - 1), k);
            let term = (self.terms[k] - known) / w[0];
            slopes.push(integer(k) * term);
            a.push(term);
        }
        Jet { terms: a }
    }

    /// The natural logarithm.
    pub fn log(&self) -> Jets {
        let u = self.terms[0];
        if u.low <= Wide::ZERO {
            return Err(blocked(Obstacle::NotPositive, u.high <= Wide::ZERO));
        }
        Ok(self.with_slope(u.log(), &self.terms))
    }

    /// The square root.
    pub fn sqrt(&self) -> Jets {
        let u = self.not_negative(self.terms[0])?;
        if u.low <= Wide::ZERO {
            return Ok(Jet::value_only(u.sqrt()));
        }
        let first = u.sqrt();
        let twice = first.scaled(1);
        let mut s = vec![first];
        for k in 1..self.terms.len() {
            let known = convolved(&s, &s, k, 1, k - 1);
            s.push((self.terms[k] - known) / twice);
        }
        Ok(Jet { terms: s })
    }

    /// `value` without what is below 0 by rounding only.
    fn not_negative(&self, value: Interval) -> Result<Interval, Blocked> {
        if value.low < Wide::from(-SLACK) {
            return Err(blocked(Obstacle::Negative, value.high < Wide::ZERO));
        }
        let low = value.low.max(Wide::ZERO);
        Ok(Interval::new(low, value.high.max(low)))
    }

    /// Sine and cosine.
    fn sine_and_cosine(&self) -> (Jet, Jet) {
        let slopes = self.weighted();
        let (sine, cosine) = self.terms[0].sine_and_cosine();
        let (mut s, mut c) = (vec![sine], vec![cosine]);
        for k in 1..self.terms.len() {
            let next = divided(convolved(&slopes, &c, k, 1, k), k);
            c.push(-divided(convolved(&slopes, &s, k, 1, k), k));
            s.push(next);
        }
        (Jet { terms: s }, Jet { terms: c })
    }

    /// The sine.
    pub fn sin(&self) -> Jet {
        self.sine_and_cosine().0
    }

    /// The cosine.
    pub fn cos(&self) -> Jet {
        self.sine_and_cosine().1
    }

    /// The tangent.
    pub fn tan(&self) -> Jets {
        let u = self.terms[0];
        let value = u.tan();
        if u.cos().contains_zero() || !value.is_bounded() {
            return Err(blocked(Obstacle::Pole, false));
        }
        let slopes = self.weighted();
        let mut t = vec![value];
        let mut w = vec![value.square() + Interval::ONE];
        for k in 1..self.terms.len() {
            t.push(divided(convolved(&slopes, &w, k, 1, k), k));
            w.push(convolved(&t, &t, k, 0, k));
        }
        Ok(Jet { terms: t })
    }

    /// The arc tangent.
    pub fn atan(&self) -> Jet {
        let mut w = self.square();
        w.terms[0] = w.terms[0] + Interval::ONE;
        self.with_slope(self.terms[0].atan(), &w.terms)
    }

    /// The arc sine.
    pub fn asin(&self) -> Jets {
        self.arc(Interval::asin)
    }

    /// The arc cosine.
    pub fn acos(&self) -> Jets {
        // The slopes are the negative of the arc sine's.
        let mut jet = self.neg().arc(Interval::asin)?;
        jet.terms[0] = self.terms[0].acos();
        Ok(jet)
    }

    fn arc(&self, function: impl Fn(Interval) -> Interval) -> Jets {
        let u = self.terms[0];
        let one = Wide::from(1.0 + f64::EPSILON);
        let over = Interval::ONE - u.abs();
        if over.low < Wide::from(-SLACK) {
            let everywhere = over.high < Wide::ZERO || u.low > one || u.high < -one;
            return Err(blocked(Obstacle::BeyondOne, everywhere));
        }
        if over.low <= Wide::ZERO {
            return Ok(Jet::value_only(function(u)));
        }
        // 1 - u^2 as (1 - u)(1 + u): no cancellation near 1.
        let one = Jet::constant(Interval::ONE, self.terms.len());
        let rest = one.sub(self).mul(&one.add(self));
        match rest.sqrt() {
            Ok(w) if w.terms.len() > 1 || self.terms.len() == 1 => {
                Ok(self.with_slope(function(u), &w.terms))
            }
            _ => Ok(Jet::value_only(function(u))),
        }
    }

    /// The magnitude.
    pub fn abs(&self) -> Jet {
        let u = self.terms[0];
        if u.low >= Wide::ZERO {
            self.clone()
        } else if u.high <= Wide::ZERO {
            self.neg()
        } else {
            Jet::value_only(u.abs())
        }
    }

    /// An integer power; `0^0 = 1`.
    pub fn power(&self, n: i32) -> Jets {
        let u = self.terms[0];
        if n < 0 {
            let one = Jet::constant(Interval::ONE, self.terms.len());
            return one.div(&self.power(n.saturating_neg())?);
        }
        let (mut base, mut left) = (self.clone(), n);
        let mut product = Jet::constant(Interval::ONE, self.terms.len());
        while left > 0 {
            if left % 2 == 1 {
                product = product.mul(&base);
            }
            left /= 2;
            if left > 0 {
                base = base.square();
            }
        }
        product.terms[0] = u.power(n);
        Ok(product)
    }

    /// A power with a constant exponent that is no integer.
    pub fn real_power(&self, exponent: Interval) -> Jets {
        let u = self.not_negative(self.terms[0])?;
        let value = u.real_power(exponent);
        if u.low <= Wide::ZERO {
            if exponent.low <= Wide::ZERO {
                return Err(blocked(Obstacle::Zero, u.high <= Wide::ZERO));
            }
            return Ok(Jet::value_only(value));
        }
        // u p' = exponent u' p.
        let mut p = vec![value];
        for k in 1..self.terms.len() {
            let sum = (0..k).fold(Interval::ZERO, |sum, j| {
                let factor = exponent * integer(k - j) - integer(j);
                sum + factor * self.terms[k - j] * p[j]
            });
            p.push(divided(sum, k) / u);
        }
        Ok(Jet { terms: p })
    }

    /// A power with a variable exponent: `exp(exponent log self)`.
    pub fn general_power(&self, exponent: &Jet) -> Jets {
        Ok(exponent.mul(&self.log()?).exp())
    }
}
