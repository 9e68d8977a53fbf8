//! Moments of rounding errors and of a sine table's errors (Widrow and Kollar, Quantization Noise, 2008).

use crate::design::Design;
use crate::numeric::cast::Cast;
use crate::numeric::constants;
use crate::numeric::format::{Rounding, pow2};
use std::f64::consts::TAU;

/// Mean and mean square of an error.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Moments {
    /// Mean.
    pub mean: f64,
    /// Mean square, the mean's square included.
    pub square: f64,
}

impl Moments {
    /// Mean square about the mean.
    pub fn variance(self) -> f64 {
        (self.square - self.mean * self.mean).max(0.0)
    }

    /// The error of a rounding that drops `bits` bits, all their 2^bits values being equally likely; LSB.
    ///
    /// With q = 2^-bits: to nearest 1/12 + q^2 / 6 (ties count a half); directed (1 - q)(2 - q) / 6.
    pub fn of_rounding(rounding: Rounding, bits: i32) -> Moments {
        if bits <= 0 {
            return Moments::default();
        }
        let q = pow2(-bits.min(1000));
        let directed = (1.0 - q) * (2.0 - q) / 6.0;
        let nearest = 1.0 / 12.0 + q * q / 6.0;
        let (mean, square) = match rounding {
            Rounding::Floor => (-(1.0 - q) / 2.0, directed),
            Rounding::Ceil => ((1.0 - q) / 2.0, directed),
            // Both signs equally likely.
            Rounding::TowardZero => (0.0, directed),
            Rounding::HalfUp => (q / 2.0, nearest),
            Rounding::HalfEven | Rounding::HalfAway => (0.0, nearest),
        };
        Moments { mean, square }
    }

    /// The rounding of a cast, LSB of its target.
    pub fn of_cast(cast: &Cast) -> Moments {
        Moments::of_rounding(cast.rounding, cast.shift)
    }
}

/// How the oscillator's phases are spread.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Spread {
    /// Few phases, all of them visited again and again: this many.
    Coherent(u64),
    /// So many that the phase below the address is uniform.
    Uniform,
    /// Neither: a slow drift over few phases, or too few samples.
    Unknown,
}

/// Phases that are enumerated at most.
const MOST_PHASES: u64 = 1 << 20;
/// Below this many phases a period, the table's errors are lines and no noise.
pub const FEW_PHASES: u64 = 1 << 12;

/// How a fixed tuning word spreads the phases over `samples` samples.
///
/// With x = word / 2^w, every convergent p/q of x says that the phases lie in q clusters that drift by
/// samples * |q x - p| of their distance. They cover the circle if they drift by their distance several times,
/// or if q is far beyond the table's addresses.
pub fn spread(design: &Design, samples: u64) -> Spread {
    let nco = &design.circuit.nco;
    let circle = 1i128 << nco.phase_bits;
    let word = i128::from(nco.tuning_word).rem_euclid(circle);
    let period = if word == 0 {
        1
    } else {
        circle >> word.trailing_zeros()
    };
    if period <= i128::from(MOST_PHASES) && period * 10 <= i128::from(samples) {
        return Spread::Coherent(period as u64);
    }
    let fine = 64i128 << nco.table_address_bits;
    // Continued fraction of word / circle.
    let (mut a, mut b) = (circle, word);
    let (mut q_before, mut q) = (0i128, 1i128);
    while b != 0 {
        if q > fine {
            return Spread::Uniform;
        }
        // |q x - p| = remainder / circle.
        let drift = b as f64 / circle as f64 * samples as f64;
        if drift < 10.0 {
            return Spread::Unknown;
        }
        let whole = a / b;
        (a, b) = (b, a % b);
        (q_before, q) = (q, whole.saturating_mul(q).saturating_add(q_before));
    }
    if q > fine {
        Spread::Uniform
    } else {
        Spread::Unknown
    }
}

/// Errors of sine and cosine over the phases.
#[derive(Debug, Clone, Default)]
pub struct TableErrors {
    /// A.
    pub amplitude: f64,
    /// Of [sine, cosine]: mean of e^2 times [1, cos 2 theta, sin 2 theta].
    pub square: [[f64; 3]; 2],
    /// Twice the mean of e times [sin theta, cos theta]: what is synchronous with the carrier.
    pub synchronous: [[f64; 2]; 2],
    /// Share of phases whose entry ends in j zero bits, by j; the last stands for the entry 0.
    pub zero_bits: [Vec<f64>; 2],
}

impl TableErrors {
    /// Enumerates all phases of a coherent oscillator, or every address with phases evenly between.
    pub fn new(design: &Design, spread: Spread) -> Self {
        let nco = &design.circuit.nco;
        let bits = nco.table.bits();
        let entries = constants::sine_table(nco.table_address_bits, bits);
        let addresses = entries.len() as u64;
        let (phases, offset) = match spread {
            Spread::Coherent(period) => (period, 0.0),
            _ => (addresses * 8, 0.5),
        };
        let lsb = nco.table.lsb();
        let amplitude = ((1i64 << (bits - 1)) - 1) as f64 * lsb;
        let half = if nco.address_rounding == Rounding::HalfUp
            && nco.phase_bits > nco.table_address_bits
        {
            0.5
        } else {
            0.0
        };
        let mut errors = TableErrors {
            amplitude,
            zero_bits: [vec![0.0; 65], vec![0.0; 65]],
            ..TableErrors::default()
        };
        let share = 1.0 / phases as f64;
        for k in 0..phases {
            let turns = (k as f64 + offset) / phases as f64;
            let (sin, cos) = (turns * TAU).sin_cos();
            let weights = [1.0, cos * cos - sin * sin, 2.0 * sin * cos];
            let address = (turns * addresses as f64 + half).floor() as u64;
            for (part, exact) in [(0, sin), (1, cos)] {
                let entry = entries
                    .get(((address + part as u64 * addresses / 4) % addresses) as usize)
                    .copied()
                    .unwrap_or(0);
                let error = entry as f64 * lsb - amplitude * exact;
                for (sum, weight) in errors.square[part].iter_mut().zip(weights) {
                    *sum += error * error * weight * share;
                }
                for (sum, weight) in errors.synchronous[part].iter_mut().zip([sin, cos]) {
                    *sum += 2.0 * error * weight * share;
                }
                let zeros = (entry.trailing_zeros() as usize).min(64);
                if let Some(sum) = errors.zero_bits[part].get_mut(zeros) {
                    *sum += share;
                }
            }
        }
        errors
    }

    /// rms of the error of sine (0) or cosine (1).
    pub fn rms(&self, part: usize) -> f64 {
        self.square.get(part).map_or(0.0, |s| s[0].max(0.0).sqrt())
    }

    /// Rounding of code * entry by `bits` bits, LSB: an entry that ends in zero bits leaves fewer to round.
    pub fn product_rounding(&self, part: usize, rounding: Rounding, bits: i32) -> Moments {
        let mut moments = Moments::default();
        for (zeros, share) in self.zero_bits.get(part).into_iter().flatten().enumerate() {
            let of = Moments::of_rounding(rounding, bits - zeros as i32);
            moments.mean += share * of.mean;
            moments.square += share * of.square;
        }
        moments
    }
}

/// Sum of the squared taps of an N-stage CIC whose taps add up to 1.
pub fn cic_noise_gain(stages: u32, width: usize) -> f64 {
    let mut taps = vec![1.0];
    for _ in 0..stages {
        let mut sum = 0.0;
        let next = (0..taps.len() + width - 1).map(|k| {
            sum += taps.get(k).copied().unwrap_or(0.0);
            let value = sum / width as f64;
            if k + 1 >= width {
                sum -= taps.get(k + 1 - width).copied().unwrap_or(0.0);
            }
            value
        });
        taps = next.collect();
    }
    taps.iter().map(|h| h * h).sum()
}
