//! Logs whose gyro was corrected as it was recorded: where the correction was on, what it was, and the record without it.

use super::dataflash;
use super::dataflash_tests as flash;
use super::log_cases_tests::{at, of, said, with, wobble};
use super::thermal::ThermalRecord;
use super::ulog_tests::{Writer, floats};
use super::warning::Warning;
use crate::design::RecordMapping;
use crate::error::Result;
use std::path::Path;

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
