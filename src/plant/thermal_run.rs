//! The thermal run: a chamber that steps from start to stop and back, and what both ADCs give at
//! each reading.
//!
//! The chamber ramps at [`RAMP_K_PER_S`] from dwell to dwell, waits `dwell_s`, and takes the
//! dwell's readings [`READING_SPACING_S`] apart (or as long as a reading lasts, if that is more).
//! A reading is taken in thermal and mechanical equilibrium.
//!
//! Of the circuit, the plant knows [`Sampling`] alone. The excitation has a fixed frequency and is
//! the phase reference: ADC sample n (counted from 1, for the oscillator adds its tuning word
//! before it is used) sees the reference at n * word * 2^-bits turns, exactly.

use super::converter::{Channel, Converter};
use super::device::Device;
use super::effects::{self, Instant};
use super::noise::Noise;
use super::turn;
use crate::design::{Gyro, ThermalRun};

/// The chamber's ramp, 1 K/min, K/s.
pub const RAMP_K_PER_S: f64 = 1.0 / 60.0;

/// From the start of one reading to that of the next in a dwell, at least, s.
pub const READING_SPACING_S: f64 = 10.0;

/// The number of the first ADC sample of a run: the reference has then advanced once.
pub const FIRST_SAMPLE: u64 = 1;

/// All that the plant knows of the circuit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sampling {
    /// ADC sample rate, Hz.
    pub sample_rate_hz: f64,
    /// Bits of a code, 2..=32; the full scale is 2^(bits-1) LSB.
    pub adc_bits: u32,
    /// The reference advances by this in a sample, in 2^-phase_bits turn, modulo one turn.
    pub tuning_word: i64,
    /// Bits of the reference's phase, 1..=64.
    pub phase_bits: u32,
}

impl Sampling {
    /// The reference's advance in a sample, in 2^-64 turn: exact.
    fn step(&self) -> u64 {
        let shift = 64u32.saturating_sub(self.phase_bits);
        (self.tuning_word as u64).checked_shl(shift).unwrap_or(0)
    }

    /// The full scale, LSB.
    fn full_scale_lsb(&self) -> f64 {
        f64::powi(2.0, self.adc_bits as i32 - 1)
    }
}

/// One averaged reading of the run.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Reading {
    /// 0, 1, 2, ... in the order of time.
    pub index: u64,
    /// Start of the reading, s since the run's start.
    pub time_s: f64,
    /// Chamber, and device, degC.
    pub chamber_degc: f64,
    /// True up to the top dwell, false after it.
    pub heating: bool,
}

/// A device in the chamber.
#[derive(Debug, Clone, PartialEq)]
pub struct ThermalPlant {
    /// The gyro.
    pub device: Device,
    /// Schedule, amplitudes and noise.
    pub run: ThermalRun,
    /// How it is sampled.
    pub sampling: Sampling,
}

impl ThermalPlant {
    /// The gyro `gyro` in the run `run`.
    pub fn new(gyro: &Gyro, run: &ThermalRun, sampling: Sampling) -> Self {
        ThermalPlant {
            device: Device::new(gyro),
            run: run.clone(),
            sampling,
        }
    }

    /// The dwells' temperatures, degC, and whether each was reached by heating; the top once. If
    /// the step does not divide the span, the last step up is shorter.
    pub fn dwells(&self) -> Vec<(f64, bool)> {
        let run = &self.run;
        // A step that divides the span but for rounding divides it.
        let steps = ((run.stop_degc - run.start_degc) / run.step_k - 1e-9).ceil();
        let below = (0..steps.max(0.0) as u64).map(|k| run.start_degc + k as f64 * run.step_k);
        let up: Vec<f64> = below.chain([run.stop_degc]).collect();
        let heating = up.iter().map(|&t| (t, true));
        let cooling = up.iter().rev().skip(1).map(|&t| (t, false));
        heating.chain(cooling).collect()
    }

    /// Every reading of the run; one lasts `reading_s` seconds, its settling included.
    pub fn readings(&self, reading_s: f64) -> Vec<Reading> {
        let spacing = reading_s.max(READING_SPACING_S);
        let mut readings = Vec::new();
        let (mut time_s, mut last) = (0.0, self.run.start_degc);
        for (chamber_degc, heating) in self.dwells() {
            time_s += (chamber_degc - last).abs() / RAMP_K_PER_S + self.run.dwell_s;
            last = chamber_degc;
            for k in 0..self.run.readings_per_dwell {
                readings.push(Reading {
                    index: readings.len() as u64,
                    time_s: time_s + f64::from(k) * spacing,
                    chamber_degc,
                    heating,
                });
            }
            time_s += f64::from(self.run.readings_per_dwell) * spacing;
        }
        readings
    }

    /// The measured drive phase without noise, rad.
    pub fn true_phase_rad(&self, reading: &Reading) -> f64 {
        self.device.measured_phase_rad(reading.chamber_degc)
    }

    /// The bias without noise, deg/s.
    pub fn true_bias_dps(&self, reading: &Reading) -> f64 {
        let device = &self.device;
        let at = Instant {
            time_s: reading.time_s,
            power_on_s: reading.time_s,
            quadrature_dps: self.run.quadrature_dps,
            ..device.equilibrium(reading.chamber_degc)
        };
        device.declared_bias_dps(reading.chamber_degc) + effects::bias_dps(&device.effects, &at)
    }

    /// Drive and sense codes of `settle_samples + samples` ADC samples from [`FIRST_SAMPLE`] on.
    pub fn codes(
        &self,
        reading: &Reading,
        settle_samples: usize,
        samples: usize,
    ) -> (Vec<i32>, Vec<i32>) {
        self.codes_from(
            reading,
            FIRST_SAMPLE,
            settle_samples.saturating_add(samples),
        )
    }

    /// Drive and sense codes of the ADC samples `first_sample .. first_sample + count` of a reading;
    /// a reading made in pieces is the same as one made at once.
    ///
    /// With w the reference's phase at sample n, phi the measured drive phase, F the ADC's full scale
    /// in LSB and S the sense channel's in deg/s, before the ADC's quantiser:
    ///
    /// - drive: F * drive_amplitude * sin(w + phi) + a1
    /// - sense: F / S * ((bias + r) * sin w + quadrature * cos w) + a2
    ///
    /// a1, a2: ADC noise, white, rms as designed; r: white noise of the rate of one-sided density N, which
    /// is N * sqrt(sample rate / 2) rms in a sample. F / S * r * sin w + a2 is drawn as
    /// one normal number of the sum's standard deviation, which has the same distribution. As r
    /// is white up to half the sample rate, a demodulator by sin w brings to zero frequency its noise there and
    /// its noise at twice the excitation: its output has the density sqrt(3/2) * N.
    pub fn codes_from(
        &self,
        reading: &Reading,
        first_sample: u64,
        count: usize,
    ) -> (Vec<i32>, Vec<i32>) {
        let (run, sampling) = (&self.run, &self.sampling);
        let full_scale = sampling.full_scale_lsb();
        let effects = &self.device.effects;
        let [drive_adc, sense_adc] = [Channel::Drive, Channel::Sense]
            .map(|channel| Converter::new(effects, channel, sampling.adc_bits));
        let step = sampling.step();
        let mut reference = step.wrapping_mul(first_sample);

        // Drive: A sin(w + phi) = (A cos phi) sin w + (A sin phi) cos w.
        let (sin_phi, cos_phi) = turn::sin_cos(turn::phase_of_rad(self.true_phase_rad(reading)));
        let drive_lsb = full_scale * run.drive_amplitude;
        let (drive_sin, drive_cos) = (drive_lsb * cos_phi, drive_lsb * sin_phi);
        let sense_lsb = full_scale / run.sense_full_scale_dps;
        let sense_sin = sense_lsb * self.true_bias_dps(reading);
        let sense_cos = sense_lsb * run.quadrature_dps;

        let rate_rms = sense_lsb * run.rate_noise_dps_rthz * (sampling.sample_rate_hz / 2.0).sqrt();
        let (rate_variance, adc_variance) =
            (rate_rms * rate_rms, run.adc_noise_lsb * run.adc_noise_lsb);
        let noisy = rate_variance > 0.0 || adc_variance > 0.0;
        let noise = Noise::new(run.seed, reading.index);

        let (mut drive, mut sense) = (vec![0; count], vec![0; count]);
        for (i, (d, s)) in drive.iter_mut().zip(&mut sense).enumerate() {
            let (sine, cosine) = turn::sin_cos(reference);
            reference = reference.wrapping_add(step);
            let mut drive_input = drive_sin * sine + drive_cos * cosine;
            let mut sense_input = sense_sin * sine + sense_cos * cosine;
            if noisy {
                let (g1, g2) = noise.gaussian_pair(first_sample.wrapping_add(i as u64));
                drive_input += run.adc_noise_lsb * g1;
                sense_input += (rate_variance * sine * sine + adc_variance).sqrt() * g2;
            }
            *d = drive_adc.code(drive_adc.analog(drive_input));
            *s = sense_adc.code(sense_adc.analog(sense_input));
        }
        (drive, sense)
    }
}

#[cfg(test)]
#[path = "thermal_run_tests.rs"]
mod tests;
