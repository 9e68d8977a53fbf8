//! A file of each kind that is read goes to compiled firmware without a design, and the choices are printed.

use crate::common::command::{gyrogen_in, told};
use crate::common::logs;
use std::fmt::Write as _;
use std::fs;
use std::io::Write as _;
use std::path::Path;

/// Rows of a warm-up and a way back: time, s, output, deg/s, temperature, degC.
fn rows() -> Vec<(f64, f64, f64)> {
    (0..240)
        .map(|k| {
            let degc = 20.0 + 0.25 * f64::from(if k < 120 { k } else { 240 - k });
            let wobble = 0.01 * (7.7 * f64::from(k * k)).sin();
            (
                2.0 * f64::from(k),
                0.5 - 0.02 * degc + 2e-4 * degc * degc + wobble,
                degc,
            )
        })
        .collect()
}

fn table(header: &str) -> String {
    let mut csv = format!("{header}\n");
    for (time_s, dps, degc) in rows() {
        writeln!(csv, "{time_s},{dps:.5},{degc:.3}").expect("a string");
    }
    csv
}

fn gzip(bytes: &[u8]) -> Vec<u8> {
    let mut out = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::default());
    out.write_all(bytes).expect("memory");
    out.finish().expect("memory")
}

fn zstd(bytes: &[u8]) -> Vec<u8> {
    ruzstd::encoding::compress_to_vec(bytes, ruzstd::encoding::CompressionLevel::Fastest)
}

/// Status, stdout and stderr.
fn gyrogen(folder: &Path, arguments: &[&str]) -> (Option<i32>, String, String) {
    let out = gyrogen_in(folder, arguments, &[]);
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    (out.status.code(), text(&out.stdout), told(&out))
}

#[test]
fn a_record_of_each_kind_becomes_compiled_firmware() {
    let top = tempfile::tempdir().expect("a folder");
    let csv = table("time_s,rate_out_dps,die_degc");
    let (ulg, bin) = (logs::ulog(&rows()), logs::dataflash(&rows()));
    let files: [(&str, Vec<u8>); 8] = [
        ("r.csv", csv.clone().into_bytes()),
        (
            "units.csv",
            table("time [s],rate_out [deg/s],die [degC]").into_bytes(),
        ),
        ("names.csv", table("time,gyro_z,temp").into_bytes()),
        ("r.csv.gz", gzip(csv.as_bytes())),
        ("r.csv.zst", zstd(csv.as_bytes())),
        ("r.ulg", ulg.clone()),
        ("r.bin", bin),
        ("r.ulg.gz", gzip(&ulg)),
    ];
    for (name, bytes) in &files {
        fs::write(top.path().join(name), bytes).expect("written");
        let (status, said, complaints) =
            gyrogen(top.path(), &["run", "--record", name, "--out", "out"]);
        if *name == "names.csv" {
            // Names that say nothing are asked for, with all keys at once.
            assert_eq!(status, Some(2), "{said}{complaints}");
            for key in [
                "[record.columns]",
                "time_s = { column = \"time\", unit = \"s\" } # a guess: or ms, ",
                "rate_out_dps = { column = \"gyro_z\", unit = \"deg/s\" } # a guess: or mdeg/s, ",
                "die_degc = { column = \"temp\", unit = \"degC\" } # a guess: or degF, K, ",
                "gyrogen run gyro.toml --record",
            ] {
                assert!(complaints.contains(key), "{key}: {complaints}");
            }
            continue;
        }
        assert_eq!(status, Some(0), "{name}: {said}{complaints}");
        assert!(said.contains("read: "), "{name}: {said}");
        for quantity in ["time_s", "rate_out_dps", "die_degc"] {
            assert!(said.contains(quantity), "{name}: {said}");
        }
        assert!(said.contains(", 0 mismatches"), "{name}: {said}");
        // The polynomial leaves noise alone.
        assert!(!complaints.contains("next: "), "{name}: {complaints}");
        for file in [
            "firmware/c/manifest.json",
            "firmware/rust/manifest.json",
            "summary.json",
        ] {
            assert!(
                top.path().join("out").join(file).is_file(),
                "{name}: {file}"
            );
        }
        fs::remove_dir_all(top.path().join("out")).expect("removed");
    }
}

/// A step that no polynomial follows is left in both; `close` refuses the shorter one.
#[test]
fn a_record_of_few_rows_is_not_sent_to_close() {
    let top = tempfile::tempdir().expect("a folder");
    for (rows, is_sent) in [(16, false), (24, true)] {
        let mut csv = "time_s,rate_out_dps,die_degc\n".to_owned();
        for k in 0..rows {
            let (after, degc) = match 2 * k < rows {
                true => (0.0, 20 + 2 * k),
                false => (0.2, 20 + 2 * (rows - k)),
            };
            let rate = 0.5 + after + 0.001 * f64::from(k % 2);
            writeln!(csv, "{},{rate:.3},{degc}", 10 * k).expect("a string");
        }
        fs::write(top.path().join("r.csv"), csv).expect("a record");
        let arguments = ["run", "--record", "r.csv", "--out", "out", "--force"];
        let (status, said, complaints) = gyrogen(top.path(), &arguments);
        assert_eq!(status, Some(0), "{said}{complaints}");
        assert_eq!((said + &complaints).contains("next: "), is_sent);
    }
}

#[test]
fn a_loop_of_heating_and_cooling_is_said_once() {
    let top = tempfile::tempdir().expect("a folder");
    let mut csv = "time_s,rate_out_dps,die_degc\n".to_owned();
    for k in 0..960 {
        let up = k % 480 < 240;
        let degc = 20.0 + 0.125 * f64::from(if up { k % 480 } else { 480 - k % 480 });
        let lag = if up { 0.2 } else { -0.2 } * (std::f64::consts::PI * (degc - 20.0) / 30.0).sin();
        let noise = 0.01 * (7.7 * f64::from(k * k)).sin();
        writeln!(
            csv,
            "{},{:.5},{degc:.3}",
            2 * k,
            0.5 - 0.2 * degc + lag + noise
        )
        .expect("a string");
    }
    fs::write(top.path().join("r.csv"), csv).expect("a record");
    let (status, said, complaints) =
        gyrogen(top.path(), &["run", "--record", "r.csv", "--out", "out"]);
    assert_eq!(status, Some(0), "{said}{complaints}");
    let all = said + &complaints;
    assert_eq!(all.matches("eating and cooling differ").count(), 1, "{all}");
    assert!(!all.contains("rising and falling sweeps"), "{all}");
    assert!(
        all.contains("next: `gyrogen close --record r.csv`"),
        "{all}"
    );
    assert!(
        all.contains("(proved, unless a word saturates). The fit's own error"),
        "{all}"
    );
}

#[test]
fn a_design_without_circuit_in_its_firmware_says_so_and_what_was_not_run() {
    let top = tempfile::tempdir().expect("a folder");
    fs::write(
        top.path().join("r.csv"),
        table("time_s,rate_out_dps,die_degc"),
    )
    .expect("a record");
    let (status, _, complaints) =
        gyrogen(top.path(), &["run", "--record", "r.csv", "--out", "out"]);
    assert_eq!(status, Some(0), "{complaints}");
    let alone = "The firmware of this design is the compensation alone: its input, die_degc, is no word of the circuit.";
    for command in ["check", "equiv"] {
        let (status, said, complaints) = gyrogen(
            top.path(),
            &[
                command,
                "out/design.toml",
                "--samples",
                "20000",
                "--out",
                command,
            ],
        );
        assert_eq!(status, Some(0), "{said}{complaints}");
        assert!(said.starts_with(alone), "{said}");
        if command == "check" {
            let verdict = "\nholds for the words that were run; 1 word not run could overflow\n";
            assert!(said.contains(verdict), "{said}");
        }
    }
}

fn codes() -> Vec<(i32, i32)> {
    (0..4096)
        .map(|k| {
            let turns = std::f64::consts::TAU * f64::from(k) / 128.0;
            let drive = -9000.0 * turns.cos();
            let sense = 4000.0 * turns.sin() + 40.0 * (0.7 * f64::from(k)).sin();
            (drive.round() as i32, sense.round() as i32)
        })
        .collect()
}

#[test]
fn a_capture_of_each_form_runs_through_the_compiled_firmware() {
    let top = tempfile::tempdir().expect("a folder");
    let lines = |separator: &str, of: &dyn Fn(usize, i32, i32) -> [String; 3]| -> String {
        let rows = codes().into_iter().enumerate();
        rows.map(|(k, (d, s))| of(k, d, s).join(separator) + "\n")
            .collect()
    };
    let volts = lines(",", &|k, d, s| {
        [
            format!("{:.9}", k as f64 / 224_000.0),
            format!("{:.5}", f64::from(d) * 1e-4),
            format!("{:.5}", f64::from(s) * 1e-4),
        ]
    });
    let plain = lines(",", &|k, d, s| {
        [k.to_string(), d.to_string(), s.to_string()]
    });
    let raw: Vec<u8> = codes()
        .into_iter()
        .flat_map(|(d, s)| [d as i16, s as i16])
        .flat_map(i16::to_le_bytes)
        .collect();
    let mut npy = b"\x93NUMPY\x01\x00".to_vec();
    let header = "{'descr': '<i2', 'fortran_order': False, 'shape': (4096, 2), }\n";
    npy.extend((header.len() as u16).to_le_bytes());
    npy.extend(header.bytes());
    npy.extend(&raw);
    let contract = format!("t,drive_code,sense_code\n{plain}");
    let scope = format!("Model,X\nSample Interval,4.46e-6,s\n\nTIME,CH1,CH2\n{volts}");
    let files: [(&str, Vec<u8>, &str); 6] = [
        ("c.csv", contract.clone().into_bytes(), ""),
        ("c.csv.gz", gzip(contract.as_bytes()), ""),
        ("c.npy", npy, ""),
        (
            "names.csv",
            format!("k,drive,sense\n{plain}").into_bytes(),
            "read: the drive is column 1, \"drive\"",
        ),
        ("scope.csv", scope.into_bytes(), "read: a code is 1e-4"),
        (
            "samples.raw",
            raw,
            "read: 4096 rows of 2 interleaved channels",
        ),
    ];
    let write =
        |name: &str, bytes: &[u8]| fs::write(top.path().join(name), bytes).expect("written");
    write("samples.toml", b"item = \"int16\"\n");
    write(
        "scope.toml",
        b"drive_column = \"CH1\"\nsense_column = \"CH2\"\nvolts_per_code = 1e-4\n",
    );
    let mut first: Option<Vec<u8>> = None;
    for (name, bytes, choice) in &files {
        write(name, bytes);
        let (status, said, complaints) = gyrogen(
            top.path(),
            &["replay", "--capture", name, "--out", "rows.csv"],
        );
        assert_eq!(status, Some(0), "{name}: {said}{complaints}");
        assert!(complaints.contains(choice), "{name}: {complaints}");
        let rows = fs::read(top.path().join("rows.csv")).expect("rows");
        assert_eq!(first.get_or_insert(rows.clone()), &rows, "{name}");
    }
    // Compiled C and Rust beside the model, on what an oscilloscope wrote.
    let (status, said, complaints) = gyrogen(
        top.path(),
        &["equiv", "--capture", "scope.csv", "--out", "out"],
    );
    assert_eq!(status, Some(0), "{said}{complaints}");
    let (status, said, complaints) = gyrogen(
        top.path(),
        &["close", "--capture", "scope.csv", "--out", "closed"],
    );
    assert_eq!(status, Some(0), "{said}{complaints}");
    assert!(complaints.contains("[capture_form]"), "{complaints}");
}

#[test]
fn a_capture_too_short_for_a_row_says_what_it_has_and_what_a_row_needs() {
    let top = tempfile::tempdir().expect("a folder");
    for (count, has) in [(0, "has 0 samples"), (31, "has 31 samples")] {
        let codes: String = (0..count).map(|k| format!("{k},{}\n", 3 * k)).collect();
        let text = format!("drive_code,sense_code\n{codes}");
        fs::write(top.path().join("short.csv"), text).expect("written");
        let all = [
            "replay",
            "--capture",
            "short.csv",
            "--out",
            "rows.csv",
            "--quiet",
        ];
        let (status, said, complaints) = gyrogen(top.path(), &all[..5]);
        assert_eq!(status, Some(0), "{said}{complaints}");
        assert!(
            complaints.contains(has) && complaints.contains("one row needs 32"),
            "{complaints}"
        );
        let rows = fs::read_to_string(top.path().join("rows.csv")).expect("rows");
        assert_eq!(rows.lines().count(), 1, "{rows}");
        let (status, _, complaints) = gyrogen(top.path(), &all);
        assert_eq!((status, &complaints[..]), (Some(0), ""));
    }
}

#[test]
fn a_simulated_run_says_why_its_own_record_gets_another_order() {
    let top = tempfile::tempdir().expect("a folder");
    let of = |arguments: &[&str]| {
        let (status, said, complaints) = gyrogen(top.path(), arguments);
        assert_eq!(status, Some(0), "{said}{complaints}");
        // The bound of the rate is made of that of the bias: in this order.
        let at = |words: &str| said.find(words).expect(words);
        assert!(
            at("the firmware's bias is at most ") < at("The rate adds two roundings, "),
            "{said}"
        );
        let lines = said
            .lines()
            .filter(|l| l.starts_with("fit in ") || l.starts_with("held-out rms "));
        lines.collect::<Vec<_>>().join("\n")
    };
    let own = of(&["run", "--out", "own"]);
    let again = of(&["run", "--record", "own/record.csv", "--out", "again"]);
    assert!(
        own.contains(
            ": order 2 is prescribed for the simulated run (Chen et al. 2004): held-out rms "
        ) && own.contains("By held-out error it would be order 3, held-out rms ")
            && own.contains(" Order 3 is the smallest order that exceeds it by at most one standard error (up to "),
        "{own}"
    );
    assert!(
        own.contains("`run --record` of this run's record chooses by held-out error"),
        "{own}"
    );
    assert!(
        again.contains(": order 3, held-out rms ")
            // The reader of a measured record has no simulated one.
            && !again.contains("simulated"),
        "{again}"
    );
    let floor = |lines: &str| {
        let floor =
            lines.rsplit_once("The noise floor, from differences of neighbouring residuals, is ");
        floor.expect("a noise floor").1.to_owned()
    };
    assert_eq!(floor(&own), floor(&again));
    assert!(
        own.contains("of 10 blocks in time was predicted from the others"),
        "{own}"
    );
}

/// A design is given to `close` as to every other command, or as an option; a file alone is asked about.
#[test]
fn a_design_stands_before_the_options_or_is_one() {
    let top = tempfile::tempdir().expect("a folder");
    let here = top.path();
    fs::write(here.join("r.csv"), table("time_s,gyro,temperature")).expect("written");
    let design = "[record.columns]\nrate_out_dps = \"gyro\"\ndie_degc = \"temperature\"\n";
    fs::write(here.join("d.toml"), design).expect("written");
    let closed = |arguments: &[&str], out: &str| {
        let all = [&["close", "--record", "r.csv", "--out", out], arguments].concat();
        let (status, _, said) = gyrogen(here, &all);
        assert_eq!(status, Some(0), "{said}");
        fs::read(here.join(out).join("residuals.csv")).expect("residuals")
    };
    assert_eq!(
        closed(&["d.toml"], "a"),
        closed(&["--design", "d.toml"], "b")
    );
    let (status, _, said) = gyrogen(here, &["check", "--design", "d.toml"]);
    assert_eq!(status, Some(0), "{said}");
    for (arguments, due) in [
        (&["close", "r.csv"][..], "--record r.csv"),
        (&["close", "d.toml"], "gyrogen close d.toml --record FILE"),
        (
            &["close", "d.toml", "--design", "d.toml", "--record", "r.csv"],
            "cannot be used with",
        ),
        (
            &["close", "r.csv", "--record", "r.csv"],
            "this is no design",
        ),
        (
            &["run", "r.csv", "d.toml"],
            "a record is given with --record FILE",
        ),
        (
            &["simulate", "--duration", "1h"],
            "give one without its unit",
        ),
    ] {
        let (status, _, said) = gyrogen(here, arguments);
        assert!(status == Some(2) && said.contains(due), "{said}");
        assert!(!here.join("gyrogen-close").exists());
    }
}

/// What is nearly right is refused with what is right; where nothing else can be meant, it is taken.
#[test]
fn arguments_that_are_nearly_right_are_shown_right() {
    let top = tempfile::tempdir().expect("a folder");
    let approx = ["approx", "--function", "x", "--degree", "1"];
    let formats = ["--output", "Q1.15", "--coefficients", "Q1.15"];
    fs::write(top.path().join("r.csv"), "time_s,a\n0,1\n1,2\n").expect("written");
    let rows = (0..12).map(|k| format!("{k},{:.3},{}\n", 0.1 * f64::from(k % 7), 20 + k));
    let short = format!("time_s,rate_out_dps,die_degc\n{}", rows.collect::<String>());
    fs::write(top.path().join("short.csv"), short).expect("written");
    fs::write(top.path().join("result.json"), "{\"schema\": \"s\"}\n").expect("written");
    let of = |more: &[&'static str]| [&approx[..], &formats[..], more].concat();
    for (arguments, part) in [
        (vec!["help", "clsoe"], "'close'"),
        (vec!["clsoe"], "'close'"),
        (
            vec!["check", "--samples", "200k"],
            "write the number in digits alone: 200000",
        ),
        (
            vec!["check", "--samples", "10"],
            "give a whole number from 1000 to 100000000",
        ),
        (
            vec!["close", "--record", "r.csv", "--clean", "3"],
            "add `--self-test`, or leave that option out",
        ),
        (
            vec!["close", "--record", "r.csv", "--capture", "c.csv"],
            "one command for each",
        ),
        (
            vec!["check", "--samples", "-5"],
            "give a whole number from 1000 to 100000000",
        ),
        (
            vec!["close", "--self-test", "--records", "-1.5"],
            "invalid value '-1.5' for '--records <N>'",
        ),
        (
            vec!["fit", "--record", "r.csv"],
            "`run --record FILE` fits the bias",
        ),
        (vec!["help", "fit"], "`run --record FILE` fits the bias"),
        (
            vec!["run", "--record", "r.csv", "--lang", "both"],
            "leave `--lang` out for both",
        ),
        (
            vec!["emit", "--lang", "c,rust"],
            "once with `--lang c` and once with `--lang rust`",
        ),
        (vec!["check", "-q", "-v"], "leave one of the two out"),
        (vec!["emit"], "tip: for example `--lang c`"),
        (vec!["schema"], "tip: give one of design, "),
        (
            vec!["approx"],
            "tip: for example `--function 'sin(x)' --domain=0,1 --input Q1.15 --output Q1.15`",
        ),
        (
            vec!["run", "--recrod", "r.csv"],
            "Usage: gyrogen run [OPTIONS] [DESIGN]\n",
        ),
        (
            vec!["close", "--record", "r.csv", "--lang", "c"],
            "always write both C and Rust",
        ),
        (
            vec!["close"],
            "gyrogen close [OPTIONS] [DESIGN] --capture FILE",
        ),
        (
            vec!["replay", "r.csv"],
            "the one file without an option is the design (TOML)",
        ),
        (
            vec!["replay"],
            "gyrogen replay [OPTIONS] [DESIGN] --capture FILE --out FILE",
        ),
        (
            vec!["verify", "fw", "--digest", "123"],
            "64 hexadecimal digits, and 3 characters were given",
        ),
        (vec!["close", "--record", "r.CSV"], "did you mean r.csv?"),
        (
            vec!["close", "--record", "short.csv"],
            "12 usable rows are too few\n  help: record 20 rows or more, or average less",
        ),
        // What is wrong with the record comes before what is wrong with the folder.
        (
            vec!["close", "--record", "r.csv", "--out", "r.csv/sub"],
            "no column rate_out_dps",
        ),
        (vec!["check", "result.json"], "it looks like JSON"),
        (
            of(&["--domain=0,1", "--input", "Q15"]),
            "did you mean `Q1.15`",
        ),
        (
            of(&["--domain=0,5,0,7", "--input", "Q1.15"]),
            "the decimal mark is a point: `--domain=0.5,0.7`",
        ),
        (
            of(&["--domain=0,1", "--input", "Q1.15", "--bound", "0,01"]),
            "give 0.01",
        ),
    ] {
        let (status, said, complaints) = gyrogen(top.path(), &arguments);
        assert_eq!(status, Some(2), "{arguments:?}: {said}{complaints}");
        assert!(complaints.contains(part), "{part}: {complaints}");
        // JSON is no record, so that no command fits it.
        assert!(!complaints.contains("--record result.json"), "{complaints}");
    }
    for arguments in [
        &["init", "--out", "my.toml"][..],
        &["emit", "--lang", "C", "--part", "Tables", "--out", "fw"],
    ] {
        let (status, said, complaints) = gyrogen(top.path(), arguments);
        assert_eq!(status, Some(0), "{arguments:?}: {said}{complaints}");
    }
    assert!(top.path().join("my.toml").is_file());
}
