//! Whether a compensation takes anything of the drift off: said of a measured record by all that fit one.

use crate::record::Warning;
use crate::text::number;

/// Bins over the thermometer's range, of whose means the drift is.
pub const DRIFT_BINS: usize = 24;

/// A compensation gains nothing if more than this share is left both of the drift and of the standard deviation about the mean
/// (convention).
const NO_GAIN: f64 = 0.9;

/// Share of the rates' range that a turn passes from one reading to the next when it begins, and a drift does not (convention).
const TURN_SHARE: f64 = 0.25;

/// Greatest minus least of the means over bins of the thermometer; of pairs of its reading and a rate.
pub fn drift_pp(readings: impl Iterator<Item = (f64, f64)> + Clone) -> f64 {
    let whole = || readings.clone().map(|r| r.0);
    let low = whole().fold(f64::INFINITY, f64::min);
    let high = whole().fold(f64::NEG_INFINITY, f64::max);
    let width = (high - low).max(f64::MIN_POSITIVE) / DRIFT_BINS as f64;
    let mut sums = [(0.0, 0usize); DRIFT_BINS];
    for (thermometer, rate) in readings.clone() {
        let bin = (((thermometer - low) / width) as usize).min(DRIFT_BINS - 1);
        sums[bin].0 += rate;
        sums[bin].1 += 1;
    }
    // Bins with a third of the usual number of readings and more: the others are noise.
    let filled = sums.iter().filter(|b| b.1 > 0).count().max(1);
    let least = (readings.count() / filled / 3).max(1);
    let means = sums.iter().filter(|b| b.1 >= least);
    let means: Vec<f64> = means.map(|b| b.0 / b.1 as f64).collect();
    crate::statistics::stats::extremes(&means).map_or(0.0, |(low, high)| high - low)
}

/// Standard deviation about the mean.
fn deviation(rates: impl Iterator<Item = f64> + Clone) -> f64 {
    let count = rates.clone().count().max(1) as f64;
    let mean = rates.clone().sum::<f64>() / count;
    let squares = rates.map(|rate| (rate - mean).powi(2));
    (squares.sum::<f64>() / count).sqrt()
}

/// True if the rate varies as much after the compensation as before it; a mean that is taken off is no gain.
fn gains_nothing(readings: impl Iterator<Item = [f64; 3]> + Clone) -> bool {
    let [before, after] = [1, 2].map(|k| {
        let rates = readings.clone().map(move |r| (r[0], r[k]));
        (drift_pp(rates.clone()), deviation(rates.map(|r| r.1)))
    });
    after.0 > NO_GAIN * before.0 && after.1 > NO_GAIN * before.1
}

/// What is said of a compensation that takes nothing off; of readings in the order of time: the thermometer's, with the rate before
/// the compensation and after it, deg/s, the applied rate subtracted. Where heating and cooling differ (`has_loop`), that is the reason
/// and is told by itself, unless the gyro was turned, which makes them differ as well. Where it is not known that more than noise is
/// there (`may_be_noise`), that is said to be possible.
pub fn warning(
    thermometer: &str,
    readings: impl Iterator<Item = [f64; 3]> + Clone,
    has_loop: bool,
    may_be_noise: bool,
) -> Option<Warning> {
    if !gains_nothing(readings.clone()) {
        return None;
    }
    let rates: Vec<f64> = readings.map(|r| r[1]).collect();
    let (low, high) = crate::statistics::stats::extremes(&rates)?;
    let mut pairs = rates.windows(2);
    let is_turned = pairs.any(|pair| (pair[1] - pair[0]).abs() > TURN_SHARE * (high - low));
    (!has_loop || is_turned).then(|| {
        let said = format!(
            "the compensation takes nothing of the drift off: the rate runs from {} to {} deg/s before it and varies as much after it. \
             Either {}it does not follow {thermometer}, or the gyro was turned. If it was, cut the rows in which it turned, or give \
             the applied rate as rate_dps",
            number(low, 4),
            number(high, 4),
            match may_be_noise {
                true => "there is no drift beyond noise, or ",
                false => "",
            }
        );
        Warning::general("no_gain", said)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Readings from 20 to 44 degC, by their number of 2400: before the compensation and after it, deg/s.
    fn nothing_gained(before: fn(u32) -> f64, after: fn(u32) -> f64) -> bool {
        gains_nothing((0..2400).map(|k| [20.0 + f64::from(k) / 100.0, before(k), after(k)]))
    }

    fn noise(k: u32) -> f64 {
        if k.is_multiple_of(2) { 1.0 } else { -1.0 }
    }

    fn slope(k: u32) -> f64 {
        f64::from(k) / 10_000.0
    }

    /// Heating and cooling differ, and no function of the temperature takes anything of that off: rows are not to blame, unless the
    /// rate jumps.
    #[test]
    fn a_loop_blames_no_rows_and_a_turn_does() {
        let said = |turned_dps: f64, has_loop| {
            let readings = (0..600).map(move |k| {
                let (sin, cos) = (f64::from(k) * std::f64::consts::TAU / 300.0).sin_cos();
                let turned = turned_dps * f64::from(u8::from((300..360).contains(&k)));
                let rate = sin + 0.2 * cos + 0.05 * noise(k) + turned;
                [25.0 + 20.0 * cos, rate, rate]
            });
            warning("die_degc", readings, has_loop, false).is_some()
        };
        assert!(said(0.0, false));
        assert!(!said(0.0, true));
        assert!(said(50.0, true));
    }

    /// A run does not know whether more than noise is there; where it is known, noise is not named.
    #[test]
    fn noise_alone_is_said_where_it_may_be_all() {
        let rate = |k: u32| slope(k) + noise(k);
        let readings = (0..600).map(|k| [20.0 + f64::from(k) / 100.0, rate(k), rate(k)]);
        let said = |may_be_noise| {
            let found = warning("die_degc", readings.clone(), false, may_be_noise);
            found.expect("a warning").message
        };
        let possible = "Either there is no drift beyond noise, or it does not follow die_degc, or";
        assert!(said(true).contains(possible), "{}", said(true));
        assert!(said(false).contains("Either it does not follow die_degc, or"));
    }

    #[test]
    fn a_mean_that_is_taken_off_is_no_gain_and_a_small_drift_in_noise_is_one() {
        // Turned for half of the record: the mean of 2.5 deg/s is a good part of the rms.
        let turned = |k: u32| if k < 1200 { 0.0 } else { 5.0 };
        assert!(nothing_gained(turned, |k| if k < 1200 {
            -2.5
        } else {
            2.5
        }));
        // The noise hides the drift from the standard deviation, and the means over bins show it.
        assert!(!nothing_gained(|k| slope(k) + noise(k), noise));
        // Half of the drift remains, and half of the standard deviation.
        assert!(!nothing_gained(slope, |k| slope(k) / 2.0));
        // Nothing is left of nothing.
        assert!(!nothing_gained(|_| 3.0, |_| 0.0));
    }
}
