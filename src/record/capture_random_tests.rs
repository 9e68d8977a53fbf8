//! The capture reader under random files.

use super::capture::CaptureReader;
use super::capture_tests::{Capture, Q15, csv, npy_rows};
use super::npy_header;
use crate::numeric::format::Format;
use proptest::prelude::*;

fn codes(limit: i32) -> impl Strategy<Value = Vec<(i32, i32)>> {
    let code = || -limit - 1..=limit;
    prop::collection::vec((code(), code()), 0..300)
}

proptest! {
    #[test]
    fn every_file_and_block_size_gives_the_same_rows(
        rows in codes(32767), block in 0usize..400, version in 1u8..=3
    ) {
        let want = (rows.clone(), None);
        let text: String = rows.iter().map(|(d, s)| format!("{s},x,{d}\n")).collect();
        let text = format!("sense_code,t,drive_code\n{text}");
        prop_assert_eq!(csv(text).rows(Q15, block), want.clone());
        for (item, fortran) in [(2, false), (2, true), (4, false), (4, true)] {
            let file = Capture::new("c.npy", npy_rows(version, item, fortran, &rows));
            let reader = CaptureReader::open(&file.path, Q15).unwrap();
            prop_assert_eq!(reader.rows_hint(), Some(rows.len() as u64));
            prop_assert_eq!(file.rows(Q15, block), want.clone());
        }
    }

    #[test]
    fn codes_of_32_bits_survive(rows in codes(i32::MAX)) {
        let text: String = rows.iter().map(|(d, s)| format!("{d},{s}\n")).collect();
        let want = (rows.clone(), None);
        let adc = Format::q(2, 30);
        prop_assert_eq!(csv(format!("drive_code,sense_code\n{text}")).rows(adc, 99), want.clone());
        prop_assert_eq!(Capture::new("c.npy", npy_rows(1, 4, true, &rows)).rows(adc, 99), want);
    }

    #[test]
    fn random_bytes_never_panic(bytes in prop::collection::vec(any::<u8>(), 0..400)) {
        let toml = bytes.clone();
        let _ = csv(&bytes).rows(Q15, 8);
        let header = [b"drive_code,sense_code\n", bytes.as_slice()].concat();
        let _ = csv(header).rows(Q15, 8);
        let magic = [npy_header::MAGIC, b"\x01\x00\x40\x00{'descr'", &bytes].concat();
        let _ = Capture::new("c.npy", magic).rows(Q15, 8);
        let data = npy_rows(1, 2, false, &[(1, 2)]);
        let _ = Capture::new("c.npy", data).beside("c.toml", toml).meta();
    }

    #[test]
    fn mutated_files_never_panic_and_blocks_do_not_matter(
        changes in prop::collection::vec((any::<prop::sample::Index>(), prop_oneof![
            any::<u8>(), prop::sample::select(b",\n\r -09#=\"'(){}".as_slice())
        ]), 1..4),
        cut in any::<prop::sample::Index>(),
    ) {
        let rows = [(1, -2), (-300, 400), (5, 32767), (7, 8)];
        let text = "\u{feff}# fs_hz = 224000.0\n# ftw = 5\nt,drive_code,sense_code\r\n\
                    0,1,-2\r\n1, -300 ,400\n2,5,32767\n3,7,8\n\n";
        for valid in [text.as_bytes().to_vec(), npy_rows(1, 2, false, &rows), npy_rows(2, 4, true, &rows)] {
            for shorten in [false, true] {
                let mut bytes = valid.clone();
                for (at, byte) in &changes {
                    let at = at.index(bytes.len());
                    bytes[at] = *byte;
                }
                if shorten {
                    bytes.truncate(cut.index(bytes.len()));
                }
                let file = csv(bytes);
                prop_assert_eq!(file.rows(Q15, 1), file.rows(Q15, 3));
            }
        }
    }
}
