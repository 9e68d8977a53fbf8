//! Logs as they really come: two gyros, a device that is replaced, a clock with one wrong time, rates that change,
//! error values, bursts.

use super::thermal::ThermalRecord;
use super::ulog;
use super::ulog_tests::{Writer, floats};
use super::warning::Warning;
use crate::design::RecordMapping;
use crate::error::Result;
use std::path::Path;

pub(super) fn wobble(k: u64) -> f64 {
    0.02 * ((k.wrapping_mul(2_654_435_761) >> 7) % 1000) as f64 / 1000.0
}

pub(super) fn of(w: &Writer, instance: Option<u32>) -> Result<(ThermalRecord, Vec<Warning>)> {
    with(
        w,
        &RecordMapping {
            instance,
            ..RecordMapping::default()
        },
    )
}

pub(super) fn with(w: &Writer, mapping: &RecordMapping) -> Result<(ThermalRecord, Vec<Warning>)> {
    ulog::read(&w.0[..], Path::new("flight.ulg"), mapping)
}

pub(super) fn said(warnings: &[Warning], code: &str) -> String {
    let found = warnings.iter().filter(|w| w.code == code);
    let texts: Vec<&str> = found.map(|w| w.message.as_str()).collect();
    texts.join("\n")
}

/// A log whose sensor_gyro 0 has, at 10 Hz, what `sample` says of each: (time in us, device_id, deg/s, degC).
fn gyro(samples: u64, sample: impl Fn(u64) -> (u64, u32, f64, f64)) -> Writer {
    let mut w = Writer::new();
    w.message(
        b'F',
        b"sensor_gyro:uint64_t timestamp;uint32_t device_id;float x;float y;float z;float temperature;",
    );
    w.subscribe(0, 0, "sensor_gyro");
    for k in 0..samples {
        let (time, id, dps, degc) = sample(k);
        let mut body = id.to_le_bytes().to_vec();
        body.extend(floats(&[0.0, 0.0, dps.to_radians() as f32, degc as f32]));
        w.data(0, time, &body);
    }
    w
}

pub(super) fn at(k: u64) -> u64 {
    10_000_000 + 100_000 * k
}

#[test]
fn the_gyro_in_use_is_not_another_gyro() {
    for selected in [None, Some(111), Some(222u32)] {
        let mut w = Writer::new();
        w.message(
            b'F',
            b"sensor_combined:uint64_t timestamp;float[3] gyro_rad;",
        );
        w.message(
            b'F',
            b"vehicle_imu_status:uint64_t timestamp;uint32_t gyro_device_id;float temperature_gyro;",
        );
        w.message(b'F', b"sensor_selection:uint64_t timestamp;uint32_t accel_device_id;uint32_t gyro_device_id;");
        w.subscribe(0, 0, "sensor_combined");
        w.subscribe(1, 0, "vehicle_imu_status");
        w.subscribe(2, 1, "vehicle_imu_status");
        w.subscribe(3, 0, "sensor_selection");
        if let Some(id) = selected {
            w.data(3, at(0), &[9u32.to_le_bytes(), id.to_le_bytes()].concat());
        }
        for k in 0..200 {
            w.data(0, at(k), &floats(&[0.0, 0.0, wobble(k) as f32]));
            if k % 10 == 0 {
                for (number, id, degc) in [(1, 111u32, 20.0), (2, 222, 50.0)] {
                    let heat = floats(&[degc + k as f32 * 0.01]);
                    w.data(number, at(k), &[&id.to_le_bytes()[..], &heat].concat());
                }
            }
        }
        let (r, warnings) = of(&w, None).unwrap();
        let expected = if selected == Some(222) { 50.0 } else { 20.0 };
        assert_eq!(r.columns["die_degc"][0], expected, "{selected:?}");
        let doubt = said(&warnings, "gyro_not_identified");
        assert_eq!(doubt.is_empty(), selected.is_some(), "{doubt}");
        let used = u32::from(selected == Some(222));
        assert!(of(&w, Some(used)).is_ok());
        let refused = of(&w, Some(1 - used)).unwrap_err().to_string();
        let asked = format!("no samples of gyro {}", 1 - used);
        for part in [
            asked.as_str(),
            "sensor_combined 0",
            "device_id 222",
            "50.0 to 52.0 degC",
        ] {
            let listed =
                refused.contains(part) || (part.contains("52.0") && refused.contains("51.9"));
            assert!(listed, "no {part} in {refused}");
        }
    }
}

#[test]
fn two_gyros_are_listed_and_the_first_is_taken() {
    let w = super::ulog_tests::sound();
    let (_, warnings) = of(&w, None).unwrap();
    let listed = said(&warnings, "gyros_in_log");
    for part in [
        "2 gyros",
        "0 (sensor_gyro, 20 rows, 200 samples, 30.0 to 49.0 degC",
        "Gyro 0 is read",
    ] {
        assert!(listed.contains(part), "no {part} in {listed}");
    }
    assert_eq!(said(&of(&w, Some(1)).unwrap().1, "gyros_in_log"), "");
}

#[test]
fn a_topic_without_samples_is_no_gyro() {
    // The gyro's number in sensor_gyro is 1, and 0 in the topic that has its temperature.
    let mut w = gyro(0, |k| (k, 0, 0.0, 0.0));
    w.message(
        b'F',
        b"vehicle_imu_status:uint64_t timestamp;uint32_t gyro_device_id;float temperature_gyro;",
    );
    w.subscribe(1, 1, "sensor_gyro");
    w.subscribe(2, 0, "vehicle_imu_status");
    for k in 0..300 {
        let degc = 20.0 + k as f32 * 0.1;
        let id = 7u32.to_le_bytes();
        let sample = floats(&[0.0, 0.0, wobble(k) as f32, f32::NAN]);
        w.data(1, at(k), &[&id[..], &sample].concat());
        w.data(2, at(k), &[&id[..], &floats(&[degc])].concat());
    }
    let (r, warnings) = of(&w, None).unwrap();
    assert_eq!(r.len(), 30);
    assert_eq!(said(&warnings, "gyros_in_log"), "");
    let (r, _) = of(&w, Some(1)).unwrap();
    assert!(r.columns.contains_key("die_degc"));
    let refused = of(&w, Some(0)).unwrap_err().to_string();
    assert!(
        refused.contains("no samples of gyro 0") && refused.contains("1 (sensor_gyro, 30 rows"),
        "{refused}"
    );
}

#[test]
fn a_device_that_is_replaced_ends_the_record() {
    let w = gyro(400, |k| {
        (
            at(k),
            if k < 250 { 7 } else { 8 },
            wobble(k),
            20.0 + 0.1 * k as f64,
        )
    });
    let (r, warnings) = of(&w, None).unwrap();
    assert_eq!(r.len(), 25);
    let told = said(&warnings, "gyro_replaced");
    assert!(told.contains("from device_id 7 to 8 at 35.0 s"), "{told}");
}

#[test]
fn a_slow_part_stays_and_a_part_of_a_row_is_told() {
    // 4 Hz for 40 s, then 20 Hz: nothing is left out.
    let time = |k: u64| match k {
        0..160 => 10_000_000 + 250_000 * k,
        _ => 50_000_000 + 50_000 * (k - 160),
    };
    let w = gyro(1360, |k| {
        (time(k), 7, wobble(k), 20.0 + 3e-8 * time(k) as f64)
    });
    let (r, warnings) = of(&w, None).unwrap();
    assert_eq!(r.len(), 100);
    assert_eq!(said(&warnings, "rows_left_out"), "");
    // Rows that lost most of their samples.
    let mut w = gyro(0, |k| (k, 0, 0.0, 0.0));
    for k in (0..400).filter(|k| !(152..160).contains(k) && !(253..259).contains(k)) {
        let mut body = 7u32.to_le_bytes().to_vec();
        body.extend(floats(&[0.0, 0.0, wobble(k) as f32, 20.0 + k as f32 * 0.1]));
        w.data(0, at(k), &body);
    }
    let (r, warnings) = of(&w, None).unwrap();
    assert_eq!(r.len(), 38);
    let told = said(&warnings, "rows_left_out");
    for part in ["2 rows (6 samples", "25 and 35 s", "35.0 to 45"] {
        assert!(told.contains(part), "no {part} in {told}");
    }
}

#[test]
fn one_wrong_time_costs_one_message() {
    for bad in [4_213_092_985_657_280_000, 0, u64::MAX] {
        let w = gyro(300, |k| {
            (
                if k == 111 { bad } else { at(k) },
                7,
                wobble(k),
                20.0 + 0.1 * k as f64,
            )
        });
        let (r, warnings) = of(&w, None).unwrap();
        assert_eq!(r.len(), 30);
        assert!(
            said(&warnings, "wrong_times").contains("one message in sensor_gyro 0")
                || said(&warnings, "wrong_times").contains("one message"),
            "{warnings:?}"
        );
    }
}

#[test]
fn bursts_of_counts_are_read() {
    let mut w = Writer::new();
    w.message(b'F', b"sensor_gyro_fifo:uint64_t timestamp;uint64_t timestamp_sample;uint32_t device_id;float dt;float scale;uint8_t samples;int16_t[32] x;int16_t[32] y;int16_t[32] z;");
    w.subscribe(0, 0, "sensor_gyro_fifo");
    let scale = 0.001f32;
    let mut sums = vec![(0.0, 0); 40];
    for k in 0..400u64 {
        let time = at(k);
        let count = 1 + (k % 8) as usize;
        let mut body = time.to_le_bytes().to_vec();
        body.extend(7u32.to_le_bytes());
        body.extend(floats(&[250.0, scale]));
        body.push(count as u8);
        let z = |i: usize| (k as i16 % 50) + i as i16;
        for axis in 0..3 {
            for i in 0..32 {
                let counts = if axis < 2 || i >= count { 999 } else { z(i) };
                body.extend(counts.to_le_bytes());
            }
        }
        w.data(0, time, &body);
        for i in 0..count {
            let taken = time - 250 * (count - 1 - i) as u64;
            if let Some(sum) = sums.get_mut((taken / 1_000_000).saturating_sub(10) as usize)
                && taken >= 10_000_000
            {
                sum.0 += (f64::from(z(i)) * f64::from(scale)).to_degrees();
                sum.1 += 1;
            }
        }
    }
    let (r, warnings) = of(&w, None).unwrap();
    assert_eq!(r.renamed["rate_out_dps"], "sensor_gyro_fifo.z");
    assert_eq!(r.len(), 40);
    for (i, (sum, n)) in sums.iter().enumerate() {
        let mean = r.columns["rate_out_dps"][i];
        assert!((mean - sum / f64::from(*n)).abs() < 1e-9, "{i}");
    }
    assert!(!said(&warnings, "log_without_temperature").is_empty());
}

#[test]
fn error_values_among_the_samples_of_a_row_are_left_out() {
    let bad = |k: u64| k % 37 == 5;
    for value in [0.0, -127.0, 85.0, 65535.0] {
        let degc = |k: u64| 20.0 + 0.02 * k as f64;
        let w = gyro(600, |k| {
            (at(k), 7, wobble(k), if bad(k) { value } else { degc(k) })
        });
        let (r, warnings) = of(&w, None).unwrap();
        for (i, got) in r.columns["die_degc"].iter().enumerate() {
            let rows = (10 * i as u64..10 * i as u64 + 10).filter(|k| !bad(*k));
            let (sum, n) = rows.fold((0.0, 0.0), |s, k| (s.0 + degc(k), s.1 + 1.0));
            assert!((got - sum / n).abs() < 1e-4, "{value} {i}: {got}");
        }
        let told = said(&warnings, "error_values");
        assert!(
            told.contains(&format!("{value} degC")) && told.contains("sensor_gyro.temperature"),
            "{told}"
        );
        // 17 samples, each in a row of its own, of all 60.
        assert!(
            told.contains("(17 times) in 17 samples of 17 of 60 rows"),
            "{told}"
        );
    }
}

#[test]
fn error_values_are_counted_in_samples_and_rows() {
    // Three rows of nothing else, and two samples of a fourth.
    let bad = |k: u64| (200..230).contains(&k) || k == 301 || k == 303;
    let w = gyro(600, |k| {
        let degc = if bad(k) {
            -127.0
        } else {
            20.0 + 0.02 * k as f64
        };
        (at(k), 7, wobble(k), degc)
    });
    let told = said(&of(&w, None).unwrap().1, "error_values");
    assert!(
        told.contains("-127 degC (32 times) in 32 samples of 4 of 60 rows"),
        "{told}"
    );
}

#[test]
fn what_is_said_of_a_log_has_times_and_no_lines() {
    let w = gyro(1200, |k| {
        let rate = if (300..310).contains(&k) {
            40_000.0
        } else {
            0.1 + wobble(k)
        };
        let degc = 20.0 + 0.02 * k.min(800) as f64 + 0.1 * wobble(k / 10);
        (at(k), 7, rate, if k < 600 { degc } else { 31.0 })
    });
    let (_, warnings) = of(&w, None).unwrap();
    let told = said(&warnings, "rate_out_of_range");
    assert!(
        told.contains("at 40.4 s since power-on") || told.contains("at 40.5 s since power-on"),
        "{told}"
    );
    assert!(
        warnings.iter().all(|w| !w.message.contains("line ")),
        "{warnings:?}"
    );
    assert!(
        !said(&warnings, "frozen_channel").is_empty(),
        "{warnings:?}"
    );
}

#[test]
fn a_gyro_that_does_not_move_is_refused() {
    let w = gyro(300, |k| (at(k), 7, 0.0, 20.0 + 0.1 * k as f64));
    assert!(
        of(&w, None)
            .unwrap_err()
            .to_string()
            .contains("nothing can be judged")
    );
    let w = gyro(300, |k| {
        (at(k), 7, 0.061 * (k % 2) as f64, 20.0 + 0.1 * k as f64)
    });
    assert!(
        of(&w, None)
            .unwrap_err()
            .to_string()
            .contains("below one LSB")
    );
}

#[test]
fn a_fast_topic_is_not_shadowed_by_a_slow_one() {
    let mut w = gyro(0, |k| (k, 0, 0.0, 0.0));
    w.message(b'F', b"vehicle_imu:uint64_t timestamp;uint32_t gyro_device_id;float[3] delta_angle;uint32_t delta_angle_dt;");
    w.subscribe(5, 0, "vehicle_imu");
    for k in 0..300 {
        let mut body = 7u32.to_le_bytes().to_vec();
        body.extend(floats(&[0.0, 0.0, 1e-5 + wobble(k) as f32 * 1e-4]));
        body.extend(5000u32.to_le_bytes());
        w.data(5, at(k), &body);
        if k % 10 == 0 {
            let mut body = 7u32.to_le_bytes().to_vec();
            body.extend(floats(&[0.0, 0.0, wobble(k) as f32, 20.0 + k as f32 * 0.1]));
            w.data(0, at(k), &body);
        }
    }
    let (r, warnings) = of(&w, None).unwrap();
    assert!(r.renamed["rate_out_dps"].starts_with("vehicle_imu"));
    assert!(r.columns.contains_key("die_degc"));
    assert!(said(&warnings, "faster_source").contains("sensor_gyro.z has 30 samples"));
}
