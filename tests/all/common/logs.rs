//! Logs of autopilots, written from the public descriptions of their forms: PX4's ULog and ArduPilot's DataFlash.

/// Samples a second of each row: the rows are 2 s apart.
const SAMPLES: u64 = 20;

/// The messages between two rows, and what they hold: time, us, rate, deg/s, temperature, degC.
fn samples(rows: &[(f64, f64, f64)]) -> impl Iterator<Item = (u64, f64, f64)> + '_ {
    rows.iter().flat_map(|(time_s, dps, degc)| {
        (0..2 * SAMPLES)
            .map(move |k| ((time_s * 1e6) as u64 + k * 1_000_000 / SAMPLES, *dps, *degc))
    })
}

/// A ULog with the topic `sensor_gyro` of one gyro, its axis z.
pub fn ulog(rows: &[(f64, f64, f64)]) -> Vec<u8> {
    let mut out = vec![0x55, 0x4C, 0x6F, 0x67, 0x01, 0x12, 0x35, 1];
    out.extend(0u64.to_le_bytes());
    let mut message = |kind: u8, body: &[u8]| {
        out.extend((body.len() as u16).to_le_bytes());
        out.push(kind);
        out.extend(body);
    };
    message(b'B', &[0; 40]);
    message(
        b'F',
        b"sensor_gyro:uint64_t timestamp;uint64_t timestamp_sample;uint32_t device_id;float x;float y;float z;float temperature;",
    );
    message(b'A', b"\x00\x07\x00sensor_gyro");
    for (time_us, dps, degc) in samples(rows) {
        let mut body = 7u16.to_le_bytes().to_vec();
        body.extend(time_us.to_le_bytes());
        body.extend(time_us.to_le_bytes());
        body.extend(2_490_378u32.to_le_bytes());
        for value in [0.0, 0.0, dps.to_radians(), degc] {
            body.extend((value as f32).to_le_bytes());
        }
        message(b'D', &body);
    }
    out
}

/// A DataFlash log with the messages of one IMU, its axis z.
pub fn dataflash(rows: &[(f64, f64, f64)]) -> Vec<u8> {
    let mut out = Vec::new();
    let mut define = |kind: u8, length: u8, name: &str, format: &str, labels: &str| {
        let padded = |text: &str, size: usize| -> Vec<u8> {
            let mut bytes = text.as_bytes().to_vec();
            bytes.resize(size, 0);
            bytes
        };
        out.extend([0xA3, 0x95, 128, kind, length]);
        out.extend(padded(name, 4));
        out.extend(padded(format, 16));
        out.extend(padded(labels, 64));
    };
    define(128, 89, "FMT", "BBnNZ", "Type,Length,Name,Format,Columns");
    define(
        131,
        3 + 8 + 1 + 12 + 4,
        "IMU",
        "QBffff",
        "TimeUS,I,GyrX,GyrY,GyrZ,T",
    );
    for (time_us, dps, degc) in samples(rows) {
        out.extend([0xA3, 0x95, 131]);
        out.extend(time_us.to_le_bytes());
        out.push(0);
        for value in [0.0, 0.0, dps.to_radians(), degc] {
            out.extend((value as f32).to_le_bytes());
        }
    }
    out
}
