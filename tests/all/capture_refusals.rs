//! Captures that `gyrogen replay` must refuse, and near ones that it must read.

use crate::oracle::capture::npy_header;
use crate::oracle::golden;
use crate::oracle::harness::{Case, Run};
use crate::oracle::number::Format;
use crate::oracle::toml_text::Printer;

/// The golden design, with another ADC format where one is given.
fn design(adc: Option<Format>) -> String {
    let mut design = golden::design();
    if let Some(adc) = adc {
        design.adc = adc;
    }
    Printer::plain().print(&design)
}

/// What the message of a refusal has to say of the place.
#[derive(Clone, Copy)]
struct Place {
    line: usize,
    /// The column by name, and by its 1-based number in the row.
    column: Option<(&'static str, usize)>,
}

/// Refused: status 2, the file named, no output and no panic, in both arithmetics.
fn refuse(what: &str, name: &'static str, bytes: &[u8], adc: Option<Format>) -> Run {
    let case = Case::new(&design(adc), name, bytes);
    let arithmetics = [Some("float"), None];
    let mut runs = arithmetics.map(|arith| {
        let run = case.run("out.csv", arith);
        if let Err(message) = run.expect_status(2) {
            let folder = case.path("");
            panic!("{what} in {}: {message}", folder.display());
        }
        case.expect_no_output()
            .unwrap_or_else(|message| panic!("{what}: {message}"));
        assert!(
            run.stderr.contains(name),
            "{what}: the file is not named: {}",
            run.stderr
        );
        Some(run)
    });
    runs[1].take().expect("two runs")
}

/// A refused CSV, with the place that the message has to name.
fn refuse_csv(what: &str, text: impl AsRef<[u8]>, place: Option<Place>) {
    let run = refuse(what, "capture.csv", text.as_ref(), None);
    check_place(what, &run, place);
}

fn check_place(what: &str, run: &Run, place: Option<Place>) {
    let Some(place) = place else { return };
    let numbers = run.integers();
    let stderr = &run.stderr;
    assert!(
        numbers.contains(&(place.line as i128)),
        "{what}: line {} is not named: {stderr}",
        place.line
    );
    if let Some((name, at)) = place.column {
        let named = stderr.contains(name) || stderr.contains(&format!("column {at}"));
        assert!(named, "{what}: column {name} ({at}) is not named: {stderr}");
    }
}

/// A line and a column of it.
fn at(line: usize, column: (&'static str, usize)) -> Option<Place> {
    Some(Place {
        line,
        column: Some(column),
    })
}

/// A line alone.
fn at_line(line: usize) -> Option<Place> {
    Some(Place { line, column: None })
}

const DRIVE: (&str, usize) = ("drive_code", 1);
const SENSE: (&str, usize) = ("sense_code", 2);

#[test]
fn cells_that_are_no_integers() {
    let bad = [
        "",
        " ",
        "nan",
        "NaN",
        "inf",
        "1.0",
        "1e3",
        "+5",
        "--5",
        "-",
        "5-",
        "0x10",
        "1_000",
        "\"5\"",
        "five",
        "5 6",
        "- 5",
        "1;2",
        "\u{661}",
        "\u{2212}5",
        "1\u{0}",
    ];
    for cell in bad {
        let text = format!("drive_code,sense_code\n1,2\n{cell},4\n5,6\n");
        refuse_csv(&format!("drive cell {cell:?}"), text, at(3, DRIVE));
        let text = format!("drive_code,sense_code\r\n1,2\r\n3,4\r\n5,{cell}\r\n");
        refuse_csv(&format!("sense cell {cell:?}"), text, at(4, SENSE));
    }
}

#[test]
fn lines_count_from_the_top_of_the_file() {
    let text = "\u{feff}# fs_hz = 224000.0\n# a remark\nsense_code,drive_code\n1,2\nx,3\n";
    refuse_csv("a bad cell below comments", text, at(5, ("sense_code", 1)));
    let text = "time_s,drive_code,note,sense_code\n0,1,a,2\n1,3,b,nan\n";
    refuse_csv("a bad cell beside others", text, at(3, ("sense_code", 4)));
}

#[test]
fn codes_out_of_range() {
    let least_and_greatest = "drive_code,sense_code\n-32768,32767\n";
    read("capture.csv", least_and_greatest.as_bytes());
    for code in [
        "32768",
        "-32769",
        "2147483648",
        "9223372036854775808",
        "-9223372036854775809",
        "340282366920938463463374607431768211456",
        "99999999999999999999999999999999999999999999999999",
    ] {
        let text = format!("drive_code,sense_code\n1,2\n{code},4\n");
        refuse_csv(&format!("drive code {code}"), text, at(3, DRIVE));
        let text = format!("drive_code,sense_code\n1,{code}\n");
        refuse_csv(&format!("sense code {code}"), text, at(2, SENSE));
    }
    // by the format of the design, in both kinds of file
    let narrow = Some(Format::q(1, 11));
    let text = b"drive_code,sense_code\n2047,-2048\n0,2048\n";
    let run = refuse("12 bits, CSV", "capture.csv", text, narrow);
    check_place("12 bits, CSV", &run, at(3, SENSE));
    let codes = [2047i16, -2048, 0, -2049];
    let bytes = npy(1, "<i2", "(2, 2)", &le(&codes));
    refuse("12 bits, NPY", "capture.npy", &bytes, narrow);
    let codes = [0i32, 32768];
    let data: Vec<u8> = codes.iter().flat_map(|code| code.to_le_bytes()).collect();
    let bytes = npy(1, "<i4", "(1, 2)", &data);
    refuse("17 bits in 16, NPY", "capture.npy", &bytes, None);
}

#[test]
fn rows_of_another_shape() {
    let cases = [
        ("one cell", "drive_code,sense_code\n1,2\n3\n", 3),
        ("three cells", "drive_code,sense_code\n1,2,3\n4,5\n", 2),
        ("a comma at the end", "drive_code,sense_code\n1,2,\n", 2),
        (
            "other column lacking",
            "drive_code,sense_code,x\n1,2,3\n1,2\n",
            3,
        ),
        (
            "an empty line inside",
            "drive_code,sense_code\n1,2\n\n3,4\n",
            3,
        ),
        (
            "CRLF empty inside",
            "drive_code,sense_code\r\n1,2\r\n\r\n3,4\r\n",
            3,
        ),
        (
            "empty line below the header",
            "drive_code,sense_code\n\n1,2\n",
            2,
        ),
        (
            "many empty inside",
            "drive_code,sense_code\n1,2\n\n\n\n3,4\n",
            3,
        ),
        (
            "a comment below the header",
            "drive_code,sense_code\n1,2\n# x\n3,4\n",
            3,
        ),
        (
            "the header again",
            "drive_code,sense_code\n1,2\ndrive_code,sense_code\n",
            3,
        ),
    ];
    for (what, text, line) in cases {
        refuse_csv(what, text, at_line(line));
    }
}

#[test]
fn files_without_their_columns() {
    let cases: [(&str, &[u8]); 9] = [
        ("an empty file", b""),
        ("a BOM alone", b"\xef\xbb\xbf"),
        ("comments alone", b"# fs_hz = 224000.0\n"),
        ("empty lines alone", b"\n\n\n"),
        ("no header", b"1,2\n3,4\n"),
        ("no sense_code", b"drive_code,other\n1,2\n"),
        ("no drive_code", b"sense_code\n1\n"),
        (
            "bytes that are not UTF-8",
            b"drive_code,sense_code\n1,\xff\xfe\n",
        ),
        ("an NPY named CSV", b"\x93NUMPY\x01\x00v\x00{'descr': '<i2'"),
    ];
    for (what, text) in cases {
        refuse_csv(what, text, None);
    }
    let doubled = "drive_code,sense_code,drive_code\n1,2,3\n";
    refuse_csv("a column twice", doubled, None);
}

/// The near shapes that are accepted.
#[test]
fn shapes_that_are_read() {
    let good: [&[u8]; 11] = [
        b"drive_code,sense_code\n1,2\n3,4\n",
        b"drive_code,sense_code\n1,2\n3,4",
        b"drive_code,sense_code\r\n1,2\r\n3,4\r\n",
        b"\xef\xbb\xbfdrive_code,sense_code\n1,2\n3,4\n",
        b"drive_code,sense_code\n1,2\n3,4\n\n\n\n",
        b"drive_code,sense_code\r\n1,2\r\n3,4\r\n\r\n",
        b"drive_code,sense_code\n 1 ,  2\n3  , -4 \n",
        b"sense_code,drive_code\n1,2\n",
        b"time_s,drive_code,note,sense_code\n0.5,1,nan,2\n1.5,3,,4\n",
        b"# fs_hz = 224000.0\n# adc_bits = 16\ndrive_code,sense_code\n-0,007\n",
        b"drive_code,sense_code\n",
    ];
    for bytes in good {
        read("capture.csv", bytes);
    }
    let four = le(&[1, 2, 3, 4]);
    for version in 1..=3 {
        read("capture.npy", &npy(version, "<i2", "(2, 2)", &four));
    }
    read("capture.npy", &npy(1, "<i4", "(0, 2)", &[]));
}

fn read(name: &'static str, bytes: &[u8]) {
    let case = Case::new(&design(None), name, bytes);
    for arith in ["fixed", "float"] {
        if let Err(message) = case.run("out.csv", Some(arith)).expect_status(0) {
            let shown = String::from_utf8_lossy(bytes);
            panic!("{shown:?} must be read: {message}");
        }
    }
}

fn le(codes: &[i16]) -> Vec<u8> {
    codes.iter().flat_map(|code| code.to_le_bytes()).collect()
}

/// An NPY file in C order.
fn npy(version: u8, descr: &str, shape: &str, data: &[u8]) -> Vec<u8> {
    let dictionary = format!("{{'descr': '{descr}', 'fortran_order': False, 'shape': {shape}, }}");
    let mut bytes = npy_header(version, &dictionary);
    bytes.extend(data);
    bytes
}

fn refuse_npy(what: &str, bytes: &[u8]) {
    refuse(what, "capture.npy", bytes, None);
}

#[test]
fn npy_of_another_type_or_shape() {
    let data = [0u8; 64];
    let types = [
        (">i2", 2),
        (">i4", 4),
        ("<i8", 8),
        ("|i1", 1),
        ("<u2", 2),
        ("<u4", 4),
        ("<f4", 4),
        ("<f8", 8),
        ("<c8", 8),
        ("|b1", 1),
        ("|S2", 2),
        ("<U1", 4),
        ("|O", 8),
        ("", 2),
        ("<i3", 3),
    ];
    for (descr, size) in types {
        let bytes = npy(1, descr, "(2, 2)", &data[..4 * size]);
        refuse_npy(&format!("dtype {descr:?}"), &bytes);
    }
    let structured = "{'descr': [('a', '<i2'), ('b', '<i2')], 'fortran_order': False, \
                      'shape': (2,), }";
    let mut bytes = npy_header(1, structured);
    bytes.extend(&data[..8]);
    refuse_npy("a structured dtype", &bytes);
    let shapes = [
        ("()", 1),
        ("(4,)", 4),
        ("(2, 3)", 6),
        ("(2, 1)", 2),
        ("(3, 2, 1)", 6),
        ("(1, 2, 2)", 4),
        ("(2, 4)", 8),
        ("(-1, 2)", 0),
        ("(2.0, 2)", 4),
        ("(a, 2)", 4),
        ("4", 4),
        ("(2, 0)", 0),
        ("(18446744073709551616, 2)", 0),
        ("(18446744073709551615, 2)", 0),
        ("(9223372036854775808, 2)", 0),
        ("(4611686018427387904, 2)", 0),
        ("(99999999999999999999999, 2)", 4),
    ];
    for (shape, count) in shapes {
        let bytes = npy(1, "<i2", shape, &data[..2 * count]);
        refuse_npy(&format!("shape {shape}"), &bytes);
    }
}

#[test]
fn npy_with_too_few_or_too_many_bytes() {
    let data = le(&[1, 2, 3, 4, 5, 6]);
    let good = npy(1, "<i2", "(3, 2)", &data);
    read("capture.npy", &good);
    for length in 0..good.len() {
        // each step of the header, and the data
        if length.is_multiple_of(7) || length < 12 || length >= good.len() - 13 {
            refuse_npy(&format!("the first {length} bytes"), &good[..length]);
        }
    }
    for extra in [1usize, 2, 4, 12, 100] {
        let mut bytes = good.clone();
        bytes.extend(vec![0u8; extra]);
        refuse_npy(&format!("{extra} bytes after the data"), &bytes);
    }
    refuse_npy("wider data", &npy(1, "<i4", "(3, 2)", &data));
}

#[test]
fn npy_with_a_broken_header() {
    let data = le(&[1, 2, 3, 4]);
    let good = npy(1, "<i2", "(2, 2)", &data);
    read("capture.npy", &good);
    let with = |at: usize, byte: u8| {
        let mut bytes = good.clone();
        bytes[at] = byte;
        bytes
    };
    refuse_npy("another magic", &with(0, b'X'));
    refuse_npy("another magic at its end", &with(5, b'X'));
    for version in [0, 4, 9, 255] {
        refuse_npy(&format!("version {version}"), &with(6, version));
    }
    refuse_npy("a header longer than the file", &with(9, 0xff));
    refuse_npy(
        "a header of no bytes",
        &[&good[..8], &[0, 0], &good[10..]].concat(),
    );
    let mut long = npy(2, "<i2", "(2, 2)", &data);
    long[8..12].fill(0xff);
    refuse_npy("a header of 4 GiB", &long);
    let dictionaries = [
        "",
        "{}",
        "{'descr': '<i2', 'fortran_order': False}",
        "{'descr': '<i2', 'shape': (2, 2)}",
        "{'fortran_order': False, 'shape': (2, 2)}",
        "{'descr': '<i2', 'fortran_order': Maybe, 'shape': (2, 2), }",
        "{'descr': '<i2', 'fortran_order': False, 'shape': (2, 2), ",
        "{'descr': '<i2, 'fortran_order': False, 'shape': (2, 2), }",
        "not a dictionary",
    ];
    for dictionary in dictionaries {
        let mut bytes = npy_header(1, dictionary);
        bytes.extend(&data);
        refuse_npy(&format!("header {dictionary:?}"), &bytes);
    }
    refuse_npy("a CSV named NPY", b"drive_code,sense_code\n1,2\n");
    refuse_npy("zeros", &[0; 256]);
}
