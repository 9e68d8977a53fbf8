//! What a file is by its first bytes, and gzip and zstd streams unpacked while they are read.

use crate::error::InputError;
use ruzstd::decoding::{FrameDecoder, StreamingDecoder};
use std::io::{self, BufRead, BufReader, Read};
use std::path::Path;

/// Bytes that tell what a file is: a tar archive says so behind the first entry's name.
pub(super) const HEAD: usize = 262;

const GZIP: [u8; 2] = [0x1F, 0x8B];
const ZSTD: [u8; 4] = [0x28, 0xB5, 0x2F, 0xFD];

/// Times that a MAVLink telemetry log can begin with, us since 1970: 2000 to 2100.
const TELEMETRY_US: std::ops::Range<u64> = 946_684_800_000_000..4_102_444_800_000_000;

/// Whether these are the first bytes of a packed file.
pub(super) fn is_packed(head: &[u8]) -> bool {
    head.starts_with(&GZIP) || is_zstd(head)
}

fn is_zstd(head: &[u8]) -> bool {
    let first = head.first_chunk::<4>().map(|h| u32::from_le_bytes(*h));
    head.starts_with(&ZSTD) || first.is_some_and(|magic| magic & !0xF == METADATA)
}

/// The stream unpacked, if its head is that of a packed one; the second: whether it was.
///
/// # Errors
/// A head that is followed by no such stream.
pub(super) fn unpacked(
    head: &[u8],
    input: Box<dyn Read + Send>,
) -> io::Result<(Box<dyn Read + Send>, bool)> {
    if head.starts_with(&GZIP) {
        let of = flate2::read::MultiGzDecoder::new(input);
        return Ok((Box::new(Told { of, name: "gzip" }), true));
    }
    if is_zstd(head) {
        let of = Zstd::new(input).map_err(|e| told(e, "zstd"))?;
        return Ok((Box::new(Told { of, name: "zstd" }), true));
    }
    Ok((input, false))
}

/// A decoder whose failures say what the file has.
struct Told<R> {
    of: R,
    name: &'static str,
}

impl<R: Read> Read for Told<R> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        self.of.read(buffer).map_err(|e| told(e, self.name))
    }
}

/// A decoder's failure in words: cut, or damaged; what the system says stays.
fn told(error: io::Error, name: &str) -> io::Error {
    let text = error.to_string();
    let is_cut = ["stream ends", "incomplete", "UnexpectedEof"]
        .iter()
        .any(|part| text.contains(part));
    match error.kind() {
        io::ErrorKind::UnexpectedEof => cut(name),
        // The zstd decoder tells all of its failures as of another kind.
        io::ErrorKind::InvalidData | io::ErrorKind::InvalidInput | io::ErrorKind::Other => {
            match is_cut {
                true => cut(name),
                false => io::Error::new(
                    io::ErrorKind::InvalidData,
                    format!("the {name} file is damaged ({text})"),
                ),
            }
        }
        _ => error,
    }
}

fn cut(name: &str) -> io::Error {
    io::Error::new(
        io::ErrorKind::UnexpectedEof,
        format!("the {name} file is cut short: it ends within its data"),
    )
}

/// Refuses what was packed twice; `head` is what was unpacked.
pub(super) fn packed_twice(path: &Path, head: &[u8]) -> Option<InputError> {
    is_packed(head).then(|| {
        InputError::new("this is a packed file that holds another packed file (gzip or zstd)")
            .in_file(path)
            .help("unpack it once: files that are packed once are read as they are")
    })
}

/// A zstd stream of one frame after the other; frames of metadata are passed over, and checksums hold.
struct Zstd {
    frame: Option<Frame>,
}

type Input = BufReader<Box<dyn Read + Send>>;
type Frame = StreamingDecoder<Input, FrameDecoder>;

impl Zstd {
    fn new(input: Box<dyn Read + Send>) -> io::Result<Self> {
        let frame = frame(BufReader::new(input))?;
        Ok(Zstd { frame })
    }
}

/// The first magic number of a frame that holds metadata, with a number from 0 to 15 in its low bits.
const METADATA: u32 = 0x184D_2A50;

fn damaged(what: impl ToString) -> io::Error {
    io::Error::new(io::ErrorKind::InvalidData, what.to_string())
}

/// The next frame with contents; `None` at the stream's end.
fn frame(mut input: Input) -> io::Result<Option<Frame>> {
    loop {
        let start = input.fill_buf()?;
        if start.is_empty() {
            return Ok(None);
        }
        let head = start.first_chunk::<4>().map(|h| u32::from_le_bytes(*h));
        if head.is_none_or(|magic| magic & !0xF != METADATA) {
            return StreamingDecoder::new(input).map(Some).map_err(damaged);
        }
        let mut header = [0u8; 8];
        input.read_exact(&mut header)?;
        let [.., a, b, c, d] = header;
        let length = u64::from(u32::from_le_bytes([a, b, c, d]));
        if io::copy(&mut input.by_ref().take(length), &mut io::sink())? < length {
            return Err(damaged("the stream ends within a frame"));
        }
    }
}

impl Read for Zstd {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        loop {
            let Some(of) = self.frame.as_mut() else {
                return Ok(0);
            };
            let count = of.read(buffer)?;
            if count > 0 || buffer.is_empty() {
                return Ok(count);
            }
            let Some(done) = self.frame.take() else {
                return Ok(0);
            };
            let (rest, decoder) = done.into_parts();
            if let Some(told) = decoder.get_checksum_from_data()
                && decoder.get_calculated_checksum() != Some(told)
            {
                return Err(damaged("the packed data do not have their checksum"));
            }
            self.frame = frame(rest)?;
        }
    }
}

/// What a file that is no record is, and what to do; `None` for one that may be.
pub(super) fn foreign(head: &[u8]) -> Option<(&'static str, &'static str)> {
    const UNPACK: &str =
        "unpack it, and give the record that is in it (gzip and zstd files are read as they are)";
    const EXPORT: &str = "export the gyro's rate, its temperature and their time from it as CSV";
    const KINDS: [(&[u8], &str, &str); 14] = [
        (
            b"PK\x03\x04",
            "this is a ZIP archive or an Excel workbook",
            "unpack it, or save the sheet as CSV UTF-8",
        ),
        (b"BZh", "this is a bzip2 file", UNPACK),
        (b"\xFD7zXZ\0", "this is an xz file", UNPACK),
        (b"7z\xBC\xAF\x27\x1C", "this is a 7-Zip archive", UNPACK),
        (b"#ROSBAG V", "this is a ROS bag", EXPORT),
        (b"\x89MCAP0\r\n", "this is an MCAP file (ROS 2)", EXPORT),
        (
            b"\x89HDF\r\n\x1A\n",
            "this is an HDF5 file (or MATLAB's)",
            EXPORT,
        ),
        (b"MATLAB 5.0", "this is a MATLAB file", EXPORT),
        (b"PAR1", "this is a Parquet file", EXPORT),
        (
            b"SQLite format 3",
            "this is an SQLite data base (ROS 2?)",
            EXPORT,
        ),
        (
            b"H Product:Blac",
            "this is a Blackbox log (Betaflight, INAV)",
            "decode it with blackbox_decode, which writes CSV",
        ),
        (
            b"\x93NUMPY",
            "this is a NumPy array",
            "a capture of ADC codes is given with `close --capture`; write a thermal record as CSV",
        ),
        (b"%PDF", "this is a PDF", EXPORT),
        (
            b"\xD0\xCF\x11\xE0",
            "this is an old Excel workbook",
            "save the sheet as CSV UTF-8",
        ),
    ];
    // Behind a byte order mark and blank lines.
    let text = head
        .strip_prefix(b"\xEF\xBB\xBF")
        .unwrap_or(head)
        .trim_ascii_start();
    let is_text = !text.iter().any(|b| matches!(b, 0..=8 | 14..=31));
    match text {
        [b'<', b'!' | b'?' | b'a'..=b'z' | b'A'..=b'Z', ..] if is_text => {
            return Some((
                "this is a web page (HTML) or XML, and no table",
                "was it downloaded while not logged in? Give the file itself",
            ));
        }
        [b'{', ..] if is_text => return Some(("this is JSON", EXPORT)),
        _ => {}
    }
    if let Some((_, what, help)) = KINDS.iter().find(|(magic, ..)| head.starts_with(magic)) {
        return Some((what, help));
    }
    if head.get(257..262) == Some(b"ustar") {
        return Some(("this is a tar archive", UNPACK));
    }
    // A time in front of each MAVLink packet (0xFE: version 1, 0xFD: version 2).
    let time = head.first_chunk::<8>().map(|t| u64::from_be_bytes(*t));
    let packet = head.get(8).is_some_and(|b| matches!(b, 0xFE | 0xFD));
    (packet && time.is_some_and(|t| TELEMETRY_US.contains(&t))).then_some((
        "this is a telemetry log (MAVLink, as a ground station writes it)",
        "its IMU messages are few and scaled; give the log that the vehicle itself wrote (ArduPilot: .bin, PX4: .ulg)",
    ))
}

#[cfg(test)]
mod tests {
    use super::super::any::read_any;
    use super::*;
    use crate::design::RecordMapping;
    use std::io::Write;

    fn csv() -> Vec<u8> {
        let rows =
            (0..300).map(|k| format!("{k},{:.4},{}\n", (1.7 * f64::from(k)).sin(), 20 + k % 40));
        ("time_s,rate_out_dps,die_degc\n".to_owned() + &rows.collect::<String>()).into_bytes()
    }

    fn gzip(bytes: &[u8]) -> Vec<u8> {
        let mut out = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::default());
        out.write_all(bytes).unwrap();
        out.finish().unwrap()
    }

    fn zstd(bytes: &[u8]) -> Vec<u8> {
        ruzstd::encoding::compress_to_vec(bytes, ruzstd::encoding::CompressionLevel::Fastest)
    }

    #[test]
    fn a_packed_record_is_the_record() {
        let folder = tempfile::tempdir().unwrap();
        let mapping = RecordMapping::default();
        let read = |name: &str, bytes: &[u8]| {
            let path = folder.path().join(name);
            std::fs::write(&path, bytes).unwrap();
            read_any(&path, &mapping)
        };
        let plain = read("r.csv", &csv()).unwrap();
        let (first, second) = csv().split_at(1000).map_halves();
        for (name, bytes) in [
            ("r.csv.gz", gzip(&csv())),
            ("r.gz", [gzip(&first), gzip(&second)].concat()),
            ("r.csv.zst", zstd(&csv())),
            ("r.zst", [zstd(&first), zstd(&second)].concat()),
            ("r.bin", gzip(&csv())),
        ] {
            let (record, warnings) = read(name, &bytes).unwrap();
            assert_eq!(record.columns, plain.0.columns, "{name}");
            assert_eq!(warnings, plain.1, "{name}");
            let cut = bytes.get(..bytes.len() / 2).unwrap();
            let error = read(name, cut).unwrap_err();
            assert_eq!(error.exit_status(), 2, "{name}");
            let error = error.to_string();
            assert!(
                error.contains("cut short") || error.contains("damaged"),
                "{error}"
            );
        }
        let error = read("r.csv.gz", &gzip(&gzip(&csv())))
            .unwrap_err()
            .to_string();
        assert!(error.contains("another packed file"), "{error}");
        let error = read("r.ulg", b"").unwrap_err().to_string();
        assert!(error.contains("the log is empty"), "{error}");
    }

    trait Halves {
        fn map_halves(self) -> (Vec<u8>, Vec<u8>);
    }

    impl Halves for (&[u8], &[u8]) {
        fn map_halves(self) -> (Vec<u8>, Vec<u8>) {
            (self.0.to_vec(), self.1.to_vec())
        }
    }

    #[test]
    fn a_file_of_another_kind_is_named() {
        let mut telemetry = 1_700_000_000_000_000u64.to_be_bytes().to_vec();
        telemetry.extend([0xFD, 9, 0, 0, 7, 1, 1, 0]);
        for (head, part) in [
            (&b"PK\x03\x04\x14\0"[..], "Excel"),
            (b"BZh91AY", "bzip2"),
            (&telemetry, "telemetry"),
            (b"\x89MCAP0\r\n", "MCAP"),
            (b"<!DOCTYPE html>", "web page"),
            (b"\xEF\xBB\xBF\r\n\n  <html lang=\"en\">", "HTML"),
            (b"{\"time_s\": [1, 2]}", "JSON"),
            (&[&[b'r'; 257][..], b"ustar\0"].concat(), "tar"),
        ] {
            assert!(foreign(head).unwrap().0.contains(part), "{part}");
        }
        for head in [
            &b"time_s,rate_out"[..],
            b"ULog\x01\x12\x35",
            b"",
            b"1,2,3,4,5,6,7,8",
            b"<\x01\x02\x00 of samples",
            b"<5,6,7",
        ] {
            assert_eq!(foreign(head), None);
        }
    }
}
