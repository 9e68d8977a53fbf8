//! Does the output follow the applied rate as `rate_out_dps` at nominal scale has to?

use super::columns::THERMOMETERS;
use super::thermal::ThermalRecord;
use super::warning::Warning;
use crate::statistics::stats;

/// Rates of a table are round in deg/s: so close to a whole number of them.
const ROUND: f64 = 2e-3;

/// A warning if the output has another unit, sign or scale than the applied rate.
pub(super) fn check(record: &ThermalRecord) -> Option<Warning> {
    let applied = record.column("rate_dps")?;
    let slope = slope(record, applied);
    if let Some((code, what)) = slope.and_then(meaning) {
        let slope = slope.unwrap_or(f64::NAN);
        return Some(Warning::on(
            code,
            "rate_out_dps",
            format!(
                "rate_out_dps follows rate_dps with slope {slope:.5}, where 1 is expected. {what}"
            ),
        ));
    }
    both_in_radians(applied)
}

/// What a slope that is not near 1 means.
fn meaning(slope: f64) -> Option<(&'static str, &'static str)> {
    Some(if (0.5..=2.0).contains(&slope) {
        return None;
    } else if (-2.0..=-0.5).contains(&slope) {
        (
            "rate_sign_reversed",
            "One of the two has the opposite sign. Turn it round in one of them",
        )
    } else if (0.012..=0.023).contains(&slope.abs()) {
        (
            "rate_in_radians",
            "rate_out_dps looks like rad/s. If it is, multiply it by 57.29578, or say its unit in [record.columns]",
        )
    } else if (43.0..=75.0).contains(&slope.abs()) {
        (
            "rate_in_radians",
            "rate_dps looks like rad/s. If it is, multiply it by 57.29578, or say its unit in [record.columns]",
        )
    } else {
        (
            "scale_not_nominal",
            "One of the two has another unit or scale. Divide rate_out_dps by the slope, or say the unit in [record.columns]",
        )
    })
}

/// The slope of the output on the applied rate, where the record decides it.
///
/// The thermal drift is taken out first, as a quadratic in the thermometer: it may go with rates
/// that were held long. What it cannot follow (a lag, a step) is caught by a second look at the
/// changes from row to row, where a drift is small: the slope counts only if both agree.
fn slope(record: &ThermalRecord, applied: &[f64]) -> Option<f64> {
    let out = record.column("rate_out_dps")?;
    let (low, high) = stats::extremes(applied)?;
    if high - low < 2e-3 {
        return None;
    }
    let thermometer = THERMOMETERS.iter().find_map(|name| record.column(name));
    let (mut rate, mut output, mut heat) = (Vec::new(), Vec::new(), Vec::new());
    for (i, (a, b)) in applied.iter().zip(out).enumerate() {
        let t = thermometer.map_or(0.0, |t| t.get(i).copied().unwrap_or(f64::NAN));
        if a.is_finite() && b.is_finite() && t.is_finite() {
            rate.push(*a);
            output.push(*b);
            heat.push(t);
        }
    }
    if rate.len() < 10 {
        return None;
    }
    let changes = |v: &[f64]| -> Vec<f64> { v.windows(2).map(|w| w[1] - w[0]).collect() };
    let (rate_changes, output_changes) = (changes(&rate), changes(&output));
    let spread = |v: &[f64]| {
        let mean = v.iter().sum::<f64>() / v.len() as f64;
        dot_of(v, |x| (x - mean) * (x - mean))
    };
    let before = spread(&rate);
    detrend(&heat, &mut [&mut rate, &mut output]);
    // A rate that is a function of the temperature cannot be told from the drift.
    if spread(&rate) < 0.01 * before {
        return None;
    }
    let levels = decided(&rate, &output)?;
    let steps = decided(&rate_changes, &output_changes)?;
    let agree = meaning(levels)?.0 == meaning(steps)?.0;
    agree.then_some(levels)
}

/// Slope of `b` on `a`, both about 0, where `a` explains at least half of `b`.
fn decided(a: &[f64], b: &[f64]) -> Option<f64> {
    let saa = dot_of(a, |x| x * x);
    let sbb = dot_of(b, |x| x * x);
    let sab: f64 = a.iter().zip(b).map(|(x, y)| x * y).sum();
    (saa > 0.0 && sab * sab >= 0.5 * saa * sbb).then(|| sab / saa)
}

fn dot_of(v: &[f64], f: impl Fn(f64) -> f64) -> f64 {
    v.iter().map(|x| f(*x)).sum()
}

/// Takes the best quadratic in `by` out of each series, by orthogonalised powers of `by` over -1
/// .. 1.
fn detrend(by: &[f64], series: &mut [&mut Vec<f64>]) {
    let Some((low, high)) = stats::extremes(by) else {
        return;
    };
    let half = if high > low { 0.5 * (high - low) } else { 1.0 };
    let u: Vec<f64> = by.iter().map(|t| (t - low) / half - 1.0).collect();
    let powers: [Vec<f64>; 3] = [
        vec![1.0; u.len()],
        u.clone(),
        u.iter().map(|u| u * u).collect(),
    ];
    let mut basis: Vec<Vec<f64>> = Vec::new();
    for mut power in powers {
        let whole = dot_of(&power, |x| x * x);
        for b in &basis {
            remove(&mut power, b);
        }
        let left = dot_of(&power, |x| x * x);
        // A constant thermometer, or one of two values, has no further power.
        if left > 1e-9 * whole {
            let length = left.sqrt();
            basis.push(power.iter().map(|x| x / length).collect());
        }
    }
    for values in series {
        for b in &basis {
            remove(values, b);
        }
    }
}

/// Takes the part along the unit vector `b` out.
fn remove(values: &mut [f64], b: &[f64]) {
    let part: f64 = values.iter().zip(b).map(|(v, b)| v * b).sum();
    for (v, b) in values.iter_mut().zip(b) {
        *v -= part * b;
    }
}

/// Rate and output in rad/s alike show no slope; a table's rates betray it, since they are round
/// in deg/s and not in rad/s.
fn both_in_radians(applied: &[f64]) -> Option<Warning> {
    let mut rates: Vec<f64> = applied.iter().map(|r| r.abs()).collect();
    rates.retain(|r| *r > 1e-6);
    // A held rate is repeated from row to row.
    rates.dedup();
    rates.sort_by(f64::total_cmp);
    rates.dedup_by(|a, b| (*a - *b).abs() < 1e-6);
    let is_round = |x: f64| x > 0.5 && (x - x.round()).abs() < ROUND;
    let in_radians = rates.iter().filter(|r| is_round(r.to_degrees())).count();
    let in_degrees = rates.iter().filter(|r| is_round(10.0 * **r)).count();
    let told = (3..=100).contains(&rates.len()) && in_radians == rates.len() && in_degrees <= 1;
    told.then(|| {
        Warning::on(
            "rate_in_radians",
            "rate_dps",
            format!(
                "the {} rates that were applied are whole numbers of deg/s if rate_dps is in rad/s. If it is, multiply \
                 rate_dps and rate_out_dps by 57.29578, or say their units in [record.columns]",
                rates.len()
            ),
        )
    })
}

#[cfg(test)]
mod tests {
    use super::super::thermal::parse;
    use crate::design::RecordMapping;
    use std::path::Path;

    /// The codes for a record of `rows` rows of (rate, output, die).
    fn codes(rows: usize, row: impl Fn(f64) -> (f64, f64, f64)) -> Vec<&'static str> {
        let mut text = String::from("time_s,rate_out_dps,rate_dps,die_degc\n");
        for k in 0..rows {
            let (rate, out, die) = row(k as f64);
            text.push_str(&format!("{},{out},{rate},{die}\n", 10 * k));
        }
        let mapping = RecordMapping::default();
        let (_, warnings) = parse(text.as_bytes(), Path::new("r.csv"), &mapping).unwrap();
        warnings.iter().map(|w| w.code).collect()
    }

    fn wiggle(k: f64) -> f64 {
        (k * 1.7).sin() * 0.01 + (k * 0.9).cos() * 0.013
    }

    fn die(k: f64) -> f64 {
        k * 0.35 + 0.1 * wiggle(k)
    }

    #[test]
    fn drift_that_goes_with_rates_held_long_is_no_scale() {
        // 160 deg/s of drift over 70 K while the table stands at -20, then 0, then 20 deg/s.
        let held = |k: f64| ((k / 67.0).floor() - 1.0) * 20.0;
        let bias = |k: f64| 100.0 * die(k) / 70.0 + 60.0 * (die(k) / 70.0).powi(2);
        assert!(codes(200, |k| (held(k), held(k) + bias(k) + wiggle(k), die(k))).is_empty());
        // The same with a step in the bias, which no quadratic follows.
        let step = |k: f64| if k > 90.0 { 60.0 } else { 0.0 };
        let with_step = |k: f64| held(k) + bias(k) + step(k) + wiggle(k);
        assert!(codes(200, |k| (held(k), with_step(k), die(k))).is_empty());
        // A rate that follows the temperature decides nothing.
        assert!(codes(200, |k| (die(k), 5.0 * die(k), die(k))).is_empty());
    }

    #[test]
    fn a_wrong_scale_is_seen_through_the_drift() {
        let rate = |k: f64| ((k / 20.0).floor() % 5.0 - 2.0) * 100.0;
        let bias = |k: f64| 30.0 * die(k) / 70.0;
        for (factor, expected) in [
            (1.02, None),
            (-1.0, Some("rate_sign_reversed")),
            (57.3, Some("rate_in_radians")),
            (16.4, Some("scale_not_nominal")),
            (0.3, Some("scale_not_nominal")),
        ] {
            let out = |k: f64| factor * rate(k) + bias(k) + wiggle(k);
            let found = codes(200, |k| (rate(k), out(k), die(k)));
            assert_eq!(found, expected.into_iter().collect::<Vec<_>>(), "{factor}");
        }
    }

    #[test]
    fn rates_that_are_round_in_degrees_alone_are_radians() {
        let rate = |k: f64| ((k / 5.0).floor() % 7.0 - 3.0) * 30.0;
        let found = codes(140, |k| {
            let radians = format!("{:.5}", rate(k).to_radians()).parse().unwrap();
            (radians, radians + 1e-3 * wiggle(k), die(k))
        });
        assert_eq!(found, ["rate_in_radians"]);
        for unit in [1.0, 0.1, 0.25, 1.0 / 3.0] {
            let found = codes(140, |k| {
                (unit * rate(k), unit * rate(k) + wiggle(k), die(k))
            });
            assert!(found.is_empty(), "{unit}: {found:?}");
        }
    }
}
