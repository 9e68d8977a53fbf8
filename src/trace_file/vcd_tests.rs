//! VCD, read by a strict reader written from the standard's grammar (IEEE 1364-2005, section 18.2).

use super::tests::{REALS, integers, reals, trace, written};
use super::{Signal, Trace, Values};
use std::collections::BTreeMap;

/// A variable with its changes: (time, text after `b` or `r`, or the scalar).
#[derive(Debug, Default, PartialEq)]
struct Variable {
    kind: String,
    bits: u32,
    changes: Vec<(u64, String)>,
}

/// What a dump says.
#[derive(Debug, Default)]
struct Dump {
    timescale: String,
    /// By path of scopes and name, joined by `/`.
    variables: BTreeMap<String, Variable>,
    last_time: u64,
}

/// Reads all of a dump; panics at what the grammar does not have.
fn read(bytes: &[u8]) -> Dump {
    let text = std::str::from_utf8(bytes).unwrap();
    assert!(text.bytes().all(|b| b == b'\n' || (32..127).contains(&b)));
    let mut words = text.split_ascii_whitespace();
    let mut dump = Dump::default();
    let mut scopes: Vec<String> = Vec::new();
    let mut names: BTreeMap<String, String> = BTreeMap::new();
    loop {
        let keyword = words.next().unwrap();
        let body: Vec<&str> = words.by_ref().take_while(|w| *w != "$end").collect();
        match (keyword, body.as_slice()) {
            ("$version" | "$comment", _) => {}
            ("$timescale", [count @ ("1" | "10" | "100"), unit]) => {
                assert!(["s", "ms", "us", "ns", "ps", "fs"].contains(unit));
                dump.timescale = format!("{count} {unit}");
            }
            ("$scope", ["module", name]) => scopes.push(simple(name)),
            ("$upscope", []) => assert!(scopes.pop().is_some()),
            ("$var", [kind @ ("wire" | "real"), bits, code, name]) => {
                let path = scopes.iter().cloned().chain([simple(name)]);
                let path = path.collect::<Vec<_>>().join("/");
                assert!(code.bytes().all(|b| (33..=126).contains(&b)));
                let old = names.insert(code.to_string(), path.clone());
                assert_eq!(old, None, "code {code} twice");
                let variable = Variable {
                    kind: kind.to_string(),
                    bits: bits.parse().unwrap(),
                    changes: Vec::new(),
                };
                assert_eq!(dump.variables.insert(path, variable), None);
            }
            ("$enddefinitions", []) => break,
            other => panic!("{other:?}"),
        }
    }
    assert!(scopes.is_empty() && !dump.timescale.is_empty());
    let mut now: Option<u64> = None;
    while let Some(word) = words.next() {
        let (first, rest) = word.split_at(1);
        let (value, code) = match first {
            "#" => {
                let time = rest.parse().unwrap();
                assert!(now < Some(time), "time goes on");
                now = Some(time);
                dump.last_time = time;
                continue;
            }
            "$" => {
                assert!(rest == "dumpvars" || rest == "end");
                continue;
            }
            "b" | "r" => (rest, words.next().unwrap()),
            _ => (first, rest),
        };
        let variable = dump.variables.get_mut(&names[code]).unwrap();
        match (variable.kind.as_str(), first) {
            ("wire", "b") => {
                assert!(value == "x" || value.bytes().all(|b| b == b'0' || b == b'1'));
                assert!(value.len() <= variable.bits as usize);
            }
            ("wire", "0" | "1" | "x") => assert_eq!(variable.bits, 1),
            ("real", "r") => {
                let _: f64 = value.parse().unwrap();
            }
            other => panic!("{other:?}"),
        }
        variable.changes.push((now.unwrap(), value.to_owned()));
    }
    dump
}

/// An identifier that needs no escape.
fn simple(name: &str) -> String {
    let mut bytes = name.bytes();
    assert!(
        bytes
            .next()
            .is_some_and(|b| b.is_ascii_alphabetic() || b == b'_')
    );
    assert!(bytes.all(|b| b.is_ascii_alphanumeric() || b == b'_'));
    name.to_owned()
}

/// The word after a change, extended with zeros, in two's complement; `None` is x.
fn word(text: &str, bits: u32) -> Option<i64> {
    let raw = u64::from_str_radix(text, 2).ok()?;
    let spare = 64 - bits;
    Some(((raw << spare) as i64) >> spare)
}

/// Value by time of a variable.
fn at(dump: &Dump, name: &str, time: u64) -> String {
    let changes = dump.variables[name].changes.iter();
    changes
        .take_while(|c| c.0 <= time)
        .last()
        .unwrap()
        .1
        .clone()
}

#[test]
fn words_of_every_width_come_back() {
    for bits in [1, 2, 7, 8, 31, 32, 33, 63, 64] {
        let low = i64::MIN >> (64 - bits);
        let values = [low, !low, 0, -1, low / 3, !low / 5, -1, -1, 0];
        let t = trace(3, vec![integers("a.b", 1, bits, &values)]);
        let mut t = t;
        t.sample_rate_hz = 1000.0;
        let dump = read(&written(&t, "vcd"));
        assert_eq!(dump.timescale, "1 ms");
        assert_eq!(dump.variables["a/b"].bits, bits);
        for (k, value) in values.iter().enumerate() {
            let text = at(&dump, "a/b", 3 + k as u64);
            assert_eq!(word(&text, bits), Some(*value), "{bits} bits: {text}");
        }
        // Only changes: -1 twice is one.
        let changes = &dump.variables["a/b"].changes;
        assert!(changes.windows(2).all(|w| w[0].1 != w[1].1));
        assert_eq!(dump.last_time, 3 + values.len() as u64);
    }
}

#[test]
fn reals_come_back_bit_for_bit() {
    let mut t = trace(0, vec![reals("x", 1, &REALS)]);
    t.sample_rate_hz = 1.0;
    let dump = read(&written(&t, "vcd"));
    assert_eq!(
        (dump.timescale.as_str(), dump.variables["x"].bits),
        ("1 s", 64)
    );
    for (k, value) in REALS.iter().enumerate() {
        let back: f64 = at(&dump, "x", k as u64).parse().unwrap();
        let same = back.to_bits() == value.to_bits();
        assert!(same || (back.is_nan() && value.is_nan()), "{back} {value}");
    }
}

#[test]
fn rates_may_be_mixed() {
    let mut t = trace(
        10,
        vec![
            integers("fast", 1, 8, &[5, 5, 5, 6, 6, 6]),
            integers("slow", 3, 8, &[-7, -8]),
            reals("real", 2, &[0.5, 0.5, 0.25]),
        ],
    );
    t.sample_rate_hz = 1000.0;
    let dump = read(&written(&t, "vcd"));
    let changes = |name: &str| dump.variables[name].changes.clone();
    let list = |of: &[(u64, &str)]| -> Vec<(u64, String)> {
        of.iter().map(|(t, v)| (*t, v.to_string())).collect()
    };
    assert_eq!(changes("fast"), list(&[(10, "101"), (13, "110")]));
    assert_eq!(
        changes("slow"),
        list(&[(10, "x"), (12, "11111001"), (15, "11111000")])
    );
    assert_eq!(
        changes("real"),
        list(&[(10, "NaN"), (11, "0.5"), (15, "0.25")])
    );
}

#[test]
fn names_become_scopes_and_identifiers() {
    let names = [
        "circuit.decimator.output drive_i",
        "circuit.decimator.output drive_q",
        "circuit.nco.phase",
        "gyro.rate in deg/s",
        "circuit.decimator.output drive.i",
        "",
        "9 lives",
        "$end",
    ];
    let signals: Vec<Signal> = names.iter().map(|n| integers(n, 1, 8, &[1])).collect();
    let mut signals = signals;
    signals[0].unit = "$end \u{b0}/s\n".to_owned();
    let t = trace(0, signals);
    let dump = read(&written(&t, "vcd"));
    let paths: Vec<&str> = dump.variables.keys().map(String::as_str).collect();
    let expected = [
        "_",
        "_9/lives",
        "_end",
        "circuit/decimator/output/drive_i",
        "circuit/decimator/output/drive_i_2",
        "circuit/decimator/output/drive_q",
        "circuit/nco/phase",
        "gyro/rate/in_deg_s",
    ];
    assert_eq!(paths, expected);
    let text = String::from_utf8(written(&t, "vcd")).unwrap();
    assert_eq!(text.matches("$scope module circuit ").count(), 1);
}

/// Codes stay unique where they need two and three characters.
#[test]
fn many_signals_have_codes_of_their_own() {
    let signals = (0..94 * 95 + 10).map(|k| integers(&format!("s{k}"), 1, 14, &[k]));
    let dump = read(&written(&trace(0, signals.collect()), "vcd"));
    assert_eq!(dump.variables.len(), 94 * 95 + 10);
    for (name, variable) in &dump.variables {
        let k: i64 = name[1..].parse().unwrap();
        assert_eq!(word(&variable.changes[0].1, 64), Some(k));
    }
}

fn instants(sample_rate_hz: f64, first_sample: u64, count: usize) -> (String, Vec<u64>) {
    let values: Vec<i64> = (0..count as i64).map(|k| k % 2).collect();
    let mut t = trace(first_sample, vec![integers("a", 1, 2, &values)]);
    t.sample_rate_hz = sample_rate_hz;
    let dump = read(&written(&t, "vcd"));
    let times = dump.variables["a"].changes.iter().map(|c| c.0).collect();
    (dump.timescale, times)
}

#[test]
fn instants_are_exact_where_a_unit_allows_it_and_nearest_elsewhere() {
    let exact = [
        (1.0, "1 s", 1),
        (50_000.0, "10 us", 2),
        (48_828.125, "10 ns", 2048),
        (1e9, "1 ns", 1),
        (8.0, "1 ms", 125),
    ];
    for (rate, unit, step) in exact {
        let (timescale, times) = instants(rate, 7, 4);
        assert_eq!(timescale, unit, "{rate}");
        assert_eq!(times, [7, 8, 9, 10].map(|n| n * step), "{rate}");
    }
    // 56 kHz: 17.857142... us; a millionth of it is 17.8 ps, so 10 ps.
    let (timescale, times) = instants(56_000.0, 0, 57);
    assert_eq!(timescale, "10 ps");
    assert_eq!(times[1..4], [1_785_714, 3_571_429, 5_357_143]);
    // No error adds up: 56 samples are 1 ms to the unit; far on, too.
    assert_eq!(times[56], 100_000_000);
    let (_, times) = instants(56_000.0, 56_000_000_000, 2);
    assert_eq!(times[0], 100_000_000_000_000_000);
    assert_eq!(times[1], 100_000_000_001_785_714);
    // A rate that no integer is: the period is 3 s nearly.
    let (timescale, times) = instants(1.0 / 3.0, 0, 3);
    assert_eq!((timescale.as_str(), times[2]), ("1 us", 6_000_000));
}

#[test]
fn the_same_trace_is_the_same_bytes_and_an_empty_one_is_a_dump() {
    let t: Trace = trace(9, vec![integers("a", 1, 8, &[]), reals("b", 32, &[])]);
    let dump = read(&written(&t, "vcd"));
    assert_eq!(dump.variables["a"].changes.len(), 1);
    assert_eq!(at(&dump, "a", 1 << 40), "x");
    assert!(matches!(t.signals[0].values, Values::Integer { .. }));
    read(&written(&trace(0, vec![]), "vcd"));
    let t = trace(0, vec![integers("a", 1, 8, &[1, 2])]);
    assert_eq!(written(&t, "vcd"), written(&t, "vcd"));
}

#[test]
fn a_time_beyond_64_bits_is_refused() {
    let t = trace(u64::MAX / 2, vec![integers("a", 1, 8, &[1])]);
    let folder = tempfile::tempdir().unwrap();
    let error = t.write(&folder.path().join("t.vcd")).unwrap_err();
    assert!(error.to_string().contains("10 ps"), "{error}");
}
