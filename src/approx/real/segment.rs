//! One Taylor polynomial with its radius.

use super::enclosure::DEGREE;
use super::expression::{Expression, Trouble};
use super::interval::Interval;
use super::wide::{Toward, Wide};

/// Half a unit in the last place of 1.
const U: f64 = f64::EPSILON / 2.0;

/// `|f(x) - sum over k of coefficients_k (x - centre)^k| <= radius` for every x of `place`.
#[derive(Debug, Clone)]
pub struct Segment {
    /// The arguments.
    pub place: Interval,
    /// What the polynomial's argument is counted from.
    pub centre: Wide,
    /// At least the largest |x - centre|.
    pub reach: f64,
    /// Enclosures of the polynomial's coefficients, lowest order first; at most 12.
    pub coefficients: Vec<Interval>,
    /// The polynomial's distance from the function, at most; in the function's unit.
    pub radius: f64,
    /// The value at the centre as two doubles, the other coefficients as one each.
    first: f64,
    first_rest: f64,
    fast: [f64; DEGREE],
    used: usize,
    /// The radius with all roundings of [`Segment::at`].
    fast_radius: f64,
}

/// `a * b` and `a + b` of bounds that are not negative, rounded upwards.
fn times(a: f64, b: f64) -> f64 {
    if a == 0.0 || b == 0.0 {
        0.0
    } else {
        (a * b).next_up()
    }
}

fn plus(a: f64, b: f64) -> f64 {
    (a + b).next_up()
}

impl Segment {
    /// The polynomial of least degree within `tolerance` over `place`, or the best there is.
    pub(super) fn new(f: &Expression, place: Interval, tolerance: f64) -> Result<Segment, Trouble> {
        let middle = place.middle();
        let double = Wide::from(middle.to_f64());
        let centre = if place.contains(double) {
            double
        } else {
            middle
        };
        let above = place.high.sub(centre, Toward::Up);
        let reach = above.max(centre.sub(place.low, Toward::Up)).ceil_f64();
        let over = f.jet(place, DEGREE + 2)?;
        // The value's range alone.
        let range = over.value();
        let mut coefficients = vec![Interval::from(range.middle())];
        let mut radius = range.radius();
        if over.terms().len() > 1 && radius > tolerance {
            let at = f.jet(Interval::from(centre), DEGREE + 1)?;
            let mut power = 1.0;
            let next = over.terms().iter().skip(1);
            for (degree, (_, next)) in at.terms().iter().zip(next).enumerate() {
                power = times(power, reach);
                let remainder = times(next.magnitude(), power);
                // Not a number where both are beyond all bounds.
                if remainder < radius {
                    radius = remainder;
                    coefficients = at.terms().iter().take(degree + 1).copied().collect();
                }
                if radius <= tolerance {
                    break;
                }
            }
        }
        let bounded = coefficients.iter().all(|c| c.is_bounded());
        let mut segment = Segment {
            place,
            centre,
            reach,
            radius: if bounded { radius } else { f64::INFINITY },
            coefficients,
            first: 0.0,
            first_rest: 0.0,
            fast: [0.0; DEGREE],
            used: 0,
            fast_radius: f64::INFINITY,
        };
        segment.prepare();
        Ok(segment)
    }

    /// The coefficients in double precision and what evaluating them costs in accuracy.
    fn prepare(&mut self) {
        self.used = self.coefficients.len() - 1;
        let reach = self.reach;
        let (mut rest, mut slope, mut blur, mut power) = (0.0, 0.0, 0.0, 1.0);
        for (k, c) in self.coefficients.iter().enumerate() {
            let size = c.magnitude();
            if k > 0 {
                slope = plus(slope, times(times(k as f64, size), power));
                power = times(power, reach);
                rest = plus(rest, times(size, power));
                blur = plus(blur, times(U, times(size, power)));
                if let Some(fast) = self.fast.get_mut(k - 1) {
                    *fast = c.middle().to_f64();
                }
            }
            blur = plus(blur, times(c.radius(), power));
        }
        let first = self.coefficients[0].middle();
        (self.first, self.first_rest) = (first.to_f64(), first.rest());
        let (top, low) = (self.first.abs(), self.first_rest.abs());
        // x - centre in two steps: each is off by at most U times its result.
        let off = U * (2.0 * reach + 2.0 * self.centre.rest().abs());
        // Horner: 2 roundings a step and those of the lower part, then the last sum's.
        let horner = (2.0 * self.used as f64 + 5.0) * U * (rest + low);
        let last = U * (top + low + rest);
        let total = self.radius + blur + slope * off + horner + last;
        self.fast_radius = total * (1.0 + 1e-6) + 1e-300;
    }

    /// Whether all of it is below `x`.
    pub(super) fn ends_below(&self, x: f64) -> bool {
        let high = self.place.high;
        high.to_f64() < x || (high.to_f64() == x && high.rest() < 0.0)
    }

    /// Whether it holds `x`.
    pub(super) fn holds(&self, x: f64) -> bool {
        self.place.contains(Wide::from(x))
    }

    /// The value at a double inside, and a radius with all roundings.
    pub(super) fn at(&self, x: f64) -> (f64, f64) {
        let t = (x - self.centre.to_f64()) - self.centre.rest();
        let used = self.fast.get(..self.used).unwrap_or(&[]);
        let sum = used.iter().rev().fold(0.0, |sum, c| sum * t + c);
        (self.first + (sum * t + self.first_rest), self.fast_radius)
    }

    /// At least the largest magnitude of the function here.
    pub(super) fn size(&self) -> f64 {
        let mut power = 1.0;
        let mut sum = self.radius;
        for c in &self.coefficients {
            sum = plus(sum, times(c.magnitude(), power));
            power = times(power, self.reach);
        }
        sum
    }
}
