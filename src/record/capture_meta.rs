//! What a capture says of itself: the comment lines `# key = value` of a CSV file, or the side-car
//! TOML of an NPY file (`docs/manual.md`, "Replay and captures").

use super::bench_keys::{BenchKeys, KeyValue};
use super::capture_places::Places;
use crate::base_name::name_of;
use crate::error::{InputError, Result, io_error};
use crate::input::in_any_case;
use std::io::Read;
use std::path::{Path, PathBuf};
use toml::de::{DeTable, DeValue};

/// A side-car larger than this is none.
const MAX_SIDECAR_BYTES: u64 = 1 << 20;

/// What a capture says of itself. `None` = the key is missing (or, for a real, empty or `nan`).
#[derive(Debug, Clone, Default, PartialEq)]
pub struct CaptureMeta {
    /// `fs_hz`: ADC sample rate, Hz; positive.
    pub fs_hz: Option<f64>,
    /// `ftw`: the NCO's tuning word for a 32-bit accumulator; the tone is at ftw * fs / 2^32.
    pub ftw: Option<u32>,
    /// `adc_bits`: 1 ..= 64.
    pub adc_bits: Option<u32>,
    /// `drive_amplitude_codes`: amplitude of the drive tone, codes.
    pub drive_amplitude_codes: Option<f64>,
    /// `sense_codes_per_dps`: sense amplitude per applied rate, codes per deg/s.
    pub sense_codes_per_dps: Option<f64>,
    /// `sense_phase_rad`: phase of the sense carrier, rad.
    pub sense_phase_rad: Option<f64>,
    /// `rate_dps`: the applied rate, deg/s.
    pub rate_dps: Option<f64>,
}

/// The value of a key, before its type is checked.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Value {
    /// A whole number.
    Integer(i128),
    /// Any other number; `nan` counts as missing.
    Real(f64),
    /// Nothing stands there.
    Empty,
    /// No number; how it is called in a message.
    Other(String),
}

impl Value {
    /// Reads the value of a comment line: `[+-]?[0-9]+`, a real, or nothing.
    pub(super) fn of_text(text: &str) -> Value {
        let digits = text.strip_prefix(['-', '+']).unwrap_or(text);
        if text.is_empty() {
            return Value::Empty;
        }
        if !digits.is_empty()
            && digits.bytes().all(|b| b.is_ascii_digit())
            && let Ok(v) = text.parse()
        {
            return Value::Integer(v);
        }
        match text.parse() {
            Ok(v) => Value::Real(v),
            Err(_) => Value::Other(format!("`{text}`")),
        }
    }

    /// Reads a TOML value; anything but a number is `Other`.
    fn of_toml(value: &DeValue<'_>) -> Value {
        let parsed = match value {
            DeValue::Integer(i) => match i128::from_str_radix(i.as_str(), i.radix()) {
                Ok(v) => Some(Value::Integer(v)),
                Err(_) => return Value::Other(format!("`{i}`")),
            },
            DeValue::Float(x) => x.as_str().parse().ok().map(Value::Real),
            _ => None,
        };
        parsed.unwrap_or_else(|| Value::Other(format!("a TOML {}", value.type_str())))
    }

    /// A finite real; a whole number counts.
    fn real(self) -> std::result::Result<Option<f64>, String> {
        match self {
            Value::Integer(v) => Ok(Some(v as f64)),
            Value::Real(v) if v.is_nan() => Ok(None),
            Value::Real(v) if v.is_finite() => Ok(Some(v)),
            Value::Real(v) => Err(format!("must be a finite number, and is {v}")),
            Value::Empty => Ok(None),
            Value::Other(what) => Err(format!("must be a number, and is {what}")),
        }
    }

    /// A whole number within `min ..= max`.
    fn integer(self, min: u32, max: u32) -> std::result::Result<Option<u32>, String> {
        let found = match self {
            Value::Integer(v) => match u32::try_from(v) {
                Ok(v) if (min..=max).contains(&v) => return Ok(Some(v)),
                _ => v.to_string(),
            },
            Value::Real(v) if v.is_nan() => return Ok(None),
            Value::Real(v) => format!("{v:?}"),
            Value::Empty => return Ok(None),
            Value::Other(what) => what,
        };
        Err(format!(
            "must be a whole number within {min} ..= {max}, and is {found}"
        ))
    }
}

impl CaptureMeta {
    /// The keys, as both kinds of file spell them.
    pub const KEYS: [&'static str; 7] = [
        "fs_hz",
        "ftw",
        "adc_bits",
        "drive_amplitude_codes",
        "sense_codes_per_dps",
        "sense_phase_rad",
        "rate_dps",
    ];

    /// Sets `key`; an unknown key changes nothing. The error says what the value must be.
    pub(super) fn set(&mut self, key: &str, value: Value) -> std::result::Result<(), String> {
        let outcome = match key {
            "fs_hz" => value.real().and_then(|v| match v {
                Some(hz) if hz <= 0.0 => Err(format!("must be positive, and is {hz}")),
                _ => {
                    self.fs_hz = v;
                    Ok(())
                }
            }),
            "ftw" => value.integer(0, u32::MAX).map(|v| self.ftw = v),
            "adc_bits" => value.integer(1, 64).map(|v| self.adc_bits = v),
            "drive_amplitude_codes" => value.real().map(|v| self.drive_amplitude_codes = v),
            "sense_codes_per_dps" => value.real().map(|v| self.sense_codes_per_dps = v),
            "sense_phase_rad" => value.real().map(|v| self.sense_phase_rad = v),
            "rate_dps" => value.real().map(|v| self.rate_dps = v),
            _ => Ok(()),
        };
        outcome.map_err(|problem| format!("`{key}` {problem}"))
    }

    /// Reads the side-car of a capture: the TOML file of the same stem, keys at top level; with those that say
    /// what a bench wrote. No such file = nothing is known; other keys are ignored. A file that is no TOML, or a key
    /// with the wrong type, is refused with its line, and so are two files whose extensions differ in case alone.
    pub(super) fn of_sidecar(
        capture: &Path,
        places: &mut Places,
    ) -> Result<(CaptureMeta, BenchKeys)> {
        let mut meta = CaptureMeta::default();
        let mut keys = BenchKeys::default();
        let mut found = in_any_case(&sidecar_of(capture));
        found.retain(|path| path != capture);
        if let [one, other, ..] = found.as_slice() {
            let [one, other] = [one, other].map(|p| name_of(p));
            return Err(InputError::new(format!(
                "this capture has two side-cars: {one} and {other}"
            ))
            .in_file(capture)
            .help("keep the one whose keys are right, and rename or remove the other")
            .into());
        }
        let Some(path) = found.pop() else {
            return Ok((meta, keys));
        };
        let Some(text) = read_sidecar(&path)? else {
            return Ok((meta, keys));
        };
        let help = "the side-car holds `key = value` lines such as `fs_hz = 224000.0`; correct it \
                    or take it away (it is optional for `replay`)";
        let refuse = |offset: usize, message: String| {
            InputError::new(message)
                .in_file(&path)
                .at_offset(&text, offset)
                .help(help)
        };
        let table = DeTable::parse(&text).map_err(|e| {
            let offset = e.span().map_or(0, |s| s.start);
            refuse(offset, format!("no valid TOML: {}", e.message()))
        })?;
        for (key, value) in table.get_ref() {
            places.keep(
                key.get_ref(),
                refuse(value.span().start, String::new()).position(),
            );
            meta.set(key.get_ref(), Value::of_toml(value.get_ref()))
                .and_then(|()| keys.set(key.get_ref(), &KeyValue::of_toml(value.get_ref())))
                .map_err(|problem| refuse(value.span().start, problem))?;
        }
        Ok((meta, keys))
    }

    /// These, and what only `other` says.
    pub(super) fn or(self, other: CaptureMeta) -> CaptureMeta {
        CaptureMeta {
            fs_hz: self.fs_hz.or(other.fs_hz),
            ftw: self.ftw.or(other.ftw),
            adc_bits: self.adc_bits.or(other.adc_bits),
            drive_amplitude_codes: self.drive_amplitude_codes.or(other.drive_amplitude_codes),
            sense_codes_per_dps: self.sense_codes_per_dps.or(other.sense_codes_per_dps),
            sense_phase_rad: self.sense_phase_rad.or(other.sense_phase_rad),
            rate_dps: self.rate_dps.or(other.rate_dps),
        }
    }
}

/// The side-car's path: the capture's with `.toml` in place of its extension (`scope.csv.gz` has `scope.toml`).
pub(super) fn sidecar_of(capture: &Path) -> PathBuf {
    let is_packed = capture
        .extension()
        .is_some_and(|e| e.eq_ignore_ascii_case("gz") || e.eq_ignore_ascii_case("zst"));
    match is_packed {
        true => capture.with_extension("").with_extension("toml"),
        false => capture.with_extension("toml"),
    }
}

/// The name of a capture's side-car.
pub(super) fn sidecar_name(path: &Path) -> String {
    let name = sidecar_of(path);
    name.file_name()
        .map_or(String::new(), |n| n.to_string_lossy().into_owned())
}

/// The text of a side-car, `None` if there is no such file.
fn read_sidecar(path: &Path) -> Result<Option<String>> {
    let failed = |e: std::io::Error| io_error(path, "read the capture's side-car", &e);
    let file = match std::fs::File::open(path) {
        Ok(file) => file,
        Err(e) if e.kind() == std::io::ErrorKind::NotFound => return Ok(None),
        Err(e) => return Err(failed(e)),
    };
    let mut bytes = Vec::new();
    file.take(MAX_SIDECAR_BYTES + 1)
        .read_to_end(&mut bytes)
        .map_err(failed)?;
    let refuse = |message: &str| {
        InputError::new(message)
            .in_file(path)
            .help("a side-car is a short TOML file in UTF-8; correct it or take it away")
    };
    if bytes.len() as u64 > MAX_SIDECAR_BYTES {
        return Err(refuse("the side-car is larger than 1 MiB").into());
    }
    match String::from_utf8(bytes) {
        Ok(text) => Ok(Some(text)),
        Err(e) => {
            let valid = String::from_utf8_lossy(&e.as_bytes()[..e.utf8_error().valid_up_to()]);
            Err(refuse("the side-car is no UTF-8")
                .at_offset(&valid, valid.len())
                .into())
        }
    }
}

/// The relative difference up to which two frequencies are taken as the same: some thousand times
/// the error of the double arithmetic here, and a hundred times less than what one LSB of a 32-bit
/// tuning word makes anywhere.
pub const FREQUENCY_TOLERANCE: f64 = 1e-12;

/// One warning for each of `fs_hz`, `ftw`, `adc_bits` in which a capture and a design differ; a
/// missing key warns of nothing. The design counts, so nothing is refused.
///
/// `sample_rate_hz` is the design's, Hz; `tuning_word` is (word modulo 2^w, w in bits). `ftw` is
/// compared as a frequency, ftw * fs_hz / 2^32 against word * sample_rate_hz / 2^w (with the
/// design's sample rate where the capture does not say its own), both frequencies and sample rates
/// within [`FREQUENCY_TOLERANCE`].
pub fn mismatch_warnings(
    meta: &CaptureMeta,
    sample_rate_hz: f64,
    tuning_word: (u128, u32),
    adc_bits: u32,
) -> Vec<String> {
    let differ = |a: f64, b: f64| (a - b).abs() > FREQUENCY_TOLERANCE * f64::max(a.abs(), b.abs());
    let mut warnings = Vec::new();
    if let Some(fs) = meta.fs_hz.filter(|&fs| differ(fs, sample_rate_hz)) {
        warnings.push(format!(
            "`fs_hz`: the capture says {fs} Hz, the design's sample rate is {sample_rate_hz} Hz; \
             the design's is used"
        ));
    }
    if let Some(ftw) = meta.ftw {
        let (word, bits) = tuning_word;
        let fs = meta.fs_hz.unwrap_or(sample_rate_hz);
        let captured = f64::from(ftw) * fs / 2f64.powi(32);
        let designed = word as f64 * sample_rate_hz / 2f64.powi(bits as i32);
        if differ(captured, designed) {
            warnings.push(format!(
                "`ftw`: the capture's drive tone is at {captured} Hz (tuning word {ftw} of 32 \
                 bits), the design's at {designed} Hz (tuning word {word} of {bits} bits); the \
                 design's is used"
            ));
        }
    }
    if let Some(bits) = meta.adc_bits.filter(|&bits| bits != adc_bits) {
        warnings.push(format!(
            "`adc_bits`: the capture says {bits} bits, the design's ADC has {adc_bits}; the \
             design's is used"
        ));
    }
    warnings
}

#[cfg(test)]
mod tests {
    use super::*;

    fn meta(fs_hz: Option<f64>, ftw: Option<u32>, adc_bits: Option<u32>) -> CaptureMeta {
        CaptureMeta {
            fs_hz,
            ftw,
            adc_bits,
            ..CaptureMeta::default()
        }
    }

    #[test]
    fn a_warning_names_each_key_that_differs_and_no_other() {
        let design = (224000.0, (33554432u128, 32u32), 16);
        for (capture, keys) in [
            (meta(None, None, None), vec![]),
            (meta(Some(224000.0), Some(33554432), Some(16)), vec![]),
            (meta(None, Some(33554432), None), vec![]),
            (meta(None, Some(33554433), None), vec!["`ftw`"]),
            // The same tone at another sample rate.
            (meta(Some(448000.0), Some(16777216), None), vec!["`fs_hz`"]),
            (
                meta(Some(112000.0), Some(33554432), Some(12)),
                vec!["`fs_hz`", "`ftw`", "`adc_bits`"],
            ),
        ] {
            let found = mismatch_warnings(&capture, design.0, design.1, design.2);
            let named: Vec<_> = found.iter().map(|w| w.split(':').next().unwrap()).collect();
            assert_eq!(named, keys, "{capture:?}");
        }
        // One LSB of 32 bits is seen at the top of the range, and accumulators of any width agree.
        let top = meta(None, Some(u32::MAX), None);
        let warn = |word, bits| mismatch_warnings(&top, 1e5, (word, bits), 16).len();
        assert_eq!(warn(u128::from(u32::MAX - 1), 32), 1);
        assert_eq!(warn(u128::from(u32::MAX) << 32, 64), 0);
        assert_eq!(warn((u128::from(u32::MAX) << 32) + (1 << 24), 64), 0);
        assert_eq!(warn((u128::from(u32::MAX) << 16) + 1024, 48), 1);
    }

    #[test]
    fn the_value_of_a_comment_is_a_number_or_named() {
        for (text, value) in [
            ("224000", Value::Integer(224000)),
            ("-5", Value::Integer(-5)),
            ("224000.", Value::Real(224000.0)),
            ("1e5", Value::Real(1e5)),
            ("", Value::Empty),
            ("12 kHz", Value::Other("`12 kHz`".into())),
            ("0x20", Value::Other("`0x20`".into())),
        ] {
            assert_eq!(Value::of_text(text), value);
        }
        assert!(matches!(Value::of_text(&"9".repeat(60)), Value::Real(_)));
    }
}
