//! Maxima of an error that is known at points: which they are, and what they are between the points.

use super::samples::{Samples, place};
use super::wide::Wide;
use std::f64::consts::PI;

/// A local maximum of a weighted error's magnitude.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Extremum {
    /// Where.
    pub x: f64,
    /// The signed weighted error there.
    pub error: f64,
    /// Index of the nearest point.
    pub index: usize,
}

impl Samples<'_> {
    /// Local maxima of an error's magnitude, one for every run of equal signs, ascending in x.
    /// Between points the error is taken as a quartic in the angle t.
    pub fn extrema(&self, errors: &[f64]) -> Vec<Extremum> {
        let mut found: Vec<Extremum> = Vec::new();
        for index in 0..errors.len() {
            let e = errors[index];
            let before = errors.get(index.wrapping_sub(1));
            let rises = before.is_none_or(|b| b.abs() <= e.abs() || b.signum() != e.signum());
            let after = errors.get(index + 1);
            let falls = after.is_none_or(|a| a.abs() <= e.abs() || a.signum() != e.signum());
            if !(rises && falls) || e == 0.0 {
                continue;
            }
            let (x, error) = self.peak(errors, index);
            let candidate = Extremum { x, error, index };
            match found.last_mut() {
                Some(last) if last.error.signum() == error.signum() => {
                    if last.error.abs() < error.abs() {
                        *last = candidate;
                    }
                }
                _ => found.push(candidate),
            }
        }
        found
    }

    /// The largest weighted error's magnitude: at the points and between them.
    pub fn supremum(&self, errors: &[f64]) -> f64 {
        let at_points = errors.iter().fold(0.0f64, |m, e| m.max(e.abs()));
        if self.between.is_none() {
            return at_points;
        }
        let mut largest = at_points;
        for index in 0..errors.len() {
            // A peak between points is higher than its neighbour by little: skip the low ones.
            if errors[index].abs() > 0.98 * at_points {
                largest = largest.max(self.peak(errors, index).1.abs());
            }
        }
        largest
    }

    /// As [`Samples::supremum`], with the function evaluated at the peaks themselves.
    pub fn supremum_of(&self, coefficients: &[Wide]) -> (f64, f64) {
        let errors = self.errors(coefficients);
        let largest = self.supremum(&errors);
        let mut best = (0.0, self.low);
        for (point, e) in self.points.iter().zip(&errors) {
            if e.abs() > best.0 {
                best = (e.abs(), point.x);
            }
        }
        if self.between.is_none() {
            return best;
        }
        let last = self.points.len().saturating_sub(1);
        for index in 0..errors.len() {
            if errors[index].abs() < 0.95 * largest {
                continue;
            }
            let (from, to) = (index.saturating_sub(1), (index + 1).min(last));
            let here = errors[index].abs();
            if errors[from].abs() > here || errors[to].abs() > here {
                continue;
            }
            let ends = (self.points[from].x, self.points[to].x);
            let (x, e) = self.climb(coefficients, ends, self.peak(&errors, index).0);
            if e > best.0 {
                best = (e, x);
            }
        }
        best
    }

    /// Golden-section search of the maximum of |error| between the neighbours of a point, which works for
    /// kinks as well, and the place where the quartic has it.
    fn climb(&self, coefficients: &[Wide], ends: (f64, f64), start: f64) -> (f64, f64) {
        const GOLDEN: f64 = 0.618_033_988_749_894_9;
        let at = |x: f64| {
            self.point_at(x)
                .map_or(0.0, |p| self.error_at(coefficients, &p).abs())
        };
        let mut best = (start, at(start));
        let (mut low, mut high) = ends;
        let mut left = high - GOLDEN * (high - low);
        let mut right = low + GOLDEN * (high - low);
        let (mut el, mut er) = (at(left), at(right));
        for _ in 0..30 {
            if el > er {
                (high, right, er) = (right, left, el);
                left = high - GOLDEN * (high - low);
                el = at(left);
            } else {
                (low, left, el) = (left, right, er);
                right = low + GOLDEN * (high - low);
                er = at(right);
            }
            for (x, e) in [(left, el), (right, er)] {
                if e > best.1 {
                    best = (x, e);
                }
            }
        }
        best
    }

    /// Place and signed value of the peak near a point, from the quartic through it and two
    /// neighbours on either side. In the angle t every function of cos t is even about the ends.
    fn peak(&self, errors: &[f64], index: usize) -> (f64, f64) {
        let here = (self.points[index].x, errors[index]);
        let last = errors.len() - 1;
        if self.between.is_none() || last < 4 {
            return here;
        }
        let reflect = |k: isize| -> f64 {
            let last = last as isize;
            let k = k.abs();
            let k = if k > last { 2 * last - k } else { k };
            errors[k.unsigned_abs()]
        };
        let i = index as isize;
        let [a, b, c, d, e] = [-2, -1, 0, 1, 2].map(|k| reflect(i + k));
        // Only a smooth neighbourhood is a quartic: a change of sign or a kink is left as it is.
        let quadratic = 0.5 * (b + d) - c;
        if quadratic * c >= 0.0 || (d - b).abs() > 4.0 * quadratic.abs() {
            return here;
        }
        let third = (e - 2.0 * d + 2.0 * b - a) / 12.0;
        let fourth = (e - 4.0 * d + 6.0 * c - 4.0 * b + a) / 24.0;
        let first = (a - 8.0 * b + 8.0 * d - e) / 12.0;
        let second = (-a + 16.0 * b - 30.0 * c + 16.0 * d - e) / 24.0;
        let mut t = 0.25 * (b - d) / quadratic;
        for _ in 0..3 {
            let slope = first + t * (2.0 * second + t * (3.0 * third + t * 4.0 * fourth));
            let curvature = 2.0 * second + t * (6.0 * third + t * 12.0 * fourth);
            if curvature * c >= 0.0 {
                return here;
            }
            t -= slope / curvature;
        }
        if !(-1.0..=1.0).contains(&t) {
            return here;
        }
        let value = c + t * (first + t * (second + t * (third + t * fourth)));
        if value.abs() < c.abs() || value.abs() > 1.1 * c.abs() {
            return here;
        }
        let angle = PI * (index as f64 + t) / last as f64;
        (place(self.low, self.high, angle.clamp(0.0, PI)), value)
    }
}
