//! What a capture from a bench says of its form: which column is which, what a code is in volts, what raw samples are.
//!
//! The keys stand where a capture's others do: comment lines before the header of a CSV file, or the TOML file of the
//! same stem. A capture in the form of `docs/manual.md`, "Replay and captures", needs none of them.

use toml::de::DeValue;

/// Most channels that a raw or NPY capture may interleave.
const MOST_CHANNELS: u64 = 64;

/// A column, as a user names it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum Column {
    /// By its name in the header.
    Name(String),
    /// By its place, from 0.
    Number(usize),
}

/// What one sample is in a raw or NPY file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Item {
    /// Bytes: 2, 4 or 8.
    pub bytes: usize,
    /// An IEEE number, not an integer.
    pub real: bool,
    /// Highest byte first.
    pub big_endian: bool,
}

impl Item {
    /// By numpy's name or by the usual one; `None` for one that is not read.
    pub(super) fn named(name: &str) -> Option<Item> {
        let (bytes, real, big_endian) = match name {
            "<i2" | "int16" | "int16_le" | "i16" => (2, false, false),
            ">i2" | "int16_be" => (2, false, true),
            "<i4" | "int32" | "int32_le" | "i32" => (4, false, false),
            ">i4" | "int32_be" => (4, false, true),
            "<f4" | "float32" | "f32" => (4, true, false),
            "<f8" | "float64" | "f64" => (8, true, false),
            _ => return None,
        };
        Some(Item {
            bytes,
            real,
            big_endian,
        })
    }
}

/// The keys; `None` = not given.
#[derive(Debug, Clone, Default, PartialEq)]
pub(super) struct BenchKeys {
    /// `drive_column` and `sense_column`.
    pub columns: [Option<Column>; 2],
    /// `volts_per_code`: volts that one code is, V; not 0, negative where the ADC inverts.
    pub volts_per_code: Option<f64>,
    /// `volts_at_code_0`: volts of code 0, V.
    pub volts_at_code_0: Option<f64>,
    /// `item`: what a sample of a raw file is.
    pub item: Option<Item>,
    /// `channels`: how many a raw file interleaves.
    pub channels: Option<usize>,
    /// `skip_bytes`: bytes before a raw file's first sample.
    pub skip_bytes: Option<u64>,
}

/// The value of a key before it is checked.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum KeyValue {
    Text(String),
    Integer(i64),
    Real(f64),
    /// Neither; how it is called in a message.
    Other(String),
}

impl KeyValue {
    /// Of a comment line: a whole number, a real, or a text with or without quotes.
    pub(super) fn of_text(text: &str) -> KeyValue {
        if let Ok(whole) = text.parse() {
            return KeyValue::Integer(whole);
        }
        if let Ok(real) = text.parse() {
            return KeyValue::Real(real);
        }
        let inner = text.strip_prefix('"').and_then(|t| t.strip_suffix('"'));
        KeyValue::Text(inner.unwrap_or(text).to_owned())
    }

    /// Of a TOML file.
    pub(super) fn of_toml(value: &DeValue<'_>) -> KeyValue {
        match value {
            DeValue::String(text) => KeyValue::Text(text.to_string()),
            DeValue::Integer(i) => match i64::from_str_radix(i.as_str(), i.radix()) {
                Ok(whole) => KeyValue::Integer(whole),
                Err(_) => KeyValue::Other(format!("`{i}`")),
            },
            DeValue::Float(x) => match x.as_str().parse() {
                Ok(real) => KeyValue::Real(real),
                Err(_) => KeyValue::Other(format!("`{}`", x.as_str())),
            },
            other => KeyValue::Other(format!("a TOML {}", other.type_str())),
        }
    }

    fn shown(&self) -> String {
        match self {
            KeyValue::Text(text) => format!("`{text}`"),
            KeyValue::Integer(v) => v.to_string(),
            KeyValue::Real(v) => format!("{v:?}"),
            KeyValue::Other(what) => what.clone(),
        }
    }

    /// A finite real; a whole number counts.
    fn real(&self) -> Result<f64, String> {
        match self {
            KeyValue::Integer(v) => Ok(*v as f64),
            KeyValue::Real(v) if v.is_finite() => Ok(*v),
            _ => Err(format!("must be a finite number, and is {}", self.shown())),
        }
    }

    fn whole(&self, most: u64) -> Result<u64, String> {
        match self {
            KeyValue::Integer(v) => u64::try_from(*v).ok().filter(|v| *v <= most),
            _ => None,
        }
        .ok_or_else(|| {
            format!(
                "must be a whole number up to {most}, and is {}",
                self.shown()
            )
        })
    }
}

impl BenchKeys {
    /// The keys as they are spelt.
    pub(super) const KEYS: [&'static str; 7] = [
        "drive_column",
        "sense_column",
        "volts_per_code",
        "volts_at_code_0",
        "item",
        "channels",
        "skip_bytes",
    ];

    /// Sets `key`; one that is none of [`Self::KEYS`] changes nothing. The error says what its value must be.
    pub(super) fn set(&mut self, key: &str, value: &KeyValue) -> Result<(), String> {
        let set = match key {
            "drive_column" => column(value).map(|c| self.columns[0] = Some(c)),
            "sense_column" => column(value).map(|c| self.columns[1] = Some(c)),
            "volts_per_code" => value.real().and_then(|v| {
                // Below: no ADC, and a quotient that need not be finite.
                if v.abs() < 1e-15 || v.abs() > 1e6 {
                    return Err(format!("must be volts a code, 1e-15 to 1e6, and is {v}"));
                }
                self.volts_per_code = Some(v);
                Ok(())
            }),
            "volts_at_code_0" => value.real().map(|v| self.volts_at_code_0 = Some(v)),
            "item" => match value {
                KeyValue::Text(name) => Item::named(name),
                _ => None,
            }
            .ok_or_else(|| {
                format!(
                    "must be \"int16\", \"int32\", \"int16_be\", \"int32_be\", \"float32\" or \"float64\", and is {}",
                    value.shown()
                )
            })
            .map(|item| self.item = Some(item)),
            "channels" => value.whole(MOST_CHANNELS).and_then(|n| {
                if n < 2 {
                    return Err(format!("must be 2 or more, and is {n}"));
                }
                self.channels = Some(n as usize);
                Ok(())
            }),
            "skip_bytes" => value.whole(1 << 40).map(|n| self.skip_bytes = Some(n)),
            _ => Ok(()),
        };
        set.map_err(|problem| format!("`{key}` {problem}"))
    }

    /// These, and what only `other` says.
    pub(super) fn or(self, other: BenchKeys) -> BenchKeys {
        let [drive, sense] = self.columns;
        let [other_drive, other_sense] = other.columns;
        BenchKeys {
            columns: [drive.or(other_drive), sense.or(other_sense)],
            volts_per_code: self.volts_per_code.or(other.volts_per_code),
            volts_at_code_0: self.volts_at_code_0.or(other.volts_at_code_0),
            item: self.item.or(other.item),
            channels: self.channels.or(other.channels),
            skip_bytes: self.skip_bytes.or(other.skip_bytes),
        }
    }

    /// What makes codes of volts, where the scale is given.
    pub(super) fn scale(&self) -> Option<Scale> {
        Some(Scale {
            volts_per_code: self.volts_per_code?,
            volts_at_code_0: self.volts_at_code_0.unwrap_or(0.0),
        })
    }

    /// The places of both columns among `count` that have no names, the first two where nothing is said; an error
    /// says what is wrong.
    pub(super) fn numbered(&self, count: usize) -> Result<[usize; 2], String> {
        let mut out = [0, 1];
        for ((place, column), key) in out.iter_mut().zip(&self.columns).zip(Self::KEYS) {
            match column {
                None => {}
                Some(Column::Number(n)) if *n < count => *place = *n,
                Some(Column::Number(n)) => {
                    return Err(format!(
                        "`{key}` is {n}, and its {count} channels are 0 to {}",
                        count - 1
                    ));
                }
                Some(Column::Name(name)) => {
                    return Err(format!(
                        "`{key}` is \"{name}\", and its channels have numbers, from 0"
                    ));
                }
            }
        }
        if out[0] == out[1] {
            return Err(format!(
                "drive and sense are both its channel {}; say `drive_column` and `sense_column`",
                out[0]
            ));
        }
        Ok(out)
    }
}

fn column(value: &KeyValue) -> Result<Column, String> {
    match value {
        KeyValue::Text(name) if !name.is_empty() => Ok(Column::Name(name.clone())),
        KeyValue::Integer(n) if (0..1 << 16).contains(n) => Ok(Column::Number(*n as usize)),
        _ => Err(format!(
            "must be a column's name, or its number from 0, and is {}",
            value.shown()
        )),
    }
}

/// Codes of volts: the nearest, ties toward plus infinity.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Scale {
    /// V.
    pub volts_per_code: f64,
    /// V.
    pub volts_at_code_0: f64,
}

impl Scale {
    /// The code that stands for a voltage, V, not yet rounded.
    pub(super) fn unrounded(self, volts: f64) -> f64 {
        (volts - self.volts_at_code_0) / self.volts_per_code
    }

    /// The nearest code; `None` beyond 32 bits or for what is no number.
    pub(super) fn code(self, volts: f64) -> Option<i32> {
        let code = (self.unrounded(volts) + 0.5).floor();
        (f64::from(i32::MIN)..=f64::from(i32::MAX))
            .contains(&code)
            .then_some(code as i32)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_key_is_what_it_must_be_or_named() {
        let mut keys = BenchKeys::default();
        for (key, text) in [
            ("drive_column", "CH1"),
            ("sense_column", "2"),
            ("volts_per_code", "-1e-4"),
            ("volts_at_code_0", "1"),
            ("item", "int16"),
            ("channels", "4"),
            ("skip_bytes", "512"),
        ] {
            keys.set(key, &KeyValue::of_text(text)).unwrap();
        }
        assert_eq!(
            keys.columns,
            [Some(Column::Name("CH1".into())), Some(Column::Number(2))]
        );
        assert_eq!(keys.scale().unwrap().code(0.99994), Some(1));
        for (key, text) in [
            ("drive_column", "-1"),
            ("volts_per_code", "0"),
            ("volts_per_code", "nan"),
            ("volts_at_code_0", "CH1"),
            ("item", "int24"),
            ("item", "16"),
            ("channels", "1"),
            ("skip_bytes", "-4"),
        ] {
            let problem = keys.set(key, &KeyValue::of_text(text)).unwrap_err();
            assert!(
                problem.starts_with(&format!("`{key}` must be")),
                "{problem}"
            );
        }
    }

    #[test]
    fn the_nearest_code_is_taken_and_none_beyond_32_bits() {
        let scale = Scale {
            volts_per_code: 0.5,
            volts_at_code_0: 1.0,
        };
        for (volts, code) in [
            (1.0, Some(0)),
            (1.25, Some(1)),
            (0.75, Some(0)),
            (0.7, Some(-1)),
            (1e10, None),
            (f64::NAN, None),
        ] {
            assert_eq!(scale.code(volts), code, "{volts}");
        }
    }
}
