//! Captures as benches write them: oscilloscopes' preambles, volts, columns by name, raw samples, arrays of real numbers.

use super::capture::CaptureReader;
use super::capture_tests::{Capture, Q15, Rows, csv};
use std::io::Write;

pub(super) const ROWS: [(i32, i32); 6] = [
    (1, -2),
    (-300, 400),
    (5, 32767),
    (7, 8),
    (0, -32768),
    (-9, 10),
];

pub(super) fn rows() -> Rows {
    ROWS.to_vec()
}

/// A table of time, drive and sense in volts of 1 mV a code, with cells between `separator`.
pub(super) fn table(separator: &str, unit: f64) -> String {
    let row = |(k, (d, s)): (usize, &(i32, i32))| {
        let [d, s] = [*d, *s].map(|c| f64::from(c) * 1e-3 / unit);
        format!("{:.6}{separator}{d:.6}{separator}{s:.6}\n", k as f64 * 4e-6)
    };
    ROWS.iter().enumerate().map(row).collect()
}

pub(super) const CHANNELS: &str =
    "drive_column = \"CH1\"\nsense_column = \"CH2\"\nvolts_per_code = 1e-3\n";

#[test]
fn preambles_of_oscilloscopes_are_passed_over() {
    let comma = table(",", 1.0);
    let rigol: String = comma.lines().map(|l| l.to_owned() + ",\n").collect();
    for (text, keys) in [
        // Names of their own.
        (format!("TIME,CH1,CH2\n{comma}"), CHANNELS),
        (
            format!(
                "Model,MSO4054\r\nFirmware Version,2.48\r\n\r\nSample Interval,4e-06,s\r\n\r\nTIME,CH1,CH2\r\n{comma}"
            ),
            CHANNELS,
        ),
        (
            format!("X,CH1,CH2,Start,Increment,\nSequence,Volt,Volt,-6.0e-3,4.0e-06\n{rigol}"),
            CHANNELS,
        ),
        (
            format!(
                "Record Length,Analog:6\nVertical Units,CH1:V,CH2:V\nSecond,Value,Value\n{comma}"
            ),
            "drive_column = 1\nsense_column = 2\nvolts_per_code = 1e-3\n",
        ),
        (
            format!("x-axis,1,2\nsecond,Volt,Volt\n{comma}"),
            "drive_column = \"1\"\nsense_column = \"2\"\nvolts_per_code = 1e-3\n",
        ),
        (
            format!(
                "LECROYWS64Xs-B,12345,Waveform\nSegments,1,SegmentSize,6\nTime,Drive,Sense\n{comma}"
            ),
            "volts_per_code = 1e-3\n",
        ),
        (
            format!("Time,Channel A,Channel B\n(ms),(V),(V)\n\n{comma}"),
            "drive_column = \"Channel A\"\nsense_column = \"Channel B\"\nvolts_per_code = 1e-3\n",
        ),
        // Units in names, other separators, decimal commas.
        (
            format!(
                "t [s];drive [mV];sense [mV]\n{}",
                table(";", 1e-3).replace('.', ",")
            ),
            "volts_per_code = 1e-3\n",
        ),
        (
            format!("t\tdrive_v\tsense_v\n{}", table("\t", 1.0)),
            "volts_per_code = 0.001\nvolts_at_code_0 = 0\n",
        ),
        (
            format!("\"Time (s)\",\"drive (V)\",\"sense (V)\"\n{comma}"),
            "volts_per_code = 1e-3\n",
        ),
    ] {
        let file = csv(&text).beside("capture.toml", keys);
        assert_eq!(file.rows(Q15, 4), (rows(), None), "{text}");
        // The same keys as comment lines.
        let comments: String = keys.lines().map(|l| format!("# {l}\n")).collect();
        assert_eq!(
            csv(format!("{comments}{text}")).rows(Q15, 4),
            (rows(), None),
            "{text}"
        );
        let notes = CaptureReader::open(&file.path, Q15)
            .unwrap()
            .notes()
            .join("; ");
        assert!(
            notes.contains("a code is") && notes.contains("the drive is column 1"),
            "{notes}"
        );
    }
}

#[test]
fn the_sample_rate_comes_from_the_column_of_times() {
    let keys = |fs: &str| format!("{CHANNELS}{fs}");
    let fs = |names: &str, keys: String| {
        csv(format!("{names}\n{}", table(",", 1.0)))
            .beside("capture.toml", keys)
            .meta()
            .unwrap()
            .fs_hz
    };
    assert_eq!(fs("TIME,CH1,CH2", keys("")), Some(250_000.0));
    assert_eq!(fs("Time (ms),CH1,CH2", keys("")), Some(2.5e8));
    assert_eq!(fs("Time (ms),CH1,CH2", keys("fs_hz = 5\n")), Some(5.0));
    assert_eq!(fs("index,CH1,CH2", keys("")), None);
}

#[test]
fn integers_are_codes_whatever_their_columns_are_called() {
    let text: String = ROWS.iter().map(|(d, s)| format!("{d},{s}\n")).collect();
    for (names, keys) in [
        ("drv,sns", ""),
        ("a,b", "drive_column = \"a\"\nsense_column = 1\n"),
    ] {
        let file = csv(format!("{names}\n{text}")).beside("capture.toml", keys);
        assert_eq!(file.rows(Q15, 4), (rows(), None), "{names}");
    }
}

#[test]
fn what_is_not_said_is_asked_for_with_the_keys() {
    let scope = format!("TIME,CH1,CH2\n{}", table(",", 1.0));
    for (text, keys, message, help) in [
        (
            scope.as_str(),
            "",
            "no name in it says which is the drive's",
            "drive_column = \"CH1\"\n    sense_column = \"CH2\"",
        ),
        (
            &scope,
            "drive_column = \"CH3\"\n",
            "no column \"CH3\", which `drive_column` names",
            "TIME",
        ),
        (
            &scope,
            "drive_column = 3\n",
            "`drive_column` is 3, and the columns are 0 to 2",
            "TIME",
        ),
        (
            &scope,
            "drive_column = 1\nsense_column = 1\n",
            "the same column",
            "TIME",
        ),
        (
            &scope,
            "drive_column = 1\nsense_column = 2\n",
            "does not say what a code is",
            "volts_per_code = 0.0001",
        ),
        (
            &scope,
            "drive_column = 1\nsense_column = 2\nvolts_per_code = 1e-9\n",
            "outside the ADC's format",
            "word length",
        ),
        (
            "drive (V),sense (mV)\n1,2\n3,4\n5,6\n",
            "volts_per_code = 1\n",
            "different units",
            "volts",
        ),
        (
            "1,2\n3,4\n5,6\n",
            "drive_column = 0\nsense_column = 1\n",
            "no column",
            "drive_code",
        ),
        (
            "a,b\n1,2\n3,x\n5,6\n7,8\n9,9\n",
            "drive_column = 0\nsense_column = 1\n",
            "right before the first whole one",
            "repair",
        ),
        (
            "drive_code,CH2\n1,2\n3,4\n5,6\n",
            "sense_column = \"CH2\"\n",
            "no column `sense_code`",
            "drive_code",
        ),
    ] {
        let (_, error) = csv(text).beside("capture.toml", keys).rows(Q15, 9);
        let told = error.unwrap().to_string();
        assert!(
            told.contains(message) && told.contains(help),
            "{text}{keys}: {told}"
        );
    }
}

#[test]
fn what_is_no_code_is_shown_at_its_place() {
    for (text, line, column, what) in [
        (
            "drive,sense\n1,2\n3,4\n5,6.5\n7,8\n",
            4,
            3,
            "6.5 in column 1, \"sense\" is no integer",
        ),
        (
            "# by hand\n\ndrive;t;sense\n0,5;0,1;2\n3;0,2;4\n5;0,3;6\n",
            4,
            1,
            "0.5 in column 0, \"drive\" is no integer",
        ),
        (
            "drive (V),sense (V)\n1,2\n3,4\n5,6\n",
            2,
            1,
            "column 0, \"drive (V)\" is a voltage",
        ),
    ] {
        let error = csv(text).rows(Q15, 9).1.unwrap();
        assert_eq!(
            (error.line, error.column),
            (Some(line), Some(column)),
            "{error}"
        );
        let told = error.to_string();
        assert!(
            told.contains(what) && told.contains("volts_per_code = 0.0001"),
            "{told}"
        );
    }
    // Below the contract's names, which have no scale.
    let error = csv("drive_code,sense_code\n0.5,1\n")
        .rows(Q15, 9)
        .1
        .unwrap();
    let told = error.to_string();
    assert!(told.contains("call them `drive` and `sense`"), "{told}");
}

#[test]
fn values_between_the_codes_are_told() {
    let rows: String = (0..60)
        .map(|k| format!("{},{}\n", f64::from(k) * 0.37e-3, f64::from(k) * 0.73e-3))
        .collect();
    let notes = |scale: &str| {
        let file = csv(format!("drive,sense\n{rows}")).beside("capture.toml", scale);
        CaptureReader::open(&file.path, Q15)
            .unwrap()
            .notes()
            .join("; ")
    };
    assert!(notes("volts_per_code = 1e-3").contains("lie between the codes"));
    assert!(!notes("volts_per_code = 1e-5").contains("lie between the codes"));
}

#[test]
fn a_row_that_is_none_is_refused_with_its_place() {
    let keys = "volts_per_code = 1e-3\n";
    let good = "drive,sense\n0.001,0.002\n0.003,0.004\n0.005,0.006\n";
    for (row, line, column, message) in [
        ("0.001,", 5, 7, "the cell of sense_code is empty"),
        ("0.001,inf", 5, 7, "overloaded here"),
        ("x,0.001", 5, 1, "no finite number"),
        ("1,2,3", 5, 5, "3 cells, the table 2"),
        ("40,0.001", 5, 1, "40 (code 40000) is outside"),
    ] {
        let (rows, error) = csv(format!("{good}{row}\n0.1,0.1\n"))
            .beside("capture.toml", keys)
            .rows(Q15, 9);
        let error = error.unwrap();
        assert_eq!(
            (rows.len(), error.line, error.column),
            (3, Some(line), Some(column)),
            "{row}: {error}"
        );
        assert!(error.to_string().contains(message), "{error}");
    }
}

#[test]
fn a_damaged_first_row_is_no_preamble_and_no_header() {
    let rows: String = (2..40)
        .map(|k| format!("{k},{},{}\n", 10 * k, 7 * k))
        .collect();
    let names = "drive_column = \"CH1\"\nsense_column = \"CH2\"\n";
    let places = "drive_column = 1\nsense_column = 2\n";
    for (first, line) in [
        ("0,OVL,0", 2),
        ("0,,0", 2),
        ("0,-9000,", 2),
        (",5,5", 2),
        ("OVL,5,5", 2),
        ("0,-9000,--", 2),
        ("0,nan,5", 2),
        ("0,-9000", 2),
        ("0,-9000,5,5", 2),
        ("0,-9000,0\n1,OVL,1", 3),
        ("0,OVL,0\n1,5,1", 2),
        ("0,OVL,0\n1,OVL,1", 2),
    ] {
        for keys in [names, places] {
            let (_, error) = csv(format!("TIME,CH1,CH2\n{first}\n{rows}"))
                .beside("capture.toml", keys)
                .rows(Q15, 9);
            let error = error.unwrap_or_else(|| panic!("{first} is passed over"));
            let told = error.to_string();
            assert_eq!(error.line, Some(line), "{first}: {told}");
            assert!(!told.contains("_column ="), "{first}: {told}");
        }
    }
}

#[test]
fn marks_of_an_overload_are_no_names() {
    let rows: String = (2..40).map(|k| format!("{},{}\n", 10 * k, 7 * k)).collect();
    for (head, line) in [
        ("OVL,OVL", 1),
        ("OVL,OVL\n-inf,12", 1),
        ("drive,sense\nOVR,OVR", 2),
        ("\"Overload\",3", 1),
    ] {
        let (_, error) = csv(format!("{head}\n{rows}")).rows(Q15, 9);
        let error = error.unwrap_or_else(|| panic!("{head} is passed over"));
        assert_eq!(error.line, Some(line), "{head}: {error}");
        assert!(error.to_string().contains("overloaded"), "{head}: {error}");
    }
}

#[test]
fn no_sample_in_the_middle_is_said_to_be_left_out() {
    let marked = "drive_code,sense_code\n1,2\nOVL,3\n5,6\n".to_owned();
    let volts = format!("TIME,CH1,CH2\n{}0.5,OVL,1\n1.0,2,3\n", table(",", 1.0));
    let keys = "drive_column = 1\nsense_column = 2\nvolts_per_code = 1.0\n";
    for text in [marked, volts] {
        let (_, error) = csv(text).beside("capture.toml", keys).rows(Q15, 9999);
        let told = error.expect("an overload is no code").to_string();
        assert!(told.contains("overloaded here"), "{told}");
        assert!(
            told.contains("none in the middle can be left out"),
            "{told}"
        );
    }
    // Only a last row that was cut short can be taken away.
    for (end, cut) in [("", true), ("\n", false)] {
        let text = format!("drive_code,sense_code\n1,2\n3{end}");
        let (_, error) = csv(text).rows(Q15, 9999);
        let told = error.expect("a cell is missing").to_string();
        assert_eq!(told.contains("the file ends here"), cut, "{told}");
        assert_eq!(told.contains("take it away"), cut, "{told}");
    }
}

#[test]
fn what_is_no_capture_is_called_what_it_is() {
    let thermal = |names: &str| format!("{names}\n1,2,3\n2,3,5\n4,5,6\n5,6,7\n").into_bytes();
    let page = b"\xEF\xBB\xBF\n\n<!DOCTYPE html>\n<html><body>time_s,rate_out_dps</body></html>\n";
    let gzip = |bytes: &[u8]| {
        let mut out = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::default());
        out.write_all(bytes).unwrap();
        out.finish().unwrap()
    };
    let capture = gzip(b"drive_code,sense_code\n1,2\n3,4\n");
    let ulog = super::ulog_tests::sound().0;
    let flash = super::dataflash_tests::sound();
    for (name, bytes, message, help) in [
        (
            "a.csv",
            thermal("time_s,rate_out_dps,die_degc"),
            "a thermal record",
            "--record",
        ),
        (
            "a.csv",
            thermal("Time (ms),Rate (\u{b0}/s),Die (\u{b0}C)"),
            "a thermal record",
            "--record",
        ),
        (
            "a.csv",
            thermal("t;gyro [deg/s];temp_c"),
            "a thermal record",
            "--record",
        ),
        (
            "a.csv",
            thermal("time_ms,rate_out_rad_s,phase_rad"),
            "a thermal record",
            "--record",
        ),
        (
            "a.csv.gz",
            gzip(&thermal("time_s,rate_out_dps,die_degc")),
            "a thermal record",
            "--record",
        ),
        ("a.ulg", ulog, "a PX4 log", "--record"),
        ("a.bin", flash, "an ArduPilot log", "--record"),
        ("a.csv", page.to_vec(), "HTML", "downloaded"),
        ("a.npy", page.to_vec(), "HTML", "downloaded"),
        ("a.ulg", page.to_vec(), "HTML", "downloaded"),
        ("a.csv.gz", gzip(page), "HTML", "downloaded"),
        ("a.csv", b"{\"drive\": [1, 2]}".to_vec(), "JSON", ""),
        (
            "a.csv.gz",
            gzip(&capture),
            "holds another packed file",
            "once",
        ),
        (
            "a.csv.gz",
            capture[..capture.len() - 12].to_vec(),
            "cut short",
            "another copy",
        ),
    ] {
        let file = Capture::new(name, &bytes);
        let told = file.rows(Q15, 9).1.unwrap().to_string();
        assert!(
            told.contains(message) && told.contains(help),
            "{name}: {told}"
        );
        assert!(!told.contains("drive_column"), "{name}: {told}");
    }
    // A line of a preamble is no header.
    let text: String = (1..9).map(|k| format!("{k},{k}\n")).collect();
    let file = csv(format!("Temperature (C),25\ndrive,sense\n{text}"));
    assert_eq!(file.rows(Q15, 9).0.len(), 8);
    // A temperature beside the codes is none of the codes.
    let text: String = (1..9).map(|k| format!("{k},{k},{k}\n")).collect();
    let file = csv(format!("drive,sense,die_degc\n{text}"));
    assert_eq!(file.rows(Q15, 9).0.len(), 8);
}

#[test]
fn rows_with_too_few_cells_are_named_and_never_dropped() {
    let many: String = (0..9).map(|k| format!("{k},{k}\n")).collect();
    for (text, expected) in [
        (
            "drive,sense\n".to_owned(),
            "c.csv:1:1: error: the capture has a header and no rows",
        ),
        (
            "drive,sense\n5\n".to_owned(),
            "c.csv:2:1: error: this row has 1 cell, where 2 are wanted",
        ),
        (
            "drive,sense\n5,6\n7\n".to_owned(),
            "c.csv:3:1: error: this row has 1 cell, where 2 are wanted",
        ),
        (
            format!("drive,sense\n5\n{many}"),
            "c.csv:2:1: error: this row has 1 cell, where 2 are wanted",
        ),
        (
            format!("drive,sense\n5,6\n7\n{many}"),
            "c.csv:3:1: error: this row has 1 cell, where 2 are wanted",
        ),
    ] {
        let (rows, error) = Capture::new("c.csv", text.as_bytes()).rows(Q15, 4);
        let said = error.expect("an error").to_string();
        let (place, message) = expected.split_once(" error: ").unwrap();
        let line = place.strip_prefix("c.csv").unwrap();
        assert!(
            rows.is_empty() && said.contains(message) && said.contains(line),
            "{text:?}: {said}"
        );
    }
    // A preamble's count of samples is no row.
    let text = format!("Samples\n9\n\ndrive,sense\n{many}");
    assert_eq!(Capture::new("c.csv", text.as_bytes()).rows(Q15, 4).1, None);
}
