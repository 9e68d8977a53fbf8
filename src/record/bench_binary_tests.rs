//! Captures of benches that are no text: raw samples and arrays with a side-car, packed files.

use super::bench_tests::{CHANNELS, ROWS, rows, table};
use super::capture::CaptureReader;
use super::capture_tests::{Capture, Q15, csv};
use std::io::Write;

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
