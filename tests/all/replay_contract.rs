//! `gyrogen replay` against the contract of the detection chain.
//!
//! Environment: `GYROGEN_RANDOM_DESIGNS` (number of random designs),
//! `GYROGEN_SEED` (the first seed; each case has the next one),
//! `GYROGEN_LONG=1` (the golden capture of 33554432 samples too),
//! `GYROGEN_BINARY` (another binary to test).

use std::io::Write;

use crate::oracle::capture::{self, CsvStyle, NpyStyle, npy_header};
use crate::oracle::cases::{Outcome, RandomCase, Tally};
use crate::oracle::design::{Design, Verdict};
use crate::oracle::generate::{self, Aim};
use crate::oracle::harness::{self, Case, Run, setting};
use crate::oracle::toml_text::Printer;
use crate::oracle::{fixed, golden};
use crate::rng::Rng;

/// Seed of the first random design.
const SEED: u64 = 20_240_501;

/// Failures that are told before a test gives up.
const MOST_FAILURES: usize = 5;

fn golden_text() -> String {
    Printer::plain().print(&golden::design())
}

/// The golden checksum of so many samples through the binary.
fn golden_through_binary(samples: usize, wanted: u64) {
    let case = Case::new(&golden_text(), "capture.npy", &[]);
    {
        let file = std::fs::File::create(case.capture()).expect("a writable folder");
        let mut file = std::io::BufWriter::new(file);
        let dictionary =
            format!("{{'descr': '<i2', 'fortran_order': False, 'shape': ({samples}, 2), }}");
        file.write_all(&npy_header(1, &dictionary)).expect("space");
        for (drive, sense) in golden::samples().take(samples) {
            file.write_all(&drive.to_le_bytes()).expect("space");
            file.write_all(&sense.to_le_bytes()).expect("space");
        }
        file.flush().expect("space");
    }
    let run = case.run("out.csv", None);
    run.expect_status(0).expect("a replay");
    let text = case.read("out.csv").expect("an output");
    let mut lines = text.lines();
    assert_eq!(
        lines.next(),
        Some("index,drive_i,drive_q,sense_i,sense_q,phase,magnitude,rate")
    );
    let words: Vec<[i64; 3]> = lines
        .enumerate()
        .map(|(index, line)| {
            let cells: Vec<i64> = line
                .split(',')
                .map(|cell| cell.parse().expect("an integer"))
                .collect();
            assert_eq!(cells.len(), 8, "{line}");
            assert_eq!(cells[0], index as i64);
            [cells[7], cells[5], cells[6]]
        })
        .collect();
    assert_eq!(words.len(), samples / 64);
    for (row, first) in words.iter().zip(golden::FIRST_ROWS) {
        assert_eq!(*row, [first.0, first.1, first.2]);
    }
    let found = golden::checksum(words.into_iter());
    assert_eq!(found, wanted, "{samples} samples: {found:016x}");
}

#[test]
fn golden_checksums_up_to_65536_samples() {
    for (samples, wanted) in &golden::CHECKSUMS[..3] {
        golden_through_binary(*samples, *wanted);
    }
}

/// 2^20 samples always, 2^25 with `GYROGEN_LONG=1`.
#[test]
fn golden_checksums_of_long_captures() {
    let (samples, wanted) = golden::CHECKSUMS[3];
    assert_eq!(samples, 1 << 20);
    golden_through_binary(samples, wanted);
    if std::env::var("GYROGEN_LONG").is_ok_and(|value| value == "1") {
        let (samples, wanted) = golden::CHECKSUMS[4];
        assert_eq!(samples, 1 << 25);
        golden_through_binary(samples, wanted);
    }
}

/// Fails with all that was found.
fn give_up(failures: &[String]) {
    assert!(failures.is_empty(), "\n{}", failures.join("\n\n"));
}

#[test]
fn random_designs_bit_for_bit() {
    let first = setting("GYROGEN_SEED", SEED);
    let count = setting("GYROGEN_RANDOM_DESIGNS", 150);
    let mut tally = Tally::default();
    let mut failures = Vec::new();
    for seed in first..first + count {
        let case = RandomCase::new(seed);
        match case.check_fixed() {
            Ok(Outcome::Agreed(rows)) => {
                tally.agreed += 1;
                tally.rows += rows;
            }
            Ok(Outcome::Refused) => tally.refused += 1,
            Ok(Outcome::Stopped) => tally.stopped += 1,
            Err(message) => failures.push(case.report(&message)),
        }
        if failures.len() >= MOST_FAILURES {
            break;
        }
    }
    println!("{tally:?}");
    give_up(&failures);
    if count >= 100 {
        assert!(tally.agreed > count as usize / 2, "{tally:?}");
        assert!(tally.refused > 0 && tally.stopped > 0, "{tally:?}");
    }
}

#[test]
fn random_designs_in_real_numbers() {
    let first = setting("GYROGEN_SEED", SEED);
    let count = setting("GYROGEN_RANDOM_DESIGNS", 150).div_ceil(2);
    let (mut compared, mut left_out) = (0, 0);
    let mut failures = Vec::new();
    for seed in first..first + count {
        let case = RandomCase::new(seed);
        match case.check_float() {
            Ok((checked, skipped)) => {
                compared += checked;
                left_out += skipped;
            }
            Err(message) => failures.push(case.report(&message)),
        }
        if failures.len() >= MOST_FAILURES {
            break;
        }
    }
    println!("{compared} cells compared, {left_out} not well conditioned");
    give_up(&failures);
    if count >= 50 {
        assert!(left_out * 2 < compared, "{left_out} left out of {compared}");
    }
}

/// An accepted random design with all stages, and a capture of a few rows on
/// which it does not stop.
fn quiet_case(seed: u64) -> (Design, Vec<(i64, i64)>, Vec<fixed::Row>) {
    let mut rng = Rng::new(seed);
    loop {
        let design = generate::design(&mut rng, Aim::Accepted);
        let all_stages = design.compensation.is_some()
            && design.phase_loop.is_some()
            && design.amplitude_loop.is_some();
        if !all_stages || design.ratio > 60 || design.verdict() != Verdict::Accepted {
            continue;
        }
        let codes = capture::random(&mut rng, &design);
        if let Ok(rows) = fixed::replay(&design, &codes)
            && rows.len() > 3
        {
            return (design, codes, rows);
        }
    }
}

#[test]
fn npy_output_holds_the_same_values() {
    for seed in 0..4 {
        let (mut design, codes, _) = quiet_case(seed);
        if seed == 0 {
            // a tuning word above 2^63 is given modulo 2^64
            design.nco.phase_bits = 64;
            design.nco.tuning_word = -12_345;
            design.phase_loop.as_mut().expect("a loop").proportional.raw = 0;
        }
        let rows = fixed::replay(&design, &codes).expect("no overflow");
        let capture = NpyStyle {
            wide: true,
            fortran: false,
            version: 1,
        };
        let text = Printer::plain().print(&design);
        let case = Case::new(&text, "capture.npy", &capture.print(&codes));

        case.run("out.npy", Some("fixed"))
            .expect_status(0)
            .expect("a replay");
        let bytes = std::fs::read(case.path("out.npy")).expect("an output");
        let npy = harness::read_npy(&bytes).expect("a readable array");
        assert_eq!(npy.descr, "<i8");
        assert_eq!(
            (npy.rows, npy.columns),
            (rows.len(), design.columns().len())
        );
        let wanted: Vec<u64> = rows
            .iter()
            .enumerate()
            .flat_map(|(index, row)| row.values(index))
            .map(|value| value as u64)
            .collect();
        assert_eq!(npy.words, wanted, "seed {seed}");

        for name in ["real.npy", "real.csv"] {
            case.run(name, Some("float"))
                .expect_status(0)
                .expect("a replay");
        }
        let bytes = std::fs::read(case.path("real.npy")).expect("an output");
        let npy = harness::read_npy(&bytes).expect("a readable array");
        assert_eq!(npy.descr, "<f8");
        let csv = case.read("real.csv").expect("an output");
        let cells = harness::read_real_csv(&csv, &design.columns()).expect("a readable CSV");
        // the text reads back as the same f64 (a zero may lose its sign)
        let same = npy
            .words
            .iter()
            .zip(cells.iter().flatten())
            .all(|(word, cell)| f64::from_bits(*word) == *cell);
        assert!(same && npy.words.len() == cells.iter().flatten().count());
    }
}

#[test]
fn fewer_samples_than_a_period_give_the_header_alone() {
    for samples in [0, 1, 63] {
        let codes = golden::capture(samples);
        let mut rng = Rng::new(1);
        let bytes = CsvStyle::default().print(&mut rng, &codes);
        let case = Case::new(&golden_text(), "capture.csv", &bytes);
        for arith in ["fixed", "float"] {
            case.run("out.csv", Some(arith))
                .expect_status(0)
                .expect("a replay");
            assert_eq!(
                case.read("out.csv").expect("an output"),
                "index,drive_i,drive_q,sense_i,sense_q,phase,magnitude,rate\n"
            );
            case.run("out.npy", Some(arith))
                .expect_status(0)
                .expect("a replay");
            let bytes = std::fs::read(case.path("out.npy")).expect("an output");
            let npy = harness::read_npy(&bytes).expect("a readable array");
            assert_eq!((npy.rows, npy.columns), (0, 8));
        }
    }
}

/// The golden design with a product that cannot be negative.
fn stopping_text() -> String {
    golden_text().replace(
        r#"{ format = "Q2.30", rounding = "half_up", overflow = "wrap" }"#,
        r#"{ format = "UQ1.15", overflow = "error" }"#,
    )
}

#[test]
fn overflow_stops_in_samples_after_the_last_period() {
    // A period of the NCO is 128 samples, sin is positive at 0 to 62 and
    // negative at 64 to 126. With rows and without any.
    for (samples, at, code) in [(70, 66, 20_000), (10, 6, -20_000)] {
        let mut codes = vec![(0, 0); samples];
        codes[at] = (0, code);
        let mut rng = Rng::new(1);
        let bytes = CsvStyle::default().print(&mut rng, &codes);
        let case = Case::new(&stopping_text(), "capture.csv", &bytes);
        let run = case.run("out.csv", None);
        run.expect_status(1).expect("a stop");
        case.expect_no_output().expect("no output");
        let node = "circuit.demodulator.product sense_i";
        assert!(run.stderr.contains(node), "{}", run.stderr);
        for number in [at as i128, i128::from(code)] {
            assert!(run.integers().contains(&number), "{}", run.stderr);
        }
        // real numbers do not overflow
        case.run("out.csv", Some("float"))
            .expect_status(0)
            .expect("a replay");
    }
}

#[test]
fn existing_files_are_replaced_whole_or_stay() {
    let mut rng = Rng::new(1);
    let good = CsvStyle::default().print(&mut rng, &golden::capture(64));
    let old = "index,drive_i,drive_q\n".to_owned()
        + &"of an earlier replay, longer than the new one\n".repeat(100);

    let case = Case::new(&golden_text(), "capture.csv", &good);
    std::fs::write(case.path("out.csv"), &old).expect("a writable folder");
    case.run("out.csv", None)
        .expect_status(0)
        .expect("a replay");
    let text = case.read("out.csv").expect("an output");
    assert!(text.starts_with("index,") && text.lines().count() == 2);
    assert_eq!(case.files(), ["capture.csv", "design.toml", "out.csv"]);

    // What no replay has written is the user's.
    let own = "time_s,die_degc,rate_out_dps\n0,25,0.5\n";
    std::fs::write(case.path("out.csv"), own).expect("a writable folder");
    let refused = case.run("out.csv", None);
    refused.expect_status(2).expect("a refusal");
    assert!(refused.stderr.contains("no result of an earlier"));
    assert_eq!(case.read("out.csv").expect("the user's file"), own);
    // So is an array of the same numbers with other columns.
    let dictionary = "{'descr': '<i8', 'fortran_order': False, 'shape': (2, 3), }";
    let own = [npy_header(1, dictionary), vec![7; 48]].concat();
    std::fs::write(case.path("out.npy"), &own).expect("a writable folder");
    let refused = case.run("out.npy", None);
    refused.expect_status(2).expect("a refusal");
    assert_eq!(std::fs::read(case.path("out.npy")).expect("theirs"), own);
    std::fs::remove_file(case.path("out.npy")).expect("a writable folder");
    for _ in 0..2 {
        let again = case.run("out.npy", None);
        again.expect_status(0).expect("a replay over a replay");
    }
    std::fs::remove_file(case.path("out.npy")).expect("a writable folder");

    let stopping = Case::new(&stopping_text(), "capture.csv", &good);
    let refused = Case::new(
        &golden_text(),
        "capture.csv",
        b"drive_code,sense_code\n1,x\n",
    );
    for (case, status) in [(stopping, 1), (refused, 2)] {
        std::fs::write(case.path("out.csv"), &old).expect("a writable folder");
        case.run("out.csv", None)
            .expect_status(status)
            .expect("a refusal");
        assert_eq!(case.read("out.csv").expect("the old file"), old);
        assert_eq!(case.files(), ["capture.csv", "design.toml", "out.csv"]);
    }
}

#[test]
fn missing_folders_and_files_are_refused() {
    let mut rng = Rng::new(1);
    let good = CsvStyle::default().print(&mut rng, &golden::capture(64));
    let case = Case::new(&golden_text(), "capture.csv", &good);
    case.run("no/such/out.csv", None)
        .expect_status(2)
        .expect("a refusal");
    case.expect_no_output().expect("no output");
    let absent = case.path("absent");
    let out = case.path("out.csv");
    let runs = [
        Run::replay(&absent, &case.capture(), &out, None),
        Run::replay(&case.design(), &absent, &out, None),
    ];
    for run in runs {
        run.expect_status(2).expect("a refusal");
        assert!(run.stderr.contains("absent"), "{}", run.stderr);
    }
    case.expect_no_output().expect("no output");
}

/// The comments of a capture warn where they differ from the design, and only
/// there; the rows do not change.
#[test]
fn capture_keys_that_differ_give_a_warning() {
    let agreeing = ["fs_hz = 224000.0", "ftw = 33554432", "adc_bits = 16"];
    let differing = ["fs_hz = 224001.0", "ftw = 33655432", "adc_bits = 14"];
    let mut design = golden::design();
    // the same frequency in a wider accumulator: ftw counts as a frequency
    design.nco.phase_bits = 48;
    design.nco.tuning_word <<= 16;
    let codes = golden::capture(640);
    let rows = fixed::replay(&design, &codes).expect("no overflow");
    let expected = harness::expected_csv(&design, &rows);
    let text = Printer::plain().print(&design);
    let mut rng = Rng::new(1);
    for at in 0..=agreeing.len() {
        let keys: Vec<&str> = (0..agreeing.len())
            .map(|key| {
                if key == at {
                    differing[key]
                } else {
                    agreeing[key]
                }
            })
            .collect();
        let comments: Vec<String> = keys.iter().map(|line| format!("# {line}")).collect();
        let style = CsvStyle {
            comments,
            ..CsvStyle::default()
        };
        let csv = Case::new(&text, "capture.csv", &style.print(&mut rng, &codes));
        let array = NpyStyle {
            wide: false,
            fortran: true,
            version: 2,
        };
        let npy = Case::new(&text, "capture.npy", &array.print(&codes));
        std::fs::write(npy.path("capture.toml"), keys.join("\n")).expect("a writable folder");
        for case in [csv, npy] {
            let run = case.run("out.csv", None);
            run.expect_status(0).expect("a replay");
            let found = case.read("out.csv").expect("an output");
            harness::compare_text(&expected, &found).expect("the same rows");
            for (key, line) in agreeing.iter().enumerate() {
                let name = line.split(' ').next().expect("a key");
                // a wrong sample rate makes the tuning word another frequency too
                let may = key == 1 && at == 0;
                let named = run.stderr.contains(name);
                assert!(may || named == (key == at), "{keys:?}: {}", run.stderr);
            }
        }
    }
}
