//! The clip of the output.

use super::{Bias, Candidate, Estimate, Missing, Parameter, Point, Reported, Sheet, map};
use crate::thermal::channels::{Channels, range};

/// Largest share of the rows that a clip holds.
const MOST_HELD: f64 = 0.8;

/// Clipping of the total output.
pub(super) struct Saturation;

const SATURATION: Sheet = Sheet {
    id: "output_saturation",
    physics: "amplifier, converter or output word clip the total of rate and bias",
    equation: "clip(rate + bias) - (rate + bias)",
    parameters: &[
        Parameter {
            name: "high_dps",
            plausible: (10.0, 3000.0),
        },
        Parameter {
            name: "low_dps",
            plausible: (-3000.0, -10.0),
        },
    ],
    compensable: false,
    confounders: &["scale_factor_nonlinearity", "scale_factor_asymmetry"],
    experiment: "look at the converter's codes; halve the front end's gain",
    reference: "IEEE Std 1431 (full scale)",
};

/// What the output would be without clipping, deg/s.
fn total(c: &Channels, bias: &Bias) -> Vec<f64> {
    let rate = c.column("rate_dps");
    (0..c.len())
        .map(|i| {
            let others = bias.others_dps.get(i).copied().unwrap_or(0.0);
            rate.map_or(0.0, |r| r[i]) + bias.at(c.u[i]) + others
        })
        .collect()
}

/// Levels from a far end of the output towards its middle, at rising shares of the rows beyond.
fn levels(c: &Channels, upper: bool) -> Vec<f64> {
    let mut sorted = c.output_dps();
    sorted.retain(|v| v.is_finite());
    sorted.sort_by(f64::total_cmp);
    if upper {
        sorted.reverse();
    }
    let n = sorted.len();
    let middle = sorted.get(n / 2).copied().unwrap_or(0.0);
    let end = sorted.first().copied().unwrap_or(0.0);
    let mut out: Vec<f64> = [0.004, 0.01, 0.02, 0.04, 0.07, 0.11, 0.16, 0.22, 0.3, 0.4]
        .iter()
        .filter_map(|share| sorted.get((share * n as f64) as usize).copied())
        .collect();
    // Within the last readings: a hard clip gathers many of them.
    out.extend([0.002, 0.01, 0.03].map(|s| end + s * (middle - end)));
    out.sort_by(f64::total_cmp);
    out.dedup();
    out
}

impl Candidate for Saturation {
    fn sheet(&self) -> &Sheet {
        &SATURATION
    }

    fn channels(&self, c: &Channels) -> Result<Vec<String>, Missing> {
        let mut out = vec!["rate_out_dps".to_owned()];
        if c.moving("rate_dps").is_some() {
            out.push("rate_dps".to_owned());
        }
        Ok(out)
    }

    fn points(&self, c: &Channels) -> Vec<Point> {
        let (high, low) = (levels(c, true), levels(c, false));
        let mut out = Vec::new();
        // Forms: both at one magnitude, upper, lower, two levels.
        out.extend(
            high.iter()
                .filter(|l| **l > 0.0)
                .map(|l| Point::at(0, &[*l])),
        );
        out.extend(
            low.iter()
                .filter(|l| **l < 0.0)
                .map(|l| Point::at(0, &[-l])),
        );
        out.extend(high.iter().map(|l| Point::at(1, &[*l])));
        out.extend(low.iter().map(|l| Point::at(2, &[*l])));
        for upper in high.iter().step_by(3) {
            for lower in low.iter().step_by(3).filter(|l| *l < upper) {
                out.push(Point::at(3, &[*upper, *lower]));
            }
        }
        out
    }

    fn columns(&self, c: &Channels, bias: &Bias, point: &Point) -> Vec<Vec<f64>> {
        let (low, high) = limits(point);
        let total = total(c, bias);
        let beyond = total.iter().filter(|x| **x < low || **x > high).count();
        if beyond as f64 > MOST_HELD * total.len() as f64 {
            // An output that hardly ever leaves its limits is no output.
            return vec![vec![0.0; total.len()]];
        }
        vec![map(&total, |x| x.max(low).min(high) - x)]
    }

    fn fine(&self, _c: &Channels, point: &Point, _seen: &[bool]) -> Vec<Point> {
        // A level that no reading reaches is none: it would clip rows that were not looked at.
        let (low, high) = limits(point);
        match point.form {
            0 => vec![
                Point::at(1, &[high]),
                Point::at(2, &[low]),
                Point::at(3, &[high, low]),
            ],
            3 => vec![Point::at(1, &[high]), Point::at(2, &[low])],
            _ => Vec::new(),
        }
    }

    fn spacing(&self, c: &Channels, point: &Point) -> Vec<f64> {
        let (low, high) = range(&c.output_dps());
        vec![0.04 * (high - low); point.theta.len()]
    }

    fn acts_on_bias(&self) -> bool {
        true
    }

    fn is_whole(&self) -> bool {
        true
    }

    fn is_last(&self) -> bool {
        true
    }

    fn moved(&self, point: &Point, by_dps: [Option<f64>; 2]) -> Option<Point> {
        let [of_upper, of_lower] = by_dps;
        let (upper, lower) = (of_upper.unwrap_or(0.0), of_lower.unwrap_or(0.0));
        match (point.form, point.theta.as_slice()) {
            (0, [level]) => {
                let outwards: Vec<f64> = of_upper.into_iter().chain(of_lower.map(|l| -l)).collect();
                let mean = outwards.iter().sum::<f64>() / outwards.len().max(1) as f64;
                Some(Point::at(0, &[level.abs() + mean]))
            }
            (1, [level]) => Some(Point::at(1, &[level + upper])),
            (2, [level]) => Some(Point::at(2, &[level + lower])),
            (3, [high, low]) => Some(Point::at(3, &[high + upper, low + lower])),
            _ => None,
        }
    }

    fn at_levels(&self, lower_dps: Option<f64>, upper_dps: Option<f64>) -> Option<Point> {
        match (lower_dps, upper_dps) {
            (None, None) => None,
            (None, Some(upper)) => Some(Point::at(1, &[upper])),
            (Some(lower), None) => Some(Point::at(2, &[lower])),
            (Some(lower), Some(upper)) => Some(Point::at(3, &[upper, lower])),
        }
    }

    fn report(&self, _c: &Channels, e: &Estimate) -> Reported {
        let (low, high) = limits(&e.point);
        let std = |k: usize| e.theta_std.get(k).copied().unwrap_or(0.0);
        let mut out = Reported::new();
        if high.is_finite() {
            out.insert("high_dps".to_owned(), (high, std(0)));
        }
        if low.is_finite() {
            let k = usize::from(e.point.form == 3);
            out.insert("low_dps".to_owned(), (low, std(k)));
        }
        out
    }
}

/// (lower, upper) limit of a point.
fn limits(point: &Point) -> (f64, f64) {
    match (point.form, point.theta.as_slice()) {
        (0, [l]) => (-l.abs(), l.abs()),
        (1, [l]) => (f64::NEG_INFINITY, *l),
        (2, [l]) => (*l, f64::INFINITY),
        (_, [upper, lower]) => (*lower, *upper),
        _ => (f64::NEG_INFINITY, f64::INFINITY),
    }
}
