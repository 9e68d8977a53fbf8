//! Captures and packed files with random damage: never a panic, and no row lost in silence. `GYROGEN_MUTATIONS=N` takes more
//! of them, `GYROGEN_SEED=S` others.

use super::any::read_any;
use super::capture::CaptureReader;
use super::capture_tests::{Q15, Rows, npy_rows};
use super::mutation_tests::{Random, asked, csv, damage};
use super::ulog_tests;
use crate::design::RecordMapping;
use std::io::Write;
use std::path::Path;

/// Codes of both channels.
fn codes() -> Vec<(i32, i32)> {
    (0..80)
        .map(|k| (k * 7919 % 30000 - 15000, k * 104_729 % 20000 - 10000))
        .collect()
}

fn contract() -> Vec<u8> {
    let rows = codes().into_iter().map(|(d, s)| format!("{d},{s}\n"));
    let rows: String = rows.collect();
    format!("# fs_hz = 224000.0\n# ftw = 33554432\ndrive_code,sense_code\n{rows}").into_bytes()
}

/// As an oscilloscope writes it: a preamble, a line of units, volts, a cell more in the first lines.
fn scope() -> Vec<u8> {
    let rows = codes().into_iter().enumerate().map(|(k, (d, s))| {
        let [d, s] = [d, s].map(|c| f64::from(c) * 1e-4);
        format!("{:.7},{d:.5},{s:.5}\n", k as f64 * 5e-6)
    });
    let rows: String = rows.collect();
    format!(
        "Model,XYZ2000\nRecord Length,80\nSample Interval,5e-6,s\n\nTIME,CH1,CH2,Start\nSequence,Volt,Volt,0\n{rows}"
    )
    .into_bytes()
}

const SCOPE_KEYS: &str = "drive_column = \"CH1\"\nsense_column = 2\nvolts_per_code = 1e-4\n";
const RAW_KEYS: &str = "item = \"int16\"\nchannels = 2\n";

fn raw() -> Vec<u8> {
    let both = codes().into_iter().flat_map(|(d, s)| [d as i16, s as i16]);
    both.flat_map(i16::to_le_bytes).collect()
}

/// The rows of a capture, if all of it can be read, with lines that were passed over; its error is one of the input.
fn rows(path: &Path, block: usize) -> Result<(Rows, Vec<String>), String> {
    let told = |e: crate::error::Error| {
        assert_eq!(e.exit_status(), 2, "{e}");
        e.to_string()
    };
    let mut reader = CaptureReader::open(path, Q15).map_err(told)?;
    let (mut all, mut drive, mut sense) = (Vec::new(), Vec::new(), Vec::new());
    while reader
        .read_block(&mut drive, &mut sense, block)
        .map_err(told)?
        > 0
    {
        all.extend(drive.iter().copied().zip(sense.iter().copied()));
    }
    Ok((all, reader.notes().to_vec()))
}

#[test]
fn a_damaged_capture_makes_no_panic_and_costs_no_row_in_silence() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    std::fs::write(path("scope.toml"), SCOPE_KEYS).unwrap();
    std::fs::write(path("samples.toml"), RAW_KEYS).unwrap();
    let sources = [
        ("contract.csv", contract()),
        ("scope.csv", scope()),
        ("samples.raw", raw()),
        ("array.npy", npy_rows(1, 2, false, &codes())),
        ("columns.npy", npy_rows(2, 4, true, &codes())),
    ];
    for (name, bytes) in &sources {
        std::fs::write(path(name), bytes).unwrap();
        assert_eq!(rows(&path(name), 7).unwrap().0, codes(), "{name}");
    }
    let (first, count) = asked(600);
    let mut read = 0;
    for seed in first..first + count {
        let mut r = Random(seed);
        let (name, sound) = &sources[r.below(sources.len())];
        let mut bytes = sound.clone();
        damage(&mut bytes, &mut r);
        let path = path(name);
        std::fs::write(&path, &bytes).unwrap();
        let out = rows(&path, 1 << 16);
        assert_eq!(out, rows(&path, 1 + r.below(90)), "{name} {seed}");
        let Ok((found, notes)) = out else { continue };
        read += 1;
        let expected = match *name {
            "samples.raw" => bytes.len() / 4,
            // What an NPY file holds is what its header says.
            "array.npy" => (bytes.len() - 80) / 4,
            "columns.npy" => found.len(),
            // A line that became no comment any more is told as one before the table.
            _ => {
                let before = notes
                    .iter()
                    .find_map(|n| n.split_once(" lines stand before"));
                let before = before.map_or(1, |(n, _)| n.parse().unwrap());
                let is_none = |l: &&[u8]| {
                    let line = l.trim_ascii();
                    line.is_empty() || line.starts_with(b"#")
                };
                let lines = bytes.split(|b| *b == b'\n').skip_while(is_none);
                lines
                    .skip(before)
                    .filter(|l| !l.trim_ascii().is_empty())
                    .count()
            }
        };
        let is_npy = name.ends_with("npy");
        assert!(
            found.len() == expected || is_npy && found.len() + 8 >= expected,
            "{name} {seed}: {} {expected}",
            found.len()
        );
    }
    assert!(8 * read > count, "{read} of {count}");
}

#[test]
fn a_damaged_packed_record_is_the_record_or_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let mapping = RecordMapping::default();
    let gzip = |bytes: &[u8]| {
        let mut out = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::default());
        out.write_all(bytes).unwrap();
        out.finish().unwrap()
    };
    let zstd = |bytes: &[u8]| {
        ruzstd::encoding::compress_to_vec(bytes, ruzstd::encoding::CompressionLevel::Fastest)
    };
    let log = ulog_tests::sound().0;
    let sources = [gzip(&csv()), zstd(&csv()), gzip(&log), zstd(&log)];
    let path = folder.path().join("packed");
    let read = |bytes: &[u8]| {
        std::fs::write(&path, bytes).unwrap();
        read_any(&path, &mapping)
    };
    let sound: Vec<_> = sources.iter().map(|s| read(s).unwrap()).collect();
    let (first, count) = asked(600);
    let mut same = 0;
    for seed in first..first + count {
        let mut r = Random(seed);
        let k = r.below(sources.len());
        let mut bytes = sources[k].clone();
        damage(&mut bytes, &mut r);
        match read(&bytes) {
            Ok((record, warnings)) => {
                // Of all bytes those of the head alone may be others: a checksum stands over the rest.
                let text = |r: &super::ThermalRecord| format!("{:?} {:?}", r.time_s, r.columns);
                assert_eq!(text(&record), text(&sound[k].0), "{k} {seed}");
                assert_eq!(warnings, sound[k].1, "{k} {seed}");
                same += 1;
            }
            Err(e) => assert_eq!(e.exit_status(), 2, "{k} {seed}: {e}"),
        }
    }
    assert!(same < count / 2);
}
