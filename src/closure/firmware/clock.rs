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
/// where the given ones are.
pub fn with_between(period_s: f64, readings: &[Reading]) -> (Vec<Reading>, Vec<usize>) {
    let mut all: Vec<Reading> = Vec::with_capacity(readings.len());
    let mut places = Vec::with_capacity(readings.len());
    let on = |r: &Reading| r.time_since_power_on_s.unwrap_or(r.time_s);
    let grid = |r: &Reading| (on(r) / period_s).round();
    for (k, reading) in readings.iter().enumerate() {
        let before = k.checked_sub(1).map(|b| &readings[b]);
        if let Some(before) = before.filter(|b| on(b) < on(reading)) {
            let steps = (grid(reading) - grid(before)).max(0.0) as u64;
            if (2..=MOST_BETWEEN).contains(&steps) {
                for j in 1..steps {
                    let at = (grid(before) + j as f64) * period_s;
                    all.push(between(before, reading, at - on(before)));
                }
            }
        }
        places.push(all.len());
        all.push(reading.clone());
    }
    (all, places)
}

/// `after_s` later than `a`, on the line from `a` to `b`.
fn between(a: &Reading, b: &Reading, after_s: f64) -> Reading {
    let on = |r: &Reading| r.time_since_power_on_s.unwrap_or(r.time_s);
    let share = (after_s / (on(b) - on(a))).clamp(0.0, 1.0);
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
        let (all, places) = with_between(20.0, &rows);
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
}
