//! Against which channel a step's contribution is shown.

use super::contribution::Contribution;
use super::view::View;
use crate::report::axis::{Axis, Interval};
use crate::verdict::Step;

/// The abscissa of a step's figure.
pub struct Abscissa {
    /// Of the channel.
    pub name: String,
    /// With its unit.
    pub axis: Axis,
    /// One value a row.
    pub values: Vec<f64>,
    /// Rows in ascending order of the values.
    pub order: Vec<usize>,
    /// Whether the contribution's deviation is one curve over it.
    pub is_band: bool,
    /// What a reader has to know of it; starts with a space, or empty.
    pub remark: String,
}

/// The first channel over which the contribution is one curve; where none is, the first, over which it is drawn in the
/// order of time: a loop is then seen as one.
pub fn abscissa(view: &View, step: &Step, contribution: &Contribution) -> Abscissa {
    let value = &contribution.value_dps;
    let mut passed: Option<Abscissa> = None;
    for (name, axis, values) in candidates(view, step) {
        let order = ascending(&values);
        let found = Abscissa {
            is_band: is_curve(&contribution.std_dps, &values, &order),
            remark: String::new(),
            name,
            axis,
            values,
            order,
        };
        if is_curve(value, &found.values, &found.order) {
            return found;
        }
        passed.get_or_insert(found);
    }
    let mut first = passed.unwrap_or_else(|| of_time(view));
    first.order = (0..value.len()).collect();
    first.is_band = false;
    first.remark = format!(
        " The effect is no function of {} alone: the line joins rows in the order of time.",
        first.name
    );
    first
}

/// The record's time.
fn of_time(view: &View) -> Abscissa {
    let (values, unit, _) = view.time();
    Abscissa {
        name: "time".to_owned(),
        axis: Axis {
            interval: Interval::of(values.iter().copied()).padded(0.01),
            quantity: "time".to_owned(),
            unit: unit.to_owned(),
        },
        order: (0..values.len()).collect(),
        values,
        is_band: true,
        remark: String::new(),
    }
}

/// A tone's phase, then the step's channels in their order.
fn candidates(view: &View, step: &Step) -> Vec<(String, Axis, Vec<f64>)> {
    let mut out = Vec::new();
    if let Some(hz) = step.parameters.get("frequency_hz") {
        let cycle = |t: &f64| (hz * t).rem_euclid(1.0);
        let values = view.closed.channels.time_s.iter().map(cycle).collect();
        let axis = Axis {
            interval: Interval {
                low: 0.0,
                high: 1.0,
            },
            quantity: "phase of the tone".to_owned(),
            unit: "cycles".to_owned(),
        };
        out.push(("its phase".to_owned(), axis, values));
    }
    for name in &step.channels {
        if name == "time_s" {
            let time = of_time(view);
            out.push((time.name, time.axis, time.values));
        } else if let Some(values) = view.channel(name) {
            out.push((name.clone(), view.channel_axis(name, &values), values));
        }
    }
    out
}

fn ascending(values: &[f64]) -> Vec<usize> {
    let mut order: Vec<usize> = (0..values.len()).collect();
    order.sort_by(|a, b| values[*a].total_cmp(&values[*b]));
    order
}

/// Share of the abscissae's span within which rows count as of one place.
const PLACE: f64 = 2e-3;

/// Whether values are a curve over the abscissae, given in their order: steps from one to the next are small beside their
/// spread (von Neumann's ratio), one jump over the whole range allowed. Where the abscissae keep to a few places, as in
/// soaks at steps of temperature, the steps within a place are what counts: there the curve may be as steep as it likes.
fn is_curve(values: &[f64], abscissae: &[f64], order: &[usize]) -> bool {
    let n = order.len().max(1) as f64;
    let mean = order.iter().map(|i| values[*i]).sum::<f64>() / n;
    let spread: f64 = order.iter().map(|i| (values[*i] - mean).powi(2)).sum();
    let span = match (order.first(), order.last()) {
        (Some(a), Some(b)) => abscissae[*b] - abscissae[*a],
        _ => 0.0,
    };
    let (mut all, mut within, mut pairs) = (0.0, 0.0, 0usize);
    for w in order.windows(2) {
        let step = (values[w[1]] - values[w[0]]).powi(2);
        all += step;
        if abscissae[w[1]] - abscissae[w[0]] <= PLACE * span {
            within += step;
            pairs += 1;
        }
    }
    let allowed = (0.02 + 8.0 / n) * spread;
    all <= allowed || (2 * pairs >= order.len() && within <= 0.02 * spread)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_loop_is_no_curve_and_a_step_is_one() {
        let x: Vec<f64> = (0..300).map(|i| (f64::from(i) / 25.0).sin()).collect();
        let rows = ascending(&x);
        let of = |f: &dyn Fn(usize) -> f64| -> Vec<f64> { (0..300).map(f).collect() };
        assert!(is_curve(&of(&|i| x[i].powi(3)), &x, &rows));
        assert!(is_curve(
            &of(&|i| f64::from(u8::from(x[i] > 0.3))),
            &x,
            &rows
        ));
        let heating = |i: usize| (i as f64 / 25.0).cos();
        assert!(!is_curve(&of(&heating), &x, &rows));
        let (time, at): (Vec<usize>, Vec<f64>) = (0..300).map(|i| (i, i as f64)).unzip();
        assert!(is_curve(&of(&heating), &at, &time));
        assert!(is_curve(&[], &[], &[]));
    }

    #[test]
    fn soaks_at_few_temperatures_are_a_curve_unless_the_ways_differ() {
        // Three readings at each of 15 temperatures, up and down, the shape changing its sign from one to the next.
        let degc = |i: usize| 5.0 * ((i / 3) as f64 - 14.0).abs();
        let x: Vec<f64> = (0..87).map(|i| degc(i) + 1e-3 * (i % 3) as f64).collect();
        let rows = ascending(&x);
        let of = |f: &dyn Fn(usize) -> f64| -> Vec<f64> { (0..87).map(f).collect() };
        let crossing = |i: usize| {
            let at = (x[i] - 37.5) / 3.7;
            at / (1.0 + at * at)
        };
        assert!(is_curve(&of(&crossing), &x, &rows));
        let loops = |i: usize| crossing(i) * if i < 42 { 1.0 } else { -1.0 };
        assert!(!is_curve(&of(&loops), &x, &rows));
    }
}
