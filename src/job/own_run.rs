//! The design's own thermal run: plant and circuit in closed loop, in one stream without a break.

use super::formats;
use super::points::{Point, Points};
use super::{clamped_bias, compensation, warning};
use crate::circuit::engine::{self, ArithmeticKind, Rows};
use crate::circuit::scale::{excitation_is_off, full_scale_is_off};
use crate::circuit::vector_width::{self, TooShort};
use crate::cosim::scale::full_scale_dps;
use crate::cosim::surroundings::Moment;
use crate::cosim::{readings, stream};
use crate::design::{CompensationInput, Design};
use crate::emit::views::Language;
use crate::error::{Error, InputError, Result};
use crate::nodes::repair::{self, Repair};
use crate::nodes::run;
use crate::numeric::format::pow2;
use crate::plant::profile::{Profile, Reading};
use crate::record::Warning;
use crate::thermal::BaselineFit;
use crate::verify::firmware::Firmware;
use serde::Serialize;
use std::f64::consts::TAU;

/// The code of the warning that x or y of the CORDIC wraps.
const WRAPS: &str = "cordic_width";

/// A word that overflows in a run.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, schemars::JsonSchema)]
pub struct Overflowing {
    /// The dotted key of the first one.
    pub word: String,
    /// The smallest formats that hold every word of the run; empty where none does.
    pub repairs: Vec<Repair>,
}

impl Overflowing {
    /// What to change, in words; `None` where nothing mends it.
    pub fn mend(&self) -> Option<String> {
        let changes: Vec<String> = self.repairs.iter().map(Repair::change).collect();
        (!changes.is_empty())
            .then(|| format!("The smallest change that mends it: {}", changes.join(", ")))
    }
}

/// Codes of the whole run and what the uncompensated circuit makes of them.
pub struct OwnRun {
    readings: Vec<Reading>,
    moments: Vec<Moment>,
    stream: stream::Stream,
    /// Mean thermometer (rad or Hz) and rate output (deg/s) of each reading, bit-accurate.
    measured: Vec<(f64, f64)>,
    tracking: bool,
}

impl OwnRun {
    /// Simulates the run and passes it through the circuit without compensation.
    ///
    /// # Errors
    /// A circuit that stops on an overflow or a loop that does not settle; a design whose readings are too
    /// long to hold; a compensation in a channel that the run does not have.
    pub fn simulate(design: &Design) -> Result<Self> {
        let own = design
            .compensation
            .as_ref()
            .filter(|_| design.compensation_is_own);
        if let Some(c) = own
            && let CompensationInput::Channel(_) = c.input
        {
            return Err(InputError::new(format!(
                "the compensation's input is {}, the own thermal run's thermometer is the circuit's own",
                formats::column_of(c)
            ))
            .help("give a measured record with --record, or set compensation.input to \"phase\" or \"tuning_word\"")
            .into());
        }
        let uncompensated = Design {
            compensation: None,
            ..design.clone()
        };
        let rows = stream::rows_per_reading(design)?;
        let samples = rows * design.circuit.decimator.ratio as usize;
        let reading_s = samples as f64 / design.circuit.sample_rate_hz;
        let (profile, readings) = Profile::of_run(&design.thermal_run, reading_s);
        let moments = readings::moments(design, &profile, &readings);
        let stream = stream::stream(&uncompensated, &moments)?;
        let mut own = OwnRun {
            readings,
            moments,
            stream,
            measured: Vec::new(),
            tracking: design.circuit.phase_loop.is_some(),
        };
        own.measured = own.uncompensated(design, ArithmeticKind::Fixed)?;
        Ok(own)
    }

    /// The run as a thermal record (`docs/manual.md`): what the closure sees of it.
    pub fn record_csv(&self) -> String {
        let thermometer = if self.tracking {
            "freq_hz"
        } else {
            "phase_rad"
        };
        let mut text = format!("time_s,chamber_degc,{thermometer},rate_out_dps\n");
        let rows = self.readings.iter().zip(&self.moments).zip(&self.measured);
        for ((reading, moment), (thermometer, rate)) in rows {
            text += &format!(
                "{:.3},{:.3},{thermometer:.9},{rate:.7}\n",
                reading.time_s, moment.temperatures.chamber_degc
            );
        }
        text
    }

    /// Where the design's own numbers do not fit each other.
    pub fn warnings(&self, design: &Design) -> Vec<Warning> {
        let mut warnings = Vec::new();
        if let Some((what, mend)) = excitation_is_off(design) {
            warnings.push(warning(
                "excitation_off_resonance",
                format!("{what}. To mend it, {mend}"),
            ));
        }
        if let Some((what, mend)) = full_scale_is_off(design) {
            warnings.push(warning(
                "scale_factor",
                format!("{what}. To mend it, {mend}"),
            ));
        }
        if let Some(said) = self.vector_wraps(design) {
            warnings.push(warning(WRAPS, said));
        }
        warnings
    }

    /// What is to be said where x and y of the CORDIC wrap in this run.
    fn vector_wraps(&self, design: &Design) -> Option<String> {
        // Most designs are proved not to, and need no second run.
        let short = TooShort::of(design)?;
        let uncompensated = Design {
            compensation: None,
            ..design.clone()
        };
        let seen = run::run(&uncompensated, &self.stream.drive, &self.stream.sense);
        let first = seen.first_overflow.as_ref();
        let first = first.filter(|event| event.label.key == vector_width::KEY)?;
        Some(format!(
            "x or y of the CORDIC wraps, first at sample {}; {}. The drive phase is wrong wherever they wrap, and with it the fit and the \
             drift after compensation",
            first.sample,
            short.sentence()
        ))
    }

    /// The first word of a design that overflows on the run's codes, and the formats that hold them.
    pub fn overflow(&self, design: &Design) -> Option<Overflowing> {
        let (drive, sense) = (&self.stream.drive, &self.stream.sense);
        let seen = run::run(design, drive, sense);
        let word = seen.first_overflow.as_ref()?.label.key.to_owned();
        let (repairs, _) = repair::repairs(design, &seen, (drive, sense));
        Some(Overflowing { word, repairs })
    }

    /// Mean thermometer and rate output of each reading, without compensation.
    fn uncompensated(&self, design: &Design, kind: ArithmeticKind) -> Result<Vec<(f64, f64)>> {
        let rows = self.rows(design, kind)?;
        let scale = full_scale_dps(design);
        Ok(rows
            .iter()
            .map(|reading| {
                let thermometer = mean(reading.iter().map(|r| r.thermometer));
                (thermometer, mean(reading.iter().map(|r| r.sense_i * scale)))
            })
            .collect())
    }

    /// The rows of each reading after settling, in real units.
    fn rows(&self, design: &Design, kind: ArithmeticKind) -> Result<Vec<Vec<RealRow>>> {
        let mut design = design.clone();
        design.compensation = None;
        let columns = engine::columns(&design).len();
        let mut engine = engine::engine(&design, kind);
        let mut rows = engine.no_rows();
        engine
            .process(&self.stream.drive, &self.stream.sense, &mut rows)
            .map_err(|o| Error::Check(o.to_string()))?;
        let circuit = &design.circuit;
        let lsb = circuit.decimator.output.format.lsb();
        let turn = pow2(-(circuit.cordic.angle_bits as i32)) * TAU;
        let word_hz = circuit.sample_rate_hz * pow2(-(circuit.nco.phase_bits as i32));
        // Sense I, thermometer: their columns, and what an LSB is.
        let (column, integer, real) = if self.tracking {
            (TUNING_WORD, word_hz, 1.0)
        } else {
            (PHASE, turn, TAU)
        };
        let row = |sense_i: f64, thermometer: f64| RealRow {
            sense_i,
            thermometer,
        };
        let real: Vec<RealRow> = match &rows {
            Rows::Integer(words) => words
                .chunks_exact(columns)
                .map(|r| row(r[SENSE_I] as f64 * lsb, r[column] as f64 * integer))
                .collect(),
            Rows::Wide(words) => words
                .chunks_exact(columns)
                .map(|r| row(r[SENSE_I] as f64 * lsb, r[column] as f64 * integer))
                .collect(),
            Rows::Real(values) => values
                .chunks_exact(columns)
                .map(|r| row(r[SENSE_I], r[column] * real))
                .collect(),
        };
        let readings = real.chunks_exact(self.stream.rows_per_reading);
        Ok(readings
            .map(|r| r[self.stream.settling_rows..].to_vec())
            .collect())
    }

    /// Every reading through every path: float with the fit's own coefficients, the bit-accurate
    /// chain, the emitted chains.
    ///
    /// # Errors
    /// A circuit that stops on an overflow; a driver that cannot be run.
    pub fn points(
        &self,
        design: &Design,
        fit: &BaselineFit,
        firmware: &Firmware,
    ) -> Result<Points> {
        let float = self.float_dps(design, fit)?;
        let fixed = self.fixed_dps(design)?;
        let (columns, rate, lsb) = rate_column(design)?;
        let rate_of = |words: &[i64]| self.mean_column(words, columns, rate, lsb);
        let emitted = |language| -> Result<Option<Vec<f64>>> {
            let Some(built) = firmware.built(language) else {
                return Ok(None);
            };
            let (drive, sense) = (&self.stream.drive, &self.stream.sense);
            let every = crate::vectors::chain::columns(design).len();
            let rows = built.chain(drive, sense, every)?;
            // The columns of `replay` come first.
            let rows = rows.chunks_exact(every).flat_map(|row| &row[..columns]);
            let rows: Vec<i64> = rows.copied().collect();
            Ok(Some(rate_of(&rows)))
        };
        let (c, rust) = (emitted(Language::C)?, emitted(Language::Rust)?);
        let missing = f64::NAN;
        let at = |values: &[f64], k: usize| values.get(k).copied().unwrap_or(missing);
        let readings = self.readings.iter().zip(&self.moments).zip(&self.measured);
        Ok(readings
            .enumerate()
            .map(|(k, ((reading, moment), (thermometer, rate)))| Point {
                time_s: reading.time_s,
                thermometer: *thermometer,
                temperature_degc: moment.temperatures.chamber_degc,
                heating: reading.heating,
                before_dps: *rate,
                float_dps: at(&float, k),
                fixed_dps: at(&fixed, k),
                c_dps: c.as_ref().map(|dps| at(dps, k)),
                rust_dps: rust.as_ref().map(|dps| at(dps, k)),
            })
            .collect::<Vec<_>>()
            .into())
    }

    /// Every reading's rate through the float circuit and the fit's own coefficients, deg/s.
    ///
    /// # Errors
    /// A circuit that stops on an overflow.
    pub fn float_dps(&self, design: &Design, fit: &BaselineFit) -> Result<Vec<f64>> {
        let scale = full_scale_dps(design);
        let rows = self.rows(design, ArithmeticKind::Float)?;
        let rates = rows.iter().map(|rows| {
            let rates = rows
                .iter()
                .map(|r| r.sense_i * scale - clamped_bias(fit, r.thermometer));
            mean(rates)
        });
        Ok(rates.collect())
    }

    /// Every reading's rate through the bit-accurate chain of a design, which need not be that of the run, deg/s.
    ///
    /// # Errors
    /// A circuit that stops on an overflow.
    pub fn fixed_dps(&self, design: &Design) -> Result<Vec<f64>> {
        let (columns, rate, lsb) = rate_column(design)?;
        let mut engine = engine::engine(design, ArithmeticKind::Fixed);
        let mut rows = engine.no_rows();
        engine
            .process(&self.stream.drive, &self.stream.sense, &mut rows)
            .map_err(|o| Error::Check(o.to_string()))?;
        let fixed: Vec<i64> = match rows {
            Rows::Integer(words) => words,
            Rows::Wide(words) => words.iter().map(|w| *w as i64).collect(),
            Rows::Real(_) => Vec::new(),
        };
        Ok(self.mean_column(&fixed, columns, rate, lsb))
    }

    /// The mean of a column over each reading after settling.
    fn mean_column(&self, words: &[i64], columns: usize, column: usize, lsb: f64) -> Vec<f64> {
        words
            .chunks_exact(columns * self.stream.rows_per_reading)
            .map(|reading| {
                let rows = reading
                    .chunks_exact(columns)
                    .skip(self.stream.settling_rows);
                mean(rows.map(|row| row[column] as f64 * lsb))
            })
            .collect()
    }
}

/// Columns of a row, which of them is the rate, and its LSB in deg/s.
fn rate_column(design: &Design) -> Result<(usize, usize, f64)> {
    let columns = engine::columns(design);
    let rate = columns.iter().position(|c| *c == "rate").unwrap_or(0);
    let lsb = compensation(design)?.output.format.lsb();
    Ok((columns.len(), rate, lsb))
}

#[derive(Debug, Clone, Copy)]
struct RealRow {
    sense_i: f64,
    /// rad or Hz.
    thermometer: f64,
}

/// Columns of a row without compensation ([`engine::columns`]).
const SENSE_I: usize = 2;
const PHASE: usize = 4;
const TUNING_WORD: usize = 6;

fn mean(values: impl Iterator<Item = f64>) -> f64 {
    let (sum, count) = values.fold((0.0, 0usize), |(s, n), v| (s + v, n + 1));
    sum / count.max(1) as f64
}

/// All warnings of a simulated run. Where the circuit overflows, what its record and its fit show is the circuit's doing, and no
/// record is to be mended.
pub fn all_warnings(
    of_record: Vec<Warning>,
    of_fit: Vec<Warning>,
    of_run: Vec<Warning>,
) -> Vec<Warning> {
    if of_run.iter().any(|w| w.code == WRAPS) {
        return of_run;
    }
    let mut all = of_record;
    Warning::add_of_fit(&mut all, of_fit);
    all.extend(of_run);
    all
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::design::{reader, template};

    /// The words that warn of a width, of the default with this one.
    fn warned(width: u32) -> Vec<String> {
        let text = template::DEFAULT
            .replacen("width = 32", &format!("width = {width}"), 1)
            .replacen("samples_per_reading = 512", "samples_per_reading = 16", 1)
            .replacen("readings_per_dwell = 3", "readings_per_dwell = 1", 1)
            .replacen("step_k = 5.0", "step_k = 35.0", 1);
        let design = reader::parse(&text, None).unwrap();
        let warnings = OwnRun::simulate(&design).unwrap().warnings(&design);
        let of_width = warnings.into_iter().filter(|w| w.code == "cordic_width");
        of_width.map(|w| w.message).collect()
    }

    #[test]
    fn where_the_circuit_overflows_the_record_is_not_blamed() {
        let codes = |of_run: &'static str| -> Vec<&str> {
            let [record, fit, run] = ["error_values", "thermometer_range_small", of_run]
                .map(|code| vec![warning(code, String::new())]);
            all_warnings(record, fit, run)
                .iter()
                .map(|w| w.code)
                .collect()
        };
        assert_eq!(codes("cordic_width"), ["cordic_width"]);
        assert_eq!(
            codes("scale_factor"),
            ["error_values", "thermometer_range_small", "scale_factor"]
        );
    }

    #[test]
    fn a_run_says_that_its_vectors_wrap_and_what_to_write() {
        let said = warned(26);
        assert!(
            matches!(&said[..], [one] if one.contains("need 31 bits") && one.contains("write `width = 31`")),
            "{said:?}"
        );
        // Not proved to hold every code, and holds those of this run.
        assert!(warned(30).is_empty());
        assert!(warned(32).is_empty());
    }
}
