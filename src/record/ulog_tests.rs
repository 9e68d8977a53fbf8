//! ULogs written by this test from the specification, read back, and damaged.

use super::any::read_any;
use super::thermal::ThermalRecord;
use super::ulog;
use super::warning::Warning;
use crate::design::{LogAxis, RecordMapping};
use crate::error::{Error, Result};
use proptest::prelude::*;
use std::path::Path;

/// A writer that knows the specification and nothing of the reader.
#[derive(Default)]
pub(super) struct Writer(pub Vec<u8>);

impl Writer {
    pub(super) fn new() -> Self {
        let mut bytes = b"ULog\x01\x12\x35\x01".to_vec();
        bytes.extend(5_000_000u64.to_le_bytes());
        let mut w = Writer(bytes);
        w.message(b'B', &[0; 40]);
        w
    }

    pub(super) fn message(&mut self, kind: u8, body: &[u8]) {
        self.0
            .extend(u16::try_from(body.len()).unwrap().to_le_bytes());
        self.0.push(kind);
        self.0.extend(body);
    }

    pub(super) fn subscribe(&mut self, number: u16, instance: u8, name: &str) {
        let mut body = vec![instance];
        body.extend(number.to_le_bytes());
        body.extend(name.bytes());
        self.message(b'A', &body);
    }

    pub(super) fn data(&mut self, number: u16, time_us: u64, rest: &[u8]) {
        let mut body = number.to_le_bytes().to_vec();
        body.extend(time_us.to_le_bytes());
        body.extend(rest);
        self.message(b'D', &body);
    }

    pub(super) fn sync(&mut self) {
        self.message(b'S', &[0x2F, 0x73, 0x13, 0x20, 0x25, 0x0C, 0xBB, 0x12]);
    }
}

pub(super) fn floats(values: &[f32]) -> Vec<u8> {
    values.iter().flat_map(|v| v.to_le_bytes()).collect()
}

/// us since power-on of the first sample.
const START_US: u64 = 20_000_000;

/// deg/s of gyro `instance`, axis `axis`, `k` steps of 0.1 s after the start.
fn rate_dps(instance: usize, axis: usize, k: u64) -> f64 {
    0.1 * (axis as f64 + 1.0) + 0.01 * (k % 10) as f64 + 1e-3 * (k / 10) as f64 - instance as f64
}

/// Twenty seconds at 10 Hz: two gyros with accelerometers, a battery every second.
pub(super) fn sound() -> Writer {
    let mut w = Writer::new();
    w.message(b'F', b"sensor_gyro:uint64_t timestamp;uint64_t timestamp_sample;uint32_t device_id;float x;float y;float z;float temperature;uint32_t error_count;uint8_t samples;uint8_t[3] _padding0;");
    w.message(
        b'F',
        b"sensor_accel:uint64_t timestamp;float x;float y;float z;",
    );
    w.message(
        b'F',
        b"battery_status:uint64_t timestamp;float voltage_v;bool connected;uint8_t[3] _padding0;",
    );
    w.message(b'F', b"system_power:uint64_t timestamp;float voltage5v_v;");
    w.message(b'F', b"attitude:uint64_t timestamp;vector q;");
    w.message(b'F', b"vector:float[4] v;");
    w.message(b'I', b"\x11char[3] sys_namePX4");
    w.message(b'P', b"\x0dint32_t A_B_C\x01\x00\x00\x00");
    for (number, instance, name) in [
        (0, 0, "sensor_gyro"),
        (1, 1, "sensor_gyro"),
        (2, 0, "sensor_accel"),
        (3, 1, "sensor_accel"),
        (4, 0, "battery_status"),
        (5, 0, "attitude"),
        (6, 0, "system_power"),
    ] {
        w.subscribe(number, instance, name);
    }
    w.message(b'L', b"6\x00\x00\x00\x00\x00\x00\x00\x00hello");
    for k in 0..200 {
        let time = START_US + k * 100_000;
        for instance in 0..2 {
            let mut body = time.to_le_bytes().to_vec();
            body.extend(7u32.to_le_bytes());
            let xyz = [0, 1, 2].map(|a| rate_dps(instance, a, k).to_radians() as f32);
            body.extend(floats(&xyz));
            body.extend(floats(&[30.0 + (k / 10) as f32 + instance as f32]));
            body.extend([0; 5]);
            w.data(instance as u16, time, &body);
            w.data(
                2 + instance as u16,
                time,
                &floats(&[0.0, 9.80665 * 0.5, -9.80665]),
            );
        }
        if k % 10 == 0 {
            w.data(
                4,
                time,
                &[&floats(&[12.0 + k as f32 * 1e-3]), &[1u8][..]].concat(),
            );
            w.data(5, time, &floats(&[1.0, 0.0, 0.0, 0.0]));
            w.data(6, time, &floats(&[0.0]));
            w.message(b'Y', b"of a future version");
            w.sync();
        }
    }
    w
}

fn of(bytes: &[u8], mapping: &RecordMapping) -> Result<(ThermalRecord, Vec<Warning>)> {
    ulog::read(bytes, Path::new("flight.ulg"), mapping)
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
    let bytes = sound().0;
    for (axis, instance) in [(LogAxis::Z, 0usize), (LogAxis::X, 1), (LogAxis::Y, 0)] {
        let mapping = RecordMapping {
            axis,
            instance: Some(instance as u32),
            ..RecordMapping::default()
        };
        let (r, warnings) = of(&bytes, &mapping).unwrap();
        assert_eq!(codes(&warnings), ["log_averaged"], "{warnings:?}");
        assert_eq!(r.len(), 20);
        for i in 0..20 {
            // Ten samples of a ramp by 0.01 deg/s: the mean is the first and 0.045.
            let expected = rate_dps(instance, axis.index(), 10 * i as u64) + 0.045;
            assert!((r.columns["rate_out_dps"][i] - expected).abs() < 1e-6);
            assert!((r.columns["die_degc"][i] - (30.0 + (i + instance) as f64)).abs() < 1e-5);
            let g = [0.0, 0.5, -1.0][axis.index()];
            assert!((r.columns["accel_g"][i] - g).abs() < 1e-6);
            assert!((r.columns["supply_v"][i] - (12.0 + 0.01 * i as f64)).abs() < 1e-5);
            assert!((r.time_s[i] - i as f64).abs() < 1e-9);
            assert!((r.columns["time_since_power_on_s"][i] - (20.45 + i as f64)).abs() < 1e-9);
        }
        // The rail of 5 V was logged as 0, so it was not measured.
        assert_eq!(r.renamed["supply_v"], "battery_status.voltage_v");
        assert!(r.renamed["rate_out_dps"].starts_with("sensor_gyro."));
        assert_eq!(r.columns.values().filter(|c| c.len() == 20).count(), 5);
    }
}

#[test]
fn the_length_of_a_row_is_the_designs() {
    let mapping = RecordMapping {
        average_s: Some(2.0),
        ..RecordMapping::default()
    };
    let (r, _) = of(&sound().0, &mapping).unwrap();
    assert_eq!(r.len(), 10);
    assert!((r.columns["die_degc"][3] - 36.5).abs() < 1e-5);
    let mapping = RecordMapping {
        average_s: Some(4.0),
        ..RecordMapping::default()
    };
    let said = refusal(&sound().0, &mapping);
    assert!(
        said.contains("average_s = 4 s leaves 5 rows of the record")
            && said.contains("average_s = 0.95 leaves 20 rows"),
        "{said}"
    );
    // What the message says helps.
    let mapping = RecordMapping {
        average_s: Some(0.95),
        ..RecordMapping::default()
    };
    assert!(of(&sound().0, &mapping).unwrap().0.len() >= 20);
}

#[test]
fn integrals_and_the_gyro_in_use_serve_where_the_driver_was_not_logged() {
    let mut w = Writer::new();
    w.message(b'F', b"vehicle_imu:uint64_t timestamp;float[3] delta_angle;float[3] delta_velocity;uint32_t delta_angle_dt;uint16_t delta_velocity_dt;");
    w.message(
        b'F',
        b"vehicle_imu_status:uint64_t timestamp;float temperature_gyro;",
    );
    w.subscribe(0, 0, "vehicle_imu");
    w.subscribe(1, 0, "vehicle_imu_status");
    for k in 0..15u64 {
        let time = k * 1_000_000 + 300;
        let rate = (0.5 + 0.01 * (k % 3) as f32 - 0.02).to_radians() * 0.005;
        let mut body = floats(&[0.0, 0.0, rate, 0.0, 0.0, -9.80665 * 0.004]);
        body.extend(5000u32.to_le_bytes());
        body.extend(4000u16.to_le_bytes());
        w.data(0, time, &body);
        w.data(1, time, &floats(&[40.0 + k as f32]));
    }
    let (r, _) = of(&w.0, &RecordMapping::default()).unwrap();
    assert!((r.columns["rate_out_dps"][14] - 0.5).abs() < 1e-6, "{r:?}");
    assert!((r.columns["accel_g"][3] + 1.0).abs() < 1e-6);
    assert_eq!(r.columns["die_degc"][14], 54.0);
    assert_eq!(r.renamed["rate_out_dps"], "vehicle_imu.delta_angle[2]");

    let mut w = Writer::new();
    w.message(
        b'F',
        b"sensor_combined:uint64_t timestamp;float[3] gyro_rad;",
    );
    w.subscribe(0, 0, "sensor_combined");
    for k in 0..15u64 {
        let wobble = 1e-4 * (k * k % 7) as f32;
        w.data(0, k * 1_000_000, &floats(&[0.0, 0.0, 0.1 + wobble]));
    }
    let (r, _) = of(&w.0, &RecordMapping::default()).unwrap();
    assert!((r.columns["rate_out_dps"][0] - 0.1f64.to_degrees()).abs() < 1e-6);
    assert!(!r.columns.contains_key("die_degc"));
}

#[test]
fn what_cannot_be_used_is_refused_with_the_reason() {
    let plain = RecordMapping::default();
    let sound = sound().0;
    let second = |w: &mut Writer| {
        w.message(
            b'F',
            b"sensor_gyro:uint64_t timestamp;float x;float y;float z;",
        );
        w.subscribe(0, 0, "sensor_gyro");
    };
    let mut back = Writer::new();
    second(&mut back);
    for (k, time) in [
        9_000_000u64,
        10_000_000,
        11_000_000,
        12_000_000,
        13_000_000,
        500_000,
        600_000,
        700_000,
        800_000,
    ]
    .into_iter()
    .enumerate()
    {
        back.data(0, time, &floats(&[k as f32; 3]));
    }
    let mut future = Writer::new();
    future.0[16 + 3 + 8] = 2;
    let mut undefined = Writer::new();
    undefined.subscribe(0, 0, "sensor_gyro");
    let mut nonsense = Writer::new();
    nonsense.message(b'F', b"no definition");
    let mut none = Writer::new();
    none.message(b'F', b"attitude:uint64_t timestamp;float q;");
    none.subscribe(0, 0, "attitude");
    let instance = RecordMapping {
        instance: Some(3),
        ..RecordMapping::default()
    };
    type Case<'a> = (&'a [u8], &'a RecordMapping, &'a [&'a str]);
    let cases: [Case; 9] = [
        (&sound[..10], &plain, &["byte 0", "header"]),
        (
            &sound[..3000],
            &plain,
            &["only 2 rows", "ends within a message"],
        ),
        (
            &sound,
            &instance,
            &["no samples of gyro 3", "sensor_gyro 0, sensor_gyro 1"],
        ),
        (
            &back.0,
            &plain,
            &["clock runs backwards", "11.000 s to 0.500 s", "(byte "],
        ),
        (&future.0, &plain, &["readers of this version", "byte 16"]),
        (
            &undefined.0,
            &plain,
            &["without a usable definition", "sensor_gyro"],
        ),
        (
            &nonsense.0,
            &plain,
            &["definition cannot be read", "byte 59"],
        ),
        (&none.0, &plain, &["no gyro topic at all", "sensor_gyro"]),
        (
            b"ULog\x01\x12\x35\x01\0\0\0\0\0\0\0\0garbage",
            &plain,
            &["byte 16", "definitions"],
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
fn a_lost_battery_and_a_bad_sector_cost_only_what_they_hit() {
    let plain = RecordMapping::default();
    let bytes = sound().0;
    let whole = of(&bytes, &plain).unwrap().0;
    let (cut, warnings) = of(&bytes[..bytes.len() - 20], &plain).unwrap();
    assert_eq!(
        codes(&warnings),
        ["log_cut_off", "gyros_in_log", "log_averaged"]
    );
    assert_eq!(cut.time_s[..19], whole.time_s[..19]);

    let mut bad = bytes.clone();
    // It begins within samples of the gyro, whose message is whole by its length alone.
    let head = [43, 0, b'D', 0, 0];
    let half = bytes.len() / 2;
    let at = half + bytes[half..].windows(5).position(|w| w == head).unwrap() + 25;
    bad[at..at + 600].fill(0xEE);
    let (left, warnings) = of(&bad, &plain).unwrap();
    assert_eq!(codes(&warnings)[0], "log_damaged", "{warnings:?}");
    // At most three rows lie between the damage and the next mark but one.
    assert!(left.len() >= 17, "{}", left.len());
    let kept = left.columns["die_degc"]
        .iter()
        .zip(&left.columns["rate_out_dps"])
        .all(|(degc, rate)| {
            let i = whole.columns["die_degc"]
                .iter()
                .position(|w| (w - degc).abs() < 1e-9);
            i.is_some_and(|i| (whole.columns["rate_out_dps"][i] - rate).abs() < 0.1)
        });
    assert!(kept);
}

#[test]
fn appended_data_are_read_behind_a_message_that_was_cut() {
    let bytes = sound().0;
    let mut log = bytes[..bytes.len() - 20].to_vec();
    let end = log.len() as u64;
    log[16 + 3 + 8] = 1;
    log[16 + 3 + 16..16 + 3 + 24].copy_from_slice(&end.to_le_bytes());
    let mut more = Writer::default();
    more.sync();
    log.extend(more.0);
    let (r, warnings) = of(&log, &RecordMapping::default()).unwrap();
    assert_eq!(r.len(), 20);
    assert_eq!(
        codes(&warnings),
        ["log_damaged", "gyros_in_log", "log_averaged"]
    );
}

#[test]
fn content_decides_what_a_file_is_and_the_name_what_it_claims() {
    let folder = tempfile::tempdir().unwrap();
    let plain = RecordMapping::default();
    let with = |name: &str, bytes: &[u8]| {
        let path = folder.path().join(name);
        std::fs::write(&path, bytes).unwrap();
        read_any(&path, &plain)
    };
    let csv: String = (0..12).map(|k| format!("{k},0.{k}\n")).collect();
    let csv = format!("time_s,rate_out_dps\n{csv}");
    assert_eq!(with("log.csv", &sound().0).unwrap().0.len(), 20);
    assert_eq!(with("r.txt", csv.as_bytes()).unwrap().0.len(), 12);
    for (name, bytes, part) in [
        ("r.ulg", csv.as_bytes(), "named as a PX4 ULog"),
        ("r.BIN", csv.as_bytes(), "named as an ArduPilot log"),
        ("r.log", b"FMT, 128, 89, FMT, BBnNZ", "text form"),
        ("r.csv", b"", "empty"),
    ] {
        let said = with(name, bytes).unwrap_err().to_string();
        assert!(said.contains(part) && said.contains("help"), "{said}");
    }
    let said = read_any(folder.path(), &plain).unwrap_err().to_string();
    assert!(said.contains("folder"), "{said}");
    let said = read_any(&folder.path().join("none.ulg"), &plain).unwrap_err();
    assert!(said.to_string().contains("check the path"), "{said}");
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
        let mut bytes = sound().0;
        for (at, byte) in edits {
            // Half of the runs damage the definitions, which a uniform choice rarely hits.
            let reach = if front { 1200 } else { bytes.len() };
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
