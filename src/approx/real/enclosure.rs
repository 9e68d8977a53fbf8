//! A function as Taylor polynomials with proved radii.
//!
//! On every segment with centre c: `|f(x) - sum over k of a_k (x - c)^k| <= radius`, by Taylor's theorem
//! with the next coefficient enclosed over the whole segment. Segments are halved until
//! the radius is small enough. Next to a point where derivatives grow without bound the segments
//! narrow and the last, tiny one has the value's range only.

use super::domain::{Domain, Dyadic, Undefined};
use super::expression::Expression;
use super::interval::Interval;
use super::segment::Segment;
use super::wide::{Toward, Wide};

/// Highest degree of a segment's polynomial.
pub(super) const DEGREE: usize = 11;
/// Most segments.
const SEGMENTS: usize = 6000;
/// Segments are not halved below this part of their place, nor below [`NARROWEST`].
const NARROW: f64 = f64::from_bits((1023 - 98) << 52);
const NARROWEST: f64 = f64::from_bits((1023 - 400) << 52);
/// No radius below this part of the function's size is aimed at.
const FINEST: f64 = f64::from_bits((1023 - 94) << 52);

/// A function over a domain, enclosed.
#[derive(Debug, Clone)]
pub struct Enclosure {
    pub(super) function: Expression,
    domain: Domain,
    segments: Vec<Segment>,
    /// The segment in which each of equal cells begins.
    cells: Vec<u32>,
    /// The domain's first double and cells per unit of the argument.
    origin: f64,
    cells_per_unit: f64,
    size: f64,
}

/// Whether `x` can be halved, and where.
fn middle_of(x: Interval) -> Option<Wide> {
    let width = x.high.sub(x.low, Toward::Up).to_f64();
    let place = x.magnitude();
    if !(width > place * NARROW && width > NARROWEST) {
        return None;
    }
    let middle = x.middle();
    // A double where there is one near enough: the polynomial's argument is exact then.
    let double = Wide::from(middle.to_f64());
    let off = double.sub(middle, Toward::Up).abs().to_f64();
    let chosen = if off < width / 16.0 { double } else { middle };
    (x.low < chosen && chosen < x.high).then_some(chosen)
}

impl Enclosure {
    /// Encloses `f` over `domain`; `tolerance` is the radius aimed at, in the function's unit
    /// ([`Enclosure::radius`] is the one that was reached).
    ///
    /// # Errors
    /// A place where `f` has no value (a pole, the logarithm of nothing positive, ...) or none that can
    /// be bounded. Removable gaps such as that of `sin(x)/x` are refused too.
    pub fn new(f: &Expression, domain: &Domain, tolerance: f64) -> Result<Enclosure, Undefined> {
        let pieces = defined_pieces(f, domain.hull())?;
        let mut size: f64 = 0.0;
        for piece in &pieces {
            let value = f.over(Interval::from(piece.middle()));
            size = size.max(value.map_or(0.0, Interval::mignitude));
        }
        let finest = (size * FINEST).max(1e-250);
        let tolerance = if tolerance > finest {
            tolerance
        } else {
            finest
        };
        let segments = polynomials(f, pieces, tolerance)?;
        Ok(Enclosure::of(f.clone(), *domain, segments))
    }

    /// Encloses `c_0 + c_1 x + ...` with exactly these doubles.
    ///
    /// # Errors
    /// A coefficient that is not finite.
    pub fn of_polynomial(coefficients: &[f64], domain: &Domain) -> Result<Enclosure, Undefined> {
        let f = Expression::polynomial(coefficients);
        Enclosure::new(&f, domain, 0.0)
    }

    fn of(function: Expression, domain: Domain, segments: Vec<Segment>) -> Enclosure {
        let hull = domain.hull();
        let (origin, end) = (hull.low.to_f64(), hull.high.to_f64());
        let count = (4 * segments.len()).next_power_of_two();
        let width = (end - origin) / count as f64;
        let cells = (0..=count)
            .map(|j| {
                let place = origin + j as f64 * width;
                segments.partition_point(|s| s.ends_below(place)) as u32
            })
            .collect();
        let size = segments.iter().map(Segment::size).fold(0.0, f64::max);
        Enclosure {
            function,
            domain,
            segments,
            cells,
            origin,
            cells_per_unit: count as f64 / (end - origin),
            size,
        }
    }

    /// Where the function is enclosed.
    pub fn domain(&self) -> &Domain {
        &self.domain
    }

    /// The segments, in the order of their places.
    pub fn segments(&self) -> &[Segment] {
        &self.segments
    }

    /// The largest radius of a segment's polynomial, in the function's unit.
    pub fn radius(&self) -> f64 {
        self.segments.iter().map(|s| s.radius).fold(0.0, f64::max)
    }

    /// Whether there are as many segments as there may be: then [`Enclosure::radius`] may be far from the one aimed at.
    pub fn is_cut_short(&self) -> bool {
        self.segments.len() > SEGMENTS
    }

    /// At least the function's largest magnitude, usually within a factor of two.
    pub fn size(&self) -> f64 {
        self.size
    }

    /// The value at `x` and a radius that holds everything: `|f(x) - value| <= radius`.
    ///
    /// Outside the domain the radius is infinite.
    pub fn at(&self, x: f64) -> (f64, f64) {
        let cell = ((x - self.origin) * self.cells_per_unit) as usize;
        let bound = |i: usize| {
            self.cells
                .get(i)
                .map_or(self.segments.len(), |k| *k as usize)
        };
        let (first, last) = (bound(cell), bound(cell + 1).saturating_add(1));
        let near = self.segments.get(first..last.min(self.segments.len()));
        if let Some(near) = near {
            let within = match near.len() {
                0 | 1 => 0,
                _ => near.partition_point(|s| s.ends_below(x)),
            };
            if let Some(segment) = near.get(within).filter(|s| s.holds(x)) {
                return segment.at(x);
            }
        }
        let place = self.segments.partition_point(|s| s.ends_below(x));
        match self.segments.get(place).filter(|s| s.holds(x)) {
            Some(segment) => segment.at(x),
            None => (f64::NAN, f64::INFINITY),
        }
    }

    /// The value at an exact argument, to some 30 digits; the whole line outside the domain.
    pub fn at_exact(&self, x: &Dyadic) -> Interval {
        self.enclosed(x.to_interval())
    }

    /// The values over an interval of arguments, from the expression; the whole line outside the domain.
    pub fn enclosed(&self, x: Interval) -> Interval {
        if self.domain.hull().encloses(x) {
            self.function.enclosed(x)
        } else {
            Interval::WHOLE
        }
    }

    /// Arguments from `low` to `high` inside the domain; an end within a rounding of the domain's is the
    /// domain's. `None` if nothing is left.
    pub(super) fn clipped(&self, low: f64, high: f64) -> Option<Interval> {
        let hull = self.domain.hull();
        let low = match low <= hull.low.to_f64().next_up() {
            true => hull.low,
            false => Wide::from(low),
        };
        let high = match high >= hull.high.to_f64().next_down() {
            true => hull.high,
            false => Wide::from(high),
        };
        (low <= high).then(|| Interval::new(low, high))
    }

    /// The segments that meet `x`, with what they have in common.
    pub(super) fn meeting(&self, x: Interval) -> impl Iterator<Item = (&Segment, Interval)> {
        let first = self.segments.partition_point(|s| s.place.high < x.low);
        let rest = self.segments.get(first..).unwrap_or(&[]);
        rest.iter()
            .take_while(move |s| s.place.low <= x.high)
            .map(move |s| (s, s.place.meet(x)))
    }
}

/// Pieces of `x` on each of which `f` has a bounded value.
fn defined_pieces(f: &Expression, x: Interval) -> Result<Vec<Interval>, Undefined> {
    let mut left = vec![x];
    let mut pieces = Vec::new();
    while let Some(x) = left.pop() {
        let known = f.over(x);
        if known.as_ref().is_ok_and(|value| value.is_bounded()) {
            pieces.push(x);
            continue;
        }
        let hopeless = matches!(&known, Err(trouble) if trouble.blocked.everywhere)
            || pieces.len() + left.len() > SEGMENTS;
        match middle_of(x).filter(|_| !hopeless) {
            Some(middle) => {
                left.push(Interval::new(middle, x.high));
                left.push(Interval::new(x.low, middle));
            }
            None => {
                return Err(match known {
                    Err(trouble) => Undefined::met(f, trouble, x),
                    Ok(_) => Undefined::unbounded(f, x),
                });
            }
        }
    }
    Ok(pieces)
}

/// Halves the pieces until a polynomial is within `tolerance` on each.
fn polynomials(
    f: &Expression,
    pieces: Vec<Interval>,
    tolerance: f64,
) -> Result<Vec<Segment>, Undefined> {
    let mut left: Vec<Interval> = pieces.into_iter().rev().collect();
    let mut segments = Vec::new();
    while let Some(x) = left.pop() {
        let best = Segment::new(f, x, tolerance).map_err(|t| Undefined::met(f, t, x))?;
        let enough = best.radius <= tolerance || segments.len() + left.len() > SEGMENTS;
        match middle_of(x).filter(|_| !enough) {
            Some(middle) => {
                left.push(Interval::new(middle, x.high));
                left.push(Interval::new(x.low, middle));
            }
            None if best.radius.is_finite() => segments.push(best),
            None => return Err(Undefined::unbounded(f, x)),
        }
    }
    Ok(segments)
}
