//! Random captures, and the files that hold them.

use std::f64::consts::TAU;

use super::design::Design;
use super::number::Format;
use crate::rng::Rng;

/// Most samples of a random capture.
const LONGEST: i64 = 6000;

/// Number of samples: some whole periods, with or without a rest.
fn length(rng: &mut Rng, ratio: i64) -> i64 {
    let rows = rng.range(1, 24);
    let count = match rng.range(0, 19) {
        0 => 0,
        1 => rng.range(0, ratio - 1),
        2 => ratio - 1,
        3 => ratio,
        4..=9 => rows * ratio,
        _ => rows * ratio + rng.range(0, ratio - 1),
    };
    count.min(LONGEST)
}

/// Random `(drive, sense)` codes for a design, all within its ADC format.
pub fn random(rng: &mut Rng, design: &Design) -> Vec<(i64, i64)> {
    let count = length(rng, i64::from(design.ratio));
    let (least, greatest) = limits(design.adc);
    let step = design.nco.tuning_word as f64 * 2f64.powi(-(design.nco.phase_bits as i32));
    let channel = |rng: &mut Rng| -> Vec<i64> {
        let detuning = match rng.range(0, 2) {
            0 => 1.0,
            1 => 1.0 + 1e-3 * rng.signed_unit(),
            _ => 1.0 + 0.2 * rng.signed_unit(),
        };
        let start = rng.unit();
        let size = match rng.range(0, 3) {
            0 => 0.99,
            1 => 0.1 * rng.unit(),
            _ => rng.unit(),
        } * greatest as f64;
        let noise = 0.02 * rng.unit() * greatest as f64;
        let constant = rng
            .pick(&[least, greatest, 0, -1, 1])
            .clamp(least, greatest);
        let kind = rng.range(0, 9);
        // bursts of some decimated samples, in one channel of three
        let burst = rng.range(1, 6) * i64::from(design.ratio);
        let rest = if rng.chance(35) {
            0.1 * rng.unit()
        } else {
            1.0
        };
        (0..count)
            .map(|n| {
                let turn = (step * detuning * (n + 1) as f64 + start).fract();
                let tone = (TAU * turn).sin();
                let envelope = if n / burst % 2 == 0 { 1.0 } else { rest };
                let code = match kind {
                    0..=5 => (size * envelope * tone + noise * rng.signed_unit()).round() as i64,
                    6 => [least, greatest][usize::from(tone >= 0.0)],
                    7 => constant,
                    _ => rng.range(least, greatest),
                };
                code.clamp(least, greatest)
            })
            .collect()
    };
    let drive = channel(rng);
    let sense = channel(rng);
    drive.into_iter().zip(sense).collect()
}

fn limits(adc: Format) -> (i64, i64) {
    (adc.least() as i64, adc.greatest() as i64)
}

/// The shapes of a CSV capture that must read the same.
#[derive(Clone, Debug, Default)]
pub struct CsvStyle {
    pub bom: bool,
    pub crlf: bool,
    pub blanks: bool,
    pub swapped: bool,
    /// Names of other columns, and where they stand: 0 first, 1 middle, 2 last.
    pub extra: Vec<(&'static str, usize)>,
    pub comments: Vec<String>,
    /// Empty lines after the last row; without the last line end for `None`.
    pub empty_lines_at_end: Option<usize>,
    /// Numbers like `-0` and `007` now and then.
    pub odd_numbers: bool,
}

impl CsvStyle {
    /// A random style; the comments agree with nothing in particular.
    pub fn random(rng: &mut Rng) -> Self {
        let mut style = Self {
            bom: rng.chance(20),
            crlf: rng.chance(30),
            blanks: rng.chance(30),
            swapped: rng.chance(40),
            empty_lines_at_end: rng.pick(&[None, Some(0), Some(0), Some(1), Some(3)]),
            odd_numbers: rng.chance(20),
            ..Self::default()
        };
        if rng.chance(30) {
            style.extra.push(("die_degc", rng.bits(0, 2) as usize));
        }
        if rng.chance(15) {
            style.extra.push(("note", rng.bits(0, 2) as usize));
        }
        if rng.chance(40) {
            style.comments.push("# fs_hz = 224000.0".to_owned());
            style.comments.push("# ftw = 33554432".to_owned());
        }
        if rng.chance(30) {
            style.comments.push("# adc_bits = 16".to_owned());
            style.comments.push("# rate_dps = 12.5".to_owned());
        }
        style
    }

    /// The text of the file.
    pub fn print(&self, rng: &mut Rng, capture: &[(i64, i64)]) -> Vec<u8> {
        let end = if self.crlf { "\r\n" } else { "\n" };
        let mut names = vec!["drive_code", "sense_code"];
        if self.swapped {
            names.reverse();
        }
        for &(name, at) in &self.extra {
            names.insert(at.min(names.len()), name);
        }
        let mut lines: Vec<String> = self.comments.clone();
        lines.push(names.join(","));
        for &(drive, sense) in capture {
            let cells: Vec<String> = names
                .iter()
                .map(|&name| match name {
                    "drive_code" => self.number(rng, drive),
                    "sense_code" => self.number(rng, sense),
                    "note" => "ok".to_owned(),
                    _ => format!("{:.2}", 20.0 + rng.unit()),
                })
                .collect();
            lines.push(cells.join(","));
        }
        let mut text = String::new();
        if self.bom {
            text.push('\u{feff}');
        }
        text.push_str(&lines.join(end));
        if let Some(empty) = self.empty_lines_at_end {
            text.push_str(&end.repeat(empty + 1));
        }
        text.into_bytes()
    }

    fn number(&self, rng: &mut Rng, value: i64) -> String {
        let mut text = value.to_string();
        if self.odd_numbers && rng.chance(10) {
            let sign = if value < 0 || (value == 0 && rng.chance(50)) {
                "-"
            } else {
                ""
            };
            text = format!("{sign}00{}", value.unsigned_abs());
        }
        if self.blanks {
            let before = " ".repeat(rng.bits(0, 2) as usize);
            let after = rng.pick(&["", " ", "  ", "\t"]);
            text = format!("{before}{text}{after}");
        }
        text
    }
}

/// The shapes of an NPY capture that must read the same.
#[derive(Clone, Copy, Debug)]
pub struct NpyStyle {
    /// `<i4`, else `<i2`.
    pub wide: bool,
    pub fortran: bool,
    /// 1, 2 or 3.
    pub version: u8,
}

impl NpyStyle {
    /// A random style that holds the codes of `adc`.
    pub fn random(rng: &mut Rng, adc: Format) -> Self {
        Self {
            wide: adc.bits() > 16 || rng.chance(40),
            fortran: rng.chance(40),
            version: rng.bits(1, 3) as u8,
        }
    }

    /// The bytes of the file.
    pub fn print(&self, capture: &[(i64, i64)]) -> Vec<u8> {
        let descr = if self.wide { "<i4" } else { "<i2" };
        let order = if self.fortran { "True" } else { "False" };
        let shape = format!("({}, 2)", capture.len());
        let dictionary =
            format!("{{'descr': '{descr}', 'fortran_order': {order}, 'shape': {shape}, }}");
        let mut bytes = npy_header(self.version, &dictionary);
        let mut put = |code: i64| {
            let code = i32::try_from(code).expect("a code of at most 32 bits");
            if self.wide {
                bytes.extend(code.to_le_bytes());
            } else {
                bytes.extend((code as i16).to_le_bytes());
            }
        };
        if self.fortran {
            capture.iter().for_each(|&(drive, _)| put(drive));
            capture.iter().for_each(|&(_, sense)| put(sense));
        } else {
            capture.iter().for_each(|&(drive, sense)| {
                put(drive);
                put(sense);
            });
        }
        bytes
    }
}

/// Magic, version, length and dictionary, padded to whole 64 bytes.
pub fn npy_header(version: u8, dictionary: &str) -> Vec<u8> {
    let prefix = if version == 1 { 10 } else { 12 };
    let padding = (64 - (prefix + dictionary.len() + 1) % 64) % 64;
    let text = format!("{dictionary}{}\n", " ".repeat(padding));
    let mut bytes = b"\x93NUMPY".to_vec();
    bytes.extend([version, 0]);
    if version == 1 {
        bytes.extend((text.len() as u16).to_le_bytes());
    } else {
        bytes.extend((text.len() as u32).to_le_bytes());
    }
    bytes.extend(text.as_bytes());
    bytes
}
