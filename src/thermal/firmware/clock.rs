//! The clock of the firmware beside the record's rows.
//!
//! Firmware steps once a period, all the time; a record keeps some of its readings, at times that need not
//! lie on the firmware's grid. Between two rows of one power-on the firmware has read what the logger
//! did not keep: its inputs are taken on the straight line between the rows.

use crate::correction::Reading;

/// Parts of the rows' period that a firmware's period is tried as.
const PARTS: [u32; 7] = [1, 2, 3, 4, 6, 8, 12];

/// How far rows may lie from the firmware's grid (rms), in periods of the rows.
const OFF: f64 = 0.04;

/// Most readings in a gap.
const MOST_BETWEEN: u64 = 4096;

/// The period of a firmware with a memory, s: the rows' own, or the largest part of it on whose grid all rows
/// nearly lie. `on_s`: times since power-on.
pub fn period_s(on_s: &[f64], rows_s: f64) -> f64 {
    let off = |parts: u32| {
        let period = rows_s / f64::from(parts);
        let square = |t: &f64| (t - (t / period).round() * period).powi(2);
        (on_s.iter().map(square).sum::<f64>() / on_s.len().max(1) as f64).sqrt() / rows_s
    };
    let parts = PARTS.into_iter().find(|p| off(*p) <= OFF);
    rows_s / f64::from(parts.unwrap_or(PARTS[PARTS.len() - 1]))
}

/// The readings with those between them that fall on the firmware's grid (their rate is not known: NaN), and
/// where the given ones are. `through_off`: also those that firmware makes up for when power returns, for
/// states that go on without it.
pub fn with_between(
    period_s: f64,
    readings: &[Reading],
    through_off: bool,
) -> (Vec<Reading>, Vec<usize>) {
    let mut all: Vec<Reading> = Vec::with_capacity(readings.len());
    let mut places = Vec::with_capacity(readings.len());
    for (k, reading) in readings.iter().enumerate() {
        let before = k.checked_sub(1).map(|b| &readings[b]);
        for at_s in before.map_or(Vec::new(), |b| moments(period_s, b, reading, through_off)) {
            all.extend(before.map(|b| between(b, reading, at_s)));
        }
        places.push(all.len());
        all.push(reading.clone());
    }
    (all, places)
}

/// Time since power-on, s.
fn on_s(reading: &Reading) -> f64 {
    reading.time_since_power_on_s.unwrap_or(reading.time_s)
}

/// When firmware steps between two rows, s after the first: on its grid since power-on, or, across an
/// interruption, once a period until the restart, which is a step of its own.
fn moments(period_s: f64, a: &Reading, b: &Reading, through_off: bool) -> Vec<f64> {
    let grid = |on_s: f64| (on_s / period_s).round();
    let (from_s, steps) = if on_s(a) < on_s(b) {
        let offset = grid(on_s(a)) * period_s - on_s(a);
        (offset, grid(on_s(b)) - grid(on_s(a)))
    } else if through_off {
        (0.0, grid(b.time_s - on_s(b) - a.time_s))
    } else {
        return Vec::new();
    };
    let steps = steps.max(0.0) as u64;
    if !(2..=MOST_BETWEEN).contains(&steps) {
        return Vec::new();
    }
    (1..steps).map(|j| from_s + j as f64 * period_s).collect()
}

/// `after_s` later than `a`, on the line from `a` to `b`.
fn between(a: &Reading, b: &Reading, after_s: f64) -> Reading {
    let powered = on_s(a) < on_s(b);
    let span_s = if powered {
        on_s(b) - on_s(a)
    } else {
        b.time_s - a.time_s
    };
    let share = (after_s / span_s).clamp(0.0, 1.0);
    let pairs = a.inputs.iter().zip(&b.inputs);
    Reading {
        time_s: a.time_s + after_s,
        time_since_power_on_s: a.time_since_power_on_s.map(|t| t + after_s),
        inputs: pairs.map(|(a, b)| a + share * (b - a)).collect(),
        rate_out_dps: f64::NAN,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn reading(on_s: f64, input: f64) -> Reading {
        Reading {
            time_s: 100.0 + on_s,
            time_since_power_on_s: Some(on_s),
            inputs: vec![input],
            rate_out_dps: input,
        }
    }

    #[test]
    fn rows_on_the_grid_keep_their_period_and_rows_beside_it_get_a_finer_one() {
        let even: Vec<f64> = (0..50).map(|k| 60.0 * f64::from(k)).collect();
        assert_eq!(period_s(&even, 60.0), 60.0);
        let quarters: Vec<f64> = (0..50)
            .map(|k| 60.0 * f64::from(k) + 15.0 * f64::from(k % 3))
            .collect();
        assert_eq!(period_s(&quarters, 60.0), 15.0);
        // Anywhere: on a grid of eighths they are off by 1 / (8 sqrt(12)) of the period, 3.6 %.
        let any: Vec<f64> = (0..50)
            .map(|k| 60.0 * (f64::from(k) * 1.618).fract() + 60.0 * f64::from(k))
            .collect();
        assert_eq!(period_s(&any, 60.0), 7.5);
    }

    #[test]
    fn what_the_logger_did_not_keep_lies_on_the_line_and_not_across_a_power_on() {
        let rows = [
            reading(0.0, 1.0),
            reading(60.0, 4.0),
            reading(0.0, 9.0),
            reading(20.0, 8.0),
        ];
        let (all, places) = with_between(20.0, &rows, false);
        assert_eq!(places, [0, 3, 4, 5]);
        assert_eq!(all[1].inputs, [2.0]);
        assert_eq!(all[2].inputs, [3.0]);
        assert_eq!(
            (all[1].time_s, all[1].time_since_power_on_s),
            (120.0, Some(20.0))
        );
        assert!(all[1].rate_out_dps.is_nan());
        for (row, place) in rows.iter().zip(&places) {
            assert_eq!(row.rate_out_dps, all[*place].rate_out_dps);
        }
    }

    #[test]
    fn across_a_power_on_it_lies_on_the_line_up_to_the_restart() {
        // Off at 160 s, on again at 240 s, first read 10 s later.
        let mut rows = [reading(60.0, 1.0), reading(10.0, 10.0)];
        rows[1].time_s = 250.0;
        let (all, places) = with_between(20.0, &rows, true);
        assert_eq!(places, [0, 4]);
        let times: Vec<f64> = all.iter().map(|r| r.time_s).collect();
        assert_eq!(times, [160.0, 180.0, 200.0, 220.0, 250.0]);
        let inputs: Vec<f64> = all.iter().map(|r| r.inputs[0]).collect();
        assert_eq!(inputs, [1.0, 3.0, 5.0, 7.0, 10.0]);
        assert_eq!(all[3].time_since_power_on_s, Some(120.0));
        // Off for less than a period and a half: the restart is the only step.
        rows[1].time_s = 198.0;
        assert_eq!(with_between(20.0, &rows, true).1, [0, 1]);
    }
}
