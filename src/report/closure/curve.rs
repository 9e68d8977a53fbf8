//! Against which channel a step's contribution is shown.

use super::contribution::Contribution;
use super::view::View;
use crate::closure::verdict::Step;
use crate::report::axis::{Axis, Interval};

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
    /// Whether the contribution is one curve over it.
    pub is_curve: bool,
    /// What a reader has to know of it; starts with a space, or empty.
    pub remark: String,
}

/// The first channel over which the contribution is one curve; where none is, the first.
pub fn abscissa(view: &View, step: &Step, contribution: &Contribution) -> Option<Abscissa> {
    let mut passed = Vec::new();
    let mut first = None;
    for candidate in candidates(view, step) {
        let order = ascending(&candidate.values);
        let is_curve = is_curve(&contribution.value_dps, &order);
        let mut candidate = Abscissa {
            order,
            is_curve,
            ..candidate
        };
        if is_curve {
            if !passed.is_empty() {
                candidate.remark += &format!(" Over {} it is not one curve.", passed.join(" or "));
            }
            return Some(candidate);
        }
        passed.push(candidate.name.clone());
        first = first.or(Some(candidate));
    }
    first.map(|mut f| {
        f.remark += " It is not one curve over any channel: one mark and bar a reading.";
        f
    })
}

/// A tone's phase, then the step's channels in their order.
fn candidates(view: &View, step: &Step) -> Vec<Abscissa> {
    let mut out = Vec::new();
    let plain = |name: &str, axis: Axis, values: Vec<f64>| Abscissa {
        name: name.to_owned(),
        axis,
        values,
        order: Vec::new(),
        is_curve: false,
        remark: String::new(),
    };
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
        out.push(plain("its phase", axis, values));
    }
    for name in &step.channels {
        if name == "time_s" {
            let (values, unit, _) = view.time();
            let axis = Axis {
                interval: Interval::of(values.iter().copied()).padded(0.01),
                quantity: "time".to_owned(),
                unit: unit.to_owned(),
            };
            out.push(plain("time", axis, values));
        } else if let Some(values) = view.channel(name) {
            out.push(plain(name, view.channel_axis(name, &values), values));
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
