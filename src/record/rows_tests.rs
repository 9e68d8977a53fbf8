//! Tests of the output of `replay`.

use super::npy_header::Header;
use super::rows::{Kind, RowWriter};
use crate::error::Error;
use proptest::prelude::*;
use std::fs;
use std::path::Path;
use tempfile::TempDir;

const COLUMNS: [&str; 3] = ["index", "rate", "tuning_word"];

fn names(folder: &Path) -> Vec<String> {
    let entries = fs::read_dir(folder).unwrap();
    let mut names: Vec<_> = entries
        .map(|e| e.unwrap().file_name().into_string().unwrap())
        .collect();
    names.sort();
    names
}

fn write_three(path: &Path, rows: &[[i128; 3]]) -> Vec<u8> {
    let mut writer = RowWriter::create(path, &COLUMNS, Kind::Integer).unwrap();
    for row in rows {
        writer.write_integers(row).unwrap();
    }
    writer.finish().unwrap();
    fs::read(path).unwrap()
}

#[test]
fn integers_are_written_whole_in_both_kinds_of_file() {
    let folder = TempDir::new().unwrap();
    let rows = [
        [0, i64::MIN.into(), u64::MAX.into()],
        [1, -1, 1 << 63],
        [2, i64::MAX.into(), i128::from(u64::MAX) + 1],
    ];
    assert_eq!(
        String::from_utf8(write_three(&folder.path().join("a.csv"), &rows)).unwrap(),
        "index,rate,tuning_word\n0,-9223372036854775808,18446744073709551615\n\
         1,-1,9223372036854775808\n2,9223372036854775807,18446744073709551616\n"
    );
    let bytes = write_three(&folder.path().join("a.NPY"), &rows);
    let header = Header::read(&mut bytes.as_slice()).unwrap();
    assert_eq!(
        (
            header.descr.as_str(),
            header.fortran_order,
            &header.shape[..]
        ),
        ("<i8", false, &[3, 3][..])
    );
    let (items, rest) = bytes[header.bytes as usize..].as_chunks::<8>();
    let items: Vec<i64> = items.iter().map(|&b| i64::from_le_bytes(b)).collect();
    assert!(rest.is_empty());
    assert_eq!(items, [0, i64::MIN, -1, 1, -1, i64::MIN, 2, i64::MAX, 0]);
    // No rows: the header alone.
    assert_eq!(
        write_three(&folder.path().join("b"), &[]),
        b"index,rate,tuning_word\n"
    );
    let bytes = write_three(&folder.path().join("b.npy"), &[]);
    assert_eq!(Header::read(&mut bytes.as_slice()).unwrap().shape, [0, 3]);
    assert_eq!(names(folder.path()), ["a.NPY", "a.csv", "b", "b.npy"]);
}

#[test]
fn many_rows_pass_through_the_buffer() {
    let folder = TempDir::new().unwrap();
    let rows: Vec<_> = (0..50_000).map(|i| [i, -i, i * i]).collect();
    let text = String::from_utf8(write_three(&folder.path().join("a.csv"), &rows)).unwrap();
    let mut lines = text.lines().skip(1);
    for [a, b, c] in rows {
        assert_eq!(lines.next().unwrap(), format!("{a},{b},{c}"));
    }
    assert!(lines.next().is_none() && text.ends_with('\n'));
}

#[test]
fn nothing_is_left_and_nothing_changed_without_finish() {
    let folder = TempDir::new().unwrap();
    let path = folder.path().join("a.csv");
    let write = |rows: usize| {
        let mut writer = RowWriter::create(&path, &COLUMNS, Kind::Integer).unwrap();
        for _ in 0..rows {
            writer.write_integers(&[1, 2, 3]).unwrap();
        }
        writer
    };
    drop(write(100_000));
    assert!(names(folder.path()).is_empty());
    fs::write(&path, "old and longer than what comes\n".repeat(9)).unwrap();
    let old = fs::read(&path).unwrap();
    drop(write(100_000));
    assert_eq!(
        (names(folder.path()), fs::read(&path).unwrap()),
        (vec!["a.csv".into()], old)
    );
    write(1).finish().unwrap();
    assert_eq!(fs::read(&path).unwrap(), b"index,rate,tuning_word\n1,2,3\n");
    assert_eq!(names(folder.path()), ["a.csv"]);
}

#[test]
fn an_output_that_cannot_be_is_refused_before_any_row() {
    let folder = TempDir::new().unwrap();
    fs::write(folder.path().join("file"), "").unwrap();
    for (path, says) in [
        (folder.path().join("none/a.csv"), "no folder"),
        (folder.path().join("file/a.csv"), "cannot write"),
        (folder.path().to_path_buf(), "is a folder"),
        (folder.path().join(".."), "is a folder"),
        ("".into(), "names no file"),
        ("/dev/null/x".into(), "cannot write"),
        (folder.path().join("x".repeat(300)), "cannot write"),
    ] {
        let e = RowWriter::create(&path, &COLUMNS, Kind::Float)
            .err()
            .unwrap();
        assert!(e.to_string().contains(says), "{path:?}: {e}");
        assert!(matches!(e, Error::Input(_)) && e.exit_status() == 2);
    }
    assert_eq!(names(folder.path()), ["file"]);
    // What is no regular file is written straight.
    let mut writer = RowWriter::create(Path::new("/dev/null"), &COLUMNS, Kind::Integer).unwrap();
    writer.write_integers(&[1, 2, 3]).unwrap();
    // A row that the columns do not have is a mistake that is told.
    assert!(writer.write_integers(&[1, 2]).is_err());
    assert!(writer.write_floats(&[1.0, 2.0, 3.0]).is_err());
    writer.finish().unwrap();
    assert!(!fs::metadata("/dev/null").unwrap().is_file());
}

#[cfg(unix)]
#[test]
fn modes_and_links_are_those_that_a_user_expects() {
    use std::os::unix::fs::{PermissionsExt, symlink};
    let folder = TempDir::new().unwrap();
    let at = |name: &str| folder.path().join(name);
    let mode = |name: &str| fs::metadata(at(name)).unwrap().permissions().mode() & 0o777;
    fs::write(at("plain"), "").unwrap();
    write_three(&at("new.csv"), &[]);
    assert_eq!(mode("new.csv"), mode("plain"));
    fs::write(at("own.csv"), "").unwrap();
    fs::set_permissions(at("own.csv"), fs::Permissions::from_mode(0o640)).unwrap();
    symlink("own.csv", at("link.csv")).unwrap();
    write_three(&at("link.csv"), &[[1, 2, 3]]);
    assert_eq!(mode("own.csv"), 0o640);
    assert!(fs::symlink_metadata(at("link.csv")).unwrap().is_symlink());
    assert!(
        fs::read_to_string(at("own.csv"))
            .unwrap()
            .ends_with("\n1,2,3\n")
    );
    let fifo = at("fifo.npy");
    let made = std::process::Command::new("mkfifo").arg(&fifo).status();
    if made.is_ok_and(|s| s.success()) {
        // Both ends, so that opening it does not wait.
        let _ends = fs::OpenOptions::new()
            .read(true)
            .write(true)
            .open(&fifo)
            .unwrap();
        let e = RowWriter::create(&fifo, &COLUMNS, Kind::Integer)
            .err()
            .unwrap();
        assert!(e.to_string().contains("regular file"), "{e}");
    }
}

fn float_text(values: &[f64]) -> (String, Vec<u8>) {
    let folder = TempDir::new().unwrap();
    let columns = vec!["x"; values.len()];
    let write = |name: &str| {
        let path = folder.path().join(name);
        let mut writer = RowWriter::create(&path, &columns, Kind::Float).unwrap();
        writer.write_floats(values).unwrap();
        writer.finish().unwrap();
        fs::read(path).unwrap()
    };
    let text = String::from_utf8(write("a.csv")).unwrap();
    (text.lines().nth(1).unwrap().to_owned(), write("a.npy"))
}

#[test]
fn reals_are_short() {
    let text = float_text(&[0.0, 12.0, -0.5, 1e-5, 9.5e-6, 1e15, 1e16, -0.0, 0.1]).0;
    assert_eq!(
        text,
        "0,12,-0.5,0.00001,9.5e-6,1000000000000000,1e+16,-0,0.1"
    );
}

proptest! {
    #[test]
    fn reals_read_back_as_they_were(values in prop::collection::vec(any::<f64>(), 1..9)) {
        let (text, npy) = float_text(&values);
        for (cell, value) in text.split(',').zip(&values) {
            let back: f64 = cell.parse().unwrap();
            prop_assert!(back.to_bits() == value.to_bits() || value.is_nan() && back.is_nan());
        }
        let header = Header::read(&mut npy.as_slice()).unwrap();
        prop_assert_eq!(header.descr, "<f8");
        prop_assert_eq!(header.shape, [1, values.len() as u64]);
        let items = npy[header.bytes as usize..].as_chunks::<8>().0;
        for (item, value) in items.iter().zip(&values) {
            prop_assert_eq!(*item, value.to_le_bytes());
        }
    }
}
