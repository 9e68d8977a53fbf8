//! How far a polynomial is from an enclosed function, proved from above and shown from below.
//!
//! On every segment the difference is a polynomial in `t = x - centre` with a radius, whose largest
//! magnitude branch and bound finds (`search`; compare S. Chevillard, J. Harrison, M. Joldes, C. Lauter,
//! "Efficient and accurate computation of upper bounds of approximation errors", TCS 412 (2011), with
//! plain subdivision in place of sums of squares).

use super::domain::{Domain, Dyadic, Undefined};
use super::enclosure::Enclosure;
use super::interval::Interval;
use super::search::{Aim, Model, search, search_least};
use super::wide::Wide;

/// Upper and lower bound meet within this part.
const GAP: f64 = 1e-5;
/// For ranges: the gap as a part of the function's size.
const RANGE_GAP: f64 = 1e-9;
/// No gap below this part of the function's size is aimed at.
const FLOOR: f64 = f64::from_bits((1023 - 60) << 52);

/// The largest |f - p| (or |f - p| / |f|) over an interval.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Supremum {
    /// At least the supremum (proved); infinite if the interval has no part of the domain.
    pub upper: f64,
    /// At most the value at `at` (proved): the supremum is at least this.
    pub lower: f64,
    /// The argument, as the nearest double.
    pub at: f64,
}

const NO_POLYNOMIAL: (&[Interval], Interval) = (&[], Interval::ZERO);

const NOTHING: Supremum = Supremum {
    upper: f64::INFINITY,
    lower: 0.0,
    at: f64::NAN,
};

impl Enclosure {
    fn models(&self, p: (&[Interval], Interval), x: Interval, relative: bool) -> Vec<Model> {
        let parts = self.meeting(x);
        let model = |(s, place)| Model::new(s, place, p, relative);
        parts.map(model).collect()
    }

    /// Over `x`; relative to the function where its `least` magnitude is given.
    fn largest(
        &self,
        (p, about): (&[Dyadic], Interval),
        x: Interval,
        least: Option<f64>,
    ) -> Supremum {
        let p: Vec<Interval> = p.iter().map(|c| c.to_interval()).collect();
        let p = (&p[..], about);
        let relative = least.is_some();
        let floor = if relative { FLOOR } else { FLOOR * self.size() };
        let gap = |best: f64| (GAP * best.abs()).max(floor);
        let (mut found, mut noisy) = search(&self.models(p, x, relative), Aim::Magnitude, gap);
        // The function's own radius is in the way: enclose it better, here only.
        for _ in 0..2 {
            if !noisy {
                break;
            }
            let finer = found.lower.max(floor) * least.unwrap_or(1.0) * (0.1 * GAP);
            let domain = Domain {
                low: Interval::from(x.low),
                high: Interval::from(x.high),
            };
            let Ok(better) = Enclosure::new(&self.function, &domain, finer) else {
                break;
            };
            let (again, still) = search(&better.models(p, x, relative), Aim::Magnitude, gap);
            noisy = still;
            if again.upper < found.upper {
                let lower = again.lower.max(found.lower);
                found = Supremum { lower, ..again };
            }
        }
        found.lower = found.lower.max(0.0);
        found
    }

    /// The supremum of |f - p| from `low` to `high` (the part of it in the domain), where
    /// `p = p_0 + p_1 x + ...`, lowest order first.
    pub fn supremum(&self, p: &[Dyadic], low: f64, high: f64) -> Supremum {
        self.supremum_about(p, Dyadic::new(0, 0), low, high)
    }

    /// As [`Enclosure::supremum`] for `p = p_0 + p_1 (x - about) + p_2 (x - about)^2 + ...`.
    pub fn supremum_about(&self, p: &[Dyadic], about: Dyadic, low: f64, high: f64) -> Supremum {
        match self.clipped(low, high) {
            Some(x) => self.largest((p, about.to_interval()), x, None),
            None => NOTHING,
        }
    }

    /// As [`Enclosure::supremum`], over the whole domain.
    pub fn supremum_over_domain(&self, p: &[Dyadic]) -> Supremum {
        self.largest((p, Interval::ZERO), self.domain().hull(), None)
    }

    /// The supremum of |f - p| / |f|.
    ///
    /// Where both are exactly 0 at x = 0 (the sine and a polynomial of odd powers) the quotient near it
    /// is bounded by Cauchy's mean value theorem: it is that of the derivatives somewhere between.
    ///
    /// # Errors
    /// `f` is 0 somewhere else from `low` to `high`, or not seen to differ from 0.
    pub fn supremum_relative(
        &self,
        p: &[Dyadic],
        low: f64,
        high: f64,
    ) -> Result<Supremum, Undefined> {
        let Some(x) = self.clipped(low, high) else {
            return Ok(NOTHING);
        };
        let Some((part, mut found)) = self.near_common_zero(p, x) else {
            return self.largest_relative(p, x);
        };
        for (low, high) in [(x.low, part.low), (part.high, x.high)] {
            if low < high {
                let other = self.largest_relative(p, Interval::new(low, high))?;
                let at = if other.lower > found.lower {
                    other.at
                } else {
                    found.at
                };
                found = Supremum {
                    upper: found.upper.max(other.upper),
                    lower: found.lower.max(other.lower),
                    at,
                };
            }
        }
        Ok(found)
    }

    fn largest_relative(&self, p: &[Dyadic], x: Interval) -> Result<Supremum, Undefined> {
        let (least, at) = search_least(&self.models(NO_POLYNOMIAL, x, false), self.size() * FLOOR);
        if least > 0.0 {
            return Ok(self.largest((p, Interval::ZERO), x, Some(least)));
        }
        Err(Undefined {
            at,
            reason: format!(
                "a relative error has no meaning where `{}` is 0: near x = {at:.6}",
                self.function
            ),
            column_in_text: None,
        })
    }

    /// A part of `x` around 0 and the supremum of the relative error there, if f and p are exactly 0 at 0
    /// and f has a slope.
    fn near_common_zero(&self, p: &[Dyadic], x: Interval) -> Option<(Interval, Supremum)> {
        let zero = Interval::ZERO;
        let vanish = x.contains_zero() && p.first().is_none_or(|c| c.raw == 0);
        if !vanish || self.function.enclosed(zero) != zero {
            return None;
        }
        // Derivative of p at 0 and its second derivative over a part.
        let p: Vec<Interval> = p.iter().map(|c| c.to_interval()).collect();
        let second = |over: Interval| {
            let terms = p.iter().enumerate().skip(2).rev();
            terms.fold(zero, |sum, (k, c)| {
                sum * over + *c * Interval::from((k * (k - 1)) as f64)
            })
        };
        let first = p.get(1).copied().unwrap_or(zero);
        let slope = *self.function.jet(zero, 2).ok()?.terms().get(1)?;
        for halvings in 8..40 {
            let reach = x.radius() * f64::powi(0.5, halvings);
            let part = x.meet(Interval::symmetric(reach));
            let Ok(jet) = self.function.jet(part, 3) else {
                continue;
            };
            let Some(bend) = jet.terms().get(2).map(|c| c.scaled(1)) else {
                continue;
            };
            let off = (slope - first) + part * (bend - second(part));
            let ratio = (off / (slope + part * bend)).abs();
            let limit = ((slope - first) / slope).abs();
            let wide = ratio.radius() > GAP * ratio.magnitude().max(FLOOR);
            if ratio.is_bounded() && (!wide || halvings == 39) {
                let found = Supremum {
                    upper: ratio.high.ceil_f64(),
                    lower: limit.low.max(Wide::ZERO).floor_f64(),
                    at: 0.0,
                };
                return Some((part, found));
            }
        }
        None
    }

    /// Bounds of the function's values from `low` to `high` (the part of it in the domain): proved, and
    /// wider than the true range by about 1e-9 of the function's size and its radius.
    pub fn range(&self, low: f64, high: f64) -> (f64, f64) {
        let Some(x) = self.clipped(low, high) else {
            return (f64::NEG_INFINITY, f64::INFINITY);
        };
        let models = self.models(NO_POLYNOMIAL, x, false);
        let gap = |_: f64| RANGE_GAP * self.size();
        let (highest, _) = search(&models, Aim::Highest, gap);
        let (lowest, _) = search(&models, Aim::Lowest, gap);
        (-lowest.upper, highest.upper)
    }
}
