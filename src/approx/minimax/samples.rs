//! A function on an interval with its weight, at points dense enough to see the maximum of an error.
//!
//! Points are equally spaced in the angle t of x = middle - half cos t, so that they cluster at the ends,
//! where the errors of good polynomials oscillate fastest, and where roots such as sqrt(x) at 0
//! become smooth in t.

use super::basis::{Basis, Monomials};
use super::wide::Wide;
use crate::error::{InputError, Result};
use std::f64::consts::PI;

/// A function to be approximated.
pub trait Target {
    /// Its value, to a double's accuracy.
    fn value(&self, x: f64) -> f64;

    /// Its value to some 30 digits where the function can give them. Errors of an approximation
    /// below 1e-13 of the function are noise without this.
    fn value_wide(&self, x: Wide) -> Wide {
        Wide::from(self.value(x.to_f64()))
    }
}

impl<F: Fn(f64) -> f64> Target for F {
    fn value(&self, x: f64) -> f64 {
        self(x)
    }
}

/// What an error is measured in.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Weight {
    /// The function's own unit.
    Absolute,
    /// Parts of the function's magnitude.
    Relative,
}

/// The function at one point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Point {
    /// Where.
    pub x: f64,
    /// Value there.
    pub value: Wide,
    /// Factor of the error: 1 for [`Weight::Absolute`], 1/|f| for [`Weight::Relative`], 1/sigma
    /// for measured data.
    pub weight: f64,
}

/// A function, or measured data, at the points where errors are looked at.
pub struct Samples<'a> {
    /// The monomials of the polynomials to come.
    pub basis: Basis,
    /// Lower end of the interval that has to be looked at: half of the function's own if the
    /// function and the basis have the same symmetry.
    pub low: f64,
    /// Its upper end.
    pub high: f64,
    /// Ascending in x.
    pub points: Vec<Point>,
    /// The function between the points; None if only the points count (codes, measured data).
    pub(super) between: Option<(&'a dyn Target, Weight)>,
}

impl<'a> Samples<'a> {
    /// The function on [low, high]: every real number of it counts.
    ///
    /// Refused: an interval that is empty or not finite, a function that is not finite somewhere,
    /// and a relative weight where the function vanishes but the basis does not.
    pub fn new(
        target: &'a dyn Target,
        basis: &Basis,
        low: f64,
        high: f64,
        weight: Weight,
    ) -> Result<Samples<'a>> {
        check_interval(low, high)?;
        let (low, high) = reduced(target, basis, low, high);
        let count = (64 * basis.len() + 1).clamp(321, 1601);
        let places: Vec<f64> = (0..count)
            .map(|k| place(low, high, PI * k as f64 / (count - 1) as f64))
            .collect();
        Ok(Samples {
            points: evaluate(target, basis, &places, weight)?,
            basis: basis.clone(),
            low,
            high,
            between: Some((target, weight)),
        })
    }

    /// The function at codes only: `nearest` maps a real number to the nearest value that the
    /// input can have. The points are a dense subset of the codes, so a maximum over them never
    /// exceeds that over all codes.
    pub fn on_codes(
        target: &'a dyn Target,
        basis: &Basis,
        low: f64,
        high: f64,
        weight: Weight,
        nearest: &dyn Fn(f64) -> f64,
    ) -> Result<Samples<'a>> {
        check_interval(low, high)?;
        let (from, to) = reduced(target, basis, low, high);
        let count = (64 * basis.len() + 1).clamp(321, 1601);
        let mut places: Vec<f64> = (0..count)
            .map(|k| nearest(place(from, to, PI * k as f64 / (count - 1) as f64)))
            .filter(|x| (low..=high).contains(x))
            .collect();
        places.sort_by(f64::total_cmp);
        places.dedup();
        let samples = Samples {
            points: evaluate(target, basis, &places, weight)?,
            basis: basis.clone(),
            low: from,
            high: to,
            between: None,
        };
        samples.check_count()?;
        Ok(samples)
    }

    /// Measured points with their standard deviations; the weight is 1/sigma.
    pub fn measured(basis: &Basis, x: &[f64], y: &[f64], sigma: &[f64]) -> Result<Samples<'a>> {
        if x.len() != y.len() || x.len() != sigma.len() {
            return Err(InputError::new(format!(
                "measured data: {} positions, {} values and {} standard deviations",
                x.len(),
                y.len(),
                sigma.len()
            ))
            .into());
        }
        let mut points = Vec::with_capacity(x.len());
        for (row, ((&x, &y), &sigma)) in x.iter().zip(y).zip(sigma).enumerate() {
            if !(x.is_finite() && y.is_finite() && sigma.is_finite() && sigma > 0.0) {
                return Err(InputError::new(format!(
                    "measured data, point {}: x = {x}, y = {y}, sigma = {sigma}",
                    row + 1
                ))
                .help("all must be finite and sigma positive")
                .into());
            }
            points.push(Point {
                x,
                value: Wide::from(y),
                weight: 1.0 / sigma,
            });
        }
        points.sort_by(|a, b| a.x.total_cmp(&b.x));
        let ends = (points.first().map(|p| p.x), points.last().map(|p| p.x));
        let (Some(low), Some(high)) = ends else {
            return Err(InputError::new("measured data: no point").into());
        };
        let samples = Samples {
            basis: basis.clone(),
            low,
            high,
            points,
            between: None,
        };
        samples.check_count()?;
        Ok(samples)
    }

    /// True if the function between the points counts as well.
    pub fn is_continuous(&self) -> bool {
        self.between.is_some()
    }

    /// Refuses fewer different places than unknowns + 1.
    fn check_count(&self) -> Result<()> {
        let mut places: Vec<f64> = self.points.iter().map(|p| p.x).collect();
        places.dedup();
        if self.basis.monomials != Monomials::All {
            places.iter_mut().for_each(|x| *x = x.abs());
            places.sort_by(f64::total_cmp);
            places.dedup();
        }
        if places.len() <= self.basis.len() {
            return Err(InputError::new(format!(
                "{} coefficients, but the function is looked at in {} different places only",
                self.basis.len(),
                places.len()
            ))
            .help("use a lower degree or a table")
            .into());
        }
        Ok(())
    }

    /// The function at any place; None between measured points or codes.
    pub(super) fn point_at(&self, x: f64) -> Option<Point> {
        let (target, weight) = self.between?;
        let value = target.value_wide(Wide::from(x));
        let weight = weight_of(value, weight);
        (value.is_finite() && weight.is_finite()).then_some(Point { x, value, weight })
    }

    /// Weighted errors of a polynomial at all points.
    pub fn errors(&self, coefficients: &[Wide]) -> Vec<f64> {
        self.points
            .iter()
            .map(|p| self.error_at(coefficients, p))
            .collect()
    }

    /// Weighted error of a polynomial at one point, (f - p) times the weight.
    pub(super) fn error_at(&self, coefficients: &[Wide], point: &Point) -> f64 {
        (point.value - self.basis.value(coefficients, Wide::from(point.x))).hi * point.weight
    }
}

/// x at an angle, exact at the ends.
pub(super) fn place(low: f64, high: f64, angle: f64) -> f64 {
    if angle <= 0.0 {
        return low;
    }
    if angle >= PI {
        return high;
    }
    // 1 - cos t = 2 sin^2(t/2): no cancellation near the lower end.
    let (s, c) = (0.5 * angle).sin_cos();
    let x = if s < c {
        low + (high - low) * s * s
    } else {
        high - (high - low) * c * c
    };
    x.clamp(low, high)
}

/// Refuses an empty interval.
fn check_interval(low: f64, high: f64) -> Result<()> {
    if low.is_finite() && high.is_finite() && low < high {
        return Ok(());
    }
    Err(
        InputError::new(format!("the interval [{low}, {high}] is empty"))
            .help("the lower end must be below the upper end, both finite")
            .into(),
    )
}

/// The half of [low, high] that says all, where function and basis are both odd or both even.
fn reduced(target: &dyn Target, basis: &Basis, low: f64, high: f64) -> (f64, f64) {
    let sign = match basis.monomials {
        Monomials::All => return (low, high),
        Monomials::Odd => -1.0,
        Monomials::Even => 1.0,
    };
    if low >= 0.0 || high <= 0.0 {
        return (low, high);
    }
    let common = high.min(-low);
    let symmetric = (1..=32).all(|k| {
        let x = Wide::from(common * f64::from(k) / 32.0);
        let (right, left) = (target.value_wide(x), target.value_wide(-x));
        (left - right * Wide::from(sign)).abs().hi <= 1e-18 * right.abs().hi.max(1e-300)
    });
    match symmetric {
        false => (low, high),
        true if high >= -low => (0.0, high),
        true => (low, 0.0),
    }
}

/// Weight of the error where the function has this value.
fn weight_of(value: Wide, weight: Weight) -> f64 {
    match weight {
        Weight::Absolute => 1.0,
        Weight::Relative => 1.0 / value.abs().hi,
    }
}

/// Moves an end at 0 inward by a thousandth of the first step: every odd polynomial is 0 at 0, and so
/// must the function be; the quotient has a limit, which is reached to 1e-10 beside it.
fn beside_zero(places: &mut [f64]) {
    if let [first, second, ..] = places
        && *first == 0.0
    {
        *first = 1e-3 * *second;
    } else if let [.., second, last] = places
        && *last == 0.0
    {
        *last = 1e-3 * *second;
    }
}

/// The function at its points, refusing what cannot be approximated.
fn evaluate(
    target: &dyn Target,
    basis: &Basis,
    places: &[f64],
    weight: Weight,
) -> Result<Vec<Point>> {
    let mut places = places.to_vec();
    if weight == Weight::Relative && basis.monomials == Monomials::Odd {
        beside_zero(&mut places);
    }
    let mut values = Vec::with_capacity(places.len());
    for x in places {
        let value = target.value_wide(Wide::from(x));
        if !value.is_finite() {
            return Err(InputError::new(format!("the function is not finite at x = {x}")).into());
        }
        values.push((x, value));
    }
    let size = values.iter().fold(0.0f64, |m, (_, v)| m.max(v.abs().hi));
    let mut points = Vec::with_capacity(values.len());
    let mut sign = 0.0;
    for (x, value) in values {
        let vanishes = value.abs().hi <= 1e-25 * size;
        let changes = sign != 0.0 && value.hi.signum() != sign;
        if weight == Weight::Relative && (vanishes || changes) {
            return Err(InputError::new(format!(
                "relative error: the function vanishes at or near x = {x}, where the polynomial need not"
            ))
            .help("use the absolute error, another interval, or odd monomials for a zero at 0")
            .into());
        }
        sign = value.hi.signum();
        points.push(Point {
            x,
            value,
            weight: weight_of(value, weight),
        });
    }
    Ok(points)
}
