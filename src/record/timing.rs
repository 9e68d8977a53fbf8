//! Is the clock of a record in seconds since its start, and were there rows all the time?

use super::thermal::ThermalRecord;
use super::warning::Warning;
use crate::design::units;
use crate::statistics::stats;
use crate::text::number;

/// No die moves faster over 10 K, K/s: a chamber's ramp makes 0.2, power-on and hot air 0.5. Ramps
/// of 1.5 K/min and more are told from it when their minutes pass for seconds.
const FASTEST_K_PER_S: f64 = 1.5;

/// Rows further apart make no thermal record, s (convention).
const MOST_STEP_S: f64 = 3600.0;

/// Movement that counts as such, K.
const LEAST_MOVE_K: f64 = 10.0;

/// Shorter pauses between rows are not told, s: few lags of a gyro end sooner (convention).
const LEAST_GAP_S: f64 = 60.0;

/// Pauses are that much longer than the median step (convention).
const LEAST_GAP_STEPS: f64 = 20.0;

/// One pause in so many steps is a gap; more of them are a program that has pauses (convention).
const STEPS_A_GAP: usize = 50;

/// Warnings for a clock in another unit, or of calendar time, and for a gap.
pub(super) fn check(record: &ThermalRecord) -> Vec<Warning> {
    let found = unit(record);
    let clock_leaps = found.as_ref().map(|w| w.code) == Some("time_step_implausible");
    let gap = gap(record).filter(|_| !clock_leaps);
    found.into_iter().chain(gap).collect()
}

/// The longest gap of a record that has few.
fn gap(record: &ThermalRecord) -> Option<Warning> {
    let steps: Vec<f64> = record.time_s.windows(2).map(|w| w[1] - w[0]).collect();
    let least_s = LEAST_GAP_S.max(LEAST_GAP_STEPS * stats::median(&steps));
    let gaps = steps.iter().enumerate().filter(|(_, s)| **s > least_s);
    let count = gaps.clone().count();
    let (before, gap_s) = gaps.max_by(|a, b| a.1.total_cmp(b.1))?;
    let others = match count {
        1 => String::new(),
        n => format!(" (the longest of {n} gaps)"),
    };
    (count <= (steps.len() / STEPS_A_GAP).max(1)).then(|| {
        Warning::on(
            "time_gap",
            "time_s",
            format!(
                "{} is {} s after {}{others}: what happened between was not measured, and a lag or a slow walk across it may be wrong",
                record.place(before + 1),
                number(*gap_s, 4),
                record.place(before)
            ),
        )
    })
}

/// A clock in another unit, or of calendar time.
fn unit(record: &ThermalRecord) -> Option<Warning> {
    let (first, last) = (*record.time_s.first()?, *record.time_s.last()?);
    if first > 1e8 {
        return Some(Warning::on(
            "time_is_calendar_time",
            "time_s",
            format!(
                "time_s starts at {first:.0} s, which looks like calendar time. Warm-up effects need the time since the record's \
                 start. Subtract the first row's time"
            ),
        ));
    }
    clocks(record)
        .or_else(|| too_long(record, last - first))
        .or_else(|| too_short(record))
}

/// Milliseconds for seconds.
fn too_long(record: &ThermalRecord, lasts_s: f64) -> Option<Warning> {
    let steps: Vec<f64> = record.time_s.windows(2).map(|w| w[1] - w[0]).collect();
    let step = stats::median(&steps);
    let days = lasts_s / 86_400.0;
    // A clock that is set while it runs: all but one step is short.
    let leap = steps.iter().copied().enumerate();
    let leap = leap.max_by(|a, b| a.1.total_cmp(&b.1)).unwrap_or((0, 0.0));
    if days > 5.0 && leap.1 > 0.9 * lasts_s && leap.1 > 1e4 * step {
        let at = |row: usize| record.time_s.get(row).copied().unwrap_or(f64::NAN);
        return Some(Warning::on(
            "time_step_implausible",
            "time_s",
            format!(
                "the clock leaps from {} to {} s ({}), and the other rows are {step} s apart. It looks like a clock that was set \
                 within the record. Make it one clock, or close the two parts one by one",
                at(leap.0),
                at(leap.0 + 1),
                record.place(leap.0 + 1)
            ),
        ));
    }
    // Rows that are whole thousands of seconds apart are of no logger.
    let thousands = step >= 1000.0 && record.time_s.iter().all(|t| t % 1000.0 == 0.0);
    (step > 3600.0 || days > 5.0 || thousands).then(|| {
        let (unit, name, per_s) = likely(step);
        // What looks like milliseconds after milliseconds were taken off is microseconds.
        let name = match record.unit_in_file("time_s", unit) {
            Some(own) if own != unit => own,
            _ => name,
        };
        Warning::on(
            "time_step_implausible",
            "time_s",
            format!(
                "the record lasts {days:.1} days with {step} s between rows. It looks like {name}: the rows are {} s apart \
                 then. If it is, divide by {per_s}, or say so: {}",
                step / per_s,
                record.unit_in_design("time_s", unit)
            ),
        )
    })
}

/// The unit in which the rows are nearest to 1 s apart: its name, how many of it are a second.
fn likely(step: f64) -> (&'static str, &'static str, f64) {
    const UNITS: [(&str, &str, f64); 3] = [
        ("ms", "milliseconds", 1e3),
        ("us", "microseconds", 1e6),
        ("ns", "nanoseconds", 1e9),
    ];
    let off = |per_s: f64| (step / per_s).log10().abs();
    let [first, others @ ..] = UNITS;
    others.into_iter().fold(
        first,
        |best, u| if off(u.2) < off(best.2) { u } else { best },
    )
}

/// The two clocks of a record run alike, except where one restarts.
fn clocks(record: &ThermalRecord) -> Option<Warning> {
    let power_on = record.column("time_since_power_on_s")?;
    let steps = |v: &[f64]| -> Vec<f64> { v.windows(2).map(|w| w[1] - w[0]).collect() };
    let ratios: Vec<f64> = steps(power_on)
        .iter()
        .zip(steps(&record.time_s))
        .filter(|(p, t)| **p > 0.0 && *t > 0.0)
        .map(|(p, t)| p / t)
        .collect();
    let ratio = stats::median(&ratios);
    (ratios.len() >= 10 && !(0.9..=1.1).contains(&ratio)).then(|| {
        Warning::on(
            "clocks_disagree",
            "time_since_power_on_s",
            format!(
                "time_since_power_on_s advances by {ratio:.6} s for each s of time_s. One of them is in another unit (minutes, \
                 ms). Say its unit in [record.columns]"
            ),
        )
    })
}

/// Minutes for seconds: the die moves faster than one can. Once and in no time: two records.
fn too_short(record: &ThermalRecord) -> Option<Warning> {
    let die = record.column("die_degc")?;
    // In another unit it says nothing of the clock's.
    if !(-100.0..=250.0).contains(&stats::median(die)) {
        return None;
    }
    // Medians of five rows, so that a glitch is no movement.
    let points: Vec<(f64, f64)> = die
        .chunks(5)
        .zip(record.time_s.chunks(5))
        .map(|(d, t)| (stats::median(t), stats::median(d)))
        .filter(|(_, d)| !d.is_nan())
        .collect();
    let (mut fastest, mut jump) = (0.0f64, None);
    let mut lag = 2;
    while lag < points.len() {
        let middles = points.iter().skip(lag / 2);
        for ((a, m), b) in points.iter().zip(middles).zip(points.iter().skip(lag)) {
            let (time, moved) = (b.0 - a.0, b.1 - a.1);
            if moved.abs() < LEAST_MOVE_K || moved.abs() <= FASTEST_K_PER_S * time {
                continue;
            }
            // A ramp is half way in the middle, a jump is over or yet to come.
            if (0.2..=0.8).contains(&((m.1 - a.1) / moved)) {
                fastest = fastest.max(moved.abs() / time.max(f64::MIN_POSITIVE));
            } else if lag == 2 {
                jump = jump.or(Some((a, b)));
            }
        }
        lag *= 2;
    }
    if let (Some((a, b)), 0.0) = (jump, fastest) {
        let (from, to) = largest_step(&record.time_s, die, a.0, b.0)?;
        let at = |row: usize| record.time_s.get(row).copied().unwrap_or(f64::NAN);
        let line = format!(" ({})", record.place(to));
        return Some(Warning::on(
            "record_spliced",
            "die_degc",
            format!(
                "die_degc jumps from {:.1} to {:.1} degC between {:.1} and {:.1} s{line}, faster than a die can. It looks like two \
                 sessions in one file: whatever else changed between them (orientation, mounting, power) cannot be told from \
                 the temperature. Record both temperatures in one session, give time_s the pause between them, or close them \
                 one by one",
                die[from],
                die[to],
                at(from),
                at(to)
            ),
        ));
    }
    (fastest > FASTEST_K_PER_S).then(|| {
        Warning::on(
            "time_step_implausible",
            "time_s",
            format!(
                "die_degc moves by {LEAST_MOVE_K} K and more at {fastest:.2} K/s, faster than a die can. {}",
                slower_units(record, fastest)
            ),
        )
    })
}

/// How far apart the rows are as the times were understood, the units in which the die is slow enough, and the line to write
/// for the first of them.
fn slower_units(record: &ThermalRecord, fastest_k_per_s: f64) -> String {
    const UNITS: [&str; 6] = ["us", "ms", "s", "min", "h", "d"];
    let taken = record.units.get("time_s");
    let (name, times) = taken.map_or(("s", 1.0), |u| (u.name, u.times));
    let steps: Vec<f64> = record.time_s.windows(2).map(|w| w[1] - w[0]).collect();
    let step_s = stats::median(&steps);
    let column = record
        .renamed
        .get("time_s")
        .map_or("time_s", String::as_str);
    let units: Vec<(&str, f64)> = UNITS
        .iter()
        .filter_map(|unit| Some((*unit, units::parse(unit)?.times / times)))
        .filter(|(_, longer)| fastest_k_per_s <= FASTEST_K_PER_S * longer)
        .filter(|(_, longer)| longer * step_s <= MOST_STEP_S)
        .take(2)
        .collect();
    let as_taken = format!(
        "Column {column} is taken as {name}, and its rows are {} s apart then (median)",
        number(step_s, 3)
    );
    let each: Vec<String> = units
        .iter()
        .map(|(unit, longer)| {
            format!(
                "in {unit} they are {} s apart, and the die moves at {} K/s",
                number(longer * step_s, 3),
                number(fastest_k_per_s / longer, 3)
            )
        })
        .collect();
    match units.first() {
        Some((unit, _)) => format!(
            "{as_taken}; {}. If it is in {unit}, say so: {}",
            each.join("; "),
            record.line_for("time_s", unit)
        ),
        None => format!("{as_taken}. Correct the times in the file"),
    }
}

/// The rows before and behind the largest step of a channel within a time.
fn largest_step(time_s: &[f64], values: &[f64], from_s: f64, to_s: f64) -> Option<(usize, usize)> {
    let is_read = |i: &usize| (from_s..=to_s).contains(&time_s[*i]) && !values[*i].is_nan();
    let rows: Vec<usize> = (0..values.len()).filter(is_read).collect();
    let steps = rows.windows(2).map(|w| (w[0], w[1]));
    let size = |s: &(usize, usize)| (values[s.1] - values[s.0]).abs();
    steps.max_by(|a, b| size(a).total_cmp(&size(b)))
}

#[cfg(test)]
mod tests {
    use super::super::thermal::parse;
    use crate::design::RecordMapping;
    use std::path::Path;

    fn codes(header: &str, row: impl Fn(f64) -> String) -> Vec<&'static str> {
        let rows: String = (0..400).map(|k| row(f64::from(k)) + "\n").collect();
        let text = format!("{header}\n{rows}");
        let mapping = RecordMapping::default();
        let (_, warnings) = parse(text.as_bytes(), Path::new("r.csv"), &mapping).unwrap();
        warnings.iter().map(|w| w.code).collect()
    }

    #[test]
    fn minutes_are_told_from_seconds_by_the_die() {
        let header = "time_s,rate_out_dps,die_degc";
        // 2 K/min up and down over 70 K, a row every 10 s; one glitch of the thermometer.
        let die = |k: f64| {
            let glitch = if k == 50.0 { 80.0 } else { 0.0 };
            70.0 - (70.0 - k / 3.0).abs() + glitch
        };
        let row = |unit: f64| move |k: f64| format!("{},{},{}", unit * k, (k * 1.7).sin(), die(k));
        assert_eq!(codes(header, row(10.0)), ["error_values"]);
        for unit in [10.0 / 60.0, 10_000.0] {
            let found = codes(header, row(unit));
            assert_eq!(found, ["error_values", "time_step_implausible"], "{unit}");
        }
    }

    #[test]
    fn seconds_under_a_name_of_milliseconds_get_a_whole_sentence() {
        let die = |k: f64| 70.0 - (70.0 - k / 3.0).abs();
        let rows: String = (0..400)
            .map(f64::from)
            .map(|k| format!("{},{},{}\n", 10.0 * k, (k * 1.7).sin(), die(k)))
            .collect();
        let text = format!("t_ms,rate_out_dps,die_degc\n{rows}");
        let mapping = RecordMapping {
            columns: [("time_s".to_owned(), "t_ms".into())].into(),
            ..RecordMapping::default()
        };
        let (_, warnings) = parse(text.as_bytes(), Path::new("r.csv"), &mapping).unwrap();
        let found = warnings.iter().find(|w| w.code == "time_step_implausible");
        let said = found.expect("a warning").message.clone();
        for piece in [
            "Column t_ms is taken as ms",
            "in s they are 10",
            "rename the column in the file",
            "time_s = { column = \"x\", unit = \"s\" }",
        ] {
            assert!(said.contains(piece), "{piece}: {said}");
        }
    }

    #[test]
    fn two_sessions_without_their_pause_are_no_ramp() {
        let header = "time_s,rate_out_dps,die_degc";
        for at in 200..206 {
            let die = |k: f64| if k < f64::from(at) { 13.0 } else { 47.0 };
            let row = |pause: f64| {
                move |k: f64| {
                    let time = if k < f64::from(at) { k } else { k + pause };
                    format!("{time},{},{}", (k * 1.7).sin(), die(k) + 0.01 * (k % 7.0))
                }
            };
            assert_eq!(codes(header, row(0.0)), ["record_spliced"], "{at}");
            let rows: String = (0..400).map(|k| row(0.0)(f64::from(k)) + "\n").collect();
            let text = format!("{header}\n{rows}");
            let mapping = RecordMapping::default();
            let (_, warnings) = parse(text.as_bytes(), Path::new("r.csv"), &mapping).unwrap();
            let place = format!("between {}.0 and {at}.0 s (line {})", at - 1, at + 2);
            assert!(warnings[0].message.contains(&place), "{warnings:?}");
            // With its pause it is one session with a gap.
            assert_eq!(codes(header, row(600.0)), ["time_gap"], "{at}");
        }
    }

    #[test]
    fn a_gap_is_told_once_with_its_rows_and_a_program_of_pauses_is_none() {
        let said = |time_s: &dyn Fn(f64) -> f64| {
            let rows: String = (0..400)
                .map(f64::from)
                .map(|k| format!("{},{},{}\n", time_s(k), (k * 1.7).sin(), 20.0 + 0.1 * k))
                .collect();
            let text = format!("time_s,rate_out_dps,die_degc\n{rows}");
            let mapping = RecordMapping::default();
            let (_, warnings) = parse(text.as_bytes(), Path::new("r.csv"), &mapping).unwrap();
            let told = warnings.iter().map(|w| (w.code, w.message.clone()));
            told.collect::<Vec<_>>()
        };
        let paused = |k: f64, at: f64, pause_s: f64| if k < at { 0.0 } else { pause_s };
        let one = said(&|k| 0.25 * k + paused(k, 200.0, 3599.75));
        assert_eq!(one.len(), 1, "{one:?}");
        assert_eq!(one[0].0, "time_gap");
        assert_eq!(
            one[0].1,
            "line 202 is 3600 s after line 201: what happened between was not measured, and a lag or a slow walk across it may be \
             wrong"
        );
        // The longer of two.
        let two = said(&|k| k + paused(k, 100.0, 99.0) + paused(k, 300.0, 199.0));
        let start = "line 302 is 200.0 s after line 301 (the longest of 2 gaps): ";
        assert!(two.len() == 1 && two[0].1.starts_with(start), "{two:?}");
        // Too short a pause; rows as far apart as the pause; a pause every tenth row, as at a chamber's set points.
        for time_s in [
            &(|k: f64| 0.25 * k + paused(k, 200.0, 50.0)) as &dyn Fn(f64) -> f64,
            &|k: f64| 10.0 * k + paused(k, 200.0, 150.0),
            &|k: f64| 10.0 * k + 900.0 * (k / 10.0).floor(),
        ] {
            let told = said(time_s);
            assert!(told.is_empty(), "{told:?}");
        }
        // A clock that was set leaves no gap.
        let set = said(&|k| k + paused(k, 100.0, 1.7e9));
        assert!(set.iter().all(|w| w.0 != "time_gap"), "{set:?}");
    }

    #[test]
    fn a_clock_that_is_set_within_the_record_is_in_no_other_unit() {
        let time = |k: f64| if k < 100.0 { k } else { 1.7e9 + k };
        let rows: String = (0..400)
            .map(f64::from)
            .map(|k| format!("{},{},{}\n", time(k), (k * 1.7).sin(), 20.0 + 0.1 * k))
            .collect();
        let text = format!("time_s,rate_out_dps,die_degc\n{rows}");
        let mapping = RecordMapping::default();
        let (_, warnings) = parse(text.as_bytes(), Path::new("r.csv"), &mapping).unwrap();
        let told = warnings
            .iter()
            .find(|w| w.code == "time_step_implausible")
            .unwrap();
        assert!(
            told.message.contains("from 99 to 1700000100 s (line 102)"),
            "{told:?}"
        );
        assert!(!told.message.contains("milliseconds"), "{told:?}");
    }

    #[test]
    fn two_clocks_run_alike() {
        let header = "time_s,time_since_power_on_s,rate_out_dps";
        let row = |unit: f64| {
            move |k: f64| format!("{k},{},{}", unit * (k % 150.0 + 3.0), (k * 1.7).sin())
        };
        assert!(codes(header, row(1.0)).is_empty());
        for unit in [1e3, 1.0 / 60.0] {
            assert_eq!(codes(header, row(unit)), ["clocks_disagree"]);
        }
    }
}
