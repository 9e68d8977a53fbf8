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

    /// A word of an interval, as the emitted self-test draws it where the interval has at most 2^64 values.
    pub fn word(&mut self, range: Interval) -> i128 {
        let span = range.high.wrapping_sub(range.low);
        if span > i128::from(u64::MAX) {
            let [high, low] = [self.draw(), self.draw()].map(i128::from);
            let drawn = ((high << 64) | low) & i128::MAX;
            return range.low + span.checked_add(1).map_or(drawn, |n| drawn % n);
        }
        let r = self.draw() >> 1;
        let offset = match (span as u64).checked_add(1) {
            Some(n) => r % n,
            None => r,
        };
        range.low + i128::from(offset)
    }
}

/// Words that every range is looked at: its ends, zero, and their neighbours.
fn ends(range: &Interval) -> Vec<i128> {
    let about = [
        range.low,
        range.low + 1,
        -1,
        0,
        1,
        range.high - 1,
        range.high,
    ];
    let mut values: Vec<i128> = about
        .into_iter()
        .filter(|v| (range.low..=range.high).contains(v))
        .collect();
    values.sort_unstable();
    values.dedup();
    values
}

/// Most words that are taken at their ends in every combination.
const COMBINED: usize = 3;

/// Inputs of a function: its words at their ends, in every combination where they are few, else at random
/// and one by one; then `random` draws.
pub fn inputs(ranges: &[Interval], random: usize, seed: u64) -> impl Iterator<Item = Vec<i128>> {
    let mut all: Vec<Vec<i128>> = vec![Vec::new()];
    if ranges.len() <= COMBINED {
        for range in ranges {
            let next = |prefix: &Vec<i128>| {
                let extended = |v| prefix.iter().copied().chain([v]).collect();
                ends(range).into_iter().map(extended).collect::<Vec<_>>()
            };
            all = all.iter().flat_map(next).collect();
        }
    } else {
        let mut lcg = Lcg(seed + 7);
        let pick = |lcg: &mut Lcg, range: &Interval| {
            let ends = ends(range);
            ends[(lcg.draw() >> 33) as usize % ends.len()]
        };
        all = (0..random / 2)
            .map(|_| ranges.iter().map(|range| pick(&mut lcg, range)).collect())
            .collect();
        for k in 0..ranges.len() {
            for end in ends(&ranges[k]) {
                let mut words: Vec<i128> = ranges.iter().map(|range| lcg.word(*range)).collect();
                words[k] = end;
                all.push(words);
            }
        }
    }
    all.into_iter().chain(self::random(ranges, random, seed))
}

/// Random words; in a third of the draws small ones, for rounding near zero.
pub fn random(ranges: &[Interval], count: usize, seed: u64) -> impl Iterator<Item = Vec<i128>> {
    let mut lcg = Lcg(seed);
    let draw = move |k: usize| {
        let words = ranges.iter().map(|range| {
            let word = lcg.word(*range);
            match k % 3 {
                2 => (word >> (lcg.draw() >> 59)).clamp(range.low, range.high),
                _ => word,
            }
        });
        words.collect()
    };
    (0..count).map(draw)
}

/// Drive and sense codes: tones beside the NCO with noise, full-scale squares, constants at the
/// ends, steps, and pure noise, in turn, `samples` in all.
pub fn capture(design: &Design, samples: usize, seed: u64) -> (Vec<i32>, Vec<i32>) {
    segments(design, samples, 1 << 12, seed)
}

/// The segment, of six, in which both codes are squares between the ends of their range.
pub const SQUARES: usize = 2;

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
            SQUARES => {
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

/// Steps that share their amplitude and kind in a long run.
pub const SEGMENT: u64 = 4096;

/// The stimulus of a long run, which the emitted harness makes for itself: triangles of changing amplitude
/// beside the given frequencies, with noise and without, random words, squares, segment after segment.
#[derive(Debug, Clone)]
pub struct LongRun {
    lcg: Lcg,
    step: u64,
    amplitude: u64,
    detuning: u32,
    words: Vec<(Interval, u32)>,
}

impl LongRun {
    /// `words`: each word's range, and its steps through 2^32 a call.
    pub fn new(words: Vec<(Interval, u32)>, seed: u64) -> Self {
        LongRun {
            lcg: Lcg(seed),
            step: 0,
            amplitude: 0,
            detuning: 0,
            words,
        }
    }

    /// The words of the next call.
    pub fn draw(&mut self) -> Vec<i128> {
        if self.step.is_multiple_of(SEGMENT) {
            self.amplitude = self.lcg.draw() >> 48;
            self.detuning = (self.lcg.draw() >> 52) as u32;
        }
        let kind = (self.step / SEGMENT) % 4;
        let n = self.step as u32;
        self.step += 1;
        let mut drawn = Vec::with_capacity(self.words.len());
        for (k, (range, rate)) in self.words.iter().enumerate() {
            let noise = self.lcg.draw() >> 32;
            let turn = n
                .wrapping_mul(rate.wrapping_add(self.detuning))
                .wrapping_add((k as u32) << 30);
            let up = turn.wrapping_mul(2);
            let triangle = u64::from(if turn >> 31 == 0 { up } else { !up });
            let scaled = ((triangle * self.amplitude) >> 16) + ((65535 - self.amplitude) << 15);
            let place = match kind {
                0 => scaled,
                1 => (scaled + (noise >> 12)).min(u64::from(u32::MAX)),
                2 => noise,
                _ => u64::from(u32::MAX) * u64::from(turn >> 31),
            };
            let span = (range.high - range.low) as u64;
            let high = (span >> 32) * place;
            let low = ((span & u64::from(u32::MAX)) * place + u64::from(u32::MAX)) >> 32;
            drawn.push(range.low + i128::from(high + low));
        }
        drawn
    }
}
