//! What a bundle says of itself: the manifest, and the banner and facts at the head of each file.

use super::emitted::EmittedFile;
use super::view::View;
use crate::design::{CompensationInput, Design, Outside};
use crate::digest::sha256;
use crate::emit::bundle::Bundle;
use crate::emit::views::Language;
use crate::numeric::format::{Overflow, pow2};
use crate::text::{self, Place};
use serde::{Deserialize, Serialize};

/// The manifest's file name.
pub const NAME: &str = "manifest.json";
/// The manifest's schema.
pub const SCHEMA: &str = "gyrogen.bundle/2";

/// `manifest.json`: what is in the bundle and how it is verified.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
pub struct Manifest {
    /// `gyrogen.bundle/2`.
    pub schema: String,
    /// Of the tool.
    pub version: String,
    /// Of the design's text.
    pub design_sha256: String,
    /// That makes the bundle again.
    pub command: String,
    /// `c` or `rust`.
    pub language: String,
    /// `compensation`, `tables`, `chain`, `function`, `conversion`, `correction`, or `all`: a product of three parts.
    pub part: String,
    /// Prefix (C) or crate (Rust).
    pub prefix: String,
    /// Tables, by their number in the self-test.
    pub tables: Vec<TableEntry>,
    /// Functions with vectors, by their number in the self-test.
    pub functions: Vec<FunctionEntry>,
    /// The whole chain has vectors.
    pub chain: Option<ChainEntry>,
    /// The function with a state that is called once a reading, in order, where there is one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sequence: Option<FunctionEntry>,
    /// The chain or sequence over a long stimulus that the harness makes.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub long_run: Option<LongEntry>,
    /// Casts whose overflow is an error, by fault number.
    pub faults: Vec<FaultEntry>,
    /// The compensation's calibrated range, where one is known.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub calibrated: Option<super::calibrated::Calibrated>,
    /// A product's parts, each a bundle with a manifest in the folder of its name.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub parts: Vec<PartEntry>,
    /// Every other file.
    pub files: Vec<FileEntry>,
    /// SHA-256 of this manifest with an empty seal: whether anything of it was changed by hand. Who means to change
    /// it seals it again; against that there is the digest of the whole file.
    pub seal: String,
}

/// A part of a product.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, schemars::JsonSchema)]
pub struct PartEntry {
    /// What it is, and the folder that it is in.
    pub part: String,
    /// SHA-256 of its manifest.
    pub digest: String,
}

/// A table.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
pub struct TableEntry {
    /// Number in the self-test.
    pub number: u32,
    /// Name without prefix.
    pub name: String,
    /// Entries.
    pub entries: usize,
}

/// A function.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
pub struct FunctionEntry {
    /// Number in the self-test.
    pub number: u32,
    /// Name without prefix.
    pub name: String,
    /// 64-bit words that go in: inputs, then state.
    pub inputs: usize,
    /// 64-bit words that come out: outputs, then state.
    pub outputs: usize,
    /// What the records of every input there is have to give, where these are few enough.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub every_input: Option<EveryEntry>,
}

/// Every input there is.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, schemars::JsonSchema)]
pub struct EveryEntry {
    /// How many.
    pub inputs: u64,
    /// FNV-1a of their records, block by block, hexadecimal.
    pub checksum: String,
}

/// A long run.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, schemars::JsonSchema)]
pub struct LongEntry {
    /// Samples or calls.
    pub steps: u64,
    /// FNV-1a of the first state, all rows or records and the last state, hexadecimal.
    pub checksum: String,
}

/// The chain.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
pub struct ChainEntry {
    /// Number in the self-test.
    pub number: u32,
    /// Samples in a decimation period.
    pub ratio: u32,
    /// Columns of a row.
    pub columns: Vec<String>,
}

/// A fault.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
pub struct FaultEntry {
    /// What the emitted code notes.
    pub number: usize,
    /// The node of the design.
    pub node: String,
}

/// A file.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
pub struct FileEntry {
    /// Inside the bundle.
    pub path: String,
    /// Lower-case hexadecimal.
    pub sha256: String,
}

/// The first line of every emitted file.
pub fn banner(design_sha256: &str, command: &str) -> String {
    banner_of(env!("CARGO_PKG_VERSION"), design_sha256, command)
}

/// The same of another version.
pub fn banner_of(version: &str, design_sha256: &str, command: &str) -> String {
    let banner = format!(
        "Generated by gyrogen {version}: `{command}`; design sha256 {design_sha256}. Do not edit."
    );
    text::shown(&banner, Place::Source)
}

/// The digest of a bundle: SHA-256 of its manifest, which holds those of all other files.
pub fn digest(files: &[EmittedFile]) -> String {
    let manifest = files.iter().find(|f| f.path == NAME);
    manifest.map_or(String::new(), |f| sha256(f.text.as_bytes()))
}

/// The design's parameters as read, for the head of the sources.
pub fn facts(design: &Design, bundle: &Bundle) -> Vec<String> {
    let c = &design.circuit;
    let mut facts = vec![format!("design `{}`", design.name)];
    if bundle.has_chain {
        facts.extend([
            format!("sample rate {} Hz, ADC {}", c.sample_rate_hz, c.adc.format),
            format!(
                "NCO {} bits, tuning word {}, table 2^{} x {}, address {}",
                c.nco.phase_bits,
                c.nco.tuning_word,
                c.nco.table_address_bits,
                c.nco.table,
                c.nco.address_rounding.name()
            ),
            format!("product {}", c.demodulator.product),
            format!(
                "CIC {} stages, ratio {}, delay {}, gain divided by 2^{}, output {}",
                c.decimator.stages,
                c.decimator.ratio,
                c.decimator.differential_delay,
                c.decimator.gain_bits(),
                c.decimator.output
            ),
            format!(
                "CORDIC {} iterations, {} guard bits, width {}, angle {} bits, gain {} bits",
                c.cordic.iterations,
                c.cordic.guard_bits,
                c.cordic.width,
                c.cordic.angle_bits,
                c.cordic.gain_bits
            ),
        ]);
        if let Some(l) = &c.phase_loop {
            facts.push(format!(
                "phase loop: setpoint {}, proportional {} >> {}, integral {} >> {}, integrator {} bits",
                l.setpoint_raw,
                l.proportional.raw,
                l.proportional.shift,
                l.integral.raw,
                l.integral.shift,
                l.integrator_bits
            ));
        }
        if let Some(l) = &c.amplitude_loop {
            facts.push(format!(
                "amplitude loop: setpoint {}, error >> {}, integrator >> {} from {}, gain {} bits",
                l.setpoint_raw, l.error_shift, l.integrator_shift, l.initial_raw, l.gain_bits
            ));
        }
    }
    if let Some(k) = &design.compensation {
        facts.push(format!(
            "compensation: input {}, coefficients {:?} {}, lowest order first",
            input(&k.input),
            k.coefficients_raw,
            k.coefficient_format
        ));
        let rate = match k.rate_full_scale_dps == 1.0 {
            true => "in deg/s".to_owned(),
            false => format!("= value of its word * {} deg/s", k.rate_full_scale_dps),
        };
        facts.push(format!(
            "accumulator {}, output {}, uncompensated rate {rate}",
            k.accumulator, k.output
        ));
        facts.push(match k.clamp_raw {
            Some((low, high)) => {
                let outside = match k.outside {
                    Outside::Clamp => "the input is clamped",
                    Outside::HoldSlope => "the slope of the nearer end is held",
                    Outside::Flag => "the input is clamped and in_range is 0",
                };
                format!(
                    "calibrated for inputs {low} .. {high} ({}); outside, {outside}",
                    in_quantity(design, &k.input, (low, high))
                )
            }
            None => "no calibrated range: the polynomial is evaluated at every input".into(),
        });
        facts.extend_from_slice(&bundle.accuracy);
    }
    facts.push("words are two's complement; ranges beside them are proved, not observed".into());
    if bundle.may_fault() {
        facts.push(
            "an overflow where the design says `error` saturates and is noted as a fault".into(),
        );
    }
    facts
}

/// A compensation's input in words.
fn input(input: &CompensationInput) -> String {
    match input {
        CompensationInput::Phase => "phase, p in half turns".into(),
        CompensationInput::TuningWord(t) => format!(
            "what the phase loop adds to the tuning word, p = (steps - {}) * 2^-{}",
            t.offset_raw, t.scale_bits
        ),
        CompensationInput::Channel(c) => format!(
            "{} {}, p = (raw - {}) * 2^-{}",
            c.column, c.format, c.offset_raw, c.scale_bits
        ),
    }
}

/// A range of input words as the quantity that they stand for.
fn in_quantity(design: &Design, input: &CompensationInput, range: (i128, i128)) -> String {
    let c = &design.circuit;
    let (zero, factor, unit) = match input {
        CompensationInput::Phase => {
            let turn = pow2(-(c.cordic.angle_bits as i32));
            (0.0, std::f64::consts::TAU * turn, "rad")
        }
        CompensationInput::TuningWord(_) => (
            c.nco.tuning_word as f64,
            c.sample_rate_hz * pow2(-(c.nco.phase_bits as i32)),
            "Hz",
        ),
        // The column's name has the unit.
        CompensationInput::Channel(channel) => (0.0, channel.format.lsb(), channel.column.as_str()),
    };
    let at = |raw: i128| text::constant((zero + raw as f64) * factor, 7);
    format!("{} .. {} {unit}", at(range.0), at(range.1))
}

/// Where a bundle comes from and what it is.
#[derive(Debug, Clone, Copy)]
pub struct Header<'a> {
    /// Of the design's text, or of the request that stands in its place.
    pub design_sha256: &'a str,
    /// That makes the bundle again.
    pub command: &'a str,
    /// The language.
    pub language: Language,
    /// As in the manifest.
    pub part: &'a str,
    /// There are functions, not tables alone.
    pub has_code: bool,
    /// Columns of a chain's row.
    pub columns: &'a [&'static str],
}

fn language_key(language: Language) -> &'static str {
    match language {
        Language::C => "c",
        Language::Rust => "rust",
    }
}

fn entries(files: &[EmittedFile]) -> Vec<FileEntry> {
    let entry = |f: &EmittedFile| FileEntry {
        path: f.path.clone(),
        sha256: sha256(f.text.as_bytes()),
    };
    files.iter().map(entry).collect()
}

impl Manifest {
    /// The manifest of a bundle whose other files are complete.
    pub fn new(header: &Header, bundle: &Bundle, view: &View, files: &[EmittedFile]) -> Self {
        let (tables, tests) = (&view.tables, &view.tests);
        let casts = bundle.program.casts.iter().enumerate();
        Manifest {
            schema: SCHEMA.into(),
            version: env!("CARGO_PKG_VERSION").into(),
            design_sha256: header.design_sha256.into(),
            command: header.command.into(),
            language: language_key(header.language).into(),
            part: header.part.into(),
            prefix: bundle.prefix.clone(),
            tables: tables
                .iter()
                .map(|t| TableEntry {
                    number: t.number,
                    name: t.name.clone(),
                    entries: t.len,
                })
                .collect(),
            functions: tests
                .iter()
                .map(|f| FunctionEntry {
                    number: f.number,
                    name: f.name.clone(),
                    inputs: f.inputs,
                    outputs: f.outputs - 1,
                    every_input: (!f.every.is_empty()).then(|| EveryEntry {
                        inputs: f.every_count,
                        checksum: f.every.clone(),
                    }),
                })
                .collect(),
            chain: (bundle.has_chain && header.has_code).then(|| ChainEntry {
                number: view.chain_number,
                ratio: bundle.ratio,
                columns: header.columns.iter().map(|&c| c.to_owned()).collect(),
            }),
            sequence: None,
            long_run: view.long().map(|(steps, checksum)| LongEntry {
                steps,
                checksum: checksum.to_owned(),
            }),
            faults: casts
                .filter(|(_, cast)| cast.overflow == Some(Overflow::Error))
                .filter(|(k, _)| !bundle.program.is_proved_in_range(*k))
                .map(|(k, cast)| FaultEntry {
                    number: k + 1,
                    node: cast.label.to_string(),
                })
                .collect(),
            calibrated: None,
            parts: Vec::new(),
            files: entries(files),
            seal: String::new(),
        }
    }

    /// The manifest of a product whose other files, those of its parts among them, are complete.
    pub fn of_product(
        header: &Header,
        prefix: &str,
        parts: Vec<PartEntry>,
        files: &[EmittedFile],
    ) -> Self {
        Manifest {
            schema: SCHEMA.into(),
            version: env!("CARGO_PKG_VERSION").into(),
            design_sha256: header.design_sha256.into(),
            command: header.command.into(),
            language: language_key(header.language).into(),
            part: header.part.into(),
            prefix: prefix.into(),
            tables: Vec::new(),
            functions: Vec::new(),
            chain: None,
            sequence: None,
            long_run: None,
            faults: Vec::new(),
            calibrated: None,
            parts,
            files: entries(files),
            seal: String::new(),
        }
    }

    /// The seal that the manifest has to have.
    pub fn sealed(&self) -> String {
        let mut open = self.clone();
        open.seal = String::new();
        sha256(open.text().as_bytes())
    }

    /// Indented JSON with a final newline, sealed.
    pub fn to_json(&self) -> String {
        let mut sealed = self.clone();
        sealed.seal = self.sealed();
        sealed.text()
    }

    fn text(&self) -> String {
        text::json(self)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::design::{ChannelInput, reader};
    use crate::emit::bundle::Part;
    use crate::numeric::format::Format;

    #[test]
    fn the_calibrated_range_is_told_in_its_quantity() {
        let mut design = reader::read(None).expect("the default");
        let c = design.compensation.as_mut().expect("a compensation");
        c.clamp_raw = Some((-4194304, -2097152));
        let said = facts(&design, &Bundle::new(&design, Part::Compensation)).join("\n");
        let told = "inputs -4194304 .. -2097152 (-1.570796 .. -0.7853982 rad); outside, the input is clamped";
        assert!(said.contains(told), "{said}");
        let channel = CompensationInput::Channel(ChannelInput {
            column: "die_degc".into(),
            format: Format::q(8, 8),
            offset_raw: 0,
            scale_bits: 15,
            rate_format: Format::q(4, 28),
        });
        let die = in_quantity(&design, &channel, (-2560, 16640));
        assert_eq!(die, "-10 .. 65 die_degc");
    }
}
