//! Captures for the tests, with accidents on the way to the file.

use super::analyse;
use super::examine::examined;
use super::input::Capture;
use super::report::Findings;
use crate::record::Warning;
use crate::record::capture_meta::CaptureMeta;
use crate::thermal::synthetic::Random;
use std::f64::consts::TAU;

/// A tone of few phases (128 samples a period), and one of many.
pub const WORDS: [u32; 2] = [1 << 25, 0x0234_5679];
pub const ROWS: usize = 16_384;

/// Codes of a capture of 12 bits with one code of noise; `fault` acts on each channel's signal before it is rounded.
pub fn codes(seed: u64, word: u32, fault: impl Fn(usize, usize, f64) -> f64) -> [Vec<i32>; 2] {
    late(seed, word, 0.0, fault)
}

/// The same with a random instant of sampling, samples rms.
pub fn late(
    seed: u64,
    word: u32,
    jitter: f64,
    fault: impl Fn(usize, usize, f64) -> f64,
) -> [Vec<i32>; 2] {
    let mut random = Random::new(seed);
    let mut codes = [Vec::new(), Vec::new()];
    for row in 0..ROWS {
        let turns = f64::from(word.wrapping_mul(row as u32)) / 4_294_967_296.0;
        let angle = TAU * (turns - jitter * random.normal() * f64::from(word) / 4_294_967_296.0);
        let sense = 300.0 * (angle + 0.3).sin() + 90.0 * (angle + 0.3).cos();
        for (channel, x) in [-1500.0 * angle.cos(), sense].into_iter().enumerate() {
            let x = fault(channel, row, x + random.normal());
            codes[channel].push((x + 0.5).floor() as i32);
        }
    }
    codes
}

pub fn clean(seed: u64, word: u32) -> [Vec<i32>; 2] {
    codes(seed, word, |_, _, x| x)
}

pub fn meta(word: u32) -> CaptureMeta {
    CaptureMeta {
        fs_hz: Some(200e3),
        ftw: Some(word),
        adc_bits: Some(12),
        drive_amplitude_codes: Some(1500.0),
        sense_codes_per_dps: Some(3.0),
        sense_phase_rad: Some(0.3),
        rate_dps: Some(100.0),
    }
}

pub fn capture(codes: [Vec<i32>; 2], meta: CaptureMeta) -> Capture {
    Capture::new(codes, meta, 12).unwrap()
}

/// What is said of the rows, and what is found in them.
pub fn judged(codes: [Vec<i32>; 2], meta: CaptureMeta) -> (Capture, Vec<Warning>, Findings) {
    let (capture, said) = examined(capture(codes, meta)).unwrap();
    let found = analyse(&capture).unwrap();
    (capture, said, found)
}

pub fn names(found: &Findings) -> Vec<&str> {
    found.steps.iter().map(|s| s.effect.as_str()).collect()
}

pub fn said(warnings: &[Warning]) -> Vec<&str> {
    warnings.iter().map(|w| w.code).collect()
}

/// Rows `cuts` (first, count) of both channels are lost.
pub fn lose(codes: [Vec<i32>; 2], cuts: &[(usize, usize)]) -> [Vec<i32>; 2] {
    let is_lost = |row: usize| {
        cuts.iter()
            .any(|(from, n)| (*from..from + n).contains(&row))
    };
    codes.map(|c| {
        let kept = c.into_iter().enumerate().filter(|(row, _)| !is_lost(*row));
        kept.map(|(_, code)| code).collect()
    })
}

/// Some wrong codes: channel, row.
pub fn wrong(seed: u64, codes: &mut [Vec<i32>; 2], count: usize) -> Vec<usize> {
    let mut random = Random::new(seed ^ 0x55);
    let mut rows: Vec<usize> = Vec::new();
    while rows.len() < count {
        let row = (random.uniform() * ROWS as f64) as usize;
        let channel = rows.len() % 2;
        let bad = (4000.0 * (random.uniform() - 0.5)) as i32;
        if !rows.contains(&row) && (bad - codes[channel][row]).abs() > 100 {
            codes[channel][row] = bad;
            rows.push(row);
        }
    }
    rows.sort_unstable();
    rows
}
