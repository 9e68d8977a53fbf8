//! Logs as they really come: two gyros, a device that is replaced, a clock with one wrong time, rates that change,
//! corrections that were on, error values, bursts.

use super::dataflash;
use super::dataflash_tests as flash;
use super::thermal::ThermalRecord;
use super::ulog;
use super::ulog_tests::{Writer, floats};
use super::warning::Warning;
use crate::design::RecordMapping;
use crate::error::Result;
use std::path::Path;

fn wobble(k: u64) -> f64 {
    0.02 * ((k.wrapping_mul(2_654_435_761) >> 7) % 1000) as f64 / 1000.0
}

fn of(w: &Writer, instance: Option<u32>) -> Result<(ThermalRecord, Vec<Warning>)> {
    with(
        w,
        &RecordMapping {
            instance,
            ..RecordMapping::default()
        },
    )
}

fn with(w: &Writer, mapping: &RecordMapping) -> Result<(ThermalRecord, Vec<Warning>)> {
    ulog::read(&w.0[..], Path::new("flight.ulg"), mapping)
}

fn said(warnings: &[Warning], code: &str) -> String {
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

fn at(k: u64) -> u64 {
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
fn corrections_are_told_and_taken_off() {
    let mut w = Writer::new();
    let parameter = |w: &mut Writer, name: &str, bytes: [u8; 4], kind: &str| {
        let key = format!("{kind} {name}");
        w.message(b'P', &[&[key.len() as u8], key.as_bytes(), &bytes].concat());
    };
    for (name, value) in [("TC_G_ENABLE", 1i32), ("TC_G0_ID", 7), ("CAL_GYRO0_ID", 7)] {
        parameter(&mut w, name, value.to_le_bytes(), "int32_t");
    }
    for (name, value) in [
        ("TC_G0_X0_2", 0.002f32),
        ("TC_G0_X1_2", 1e-4),
        ("TC_G0_TREF", 25.0),
        ("TC_G0_TMIN", 0.0),
        ("TC_G0_TMAX", 100.0),
        ("CAL_GYRO0_ZOFF", 0.01),
    ] {
        parameter(&mut w, name, value.to_le_bytes(), "float");
    }
    w.message(b'F', b"vehicle_imu:uint64_t timestamp;uint32_t gyro_device_id;float[3] delta_angle;uint32_t delta_angle_dt;");
    w.message(
        b'F',
        b"vehicle_imu_status:uint64_t timestamp;uint32_t gyro_device_id;float temperature_gyro;",
    );
    w.subscribe(0, 0, "vehicle_imu");
    w.subscribe(1, 0, "vehicle_imu_status");
    for k in 0..500 {
        let degc = 20.0 + 0.1 * k as f64;
        let left = wobble(k).to_radians() as f32 * 0.005;
        let mut body = 7u32.to_le_bytes().to_vec();
        body.extend(floats(&[0.0, 0.0, left]));
        body.extend(5000u32.to_le_bytes());
        w.data(0, at(k), &body);
        w.data(
            1,
            at(k),
            &[&7u32.to_le_bytes()[..], &floats(&[degc as f32])].concat(),
        );
        if k == 350 {
            parameter(&mut w, "CAL_GYRO0_ZOFF", 0.012f32.to_le_bytes(), "float");
        }
    }
    let (plain, warnings) = of(&w, None).unwrap();
    let on = said(&warnings, "correction_on");
    assert!(
        on.contains("TC_G_ENABLE = 1 from the start") && on.contains("--undo-correction"),
        "{on}"
    );
    let split = said(&warnings, "record_split");
    assert!(
        split.contains("CAL_GYRO0_ZOFF") && split.contains("0.012"),
        "{split}"
    );
    assert!(plain.len() == 34 || plain.len() == 35, "{}", plain.len());
    let mapping = RecordMapping {
        undo_correction: true,
        ..RecordMapping::default()
    };
    let (undone, warnings) = with(&w, &mapping).unwrap();
    assert!(!said(&warnings, "correction_undone").is_empty());
    for i in 0..plain.len() {
        let degc = plain.columns["die_degc"][i];
        let off = (0.002 + 1e-4 * (degc - 25.0)).to_degrees();
        let difference = undone.columns["rate_out_dps"][i] - plain.columns["rate_out_dps"][i];
        assert!((difference - off).abs() < 1e-6, "{i}: {difference} {off}");
    }
}

/// A parameter of PX4: a whole number where its name says so.
fn parameter(w: &mut Writer, name: &str, value: f32) {
    let is_whole = name.ends_with("_ID") || name.ends_with("_ENABLE");
    let (kind, bytes) = match is_whole {
        true => ("int32_t", (value as i32).to_le_bytes()),
        false => ("float", value.to_le_bytes()),
    };
    let key = format!("{kind} {name}");
    w.message(b'P', &[&[key.len() as u8], key.as_bytes(), &bytes].concat());
}

/// 60 s of vehicle_imu of the gyro 7, `step` messages of 0.1 s apart, with parameters at the start and before a message.
fn with_parameters(step: u64, start: &[(&str, f32)], later: &[(u64, &str, f32)]) -> Writer {
    let mut w = Writer::new();
    for (name, value) in start {
        parameter(&mut w, name, *value);
    }
    w.message(b'F', b"vehicle_imu:uint64_t timestamp;uint32_t gyro_device_id;float[3] delta_angle;uint32_t delta_angle_dt;");
    w.message(
        b'F',
        b"vehicle_imu_status:uint64_t timestamp;uint32_t gyro_device_id;float temperature_gyro;",
    );
    w.subscribe(0, 0, "vehicle_imu");
    w.subscribe(1, 0, "vehicle_imu_status");
    for k in (0..600).step_by(step as usize) {
        for (_, name, value) in later.iter().filter(|l| (k..k + step).contains(&l.0)) {
            parameter(&mut w, name, *value);
        }
        let degc = 20.0 + 0.1 * k as f64;
        let mut body = 7u32.to_le_bytes().to_vec();
        let angle = wobble(k).to_radians() as f32 * 0.005;
        body.extend(floats(&[0.0, 0.0, angle]));
        body.extend(5000u32.to_le_bytes());
        w.data(0, at(k), &body);
        w.data(
            1,
            at(k),
            &[&7u32.to_le_bytes()[..], &floats(&[degc as f32])].concat(),
        );
    }
    w
}

/// TC_G1 of the gyro 7: 0.002 rad/s and 1e-4 rad/s/K from 25 degC.
const OWN: [(&str, f32); 6] = [
    ("TC_G1_ID", 7.0),
    ("TC_G0_ID", 9.0),
    ("TC_G1_X0_2", 0.002),
    ("TC_G1_X1_2", 1e-4),
    ("TC_G0_X0_2", 0.5),
    ("CAL_GYRO0_ID", 7.0),
];

fn undone(w: &Writer) -> Result<(ThermalRecord, Vec<Warning>)> {
    let mapping = RecordMapping {
        undo_correction: true,
        ..RecordMapping::default()
    };
    with(w, &mapping)
}

#[test]
fn a_change_has_the_time_of_the_message_before_it() {
    // The clock holds messages back until four have followed: 8 s here.
    for step in [1, 20] {
        let w = with_parameters(
            step,
            &[("CAL_GYRO0_ZOFF", 0.0)],
            &[(300, "CAL_GYRO0_ZOFF", 0.01)],
        );
        let told = said(&of(&w, None).unwrap().1, "record_split");
        let expected = match step {
            1 => "at 39.9 s",
            _ => "at 38.0 s",
        };
        assert!(told.contains(expected), "{told}");
    }
    // A wild time in the message before the parameter dates nothing.
    let mut w = with_parameters(1, &[("CAL_GYRO0_ZOFF", 0.0)], &[]);
    let wild = |w: &mut Writer, time: u64| {
        let body = [&7u32.to_le_bytes()[..], &floats(&[20.0])].concat();
        w.data(1, time, &body);
    };
    wild(&mut w, u64::MAX / 3);
    parameter(&mut w, "CAL_GYRO0_ZOFF", 0.01);
    for k in 600..900 {
        let mut body = 7u32.to_le_bytes().to_vec();
        body.extend(floats(&[0.0, 0.0, wobble(k).to_radians() as f32 * 0.005]));
        body.extend(5000u32.to_le_bytes());
        w.data(0, at(k), &body);
        wild(&mut w, at(k));
    }
    let told = said(&of(&w, None).unwrap().1, "record_split");
    assert!(told.contains("at 70.0 s"), "{told}");
}

#[test]
fn a_correction_is_taken_off_where_it_was_on() {
    let off = |degc: f64| (0.002 + 1e-4 * (degc - 25.0)).to_degrees();
    for (first, change, rows, is_on) in [
        (0.0, 400, 40, false),
        (1.0, 400, 40, true),
        (0.0, 200, 40, true),
        (1.0, 200, 40, false),
    ] {
        let start = [&[("TC_G_ENABLE", first)], &OWN[..]].concat();
        let w = with_parameters(1, &start, &[(change, "TC_G_ENABLE", 1.0 - first)]);
        let ((plain, told), (undone, also)) = (of(&w, None).unwrap(), undone(&w).unwrap());
        assert!(plain.len().abs_diff(rows) < 2, "{}", plain.len());
        assert_eq!(plain.len(), undone.len());
        for i in 0..plain.len() {
            let expected = match is_on {
                true => off(plain.columns["die_degc"][i]),
                false => 0.0,
            };
            let got = undone.columns["rate_out_dps"][i] - plain.columns["rate_out_dps"][i];
            assert!((got - expected).abs() < 1e-6, "{first} {change} {i}: {got}");
        }
        let s = 9.9 + 0.1 * change as f64;
        let split = said(&told, "record_split");
        let changes = format!(
            "TC_G_ENABLE changes from {first} to {} at {s:.1} s",
            1.0 - first
        );
        assert!(split.contains(&changes), "{split}");
        let [with, without] = ["correction_on", "correction_off"].map(|code| said(&also, code));
        let (there, absent) = if is_on {
            (with, without)
        } else {
            (without, with)
        };
        assert!(
            there.contains(&format!("from {s:.1} s")) && absent.is_empty(),
            "{there}|{absent}"
        );
        assert_eq!(is_on, !there.contains("changes nothing"), "{there}");
        assert_eq!(is_on, !said(&also, "correction_undone").is_empty());
    }
}

#[test]
fn coefficients_that_change_split_the_record() {
    let start = [&[("TC_G_ENABLE", 1.0)], &OWN[..]].concat();
    for (change, offset) in [(400, 0.002f64), (200, 0.003)] {
        let w = with_parameters(1, &start, &[(change, "TC_G1_X0_2", 0.003)]);
        let (plain, (undone, told)) = (of(&w, None).unwrap().0, undone(&w).unwrap());
        assert!(said(&told, "record_split").contains("TC_G1_X0_2 changes from 0.002"));
        for i in 0..plain.len() {
            let off = (offset + 1e-4 * (plain.columns["die_degc"][i] - 25.0)).to_degrees();
            let got = undone.columns["rate_out_dps"][i] - plain.columns["rate_out_dps"][i];
            assert!((got - off).abs() < 1e-6, "{change} {i}: {got} {off}");
        }
    }
}

#[test]
fn by_the_ids_another_gyros_parameters_are_not_this_ones() {
    let others = [
        ("TC_G_ENABLE", 1.0),
        ("TC_G0_ID", 9.0),
        ("TC_G1_ID", 0.0),
        ("TC_G0_X0_2", 0.5),
        ("CAL_GYRO0_ID", 9.0),
        ("CAL_GYRO0_ZOFF", 0.0),
    ];
    let w = with_parameters(1, &others, &[(300, "CAL_GYRO0_ZOFF", 0.01)]);
    let ((plain, told), (undone, also)) = (of(&w, None).unwrap(), undone(&w).unwrap());
    assert_eq!(plain.len(), 60);
    assert_eq!(
        plain.columns["rate_out_dps"],
        undone.columns["rate_out_dps"]
    );
    let told = said(&told, "correction_off");
    for part in [
        "device_id 7",
        "TC_G0_ID = 9",
        "CAL_GYRO0_ZOFF changes",
        "another gyro's",
    ] {
        assert!(told.contains(part), "{part}: {told}");
    }
    let also = said(&also, "correction_off");
    assert!(also.contains("nothing to take off"), "{also}");
    // Without any id the number has to do.
    let bare: Vec<_> = others
        .into_iter()
        .filter(|o| !o.0.ends_with("_ID"))
        .collect();
    let w = with_parameters(1, &bare, &[(300, "CAL_GYRO0_ZOFF", 0.01)]);
    let (undone, told) = undone_of(&w);
    assert!(undone.len() < 35 && told.contains("TC_G0"), "{told}");
    // A log without a correction says that there is none.
    let w = with_parameters(1, &[("TC_G_ENABLE", 0.0)], &[]);
    let told = said(&undone_of_all(&w).1, "correction_off");
    assert!(told.contains("nothing to take off"), "{told}");
}

fn undone_of_all(w: &Writer) -> (ThermalRecord, Vec<Warning>) {
    undone(w).unwrap()
}

fn undone_of(w: &Writer) -> (ThermalRecord, String) {
    let (record, warnings) = undone(w).unwrap();
    (record, said(&warnings, "correction_undone"))
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

#[test]
fn ardupilots_correction_is_taken_off_where_it_was_on() {
    for (first, is_on) in [(0.0, false), (1.0, true)] {
        let mut log = Vec::new();
        flash::define(&mut log, 64, 31, "PARM", "QNf", "TimeUS,Name,Value");
        let set = |log: &mut Vec<u8>, time: u64, name: &str, value: f32| {
            let name = flash::text::<16>(name);
            flash::message(log, 64, &[&time.to_le_bytes(), &name, &floats(&[value])]);
        };
        set(&mut log, 1000, "INS_TCAL1_ENABLE", first);
        set(&mut log, 1000, "INS_TCAL1_GYR1_Z", 123.0);
        log.extend(flash::sound());
        // Behind all messages, but its time is 13.5 s after the first of 20 s.
        set(&mut log, 20_500_000, "INS_TCAL1_ENABLE", 1.0 - first);
        let read = |undo_correction| {
            let mapping = RecordMapping {
                undo_correction,
                ..RecordMapping::default()
            };
            dataflash::read(&log[..], Path::new("1.BIN"), &mapping).unwrap()
        };
        let ((plain, told), (undone, also)) = (read(false), read(true));
        let same = plain.columns["rate_out_dps"] == undone.columns["rate_out_dps"];
        assert_eq!(same, !is_on, "{told:?} {also:?}");
        assert!(said(&told, "record_split").contains("INS_TCAL1_ENABLE changes"));
        let code = if is_on {
            "correction_on"
        } else {
            "correction_off"
        };
        assert!(said(&also, code).contains("from 20.5 s"), "{also:?}");
    }
}

#[test]
fn ardupilots_parameters_are_read() {
    let mut log = flash::sound();
    let mut parameters = Vec::new();
    flash::define(&mut parameters, 64, 31, "PARM", "QNf", "TimeUS,Name,Value");
    for (name, value) in [
        ("INS_TCAL1_ENABLE", 1.0),
        ("INS_TCAL1_GYR1_Z", 123.0),
        ("INS_TCAL1_TMIN", 0.0),
        ("INS_TCAL1_TMAX", 70.0),
        ("INS_GYR_ID", 55.0),
    ] {
        flash::message(
            &mut parameters,
            64,
            &[
                &1000u64.to_le_bytes(),
                &flash::text::<16>(name),
                &floats(&[value]),
            ],
        );
    }
    parameters.append(&mut log);
    let read = |undo_correction| {
        let mapping = RecordMapping {
            undo_correction,
            ..RecordMapping::default()
        };
        dataflash::read(&parameters[..], Path::new("1.BIN"), &mapping).unwrap()
    };
    let ((plain, warnings), (undone, _)) = (read(false), read(true));
    let on = said(&warnings, "correction_on");
    assert!(
        on.contains("INS_TCAL1_ENABLE = 1") && on.contains("--undo-correction"),
        "{on}"
    );
    assert!(said(&warnings, "gyros_in_log").contains("device_id 55"));
    for i in 0..plain.len() {
        let t = plain.columns["die_degc"][i] - 35.0;
        let off = (123e-6 * t).to_degrees();
        let difference = undone.columns["rate_out_dps"][i] - plain.columns["rate_out_dps"][i];
        assert!((difference - off).abs() < 1e-9, "{i}");
    }
}
