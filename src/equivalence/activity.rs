//! What the theory of quantisation needs to know of a run: second moments of the signals, no error.

/// Bins of the drive phase.
pub const PHASE_BINS: usize = 4096;

/// 2^64 divided by the golden ratio: spreads words over a sketch (Knuth).
const GOLDEN: u64 = 0x9e37_79b9_7f4a_7c15;

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
    /// Rows by drive phase.
    pub phase_rows: Vec<u64>,
    /// Sum of 1 / length^2 of the drive vector over rows.
    pub inverse_square: f64,
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
            phase_rows: vec![0; PHASE_BINS],
            inverse_square: 0.0,
            rows: 0,
        }
    }
}

impl Activity {
    /// A float product of channel 0 .. 3, from the raw code and entry.
    #[inline(always)]
    pub fn product(&mut self, channel: usize, real: f64, code: i128, entry: i128) {
        let pair = channel / 2;
        if channel.is_multiple_of(2) {
            self.last = real;
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
        }
    }

    /// A row's drive vector.
    pub fn vector(&mut self, phase_turns: f64, length: f64) {
        self.rows += 1;
        if length > 0.0 {
            self.inverse_square += 1.0 / (length * length);
        }
        let bin = ((phase_turns + 0.5) * PHASE_BINS as f64).floor();
        if let Some(rows) = self
            .phase_rows
            .get_mut((bin.max(0.0) as usize).min(PHASE_BINS - 1))
        {
            *rows += 1;
        }
    }
}
