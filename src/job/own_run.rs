//! The design's own thermal run: plant, ADC codes, circuit, in one stream without a break.

use super::firmware::Firmware;
use super::formats;
use super::outcome::Point;
use super::{clamped_bias, compensation, warning};
use crate::circuit::engine::{self, ArithmeticKind, Rows};
use crate::closure::BaselineFit;
use crate::design::{CompensationInput, Design};
use crate::error::{Error, InputError, Result};
use crate::numeric::format::pow2;
use crate::plant::{Reading, Sampling, ThermalPlant};
use crate::record::Warning;
use std::f64::consts::TAU;

/// Rows dropped at the start of a reading, beyond the decimator's memory.
const SETTLING_ROWS: usize = 8;

/// Codes of the whole run and what the uncompensated circuit makes of them.
pub struct OwnRun {
    readings: Vec<Reading>,
    drive: Vec<i32>,
    sense: Vec<i32>,
    rows_per_reading: usize,
    settling_rows: usize,
    /// Mean phase (rad) and rate output (deg/s) of each reading, bit-accurate.
    measured: Vec<(f64, f64)>,
}

impl OwnRun {
    /// Simulates the run and passes it through the circuit without compensation.
    ///
    /// # Errors
    /// A circuit that stops on an overflow; a design whose readings are too long to hold.
    pub fn simulate(design: &Design) -> Result<Self> {
        let circuit = &design.circuit;
        let run = &design.thermal_run;
        if circuit.phase_loop.is_some() {
            return Err(InputError::new(
                "the design has a phase loop, which holds the drive phase: it is no thermometer then, and \
                 the own thermal run drives at a fixed frequency",
            )
            .help("leave [circuit.phase_loop] out, or give a measured record with --record")
            .into());
        }
        let plant = ThermalPlant::new(
            &design.gyro,
            run,
            Sampling {
                sample_rate_hz: circuit.sample_rate_hz,
                adc_bits: circuit.adc.format.bits(),
                tuning_word: circuit.nco.tuning_word,
                phase_bits: circuit.nco.phase_bits,
            },
        );
        let own = design
            .compensation
            .as_ref()
            .filter(|_| design.compensation_is_own);
        if let Some(c) = own
            && c.input != CompensationInput::Phase
        {
            return Err(InputError::new(format!(
                "the compensation's input is {}, the own thermal run's thermometer is the drive phase",
                formats::column_of(c)
            ))
            .help("give a measured record with --record, or set compensation.input = \"phase\"")
            .into());
        }
        let ratio = circuit.decimator.ratio as usize;
        let memory = (circuit.decimator.stages * circuit.decimator.differential_delay) as usize;
        let settling_rows = memory + SETTLING_ROWS;
        let rows_per_reading = settling_rows + run.samples_per_reading as usize;
        let samples = rows_per_reading * ratio;
        let readings = plant.readings(samples as f64 / circuit.sample_rate_hz);
        const LIMIT: usize = 1 << 28;
        if samples.saturating_mul(readings.len()) > LIMIT {
            return Err(InputError::new(format!(
                "the thermal run has {} readings of {samples} ADC samples, more than {LIMIT} in all",
                readings.len()
            ))
            .help("lower thermal_run.samples_per_reading or readings_per_dwell, or raise step_k")
            .into());
        }
        let (mut drive, mut sense) = (Vec::new(), Vec::new());
        for (k, reading) in readings.iter().enumerate() {
            // The NCO runs on from reading to reading, and so does the excitation.
            let first = crate::plant::thermal_run::FIRST_SAMPLE + (k * samples) as u64;
            let (d, s) = plant.codes_from(reading, first, samples);
            drive.extend(d);
            sense.extend(s);
        }
        let mut own = OwnRun {
            readings,
            drive,
            sense,
            rows_per_reading,
            settling_rows,
            measured: Vec::new(),
        };
        own.measured = own.uncompensated(design, ArithmeticKind::Fixed)?;
        Ok(own)
    }

    /// The run as a thermal record (`docs/manual.md`): what the closure sees of it.
    pub fn record_csv(&self) -> String {
        let mut text = String::from("time_s,chamber_degc,phase_rad,rate_out_dps\n");
        for (reading, (phase, rate)) in self.readings.iter().zip(&self.measured) {
            text += &format!(
                "{:.3},{:.3},{phase:.9},{rate:.7}\n",
                reading.time_s, reading.chamber_degc
            );
        }
        text
    }

    /// Where the design's own numbers do not fit each other.
    pub fn warnings(&self, design: &Design) -> Vec<Warning> {
        let circuit = &design.circuit;
        let mut warnings = Vec::new();
        let word = circuit.nco.tuning_word as f64;
        let nco_hz = word * pow2(-(circuit.nco.phase_bits as i32)) * circuit.sample_rate_hz;
        let drive_hz = design.gyro.drive_frequency_hz;
        if (nco_hz / drive_hz - 1.0).abs() > 1e-3 {
            warnings.push(warning(
                "excitation_off_resonance",
                format!("the NCO runs at {nco_hz:.3} Hz, the gyro resonates at {drive_hz} Hz"),
            ));
        }
        let nominal = formats::nominal_full_scale_dps(design);
        if let Some(c) = &design.compensation
            && (c.rate_full_scale_dps / nominal - 1.0).abs() > 0.01
        {
            warnings.push(warning(
                "scale_factor",
                format!(
                    "compensation.rate_full_scale_dps is {}, sense I of this run has a full scale of \
                     {nominal:.3} deg/s (a power of two is wanted): rates and drift come out {:.4} times as large",
                    c.rate_full_scale_dps,
                    c.rate_full_scale_dps / nominal
                ),
            ));
        }
        warnings
    }

    /// Mean phase and rate output of each reading, without compensation.
    fn uncompensated(&self, design: &Design, kind: ArithmeticKind) -> Result<Vec<(f64, f64)>> {
        let rows = self.rows(design, kind)?;
        let scale = full_scale(design);
        Ok(rows
            .iter()
            .map(|reading| {
                let phase = mean(reading.iter().map(|r| r.phase_rad));
                (phase, mean(reading.iter().map(|r| r.sense_i * scale)))
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
            .process(&self.drive, &self.sense, &mut rows)
            .map_err(|o| Error::Check(o.to_string()))?;
        let lsb = design.circuit.decimator.output.format.lsb();
        let turn = pow2(-(design.circuit.cordic.angle_bits as i32));
        let real: Vec<RealRow> = match &rows {
            Rows::Integer(words) => words
                .chunks_exact(columns)
                .map(|r| RealRow {
                    sense_i: r[2] as f64 * lsb,
                    phase_rad: r[4] as f64 * turn * TAU,
                })
                .collect(),
            Rows::Real(values) => values
                .chunks_exact(columns)
                .map(|r| RealRow {
                    sense_i: r[2],
                    phase_rad: r[4] * TAU,
                })
                .collect(),
        };
        let readings = real.chunks_exact(self.rows_per_reading);
        Ok(readings.map(|r| r[self.settling_rows..].to_vec()).collect())
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
    ) -> Result<Vec<Point>> {
        let scale = full_scale(design);
        let float: Vec<f64> = self
            .rows(design, ArithmeticKind::Float)?
            .iter()
            .map(|rows| {
                let rates = rows
                    .iter()
                    .map(|r| r.sense_i * scale - clamped_bias(fit, r.phase_rad));
                mean(rates)
            })
            .collect();
        let columns = engine::columns(design);
        let rate = columns.iter().position(|c| *c == "rate").unwrap_or(0);
        let lsb = compensation(design)?.output.format.lsb();
        let rate_of = |words: &[i64]| self.mean_column(words, columns.len(), rate, lsb);
        let mut engine = engine::engine(design, ArithmeticKind::Fixed);
        let mut rows = engine.no_rows();
        engine
            .process(&self.drive, &self.sense, &mut rows)
            .map_err(|o| Error::Check(o.to_string()))?;
        let fixed: Vec<i64> = match rows {
            Rows::Integer(words) => words.iter().map(|w| *w as i64).collect(),
            Rows::Real(_) => Vec::new(),
        };
        let fixed = rate_of(&fixed);
        let c = rate_of(&firmware.c.chain(&self.drive, &self.sense, columns.len())?);
        let rust = rate_of(
            &firmware
                .rust
                .chain(&self.drive, &self.sense, columns.len())?,
        );
        let missing = f64::NAN;
        let at = |values: &[f64], k: usize| values.get(k).copied().unwrap_or(missing);
        Ok(self
            .readings
            .iter()
            .zip(&self.measured)
            .enumerate()
            .map(|(k, (reading, (phase, rate)))| Point {
                time_s: reading.time_s,
                thermometer: *phase,
                temperature_degc: reading.chamber_degc,
                heating: reading.heating,
                before_dps: *rate,
                float_dps: at(&float, k),
                fixed_dps: at(&fixed, k),
                c_dps: at(&c, k),
                rust_dps: at(&rust, k),
            })
            .collect())
    }

    /// The mean of a column over each reading after settling.
    fn mean_column(&self, words: &[i64], columns: usize, column: usize, lsb: f64) -> Vec<f64> {
        words
            .chunks_exact(columns * self.rows_per_reading)
            .map(|reading| {
                let rows = reading.chunks_exact(columns).skip(self.settling_rows);
                mean(rows.map(|row| row[column] as f64 * lsb))
            })
            .collect()
    }
}

#[derive(Debug, Clone, Copy)]
struct RealRow {
    sense_i: f64,
    phase_rad: f64,
}

fn mean(values: impl Iterator<Item = f64>) -> f64 {
    let (sum, count) = values.fold((0.0, 0usize), |(s, n), v| (s + v, n + 1));
    sum / count.max(1) as f64
}

/// Sense I in deg/s is its value times this.
fn full_scale(design: &Design) -> f64 {
    let own = design.compensation.as_ref().map(|c| c.rate_full_scale_dps);
    own.unwrap_or_else(|| formats::power_of_two_near(formats::nominal_full_scale_dps(design)))
}
