//! Moments of rounding errors (Widrow and Kollar, Quantization Noise, 2008), and how an oscillator's phases are spread.

use crate::design::Design;
use crate::numeric::cast::Cast;
use crate::numeric::format::{Rounding, pow2};

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

    /// The same, all *odd* values being equally likely: each of them is half of all values, and the even ones
    /// are those of one bit less.
    pub fn of_rounding_odd(rounding: Rounding, bits: i32) -> Moments {
        if bits <= 0 {
            return Moments::default();
        }
        let (all, even) = (
            Moments::of_rounding(rounding, bits),
            Moments::of_rounding(rounding, bits - 1),
        );
        Moments {
            mean: 2.0 * all.mean - even.mean,
            square: 2.0 * all.square - even.square,
        }
    }

    /// The rounding of a cast, LSB of its target.
    pub fn of_cast(cast: &Cast) -> Moments {
        Moments::of_rounding(cast.rounding, cast.shift)
    }
}

/// How the oscillator's phases are spread over a run.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Spread {
    /// A short period: this many phases, again and again.
    Coherent(u64),
    /// Phases in this many clusters, which hardly drift during the run.
    Clusters(u64),
    /// Many phases.
    Many,
}

impl Spread {
    /// Places on the circle.
    pub fn places(self) -> f64 {
        match self {
            Spread::Coherent(count) | Spread::Clusters(count) => count as f64,
            Spread::Many => f64::INFINITY,
        }
    }
}

/// Below this many phases a period, the table's errors are lines and no noise.
pub const FEW_PHASES: u64 = 1 << 12;

/// Addresses that a slow drift has to pass.
const STEPS: f64 = 64.0;

/// How a fixed tuning word spreads the phases over `samples` samples.
///
/// With x = word / 2^w, every convergent p/q of x says that the phases lie in q clusters that drift by
/// samples * |q x - p| / q; the circle is covered if they drift by their distance 1 / q. If the clusters are not finer than
/// the table's addresses, its errors are waves as slow as that drift: they go round often enough to have nothing in
/// common with the signal's own changes if the drift is over `STEPS` addresses.
pub fn spread(design: &Design, samples: u64) -> Spread {
    let nco = &design.circuit.nco;
    let circle = 1i128 << nco.phase_bits;
    let word = i128::from(nco.tuning_word).rem_euclid(circle);
    let addresses = 1i128 << nco.table_address_bits;
    // Continued fraction of word / circle; ends where the period is met.
    let (mut a, mut b) = (circle, word);
    let (mut q_before, mut q) = (0i128, 1i128);
    while b != 0 {
        if q > i128::from(FEW_PHASES) {
            return Spread::Many;
        }
        // |q x - p| = b / circle.
        let drift = (b as f64 / circle as f64) * (samples as f64) / q as f64;
        let slow = q < 8 * addresses && drift * (addresses as f64) < STEPS;
        if drift * (q as f64) < 1.0 || slow {
            return Spread::Clusters(q as u64);
        }
        let whole = a / b;
        (a, b) = (b, a % b);
        (q_before, q) = (q, whole.saturating_mul(q).saturating_add(q_before));
    }
    if q > i128::from(FEW_PHASES) {
        Spread::Many
    } else {
        Spread::Coherent(q as u64)
    }
}

/// The period after which phases repeat, exactly or as nearly as 2^20 samples show.
pub fn repeats(design: &Design) -> Option<usize> {
    match spread(design, 1 << 20) {
        Spread::Coherent(count) | Spread::Clusters(count) => Some(count as usize),
        Spread::Many => None,
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
