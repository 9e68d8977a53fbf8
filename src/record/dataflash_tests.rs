//! DataFlash logs written by this test from the format's description, read back, and damaged.

use super::any::read_any;
use super::dataflash;
use super::thermal::ThermalRecord;
use super::warning::Warning;
use crate::design::{LogAxis, RecordMapping};
use crate::error::{Error, Result};
use proptest::prelude::*;
use std::path::Path;

/// A message: head, type, body.
pub(super) fn message(log: &mut Vec<u8>, kind: u8, body: &[&[u8]]) {
    log.extend([0xA3, 0x95, kind]);
    log.extend(body.concat());
}

pub(super) fn text<const N: usize>(value: &str) -> [u8; N] {
    let mut out = [0; N];
    out[..value.len()].copy_from_slice(value.as_bytes());
    out
}

/// An FMT message, which says what type `kind` holds.
pub(super) fn define(
    log: &mut Vec<u8>,
    kind: u8,
    length: u8,
    name: &str,
    format: &str,
    labels: &str,
) {
    let (name, format, labels) = (text::<4>(name), text::<16>(format), text::<64>(labels));
    message(log, 128, &[&[kind, length], &name, &format, &labels]);
}

pub(super) fn floats(values: &[f32]) -> Vec<u8> {
    values.iter().flat_map(|v| v.to_le_bytes()).collect()
}

fn rate_dps(instance: u8, axis: usize, k: u64) -> f64 {
    0.2 * axis as f64 + 0.01 * (k % 10) as f64 + 1e-3 * (k / 10) as f64 + f64::from(instance)
}

/// Twenty seconds at 10 Hz as a present ArduPilot writes them.
pub(super) fn sound() -> Vec<u8> {
    let mut log = Vec::new();
    define(
        &mut log,
        128,
        89,
        "FMT",
        "BBnNZ",
        "Type,Length,Name,Format,Columns",
    );
    define(
        &mut log,
        144,
        54,
        "IMU",
        "QBffffffIIfBBHH",
        "TimeUS,I,GyrX,GyrY,GyrZ,AccX,AccY,AccZ,EG,EA,T,GH,AH,GHz,AHz",
    );
    define(&mut log, 150, 21, "POWR", "QffH", "TimeUS,Vcc,VServo,Flags");
    define(&mut log, 151, 75, "MSG", "QZ", "TimeUS,Message");
    for k in 0..200u64 {
        let time = (7_000_000 + k * 100_000).to_le_bytes();
        for instance in 0..2u8 {
            let gyro = [0, 1, 2].map(|a| rate_dps(instance, a, k).to_radians() as f32);
            message(
                &mut log,
                144,
                &[
                    &time,
                    &[instance],
                    &floats(&gyro),
                    &floats(&[9.80665, 0.0, -9.80665 * 2.0]),
                    &[0; 8],
                    &floats(&[20.0 + (k / 10) as f32]),
                    &[1, 1, 0xE8, 0x03, 0xE8, 0x03],
                ],
            );
        }
        if k % 10 == 3 {
            let volts = floats(&[5.0 + 1e-3 * k as f32, 4.9]);
            message(&mut log, 150, &[&time, &volts, &[0, 0]]);
            message(&mut log, 151, &[&time, &text::<64>("Ready")]);
        }
    }
    log
}

fn of(bytes: &[u8], mapping: &RecordMapping) -> Result<(ThermalRecord, Vec<Warning>)> {
    dataflash::read(bytes, Path::new("00000001.BIN"), mapping)
}

fn codes(warnings: &[Warning]) -> Vec<&str> {
    warnings.iter().map(|w| w.code).collect()
}

fn refusal(bytes: &[u8], mapping: &RecordMapping) -> String {
    match of(bytes, mapping) {
        Err(Error::Input(e)) => {
            assert!(e.help.is_some() && e.file.is_some(), "{e}");
            e.to_string()
        }
        other => panic!("not refused: {other:?}"),
    }
}

#[test]
fn axis_instance_units_and_rows_are_what_was_written() {
    let bytes = sound();
    for (axis, instance) in [(LogAxis::Z, 0), (LogAxis::X, 1), (LogAxis::Y, 1)] {
        let mapping = RecordMapping {
            axis,
            instance: Some(u32::from(instance)),
            ..RecordMapping::default()
        };
        let (r, warnings) = of(&bytes, &mapping).unwrap();
        assert_eq!(codes(&warnings), ["log_averaged"], "{warnings:?}");
        assert_eq!(r.len(), 20);
        for i in 0..20 {
            let expected = rate_dps(instance, axis.index(), 10 * i as u64) + 0.045;
            assert!((r.columns["rate_out_dps"][i] - expected).abs() < 1e-6);
            assert_eq!(r.columns["die_degc"][i], 20.0 + i as f64);
            let g = [1.0, 0.0, -2.0][axis.index()];
            assert!((r.columns["accel_g"][i] - g).abs() < 1e-6);
            let volts = 5.003 + 0.01 * i as f64;
            assert!((r.columns["supply_v"][i] - volts).abs() < 1e-5);
            assert!((r.columns["time_since_power_on_s"][i] - (7.45 + i as f64)).abs() < 1e-9);
        }
    }
}

#[test]
fn logs_of_older_versions_name_the_gyro_in_the_message() {
    let mut log = Vec::new();
    define(
        &mut log,
        128,
        89,
        "FMT",
        "BBnNZ",
        "Type,Length,Name,Format,Columns",
    );
    for (kind, name) in [(131, "IMU"), (135, "IMU2")] {
        let labels = "TimeMS,GyrX,GyrY,GyrZ,AccX,AccY,AccZ,Temp";
        define(&mut log, kind, 33, name, "Iffffffc", labels);
    }
    define(&mut log, 140, 9, "POWR", "IH", "TimeMS,Vcc");
    for k in 0..15u32 {
        let time = (1000 * k).to_le_bytes();
        for (kind, rate) in [(131, 0.01f32), (135, -0.02)] {
            let rate = rate + 1e-4 * (k % 4) as f32;
            let motion = floats(&[0.0, 0.0, rate, 0.0, 0.0, -9.80665]);
            let centidegrees = (2500 + 100 * k as i16).to_le_bytes();
            message(&mut log, kind, &[&time, &motion, &centidegrees]);
        }
        message(&mut log, 140, &[&time, &5040u16.to_le_bytes()]);
    }
    for (instance, rate) in [(0, 0.01f64), (1, -0.02)] {
        let mapping = RecordMapping {
            instance: Some(instance),
            ..RecordMapping::default()
        };
        let (r, _) = of(&log, &mapping).unwrap();
        assert!((r.columns["rate_out_dps"][4] - rate.to_degrees()).abs() < 1e-6);
        assert!((r.columns["die_degc"][4] - 29.0).abs() < 1e-9);
        assert!((r.columns["supply_v"][4] - 5.04).abs() < 1e-9);
        assert_eq!(r.time_s[14], 14.0);
    }
}

#[test]
fn what_cannot_be_used_is_refused_with_the_reason() {
    let plain = RecordMapping::default();
    let sound = sound();
    let instance = RecordMapping {
        instance: Some(2),
        ..RecordMapping::default()
    };
    let mut disagrees = Vec::new();
    define(&mut disagrees, 144, 40, "IMU", "QBffffff", "TimeUS,I,GyrX");
    let mut none = Vec::new();
    define(&mut none, 151, 75, "MSG", "QZ", "TimeUS,Message");
    let mut twice = sound.clone();
    twice.extend(&sound);
    type Case<'a> = (&'a [u8], &'a RecordMapping, &'a [&'a str]);
    let cases: [Case; 6] = [
        (
            &sound[..100],
            &plain,
            &["no IMU message", "ends within a message"],
        ),
        (
            &sound[..3000],
            &plain,
            &["only 2 rows", "ends within a message"],
        ),
        (
            &sound,
            &instance,
            &["no samples of gyro 2", "it has IMU 0, IMU 1"],
        ),
        (&disagrees, &plain, &["\"QBffffff\"", "40 bytes", "byte 0"]),
        (&none, &plain, &["no IMU message at all", "instance"]),
        (
            &twice,
            &plain,
            &[
                "clock runs backwards",
                "26.700 s to 7.000 s",
                "one power-on",
            ],
        ),
    ];
    for (bytes, mapping, parts) in cases {
        let said = refusal(bytes, mapping);
        for part in parts {
            assert!(said.contains(part), "no {part:?} in\n{said}");
        }
    }
}

#[test]
fn damage_costs_what_it_hits_and_erased_flash_nothing() {
    let plain = RecordMapping::default();
    let bytes = sound();
    let whole = of(&bytes, &plain).unwrap();
    for erased in [0u8, 0xFF] {
        let mut padded = bytes.clone();
        padded.extend([erased; 5000]);
        assert_eq!(of(&padded, &plain).unwrap(), whole);
    }
    let (cut, warnings) = of(&bytes[..bytes.len() - 20], &plain).unwrap();
    assert_eq!(
        codes(&warnings),
        ["log_cut_off", "gyros_in_log", "log_averaged"]
    );
    assert_eq!(cut.len(), 20);

    let mut bad = bytes.clone();
    let at = bytes.len() / 2;
    bad[at..at + 300].fill(0xEE);
    let (left, warnings) = of(&bad, &plain).unwrap();
    assert_eq!(
        codes(&warnings),
        ["log_damaged", "gyros_in_log", "log_averaged"]
    );
    assert!(warnings[0].message.contains("in 2 places"), "{warnings:?}");
    assert_eq!(left.len(), 20);
    for (a, b) in left.columns["die_degc"]
        .iter()
        .zip(&whole.0.columns["die_degc"])
    {
        assert!((a - b).abs() < 1e-9);
    }

    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("no_extension");
    std::fs::write(&path, &bytes).unwrap();
    assert_eq!(read_any(&path, &plain).unwrap().0.columns, whole.0.columns);
}

#[test]
fn a_flight_and_keys_for_csv_are_told() {
    let mut log = Vec::new();
    define(&mut log, 144, 15, "IMU", "Qf", "TimeUS,GyrZ");
    for k in 0..30u64 {
        let rate = (30.0 * (k as f32 * 0.7).sin()).to_radians();
        message(
            &mut log,
            144,
            &[&(k * 1_000_000).to_le_bytes(), &floats(&[rate])],
        );
    }
    let mapping = RecordMapping {
        row_period_s: Some(1.0),
        ..RecordMapping::default()
    };
    let (_, warnings) = of(&log, &mapping).unwrap();
    let expected = [
        "record_keys_unused",
        "log_averaged",
        "log_without_temperature",
        "log_not_at_rest",
    ];
    assert_eq!(codes(&warnings), expected);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(300))]

    #[test]
    fn damaged_logs_never_panic(
        edits in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 0..20),
        front in any::<bool>(),
        cut in any::<prop::sample::Index>(),
        whole in any::<bool>(),
    ) {
        let mut bytes = sound();
        for (at, byte) in edits {
            let reach = if front { 400 } else { bytes.len() };
            bytes[at.index(reach)] = byte;
        }
        if !whole {
            bytes.truncate(cut.index(bytes.len()));
        }
        match of(&bytes, &RecordMapping::default()) {
            Ok((r, _)) => {
                prop_assert!(r.len() >= 10);
                prop_assert!(r.columns.values().all(|c| c.len() == r.len()));
                prop_assert!(r.time_s.windows(2).all(|w| w[0] < w[1]));
            }
            Err(e) => prop_assert_eq!(e.exit_status(), 2),
        }
    }
}
