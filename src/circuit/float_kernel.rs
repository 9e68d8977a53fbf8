//! The fast rate without quantisation over a whole decimation period, by moments.
//!
//! Inside a period the tuning word is constant, so what a period leaves in the integrators is a sum of its
//! inputs with weights that are made once: binomial coefficients times sine and cosine of n steps. The phase before
//! the period turns the sums. The integrators stay on their grid of 128 bits, so no error outlives the comb's memory.
//!
//! This states NCO, demodulator and integrators a second time, so it is never trusted: a test compares it with the
//! blocks as they are written over random designs. Both round, the blocks at each product, this at each sum: they
//! agree to some 1e-15 of full scale, not to the bit. The order of every sum is stated here, and no product and sum
//! are contracted, so the values do not depend on the processor.

use super::chain::{Chain, FastState};
use crate::numeric::arithmetic::Arithmetic;
use crate::numeric::float::Float;
use crate::numeric::format::pow2;
use crate::numeric::turn;

/// Samples that are added up side by side.
const WIDTH: usize = 8;

/// Inputs or weights of consecutive samples.
type Eight = [f64; WIDTH];

/// The weights of a period.
#[derive(Debug, Clone)]
pub struct FloatKernel<const N: usize> {
    ratio: usize,
    /// What the weights are made for: the phase's advance a sample, 2^-64 turn.
    step: Option<u64>,
    /// By integrator, sample: how often a sample is in it at the end of the period, times the carrier's amplitude
    /// and the value of an LSB.
    counts: [Vec<f64>; N],
    /// The counts times cosine and sine of n steps, by integrator, in eights; 0 after the period.
    weights: [[Vec<Eight>; 2]; N],
    /// How often the integrators before the period are in those after it, by distance.
    growth: [i128; N],
}

impl<const N: usize> FloatKernel<N> {
    /// Of a chain.
    pub fn new(chain: &Chain<N>) -> Self {
        let ratio = chain.cics[0].ratio as usize;
        let unit = chain.nco.table.amplitude * pow2(-chain.code_fraction_bits);
        let counts = std::array::from_fn(|k| {
            let left = |n: usize| unit * choose(ratio - n + k, k) as f64;
            (1..=ratio).map(left).collect()
        });
        FloatKernel {
            ratio,
            step: None,
            counts,
            weights: std::array::from_fn(|_| {
                std::array::from_fn(|_| vec![[0.0; WIDTH]; ratio.div_ceil(WIDTH)])
            }),
            growth: std::array::from_fn(|k| choose(ratio + k - 1, k)),
        }
    }

    /// Samples of a period.
    pub fn samples(&self) -> usize {
        self.ratio
    }

    /// A whole period of both ADC inputs, LSB.
    pub fn run(
        &mut self,
        chain: &Chain<N>,
        state: &mut FastState<i128, N>,
        [drive, sense]: [&[f64]; 2],
    ) {
        // One turn is the whole 128-bit circle; 2^-64 turn is far below what a carrier is rounded to.
        let oscillator = &mut state.oscillator;
        let step = (oscillator.tuning >> 64) as u64;
        if self.step != Some(step) {
            self.step = Some(step);
            pulp::Arch::new().dispatch(Weigh { kernel: self, step });
        }
        let (sine, cosine) = turn::sin_cos((oscillator.phase >> 64) as u64);
        let advance = oscillator.tuning.wrapping_mul(self.ratio as i128);
        oscillator.phase = oscillator.phase.wrapping_add(advance);

        let sums = pulp::Arch::new().dispatch(Sums {
            kernel: self,
            inputs: [drive, sense],
        });
        for (c, cic) in state.cics.iter_mut().enumerate() {
            let old = cic.integrators;
            for (k, integrator) in cic.integrators.iter_mut().enumerate() {
                let [by_cosine, by_sine] = sums[c / 2][k];
                let sum = match c % 2 {
                    0 => sine * by_cosine + cosine * by_sine,
                    _ => cosine * by_cosine - sine * by_sine,
                };
                let mut new = Float.residue(sum, &chain.cics[c].ring);
                for (j, old) in old.iter().enumerate().take(k + 1) {
                    new = new.wrapping_add(self.growth[k - j].wrapping_mul(*old));
                }
                *integrator = new;
            }
        }
    }
}

/// The binomial coefficient C(n, k), modulo 2^128; k is at most 5.
fn choose(n: usize, k: usize) -> i128 {
    // Each is the one before times an integer, divided exactly.
    (1..=k).fold(1, |number, j| number * (n - k + j) as i128 / j as i128)
}

/// Makes the weights of a step: an object, as all that is compiled for wider SIMD.
struct Weigh<'a, const N: usize> {
    kernel: &'a mut FloatKernel<N>,
    step: u64,
}

impl<const N: usize> pulp::WithSimd for Weigh<'_, N> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _simd: S) {
        let FloatKernel {
            counts, weights, ..
        } = self.kernel;
        let chunks = weights[0][0].len();
        for chunk in 0..chunks {
            let (mut sine, mut cosine) = ([0.0; WIDTH], [0.0; WIDTH]);
            for lane in 0..WIDTH {
                let n = (chunk * WIDTH + lane + 1) as u64;
                (sine[lane], cosine[lane]) = turn::sin_cos(self.step.wrapping_mul(n));
            }
            for k in 0..N {
                let from = &counts[k][chunk * WIDTH..];
                for lane in 0..WIDTH.min(from.len()) {
                    weights[k][0][chunk][lane] = from[lane] * cosine[lane];
                    weights[k][1][chunk][lane] = from[lane] * sine[lane];
                }
            }
        }
    }
}

/// Sums of inputs with their weights: by input, integrator, and cosine or sine.
struct Sums<'a, const N: usize> {
    kernel: &'a FloatKernel<N>,
    inputs: [&'a [f64]; 2],
}

impl<const N: usize> Sums<'_, N> {
    /// Takes eight samples of both inputs into sums by integrator, cosine or sine, input, and lane: no sum waits for another.
    #[inline(always)]
    fn take(&self, sums: &mut [[[Eight; 2]; 2]; N], chunk: usize, eights: [&Eight; 2]) {
        for (sums, weights) in sums.iter_mut().zip(&self.kernel.weights) {
            for (sums, weights) in sums.iter_mut().zip(weights) {
                let Some(weight) = weights.get(chunk) else {
                    return;
                };
                for (sum, eight) in sums.iter_mut().zip(eights) {
                    for lane in 0..WIDTH {
                        sum[lane] += eight[lane] * weight[lane];
                    }
                }
            }
        }
    }
}

impl<const N: usize> pulp::WithSimd for Sums<'_, N> {
    type Output = [[[f64; 2]; N]; 2];

    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _simd: S) -> [[[f64; 2]; N]; 2] {
        let [drive, sense] = self.inputs;
        let (drive, drive_rest) = drive.as_chunks::<WIDTH>();
        let (sense, sense_rest) = sense.as_chunks::<WIDTH>();
        let mut sums = [[[[0.0; WIDTH]; 2]; 2]; N];
        for (chunk, (drive, sense)) in drive.iter().zip(sense).enumerate() {
            self.take(&mut sums, chunk, [drive, sense]);
        }
        if !drive_rest.is_empty() {
            let mut last = [[0.0; WIDTH]; 2];
            for (last, rest) in last.iter_mut().zip([drive_rest, sense_rest]) {
                last[..rest.len()].copy_from_slice(rest);
            }
            self.take(&mut sums, drive.len(), last.each_ref());
        }
        let mut added = [[[0.0; 2]; N]; 2];
        for (k, sums) in sums.iter().enumerate() {
            for (part, sums) in sums.iter().enumerate() {
                for (added, sum) in added.iter_mut().zip(sums) {
                    let [a, b, c, d, e, f, g, h] = *sum;
                    added[k][part] = ((a + e) + (c + g)) + ((b + f) + (d + h));
                }
            }
        }
        added
    }
}

#[cfg(test)]
mod tests {
    use crate::circuit::block_kernel::tests::{Draw, codes, design};
    use crate::circuit::engine::{self, ArithmeticKind, Rows};
    use crate::design::{LoopGain, limits};

    /// Whole periods go through the kernel; pieces of another length through the blocks as they are written.
    #[test]
    fn whole_periods_are_as_the_blocks_sample_by_sample() {
        let mut compared = 0;
        for case in 0..300u64 {
            let mut draw = Draw(case << 32);
            let mut design = design(&mut draw);
            // A loop that does not contract makes two roundings as far apart as it likes; a weak one moves the word too.
            if let Some(phase_loop) = &mut design.circuit.phase_loop {
                phase_loop.proportional = LoopGain { raw: 1, shift: 30 };
                phase_loop.integral = LoopGain { raw: 1, shift: 40 };
            }
            if limits::check(&design).is_err() {
                continue;
            }
            compared += 1;
            let ratio = design.circuit.decimator.ratio as usize;
            let format = design.circuit.adc.format;
            let mut inputs = || -> Vec<f64> {
                let codes = codes(&mut draw, format, ratio * 12);
                codes.into_iter().map(|c| f64::from(c) + 0.3).collect()
            };
            let (drive, sense) = (inputs(), inputs());
            let columns = engine::columns(&design).len();
            let channels = |piece: usize| {
                let mut engine = engine::engine(&design, ArithmeticKind::Float);
                let mut rows = engine.no_rows();
                for (d, s) in drive.chunks(piece).zip(sense.chunks(piece)) {
                    engine
                        .process_inputs(d, s, &mut rows)
                        .expect("no cast stops");
                }
                let Rows::Real(rows) = rows else {
                    return Vec::new();
                };
                let rows = rows.chunks_exact(columns);
                rows.flat_map(|row| row[..4].to_vec()).collect::<Vec<f64>>()
            };
            let (whole, single) = (channels(ratio), channels(ratio - 1));
            assert_eq!(whole.len(), 4 * 12);
            let same = whole
                .iter()
                .zip(&single)
                .all(|(a, b)| (a - b).abs() < 1e-13);
            assert!(same, "case {case}: {whole:?} {single:?}");
        }
        assert!(compared > 100, "{compared}");
    }
}
