//! What the figures of a closure have in common: residuals, the readings that are drawn, axes.

use super::contribution::{self, Contribution};
use crate::record::columns::unit_of;
use crate::report::axis::{Axis, Interval};
use crate::statistics::stats;
use crate::thermal::channels::range;
use crate::thermal::close::Closed;

/// Robust standard deviations beyond which a single reading does not set an axis.
const STANDS_OUT: f64 = 8.0;

/// Share of the readings that may stand out; more are no accidents.
const ACCIDENTS: f64 = 0.06;

/// A closure with what is drawn of it.
pub struct View<'a> {
    /// The closure.
    pub closed: &'a Closed,
    /// Error less the declared model, in the closure's unit, every row; NaN where not measured.
    pub before: Vec<f64>,
    /// Less the steps as well.
    pub after: Vec<f64>,
    /// Of each step.
    pub contributions: Vec<Contribution>,
    /// Rows that set the axes: those that do not stand out from [`View::after`].
    usual: Vec<bool>,
}

impl<'a> View<'a> {
    /// Computes residuals and contributions.
    pub fn new(closed: &'a Closed) -> Self {
        let c = &closed.channels;
        let after = closed.after.residual(c);
        View {
            closed,
            before: closed.before.residual(c),
            usual: usual(&after),
            after,
            contributions: contribution::all(c, &closed.after),
        }
    }

    /// Whether there is anything to tell before from after.
    pub fn has_steps(&self) -> bool {
        !self.contributions.is_empty()
    }

    /// Time in a unit for people: (values, unit, seconds of one).
    pub fn time(&self) -> (Vec<f64>, &'static str, f64) {
        let c = &self.closed.channels;
        let (unit, per) = match c.span_s() {
            s if s > 3.0 * 3600.0 => ("h", 3600.0),
            s if s > 600.0 => ("min", 60.0),
            _ => ("s", 1.0),
        };
        (c.time_s.iter().map(|t| t / per).collect(), unit, per)
    }

    /// Readings of a channel in its own unit; `None` if the record lacks it.
    pub fn channel(&self, name: &str) -> Option<Vec<f64>> {
        let c = &self.closed.channels;
        if name == c.thermometer {
            return Some(c.u.iter().map(|u| c.centre + c.half * u).collect());
        }
        match name {
            "time_s" => Some(c.time_s.clone()),
            "time_since_power_on_s" => Some(c.on_s.clone()),
            other => c.column(other).map(<[f64]>::to_vec),
        }
    }

    /// All channels but the record's own time: those that move, and the names of those that do not.
    pub fn channels(&self) -> (Vec<(String, Vec<f64>)>, Vec<String>) {
        let c = &self.closed.channels;
        let mut names = vec![c.thermometer.clone()];
        if c.on_known {
            names.push("time_since_power_on_s".to_owned());
        }
        names.extend(c.columns.keys().cloned());
        let (mut moving, mut still) = (Vec::new(), Vec::new());
        for name in names {
            let Some(values) = self.channel(&name) else {
                continue;
            };
            let (low, high) = range(&values);
            if high > low {
                moving.push((name, values));
            } else {
                still.push(name);
            }
        }
        (moving, still)
    }

    /// From when to when each block of rows lasts that the errors are of, s; the border is halfway between rows.
    pub fn blocks(&self) -> Vec<(f64, f64)> {
        let (time, held) = (&self.closed.channels.time_s, self.closed.split.judging());
        let mut out = Vec::new();
        let mut start = None;
        for i in 0..=held.len().min(time.len()) {
            let border = match (i.checked_sub(1).and_then(|k| time.get(k)), time.get(i)) {
                (Some(a), Some(b)) => 0.5 * (a + b),
                (a, b) => *a.or(b).unwrap_or(&0.0),
            };
            match (start, held.get(i).copied().unwrap_or(false)) {
                (None, true) => start = Some(border),
                (Some(from), false) => {
                    out.push((from, border));
                    start = None;
                }
                _ => {}
            }
        }
        out
    }

    /// The axis of a channel.
    pub fn channel_axis(&self, name: &str, values: &[f64]) -> Axis {
        Axis {
            interval: Interval::of(values.iter().copied()).padded(0.04),
            quantity: name.to_owned(),
            unit: unit_of(name).to_owned(),
        }
    }

    /// The axis of a residual, one value a row: readings that stand out alone do not set it.
    pub fn residual_axis(&self, quantity: &str, series: &[&[f64]]) -> Axis {
        let rows = series.iter().flat_map(|s| s.iter().zip(&self.usual));
        let shown = rows.filter(|(_, usual)| **usual).map(|(v, _)| *v);
        Axis {
            interval: Interval::of(shown.chain([0.0])).padded(0.07),
            quantity: quantity.to_owned(),
            unit: self.closed.closure.unit.to_owned(),
        }
    }
}

/// Which values an axis has to show: all, but for a few that stand out.
fn usual(values: &[f64]) -> Vec<bool> {
    let finite: Vec<f64> = values.iter().copied().filter(|v| v.is_finite()).collect();
    let centre = stats::median(&finite);
    let limit = STANDS_OUT * stats::robust_std(&finite);
    let kept: Vec<bool> = values.iter().map(|v| (v - centre).abs() <= limit).collect();
    let left = finite.len() - kept.iter().filter(|k| **k).count();
    if limit > 0.0 && left as f64 <= ACCIDENTS * finite.len() as f64 {
        kept
    } else {
        vec![true; values.len()]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn single_readings_do_not_set_an_axis_but_structure_does() {
        let mut values: Vec<f64> = (0..500).map(|i| f64::from(i % 10)).collect();
        values[7] = 1e4;
        let shown = usual(&values);
        assert!(shown.iter().enumerate().all(|(i, s)| *s == (i != 7)));
        // A tenth of the record is no accident.
        for v in &mut values[100..150] {
            *v = 1e4;
        }
        assert_eq!(usual(&values), [true; 500]);
        assert_eq!(usual(&[2.0; 9]), [true; 9]);
    }
}
