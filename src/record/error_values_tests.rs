//! Error values in records whose readings are known, and readings that are none.

use super::super::thermal::parse;
use super::super::warning::Warning;
use super::{Kind, kind_of, marks};
use crate::design::RecordMapping;
use std::path::Path;

fn noise(k: usize) -> f64 {
    let x = (k as u64 + 7).wrapping_mul(0x9E37_79B9_7F4A_7C15);
    ((x ^ (x >> 29)).wrapping_mul(0xBF58_476D_1CE4_E5B9) >> 40) as f64 / 16_777_216.0 - 0.5
}

fn kind() -> Kind {
    kind_of("die_degc").unwrap()
}

/// The marked cells of 200 rows, `dt_s` apart.
fn found(dt_s: f64, kind: Kind, value: impl Fn(usize) -> f64) -> Vec<usize> {
    let time: Vec<f64> = (0..200).map(|k| dt_s * k as f64).collect();
    let values: Vec<f64> = (0..200).map(value).collect();
    let marks = marks(&time, &values, kind);
    (0..200).filter(|i| marks[*i]).collect()
}

/// A name, and a reading by row.
type Course = (&'static str, fn(usize) -> f64);

#[test]
fn error_values_of_any_kind_and_share_are_found_in_a_ramp() {
    let ramps: [Course; 4] = [
        ("exact", |k| 20.0 + 0.2 * k as f64),
        ("noisy", |k| 20.0 + 0.2 * k as f64 + 0.3 * noise(k)),
        ("coarse", |k| (20.0 + 0.2 * k as f64).round()),
        // Through zero, up and down.
        ("cycle", |k| 60.0 - (100.0 - k as f64).abs() - 0.013),
    ];
    for (name, ramp) in ramps {
        for value in [0.0, 85.0, -127.0, 65535.0, 999.0, -40.0, 127.94] {
            for share in [0.015, 0.1, 0.3, 0.6] {
                let bad = |k: usize| noise(1000 + k) + 0.5 < share;
                // Where the die itself is near the value nothing can be told.
                let told = |k: &usize| {
                    bad(*k) && (ramp(*k) - value).abs() > if share > 0.5 { 20.0 } else { 12.0 }
                };
                let expected: Vec<usize> = (0..200).filter(told).collect();
                let cells = found(1.0, kind(), |k| if bad(k) { value } else { ramp(k) });
                let missed: Vec<_> = expected.iter().filter(|i| !cells.contains(i)).collect();
                let wrong: Vec<_> = cells.iter().filter(|i| !bad(**i)).collect();
                assert!(
                    missed.is_empty() && wrong.is_empty(),
                    "{name} {value} {share}: missed {missed:?}, wrongly {wrong:?}"
                );
            }
        }
        assert!(found(1.0, kind(), ramp).is_empty(), "{name}");
        assert!(found(60.0, kind(), ramp).is_empty(), "{name}");
    }
}

#[test]
fn a_block_at_the_start_in_the_middle_or_at_the_end_is_found() {
    for rows in [0..3, 0..1, 80..120, 150..200, 199..200] {
        let value = |k: usize| match rows.contains(&k) {
            true => 85.0,
            false => 20.0 + 0.2 * k as f64 + 0.05 * noise(k),
        };
        assert_eq!(found(10.0, kind(), value), rows.clone().collect::<Vec<_>>());
    }
}

#[test]
fn a_value_at_an_end_is_judged_by_one_neighbour() {
    let ramp = |k: usize| 40.0 + 0.335 * k as f64 + 0.01 * noise(k);
    for cells in [1, 2, 5, 20] {
        let start = found(1.0, kind(), |k| if k < cells { 25.0 } else { ramp(k) });
        assert_eq!(start, (0..cells).collect::<Vec<_>>(), "{cells}");
    }
    // As much as a die moves in the time between the rows, or a part of the record of its own.
    let few = |k: usize| if k < 5 { 25.0 } else { ramp(k) };
    let part = |k: usize| if k < 60 { 25.0 } else { ramp(k - 60) };
    assert!(found(60.0, kind(), few).is_empty() && found(1.0, kind(), part).is_empty());
    // Of a channel without a heat capacity it may be a setting.
    let setting = Kind {
        inert: false,
        ..kind()
    };
    assert!(found(1.0, setting, few).is_empty());
}

#[test]
fn several_values_and_single_glitches_are_found_together() {
    let value = |k: usize| match k {
        30 | 90 | 91 => 0.0,
        31 | 140 => -127.0,
        60 => 71.3,
        _ => 20.0 + 0.2 * k as f64 + 0.05 * noise(k),
    };
    assert_eq!(found(1.0, kind(), value), [30, 31, 60, 90, 91, 140]);
}

#[test]
fn what_a_chamber_does_is_no_error() {
    let none: [Course; 8] = [
        ("set points at random", |k| {
            [0.0, 70.0, 5.0, 65.0, 10.0][(k * 7 / 3) % 5]
        }),
        ("shock", |k| if (k / 20) % 2 == 0 { -40.0 } else { 85.0 }),
        ("shock, noisy", |k| {
            (if (k / 20) % 2 == 0 { -40.0 } else { 85.0 }) + noise(k)
        }),
        (
            "two sessions",
            |k| if k < 90 { 13.0 } else { 47.0 } + 0.1 * noise(k),
        ),
        ("stairs", |k| 5.0 * (k / 20) as f64 + 0.02 * noise(k)),
        ("stairs, exact", |k| 5.0 * (k / 15) as f64),
        ("noise alone", |k| 25.0 + noise(k) * noise(k + 500)),
        ("dwell", |k| (20.0 + 0.7 * k.min(70) as f64).min(60.0)),
    ];
    for (name, value) in none {
        let cells = found(1.0, kind(), value);
        assert!(cells.is_empty(), "{name}: {cells:?}");
    }
}

fn record(column: &str, value: impl Fn(usize) -> f64) -> (Vec<f64>, Vec<Warning>) {
    let output = match column {
        "rate_out_dps" => "aside",
        _ => "rate_out_dps",
    };
    let mut text = format!("time_s,{output},die_degc,{column}\n");
    for k in 0..200 {
        text += &format!(
            "{k},{:.5},{:.3},{:.6}\n",
            noise(k),
            20.0 + 0.2 * k as f64,
            value(k)
        );
    }
    let (r, w) = parse(
        text.as_bytes(),
        Path::new("r.csv"),
        &RecordMapping::default(),
    )
    .unwrap();
    (r.columns[column].clone(), w)
}

/// A column, its reading by row, and its error values.
type Abscissa = (&'static str, fn(usize) -> f64, &'static [f64]);

#[test]
fn every_abscissa_loses_its_error_values_and_says_so() {
    let columns: [Abscissa; 6] = [
        (
            "phase_rad",
            |k| -1.6 + 1e-3 * k as f64,
            &[0.0, 65535.0, -3.0],
        ),
        (
            "freq_hz",
            |k| 17_500.0 - 0.1 * k as f64,
            &[0.0, 65535.0, -1.0],
        ),
        (
            "supply_v",
            |k| 3.3 + 0.02 * noise(k),
            &[0.0, 65535.0, -127.0],
        ),
        ("supply_v", |_| 3.3, &[0.0]),
        (
            "accel_g",
            |k| 0.8 * (k as f64 / 30.0).sin() + 0.01 * noise(k),
            &[-999.0, 65535.0, 85.0],
        ),
        (
            "chamber_degc",
            |k| 22.0 + 0.2 * k as f64,
            &[0.0, 85.0, -127.0],
        ),
    ];
    for (column, reading, errors) in columns {
        for error in errors {
            let bad = [40, 90, 133];
            let (values, warnings) =
                record(
                    column,
                    |k| if bad.contains(&k) { *error } else { reading(k) },
                );
            let holes: Vec<usize> = (0..200).filter(|i| values[*i].is_nan()).collect();
            assert_eq!(holes, bad, "{column} {error}");
            let said: Vec<&Warning> = warnings
                .iter()
                .filter(|w| w.code == "error_values")
                .collect();
            let [said] = said[..] else {
                panic!("{warnings:?}")
            };
            assert_eq!(said.column.as_deref(), Some(column));
            assert!(
                said.message.contains("3 of 200") && said.message.contains("(3 times)"),
                "{}",
                said.message
            );
            assert!(
                said.message.contains("line 42, 92, 135"),
                "{}",
                said.message
            );
        }
        let (values, warnings) = record(column, reading);
        assert!(values.iter().all(|v| !v.is_nan()));
        assert!(
            warnings.iter().all(|w| w.code != "error_values"),
            "{column}: {warnings:?}"
        );
    }
}

#[test]
fn a_converters_error_value_is_no_rate() {
    let rate = |k: usize| 0.1 + 0.02 * noise(k);
    for value in [-32768.0, 32767.0, 99999.0] {
        let bad = |k: usize| [33, 70, 150].contains(&k);
        let (cells, warnings) = record("rate_out_dps", |k| if bad(k) { value } else { rate(k) });
        assert!(
            (0..cells.len()).all(|k| cells[k].is_nan() == bad(k)),
            "{value}"
        );
        let told = &warnings[0];
        assert_eq!(told.code, "error_values");
        assert!(
            told.message.contains(&format!("{value} deg/s (3 times)")),
            "{told:?}"
        );
        assert!(
            !warnings.iter().any(|w| w.message.contains("mdps")),
            "{warnings:?}"
        );
    }
    // A glitch stays, and is in no other unit.
    let (cells, warnings) = record("rate_out_dps", |k| if k == 50 { 31234.5 } else { rate(k) });
    assert_eq!(cells[50], 31234.5);
    assert!(warnings.iter().any(|w| w.code == "rate_out_of_range"));
    assert!(
        !warnings.iter().any(|w| w.message.contains("mdps")),
        "{warnings:?}"
    );
    // Millidegrees of a turning gyro are none of either.
    let (cells, warnings) = record("rate_out_dps", |k| {
        30_000.0 * ((k / 20) % 3) as f64 + 20.0 * noise(k)
    });
    assert!(cells.iter().all(|c| !c.is_nan()));
    let said = "unit = \"mdps\" }; if deg/h, with unit = \"dph\"";
    assert!(
        warnings.iter().any(|w| w.message.contains(said)),
        "{warnings:?}"
    );
}

#[test]
fn positions_and_supply_steps_are_settings() {
    for (column, value) in [
        (
            "accel_g",
            (|k| [1.0, 0.0, -1.0, 0.0][(k / 12) % 4]) as fn(usize) -> f64,
        ),
        ("accel_g", |k| {
            [1.0, 0.0, -1.0, 0.0][k % 4] + 0.001 * noise(k)
        }),
        (
            "accel_g",
            |k| if k % 40 == 0 { -1.0 } else { 1.0 } + 0.001 * noise(k),
        ),
        ("supply_v", |k| [3.3, 3.0, 3.6][(k / 25) % 3]),
        (
            "supply_v",
            |k| if (100..120).contains(&k) { 2.7 } else { 3.3 } + 0.01 * noise(k),
        ),
    ] {
        let (values, _) = record(column, value);
        assert!(values.iter().all(|v| !v.is_nan()), "{column}");
    }
}
