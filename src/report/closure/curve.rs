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

/// The first channel over which the contribution is one curve; where none is, the contribution itself.
pub fn abscissa(view: &View, step: &Step, contribution: &Contribution) -> Abscissa {
    let value = &contribution.value_dps;
    let mut passed: Vec<String> = Vec::new();
    let not = |passed: &[String]| match passed {
        [] => String::new(),
        names => format!(" Over {} it is not one curve.", names.join(" or ")),
    };
    for (name, axis, values) in candidates(view, step) {
        let order = ascending(&values);
        if is_curve(value, &order) {
            return Abscissa {
                is_band: is_curve(&contribution.std_dps, &order),
                remark: not(&passed),
                name,
                axis,
                values,
                order,
            };
        }
        passed.push(name);
    }
    let order = ascending(value);
    Abscissa {
        name: "itself".to_owned(),
        axis: Axis {
            interval: Interval::of(value.iter().copied()).padded(0.04),
            quantity: "fitted contribution".to_owned(),
            unit: view.closed.closure.unit.to_owned(),
        },
        values: value.clone(),
        is_band: is_curve(&contribution.std_dps, &order),
        order,
        remark: not(&passed) + " So the abscissa is the contribution itself.",
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
            let (values, unit, _) = view.time();
            let axis = Axis {
                interval: Interval::of(values.iter().copied()).padded(0.01),
                quantity: "time".to_owned(),
                unit: unit.to_owned(),
            };
            out.push(("time".to_owned(), axis, values));
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

/// Whether values in this order are a curve: steps from one to the next are small beside their
/// spread (von Neumann's ratio), one jump over the whole range allowed.
fn is_curve(values: &[f64], order: &[usize]) -> bool {
    let n = order.len().max(1) as f64;
    let mean = order.iter().map(|i| values[*i]).sum::<f64>() / n;
    let spread: f64 = order.iter().map(|i| (values[*i] - mean).powi(2)).sum();
    let steps: f64 = order
        .windows(2)
        .map(|w| (values[w[1]] - values[w[0]]).powi(2))
        .sum();
    steps <= (0.02 + 8.0 / n) * spread
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_loop_is_no_curve_and_a_step_is_one() {
        let x: Vec<f64> = (0..300).map(|i| (f64::from(i) / 25.0).sin()).collect();
        let rows = ascending(&x);
        let of = |f: &dyn Fn(usize) -> f64| -> Vec<f64> { (0..300).map(f).collect() };
        assert!(is_curve(&of(&|i| x[i].powi(3)), &rows));
        assert!(is_curve(&of(&|i| f64::from(u8::from(x[i] > 0.3))), &rows));
        let heating = |i: usize| (i as f64 / 25.0).cos();
        assert!(!is_curve(&of(&heating), &rows));
        let time: Vec<usize> = (0..300).collect();
        assert!(is_curve(&of(&heating), &time));
        assert!(is_curve(&[], &[]));
    }
}
