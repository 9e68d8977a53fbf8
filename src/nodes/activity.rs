//! What the theory of quantisation needs to know of a run: second moments of the signals, no error.

use crate::numeric::splitmix::GOLDEN;

/// Bins of the drive phase.
pub const PHASE_BINS: usize = 4096;

/// Counts different words, about (linear counting: Whang et al. 1990).
#[derive(Debug, Clone)]
pub struct Sketch {
    marks: Vec<u64>,
}

impl Sketch {
    /// A sketch that counts up to some times `bits`, a power of two from 64 on.
    pub fn new(bits: usize) -> Self {
        Sketch {
            marks: vec![0; bits / 64],
        }
    }

    /// Sees a word.
    #[inline(always)]
    pub fn mark(&mut self, word: u64) {
        let mixed = (word ^ (word >> 29))
            .wrapping_mul(0xd6e8_feb8_6659_fd93)
            .wrapping_mul(GOLDEN)
            >> 32;
        let bit = mixed as usize & (self.marks.len() * 64 - 1);
        if let Some(marks) = self.marks.get_mut(bit / 64) {
            *marks |= 1 << (bit % 64);
        }
    }

    /// How many different words there were, about.
    pub fn count(&self) -> f64 {
        let all = self.marks.len() as f64 * 64.0;
        let set: u32 = self.marks.iter().map(|w| w.count_ones()).sum();
        let empty = (all - f64::from(set)).max(1.0);
        -all * (empty / all).ln()
    }
}

/// Sums over one run.
#[derive(Debug, Clone)]
pub struct Activity {
    /// Sum of float I times Q, before the decimator, of drive and sense.
    pub product_cross: [f64; 2],
    /// The same behind it.
    pub output_cross: [f64; 2],
    last: f64,
    /// (code, entry), of drive and sense.
    pub pairs: [Sketch; 2],
    /// Codes of drive and sense by the zero bits that they end in; the last counts the code 0.
    pub code_zeros: [[u64; 33]; 2],
    /// Codes of the last so many samples, where phases repeat after them; of drive and sense.
    recent: [Vec<i128>; 2],
    at: [usize; 2],
    /// Sum of squared differences between codes at the same phase, and how many.
    noise: [(f64, u64); 2],
    /// Last sense I and Q.
    sense: [f64; 2],
    /// Sums of sense I and Q over the rows of a drive phase.
    pub phase_sense: Vec<[f64; 2]>,
    /// Rows by drive phase.
    pub phase_rows: Vec<u64>,
    /// Sum of 1 / length^2 over the rows of a drive phase.
    pub phase_inverse: Vec<f64>,
    /// Sum of 1 / length^2 of the drive vector over rows.
    pub inverse_square: f64,
    /// Sum of its square.
    pub inverse_fourth: f64,
    /// Rows.
    pub rows: u64,
}

impl Default for Activity {
    fn default() -> Self {
        Activity {
            product_cross: [0.0; 2],
            output_cross: [0.0; 2],
            last: 0.0,
            pairs: [Sketch::new(1 << 16), Sketch::new(1 << 16)],
            code_zeros: [[0; 33]; 2],
            recent: [Vec::new(), Vec::new()],
            at: [0; 2],
            noise: [(0.0, 0); 2],
            sense: [0.0; 2],
            phase_sense: vec![[0.0; 2]; PHASE_BINS],
            phase_inverse: vec![0.0; PHASE_BINS],
            phase_rows: vec![0; PHASE_BINS],
            inverse_square: 0.0,
            inverse_fourth: 0.0,
            rows: 0,
        }
    }
}

impl Activity {
    /// Where phases repeat after `period` samples, or nearly.
    pub fn with_period(period: Option<usize>) -> Self {
        let recent = vec![0; period.unwrap_or(0)];
        Activity {
            recent: [recent.clone(), recent],
            ..Activity::default()
        }
    }

    /// Compares a code with the one a period before.
    #[inline(always)]
    fn repeat(&mut self, pair: usize, code: i128) {
        let (recent, at) = (&mut self.recent[pair], &mut self.at[pair]);
        let Some(before) = recent.get_mut(*at) else {
            return;
        };
        let difference = (code - *before) as f64;
        *before = code;
        *at += 1;
        if *at == recent.len() {
            *at = 0;
        }
        let (sum, count) = &mut self.noise[pair];
        *sum += difference * difference;
        *count += 1;
    }

    /// How many codes share a phase at a time: 2 sqrt(pi) standard deviations of their noise (1 / sum of p^2 of
    /// a normal distribution), at least 1.
    pub fn codes_at_a_phase(&self, pair: usize) -> f64 {
        let (sum, count) = self.noise[pair];
        let variance = sum / (2.0 * count.max(1) as f64);
        (2.0 * (std::f64::consts::PI * variance).sqrt()).max(1.0)
    }

    /// A float product of channel 0 .. 3, from the raw code and entry.
    #[inline(always)]
    pub fn product(&mut self, channel: usize, real: f64, code: i128, entry: i128) {
        let pair = channel / 2;
        if channel.is_multiple_of(2) {
            self.last = real;
            self.repeat(pair, code);
            // A code has at most 32 bits.
            let zeros = (code as i32).trailing_zeros();
            if let Some(count) = self.code_zeros[pair].get_mut(zeros as usize) {
                *count += 1;
            }
            self.pairs[pair].mark(
                (code as u64)
                    .wrapping_mul(GOLDEN)
                    .wrapping_add(entry as u64),
            );
        } else {
            self.product_cross[pair] += self.last * real;
        }
    }

    /// A float output of channel 0 .. 3.
    pub fn output(&mut self, channel: usize, real: f64) {
        if channel.is_multiple_of(2) {
            self.last = real;
        } else {
            self.output_cross[channel / 2] += self.last * real;
            self.sense = [self.last, real];
        }
    }

    /// A row's drive vector.
    pub fn vector(&mut self, phase_turns: f64, length: f64) {
        self.rows += 1;
        let inverse = if length > 0.0 {
            1.0 / (length * length)
        } else {
            0.0
        };
        self.inverse_square += inverse;
        self.inverse_fourth += inverse * inverse;
        let bin = ((phase_turns + 0.5) * PHASE_BINS as f64).floor();
        let bin = (bin.max(0.0) as usize).min(PHASE_BINS - 1);
        if let (Some(rows), Some([i, q])) =
            (self.phase_rows.get_mut(bin), self.phase_sense.get_mut(bin))
        {
            *rows += 1;
            if let Some(sum) = self.phase_inverse.get_mut(bin) {
                *sum += inverse;
            }
            *i += self.sense[0];
            *q += self.sense[1];
        }
    }
}
