//! Captures as benches write them: oscilloscopes' preambles, volts, columns by name, raw samples, arrays of real numbers.

use super::capture::CaptureReader;
use super::capture_tests::{Capture, Q15, Rows, csv};
use std::io::Write;

const ROWS: [(i32, i32); 6] = [
    (1, -2),
    (-300, 400),
    (5, 32767),
    (7, 8),
    (0, -32768),
    (-9, 10),
];

fn rows() -> Rows {
    ROWS.to_vec()
}

/// A table of time, drive and sense in volts of 1 mV a code, with cells between `separator`.
fn table(separator: &str, unit: f64) -> String {
    let row = |(k, (d, s)): (usize, &(i32, i32))| {
        let [d, s] = [*d, *s].map(|c| f64::from(c) * 1e-3 / unit);
        format!("{:.6}{separator}{d:.6}{separator}{s:.6}\n", k as f64 * 4e-6)
    };
    ROWS.iter().enumerate().map(row).collect()
}

const CHANNELS: &str = "drive_column = \"CH1\"\nsense_column = \"CH2\"\nvolts_per_code = 1e-3\n";

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
fn a_side_car_is_found_whatever_the_case_of_its_extension() {
    let samples: Vec<u8> = ROWS
        .iter()
        .flat_map(|(d, s)| [*d as i16, *s as i16])
        .flat_map(i16::to_le_bytes)
        .collect();
    let keys = "item = \"int16\"\n";
    let capture = || Capture::new("CAP.BIN", &samples);
    for name in ["CAP.toml", "CAP.TOML", "CAP.Toml"] {
        let (rows, error) = capture().beside(name, keys).rows(Q15, 9);
        assert_eq!((rows, error), (ROWS.to_vec(), None), "{name}");
    }
    // Elsewhere the two may be one file.
    if !cfg!(target_os = "linux") {
        return;
    }
    let two = capture().beside("CAP.TOML", keys).beside("CAP.toml", keys);
    let told = two.rows(Q15, 9).1.unwrap().to_string();
    for part in [
        "CAP.BIN: error",
        "two side-cars: CAP.TOML and CAP.toml",
        "keep the one",
    ] {
        assert!(told.contains(part), "{part}: {told}");
    }
}

#[test]
fn what_is_no_code_is_shown_at_its_place() {
    for (text, line, column) in [
        ("drive,sense\n1,2\n3,4\n5,6.5\n7,8\n", 4, 3),
        (
            "# by hand\n\ndrive;t;sense\n0,5;0,1;2\n3;0,2;4\n5;0,3;6\n",
            4,
            1,
        ),
        ("drive (V),sense (V)\n1,2\n3,4\n5,6\n", 2, 1),
    ] {
        let error = csv(text).rows(Q15, 9).1.unwrap();
        assert_eq!(
            (error.line, error.column),
            (Some(line), Some(column)),
            "{error}"
        );
        let told = error.to_string();
        assert!(
            told.contains("the columns are no codes") && told.contains("volts_per_code = 0.0001"),
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

fn interleaved(item: fn(i32) -> Vec<u8>, channels: usize) -> Vec<u8> {
    let row = |(d, s): &(i32, i32)| {
        let other = (2..channels).map(|k| item(k as i32 * 11));
        [item(*d), item(*s)]
            .into_iter()
            .chain(other)
            .flatten()
            .collect::<Vec<u8>>()
    };
    ROWS.iter().flat_map(row).collect()
}

#[test]
fn raw_samples_are_what_their_side_car_says() {
    let low = |c: i32| (c as i16).to_le_bytes().to_vec();
    let high = |c: i32| (c as i16).to_be_bytes().to_vec();
    let wide = |c: i32| c.to_le_bytes().to_vec();
    let volts = |c: i32| (c as f32 * 1e-3).to_le_bytes().to_vec();
    for (name, bytes, keys) in [
        ("c.raw", interleaved(low, 2), "item = \"int16\"\n"),
        (
            "c.dat",
            interleaved(low, 2),
            "item = \"<i2\"\nchannels = 2\n",
        ),
        ("c.raw", interleaved(high, 2), "item = \"int16_be\"\n"),
        (
            "c.bin",
            interleaved(wide, 3),
            "item = \"int32\"\nchannels = 3\n",
        ),
        (
            "c.i16",
            [vec![1; 512], interleaved(low, 4)].concat(),
            "item = \"int16\"\nchannels = 4\nskip_bytes = 512\n",
        ),
        (
            "c.raw",
            interleaved(volts, 2),
            "item = \"float32\"\nvolts_per_code = 1e-3\n",
        ),
    ] {
        let file = Capture::new(name, &bytes).beside("c.toml", keys);
        for block in [1, 4, 100] {
            assert_eq!(file.rows(Q15, block), (rows(), None), "{name} {keys}");
        }
        assert_eq!(
            CaptureReader::open(&file.path, Q15).unwrap().rows_hint(),
            Some(6)
        );
    }
    let swapped = Capture::new("c.raw", interleaved(low, 2)).beside(
        "c.toml",
        "item = \"int16\"\ndrive_column = 1\nsense_column = 0\n",
    );
    assert_eq!(swapped.rows(Q15, 9).0[0], (-2, 1));
}

#[test]
fn raw_samples_may_stand_behind_a_header_in_text() {
    let low = |c: i32| (c as i16).to_le_bytes().to_vec();
    let header = |bytes: usize| "model = X, channels = 2\r\n".bytes().cycle().take(bytes);
    let samples: Vec<u8> = (0..40).flat_map(|_| interleaved(low, 2)).collect();
    for bytes in [100, 512, 4096] {
        let whole: Vec<u8> = header(bytes).chain(samples.iter().copied()).collect();
        let keys = format!("item = \"int16\"\nskip_bytes = {bytes}\n");
        let file = Capture::new("c.dat", &whole).beside("c.toml", &keys);
        let (read, error) = file.rows(Q15, 100);
        assert_eq!((read.len(), error), (240, None), "{bytes}");
        assert_eq!(read[..6], rows());
    }
    // A CSV file beside it, of the same stem, stays one.
    let text: String = (0..300).map(|k| format!("{k},{}\n", k % 7)).collect();
    let file = csv(format!("drive_code,sense_code\n{text}"))
        .beside("capture.toml", "item = \"int16\"\nskip_bytes = 512\n");
    assert_eq!(file.rows(Q15, 1000).0.len(), 300);
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
fn unsigned_codes_and_microvolts_are_told_as_a_user_thinks_of_them() {
    let item = npy(
        "<u2",
        "(6, 2)",
        false,
        &interleaved(|c| (c as u16).to_le_bytes().to_vec(), 2),
    );
    for keys in ["", "drive_column = 0\nsense_column = 1\n"] {
        let file = Capture::new("c.npy", &item).beside("c.toml", keys);
        let told = file.rows(Q15, 9).1.unwrap().to_string();
        assert!(
            told.contains("offset binary") && told.contains("32768"),
            "{told}"
        );
    }
    let text: String = (0..90)
        .map(|k| format!("{},{}\n", 100 * k, 200 * k))
        .collect();
    let file =
        csv(format!("drive_uV,sense_uV\n{text}")).beside("capture.toml", "volts_per_code = 1e-4\n");
    let notes = CaptureReader::open(&file.path, Q15)
        .unwrap()
        .notes()
        .join("; ");
    assert!(notes.contains("a code is 100 of"), "{notes}");
}

#[test]
fn raw_samples_without_what_they_need_are_refused() {
    let low = |c: i32| (c as i16).to_le_bytes().to_vec();
    let bytes = interleaved(low, 2);
    for (name, bytes, keys, message) in [
        ("c.raw", bytes.clone(), None, "nothing says what they are"),
        ("c.dat", bytes.clone(), None, "has binary bytes"),
        (
            "c.raw",
            bytes[..22].to_vec(),
            Some("item = \"int16\""),
            "no whole rows",
        ),
        (
            "c.raw",
            bytes.clone(),
            Some("item = \"int16\"\nskip_bytes = 99"),
            "no whole rows",
        ),
        (
            "c.raw",
            bytes.clone(),
            Some("item = \"int16\"\ndrive_column = 2"),
            "its 2 channels are 0 to 1",
        ),
        (
            "c.raw",
            bytes.clone(),
            Some("item = \"int16\"\ndrive_column = 1"),
            "both its channel 1",
        ),
        (
            "c.raw",
            bytes.clone(),
            Some("item = \"int16\"\ndrive_column = \"CH1\""),
            "have numbers",
        ),
        (
            "c.raw",
            bytes.clone(),
            Some("item = \"float32\""),
            "nothing says what a code is",
        ),
        (
            "c.raw",
            bytes.clone(),
            Some("item = \"int24\""),
            "`item` must be",
        ),
    ] {
        let file = Capture::new(name, &bytes);
        let file = match keys {
            Some(keys) => file.beside("c.toml", keys),
            None => file,
        };
        let told = file.rows(Q15, 9).1.unwrap().to_string();
        assert!(told.contains(message), "{name} {keys:?}: {told}");
    }
    // A code outside the ADC's range has its place.
    let wide = Capture::new("c.raw", interleaved(|c| (c * 2).to_le_bytes().to_vec(), 2))
        .beside("c.toml", "item = \"int32\"");
    let (rows, error) = wide.rows(Q15, 9);
    assert_eq!(rows.len(), 2);
    assert!(
        error
            .unwrap()
            .to_string()
            .contains("row 2, column 1 (from 0): sense_code 65534 is outside")
    );
}

fn npy(descr: &str, shape: &str, fortran: bool, data: &[u8]) -> Vec<u8> {
    let order = if fortran { "True" } else { "False" };
    let header = format!("{{'descr': '{descr}', 'fortran_order': {order}, 'shape': {shape}, }}\n");
    let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
    bytes.extend((header.len() as u16).to_le_bytes());
    bytes.extend(header.bytes());
    bytes.extend(data);
    bytes
}

#[test]
fn arrays_of_volts_and_of_more_columns_are_read_with_their_keys() {
    let volts = |c: i32| (f64::from(c) * 1e-3).to_le_bytes().to_vec();
    let low = |c: i32| (c as i16).to_le_bytes().to_vec();
    let by_column = |item: fn(i32) -> Vec<u8>| {
        let (drive, sense): (Vec<i32>, Vec<i32>) = ROWS.iter().copied().unzip();
        [vec![0; 6], sense, drive]
            .concat()
            .into_iter()
            .flat_map(item)
            .collect::<Vec<u8>>()
    };
    for (bytes, keys) in [
        (
            npy("<f8", "(6, 2)", false, &interleaved(volts, 2)),
            "volts_per_code = 1e-3\n",
        ),
        (
            npy("<i2", "(6, 4)", false, &interleaved(low, 4)),
            "drive_column = 0\nsense_column = 1\n",
        ),
        (
            npy("<i2", "(6, 3)", true, &by_column(low)),
            "drive_column = 2\nsense_column = 1\n",
        ),
        (
            npy("<f8", "(6, 3)", true, &by_column(volts)),
            "drive_column = 2\nsense_column = 1\nvolts_per_code = 1e-3\n",
        ),
    ] {
        let file = Capture::new("c.npy", &bytes).beside("c.toml", keys);
        for block in [1, 4, 100] {
            assert_eq!(file.rows(Q15, block), (rows(), None), "{keys}");
        }
        // Without its keys it stays refused, as the contract says.
        assert!(
            Capture::new("c.npy", &bytes).rows(Q15, 9).1.is_some(),
            "{keys}"
        );
        let cut = Capture::new("c.npy", &bytes[..bytes.len() - 1]).beside("c.toml", keys);
        assert!(
            cut.rows(Q15, 9)
                .1
                .unwrap()
                .to_string()
                .contains("bytes, and the file holds")
        );
    }
}

#[test]
fn a_packed_csv_is_read_as_it_is() {
    let text = format!("TIME,CH1,CH2\n{}", table(",", 1.0));
    let mut packed = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::default());
    packed.write_all(text.as_bytes()).unwrap();
    let packed = packed.finish().unwrap();
    let file = Capture::new("scope.csv.gz", &packed).beside("scope.toml", CHANNELS);
    assert_eq!(file.rows(Q15, 4), (rows(), None));
    let zst = ruzstd::encoding::compress_to_vec(
        &b"drive_code,sense_code\n1,2\n"[..],
        ruzstd::encoding::CompressionLevel::Fastest,
    );
    assert_eq!(
        Capture::new("c.zst", zst).rows(Q15, 4),
        (vec![(1, 2)], None)
    );
    let cut =
        Capture::new("scope.csv.gz", &packed[..packed.len() - 9]).beside("scope.toml", CHANNELS);
    assert!(cut.rows(Q15, 400).1.is_some());
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
