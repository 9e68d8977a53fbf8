//! `gyrogen replay`: captured ADC codes through the circuit, bit for bit.

use super::recorded::Recorded;
use super::stages::Stages;
use crate::circuit::engine::{self, ArithmeticKind, Rows};
use crate::design::Design;
use crate::error::{Error, Result};
use crate::output::name_of;
use crate::record::capture::{CaptureReader, mismatch_warnings};
use crate::record::replayed::Replayed;
use crate::record::rows::{Kind, RowWriter};
use crate::text::counted;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

/// Run captured ADC codes through the circuit: one row of its words for each decimated sample.
#[derive(Debug, clap::Args)]
#[command(override_usage = "gyrogen replay [OPTIONS] [DESIGN] --capture FILE --out FILE")]
pub struct Arguments {
    #[command(flatten)]
    design: super::common::DesignFile,
    /// Captured ADC codes, drive and sense (CSV or NPY).
    #[arg(long, value_name = "FILE")]
    capture: PathBuf,
    /// File for the rows: CSV, or NPY if the name ends in .npy (int64; float64 with --arith float).
    #[arg(long, value_name = "FILE")]
    out: PathBuf,
    /// Whose words are written: the bit-accurate circuit, or its float twin.
    #[arg(long, value_enum, default_value = "fixed")]
    arith: Arith,
    /// How what was done is told.
    #[arg(long, value_enum, default_value = "text")]
    format: Told,
}

/// How it is told what was done.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
pub enum Told {
    /// Sentences on stderr; nothing on stdout.
    Text,
    /// The same sentences, and JSON on stdout.
    Json,
}

/// Which arithmetic's words are written.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
pub enum Arith {
    /// Bit-accurate: raw integers.
    Fixed,
    /// Without quantisation: real values.
    Float,
}

impl From<Arith> for ArithmeticKind {
    fn from(arith: Arith) -> Self {
        match arith {
            Arith::Fixed => ArithmeticKind::Fixed,
            Arith::Float => ArithmeticKind::Float,
        }
    }
}

/// ADC samples that are read, processed and written at a time.
const BLOCK: usize = 1 << 14;

/// Refuses a file in the place of the rows that is none of an earlier replay.
fn refuse_foreign(out: &Path, header: &[&str]) -> Result<()> {
    use std::io::Read;
    // What is no regular file is the writer's to refuse.
    if !std::fs::metadata(out).is_ok_and(|m| m.is_file() && m.len() > 0) {
        return Ok(());
    }
    let mut start = Vec::new();
    let opened = std::fs::File::open(out);
    let read = opened.and_then(|f| f.take(256).read_to_end(&mut start));
    let array = format!(", {})", header.len());
    let start = String::from_utf8_lossy(&start);
    // Designs differ in the columns at the end.
    let is_csv = start.starts_with("index,drive_i,");
    let is_npy = start.contains("NUMPY") && start.contains(&array);
    if read.is_err() || is_csv || is_npy {
        return Ok(());
    }
    Err(crate::error::InputError::new(
        "this file is there, and is no result of an earlier `replay`",
    )
    .in_file(out)
    .help("name another file with --out, or move this one away")
    .into())
}

/// Runs the command.
///
/// # Errors
/// An unusable design or capture (exit 2), or an overflow where the design says `error` (exit 1);
/// no file is written then.
pub fn run(arguments: &Arguments, recorded: &Recorded) -> Result<()> {
    let stages = Stages::start("replaying");
    super::common::refuse_design(
        ("replay", "--capture"),
        &arguments.capture,
        arguments.design.path(),
    )?;
    let design = arguments.design.read()?;
    let kind = ArithmeticKind::from(arguments.arith);
    crate::output::refuse_inputs(&arguments.out, &recorded.inputs)?;
    let mut capture = CaptureReader::open(&arguments.capture, design.circuit.adc.format)?;
    let mut warnings = warn_of_mismatches(&design, &capture);

    let columns = engine::columns(&design);
    if let Some(said) = foreign_bias(&design, &columns) {
        talk!("warning: {said}");
        warnings.push(said);
    }
    let mut header = vec!["index"];
    header.extend(&columns);
    let written = match kind {
        ArithmeticKind::Fixed => Kind::Integer,
        ArithmeticKind::Float => Kind::Float,
    };
    refuse_foreign(&arguments.out, &header)?;
    let mut writer = RowWriter::create(&arguments.out, &header, written)?;

    let mut engine = engine::engine(&design, kind);
    let mut rows = engine.no_rows();
    let (mut drive, mut sense) = (Vec::new(), Vec::new());
    let of = capture.rows_hint();
    let started = Instant::now();
    let (mut samples, mut index) = (0u64, 0u64);
    let mut busy = Duration::ZERO;
    let mut still = [Still::default(), Still::default()];
    loop {
        let count = capture.read_block(&mut drive, &mut sense, BLOCK)?;
        if count == 0 {
            break;
        }
        let start = Instant::now();
        engine
            .process(&drive, &sense, &mut rows)
            .map_err(|overflowed| Error::Check(overflowed.to_string()))?;
        busy += start.elapsed();
        samples += count as u64;
        for (still, codes) in still.iter_mut().zip([&drive, &sense]) {
            still.add(codes);
        }
        index = write(&mut rows, columns.len(), index, &mut writer)?;
        stages.at(samples, of);
    }
    writer.finish()?;
    stages.over();
    let period = design.circuit.decimator.ratio;
    for (still, name) in still.iter().zip(["drive_code", "sense_code"]) {
        if let Some(message) = still.said(name) {
            talk!("warning: {message}");
            warnings.push(message);
        }
    }
    if index == 0 {
        warnings.push(format!(
            "the capture has {}; one row needs {period}, so that the file has no row. Capture longer",
            counted(samples, "sample")
        ));
        talk!("warning: {}", warnings[warnings.len() - 1]);
    }
    talk!(
        "replayed {} into {}: {:.1} M samples/s in the circuit, \
         {:.1} M/s with reading and writing, one thread",
        counted(samples, "sample"),
        counted(index, "row"),
        rate(samples, busy),
        rate(samples, started.elapsed()),
    );
    talk!("{}", units(&design, kind, &columns));
    if let Some(said) = uncorrected(&design) {
        talk!("note: {said}");
    }
    if arguments.format == Told::Json {
        let replayed = Replayed {
            schema: "gyrogen.replay/1",
            version: env!("CARGO_PKG_VERSION"),
            design_sha256: design.source.sha256.clone(),
            arithmetic: match kind {
                ArithmeticKind::Fixed => "fixed",
                ArithmeticKind::Float => "float",
            },
            samples,
            rows: index,
            columns: header.iter().map(|&c| c.to_owned()).collect(),
            warnings,
            file: name_of(&arguments.out),
        };
        super::terminal::give(&super::json(&replayed));
    }
    Ok(())
}

/// Said where the rows have a rate that is compensated by the embedded default's coefficients.
fn foreign_bias(design: &Design, columns: &[&str]) -> Option<String> {
    let is_foreign = columns.contains(&"rate") && !design.compensation_is_own;
    let said = super::emit::unfitted(design).filter(|_| is_foreign)?;
    Some(format!(
        "{said}. The column rate is compensated for that gyro alone"
    ))
}

/// Said of a design with a correction: the rows are those of its circuit, and averaged readings come after them.
fn uncorrected(design: &Design) -> Option<&'static str> {
    design.correction.as_ref().map(|_| {
        "the design's [correction] is not applied to these rows, as it acts on readings that are averaged over many of them. `gyrogen emit \
         --part correction` writes the firmware that applies it; residuals.csv of `gyrogen close` has what that leaves of the record"
    })
}

/// What the numbers in the rows' columns are.
fn units(design: &Design, kind: ArithmeticKind, columns: &[&str]) -> String {
    let circuit = &design.circuit;
    let scaled = |bits: u32, unit: &str| match kind {
        ArithmeticKind::Fixed => format!("raw * 2^-{bits} {unit}"),
        ArithmeticKind::Float => unit.to_owned(),
    };
    let front = scaled(
        circuit.decimator.output.format.fraction_bits,
        "of full scale",
    );
    let mut said = vec![format!("drive, sense and magnitude: {front}")];
    let mut add = |name: &str, bits: u32, unit: &str| {
        if columns.contains(&name) {
            said.push(format!("{name}: {}", scaled(bits, unit)));
        }
    };
    add("phase", circuit.cordic.angle_bits, "turn");
    if let Some(c) = &design.compensation {
        add("rate", c.output.format.fraction_bits, "deg/s");
    }
    if let Some(l) = &circuit.amplitude_loop {
        add("gain", l.gain_bits - 1, "of full gain");
    }
    if columns.contains(&"tuning_word") {
        let bits = circuit.nco.phase_bits;
        said.push(match kind {
            ArithmeticKind::Fixed => format!(
                "tuning_word: raw * {} * 2^-{bits} Hz",
                circuit.sample_rate_hz
            ),
            ArithmeticKind::Float => "tuning_word: Hz".to_owned(),
        });
    }
    said.join("; ")
}

/// How long a channel stands at one code.
#[derive(Debug, Clone, Copy, Default)]
struct Still {
    last: Option<i32>,
    samples: u64,
    /// Samples with the code of the one before.
    repeated: u64,
}

impl Still {
    fn add(&mut self, codes: &[i32]) {
        let before = self.last.into_iter().chain(codes.iter().copied());
        let same = before.zip(codes.iter().skip(usize::from(self.last.is_none())));
        self.repeated += same.filter(|(a, b)| a == *b).count() as u64;
        self.samples += codes.len() as u64;
        self.last = codes.last().copied().or(self.last);
    }

    /// What is said of a channel that hardly ever changes: a tone does within a few samples.
    fn said(&self, name: &str) -> Option<String> {
        let code = self.last?;
        let still = self.samples >= LEAST_STILL && 100 * self.repeated >= 99 * (self.samples - 1);
        still.then(|| {
            format!(
                "{name} has no signal: it stands at one code (the last is {code}) in nearly all rows. Is it connected?"
            )
        })
    }
}

/// Fewer samples at one code are no standstill (convention).
const LEAST_STILL: u64 = 64;

/// M samples/s.
fn rate(samples: u64, time: Duration) -> f64 {
    samples as f64 / time.as_secs_f64().max(1e-9) / 1e6
}

/// Writes and clears the rows; gives the next row's index.
fn write(rows: &mut Rows, columns: usize, mut index: u64, writer: &mut RowWriter) -> Result<u64> {
    match rows {
        Rows::Integer(words) => index = writer.write_numbered_integers(index, words, columns)?,
        Rows::Wide(words) => index = writer.write_numbered_integers(index, words, columns)?,
        Rows::Real(values) => {
            let mut line = Vec::with_capacity(columns + 1);
            for row in values.chunks_exact(columns) {
                line.clear();
                line.push(index as f64);
                line.extend_from_slice(row);
                writer.write_floats(&line)?;
                index += 1;
            }
        }
    }
    rows.clear();
    Ok(index)
}

/// Says how the capture was read and where it contradicts the design; gives the contradictions.
pub(super) fn warn_of_mismatches(design: &Design, capture: &CaptureReader) -> Vec<String> {
    for note in capture.notes() {
        talk!("read: {note}");
    }
    let nco = &design.circuit.nco;
    let circle = 1i128 << nco.phase_bits;
    let word = i128::from(nco.tuning_word).rem_euclid(circle) as u128;
    let warnings = mismatch_warnings(
        capture.meta(),
        design.circuit.sample_rate_hz,
        (word, nco.phase_bits),
        design.circuit.adc.format.bits(),
    );
    for warning in &warnings {
        talk!("warning: {warning}");
    }
    warnings
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_channel_at_one_code_is_said_and_a_tone_is_none() {
        let said = |codes: &[i32]| {
            let mut still = Still::default();
            codes.chunks(7).for_each(|block| still.add(block));
            still.said("drive_code")
        };
        let mut codes = vec![9000; 500];
        assert!(
            said(&codes)
                .unwrap()
                .contains("stands at one code (the last is 9000)")
        );
        codes[100] = 8999;
        assert!(said(&codes).is_some());
        let tone: Vec<i32> = (0..500)
            .map(|k| (100.0 * (0.1 * f64::from(k)).sin()) as i32)
            .collect();
        assert_eq!(said(&tone), None);
        assert_eq!((said(&[]), said(&[5]), said(&[5; 40])), (None, None, None));
    }

    #[test]
    fn a_correction_that_the_rows_do_not_have_is_said() {
        let of = |text: &str| uncorrected(&crate::design::reader::parse(text, None).unwrap());
        assert_eq!(of(""), None);
        let table = "[correction]\nperiod_s = 1.0\nfull_scale_dps = 1024.0\nnoise_dps = 0.01\ninputs = []\n\
                     terms = [{ kind = \"product\", gain_dps = 0.3, factors = [] }]\n";
        let said = of(table).unwrap();
        assert!(
            said.contains("not applied to these rows") && said.contains("emit --part correction"),
            "{said}"
        );
    }
}
