//! One circuit, float or fixed, around one gyro.

use super::inexact::Inexact;
use super::rest::{self, Rest};
use crate::circuit::engine::{self, ArithmeticKind, Engine, Rows};
use crate::circuit::followers::Followers;
use crate::circuit::scale::oscillator_hz;
use crate::design::Design;
use crate::error::{Error, Result};
use crate::numeric::fixed::Overflowed;
use crate::numeric::format::pow2;
use crate::plant::Gyroscope;
use crate::plant::converter::{Channel, Converter};
use crate::plant::gyroscope::{Conditions, Drive, Reference};
use crate::plant::noise::Pairs;
use std::f64::consts::TAU;

/// What a decimated sample says, in physical units.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RealRow {
    /// Drive I, drive Q, sense I, sense Q, as values of the decimator's output.
    pub channels: [f64; 4],
    /// Drive phase, rad, in [-pi, pi).
    pub phase_rad: f64,
    /// Drive magnitude, as a value of the decimator's output.
    pub magnitude: f64,
    /// Compensated rate, deg/s; NaN without compensation in the chain.
    pub rate_dps: f64,
    /// The oscillator's frequency while this row's samples were taken, Hz.
    pub freq_hz: f64,
    /// The drive gain while this row's samples were taken, 0 to 1.
    pub gain: f64,
}

/// A circuit in closed loop with a gyro. Both start at sample 0.
pub struct Path {
    engine: Box<dyn Engine>,
    /// Circuits that are alike in what is done at the sample rate and in how they excite the gyro.
    others: Followers,
    /// Of these, by their places.
    other_units: Vec<Units>,
    other_rows: Vec<Rows>,
    kind: ArithmeticKind,
    /// The gyro.
    pub gyroscope: Gyroscope,
    converters: [Converter; 2],
    inexact: Inexact,
    units: Units,
    /// rms of what is added to the drive and to the sense input, LSB.
    noise_lsb: [f64; 2],
    nominal_gain: f64,
    drive_lsb: Vec<f64>,
    sense_lsb: Vec<f64>,
    /// Noise of rms 1 of the drive and of the sense input.
    noise: [Vec<f32>; 2],
    codes: [Vec<i32>; 2],
    rows: Rows,
    /// What the last period's samples were taken under.
    last_drive: Drive,
    sample: u64,
}

/// From a row's columns to physical units.
#[derive(Debug, Clone)]
struct Units {
    sample_rate_hz: f64,
    /// Positions of phase, magnitude and rate.
    phase: usize,
    magnitude: usize,
    rate: Option<usize>,
    columns: usize,
    channel_lsb: f64,
    phase_lsb_rad: f64,
    rate_lsb_dps: f64,
}

impl Units {
    fn new(design: &Design, kind: ArithmeticKind) -> Self {
        let columns = engine::columns(design);
        let position = |name: &str| columns.iter().position(|c| *c == name);
        let circuit = &design.circuit;
        let turn = pow2(-(circuit.cordic.angle_bits as i32)) * TAU;
        let rate_lsb = design.compensation.as_ref().map(|c| c.output.format.lsb());
        let fixed = kind == ArithmeticKind::Fixed;
        let unit = |lsb: f64, real: f64| if fixed { lsb } else { real };
        Units {
            sample_rate_hz: circuit.sample_rate_hz,
            phase: position("phase").unwrap_or(0),
            magnitude: position("magnitude").unwrap_or(0),
            rate: position("rate"),
            columns: columns.len(),
            channel_lsb: unit(circuit.decimator.output.format.lsb(), 1.0),
            phase_lsb_rad: unit(turn, TAU),
            rate_lsb_dps: unit(rate_lsb.unwrap_or(1.0), 1.0),
        }
    }

    /// The row in physical units; `drive` is what its samples were taken under.
    fn row(&self, rows: &Rows, drive: Drive) -> RealRow {
        let mut row = [0.0; 9];
        let at = row.iter_mut().take(self.columns);
        match rows {
            Rows::Integer(words) => at.zip(words).for_each(|(to, word)| *to = *word as f64),
            Rows::Wide(words) => at.zip(words).for_each(|(to, word)| *to = *word as f64),
            Rows::Real(values) => at.zip(values).for_each(|(to, value)| *to = *value),
        }
        let [a, b, c, d, ..] = row;
        RealRow {
            channels: [a, b, c, d].map(|v| v * self.channel_lsb),
            phase_rad: row[self.phase] * self.phase_lsb_rad,
            magnitude: row[self.magnitude] * self.channel_lsb,
            rate_dps: self.rate.map_or(f64::NAN, |k| row[k] * self.rate_lsb_dps),
            freq_hz: drive.step as i64 as f64 * pow2(-64) * self.sample_rate_hz,
            gain: drive.gain,
        }
    }
}

impl Path {
    /// A circuit and a gyro that have not started.
    pub fn new(design: &Design, kind: ArithmeticKind) -> Self {
        let circuit = &design.circuit;
        let run = &design.thermal_run;
        let adc_bits = circuit.adc.format.bits();
        let full_scale_lsb = pow2(adc_bits as i32 - 1);
        let reference = Reference {
            sample_rate_hz: circuit.sample_rate_hz,
            full_scale_lsb,
            excitation_hz: oscillator_hz(design),
            tracking: circuit.phase_loop.is_some(),
            held_amplitude: circuit.amplitude_loop.is_some(),
            nominal_gain: rest::nominal_gain(design),
        };
        // White noise of rms s at the sense input has, demodulated, the one-sided density 2 s / sqrt(fs).
        let rate_lsb = full_scale_lsb / run.sense_full_scale_dps
            * run.rate_noise_dps_rthz
            * circuit.sample_rate_hz.sqrt()
            / 2.0;
        let engine = engine::engine(design, kind);
        let ratio = circuit.decimator.ratio as usize;
        Path {
            rows: engine.no_rows(),
            engine,
            others: Followers::default(),
            other_units: Vec::new(),
            other_rows: Vec::new(),
            kind,
            gyroscope: Gyroscope::new(&design.gyro, run, reference),
            converters: [Channel::Drive, Channel::Sense]
                .map(|channel| Converter::new(&design.gyro.effects, channel, adc_bits)),
            inexact: Inexact::new(design),
            units: Units::new(design, kind),
            noise_lsb: [run.adc_noise_lsb, rate_lsb.hypot(run.adc_noise_lsb)],
            nominal_gain: rest::nominal_gain(design),
            drive_lsb: vec![0.0; ratio],
            sense_lsb: vec![0.0; ratio],
            noise: [vec![0.0; ratio], vec![0.0; ratio]],
            codes: [vec![0; ratio], vec![0; ratio]],
            last_drive: Drive {
                phase: 0,
                step: 0,
                gain: 0.0,
            },
            sample: 0,
        }
    }

    /// Has another design's circuit make rows of the same run, before the first period: one that
    /// [shares the closed loop](crate::circuit::ensemble::share_a_closed_loop) with this, around the same gyro.
    pub fn share_with(&mut self, design: &Design) {
        self.others.add(design, self.kind, self.other_units.len());
        self.other_units.push(Units::new(design, self.kind));
        self.other_rows.push(self.engine.no_rows());
    }

    /// The rows of those circuits for the last period, in the order in which they came.
    pub fn other_rows(&self) -> impl Iterator<Item = RealRow> {
        let others = self.other_units.iter().zip(&self.other_rows);
        others.map(|(units, rows)| units.row(rows, self.last_drive))
    }

    /// Puts gyro, loops and decimator into the steady state under `conditions`: the loops are held at
    /// rest, row after row, until the decimator has forgotten what was before.
    ///
    /// # Errors
    /// A phase loop whose setpoint is no phase of the resonance; a circuit that stops on an overflow.
    pub fn warm_start(
        &mut self,
        design: &Design,
        conditions: Conditions,
        noise: &impl Pairs,
    ) -> Result<Rest> {
        self.gyroscope.set(conditions);
        let rest = rest::rest(design, &self.gyroscope)?;
        let decimator = &design.circuit.decimator;
        for _ in 0..decimator.stages * decimator.differential_delay {
            self.hold(rest);
            self.gyroscope.settle(self.drive());
            self.period(noise)?;
        }
        self.hold(rest);
        self.gyroscope.settle(self.drive());
        Ok(rest)
    }

    fn hold(&mut self, rest: Rest) {
        self.engine.hold(rest.held);
        for (_, engine) in self.others.engines() {
            engine.hold(rest.held);
        }
    }

    /// Puts the gyro into the motion that the circuit as it starts excites; the loops act from there.
    pub fn start(&mut self, conditions: Conditions) {
        self.gyroscope.set(conditions);
        self.gyroscope.settle(self.drive());
    }

    /// What the circuit drives the gyro with now.
    pub fn drive(&self) -> Drive {
        let e = self.engine.excitation();
        Drive {
            phase: e.phase,
            step: e.step,
            gain: e.gain.unwrap_or(self.nominal_gain),
        }
    }

    /// The drive gain relative to nominal.
    pub fn relative_gain(&self, row: &RealRow) -> f64 {
        row.gain / self.nominal_gain
    }

    /// ADC samples so far.
    pub fn samples(&self) -> u64 {
        self.sample
    }

    /// One decimation period. `noise`: a stream that is indexed by the sample's number.
    ///
    /// # Errors
    /// A circuit that stops on an overflow.
    pub fn period(&mut self, noise: &impl Pairs) -> Result<RealRow> {
        let drive = self.drive();
        self.gyroscope
            .block(drive, &mut self.drive_lsb, &mut self.sense_lsb);
        self.inexact.apply(
            &self.gyroscope,
            drive.step,
            self.sample,
            [&mut self.drive_lsb, &mut self.sense_lsb],
        );
        let [drive_rms, sense_rms] = self.noise_lsb;
        if drive_rms != 0.0 || sense_rms != 0.0 {
            noise.fill(self.sample, self.noise.each_mut().map(|n| &mut n[..]));
        }
        self.sample += self.drive_lsb.len() as u64;
        self.rows.clear();
        let [drive_adc, sense_adc] = &self.converters;
        let [drive_noise, sense_noise] = &self.noise;
        match self.kind {
            ArithmeticKind::Float => {
                drive_adc.front_end(&mut self.drive_lsb, drive_rms, drive_noise);
                sense_adc.front_end(&mut self.sense_lsb, sense_rms, sense_noise);
                self.engine
                    .process_inputs(&self.drive_lsb, &self.sense_lsb, &mut self.rows)
            }
            ArithmeticKind::Fixed => {
                let [d, s] = &mut self.codes;
                drive_adc.codes(&self.drive_lsb, drive_rms, drive_noise, d);
                sense_adc.codes(&self.sense_lsb, sense_rms, sense_noise, s);
                self.engine.process(d, s, &mut self.rows)
            }
        }
        .map_err(stopped)?;
        self.last_drive = drive;
        if !self.others.is_empty() {
            self.other_rows.iter_mut().for_each(Rows::clear);
            let mut result = Ok(());
            let front = [self.engine.front()];
            self.others
                .follow(&front, &mut self.other_rows, |_, overflowed| {
                    if result.is_ok() {
                        result = Err(stopped(overflowed));
                    }
                });
            result?;
        }
        Ok(self.units.row(&self.rows, drive))
    }

    /// The codes of the last period, drive and sense (bit-accurate path only).
    pub fn codes(&self) -> [&[i32]; 2] {
        [&self.codes[0], &self.codes[1]]
    }
}

fn stopped(overflowed: Box<Overflowed>) -> Error {
    Error::Check(overflowed.to_string())
}
