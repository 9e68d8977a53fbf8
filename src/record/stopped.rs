//! A thermometer that goes on with its last reading.
//!
//! A driver that fails may repeat the last good value, for a while or for ever. Such cells are no readings where one of three
//! things is seen: the thermometer has noise, and noise does not stand still; another thermometer of the gyro moves on; or
//! the thermometer stops from one row to the next, which no heat capacity does, and the bias goes on as before.

use super::columns::unit_of;
use super::thermal::ThermalRecord;
use super::warning::Warning;
use crate::statistics::stats;
use std::ops::Range;

/// Rows that are a standstill.
const LEAST_ROWS: usize = 10;

/// Probability of a standstill by chance up to which it is one.
const CHANCE: f64 = 1e-9;

/// Noise of a thermometer, in its steps, from which on it shows.
const SHOWS: f64 = 0.6;

/// Share of its range by which another thermometer moves on.
const MOVES: f64 = 0.2;

/// The thermometers that are on the gyro: a chamber's may stand while the die follows.
const ON_GYRO: [&str; 3] = ["phase_rad", "freq_hz", "die_degc"];

/// The repeated readings become holes, and are told.
pub(super) fn take(record: &mut ThermalRecord, warnings: &mut Vec<Warning>) {
    for name in ON_GYRO {
        let Some(values) = record.column(name) else {
            continue;
        };
        let run = longest_run(values);
        let why = match run.len() > LEAST_ROWS && stats::distinct(values) >= 5 {
            true => why(record, name, values, &run),
            false => None,
        };
        let Some(why) = why else { continue };
        let from = record.place(run.start);
        let value = values.get(run.start).copied().unwrap_or(f64::NAN);
        warnings.push(Warning::on(
            "frozen_channel",
            name,
            format!(
                "{name} stands at exactly {value} {} for {} rows from {from}, while {why}: the last good reading, \
                 repeated. The {} repetitions count as not measured",
                unit_of(name),
                run.len(),
                run.len() - 1
            ),
        ));
        if let Some(values) = record.columns.get_mut(name) {
            let repeated = values.get_mut(run.start + 1..run.end);
            repeated.into_iter().for_each(|cells| cells.fill(f64::NAN));
        }
    }
}

/// The longest run of exactly equal readings.
fn longest_run(values: &[f64]) -> Range<usize> {
    let mut best = 0..0;
    let mut start = 0;
    while start < values.len() {
        let same = values[start..].iter().take_while(|v| **v == values[start]);
        let end = start + same.count().max(1);
        if end - start > best.len() && !values[start].is_nan() {
            best = start..end;
        }
        start = end;
    }
    best
}

/// What shows that a standstill is none; `None`: it may be one.
fn why(
    record: &ThermalRecord,
    name: &str,
    values: &[f64],
    run: &Range<usize>,
) -> Option<&'static str> {
    let outside = |v: &[f64]| -> Vec<f64> {
        let before = v.get(..run.start).unwrap_or(&[]);
        let after = v.get(run.end..).unwrap_or(&[]);
        before.iter().chain(after).copied().collect()
    };
    let others = outside(values);
    let (low, high) = stats::extremes(&others)?;
    let step = stats::lattice_step(&others).unwrap_or(0.0);
    let noise = stats::curvature_noise(&others);
    if noise > SHOWS * step && noise > 1e-6 * (high - low) {
        let equal = others.windows(2).filter(|w| w[0] == w[1]).count();
        let seen = (equal as f64 + 1.0) / (others.len() as f64 + 2.0);
        // Two normal readings round to the same step so often.
        let expected = step / (noise * 2.0 * std::f64::consts::PI.sqrt());
        let often = seen.max(expected);
        let chance = (values.len() as f64).ln() + run.len() as f64 * often.ln();
        if often < 1.0 && chance < CHANCE.ln() {
            return Some("its noise elsewhere moves it from row to row");
        }
    }
    let smooth = |v: &[f64]| -> Vec<f64> { v.chunks(9).map(stats::median).collect() };
    let moved = |other: &[f64]| -> Option<f64> {
        let (low, high) = stats::extremes(&smooth(other))?;
        let (a, b) = stats::extremes(&smooth(other.get(run.clone())?))?;
        (high > low).then(|| (b - a) / (high - low))
    };
    let shows = MOVES * (high - low) > 3.0 * step;
    let others = ON_GYRO.iter().chain(&["chamber_degc"]);
    for other in others.filter(|o| **o != name) {
        let part = record.column(other).and_then(moved);
        if shows && part.is_some_and(|part| part > MOVES) {
            return Some("another thermometer moves on");
        }
    }
    let stops = stops_at_once(values, run);
    (stops && bias_goes_on(record, run)).then_some("the bias goes on as before")
}

/// Whether the readings before a run move evenly, in steps of their own, and it begins without slowing down.
fn stops_at_once(values: &[f64], run: &Range<usize>) -> bool {
    let from = run.start.saturating_sub(LEAST_ROWS);
    let Some(before) = values.get(from..=run.start) else {
        return false;
    };
    let steps: Vec<f64> = before.windows(2).map(|w| w[1] - w[0]).collect();
    let usual = stats::median(&steps);
    let last = steps.get(steps.len().saturating_sub(3)..).unwrap_or(&[]);
    steps.len() >= LEAST_ROWS && usual != 0.0 && last.iter().all(|s| s / usual > 0.5)
}

/// Whether the error signal moves in the later half of a run as fast as before it, by half at least, well beyond noise.
fn bias_goes_on(record: &ThermalRecord, run: &Range<usize>) -> bool {
    let error = record.error_dps();
    let half = run.len() / 2;
    let noise = stats::difference_noise(&error);
    let change = |rows: Range<usize>| -> Option<f64> {
        let part = error.get(rows)?;
        let third = (part.len() / 3).max(1);
        let last = part.get(part.len() - third..)?;
        Some(stats::median(last) - stats::median(part.get(..third)?))
    };
    let (Some(start), true) = (run.start.checked_sub(half), half >= LEAST_ROWS / 2) else {
        return false;
    };
    let (Some(before), Some(later)) = (change(start..run.start), change(run.end - half..run.end))
    else {
        return false;
    };
    let third = (half as f64 / 3.0).max(1.0);
    later / before > 0.5 && later.abs() > 6.0 * noise / third.sqrt()
}

#[cfg(test)]
mod tests {
    use super::super::thermal::parse;
    use crate::design::RecordMapping;
    use std::path::Path;

    fn noise(k: usize) -> f64 {
        let x = (k as u64 + 3).wrapping_mul(0x9E37_79B9_7F4A_7C15);
        ((x ^ (x >> 29)).wrapping_mul(0xBF58_476D_1CE4_E5B9) >> 40) as f64 / 16_777_216.0 - 0.5
    }

    /// How many of 200 readings of the die are left, with a die that is read so and a bias that follows the true one.
    fn left(read: impl Fn(usize) -> f64, die: impl Fn(usize) -> f64, more: Option<&str>) -> usize {
        let name = more.unwrap_or("note");
        let mut text = format!("time_s,rate_out_dps,die_degc,{name}\n");
        for k in 0..200 {
            let bias = 0.3 + 0.01 * (die(k) - 20.0) + 0.01 * noise(k);
            let other = if more.is_some() { die(k) } else { 1.0 };
            text += &format!("{k},{bias:.6},{:.6},{other:.4}\n", read(k));
        }
        let (r, w) = parse(
            text.as_bytes(),
            Path::new("r.csv"),
            &RecordMapping::default(),
        )
        .unwrap();
        let measured = r.measured("die_degc");
        let told = w
            .iter()
            .any(|w| w.message.contains("count as not measured"));
        assert_eq!(told, measured < 200, "{w:?}");
        measured
    }

    #[test]
    fn the_last_good_value_for_ever_is_no_reading() {
        let ramp = |k: usize| 20.0 + 0.2 * k as f64;
        let stuck = |at: usize, v: fn(usize) -> f64| move |k: usize| v(k.min(at));
        let noisy = |k: usize| 20.0 + 0.2 * k as f64 + 0.1 * noise(k);
        for at in [80, 126, 170] {
            assert_eq!(left(stuck(at, ramp), ramp, None), at + 1, "{at}");
            assert_eq!(left(stuck(at, noisy), ramp, None), at + 1, "{at}");
            assert_eq!(
                left(stuck(at, ramp), ramp, Some("chamber_degc")),
                at + 1,
                "{at}"
            );
        }
        // For a while.
        let middle = |k: usize| {
            if (60..110).contains(&k) {
                ramp(60)
            } else {
                ramp(k)
            }
        };
        assert_eq!(left(middle, ramp, None), 200 - 49);
    }

    #[test]
    fn a_dwell_is_a_dwell() {
        let dwell = |k: usize| 20.0 + 0.2 * k.min(120) as f64;
        assert_eq!(left(dwell, dwell, None), 200);
        assert_eq!(left(dwell, dwell, Some("chamber_degc")), 200);
        let coarse = |k: usize| (20.0 + 0.2 * k.min(120) as f64 + 0.1 * noise(k)).round();
        assert_eq!(left(coarse, dwell, None), 200);
        let settles = |k: usize| 60.0 - 40.0 * (-(k as f64) / 20.0).exp();
        let read = |k: usize| (settles(k) * 10.0).round() / 10.0;
        assert_eq!(left(read, settles, None), 200);
    }
}
