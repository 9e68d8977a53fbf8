//! Best first search for the largest value of polynomials with noise, segment by segment.
//!
//! The segments are divided, the most promising part first: the quadratic part of the polynomial is
//! bounded exactly, the rest by magnitudes, so that the bounds close with the cube of the width.

use std::cmp::Ordering;
use std::collections::BinaryHeap;

use super::interval::Interval;
use super::segment::Segment;
use super::supremum::Supremum;
use super::wide::{Toward, Wide};

/// Most parts that are looked at.
const PARTS: usize = 200_000;

/// What is made as large as possible.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Aim {
    Magnitude,
    Highest,
    Lowest,
}

/// `value(t)` within `noise` for all t from `low` to `high`, evaluation in double precision included.
#[derive(Debug, Clone)]
struct Local {
    terms: Vec<f64>,
    noise: f64,
}

/// A segment's part of the search: the difference, and the function where the error is relative.
pub(super) struct Model {
    centre: Wide,
    low: f64,
    high: f64,
    difference: Local,
    weight: Option<Local>,
}

/// A part of a segment, ordered by its upper bound.
struct Part {
    upper: f64,
    model: usize,
    low: f64,
    high: f64,
}

impl PartialEq for Part {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other) == Ordering::Equal
    }
}
impl Eq for Part {}
impl PartialOrd for Part {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}
impl Ord for Part {
    fn cmp(&self, other: &Self) -> Ordering {
        // Ties by place, so that the same input gives the same answer.
        self.upper
            .total_cmp(&other.upper)
            .then(other.model.cmp(&self.model))
            .then(other.low.total_cmp(&self.low))
    }
}

impl Local {
    /// From enclosed coefficients, for |t| <= `reach`; the function is within `radius` of them.
    fn new(coefficients: &[Interval], radius: f64, reach: f64) -> Local {
        let (mut total, mut blur, mut power) = (0.0, 0.0, 1.0);
        let mut terms = Vec::with_capacity(coefficients.len());
        for c in coefficients {
            let middle = c.middle();
            terms.push(middle.to_f64());
            total += c.magnitude() * power;
            blur += (c.radius() + middle.rest().abs()) * power;
            power *= reach;
        }
        // A shift and the bounds after it are below 4 n roundings of terms that sum up to at most twice
        // `total` (|m| + |s| <= reach, but for their rounding).
        let n = coefficients.len() as f64 + 4.0;
        let rounding = 8.0 * n * f64::EPSILON * total;
        Local {
            terms,
            noise: (radius + blur + rounding) * (1.0 + 1e-9) + 1e-290,
        }
    }

    /// The coefficients in `s = t - middle`.
    fn shifted(&self, middle: f64, into: &mut Vec<f64>) {
        into.clear();
        into.extend_from_slice(&self.terms);
        let n = into.len();
        for i in 0..n {
            for j in (i..n.saturating_sub(1)).rev() {
                into[j] += middle * into[j + 1];
            }
        }
    }
}

/// Least and largest value of `sum of terms_k s^k` over |s| <= w, without noise.
pub(super) fn range_of(terms: &[f64], w: f64) -> (f64, f64) {
    let term = |k: usize| terms.get(k).copied().unwrap_or(0.0);
    let (a, b, c) = (term(0), term(1), term(2));
    let (left, right) = (a - w * (b - w * c), a + w * (b + w * c));
    let (mut low, mut high) = (left.min(right), left.max(right));
    if b.abs() <= 2.0 * c.abs() * w {
        // Never beyond w in the quotient: no overflow, no underflow that matters.
        let vertex = a - b * (b / (4.0 * c));
        if vertex.is_finite() {
            (low, high) = (low.min(vertex), high.max(vertex));
        }
    }
    let rest = terms
        .iter()
        .skip(3)
        .rev()
        .fold(0.0, |sum, c| (sum + c.abs()) * w)
        * w
        * w;
    (low - rest, high + rest)
}

impl Aim {
    fn of(self, low: f64, high: f64) -> f64 {
        match self {
            Aim::Magnitude => high.max(-low),
            Aim::Highest => high,
            Aim::Lowest => -low,
        }
    }
}

impl Model {
    /// Over `place`, a part of the segment; `p` is in powers of `x - about`.
    pub(super) fn new(
        segment: &Segment,
        place: Interval,
        (p, about): (&[Interval], Interval),
        relative: bool,
    ) -> Model {
        let centre = Interval::from(segment.centre) - about;
        let mut moved = p.to_vec();
        let n = moved.len();
        for i in 0..n {
            for j in (i..n.saturating_sub(1)).rev() {
                moved[j] = moved[j] + centre * moved[j + 1];
            }
        }
        let length = n.max(segment.coefficients.len());
        let term = |list: &[Interval], k: usize| list.get(k).copied().unwrap_or(Interval::ZERO);
        let difference: Vec<Interval> = (0..length)
            .map(|k| term(&segment.coefficients, k) - term(&moved, k))
            .collect();
        // The ends rounded inwards where points are taken, and the bounds reach over by the rounding.
        let low = place.low.sub(segment.centre, Toward::Down).floor_f64();
        let high = place.high.sub(segment.centre, Toward::Up).ceil_f64();
        let reach = low.abs().max(high.abs());
        Model {
            centre: segment.centre,
            low,
            high,
            difference: Local::new(&difference, segment.radius, reach),
            weight: relative.then(|| Local::new(&segment.coefficients, segment.radius, reach)),
        }
    }

    /// Upper bound over a part, lower bound at its middle, and the part of the upper bound that no
    /// division makes smaller.
    fn bounds(&self, aim: Aim, low: f64, high: f64, room: &mut Vec<f64>) -> (f64, f64, f64) {
        let middle = 0.5 * (low + high);
        let w = (high - middle).max(middle - low) * (1.0 + 4.0 * f64::EPSILON);
        self.difference.shifted(middle, room);
        let (least, largest) = range_of(room, w);
        let first = room.first().copied().unwrap_or(0.0);
        let noise = self.difference.noise;
        let upper = aim.of(least, largest) + noise;
        let lower = aim.of(first, first) - noise;
        let Some(weight) = &self.weight else {
            return (upper, lower, aim.of(first, first) + noise);
        };
        weight.shifted(middle, room);
        let (least, largest) = range_of(room, w);
        let nearest = if least > 0.0 { least } else { -largest };
        let nearest = nearest - weight.noise;
        let size = room.first().map_or(0.0, |f| f.abs());
        if nearest <= 0.0 {
            return (f64::INFINITY, lower.max(0.0) / (size + weight.noise), 0.0);
        }
        let up = 1.0 + 4.0 * f64::EPSILON;
        (
            upper / nearest * up,
            lower / (size + weight.noise) / up,
            (aim.of(first, first) + noise) / (size - weight.noise).max(nearest),
        )
    }
}

/// Best first search over all models; stops where the bounds are within `gap` of each other.
pub(super) fn search(models: &[Model], aim: Aim, gap: impl Fn(f64) -> f64) -> (Supremum, bool) {
    let mut room = Vec::new();
    let mut heap = BinaryHeap::new();
    let mut best = (f64::NEG_INFINITY, 0.0);
    // Parts that are as narrow as they get.
    let mut settled = f64::NEG_INFINITY;
    let mut noisy = false;
    for (model, m) in models.iter().enumerate() {
        heap.push(Part {
            upper: f64::INFINITY,
            model,
            low: m.low,
            high: m.high,
        });
    }
    let mut parts = 0;
    while let Some(part) = heap.pop() {
        if part.upper <= best.0 + gap(best.0) || parts > PARTS {
            settled = settled.max(part.upper);
            break;
        }
        parts += 1;
        let Some(model) = models.get(part.model) else {
            break;
        };
        let (upper, lower, kept) = model.bounds(aim, part.low, part.high, &mut room);
        let upper = upper.min(part.upper);
        let middle = 0.5 * (part.low + part.high);
        // The middle of a part of no width may lie outside by a rounding.
        let inside = (part.low < middle && middle < part.high) || part.low == part.high;
        if lower > best.0 && inside {
            best = (
                lower,
                model.centre.to_f64() + (model.centre.rest() + middle),
            );
        }
        let allowed = gap(best.0);
        if upper <= best.0 + allowed {
            settled = settled.max(upper);
            continue;
        }
        // Halving only shrinks what is above `kept`.
        let stuck = upper - kept <= 0.25 * allowed || !(part.low < middle && middle < part.high);
        if stuck {
            noisy = true;
            settled = settled.max(upper);
            continue;
        }
        for (low, high) in [(part.low, middle), (middle, part.high)] {
            heap.push(Part {
                upper,
                model: part.model,
                low,
                high,
            });
        }
    }
    let found = Supremum {
        upper: if models.is_empty() {
            f64::INFINITY
        } else {
            settled
        },
        lower: best.0,
        at: best.1,
    };
    (found, noisy || parts > PARTS)
}

/// A lower bound of the least magnitude, and where it is met; 0 as soon as it cannot be told from 0.
pub(super) fn search_least(models: &[Model], floor: f64) -> (f64, f64) {
    let mut room = Vec::new();
    let mut least = (f64::INFINITY, f64::NAN);
    for model in models {
        let mut left = vec![(model.low, model.high)];
        while let Some((low, high)) = left.pop() {
            let middle = 0.5 * (low + high);
            let w = (high - middle).max(middle - low) * (1.0 + 4.0 * f64::EPSILON);
            model.difference.shifted(middle, &mut room);
            let (below, above) = range_of(&room, w);
            let size = below.max(-above) - model.difference.noise;
            let x = model.centre.to_f64() + (model.centre.rest() + middle);
            let first = room.first().map_or(0.0, |f| f.abs());
            if size > 0.0 {
                if size < least.0 {
                    least = (size, x);
                }
            } else if first <= floor + model.difference.noise || !(low < middle && middle < high) {
                return (0.0, x);
            } else {
                left.push((middle, high));
                left.push((low, middle));
            }
        }
    }
    least
}
