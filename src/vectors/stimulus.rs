//! Inputs for comparisons: corners and pseudo-random words of a range; ordinary and adversarial
//! captures for a chain. All from counters, so that a run can be repeated anywhere.

use crate::design::Design;
use crate::numeric::trace::ir::Interval;

/// Seed of everything that a bundle's tests draw.
pub const SEED: u64 = 2004;
/// Inputs of at most this many bits are compared exhaustively.
pub const EXHAUSTIVE_BITS: u32 = 24;

/// The multiplier and increment of Knuth's MMIX generator; the emitted self-test uses the same.
pub const LCG: (u64, u64) = (6_364_136_223_846_793_005, 1_442_695_040_888_963_407);

/// A linear congruential generator modulo 2^64.
#[derive(Debug, Clone)]
pub struct Lcg(pub u64);

impl Lcg {
    /// The next state.
    pub fn draw(&mut self) -> u64 {
        self.0 = self.0.wrapping_mul(LCG.0).wrapping_add(LCG.1);
        self.0
    }

    /// A word of an interval of at most 2^64 values, as the emitted self-test draws it.
    pub fn word(&mut self, range: Interval) -> i128 {
        let span = (range.high - range.low) as u64;
        let r = self.draw() >> 1;
        let offset = match span.checked_add(1) {
            Some(n) => r % n,
            None => r,
        };
        range.low + i128::from(offset)
    }
}

/// Inputs of a function: every combination of ends, zero and their neighbours, then `random` draws.
pub fn inputs(ranges: &[Interval], random: usize, seed: u64) -> Vec<Vec<i128>> {
    let corners = |range: &Interval| {
        let mut values: Vec<i128> = [
            range.low,
            range.low + 1,
            -1,
            0,
            1,
            range.high - 1,
            range.high,
        ]
        .into_iter()
        .filter(|v| range.is_within(*v, *v) || (range.low..=range.high).contains(v))
        .collect();
        values.dedup();
        values
    };
    let mut all: Vec<Vec<i128>> = vec![Vec::new()];
    for range in ranges {
        all = all
            .iter()
            .flat_map(|prefix| {
                corners(range).into_iter().map(move |v| {
                    let mut next = prefix.clone();
                    next.push(v);
                    next
                })
            })
            .collect();
    }
    let mut lcg = Lcg(seed);
    for k in 0..random {
        let draw = ranges.iter().map(|range| {
            let word = lcg.word(*range);
            // A third of the draws are small words: rounding near zero.
            if k % 3 == 2 {
                (word >> (lcg.draw() >> 59)).clamp(range.low, range.high)
            } else {
                word
            }
        });
        all.push(draw.collect());
    }
    all
}

/// Drive and sense codes: tones beside the NCO with noise, full-scale squares, constants at the
/// ends, steps, and pure noise, in turn, `samples` in all.
pub fn capture(design: &Design, samples: usize, seed: u64) -> (Vec<i32>, Vec<i32>) {
    segments(design, samples, 1 << 12, seed)
}

/// The same with segments of another length: at `samples / 6`, one of each kind.
pub fn segments(design: &Design, samples: usize, length: usize, seed: u64) -> (Vec<i32>, Vec<i32>) {
    let format = design.circuit.adc.format;
    let range = Interval::new(format.min_raw(), format.max_raw());
    let (low, high) = (range.low as i32, range.high as i32);
    let turns = design.circuit.nco.tuning_word as f64
        / f64::powi(2.0, design.circuit.nco.phase_bits as i32);
    let mut lcg = Lcg(seed);
    let (mut drive, mut sense) = (Vec::with_capacity(samples), Vec::with_capacity(samples));
    let clip = |v: f64| (v.round() as i64).clamp(i64::from(low), i64::from(high)) as i32;
    for n in 0..samples {
        let segment = n / length;
        let full = f64::from(high);
        let angle =
            std::f64::consts::TAU * (turns * n as f64 * (1.0 + 1e-5 * segment as f64)).fract();
        let noise = |lcg: &mut Lcg| (lcg.draw() >> 40) as f64 / f64::from(1 << 24) - 0.5;
        let (d, s) = match segment % 6 {
            0 | 1 => {
                let phase = segment as f64;
                let drive = 0.5 * full * (angle + phase).sin() + 4.0 * noise(&mut lcg);
                let sense = 0.3 * full * (angle + 0.1).sin() + 0.2 * full * angle.cos();
                (clip(drive), clip(sense + 4.0 * noise(&mut lcg)))
            }
            2 => {
                let square = |a: f64| if a.sin() >= 0.0 { high } else { low };
                (square(angle), square(angle + 1.0))
            }
            3 => (if segment % 4 == 3 { low } else { high }, low),
            4 => {
                let level = lcg.word(range) as i32;
                let held = *drive.last().unwrap_or(&level);
                (
                    if n % 97 == 0 { level } else { held },
                    if n % 53 == 0 { high } else { 0 },
                )
            }
            _ => (lcg.word(range) as i32, lcg.word(range) as i32),
        };
        drive.push(d);
        sense.push(s);
    }
    (drive, sense)
}
