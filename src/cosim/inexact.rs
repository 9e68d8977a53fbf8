//! What is between the gyro and the ADCs in time: jitter of the sampling instant, mains pickup, a spur of
//! the excitation. Nothing of it without the effects.

use crate::design::Design;
use crate::numeric::format::pow2;
use crate::numeric::turn;
use crate::plant::Gyroscope;
use crate::plant::converter::{Channel, Converter};
use crate::plant::noise::Noise;
use std::f64::consts::TAU;

/// The stream of the jitter's noise; readings count theirs from 0, slow noise has the last two.
const JITTER_STREAM: u64 = u64::MAX - 3;

/// Time-domain effects of the converters.
#[derive(Debug, Clone)]
pub struct Inexact {
    sample_rate_hz: f64,
    converter: Converter,
    jitter: Option<(f64, Noise)>,
    mains: bool,
    spur: bool,
    /// The last inputs of the block before, for the slope.
    before: [f64; 2],
}

impl Inexact {
    /// As the design's effects say.
    pub fn new(design: &Design) -> Self {
        let effects = &design.gyro.effects;
        let adc_bits = design.circuit.adc.format.bits();
        let converter = Converter::new(effects, Channel::Drive, adc_bits);
        let rms_s = converter.aperture_jitter_rms_s();
        let noise = Noise::new(design.thermal_run.seed, JITTER_STREAM);
        Inexact {
            sample_rate_hz: design.circuit.sample_rate_hz,
            jitter: (rms_s > 0.0).then_some((rms_s, noise)),
            mains: effects.get::<2>("mains_pickup").is_some(),
            spur: effects.get::<2>("nco_spur").is_some(),
            converter,
            before: [0.0; 2],
        }
    }

    /// Acts on a block of both inputs, LSB, that begins at ADC sample `first`; the excitation advances by
    /// `step` (2^-64 turn) in a sample.
    pub fn apply(
        &mut self,
        gyroscope: &Gyroscope,
        step: u64,
        first: u64,
        mut inputs: [&mut [f64]; 2],
    ) {
        if self.spur
            && let Some((hz, phasors)) = gyroscope.spur()
        {
            for (input, phasor) in inputs.iter_mut().zip(phasors) {
                for (n, value) in (first..).zip(input.iter_mut()) {
                    let turns = (hz / self.sample_rate_hz * n as f64).fract();
                    let (sin, cos) = turn::sin_cos(turn::phase_of_rad(TAU * turns));
                    *value += phasor.re * sin + phasor.im * cos;
                }
            }
        }
        if self.mains {
            for input in inputs.iter_mut() {
                for (n, value) in (first..).zip(input.iter_mut()) {
                    *value += self.converter.additive_lsb(n as f64 / self.sample_rate_hz);
                }
            }
        }
        if let Some((rms_s, noise)) = self.jitter {
            self.jitter(rms_s, &noise, step, first, inputs);
        }
    }

    /// Each sample is taken a random time late: plus slope times time. Of a tone of angle d a sample, the
    /// slope is w (x_n cos d - x_(n-1)) / sin d.
    fn jitter(
        &mut self,
        rms_s: f64,
        noise: &Noise,
        step: u64,
        first: u64,
        inputs: [&mut [f64]; 2],
    ) {
        let angle = step as i64 as f64 * pow2(-64) * TAU;
        let (sin, cos) = angle.sin_cos();
        if sin == 0.0 {
            return;
        }
        let per_s = angle * self.sample_rate_hz / sin;
        let [drive, sense] = inputs;
        let [mut last_drive, mut last_sense] = self.before;
        for (n, (d, s)) in (first..).zip(drive.iter_mut().zip(sense.iter_mut())) {
            // Both channels are sampled at once.
            let late_s = rms_s * noise.gaussian_pair(n).0;
            let slopes =
                [(*d, last_drive), (*s, last_sense)].map(|(now, last)| per_s * (now * cos - last));
            (last_drive, last_sense) = (*d, *s);
            *d += slopes[0] * late_s;
            *s += slopes[1] * late_s;
        }
        self.before = [last_drive, last_sense];
    }
}
