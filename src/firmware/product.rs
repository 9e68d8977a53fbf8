//! Chain, conversion and correction of one design: three bundles in folders of their own, and beside them what
//! builds, checks and shows them together.

use super::correction::Origin;
use super::emitted::EmittedFile;
use super::files;
use super::manifest::{self, Header, Manifest, PartEntry};
use super::{conversion, correction, paths, stepped, vectors};
use crate::correction::block;
use crate::correction::conversion as glue;
use crate::correction::rows::Source;
use crate::correction::{Calls, Conversion, Correction};
use crate::design::Design;
use crate::emit::bundle::{Bundle, Part};
use crate::emit::machine::{Type, Width, parameter_type};
use crate::emit::views::{BASIS, Language, mix};
use crate::emit::{c, rust};
use crate::error::{Error, InputError, Result};
use crate::numeric::trace::ir::Interval;
use crate::text::{self, Place};
use crate::vectors::chain;
use askama::Template;

/// Samples of the check of all parts together, up to the end of a reading.
const SAMPLES: u64 = 1 << 21;
/// Readings of it: at least, where [`MOST_SAMPLES`] allow, and at most.
const READINGS: (u64, u64) = (2, 16);
/// Most samples of it.
const MOST_SAMPLES: u64 = 1 << 25;
/// The drive's phase moves by one turn in so many readings.
const READINGS_OF_TURN: u64 = 8;
/// The sense channel leads by this, 2^-32 turn: an eighth.
const LEAD: u32 = 1 << 29;
/// From one reading to the next an input that is not the chain's moves by this, raw, modulo its range.
const STRIDE: u64 = 7919;
/// From one such input to the next its first word moves by this, raw.
const START: u64 = 104_729;

macro_rules! page {
    ($name:ident, $path:literal) => {
        #[derive(Template)]
        #[template(path = $path, escape = "none")]
        struct $name<'a> {
            v: &'a View,
        }
    };
}

page!(Readme, "product/README.md");
page!(Makefile, "product/Makefile");
page!(CMakeLists, "product/CMakeLists.txt");
page!(CheckC, "product/check.c");
page!(Cargo, "product/Cargo.toml");
page!(CheckRust, "product/main.rs");
page!(PartsRust, "product/parts.rs");

/// Everything that the templates of a product see.
#[derive(Debug)]
struct View {
    p: String,
    language: Language,
    banner: String,
    parts: [&'static str; 3],
    /// Lines of text on what goes between the parts.
    facts: Vec<String>,
    ratio: u32,
    rows: u32,
    code: String,
    code_low: String,
    code_span: String,
    /// Types of the conversion's and of the correction's state, without prefix.
    sums: String,
    state: String,
    /// Arguments of `convert` after `restart`.
    row: Vec<String>,
    /// What `convert` gives.
    words: Vec<&'static str>,
    inputs: Vec<InputView>,
    /// The last argument of `correct` in the check, and in the example.
    rate: String,
    rate_shown: String,
    rate_meaning: String,
    reading_samples: u64,
    samples: u64,
    readings: u64,
    step: u32,
    lead: u32,
    stride: u64,
    checksum: String,
}

/// An input of the correction.
#[derive(Debug)]
struct InputView {
    name: &'static str,
    /// The chain has it.
    own: bool,
    /// The argument in the check, and in the example.
    argument: String,
    shown: String,
    /// Formula and format.
    meaning: String,
    ty: String,
    low: String,
    start: u64,
    /// Words that it can have.
    count: u64,
}

impl View {
    fn is_c(&self) -> bool {
        self.language == Language::C
    }

    fn has_others(&self) -> bool {
        self.inputs.iter().any(|input| !input.own)
    }
}

/// A design's chain, conversion and correction.
struct Product<'a> {
    design: &'a Design,
    correction: Correction,
    conversion: Conversion,
    language: Language,
}

/// Emits the three parts of a design in one language, as files in memory.
///
/// # Errors
/// A design without a correction, or whose chain and correction do not go together.
pub fn emit(design: &Design, language: Language, command: &str) -> Result<Vec<EmittedFile>> {
    let (conversion, correction) = of_design(design)?;
    let product = Product {
        design,
        correction,
        conversion,
        language,
    };
    let sha256 = &design.source.sha256;
    let name = &design.name;
    let mut files = Vec::new();
    let mut parts = Vec::new();
    for part in paths::PARTS {
        let prefix = paths::prefix_of(name, part);
        let origin = Origin {
            prefix: &prefix,
            sha256,
            command,
        };
        let emitted = match part {
            "conversion" => conversion::emit(&product.conversion, &origin, language)?,
            "correction" => correction::emit(&product.correction, &origin, language)?,
            _ => files::emit(design, Part::Chain, language, command)?,
        };
        parts.push(PartEntry {
            part: part.to_owned(),
            digest: manifest::digest(&emitted),
        });
        files.extend(emitted.into_iter().map(|file| EmittedFile {
            path: format!("{part}/{}", file.path),
            text: file.text,
        }));
    }
    files.extend(pages(&product.view(command)?)?);
    files.push(files::sums(&files));
    let header = Header {
        design_sha256: sha256,
        command,
        language,
        part: "all",
        has_code: true,
        columns: &[],
    };
    let manifest = Manifest::of_product(&header, name, parts, &files);
    files.push(EmittedFile {
        path: manifest::NAME.into(),
        text: manifest.to_json(),
    });
    Ok(files)
}

/// The conversion of a design with its correction.
///
/// # Errors
/// As [`emit`].
pub fn of_design(design: &Design) -> Result<(Conversion, Correction)> {
    let planned = design.correction.as_ref().ok_or_else(|| {
        InputError::new("the design has no [correction] to join to its chain")
            .help("take the design.toml that `gyrogen close` writes, or emit `--part chain`")
    })?;
    let correction = planned.compile()?;
    Ok((Conversion::new(design, &correction)?, correction))
}

fn pages(view: &View) -> Result<Vec<EmittedFile>> {
    let v = view;
    let pages: Vec<(String, askama::Result<String>)> = match v.language {
        Language::C => vec![
            ("Makefile".into(), Makefile { v }.render()),
            ("CMakeLists.txt".into(), CMakeLists { v }.render()),
            (format!("test/{}_all.c", v.p), CheckC { v }.render()),
            (paths::README.into(), Readme { v }.render()),
        ],
        Language::Rust => vec![
            ("Cargo.toml".into(), Cargo { v }.render()),
            ("src/main.rs".into(), CheckRust { v }.render()),
            ("tests/parts.rs".into(), PartsRust { v }.render()),
            (paths::README.into(), Readme { v }.render()),
        ],
    };
    let page = |(path, text): (String, askama::Result<String>)| {
        let text = text.map_err(|e| InputError::new(format!("cannot print {path}: {e}")))?;
        let text = text.trim_end().to_owned() + "\n";
        Ok(EmittedFile { path, text })
    };
    pages.into_iter().map(page).collect()
}

impl Product<'_> {
    fn view(&self, command: &str) -> Result<View> {
        let (design, language) = (self.design, self.language);
        let circuit = &design.circuit;
        let chain = Bundle::new(design, Part::Chain);
        let glue = stepped::bundle("", &self.conversion.trace());
        let correct = stepped::bundle("", &self.correction.trace());
        let code = codes(design);
        let run = self.run();
        let inputs = self.inputs(&glue, &correct)?;
        let rate_type = parameter(&correct, block::STEP, self.correction.plan.inputs.len() + 1)?;
        let rate = |from: &str| {
            let given = output(&glue, glue::CONVERT, "rate")?;
            Ok::<String, Error>(self.converted(&format!("{from}.rate"), given, rate_type))
        };
        Ok(View {
            p: design.name.clone(),
            language,
            banner: manifest::banner(manifest::DESIGN, &design.source.sha256, command),
            parts: paths::PARTS,
            facts: self
                .conversion
                .facts()
                .iter()
                .map(|line| text::shown(line, Place::Source))
                .collect(),
            ratio: circuit.decimator.ratio,
            rows: self.conversion.rows(),
            code: self.type_name(parameter_type(code)),
            code_low: self.wide(code.low),
            code_span: self.unsigned((code.high - code.low) as u64),
            sums: self.state_name(glue::SUMS),
            state: self.state_name(block::STATE),
            row: self.row(&chain, &glue)?,
            words: self.words(),
            inputs,
            rate: rate("words")?,
            rate_shown: rate("x")?,
            rate_meaning: format!("one LSB is {:e} deg/s", self.correction.formats.rate.lsb()),
            reading_samples: run.reading,
            samples: run.samples,
            readings: run.samples / run.reading,
            step: run.step,
            lead: LEAD,
            stride: STRIDE,
            checksum: format!("{:#x}", self.checksum(&run)),
        })
    }

    /// `complete`, the inputs that the chain has, `rate`.
    fn words(&self) -> Vec<&'static str> {
        let inputs = self.conversion.inputs();
        let names = self.correction.plan.input_names();
        let mut words = vec!["complete"];
        words.extend(inputs.iter().filter_map(|k| names.get(*k).copied()));
        words.push("rate");
        words
    }

    /// Arguments of `convert` from the row and, of the tuning word, the oscillator's state.
    fn row(&self, chain: &Bundle, glue: &Bundle) -> Result<Vec<String>> {
        let sources = self.conversion.sources();
        let mut arguments = Vec::new();
        for (k, source) in sources.into_iter().enumerate() {
            let to = parameter(glue, glue::CONVERT, k + 1)?;
            arguments.push(match source {
                Source::TuningWord => {
                    let bits = self.design.circuit.nco.phase_bits;
                    let mask = u64::MAX >> (64 - bits);
                    match self.language {
                        Language::C => format!(
                            "({})((uint64_t)g.chain.nco.tuning_word & UINT64_C({mask}))",
                            self.type_name(to)
                        ),
                        Language::Rust => format!(
                            "(u64::from(detector.chain.nco.tuning_word) & {mask}) as {}",
                            self.type_name(to)
                        ),
                    }
                }
                source => {
                    let from = output(chain, "period", source.name())?;
                    self.converted(&format!("row.{}", source.name()), from, to)
                }
            });
        }
        Ok(arguments)
    }

    fn inputs(&self, glue: &Bundle, correct: &Bundle) -> Result<Vec<InputView>> {
        let plan = &self.correction.plan;
        let own = self.conversion.inputs();
        let mut views = Vec::new();
        let inputs = plan.inputs.iter().zip(&self.correction.formats.inputs);
        for (k, ((input, format), name)) in inputs.zip(plan.input_names()).enumerate() {
            let ty = parameter(correct, block::STEP, k + 1)?;
            let is_own = own.contains(&k);
            let argument = |from: &str| {
                if !is_own {
                    return Ok(String::new());
                }
                let given = output(glue, glue::CONVERT, name)?;
                Ok::<String, Error>(self.converted(&format!("{from}.{name}"), given, ty))
            };
            let meaning = format!("{name} = {}, {format}", input.formula());
            views.push(InputView {
                name,
                own: is_own,
                argument: argument("words")?,
                shown: argument("x")?,
                meaning: text::shown(&meaning, Place::Source),
                ty: self.type_name(ty),
                low: self.wide(format.min_raw()),
                start: k as u64 * START,
                count: (format.max_raw() - format.min_raw() + 1) as u64,
            });
        }
        Ok(views)
    }

    fn converted(&self, expression: &str, from: Type, to: Type) -> String {
        match self.language {
            _ if from == to => expression.to_owned(),
            Language::C => format!("({}){expression}", self.type_name(to)),
            Language::Rust => format!("{expression} as {}", self.type_name(to)),
        }
    }

    fn type_name(&self, ty: Type) -> String {
        match self.language {
            Language::C => c::type_name("", ty),
            Language::Rust => rust::type_name(ty).to_owned(),
        }
    }

    fn state_name(&self, state: &str) -> String {
        match self.language {
            Language::C => state.to_owned(),
            Language::Rust => rust::camel(state),
        }
    }

    /// A constant in 64 bits.
    fn wide(&self, value: i128) -> String {
        let ty = Type::Signed(Width::W64);
        match self.language {
            Language::C => c::constant("", value, ty),
            Language::Rust => rust::constant(value, ty),
        }
    }

    fn unsigned(&self, value: u64) -> String {
        match self.language {
            Language::C => format!("UINT64_C({value})"),
            Language::Rust => format!("{value}_u64"),
        }
    }

    fn run(&self) -> Run {
        let ratio = u64::from(self.design.circuit.decimator.ratio);
        let reading = ratio * u64::from(self.conversion.rows());
        let readings = (SAMPLES / reading).clamp(READINGS.0, READINGS.1);
        let samples = (readings * reading).min(MOST_SAMPLES / ratio * ratio);
        let of_chain = vectors::long_words_of_chain(self.design);
        let rate = of_chain.first().map_or(0, |(_, rate)| *rate);
        let drift = (1 << 32) / (READINGS_OF_TURN * reading);
        Run {
            reading,
            samples,
            step: rate.wrapping_add(drift.max(1) as u32),
        }
    }

    /// Of the words of the conversion after every row, of the corrected rates and of the chain's fault.
    fn checksum(&self, run: &Run) -> u64 {
        let range = codes(self.design);
        let span = (range.high - range.low) as u64;
        let code = |turn: u32| {
            let up = turn.wrapping_mul(2);
            let place = u64::from(if turn >> 31 == 0 { up } else { !up });
            (range.low + i128::from((span * place) >> 32)) as i32
        };
        let names = chain::columns(self.design);
        let position = |source: &Source| names.iter().position(|name| *name == source.name());
        let sources = self.conversion.sources();
        let columns: Vec<usize> = sources.iter().filter_map(position).collect();
        let mut chain = chain::chain(self.design);
        let mut convert = self.conversion.stepper();
        let mut correct = self.correction.stepper();
        let own = self.conversion.inputs();
        let (mut h, mut turn, mut reading, mut fault) = (BASIS, 0u32, 0u64, 0);
        let mut words = Vec::new();
        for _ in 0..run.samples {
            turn = turn.wrapping_add(run.step);
            let Some(row) = chain.push(code(turn), code(turn.wrapping_add(LEAD))) else {
                continue;
            };
            fault = row.last().copied().unwrap_or(0);
            let row = columns.iter().map(|k| row.get(*k).copied().unwrap_or(0));
            let given: Vec<i128> = std::iter::once(0).chain(row).collect();
            words.clear();
            convert.call(&given, &mut words);
            h = words.iter().fold(h, |h, word| mix(h, *word as u64));
            if words.first() != Some(&1) {
                continue;
            }
            let mut given = vec![i128::from(reading == 0)];
            for (k, format) in self.correction.formats.inputs.iter().enumerate() {
                given.push(match own.iter().position(|own| *own == k) {
                    Some(place) => words.get(place + 1).copied().unwrap_or(0),
                    None => {
                        let count = (format.max_raw() - format.min_raw() + 1) as u64;
                        let place = (reading * STRIDE + k as u64 * START) % count;
                        format.min_raw() + i128::from(place)
                    }
                });
            }
            given.extend(words.last());
            h = mix(h, correct.corrected(&given) as u64);
            reading += 1;
        }
        mix(h, fault as u64)
    }
}

/// The check of all parts together.
struct Run {
    /// Samples of a reading.
    reading: u64,
    samples: u64,
    /// What the drive's phase advances by before each sample, 2^-32 turn.
    step: u32,
}

/// The ADC's codes.
fn codes(design: &Design) -> Interval {
    let format = design.circuit.adc.format;
    Interval::new(format.min_raw(), format.max_raw())
}

fn place(bundle: &Bundle, function: &str) -> Result<usize> {
    let mut functions = bundle.program.functions.iter();
    let found = functions.position(|f| f.name == function);
    found.ok_or_else(|| Error::Check(format!("internal: {function} was not traced")))
}

/// The type of a function's parameter after its state.
fn parameter(bundle: &Bundle, function: &str, number: usize) -> Result<Type> {
    let lowered = &bundle.lowered[place(bundle, function)?];
    let found = lowered.inputs.get(number).copied();
    found.ok_or_else(|| Error::Check(format!("internal: {function} has no such parameter")))
}

/// The type of what a function gives under a name.
fn output(bundle: &Bundle, function: &str, name: &str) -> Result<Type> {
    let lowered = &bundle.lowered[place(bundle, function)?];
    let found = lowered.outputs.iter().find(|(n, _)| *n == name);
    let found = found.map(|(_, typed)| typed.ty);
    found.ok_or_else(|| Error::Check(format!("internal: {function} gives no {name}")))
}
