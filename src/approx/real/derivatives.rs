//! Bounds of an enclosed function's derivatives over an interval.

use super::enclosure::Enclosure;
use super::interval::Interval;
use super::wide::{Toward, Wide};

/// Highest order.
pub const HIGHEST: usize = 8;
/// Halvings at most.
const DEPTH: u32 = 6;
/// The bound is not made tighter than this part above a value that is met.
const ENOUGH: f64 = 1.01;

impl Enclosure {
    /// At least the largest |f^(order)| from `low` to `high` (the part of it in the domain), order 0 to 8,
    /// usually to 1 %; `None` where no bound is known: the derivative is not bounded, or the order too
    /// high.
    pub fn derivative_bound(&self, order: usize, low: f64, high: f64) -> Option<f64> {
        let (least, largest) = self.derivative_range(order, low, high)?;
        Some(least.abs().max(largest.abs()))
    }

    /// Bounds of f^(order) from `low` to `high`; see [`Enclosure::derivative_bound`].
    pub fn derivative_range(&self, order: usize, low: f64, high: f64) -> Option<(f64, f64)> {
        if order > HIGHEST {
            return None;
        }
        let whole = self.clipped(low, high)?;
        let factorial: f64 = (1..=order).map(|k| k as f64).product();
        let mut left = vec![(whole, DEPTH)];
        let mut range: Option<Interval> = None;
        let mut met: Option<Interval> = None;
        while let Some((x, depth)) = left.pop() {
            let (over, at) = self.coefficient(order, reaching_over(x, whole));
            if let Some(at) = at {
                met = Some(met.map_or(at, |m| m.hull(at)));
            }
            let inside = |over: Interval| {
                let met = met.map_or(0.0, Interval::magnitude);
                over.is_bounded() && over.magnitude() <= ENOUGH * met
            };
            if depth == 0 || over.is_some_and(inside) {
                let over = over?;
                range = Some(range.map_or(over, |r| r.hull(over)));
                continue;
            }
            let middle = x.middle();
            if !(x.low < middle && middle < x.high) {
                let over = over?;
                range = Some(range.map_or(over, |r| r.hull(over)));
                continue;
            }
            left.push((Interval::new(middle, x.high), depth - 1));
            left.push((Interval::new(x.low, middle), depth - 1));
        }
        let range = range? * Interval::from(factorial);
        range
            .is_bounded()
            .then(|| (range.low.floor_f64(), range.high.ceil_f64()))
    }

    /// The Taylor coefficient of an order over `x`, by the mean value form where that is tighter, and
    /// at the middle.
    fn coefficient(&self, order: usize, x: Interval) -> (Option<Interval>, Option<Interval>) {
        let middle = x.middle();
        let jet = |x: Interval, length: usize| self.function.jet(x, length).ok();
        let at = jet(Interval::from(middle), order + 1);
        let at = at.and_then(|jet| jet.terms().get(order).copied());
        let Some(over) = jet(x, order + 2) else {
            return (None, at);
        };
        let direct = over.terms().get(order).copied();
        let slope = over.terms().get(order + 1);
        if let (Some(direct), Some(slope), Some(at)) = (direct, slope, at) {
            let reach = x
                .high
                .sub(middle, Toward::Up)
                .max(middle.sub(x.low, Toward::Up));
            let off = Interval::new(-reach, reach);
            // The coefficient's derivative is (order + 1) times the next coefficient.
            let mean = at + *slope * off * Interval::from((order + 1) as f64);
            return (Some(direct.meet(mean)), Some(at));
        }
        (direct, at)
    }
}

/// `x` with a little more on the sides that are not those of `whole`: a kink where it was divided must
/// not get lost between two smooth halves.
fn reaching_over(x: Interval, whole: Interval) -> Interval {
    let more = |end: Wide| Wide::from(end.abs().to_f64() * 1e-20 + 1e-200);
    let low = match x.low > whole.low {
        true => x.low.sub(more(x.low), Toward::Down).max(whole.low),
        false => x.low,
    };
    let high = match x.high < whole.high {
        true => x.high.add(more(x.high), Toward::Up).min(whole.high),
        false => x.high,
    };
    Interval::new(low, high)
}
