//! The phase of the oscillator at each row, and the declared tones.

use super::blocks;
use super::input::Capture;
use crate::numeric::turn;
use crate::statistics::normal::median;
use rustfft::FftPlanner;
use rustfft::num_complex::Complex;
use std::f64::consts::TAU;

/// 2^-32 turn.
const WORD: f64 = 1.0 / 4_294_967_296.0;

/// Phase 0 at row 0 (plus `offset_turns` where the tuning word is not known).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Tone {
    /// Tuning word of 32 bits, if known: phases are then exact.
    pub word: Option<u32>,
    /// Turns a sample, 0 to 1/2.
    pub turns: f64,
    /// Of row 0.
    pub offset_turns: f64,
}

impl Tone {
    /// Of the capture's tuning word; without one, fitted to the drive codes so that these are
    /// -cos(2 pi phase). `None`: there is no tone.
    pub fn of(capture: &Capture) -> Option<Tone> {
        match capture.meta.ftw {
            Some(word) => Some(Tone {
                word: Some(word),
                turns: f64::from(word) * WORD,
                offset_turns: 0.0,
            }),
            None => strongest(capture),
        }
    }

    /// Phase of a row, turns in 0 .. 1.
    pub fn phase(&self, row: usize) -> f64 {
        match self.word {
            Some(word) => f64::from(word.wrapping_mul(row as u32)) * WORD,
            None => (self.turns * row as f64 + self.offset_turns).rem_euclid(1.0),
        }
    }

    /// Rows after which the phase comes back, where the tuning word is known.
    pub fn period(&self) -> Option<u64> {
        let word = self.word.filter(|word| *word != 0)?;
        Some(1 << (32 - word.trailing_zeros()))
    }

    /// Turns a sample folded into 0 ..= 1/2.
    pub fn folded(&self) -> f64 {
        fold(self.turns)
    }

    /// Angle a sample with its sign, rad: negative above half the sample rate.
    pub fn angle(&self) -> f64 {
        let turns = self.turns.rem_euclid(1.0);
        TAU * if turns > 0.5 { turns - 1.0 } else { turns }
    }
}

/// Sine and cosine of the phase of every row, computed once.
#[derive(Debug, Clone)]
pub struct Phases(std::sync::Arc<Vec<[f64; 2]>>);

impl Phases {
    /// Of the first `rows` rows.
    pub fn of(tone: &Tone, rows: usize) -> Phases {
        let at = |row: usize| match tone.word {
            Some(word) => turn::sin_cos(u64::from(word.wrapping_mul(row as u32)) << 32),
            None => (TAU * tone.phase(row)).sin_cos(),
        };
        let pairs = (0..rows).map(|row| {
            let (sin, cos) = at(row);
            [sin, cos]
        });
        Phases(std::sync::Arc::new(pairs.collect()))
    }

    /// Sine and cosine at a row.
    #[inline]
    pub fn at(&self, row: usize) -> (f64, f64) {
        self.0.get(row).map_or((0.0, 1.0), |[s, c]| (*s, *c))
    }
}

/// A frequency in turns a sample folded into 0 ..= 1/2.
pub fn fold(turns: f64) -> f64 {
    let turns = turns.rem_euclid(1.0);
    turns.min(1.0 - turns)
}

/// Least squares frequency and phase of the drive's strongest line, so that the codes are -cos(2 pi phase).
pub fn strongest(capture: &Capture) -> Option<Tone> {
    let mut tone = near_strongest(capture)?;
    for _ in 0..REFINED {
        let blocks = blocks::blocks(capture, &tone);
        if blocks.len() < 3 {
            break;
        }
        let (slope, offset) = course(&blocks);
        tone.turns += slope;
        tone.offset_turns = (tone.offset_turns + offset).rem_euclid(1.0);
    }
    Some(tone)
}

/// Times that a found tone is fitted again.
const REFINED: usize = 3;
/// Typical deviations of a block's phase from the course from which on it has no say in it.
const FAR: f64 = 6.0;

/// The straight course of the drive's phase over the blocks, beyond that of the tone they were fitted with: turns a
/// sample, and turns at row 0. Each block has its own constant and tone, so neither leaks into its phase.
fn course(blocks: &[blocks::Block]) -> (f64, f64) {
    // -cos is half a turn from what `phase` takes as zero.
    let of = |b: &blocks::Block| blocks::wrapped(blocks::phase(&b.tone[0]) + 0.5);
    let points: Vec<(f64, f64)> = blocks.iter().map(|b| (b.middle(), of(b))).collect();
    let mut used = points.clone();
    let mut line = (0.0, 0.0);
    for _ in 0..2 {
        let n = used.len().max(1) as f64;
        let mean = |f: &dyn Fn(&(f64, f64)) -> f64| used.iter().map(f).sum::<f64>() / n;
        let (x, y) = (mean(&|p| p.0), mean(&|p| p.1));
        let slope = mean(&|p| (p.0 - x) * (p.1 - y)) / mean(&|p| (p.0 - x).powi(2)).max(1e-12);
        line = (slope, y - slope * x);
        let off = |p: &(f64, f64)| (p.1 - line.1 - line.0 * p.0).abs();
        let mut all: Vec<f64> = points.iter().map(off).collect();
        let far = FAR * 1.4826 * median(&mut all).unwrap_or(0.0);
        used = points.iter().copied().filter(|p| off(p) <= far).collect();
    }
    line
}

/// The strongest line by a Hann-windowed transform, then steps of the phase between the two halves. The constant and
/// the line at the negative frequency leak into the halves, which leaves an error of the frequency.
fn near_strongest(capture: &Capture) -> Option<Tone> {
    let codes = &capture.codes[0];
    let n = codes.len();
    let sum: f64 = capture.used_codes(0).map(f64::from).sum();
    let mean = sum / capture.used_rows().max(1) as f64;
    let value = |i: usize| match codes.get(i) {
        Some(code) if !capture.is_left_out(i) => f64::from(*code) - mean,
        _ => 0.0,
    };
    let mut buffer: Vec<Complex<f64>> = (0..n)
        .map(|i| {
            let hann = 0.5 - 0.5 * (TAU * (i as f64 + 0.5) / n as f64).cos();
            Complex::new(value(i) * hann, 0.0)
        })
        .collect();
    FftPlanner::new().plan_fft_forward(n).process(&mut buffer);
    let half = buffer.iter().enumerate().take(n / 2).skip(2);
    let (peak, height) = half
        .map(|(k, c)| (k, c.norm_sqr()))
        .fold((0, 0.0), |a, b| if b.1 > a.1 { b } else { a });
    if peak == 0 || height <= 0.0 {
        return None;
    }
    let mut turns = peak as f64 / n as f64;
    let sums = |turns: f64, from: usize, to: usize| {
        (from..to).fold(Complex::new(0.0, 0.0), |sum, i| {
            sum + Complex::from_polar(value(i), -TAU * (turns * i as f64).fract())
        })
    };
    for _ in 0..12 {
        let (first, second) = (sums(turns, 0, n / 2), sums(turns, n / 2, n));
        let step = (second * first.conj()).arg() / (TAU * (n as f64 / 2.0));
        turns += step;
        if step.abs() < 1e-14 {
            break;
        }
    }
    // -cos(2 pi p) = cos(2 pi (p + 1/2)), and the sum's argument is that of a cosine.
    let offset_turns = sums(turns, 0, n).arg() / TAU + 0.5;
    Some(Tone {
        word: None,
        turns,
        offset_turns: offset_turns.rem_euclid(1.0),
    })
}

#[cfg(test)]
mod tests {
    use super::super::synthetic::Made;
    use super::*;

    #[test]
    fn a_phase_comes_back_after_its_period_and_not_before() {
        for (word, period) in [(5 << 25, 128), (1 << 31, 2), (0x0030_0000, 4096)] {
            let tone = Tone {
                word: Some(word),
                turns: f64::from(word) * WORD,
                offset_turns: 0.0,
            };
            assert_eq!(tone.period(), Some(period));
            assert_eq!(tone.phase(period as usize), 0.0);
            assert!((1..period).all(|row| tone.phase(row as usize) != 0.0));
        }
    }

    #[test]
    fn the_strongest_line_is_found_without_what_leaks_into_it() {
        for word in [0x0734_5679, 0x0234_5679, 0x0333_3333] {
            for rows in [1000, 2000, 3001] {
                let made = Made {
                    rows,
                    word,
                    noise: 0.05,
                    ..Made::CLEAN
                };
                let tone = strongest(&made.capture()).unwrap();
                // Turns over the whole capture: the rounding's part is some 1e-5.
                let off = (tone.turns - f64::from(word) * WORD) * rows as f64;
                assert!(off.abs() < 1e-4, "{word:x} {rows}: {off}");
                let offset = (tone.offset_turns + 0.5).rem_euclid(1.0) - 0.5;
                assert!(offset.abs() < 1e-4, "{word:x} {rows}: {offset}");
            }
        }
    }
}
