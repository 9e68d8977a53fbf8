//! Captures for the tests of the parts: a drive and a sense tone, white noise, rounding, a limit.

use super::columns::Model;
use super::fit::declared;
use super::input::Capture;
use super::known;
use super::tone::Tone;
use crate::plant::noise::Noise;
use crate::record::capture_meta::CaptureMeta;
use std::f64::consts::TAU;

/// How a capture is made.
#[derive(Debug, Clone, Copy)]
pub struct Made {
    /// Rows.
    pub rows: usize,
    /// Tuning word.
    pub word: u32,
    /// Noise of both channels, codes rms.
    pub noise: f64,
    /// Noise is added to the rounded code, as a whole number.
    pub after: bool,
    /// Added to the drive's signal, codes.
    pub offset: f64,
    /// Largest drive code that comes out.
    pub limit: f64,
    /// Random time of the drive's samples, samples rms.
    pub jitter: f64,
    /// Address bits of the oscillator's table.
    pub bits: Option<u32>,
}

/// Amplitude of the drive, codes.
pub const AMPLITUDE: f64 = 200.3;

impl Made {
    /// 20 000 rows with one code of noise and nothing wrong.
    pub const CLEAN: Made = Made {
        rows: 20_000,
        word: 0x0734_5679,
        noise: 1.0,
        after: false,
        offset: 0.0,
        limit: f64::INFINITY,
        jitter: 0.0,
        bits: None,
    };

    /// The capture.
    pub fn capture(&self) -> Capture {
        let streams = [Noise::new(7, 0), Noise::new(7, 1), Noise::new(7, 2)];
        let normal = |stream: usize, row: usize| streams[stream].gaussian_pair(row as u64).0;
        let code = |channel: usize, row: usize| {
            let turns = f64::from(self.word.wrapping_mul(row as u32)) / 4_294_967_296.0;
            let steps = self.bits.map(|bits| f64::powi(2.0, bits as i32));
            let turns = steps.map_or(turns, |n| (turns * n).floor() / n);
            let late = f64::from(self.word) / 4_294_967_296.0 * self.jitter * normal(2, row);
            let signal = match channel {
                0 => self.offset - AMPLITUDE * (TAU * (turns - late)).cos(),
                _ => 61.7 * (TAU * turns).sin() + 20.2 * (TAU * turns).cos(),
            };
            let noise = self.noise * normal(channel, row);
            let limit = if channel == 0 {
                self.limit
            } else {
                f64::INFINITY
            };
            let code = match self.after {
                true => signal.min(limit).round() + noise.round(),
                false => (signal + noise).min(limit).round(),
            };
            code as i32
        };
        let codes = [0, 1].map(|c| (0..self.rows).map(|row| code(c, row)).collect());
        let meta = CaptureMeta {
            fs_hz: Some(1e5),
            ftw: Some(self.word),
            adc_bits: Some(10),
            drive_amplitude_codes: Some(AMPLITUDE),
            sense_codes_per_dps: None,
            sense_phase_rad: None,
            rate_dps: None,
        };
        Capture::new(codes, meta, 10).unwrap()
    }
}

/// The declared model with the sense carriers fitted, at the noise the capture was made with.
pub fn model(capture: &Capture, made: &Made) -> (super::candidates::Known, Model) {
    let tone = Tone::of(capture).unwrap();
    let (known, mut model) = known(capture, tone);
    assert_eq!(declared(capture, &known, tone).declared, model.declared);
    model.variance.base = [made.noise.powi(2) + 1.0 / 12.0; 2];
    model.variance.jitter = [made.jitter.powi(2); 2];
    (known, model)
}
