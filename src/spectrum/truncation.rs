//! What the spurs of an oscillator should be.
//!
//! An accumulator of w bits addresses a table of 2^P entries, so B = w - P bits are dropped. With
//! F the tuning word and g = gcd(F, 2^B), the dropped part runs through a sawtooth of L = 2^B / g
//! steps. The output is the table's staircase, of which the sampled harmonics 1 + k 2^P are the
//! carrier (k = 0) and the truncation spurs, L - 1 of them (Nicholas and Samueli 1987):
//!
//! - frequency: F (1 + k 2^P) / 2^w of the sample rate, folded into 0 .. 1/2
//! - level: 20 log10 | sin(pi / (L 2^P)) / sin(pi (1 + k 2^P) / (L 2^P)) | dBc
//!
//! Both are exact, whatever the table holds: a table scales carrier and truncation spurs alike. The
//! worst is k = -1; for large P it is -6.02 P + 20 log10((pi / L) / sin(pi / L)) dBc, the
//! published form, up to 3.92 dB (L = 2) above -6.02 P. If F is a multiple of 2^B there is none. Rounding the
//! address by half a step shifts the sawtooth by a constant, and no level.
//!
//! A table with rounded entries has harmonics h of its own; these are lines at h F / 2^w, under the
//! same staircase. The tuning word decides where lines fall, and how high they are only by its
//! power of two (Torosyan and Willson 2005), so the table's own transform gives the levels.

use super::lines::Method;
use crate::circuit::nco::Oscillator;
use rustfft::FftPlanner;
use rustfft::num_complex::Complex;
use std::f64::consts::PI;

/// Truncation spurs that are listed.
const LISTED: usize = 8;

/// A spur that phase truncation makes.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, schemars::JsonSchema)]
pub struct TruncationSpur {
    /// k: the harmonic 1 + k 2^P of the table's staircase.
    pub order: i64,
    /// Hz, folded into 0 to half the sample rate.
    pub frequency_hz: f64,
    /// dB from the carrier.
    pub level_dbc: f64,
}

/// What theory says of an oscillator's spurs.
#[derive(Debug, Clone, PartialEq, serde::Serialize, schemars::JsonSchema)]
pub struct Predicted {
    /// B: bits of the phase that do not address the table.
    pub dropped_bits: u32,
    /// L = 2^B / gcd(F, 2^B): values that the dropped part takes; 1 = it is always 0.
    pub truncation_steps: u64,
    /// L - 1: truncation spurs, weak ones among them.
    pub truncation_spurs: u64,
    /// The strongest truncation spurs, strongest first; at most 8.
    pub strongest: Vec<TruncationSpur>,
    /// The highest harmonic of the table as its entries are, dBc: of all entries, or of those that the
    /// tuning word visits. Absent: there is none.
    pub table_dbc: Option<f64>,
    /// Total noise of the table if its rounding errors were white: -(6.02 A + 1.76) dBc for entries
    /// of A bits. A bound for no single spur: with a coherent tuning word few harmonics hold all of it.
    pub table_noise_dbc: f64,
}

impl Predicted {
    /// The strongest truncation spur, dBc.
    pub fn truncation_dbc(&self) -> Option<f64> {
        self.strongest.first().map(|s| s.level_dbc)
    }
}

/// Tuning word and accumulator, in the numbers of the formulas.
#[derive(Debug, Clone, Copy)]
pub(super) struct Word {
    /// w.
    pub(super) phase_bits: u32,
    /// P.
    address_bits: u32,
    /// F, 0 ..= 2^w - 1.
    tuning_word: u128,
}

impl Word {
    pub(super) fn of(oscillator: &Oscillator) -> Word {
        let phase_bits = oscillator.table.phase_bits;
        Word {
            phase_bits,
            address_bits: oscillator.table.address_bits.min(phase_bits),
            tuning_word: oscillator.tuning_word.unsigned_abs() & ((1u128 << phase_bits) - 1),
        }
    }

    /// log2 of the period in samples: 2^w / gcd(F, 2^w).
    pub(super) fn period_bits(&self) -> u32 {
        self.phase_bits - self.tuning_word.trailing_zeros().min(self.phase_bits)
    }

    pub(super) fn dropped_bits(&self) -> u32 {
        self.phase_bits - self.address_bits
    }

    /// log2 L.
    pub(super) fn step_bits(&self) -> u32 {
        let zeros = self.tuning_word.trailing_zeros();
        self.dropped_bits().saturating_sub(zeros)
    }

    /// Cycles per sample of harmonic 1 + k 2^P, folded into 0 ..= 1/2.
    pub(super) fn frequency(&self, order: i64) -> f64 {
        let turn = 1i128 << self.phase_bits;
        // |k| 2^P is below 2^30, F below 2^64.
        let harmonic = 1 + i128::from(order) * (1i128 << self.address_bits);
        let step = (harmonic * self.tuning_word as i128).rem_euclid(turn);
        step.min(turn - step) as f64 / turn as f64
    }

    /// Orders of the truncation spurs of `|k| <= reach`: -1, 1, -2, 2 and so on.
    pub(super) fn orders(&self, reach: i64) -> Vec<i64> {
        let steps = 1i64 << self.step_bits();
        (1..=reach)
            .flat_map(|k| [-k, k])
            // Orders that differ by L are the same line.
            .filter(|k| *k >= -steps / 2 && *k < (steps + 1) / 2)
            .collect()
    }

    /// Level of harmonic 1 + k 2^P, dBc.
    pub(super) fn level_dbc(&self, order: i64) -> f64 {
        let count = f64::exp2(f64::from(self.address_bits));
        let steps = f64::exp2(f64::from(self.step_bits()));
        let line = (PI * (1.0 / count + order as f64) / steps).sin();
        20.0 * ((PI / (steps * count)).sin() / line).abs().log10()
    }
}

/// What theory says of this oscillator at this sample rate, Hz.
pub(super) fn predict(oscillator: &Oscillator, sample_rate_hz: f64) -> Predicted {
    let word = Word::of(oscillator);
    let spur = |order: i64| TruncationSpur {
        order,
        frequency_hz: word.frequency(order) * sample_rate_hz,
        level_dbc: word.level_dbc(order),
    };
    let mut strongest: Vec<TruncationSpur> =
        word.orders(LISTED as i64).into_iter().map(spur).collect();
    strongest.sort_by(|a, b| b.level_dbc.total_cmp(&a.level_dbc));
    strongest.truncate(LISTED);
    let steps = 1u64 << word.step_bits();
    Predicted {
        dropped_bits: word.dropped_bits(),
        truncation_steps: steps,
        truncation_spurs: steps - 1,
        strongest,
        table_dbc: table_dbc(oscillator, &word),
        table_noise_dbc: -(20.0 * 2f64.log10() * entry_bits(oscillator) + 1.76),
    }
}

/// A: the width that holds the table's peak 2^(A-1) - 1.
fn entry_bits(oscillator: &Oscillator) -> f64 {
    let lsb = f64::exp2(-f64::from(oscillator.table.fraction_bits));
    1.0 + (oscillator.table.amplitude / lsb + 1.0).log2()
}

/// The highest harmonic of the entries that the tuning word visits, under the staircase.
fn table_dbc(oscillator: &Oscillator, word: &Word) -> Option<f64> {
    // With nothing truncated only each `stride`-th entry is visited.
    let zeros = word.tuning_word.trailing_zeros();
    let stride = 1usize
        << zeros
            .saturating_sub(word.dropped_bits())
            .min(word.address_bits);
    let entries = oscillator.table.entries.iter().step_by(stride);
    let mut buffer: Vec<Complex<f64>> = entries.map(|e| Complex::new(*e as f64, 0.0)).collect();
    let count = buffer.len();
    FftPlanner::new()
        .plan_fft_forward(count)
        .process(&mut buffer);
    let steps = f64::exp2(f64::from(word.step_bits()));
    // The staircase holds each entry for L steps.
    let held = |h: usize| {
        let angle = PI * h as f64 / count as f64;
        angle.sin() / (steps * (angle / steps).sin())
    };
    let level = |(h, c): (usize, &Complex<f64>)| {
        // Half the sample rate has no image to add to it.
        let images = if steps == 1.0 && 2 * h == count {
            0.5
        } else {
            1.0
        };
        c.norm() * held(h) * images
    };
    let carrier = buffer.get(1).map(|c| level((1, c)))?;
    let harmonics = buffer.iter().enumerate().take(count / 2 + 1).skip(2);
    let worst = 20.0 * (harmonics.map(level).fold(0.0, f64::max) / carrier).log10();
    (worst > Method::WholePeriod.floor_dbc()).then_some(worst)
}
