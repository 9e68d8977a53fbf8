//! The capture as the closure uses it: codes of both channels, the keys, the segments of rows.

use crate::error::{InputError, Result};
use crate::numeric::format::Format;
use crate::record::Warning;
use crate::record::capture::{CaptureMeta, CaptureReader};
use crate::record::capture_places::Places;
use std::path::Path;

/// Rows that are used at most; a longer capture says so.
pub const MOST_ROWS: usize = 10_000_000;
/// Rows without which nothing can be said.
pub const LEAST_ROWS: usize = 256;
/// Segments of equal length.
const SEGMENTS: usize = 24;
/// Segments that are held out: a quarter, at uneven distances, never the first nor the last.
const HELD_OUT: [usize; 6] = [2, 5, 10, 14, 17, 21];
/// Groups of training segments, for the half-samples.
pub const GROUPS: usize = 4;

/// What a segment of rows is for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Part {
    /// To fit on, with the number of its group.
    Train(usize),
    /// To judge on.
    HeldOut,
}

/// A stretch of rows.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Segment {
    /// First row, and the one after the last.
    pub rows: std::ops::Range<usize>,
    /// Its use.
    pub part: Part,
}

/// A capture in memory.
#[derive(Debug, Clone)]
pub struct Capture {
    /// Drive and sense codes.
    pub codes: [Vec<i32>; 2],
    /// The keys.
    pub meta: CaptureMeta,
    /// In the order of the rows.
    pub segments: Vec<Segment>,
    /// 2^(adc_bits - 1), codes.
    pub full_scale_codes: f64,
    /// By row: a wrong code, or a sample that was lost. Empty: none is.
    pub left_out: Vec<bool>,
    /// Where keys and columns stand.
    pub places: Places,
}

impl Capture {
    /// From codes of equal lengths and the keys; `adc_bits` holds where the keys do not say it.
    ///
    /// # Errors
    /// Fewer rows than [`LEAST_ROWS`].
    pub fn new(codes: [Vec<i32>; 2], meta: CaptureMeta, adc_bits: u32) -> Result<Self> {
        let rows = codes.iter().map(Vec::len).min().unwrap_or(0);
        if rows < LEAST_ROWS {
            return Err(InputError::new(format!(
                "the capture has {rows} rows, and {LEAST_ROWS} are the least to judge it by"
            ))
            .help("capture some thousand rows or more")
            .into());
        }
        let bits = meta.adc_bits.unwrap_or(adc_bits).clamp(2, 32);
        Ok(Capture {
            codes,
            segments: segments(rows),
            full_scale_codes: f64::powi(2.0, bits as i32 - 1),
            meta,
            left_out: Vec::new(),
            places: Places::default(),
        })
    }

    /// The same with other codes of equal lengths and other rows left out: [`Capture::left_out`].
    pub fn with_rows(&self, codes: [Vec<i32>; 2], left_out: Vec<bool>) -> Self {
        let rows = codes.iter().map(Vec::len).min().unwrap_or(0);
        Capture {
            codes,
            segments: segments(rows),
            left_out,
            meta: self.meta.clone(),
            places: self.places.clone(),
            full_scale_codes: self.full_scale_codes,
        }
    }

    /// Whether a row is left out of all fits and errors.
    #[inline]
    pub fn is_left_out(&self, row: usize) -> bool {
        self.left_out.get(row).copied().unwrap_or(false)
    }

    /// The codes of a channel that are not left out.
    pub fn used_codes(&self, channel: usize) -> impl Iterator<Item = i32> + '_ {
        let codes = self.codes[channel].iter().enumerate();
        codes
            .filter(|(row, _)| !self.is_left_out(*row))
            .map(|(_, code)| *code)
    }

    /// Number of rows that are not left out.
    pub fn used_rows(&self) -> usize {
        self.used_of(0..self.rows())
    }

    fn used_of(&self, rows: std::ops::Range<usize>) -> usize {
        let out = self.left_out.get(rows.clone()).unwrap_or_default();
        rows.len() - out.iter().filter(|out| **out).count()
    }

    /// Number of rows.
    pub fn rows(&self) -> usize {
        self.segments.last().map_or(0, |s| s.rows.end)
    }

    /// Number of training rows that are not left out.
    pub fn training_rows(&self) -> usize {
        let train = |s: &&Segment| s.part != Part::HeldOut;
        let segments = self.segments.iter().filter(train);
        segments.map(|s| self.used_of(s.rows.clone())).sum()
    }
}

fn segments(rows: usize) -> Vec<Segment> {
    let mut group = 0;
    (0..SEGMENTS)
        .map(|k| {
            let part = if HELD_OUT.contains(&k) {
                Part::HeldOut
            } else {
                group += 1;
                Part::Train(group % GROUPS)
            };
            Segment {
                rows: k * rows / SEGMENTS..(k + 1) * rows / SEGMENTS,
                part,
            }
        })
        .collect()
}

/// Reads a capture: at most [`MOST_ROWS`] rows. Codes must fit `adc_bits` of its own keys, where
/// these say it. `adc_bits` is the design's.
///
/// # Errors
/// What [`CaptureReader`] refuses; too few rows.
pub fn read(path: &Path, adc_bits: u32) -> Result<(Capture, Vec<Warning>)> {
    let widest = Format::q(1, 31);
    let own = CaptureReader::open(path, widest)?.meta().adc_bits;
    let format = match own {
        Some(bits @ 2..=31) => Format::q(1, bits - 1),
        _ => widest,
    };
    let mut reader = CaptureReader::open(path, format)?;
    let (meta, places) = (reader.meta().clone(), reader.places().clone());
    let mut codes = [Vec::new(), Vec::new()];
    let (mut drive, mut sense) = (Vec::new(), Vec::new());
    let mut warnings = Vec::new();
    if !reader.notes().is_empty() {
        warnings.push(Warning::general("capture_form", reader.notes().join("; ")));
    }
    while reader.read_block(&mut drive, &mut sense, 1 << 16)? > 0 {
        let [d, s] = &mut codes;
        let room = MOST_ROWS - d.len();
        d.extend(drive.iter().take(room));
        s.extend(sense.iter().take(room));
        if drive.len() > room {
            warnings.push(Warning::general(
                "capture_cut",
                format!("only the first {MOST_ROWS} rows are used"),
            ));
            break;
        }
    }
    let mut capture = Capture::new(codes, meta, adc_bits).map_err(|e| match e {
        crate::error::Error::Input(e) => (*e).in_file(path).into(),
        other => other,
    })?;
    capture.places = places;
    Ok((capture, warnings))
}
