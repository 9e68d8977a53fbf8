//! The sine table's errors as the oscillator meets them: at the phases that it visits, one after the other.
//!
//! The error of each phase is known: entry - amplitude * sine. So its second moments over a run are not
//! guessed from a model of rounding but taken over the phases themselves, and what of it comes through the
//! decimator is what the same CIC makes of the sequence. A tone in the codes,
//! D_s sin theta + D_c cos theta, makes the products' errors D_s (e sin theta) + D_c (e cos theta): two sequences for
//! each of sine and cosine, filtered here once. Lines that fold to zero frequency, that fall on the
//! decimator's zeros, that drift: all are in it.

use crate::circuit::nco::Oscillator;
use crate::design::Design;
use crate::nodes::quantisation::Moments;
use crate::numeric::format::{Rounding, pow2};
use std::f64::consts::TAU;

/// Phases that are looked at, at most.
const MOST_SAMPLES: usize = 1 << 22;
/// What is decimated: e_s sin, e_s cos, e_c sin, e_c cos, 2 sin^2, 2 sin cos.
const SEQUENCES: usize = 6;
/// What makes integers of the carrier's products.
const CARRIER_SCALE: f64 = (1u64 << 44) as f64;
/// A block of them: a multiple of every short period.
const BLOCK: usize = 1 << 16;

/// Errors of sine and cosine over the phases of a run.
#[derive(Debug, Clone, Default)]
pub struct TableErrors {
    /// A.
    pub amplitude: f64,
    /// Of [sine, cosine]: mean of e^2 times [1, cos 2 theta, sin 2 theta].
    pub square: [[f64; 3]; 2],
    /// Share of phases whose entry ends in j zero bits, by j; the last stands for the entry 0.
    zero_bits: [Vec<f64>; 2],
    /// Behind the decimator.
    pub lines: Lines,
    /// The same with what a turn adds to the length added to x0 and x3: a turned vector keeps its length.
    pub stretch: Lines,
}

/// Table errors behind the decimator, relative to the signal: the errors of I and Q of a tone are I x0 + Q x1 and
/// I x2 + Q x3. (I and Q themselves hold what the decimator leaves of twice the carrier.)
#[derive(Debug, Clone, Copy, Default)]
pub struct Lines {
    /// Mean of x.
    pub mean: [f64; 4],
    /// Mean of x x'.
    pub square: [[f64; 4]; 4],
    /// Mean square of what turns every vector alike, (x2 - x1) / 2, rad^2.
    pub turn_square: f64,
}

impl Lines {
    fn add(&mut self, x: [f64; 4], turn: f64) {
        self.turn_square += turn * turn;
        for (k, a) in x.iter().enumerate() {
            self.mean[k] += a;
            for (sum, b) in self.square[k].iter_mut().zip(&x) {
                *sum += a * b;
            }
        }
    }

    fn divide(&mut self, rows: f64) {
        self.turn_square /= rows;
        let sums = self.mean.iter_mut().chain(self.square.iter_mut().flatten());
        sums.for_each(|sum| *sum /= rows);
    }

    /// u' mean(x).
    pub fn mean_of(&self, u: [f64; 4]) -> f64 {
        self.mean.iter().zip(u).map(|(m, u)| m * u).sum()
    }

    /// u' mean(x x') v.
    pub fn product_of(&self, u: [f64; 4], v: [f64; 4]) -> f64 {
        let rows = self.square.iter().zip(u);
        rows.map(|(row, u)| u * row.iter().zip(v).map(|(m, v)| m * v).sum::<f64>())
            .sum()
    }
}

impl TableErrors {
    /// Over the phases of the first `samples` samples, or blocks of them evenly spread.
    pub fn new(design: &Design, samples: u64) -> Self {
        let oscillator = Oscillator::new(&design.circuit.nco);
        let bits = design.circuit.nco.phase_bits;
        let mut sums = Sums::new(design, &oscillator);
        let (length, starts) = blocks(design, samples as usize);
        let word = (oscillator.tuning_word as u64) << (64 - bits);
        for start in starts {
            sums.begin();
            for k in start..start + length {
                sums.phase(word.wrapping_mul(k as u64 + 1));
            }
        }
        sums.finish()
    }

    /// rms of the error of sine (0) or cosine (1).
    pub fn rms(&self, part: usize) -> f64 {
        self.square.get(part).map_or(0.0, |s| s[0].max(0.0).sqrt())
    }

    /// Rounding of code * entry by `bits` bits, LSB. The product of two words that end in j and k zero bits ends
    /// in j + k, above which it is odd; `code_zeros` counts codes by their zero bits, the last being the code 0.
    pub fn product_rounding(
        &self,
        part: usize,
        code_zeros: &[u64],
        rounding: Rounding,
        bits: i32,
    ) -> Moments {
        let mut moments = Moments::default();
        let codes = code_zeros.iter().sum::<u64>().max(1) as f64;
        let of: Vec<Moments> = (0..=bits.max(0))
            .map(|zeros| Moments::of_rounding_odd(rounding, bits - zeros))
            .collect();
        // The words 0 stand last: nothing is rounded there.
        let entries = self.zero_bits.get(part).into_iter().flatten();
        for (j, share) in entries.take(64).enumerate() {
            for (k, count) in code_zeros.iter().take(32).enumerate() {
                let Some(of) = of.get(j + k) else { break };
                let share = share * *count as f64 / codes;
                moments.mean += share * of.mean;
                moments.square += share * of.square;
            }
        }
        moments
    }
}

/// Length of a block and where they begin.
fn blocks(design: &Design, samples: usize) -> (usize, Vec<usize>) {
    let d = &design.circuit.decimator;
    let settling = (d.ratio * d.stages * d.differential_delay) as usize;
    let length = BLOCK.max(16 * settling).next_multiple_of(BLOCK);
    if samples <= MOST_SAMPLES {
        return (samples, vec![0]);
    }
    let count = (MOST_SAMPLES / length).max(1);
    let starts = (0..count).map(|k| k * (samples - length) / count);
    (length, starts.collect())
}

/// The sums over phases, and a CIC for each of the four sequences.
struct Sums<'a> {
    oscillator: &'a Oscillator,
    stages: usize,
    ratio: usize,
    delay: usize,
    half: u64,
    lsb: f64,
    /// What makes integers of e * sin.
    scale: f64,
    integrators: [[i128; SEQUENCES]; 6],
    combs: [[[i128; SEQUENCES]; 2]; 6],
    /// Samples of the block.
    count: usize,
    rows: u64,
    phases: u64,
    errors: TableErrors,
}

impl<'a> Sums<'a> {
    fn new(design: &Design, oscillator: &'a Oscillator) -> Self {
        let d = &design.circuit.decimator;
        let table = &oscillator.table;
        let lsb = pow2(-(table.fraction_bits as i32));
        let dropped = table.phase_bits - table.address_bits;
        let widest = lsb + table.amplitude * TAU * pow2(-(table.address_bits as i32));
        Sums {
            oscillator,
            stages: d.stages as usize,
            ratio: d.ratio as usize,
            delay: d.differential_delay as usize,
            half: if table.half_step && dropped > 0 {
                1 << (63 - table.address_bits)
            } else {
                0
            },
            lsb,
            // 45 bits, and a CIC's 78 at most: within 128.
            scale: pow2(44) / widest,
            integrators: [[0; SEQUENCES]; 6],
            combs: [[[0; SEQUENCES]; 2]; 6],
            count: 0,
            rows: 0,
            phases: 0,
            errors: TableErrors {
                amplitude: table.amplitude,
                zero_bits: [vec![0.0; 65], vec![0.0; 65]],
                ..TableErrors::default()
            },
        }
    }

    fn begin(&mut self) {
        self.integrators = [[0; SEQUENCES]; 6];
        self.combs = [[[0; SEQUENCES]; 2]; 6];
        self.count = 0;
    }

    /// One sample at a phase of 2^-64 turn.
    fn phase(&mut self, phase: u64) {
        let table = &self.oscillator.table;
        let (sin, cos) = (phase as i64 as f64 * pow2(-64) * TAU).sin_cos();
        let weights = [1.0, cos * cos - sin * sin, 2.0 * sin * cos];
        let mut input = [0i128; SEQUENCES];
        for (part, exact) in [(0, sin), (1, cos)] {
            let ahead = phase.wrapping_add((part as u64) << 62);
            let address = ahead.wrapping_add(self.half) >> (64 - table.address_bits);
            let entry = table.entries.get(address as usize).copied().unwrap_or(0);
            let error = entry as f64 * self.lsb - table.amplitude * exact;
            for (sum, weight) in self.errors.square[part].iter_mut().zip(weights) {
                *sum += error * error * weight;
            }
            let zeros = (entry.trailing_zeros() as usize).min(64);
            if let Some(sum) = self.errors.zero_bits[part].get_mut(zeros) {
                *sum += 1.0;
            }
            let scaled = error * self.scale;
            input[2 * part] = (scaled * sin) as i64 as i128;
            input[2 * part + 1] = (scaled * cos) as i64 as i128;
        }
        input[4] = (2.0 * sin * sin * CARRIER_SCALE) as i64 as i128;
        input[5] = (2.0 * sin * cos * CARRIER_SCALE) as i64 as i128;
        self.phases += 1;
        self.decimate(input);
    }

    fn decimate(&mut self, mut x: [i128; SEQUENCES]) {
        for stage in self.integrators.iter_mut().take(self.stages) {
            for (sum, x) in stage.iter_mut().zip(&mut x) {
                *sum = sum.wrapping_add(*x);
                *x = *sum;
            }
        }
        self.count += 1;
        if !self.count.is_multiple_of(self.ratio) {
            return;
        }
        for stage in self.combs.iter_mut().take(self.stages) {
            let late = stage[self.delay - 1];
            stage[1] = stage[0];
            stage[0] = x;
            for (x, late) in x.iter_mut().zip(late) {
                *x = x.wrapping_sub(late);
            }
        }
        if self.count > self.ratio * self.stages * self.delay {
            self.row(x);
        }
    }

    fn row(&mut self, sums: [i128; SEQUENCES]) {
        let taps = ((self.ratio * self.delay) as f64).powi(self.stages as i32);
        let error_scale = 2.0 / (self.errors.amplitude * self.scale * taps);
        let carrier_scale = 1.0 / (CARRIER_SCALE * taps);
        let [a, b, c, d, p, q] = sums.map(|x| x as f64);
        let [a, b, c, d] = [a, b, c, d].map(|x| x * error_scale);
        // (D_s, D_c) makes I and Q of F = [[p, q], [q, 2 - p]]; the errors are given by I and Q: x = e F^-1.
        let (p, q) = (p * carrier_scale, q * carrier_scale);
        let determinant = p * (2.0 - p) - q * q;
        if determinant.is_nan() || determinant < 0.01 {
            return;
        }
        let by = |s: f64, c: f64| {
            [
                (s * (2.0 - p) - c * q) / determinant,
                (c * p - s * q) / determinant,
            ]
        };
        let ([x0, x1], [x2, x3]) = (by(a, b), by(c, d));
        let x = [x0, x1, x2, x3];
        self.rows += 1;
        let turn = (x[2] - x[1]) / 2.0;
        let along = (x[0] + x[3]) / 2.0;
        let longer = (1.0 + along).hypot(turn) - 1.0 - along;
        self.errors.lines.add(x, turn);
        let stretched = [x[0] + longer, x[1], x[2], x[3] + longer];
        self.errors.stretch.add(stretched, turn);
    }

    fn finish(self) -> TableErrors {
        let mut errors = self.errors;
        let phases = self.phases.max(1) as f64;
        let rows = self.rows.max(1) as f64;
        let of_phases = errors.square.iter_mut().flatten();
        for sum in of_phases.chain(errors.zero_bits.iter_mut().flatten()) {
            *sum /= phases;
        }
        errors.lines.divide(rows);
        errors.stretch.divide(rows);
        errors
    }
}
