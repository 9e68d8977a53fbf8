//! A capture of raw samples, all channels of a row one after the other, as its side-car says; and the NPY arrays that need
//! the same keys: real numbers in volts, more than two columns.

use super::bench_keys::{BenchKeys, Item, Scale};
use super::capture::{COLUMNS, Codes};
use super::capture_meta::sidecar_name;
use super::npy_header::{Header, HeaderError};
use crate::error::{InputError, Result, io_error};
use std::fs::File;
use std::io::{Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};

/// Bytes decoded at a time, about.
const CHUNK_BYTES: usize = 1 << 17;

/// The rows of such a capture.
pub(super) struct RawSource {
    path: PathBuf,
    file: File,
    item: Item,
    channels: usize,
    /// Drive's and sense's channel.
    used: [usize; 2],
    fortran_order: bool,
    /// Bytes before the first item.
    start: u64,
    rows: u64,
    /// Rows read so far.
    next: u64,
    codes: Codes,
    scale: Option<Scale>,
    chunk: Vec<u8>,
}

/// Whether a file's name says that it holds raw samples.
pub(super) fn is_named_raw(path: &Path) -> bool {
    const NAMES: [&str; 6] = ["raw", "pcm", "i16", "s16", "int16", "i32"];
    let extension = path.extension().and_then(|e| e.to_str()).unwrap_or("");
    NAMES.contains(&extension.to_ascii_lowercase().as_str())
}

/// The side-car of a raw capture that has none, for a message.
pub(super) fn without_keys(path: &Path) -> InputError {
    InputError::new("this capture is raw samples, and nothing says what they are")
        .in_file(path)
        .help(format!(
            "write {} beside it:\n    item = \"int16\"\n    channels = 2\n    drive_column = 0\n    sense_column = 1\n    \
             skip_bytes = 0\n    fs_hz = 224000.0",
            sidecar_name(path)
        ))
}

impl RawSource {
    /// A raw file of `length` bytes (`None` = no regular file, which is refused); the second: what was chosen.
    ///
    /// # Errors
    /// Keys that are missing or do not agree with each other or with the length.
    pub(super) fn open(
        path: &Path,
        file: File,
        length: Option<u64>,
        codes: Codes,
        keys: &BenchKeys,
    ) -> Result<(Self, Vec<String>)> {
        let item = keys.item.ok_or_else(|| without_keys(path))?;
        let channels = keys.channels.unwrap_or(2);
        let skip = keys.skip_bytes.unwrap_or(0);
        let refuse =
            |message: String, help: &str| InputError::new(message).in_file(path).help(help);
        let Some(length) = length else {
            let message =
                "a raw capture must be a regular file: its length tells its rows".to_owned();
            return Err(refuse(message, "write it to a file").into());
        };
        let row = (channels * item.bytes) as u64;
        let held = length.saturating_sub(skip);
        if skip > length || held == 0 || held % row != 0 {
            let message = format!(
                "{length} bytes less {skip} are no whole rows of {channels} channels of {} bytes",
                item.bytes
            );
            let help = format!(
                "correct `item`, `channels` or `skip_bytes` in {}; or the file was cut",
                sidecar_name(path)
            );
            return Err(refuse(message, &help).into());
        }
        let used = keys
            .numbered(channels)
            .map_err(|message| refuse(message, "the side-car names them: `drive_column = 0`"))?;
        let mut notes = vec![format!(
            "{} rows of {channels} interleaved channels of {} bytes, the {} byte first; the drive is channel {}, the sense {}",
            held / row,
            item.bytes,
            if item.big_endian { "highest" } else { "lowest" },
            used[0],
            used[1]
        )];
        let scale = scale(path, item, keys, &mut notes)?;
        let source = RawSource {
            path: path.to_path_buf(),
            file,
            item,
            channels,
            used,
            fortran_order: false,
            start: skip,
            rows: held / row,
            next: 0,
            codes,
            scale,
            chunk: Vec::new(),
        };
        Ok((source, notes))
    }

    /// An NPY array with columns or a scale that its side-car gives.
    ///
    /// # Errors
    /// An array that is no such one.
    pub(super) fn open_npy(
        path: &Path,
        mut file: File,
        length: Option<u64>,
        codes: Codes,
        keys: &BenchKeys,
    ) -> Result<(Self, Vec<String>)> {
        let refuse = |message: String| {
            InputError::new(format!("this capture cannot be used: {message}"))
                .in_file(path)
                .help("save an array of shape (n, k), little-endian: int16, int32, float32 or float64")
        };
        let failed = |e: std::io::Error| io_error(path, "read the capture", &e);
        let Some(length) = length else {
            return Err(refuse("an NPY capture must be a regular file".into()).into());
        };
        file.rewind().map_err(failed)?;
        let header = Header::read(&mut file).map_err(|e| match e {
            HeaderError::Io(e) => failed(e),
            HeaderError::Wrong(message) => refuse(message).into(),
        })?;
        let item = Item::named(&header.descr)
            .filter(|_| header.descr.starts_with(['<', '>']))
            .ok_or_else(|| {
                let shown = header.descr.escape_debug();
                let mut error = refuse(format!("its items are `{shown}`"));
                error.help = error
                    .help
                    .map(|help| super::capture_npy::item_help(&header.descr, &help));
                error
            })?;
        let [rows, channels @ 2..=64] = header.shape[..] else {
            let message = format!("its shape is {:?}, not (n, 2) or (n, k)", header.shape);
            return Err(refuse(message).into());
        };
        let needed = u128::from(rows) * u128::from(channels) * item.bytes as u128;
        let held = u128::from(length.saturating_sub(header.bytes));
        if held != needed {
            let message = format!("{rows} rows need {needed} bytes, and the file holds {held}");
            return Err(refuse(message).into());
        }
        let channels = channels as usize;
        let used = keys.numbered(channels).map_err(refuse)?;
        let mut notes = vec![format!(
            "of {channels} columns of `{}` the drive is {}, the sense {}",
            header.descr, used[0], used[1]
        )];
        let scale = scale(path, item, keys, &mut notes)?;
        let source = RawSource {
            path: path.to_path_buf(),
            file,
            item,
            channels,
            used,
            fortran_order: header.fortran_order,
            start: header.bytes,
            rows,
            next: 0,
            codes,
            scale,
            chunk: Vec::new(),
        };
        Ok((source, notes))
    }

    /// Rows in the file.
    pub(super) fn rows(&self) -> u64 {
        self.rows
    }

    /// Appends up to `max_rows` rows; fewer = the end, or the error that follows them.
    pub(super) fn read(
        &mut self,
        drive: &mut Vec<i32>,
        sense: &mut Vec<i32>,
        max_rows: usize,
    ) -> Result<()> {
        let row = self.channels * self.item.bytes;
        while drive.len() < max_rows && self.next < self.rows {
            let left = usize::try_from(self.rows - self.next).unwrap_or(usize::MAX);
            let count = (CHUNK_BYTES / row)
                .max(1)
                .min(max_rows - drive.len())
                .min(left);
            let had = drive.len();
            let mut wrong: Option<(usize, usize, String)> = None;
            for (k, column) in [&mut *drive, &mut *sense].into_iter().enumerate() {
                let (first, stride, at) = if self.fortran_order {
                    let place = self.used[k] as u64 * self.rows + self.next;
                    (0, self.item.bytes, place * self.item.bytes as u64)
                } else {
                    (self.used[k] * self.item.bytes, row, self.next * row as u64)
                };
                // Of interleaved rows the chunk that the drive was in holds the sense too.
                if k == 0 || self.fortran_order {
                    self.fill(self.start + at, count * stride)?;
                }
                for (i, bytes) in self.chunk.chunks_exact(stride).enumerate() {
                    let item = bytes.get(first..first + self.item.bytes).unwrap_or(&[]);
                    match self.code(item) {
                        Ok(code) => column.push(code),
                        Err(shown) => {
                            if wrong.as_ref().is_none_or(|w| i < w.0) {
                                wrong = Some((i, k, shown));
                            }
                            break;
                        }
                    }
                }
            }
            if let Some((i, k, shown)) = wrong {
                drive.truncate(had + i);
                sense.truncate(had + i);
                let mut error = self.codes.refuse(&shown, COLUMNS[k]);
                let row = self.next + i as u64;
                error.message = format!(
                    "row {row}, column {} (from 0): {}",
                    self.used[k], error.message
                );
                return Err(error.in_file(&self.path).into());
            }
            self.next += count as u64;
        }
        Ok(())
    }

    fn fill(&mut self, at: u64, bytes: usize) -> Result<()> {
        self.chunk.resize(bytes, 0);
        let (file, chunk) = (&mut self.file, &mut self.chunk);
        file.seek(SeekFrom::Start(at))
            .and_then(|_| file.read_exact(chunk))
            .map_err(|e| io_error(&self.path, "read the capture", &e))
    }

    /// The code of an item's bytes; for one that is none how it is shown.
    fn code(&self, bytes: &[u8]) -> std::result::Result<i32, String> {
        let mut low = [0u8; 8];
        for (to, from) in low.iter_mut().zip(bytes) {
            *to = *from;
        }
        if self.item.big_endian {
            low[..bytes.len().min(8)].reverse();
        }
        let whole = i64::from_le_bytes(low);
        let (code, shown) = match (self.item.real, self.item.bytes) {
            (false, 2) => (Some(i32::from(whole as i16)), None),
            (false, _) => (Some(whole as i32), None),
            (true, bytes) => {
                let volts = match bytes {
                    4 => f64::from(f32::from_bits(whole as u32)),
                    _ => f64::from_bits(whole as u64),
                };
                (self.scale.and_then(|s| s.code(volts)), Some(volts))
            }
        };
        let shown = || match (shown, code) {
            (Some(volts), Some(code)) => format!("{volts} V (code {code})"),
            (Some(volts), None) => format!("{volts} V"),
            (None, code) => code.unwrap_or(0).to_string(),
        };
        code.filter(|c| (self.codes.min..=self.codes.max).contains(c))
            .ok_or_else(shown)
    }
}

/// The scale of real items; integers are codes.
fn scale(
    path: &Path,
    item: Item,
    keys: &BenchKeys,
    notes: &mut Vec<String>,
) -> Result<Option<Scale>> {
    match (item.real, keys.scale()) {
        (true, None) => Err(InputError::new(
            "its items are real numbers, and nothing says what a code is",
        )
        .in_file(path)
        .help(format!(
            "write `volts_per_code = 0.0001` (the ADC's volts for one code) into {} beside it",
            sidecar_name(path)
        ))
        .into()),
        (true, Some(scale)) => {
            notes.push(format!(
                "a code is {:e} V, code 0 at {} V; the nearest code is taken",
                scale.volts_per_code, scale.volts_at_code_0
            ));
            Ok(Some(scale))
        }
        (false, Some(_)) => {
            notes.push(
                "its items are integers, and are the codes: `volts_per_code` is not used"
                    .to_owned(),
            );
            Ok(None)
        }
        (false, None) => Ok(None),
    }
}
