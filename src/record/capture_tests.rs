//! Tests of the capture reader over both kinds of file.

use super::capture::{CaptureMeta, CaptureReader};
use super::npy_header;
use crate::error::{Error, InputError};
use crate::numeric::format::Format;
use std::path::PathBuf;
use tempfile::TempDir;

pub(super) const Q15: Format = Format::q(1, 15);
pub(super) type Rows = Vec<(i32, i32)>;

/// A folder with one capture in it.
pub(super) struct Capture {
    folder: TempDir,
    pub(super) path: PathBuf,
}

impl Capture {
    pub(super) fn new(name: &str, bytes: impl AsRef<[u8]>) -> Self {
        let folder = TempDir::new().unwrap();
        let path = folder.path().join(name);
        std::fs::write(&path, bytes).unwrap();
        Capture { folder, path }
    }

    pub(super) fn beside(self, name: &str, bytes: impl AsRef<[u8]>) -> Self {
        std::fs::write(self.folder.path().join(name), bytes).unwrap();
        self
    }

    /// All rows in blocks of `block`, then what stopped the reading.
    pub(super) fn rows(&self, adc: Format, block: usize) -> (Rows, Option<Box<InputError>>) {
        let mut rows = Vec::new();
        let mut reader = match CaptureReader::open(&self.path, adc) {
            Ok(reader) => reader,
            Err(e) => return (rows, Some(input(e))),
        };
        let (mut drive, mut sense) = (vec![7], vec![7, 7]);
        loop {
            match reader.read_block(&mut drive, &mut sense, block) {
                Ok(0) => return (rows, None),
                Ok(n) => {
                    assert!(n == drive.len() && n == sense.len() && n <= block.max(1));
                    rows.extend(drive.iter().copied().zip(sense.iter().copied()));
                }
                Err(e) => {
                    let again = reader.read_block(&mut drive, &mut sense, block);
                    assert_eq!(input(again.unwrap_err()), input(e.clone()));
                    assert!(drive.is_empty() && sense.is_empty());
                    return (rows, Some(input(e)));
                }
            }
        }
    }

    pub(super) fn meta(&self) -> Result<CaptureMeta, Box<InputError>> {
        let reader = CaptureReader::open(&self.path, Q15).map_err(input)?;
        Ok(reader.meta().clone())
    }
}

fn input(e: Error) -> Box<InputError> {
    match e {
        Error::Input(e) => e,
        other => panic!("no input error: {other}"),
    }
}

pub(super) fn csv(text: impl AsRef<[u8]>) -> Capture {
    Capture::new("capture.csv", text)
}

/// The bytes of an NPY file with this header and these items.
fn npy(version: u8, header: &str, data: &[u8]) -> Vec<u8> {
    let mut bytes = npy_header::MAGIC.to_vec();
    bytes.extend([version, 0]);
    match version {
        1 => bytes.extend((header.len() as u16).to_le_bytes()),
        _ => bytes.extend((header.len() as u32).to_le_bytes()),
    }
    bytes.extend(header.bytes());
    bytes.extend(data);
    bytes
}

pub(super) fn npy_rows(version: u8, item: usize, fortran: bool, rows: &[(i32, i32)]) -> Vec<u8> {
    let order = if fortran { "True" } else { "False" };
    let header = format!(
        "{{'descr': '<i{item}', 'fortran_order': {order}, 'shape': ({}, 2), }}  \n",
        rows.len()
    );
    let codes: Vec<i32> = if fortran {
        let (drive, sense): (Vec<i32>, Vec<i32>) = rows.iter().copied().unzip();
        [drive, sense].concat()
    } else {
        rows.iter().flat_map(|&(d, s)| [d, s]).collect()
    };
    let bytes = codes.iter().flat_map(|c| c.to_le_bytes()[..item].to_vec());
    npy(version, &header, &bytes.collect::<Vec<_>>())
}

#[test]
fn csv_is_read_in_every_accepted_spelling() {
    let rows = vec![(1, -2), (32767, -32768), (0, 7)];
    for text in [
        "drive_code,sense_code\n1,-2\n32767,-32768\n0,7\n",
        "drive_code,sense_code\n1,-2\n32767,-32768\n0,7",
        "\u{feff}drive_code,sense_code\r\n1,-2\r\n32767,-32768\r\n0,7\r\n",
        "\u{feff}# fs_hz = 5\r\n#\r\n# note\r\ndrive_code,sense_code\r\n1,-2\r\n32767,-32768\r\n0,7",
        "drive_code,sense_code\n1,-2\n32767,-32768\n0,7\n\n \t\n\r\n\n",
        " drive_code\t, sense_code \n 1 ,\t-2 \n32767,-32768\n-0,0000000000000000000000000007\n",
        "sense_code,drive_code\n-2,1\n-32768,32767\n7,0\n",
        "t,drive_code,µ,sense_code,x\n,1,a,-2,nan\n,32767,,-32768,\n\u{e9}, 0 ,, 7 ,\"q\"\n",
        "sense_code,t,drive_code,\n-2,,1,\r\n-32768,,32767,\n7,,0,\n",
    ] {
        for block in [1, 2, 3, 100] {
            assert_eq!(csv(text).rows(Q15, block), (rows.clone(), None), "{text:?}");
        }
    }
    assert_eq!(csv("drive_code,sense_code").rows(Q15, 9), (vec![], None));
    // An array is known by its content, whatever its name.
    let named = Capture::new("capture.csv", npy_rows(1, 2, false, &rows));
    assert_eq!(named.rows(Q15, 9), (rows, None));
}

#[test]
fn every_unusable_csv_is_refused_with_line_and_column() {
    let long = "9".repeat(500);
    let huge = format!("drive_code,sense_code\n1,{long}\n");
    // Text, line, column, part of the message, rows before.
    let h = "drive_code,sense_code\n";
    for (text, line, column, says, before) in [
        (format!("{h}1,\n"), 2, 3, "cell of sense_code is empty", 0),
        (format!("{h}1,2\n ,2\n"), 3, 1, "drive_code is empty", 1),
        (format!("{h}1,2\n3,nan\n"), 3, 3, "sense_code is `nan`", 1),
        (
            format!("{h}1,2\n3,  NaN \n"),
            3,
            5,
            "is `NaN`: the instrument",
            1,
        ),
        (format!("{h}1.0,2\n"), 2, 1, "`1.0` is no integer", 0),
        (format!("{h}+1,2\n"), 2, 1, "`+1`", 0),
        (format!("{h}1,-\n"), 2, 3, "`-` is no", 0),
        (format!("{h}1,--2\n"), 2, 3, "`--2`", 0),
        (format!("{h}1,- 2\n"), 2, 3, "`- 2`", 0),
        (format!("{h}1 1,2\n"), 2, 1, "`1 1`", 0),
        (format!("{h}1e3,2\n"), 2, 1, "`1e3`", 0),
        (format!("{h}0x10,2\n"), 2, 1, "`0x10`", 0),
        (format!("{h}12abc,2\n"), 2, 1, "`12abc`", 0),
        (format!("{h}1,12abc\n"), 2, 3, "`12abc`", 0),
        (format!("{h}\"1\",2\n"), 2, 1, "is no integer", 0),
        (format!("{h}1,\u{663}\n"), 2, 3, "is no integer", 0),
        (format!("{h}1,2\r\r\n"), 2, 3, "is no integer", 0),
        (format!("{h}1,2\n3\n"), 3, 2, "1 cell, the header has 2", 1),
        (format!("{h}1,2,\n"), 2, 5, "3 cells, the header has 2", 0),
        (format!("{h}1,2,3,4\n"), 2, 5, "4 cells", 0),
        (format!("{h}x,y,z\n"), 2, 5, "3 cells", 0),
        (format!("{h}1,2\n# note\n3,4\n"), 3, 7, "1 cell", 1),
        (format!("{h}1,2\n\n3,4\n"), 3, 1, "empty line between", 1),
        (format!("{h}\n \r\n3,4\n"), 2, 1, "empty line between", 0),
        (
            format!("{h}32768,2\n"),
            2,
            1,
            "Q1.15, which holds -32768",
            0,
        ),
        (format!("{h}1,-32769\n"), 2, 3, "code -32769 is outside", 0),
        (format!("{h}1,-99999999999999999999\n"), 2, 3, "outside", 0),
        (huge, 2, 3, "99… is outside", 0),
        ("t,drive_code,sense_code\nµs, 5, x\n".into(), 2, 8, "`x`", 0),
        ("drive_code,t,sense_code\n5x,1,2\n".into(), 2, 1, "`5x`", 0),
        ("drive_code,t,sense_code\n5,1\n".into(), 2, 4, "2 cells", 0),
        ("drive_code,t,sense_code\n5,1,2,3\n".into(), 2, 7, "4", 0),
        ("drive_code,sense_code,t\n5,1\n".into(), 2, 4, "2 cells", 0),
        (
            "drive_code,sense_code,t\n5,1 x,2\n".into(),
            2,
            3,
            "`1 x`",
            0,
        ),
        (
            "drive,sense_code\n1,2\n".into(),
            1,
            1,
            "no column `drive_code`",
            0,
        ),
        ("drive_code\n1\n".into(), 1, 1, "no column `sense_code`", 0),
        ("1,2\n3,4\n".into(), 1, 1, "no column", 0),
        ("\"drive_code\",sense_code\n".into(), 1, 1, "no column", 0),
        ("drive_code;sense_code\n1;2\n".into(), 1, 1, "no column", 0),
        (
            "# a\n\u{feff}drive_code,sense_code\n".into(),
            2,
            1,
            "no column",
            0,
        ),
        (
            "sense_code,drive_code, sense_code\n".into(),
            1,
            23,
            "twice",
            0,
        ),
        (
            "# fs_hz = fast\nx\n".into(),
            1,
            11,
            "`fs_hz` must be a number",
            0,
        ),
        ("# fs_hz = 0\n".into(), 1, 11, "must be positive", 0),
        ("# fs_hz = inf\n".into(), 1, 11, "finite", 0),
        (
            "#\n#ftw=1.5\n".into(),
            2,
            6,
            "`ftw` must be a whole number",
            0,
        ),
        ("# ftw = 4294967296\n".into(), 1, 9, "and is 4294967296", 0),
        ("# ftw = -1\n".into(), 1, 9, "and is -1", 0),
        ("# adc_bits = 0 # none\n".into(), 1, 14, "1 ..= 64", 0),
        ("# ftw = 1\n# ftw = 1\n".into(), 2, 3, "a second time", 0),
    ] {
        for block in [1, 2, 100] {
            let (rows, e) = csv(&text).rows(Q15, block);
            let e = e.unwrap_or_else(|| panic!("accepted: {text:?}"));
            assert_eq!(
                (e.line, e.column),
                (Some(line), Some(column)),
                "{text:?} {e}"
            );
            assert!(e.message.contains(says), "{text:?}: {e}");
            assert!(e.help.is_some() && e.file.is_some(), "{text:?}: {e}");
            assert_eq!(rows.len(), before, "{text:?}: {e}");
        }
    }
}

#[test]
fn what_is_no_capture_at_all_is_refused_without_a_panic() {
    let folder = TempDir::new().unwrap();
    for (path, says) in [
        (folder.path().to_path_buf(), "folder"),
        (folder.path().join("none.csv"), "cannot read the capture"),
        (PathBuf::new(), "cannot read the capture"),
        (PathBuf::from("/dev/zero"), "a device, not a capture"),
    ] {
        let e = CaptureReader::open(&path, Q15).err().map(input).unwrap();
        assert!(e.message.contains(says), "{e}");
    }
    for (bytes, says) in [
        (b"".to_vec(), "is empty"),
        (b"\n\n".to_vec(), "no header line"),
        (b"# fs_hz = 1\n".to_vec(), "no header line"),
        (b"PK\x03\x04\x00\x00,\n".to_vec(), "a ZIP archive"),
        (b"\x01\x02\x00\x00,\n".to_vec(), "binary"),
        (b"\xff\xfed\x00r\x00\n\x00".to_vec(), "binary"),
        (vec![b'1'; 3 << 20], "longer than 1 MiB"),
        (b"\x93NUM".to_vec(), "ends inside"),
    ] {
        let e = csv(bytes).rows(Q15, 8).1.unwrap();
        assert!(e.message.contains(says), "{e}");
    }
}

#[test]
fn a_long_line_is_read_and_a_longer_one_refused_with_its_number() {
    let row = |length: usize| format!("{}5,6,\n", " ".repeat(length));
    let text = |length| format!("drive_code,sense_code,t\n1,2,\n{}7,8,\n", row(length));
    let rows = vec![(1, 2), (5, 6), (7, 8)];
    assert_eq!(csv(text(900_000)).rows(Q15, 2), (rows, None));
    let (rows, e) = csv(text(1 << 20)).rows(Q15, 2);
    assert_eq!((rows, e.unwrap().line), (vec![(1, 2)], Some(3)));
}

#[test]
fn comments_and_side_car_give_the_same_meta() {
    let full = CaptureMeta {
        fs_hz: Some(224000.0),
        ftw: Some(33555666),
        adc_bits: Some(16),
        drive_amplitude_codes: Some(26000.0),
        sense_codes_per_dps: Some(-9.5),
        sense_phase_rad: Some(1e-3),
        rate_dps: None,
    };
    let keys = "fs_hz = 224000\nftw = 33555666\nadc_bits = 16\ndrive_amplitude_codes = 26000.0\n\
                sense_codes_per_dps = -9.5\nsense_phase_rad = 1e-3\nrate_dps = nan\nmade_by = 5\n";
    let comments: String = keys.lines().map(|l| format!("# {l} # so\n")).collect();
    let text = format!("made up\n{comments}drive_code,sense_code\n");
    assert_eq!(csv(format!("#{text}")).meta(), Ok(full.clone()));
    assert_eq!(
        csv("\u{feff}# rate_dps =\ndrive_code,sense_code\n").meta(),
        Ok(CaptureMeta::default())
    );
    let data = npy_rows(1, 2, false, &[(1, 2)]);
    let with = |toml: &[u8]| Capture::new("capture.npy", &data).beside("capture.toml", toml);
    assert_eq!(with(keys.as_bytes()).meta(), Ok(full));
    assert_eq!(
        with(b"\xef\xbb\xbf[x]\nfs_hz = 'a'\n").meta(),
        Ok(CaptureMeta::default())
    );
    assert_eq!(
        Capture::new("capture.npy", &data).meta(),
        Ok(CaptureMeta::default())
    );
    for (toml, line, says) in [
        (b"a = 1\nfs_hz = 'fast'\n".as_slice(), 2, "a TOML string"),
        (b"fs_hz = [1.0]\n", 1, "a TOML array"),
        (b"\n\nftw = 1.5\n", 3, "and is 1.5"),
        (b"ftw = 0x1_0000_0000\n", 1, "and is 4294967296"),
        (b"adc_bits = true\n", 1, "a TOML bool"),
        (b"ftw = 1\nftw = 2\n", 2, "no valid TOML"),
        (b"fs_hz 224000\n", 1, "no valid TOML"),
        (b"# a\n# \xff\n", 2, "no UTF-8"),
    ] {
        let e = with(toml).meta().unwrap_err();
        assert_eq!(e.line, Some(line), "{e}");
        assert!(e.message.contains(says), "{e}");
        assert!(e.file.unwrap().ends_with("capture.toml"));
    }
    let folder = Capture::new("capture.npy", &data);
    std::fs::create_dir(folder.folder.path().join("capture.toml")).unwrap();
    assert!(folder.meta().unwrap_err().message.contains("side-car"));
}

#[test]
fn every_unusable_npy_is_refused_with_what_was_found() {
    let header = |descr: &str, shape: &str| {
        format!("{{'descr': {descr}, 'fortran_order': False, 'shape': {shape}, }}\n")
    };
    for (descr, shape, bytes, says) in [
        (
            "'<i2'",
            "(3, 2)",
            11,
            "3 rows need 12 bytes, and the file holds 11",
        ),
        ("'<i2'", "(3, 2)", 13, "1 bytes follow after its 3 rows"),
        ("'<i2'", "(0, 2)", 1, "1 bytes follow"),
        (
            "'<i4'",
            "(18446744073709551615, 2)",
            8,
            "need 147573952589676412920",
        ),
        ("'<i2'", "(2, 3)", 12, "shape is [2, 3], not (n, 2)"),
        ("'<i2'", "(6,)", 12, "shape is [6]"),
        ("'<i2'", "()", 2, "shape is []"),
        ("'<i2'", "(3, 2, 1)", 12, "shape is [3, 2, 1]"),
        ("'>i2'", "(3, 2)", 12, "items are `>i2`"),
        ("'<i8'", "(3, 2)", 48, "items are `<i8`"),
        ("'<u2'", "(3, 2)", 12, "items are `<u2`"),
        ("'<f4'", "(3, 2)", 24, "items are `<f4`"),
        ("[('a', '<i2')]", "(3, 2)", 12, "`[` where a string"),
    ] {
        for version in [1, 2, 3] {
            let data = npy(version, &header(descr, shape), &vec![0; bytes]);
            let (rows, e) = Capture::new("c.npy", data).rows(Q15, 8);
            let e = e.unwrap();
            assert!(rows.is_empty() && e.message.contains(says), "{e}");
            assert!(e.file.is_some() && e.help.is_some(), "{e}");
        }
    }
    // Codes outside the format, in either column and order; the rows before them come first.
    for fortran in [false, true] {
        let mut rows = vec![(1, 2); 40_000];
        rows[35_000] = (5, -2049);
        rows[36_000] = (4000, 3);
        let data = npy_rows(1, 4, fortran, &rows);
        for (format, before, says) in [
            (
                Format::q(1, 11),
                35_000,
                "row 35000, column 1 (from 0): sense_code -2049 is outside",
            ),
            (Format::q(1, 12), 40_000, ""),
        ] {
            for block in [1000, 7777, 50_000] {
                let (found, e) = Capture::new("c.npy", &data).rows(format, block);
                assert_eq!(found.len(), before);
                assert_eq!(e.is_some(), !says.is_empty());
                assert!(e.is_none_or(|e| e.message.contains(says)));
            }
        }
    }
}
