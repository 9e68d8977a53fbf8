//! What the rounding of an ADC does to a tone that the oscillator samples at the same few phases over and over.
//!
//! The errors of the codes then repeat with the oscillator: no averaging removes them, and demodulated they are an
//! offset of I and Q that turns with the tone's amplitude and phase. Noise before the ADC takes it away: of the
//! error's k-th harmonic in the input it leaves exp(-2 pi^2 k^2 sigma^2), sigma in LSB (Widrow & Kollár 2008, ch. 19).

use crate::circuit::demodulator::Mixer;
use crate::circuit::nco::Oscillator;
use crate::design::Design;
use crate::numeric::arithmetic::{Arithmetic, Block};
use crate::numeric::fixed::Fixed;
use crate::numeric::format::pow2;
use crate::statistics::normal;
use std::f64::consts::{PI, TAU};

/// Most phases of the oscillator that are followed one by one.
const MOST_PHASES: f64 = 1024.0;

/// Harmonics of the rounding error that are added up.
const HARMONICS: usize = 64;

/// Noise below it (LSB) is none; how many deviations of it are looked at.
const SILENT: f64 = 1e-6;
const REACH: f64 = 4.5;

/// Most turns of the way back from what was read, and the change at which it ends, LSB.
const TURNS: usize = 60;
const SETTLED: f64 = 1e-5;

/// How many phases the oscillator samples before it repeats: a power of two, 2^w / gcd(FCW, 2^w). All that there are
/// where a phase loop moves it.
pub fn period(design: &Design) -> f64 {
    let nco = &design.circuit.nco;
    let free = match design.circuit.phase_loop {
        Some(_) => 0,
        None => nco.tuning_word.trailing_zeros().min(nco.phase_bits),
    };
    pow2((nco.phase_bits - free) as i32)
}

/// How many different phases `samples` samples of a tone of `amplitude_lsb` see, for its rounding. A tuning word that is
/// nearly p/q turns samples q phases that creep: as long as the tone moves by less than an LSB meanwhile these are
/// q; beyond, the sawtooth of the rounding error averages out with the square of the way.
pub fn phases(design: &Design, amplitude_lsb: f64, samples: f64) -> f64 {
    let period = period(design);
    if design.circuit.phase_loop.is_some() {
        return period.min(samples);
    }
    let turn = pow2(design.circuit.nco.phase_bits as i32);
    let frequency = (design.circuit.nco.tuning_word as f64 / turn).rem_euclid(1.0);
    // Denominators of the best approximations p/q (continued fraction).
    let (mut before, mut q, mut rest) = (0.0, 1.0, frequency);
    let mut least = period.min(samples);
    while q < least {
        let creep = (q * frequency - (q * frequency).round()).abs() / q * samples;
        let way_lsb = TAU * amplitude_lsb * creep;
        least = least.min(q * way_lsb.powi(2).max(1.0));
        if rest < 1e-12 {
            break;
        }
        let whole = (1.0 / rest).floor();
        rest = 1.0 / rest - whole;
        (before, q) = (q, whole * q + before);
    }
    least
}

/// The rms that rounding leaves in I or in Q, LSB, for a tone of some amplitude, `phases` sampled phases and
/// noise before the ADC, both in LSB; over all amplitudes and phases of the tone near to these.
///
/// Two parts of the k-th harmonic of the rounding error in the input: at N phases as if independent, 4 / N of its
/// variance (2 / N, and opposite phases have opposite errors), where N does not follow its 2 pi k A cycles in a
/// turn; and its fundamental over the turn, 2 / (pi k) J_1(2 pi k A), which no number of phases removes.
pub fn rms_lsb(phases: f64, amplitude_lsb: f64, noise_lsb: f64) -> f64 {
    let left = |k: f64| (-(TAU * k * noise_lsb).powi(2)).exp();
    let square: f64 = (1..=HARMONICS)
        .map(|k| {
            let k = k as f64;
            let independent = if TAU * k * amplitude_lsb > phases {
                4.0 / phases / (2.0 * (PI * k).powi(2))
            } else {
                0.0
            };
            // The mean of J_1^2 over the phase of its argument z is 1 / (pi z); half of it is in I.
            let tone = 1.0 / (PI.powi(4) * k.powi(3) * amplitude_lsb.max(1.0));
            (independent + tone) * left(k)
        })
        .sum();
    square.sqrt()
}

/// Both demodulators of one ADC over one period of the oscillator, bit for bit, but for the noise before the ADC,
/// over which they are averaged.
pub struct Rounding {
    samples: Vec<Sample>,
    mixers: [Mixer; 2],
    noise_lsb: f64,
    limits: [f64; 2],
    code_fraction_bits: i32,
    /// One LSB of an exact product and of a demodulator's product, in LSB of the tone.
    exact_lsb: f64,
    product_lsb: f64,
}

/// One phase of the oscillator.
struct Sample {
    /// Sine and cosine of the phase itself.
    tone: [f64; 2],
    /// The table's words.
    carriers: [i128; 2],
}

type Words = Fixed<i128, i128>;

impl Rounding {
    /// Of the channels I and Q (of `circuit::CHANNELS`) with noise of `noise_lsb` before their ADC; `None` where the
    /// oscillator does not repeat after few samples.
    pub fn new(design: &Design, channels: [&'static str; 2], noise_lsb: f64) -> Option<Self> {
        let count = period(design);
        if design.circuit.phase_loop.is_some() || count > MOST_PHASES {
            return None;
        }
        let circuit = &design.circuit;
        let (adc, table) = (circuit.adc.format, circuit.nco.table);
        let ar = Words::new();
        let oscillator = Oscillator::new(&circuit.nco);
        let mut state = oscillator.start(&ar);
        let turn = (1i128 << circuit.nco.phase_bits) - 1;
        let samples: Vec<Sample> = (0..count as usize)
            .map(|_| {
                let carriers = Block::<Words, 0, 2>::step(&oscillator, &ar, &mut state, []);
                let turns = (state.phase & turn) as f64 * pow2(-(circuit.nco.phase_bits as i32));
                let (sin, cos) = (TAU * turns).sin_cos();
                Sample {
                    tone: [sin, cos],
                    carriers,
                }
            })
            .collect();
        // A product with the carrier halves an amplitude.
        let peak = (pow2(table.bits() as i32 - 1) - 1.0) * table.lsb();
        let unit = 2.0 / (count * peak * adc.lsb());
        Some(Rounding {
            samples,
            mixers: channels.map(|channel| Mixer::new(circuit, channel)),
            noise_lsb,
            limits: [adc.min_raw() as f64, adc.max_raw() as f64],
            code_fraction_bits: adc.fraction_bits as i32,
            exact_lsb: unit * adc.lsb() * table.lsb(),
            product_lsb: unit * circuit.demodulator.product.format.lsb(),
        })
    }

    /// What rounding adds to I and Q of a tone `i` sin + `q` cos, all in LSB of the ADC.
    pub fn added(&self, [i, q]: [f64; 2]) -> [f64; 2] {
        let ar = Words::new();
        let mut sum = [0.0; 2];
        for sample in &self.samples {
            let input = i * sample.tone[0] + q * sample.tone[1];
            self.each_code(input, |code, weight| {
                let word = ar.constant(code as i128, self.code_fraction_bits);
                for ((sum, mixer), carrier) in sum.iter_mut().zip(&self.mixers).zip(sample.carriers)
                {
                    let [product] =
                        Block::<Words, 2, 1>::step(mixer, &ar, &mut (), [word, carrier]);
                    *sum += weight * product as f64 * self.product_lsb;
                }
            });
            for (sum, carrier) in sum.iter_mut().zip(sample.carriers) {
                *sum -= input * carrier as f64 * self.exact_lsb;
            }
        }
        sum
    }

    /// The tone that is read as I and Q: what was read less what rounding adds there (a fixed point, half of each
    /// step taken).
    pub fn behind(&self, read: [f64; 2]) -> [f64; 2] {
        let mut tone = read;
        for _ in 0..TURNS {
            let added = self.added(tone);
            let mut change: f64 = 0.0;
            for k in 0..2 {
                let step = 0.5 * (read[k] - added[k] - tone[k]);
                tone[k] += step;
                change = change.max(step.abs());
            }
            if change < SETTLED {
                break;
            }
        }
        tone
    }

    /// The codes that an input becomes, each with its probability.
    fn each_code(&self, input_lsb: f64, mut with: impl FnMut(f64, f64)) {
        let [low, high] = self.limits;
        let code = |lsb: f64| (lsb + 0.5).floor().max(low).min(high);
        if self.noise_lsb < SILENT {
            with(code(input_lsb), 1.0);
            return;
        }
        let reach = REACH * self.noise_lsb;
        let (first, last) = (code(input_lsb - reach), code(input_lsb + reach));
        let below = |edge: f64| normal::below((edge - input_lsb) / self.noise_lsb);
        let mut before = 0.0;
        let mut at = first;
        while at < last {
            let upto = below(at + 0.5);
            with(at, upto - before);
            before = upto;
            at += 1.0;
        }
        with(last, 1.0 - before);
    }
}

#[cfg(test)]
#[path = "adc_rounding_tests.rs"]
mod tests;
