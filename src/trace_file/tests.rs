//! What is written is read back, by readers that share nothing with the writers.

use super::{Signal, Trace, Values};

/// A signal of integers.
pub(super) fn integers(name: &str, every: u32, bits: u32, values: &[i64]) -> Signal {
    let values = values.to_vec();
    Signal {
        name: name.to_owned(),
        unit: "LSB".to_owned(),
        every,
        values: Values::Integer { bits, values },
    }
}

/// A signal of reals.
pub(super) fn reals(name: &str, every: u32, values: &[f64]) -> Signal {
    Signal {
        name: name.to_owned(),
        unit: String::new(),
        every,
        values: Values::Real(values.to_vec()),
    }
}

/// A trace at 56 kHz.
pub(super) fn trace(first_sample: u64, signals: Vec<Signal>) -> Trace {
    Trace {
        sample_rate_hz: 56000.0,
        first_sample,
        signals,
    }
}

/// What is written under this extension.
pub(super) fn written(trace: &Trace, extension: &str) -> Vec<u8> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(format!("trace.{extension}"));
    trace.write(&path).unwrap();
    std::fs::read(path).unwrap()
}

/// Reals that are easily written wrong.
pub(super) const REALS: [f64; 9] = [
    0.1,
    -0.0,
    1e300,
    -5e-324,
    1.0 / 3.0,
    f64::MAX,
    f64::NAN,
    f64::NEG_INFINITY,
    123456789012345680.0,
];

fn refusal(trace: &Trace, name: &str) -> String {
    let folder = tempfile::tempdir().unwrap();
    let error = trace.write(&folder.path().join(name)).unwrap_err();
    assert_eq!(error.exit_status(), 2);
    let left = std::fs::read_dir(folder.path()).unwrap().count();
    assert_eq!(left, 0, "{name} leaves a file");
    error.to_string()
}

/// Cells of a CSV file by the `csv` crate's reader.
fn cells(trace: &Trace) -> Vec<Vec<String>> {
    let text = written(trace, "csv");
    let mut reader = ::csv::ReaderBuilder::new()
        .has_headers(false)
        .from_reader(&text[..]);
    let rows = reader.records().map(|r| r.unwrap());
    rows.map(|r| r.iter().map(str::to_owned).collect())
        .collect()
}

#[test]
fn csv_reads_back_the_same_bits() {
    let extremes = [i64::MIN, i64::MAX, -1, 0, 1, -2, 3, 4, 5];
    let t = trace(
        1000,
        vec![
            integers("a.b drive_i", 1, 64, &extremes),
            reals("c", 1, &REALS),
        ],
    );
    let rows = cells(&t);
    assert_eq!(rows[0], ["sample", "time_s", "a.b drive_i [LSB]", "c"]);
    assert_eq!(rows.len(), 10);
    for (k, row) in rows[1..].iter().enumerate() {
        assert_eq!(row[0].parse(), Ok(1000 + k as u64));
        assert_eq!(row[1].parse(), Ok((1000 + k) as f64 / 56000.0));
        assert_eq!(row[2].parse(), Ok(extremes[k]));
        let back: f64 = row[3].parse().unwrap();
        let same = back.to_bits() == REALS[k].to_bits();
        assert!(same || (back.is_nan() && REALS[k].is_nan()), "{row:?}");
    }
}

#[test]
fn csv_leaves_cells_empty_where_a_slower_signal_has_no_value() {
    let t = trace(
        10,
        vec![
            integers("fast", 2, 8, &[1, 2, 3]),
            integers("slow, \"odd\"\nname", 3, 8, &[-7, -8]),
        ],
    );
    let rows = cells(&t);
    assert_eq!(rows[0][3], "slow, \"odd\"\nname [LSB]");
    let numbers: Vec<[&str; 3]> = rows[1..]
        .iter()
        .map(|r| [r[0].as_str(), r[2].as_str(), r[3].as_str()])
        .collect();
    let expected = [
        ["11", "1", ""],
        ["12", "", "-7"],
        ["13", "2", ""],
        ["15", "3", "-8"],
    ];
    assert_eq!(numbers, expected);
}

/// The items of an NPY file of version 1.0: type, shape, words.
fn array(bytes: &[u8]) -> (String, String, Vec<u64>) {
    assert_eq!(&bytes[..8], b"\x93NUMPY\x01\x00");
    let length = 10 + usize::from(u16::from_le_bytes([bytes[8], bytes[9]]));
    assert_eq!(length % 64, 0);
    let header = std::str::from_utf8(&bytes[10..length]).unwrap();
    let between = |from: &str, to: &str| {
        let rest = &header[header.find(from).unwrap() + from.len()..];
        rest[..rest.find(to).unwrap()].to_owned()
    };
    let items = bytes[length..].chunks(8);
    let words = items.map(|c| u64::from_le_bytes(c.try_into().unwrap()));
    let shape = between("'shape': (", ")");
    (between("'descr': '", "'"), shape, words.collect())
}

#[test]
fn npy_of_integers_keeps_all_64_bits() {
    let t = trace(
        0,
        vec![
            integers("a", 4, 64, &[i64::MIN, -1]),
            integers("b", 4, 64, &[i64::MAX, (1 << 53) + 1]),
        ],
    );
    let (kind, shape, words) = array(&written(&t, "npy"));
    assert_eq!((kind.as_str(), shape.as_str()), ("<i8", "2, 2"));
    let back: Vec<i64> = words.iter().map(|w| *w as i64).collect();
    assert_eq!(back, [i64::MIN, i64::MAX, -1, (1 << 53) + 1]);
}

#[test]
fn npy_of_mixed_rates_holds_the_slower_signal() {
    let t = trace(
        7,
        vec![
            reals("fast", 2, &[0.5, 1.5, 2.5, 3.5]),
            integers("slow", 3, 16, &[-3, 9]),
        ],
    );
    let (kind, shape, words) = array(&written(&t, "npy"));
    assert_eq!((kind.as_str(), shape.as_str()), ("<f8", "4, 2"));
    let back: Vec<f64> = words.iter().map(|w| f64::from_bits(*w)).collect();
    assert!(back[1].is_nan(), "no value of the slow signal yet");
    assert_eq!(back[0], 0.5);
    assert_eq!(back[2..], [1.5, -3.0, 2.5, 9.0, 3.5, 9.0]);
}

#[test]
fn npy_refuses_an_integer_that_a_float_would_change() {
    let wide = integers("word", 1, 64, &[1 << 53, (1 << 53) + 1]);
    let t = trace(0, vec![wide, reals("x", 1, &[0.0, 0.0])]);
    let text = refusal(&t, "t.npy");
    assert!(
        text.contains("9007199254740993") && text.contains("word"),
        "{text}"
    );
}

#[test]
fn an_empty_trace_is_a_file_without_rows() {
    let none = trace(5, vec![]);
    assert_eq!(written(&none, "csv"), b"sample,time_s\n");
    assert_eq!(array(&written(&none, "npy")).1, "0, 0");
    let no_values = trace(5, vec![integers("a", 1, 8, &[]), reals("b", 32, &[])]);
    assert_eq!(written(&no_values, "csv"), b"sample,time_s,a [LSB],b\n");
    assert_eq!(array(&written(&no_values, "npy")).1, "0, 2");
    // Not one value of the slow signal: its column is there all the same.
    let half = trace(5, vec![reals("b", 32, &[]), reals("c", 1, &[1.0])]);
    let (_, shape, words) = array(&written(&half, "npy"));
    assert_eq!(shape, "1, 2");
    assert!(f64::from_bits(words[0]).is_nan());
}

#[test]
fn what_cannot_be_written_is_refused_and_leaves_nothing() {
    let good = trace(0, vec![integers("a", 1, 8, &[1])]);
    for name in ["t", "t.txt", "t.vcd.gz"] {
        let text = refusal(&good, name);
        for format in [".csv", ".npy", ".vcd"] {
            assert!(text.contains(format), "{text}");
        }
    }
    assert_eq!(written(&good, "CSV"), written(&good, "csv"));
    for rate in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        let mut t = good.clone();
        t.sample_rate_hz = rate;
        assert!(refusal(&t, "t.csv").contains("sample rate"));
    }
    let cases = [
        (integers("n", 0, 8, &[1]), "0 samples"),
        (integers("n", 1, 0, &[]), "1 to 64 bits"),
        (integers("n", 1, 65, &[]), "1 to 64 bits"),
        (integers("n", 1, 8, &[256]), "256 does not fit"),
        (integers("n", 1, 8, &[-129]), "-129 does not fit"),
    ];
    for (signal, what) in cases {
        for name in ["t.csv", "t.npy", "t.vcd"] {
            let text = refusal(&trace(0, vec![signal.clone()]), name);
            assert!(text.contains(what) && text.contains("`n`"), "{text}");
        }
    }
    let late = trace(u64::MAX, vec![integers("n", 1, 8, &[1])]);
    assert!(refusal(&late, "t.csv").contains("64 bits"));
}

/// Larger than one buffer: what is passed on is neither lost nor doubled.
#[test]
fn a_long_trace_is_whole() {
    let values: Vec<i64> = (0..60_000).map(|k| k * 7919 % 30011 - 15000).collect();
    let t = trace(0, vec![integers("a", 1, 16, &values)]);
    let rows = cells(&t);
    let back: Vec<i64> = rows[1..].iter().map(|r| r[2].parse().unwrap()).collect();
    assert_eq!(back, values);
}
