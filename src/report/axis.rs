//! Axes: finite intervals, round ticks, labels with units.

use super::text::{minus, superscript};

/// Width of a character of the labels' font, px, on the generous side.
pub const CHARACTER: f64 = 7.3;
/// What no axis is asked to show.
const LARGEST: f64 = 1e30;

/// An interval of an axis: finite, and wider than nothing.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Interval {
    /// The lower end.
    pub low: f64,
    /// The upper end.
    pub high: f64,
}

impl Interval {
    /// The smallest interval with all usable values; 0..1 without any, some width around a single
    /// one.
    pub fn of(values: impl IntoIterator<Item = f64>) -> Self {
        let usable = values
            .into_iter()
            .filter(|v| v.is_finite() && v.abs() < LARGEST);
        let (low, high) = usable.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), v| {
            (low.min(v), high.max(v))
        });
        if low > high {
            return Interval {
                low: 0.0,
                high: 1.0,
            };
        }
        let size = low.abs().max(high.abs());
        if high - low > (1e-9 * size).max(1e-30) {
            return Interval { low, high };
        }
        let half = if size > 1e-30 { 0.05 * size } else { 1.0 };
        Interval {
            low: low - half,
            high: high + half,
        }
    }

    /// Wider by a share of the width at both ends.
    pub fn padded(self, share: f64) -> Self {
        let by = share * (self.high - self.low);
        Interval {
            low: self.low - by,
            high: self.high + by,
        }
    }
}

/// Where an axis has its ticks: multiples of 1, 2 or 5 times a power of ten.
#[derive(Debug, Clone, PartialEq)]
pub struct Ticks {
    /// In the axis's unit.
    pub values: Vec<f64>,
    /// In units of `10^exponent`.
    pub labels: Vec<String>,
    /// 0, or a multiple of three for very large and very small values.
    pub exponent: i32,
}

/// At most about `most` ticks, and two at least.
pub fn ticks(interval: Interval, most: usize) -> Ticks {
    let span = interval.high - interval.low;
    let least = span / most.max(1) as f64 * (1.0 - 1e-9);
    let mut power = least.log10().floor() as i32;
    let reaches = |m: &&i64| **m as f64 * 10f64.powi(power) >= least;
    let mut mantissa = *[1, 2, 5].iter().find(reaches).unwrap_or(&10);
    if mantissa == 10 {
        (mantissa, power) = (1, power + 1);
    }
    let count = |step: f64| (interval.high / step).floor() - (interval.low / step).ceil() + 1.0;
    // One tick is no scale.
    while count(mantissa as f64 * 10f64.powi(power)) < 2.0 {
        (mantissa, power) = match mantissa {
            1 => (5, power - 1),
            5 => (25, power - 1),
            25 => (2, power + 1),
            _ => (1, power),
        };
    }
    let step = mantissa as f64 * 10f64.powi(power);
    let size = interval.low.abs().max(interval.high.abs());
    let exponent = if (1e-2..1e6).contains(&size) {
        0
    } else {
        (size.log10() / 3.0).floor() as i32 * 3
    };
    let decimals = (exponent - power).max(0) as usize;
    let first = (interval.low / step - 1e-6).ceil() as i64;
    let last = (interval.high / step + 1e-6).floor() as i64;
    // Dividing by a whole power keeps 3 * 0.1 at 0.3.
    let scaled = |k: i64, power: i32| {
        let whole = (k * mantissa) as f64;
        if power < 0 {
            whole / 10f64.powi(-power)
        } else {
            whole * 10f64.powi(power)
        }
    };
    let label = |k: i64| minus(&format!("{:.*}", decimals, scaled(k, power - exponent)));
    Ticks {
        values: (first..=last).map(|k| scaled(k, power)).collect(),
        labels: (first..=last).map(label).collect(),
        exponent,
    }
}

/// Ticks of a logarithmic axis whose interval is in powers of ten: at most about `most` whole powers, with twice and five
/// times of each where there are fewer than three of them.
pub fn decades(interval: Interval, most: usize) -> Ticks {
    let (low, high) = (interval.low.ceil() as i32, interval.high.floor() as i32);
    let mantissas: &[f64] = if high - low >= 2 {
        &[1.0]
    } else {
        &[1.0, 2.0, 5.0]
    };
    let mut out = Ticks {
        values: Vec::new(),
        labels: Vec::new(),
        exponent: 0,
    };
    let every = 1 + (high - low).max(0) / most.max(2) as i32;
    for power in (low.saturating_sub(1)..=high).filter(|p| p.rem_euclid(every) == 0) {
        for mantissa in mantissas {
            let at = f64::from(power) + mantissa.log10();
            if at >= interval.low && at <= interval.high {
                out.values.push(at);
                out.labels.push(decade(*mantissa, power));
            }
        }
    }
    out
}

/// `mantissa` 10^`power`: with plain digits from a thousandth to ten thousand.
fn decade(mantissa: f64, power: i32) -> String {
    if (-3..=4).contains(&power) {
        let decimals = (-power).max(0) as usize;
        return format!("{:.decimals$}", mantissa * 10f64.powi(power));
    }
    let ten = format!("10{}", superscript(power));
    if mantissa == 1.0 {
        ten
    } else {
        format!("{mantissa:.0}\u{202f}×\u{202f}{ten}")
    }
}

/// An axis before it has ticks.
#[derive(Debug, Clone)]
pub struct Axis {
    /// What is shown.
    pub interval: Interval,
    /// The quantity; empty = no labels at all.
    pub quantity: String,
    /// Its unit.
    pub unit: String,
}

impl Axis {
    /// The axis's label: quantity and unit; nothing for an axis without a quantity.
    pub fn labelled(&self, exponent: i32) -> String {
        match (self.quantity.as_str(), exponent) {
            ("", _) => String::new(),
            (quantity, 0) if self.unit.is_empty() => quantity.to_owned(),
            (quantity, 0) => format!("{quantity}, {}", self.unit),
            (quantity, e) => format!("{quantity}, 10{} {}", superscript(e), self.unit),
        }
    }

    /// Room that the labels of a vertical axis take, px.
    pub fn room(&self) -> f64 {
        let labels = ticks(self.interval, 8).labels;
        let longest = labels.iter().map(|l| l.chars().count()).max().unwrap_or(1);
        (36.0 + CHARACTER * longest as f64).max(74.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn labels(low: f64, high: f64) -> Vec<String> {
        decades(Interval { low, high }, 10).labels
    }

    #[test]
    fn logarithmic_ticks_are_powers_of_ten_or_what_lies_between_them() {
        assert_eq!(labels(-1.0, 1.3), ["0.1", "1", "10"]);
        assert_eq!(labels(-2.1, -1.5), ["0.01", "0.02"]);
        assert_eq!(labels(0.2, 0.8), ["2", "5"]);
        assert_eq!(labels(-5.1, -4.9), ["10⁻⁵"]);
        let interval = Interval {
            low: -7.0,
            high: -4.0,
        };
        let ticks = decades(interval, 10);
        assert_eq!(decades(interval, 2).values, [-6.0, -4.0]);
        assert_eq!(ticks.values, [-7.0, -6.0, -5.0, -4.0]);
        assert_eq!(ticks.exponent, 0);
    }
}
