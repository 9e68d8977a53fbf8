//! What of the chain's rows a correction can read: which word is which column, in which unit, and how many rows are
//! a reading.

use super::plan::Plan;
use crate::design::Design;
use crate::error::{InputError, Result};
use crate::numeric::arithmetic::Ring;
use crate::numeric::format::pow2;
use crate::numeric::trace::ir::Interval;
use std::f64::consts::TAU;

/// Most rows of a reading.
pub const MOST_ROWS: u32 = 1 << 24;
/// A reading of whole rows differs from the correction's period by at most this share of it.
const PERIOD_SHARE: f64 = 0.01;
/// Most bits of a tuning word: it fits into 64 bits with its sign.
const MOST_TUNING_BITS: u32 = 62;
/// The chain's LSB is at most this share of an input's scale.
const COARSEST: f64 = 0.5;

/// A word of a row.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Source {
    /// The drive phase.
    Phase,
    /// The oscillator's tuning word, where a phase loop moves it.
    TuningWord,
    /// The quadrature.
    SenseQ,
    /// The rate before compensation.
    SenseI,
}

impl Source {
    /// Of those that a correction may have as inputs, with the record's columns.
    const INPUTS: [(Source, &'static str); 3] = [
        (Source::Phase, "phase_rad"),
        (Source::TuningWord, "freq_hz"),
        (Source::SenseQ, "quad_dps"),
    ];

    /// The column of a row.
    pub fn name(self) -> &'static str {
        match self {
            Source::Phase => "phase",
            Source::TuningWord => "tuning_word",
            Source::SenseQ => "sense_q",
            Source::SenseI => "sense_i",
        }
    }

    /// The sum of it in the state.
    pub(super) fn sum(self) -> &'static str {
        match self {
            Source::Phase => "phase_sum",
            Source::TuningWord => "tuning_sum",
            Source::SenseQ => "sense_q_sum",
            Source::SenseI => "sense_i_sum",
        }
    }
}

/// A word of a row with its unit.
#[derive(Debug, Clone)]
pub struct Column {
    /// Which.
    pub source: Source,
    /// Every word.
    pub range: Interval,
    /// One LSB in the unit of the record's column.
    pub lsb: f64,
    /// Of a cyclic word, the turn.
    pub turn: Option<Ring>,
    unit: &'static str,
}

impl Column {
    fn new(design: &Design, source: Source) -> Result<Self> {
        let circuit = &design.circuit;
        let angle_bits = circuit.cordic.angle_bits;
        let phase_bits = circuit.nco.phase_bits;
        let output = circuit.decimator.output.format;
        let channel = Interval::new(output.min_raw(), output.max_raw());
        let rate_lsb = || Ok::<f64, crate::error::Error>(full_scale_dps(design)? * output.lsb());
        Ok(match source {
            Source::Phase => Column {
                source,
                range: Interval::of_bits(angle_bits),
                lsb: TAU * pow2(-(angle_bits as i32)),
                turn: Some(Ring::cyclic(angle_bits, 0)),
                unit: "rad",
            },
            Source::TuningWord => Column {
                source,
                range: Interval::new(0, (1 << phase_bits) - 1),
                lsb: circuit.sample_rate_hz * pow2(-(phase_bits as i32)),
                turn: None,
                unit: "Hz",
            },
            Source::SenseQ | Source::SenseI => Column {
                source,
                range: channel,
                lsb: rate_lsb()?,
                turn: None,
                unit: "deg/s",
            },
        })
    }

    /// The unit of the word.
    pub fn unit(&self) -> String {
        format!(
            "one LSB of {} is {:e} {}",
            self.source.name(),
            self.lsb,
            self.unit
        )
    }
}

/// Rows of a reading.
#[derive(Debug, Clone, Copy)]
pub struct ReadingRows {
    /// N.
    pub rows: u32,
    /// How long they are, s.
    pub seconds: f64,
}

/// How many rows the correction's period has.
///
/// # Errors
/// A period that is shorter than a row, longer than the sums take, or no whole number of rows to within a hundredth.
pub fn reading(design: &Design, plan: &Plan) -> Result<ReadingRows> {
    let circuit = &design.circuit;
    let row_s = f64::from(circuit.decimator.ratio) / circuit.sample_rate_hz;
    let exact = plan.period_s / row_s;
    let refuse = |what: String, help: &str| -> Result<ReadingRows> {
        Err(design.error_at("correction", what).help(help).into())
    };
    let period = plan.period_s;
    if exact < 1.0 - PERIOD_SHARE {
        return refuse(
            format!("period_s = {period:?} is shorter than one row of the chain, {row_s:?} s"),
            "a correction is called at most once a row: give the record's period, or decimate less",
        );
    }
    let rows = exact.round();
    if rows > f64::from(MOST_ROWS) {
        return refuse(
            format!(
                "period_s = {period:?} is {rows} rows of the chain; at most {MOST_ROWS} are averaged"
            ),
            "give a shorter period_s",
        );
    }
    let seconds = rows * row_s;
    if (seconds / period - 1.0).abs() > PERIOD_SHARE {
        return refuse(
            format!(
                "period_s = {period:?} is {exact:.3} rows of the chain: {rows} rows are {seconds:?} s, and time constants would be off by more than a hundredth"
            ),
            "give a period_s that is a whole number of rows",
        );
    }
    Ok(ReadingRows {
        rows: rows as u32,
        seconds,
    })
}

/// The words of a row that the correction takes, each with its position among the correction's inputs: those that
/// are inputs, then the rate (`None`).
///
/// # Errors
/// A chain that gives no rate; a correction without an input from the chain, or with the same one twice; an input
/// whose scale is below two LSB of the chain's word; tuning words of too many bits.
pub fn columns(design: &Design, plan: &Plan) -> Result<Vec<(Column, Option<usize>)>> {
    full_scale_dps(design)?;
    let mut chosen = Vec::new();
    for (source, name) in Source::INPUTS {
        // Without a phase loop the frequency is a constant of the design and no word of a row.
        if source == Source::TuningWord && design.circuit.phase_loop.is_none() {
            continue;
        }
        let inputs = plan.inputs.iter().enumerate();
        let mut of_column = inputs.filter(|(_, input)| input.column == name);
        let Some((k, input)) = of_column.next() else {
            continue;
        };
        if of_column.next().is_some() {
            let what = format!("two inputs are `{name}`");
            let help = "name each column of the chain once: a term takes any power of its input";
            return Err(design.error_at("correction", what).help(help).into());
        }
        if source == Source::TuningWord && design.circuit.nco.phase_bits > MOST_TUNING_BITS {
            let bits = design.circuit.nco.phase_bits;
            let what = format!(
                "tuning words have {bits} bits, and the conversion of `{name}` takes {MOST_TUNING_BITS}"
            );
            let help = "give circuit.nco.phase_bits fewer bits";
            return Err(design.error_at("correction", what).help(help).into());
        }
        let column = Column::new(design, source)?;
        if column.lsb > COARSEST * input.scale.abs() {
            let (scale, lsb) = (input.scale, column.lsb);
            let what = format!(
                "the scale of `{name}` is {scale:?}, and one LSB of the chain's word is {lsb:e}"
            );
            let help = "give a larger scale, or more bits to the chain's word";
            return Err(design.error_at("correction", what).help(help).into());
        }
        chosen.push((column, Some(k)));
    }
    if chosen.is_empty() {
        let what = "none of its inputs is a word of the chain";
        let help = match design.circuit.phase_loop {
            Some(_) => {
                "the chain has phase_rad, freq_hz and quad_dps; emit `--part chain` and `--part correction` apart"
            }
            None => {
                "the chain has phase_rad and quad_dps (freq_hz with a phase loop); emit `--part chain` and `--part correction` apart"
            }
        };
        return Err(design.error_at("correction", what).help(help).into());
    }
    chosen.push((Column::new(design, Source::SenseI)?, None));
    Ok(chosen)
}

/// deg/s of sense I = 1, which the compensation states.
fn full_scale_dps(design: &Design) -> Result<f64> {
    let of_chain = design
        .compensation
        .as_ref()
        .filter(|c| c.input.is_of_chain());
    let missing = || {
        InputError::new("the chain has no rate in deg/s for the correction: that takes a [compensation] whose input is the chain's own (`phase`, `tuning_word`)")
            .help("add one, with its rate_full_scale_dps, or emit `--part correction` alone and scale the rate yourself")
    };
    Ok(of_chain.ok_or_else(missing)?.rate_full_scale_dps)
}
