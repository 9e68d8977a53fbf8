//! The fast rate in blocks: codes, carriers, products and integrators of all samples of a block,
//! with run-time word lengths, in the widest SIMD lanes that the processor has.
//!
//! This states the arithmetic of NCO, demodulator and integrators a second time, so it is never
//! trusted: it is compiled from the chain's own table and casts, it applies only where none of its
//! words can exceed 64 bits, and `block_kernel_tests.rs` compares it with [`Chain::sample`] over
//! random designs, every instruction set in turn.
//!
//! N integrators are linear: after h samples from the state x they hold A x + m. Row k of A holds
//! the numbers `C(h + k - j - 1, k - j)`, and m, the block's moments, is what the same samples leave in
//! integrators that start at zero. So parts of a block run side by side from zero, and are then
//! chained by A (Hogenauer 1981 for the integrators; sums are modulo 2^64, where no order matters).

use super::chain::{Chain, FastState};
use super::demodulator::Mixer;
use super::sample_lanes::{CarrierPair, Portable, SampleLanes, by_channel, carrier_pair};
use crate::numeric::cast::{End, Kernel, form};

#[cfg(test)]
#[path = "block_kernel_tests.rs"]
pub(super) mod tests;

/// What the fast rate is computed with. All give the same bits.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Instructions {
    /// Sample by sample, by the blocks as they are written.
    Plain,
    /// The block kernel, compiled for any processor; on x86-64 with SSE2 for codes and carriers of 16 bits.
    Portable,
    /// The block kernel with AVX2: x86-64-v3.
    Avx2,
    /// The block kernel with AVX-512 F, BW, CD, DQ and VL: x86-64-v4.
    Avx512,
}

impl Instructions {
    /// From the slowest to the fastest.
    pub const ALL: [Instructions; 4] = [
        Instructions::Plain,
        Instructions::Portable,
        Instructions::Avx2,
        Instructions::Avx512,
    ];

    /// Does this processor have them?
    pub fn are_there(self) -> bool {
        match self {
            Instructions::Plain | Instructions::Portable => true,
            #[cfg(target_arch = "x86_64")]
            Instructions::Avx2 => pulp::x86::V3::try_new().is_some(),
            #[cfg(target_arch = "x86_64")]
            Instructions::Avx512 => pulp::x86::V4::try_new().is_some(),
            #[cfg(not(target_arch = "x86_64"))]
            _ => false,
        }
    }

    /// The fastest that this processor has for a chain. Where its product is not quantised, the blocks as they are written
    /// are faster than a kernel without SIMD.
    pub fn best<const N: usize>(chain: &Chain<N>) -> Self {
        let there = Instructions::ALL.into_iter().rev().find(|i| i.are_there());
        let idle = chain.mixers.iter().all(|m| m.product.is_idle());
        match there {
            Some(Instructions::Portable) if idle && !sixteen_bits(chain) => Instructions::Plain,
            there => there.unwrap_or(Instructions::Plain),
        }
    }
}

/// Codes and carriers have at most 16 bits, and the processor's products of these are taken.
fn sixteen_bits<const N: usize>(chain: &Chain<N>) -> bool {
    let all = i128::from(i16::MIN)..=i128::from(i16::MAX);
    let codes = &chain.code_range;
    let carriers = &chain.nco.table.entries;
    #[cfg(target_arch = "x86_64")]
    let has_products = pulp::x86::V1::try_new().is_some();
    #[cfg(not(target_arch = "x86_64"))]
    let has_products = false;
    has_products
        && all.contains(&codes.low)
        && all.contains(&codes.high)
        && carriers.iter().all(|c| all.contains(&i128::from(*c)))
}

/// The fast rate of a chain, compiled.
#[derive(Debug, Clone)]
pub struct BlockKernel<const N: usize> {
    instructions: Instructions,
    /// See [`sixteen_bits`].
    sixteen_bits: bool,
    /// Sine and cosine by address, 2^a of them.
    carriers: Box<[CarrierPair]>,
    /// The phase is moved up to the top of 64 bits by this many.
    phase_spare_bits: u32,
    /// Bits of the moved phase below the address.
    address_shift: u32,
    /// Added to the moved phase before it is truncated to an address.
    half_step: u64,
    product: Kernel<i64>,
    /// A's coefficients C(h + k - 1, k) for the number h of samples in a part.
    growth: (usize, [i64; N]),
    /// Samples of a decimation period.
    ratio: usize,
    /// Carriers of whole periods, where the tuning word makes few different ones.
    known: Known,
}

/// The most samples of periods whose carriers are kept.
const KNOWN_SAMPLES: u64 = 1024;

/// Carriers of a coherent tuning word: period after period the phase starts at one of few places.
#[derive(Debug, Clone, Default)]
struct Known {
    /// What the phase advances by before each sample.
    step: u64,
    /// Samples of a block.
    samples: usize,
    /// By the phase before the block: the carriers, by sample of a part, part and channel.
    blocks: Vec<(u64, Vec<[[i64; 4]; 2]>)>,
}

impl<const N: usize> BlockKernel<N> {
    /// The kernel of a chain whose words and residues at the sample rate fit into 64 bits; `None`
    /// where it does not apply: a table wider than 32 bits, a product that can stop the run or that
    /// drops more bits than it has.
    pub fn new(chain: &Chain<N>, instructions: Instructions) -> Option<Self> {
        if instructions == Instructions::Plain || !instructions.are_there() {
            return None;
        }
        let entries = &chain.nco.table.entries;
        let quarter = entries.len() / 4;
        let carriers: Option<Box<[CarrierPair]>> = (0..entries.len())
            .map(|k| {
                let sine = i32::try_from(entries[k]).ok()?;
                let cosine = i32::try_from(entries[(k + quarter) % entries.len()]).ok()?;
                Some(carrier_pair(sine, cosine))
            })
            .collect();
        let carriers = carriers.filter(|c| !c.is_empty())?;
        let [first, others @ ..] = &chain.mixers;
        let alike = |m: &Mixer| {
            m.product.does_as(&first.product) && m.product.is_proved() == first.product.is_proved()
        };
        let product = first.product.kernel::<i64>().clone();
        if !others.iter().all(alike) || !product.follows_the_table() || product.end == End::Report {
            return None;
        }
        let table = &chain.nco.table;
        let spare = 64u32.checked_sub(table.phase_bits)?;
        let dropped = table.phase_bits - table.address_bits;
        let half_step = if table.half_step && dropped > 0 {
            1 << (dropped - 1 + spare)
        } else {
            0
        };
        Some(BlockKernel {
            instructions,
            sixteen_bits: sixteen_bits(chain),
            carriers,
            phase_spare_bits: spare,
            address_shift: 64 - table.address_bits,
            half_step,
            product,
            growth: (0, [0; N]),
            ratio: chain.cics[0].ratio as usize,
            known: Known::default(),
        })
    }

    /// How many of a block's samples do not fill the lanes; they are run one by one, and first.
    pub fn left_over(&self, samples: usize) -> usize {
        match self.instructions {
            Instructions::Avx512 => samples % 8,
            _ => samples % 4,
        }
    }

    /// Runs a block whose number of samples leaves nothing over.
    pub fn run(&mut self, state: &mut FastState<i64, N>, drive: &[i32], sense: &[i32]) {
        match self.instructions {
            #[cfg(target_arch = "x86_64")]
            Instructions::Avx512 => {
                if let Some(simd) = pulp::x86::V4::try_new() {
                    simd.vectorize(InLanes(simd, self, state, drive, sense));
                }
            }
            #[cfg(target_arch = "x86_64")]
            Instructions::Avx2 => {
                if let Some(simd) = pulp::x86::V3::try_new() {
                    simd.vectorize(InLanes(simd, self, state, drive, sense));
                }
            }
            #[cfg(target_arch = "x86_64")]
            _ if self.sixteen_bits => {
                if let Some(simd) = pulp::x86::V1::try_new() {
                    simd.vectorize(InLanes(simd, self, state, drive, sense));
                }
            }
            _ => self.in_lanes(Portable, state, drive, sense),
        }
    }

    #[inline(always)]
    fn in_lanes<S: SampleLanes>(
        &mut self,
        simd: S,
        state: &mut FastState<i64, N>,
        drive: &[i32],
        sense: &[i32],
    ) {
        let oscillator = &mut state.oscillator;
        let phase = (oscillator.phase as u64) << self.phase_spare_bits;
        let step = (oscillator.tuning as u64) << self.phase_spare_bits;
        let walk = Walk {
            phase: phase.wrapping_add(self.half_step),
            step,
        };
        let known = self.known_carriers::<S>(walk, drive.len());
        let codes = [drive, sense];
        let moments = match self.product.form() {
            form::IDLE => self.moments::<S, { form::IDLE }>(simd, walk, known, codes),
            form::ROUNDED => self.moments::<S, { form::ROUNDED }>(simd, walk, known, codes),
            _ => self.moments::<S, { form::ANY }>(simd, walk, known, codes),
        };
        let advance = oscillator.tuning.wrapping_mul(drive.len() as i64);
        oscillator.phase = oscillator.phase.wrapping_add(advance);

        self.grow_over(drive.len() / S::PARTS);
        let growth = &self.growth.1;
        let mut integrators: [[i64; 4]; N] =
            std::array::from_fn(|k| std::array::from_fn(|c| state.cics[c].integrators[k]));
        for part in [0, 1].into_iter().take(S::PARTS) {
            let old = integrators;
            for k in 0..N {
                let mut sums = moments[k][part];
                for j in 0..=k {
                    for c in 0..4 {
                        sums[c] = sums[c].wrapping_add(growth[k - j].wrapping_mul(old[j][c]));
                    }
                }
                integrators[k] = sums;
            }
        }
        for (c, cic) in state.cics.iter_mut().enumerate() {
            for (to, from) in cic.integrators.iter_mut().zip(&integrators) {
                *to = from[c];
            }
        }
    }

    /// What the block's parts leave in integrators that start at zero: by stage, part and channel.
    #[inline(always)]
    fn moments<S: SampleLanes, const FORM: u8>(
        &self,
        simd: S,
        walk: Walk,
        known: Option<usize>,
        [drive, sense]: [&[i32]; 2],
    ) -> [[[i64; 4]; 2]; N] {
        let length = drive.len() / S::PARTS;
        let first = Part::new(drive, sense, 0..length);
        let second = match S::PARTS {
            1 => first,
            _ => Part::new(drive, sense, length..2 * length),
        };
        let codes = first.drive.iter().zip(second.drive);
        let codes = codes.zip(first.sense.iter().zip(second.sense));
        let codes = codes.map(|((d0, d1), (s0, s1))| simd.codes([d0, d1], [s0, s1]));
        let mut integrators = [simd.splat(0); N];
        if let Some((_, carriers)) = known.and_then(|k| self.known.blocks.get(k)) {
            for (four, carriers) in codes.zip(carriers.as_chunks::<4>().0) {
                for (k, carrier) in carriers.iter().enumerate() {
                    let exact = simd.products(simd.code(four, k), simd.of_channels(carrier));
                    self.integrate::<S, FORM>(simd, &mut integrators, exact);
                }
            }
        } else {
            let addresses = self.carriers.len();
            // No address is out of the table: its length is a power of two.
            if addresses == 0 {
                return [[[0; 4]; 2]; N];
            }
            let carriers = &self.carriers[..addresses];
            let shift = self.address_shift;
            let at = |phase: u64| &carriers[(phase >> shift) as usize & (addresses - 1)];
            let ahead = walk.step.wrapping_mul(length as u64);
            let mut phase = walk.phase;
            for four in codes {
                for k in 0..4 {
                    phase = phase.wrapping_add(walk.step);
                    let pairs = simd.carriers([at(phase), at(phase.wrapping_add(ahead))]);
                    let exact = simd.products(simd.code(four, k), pairs);
                    self.integrate::<S, FORM>(simd, &mut integrators, exact);
                }
            }
        }
        integrators.map(|words| simd.by_channel(words))
    }

    /// One sample of each part into the integrators.
    #[inline(always)]
    fn integrate<S: SampleLanes, const FORM: u8>(
        &self,
        simd: S,
        integrators: &mut [S::Words; N],
        exact: S::Words,
    ) {
        let mut carried = self.product.in_lanes::<S, FORM>(simd, exact);
        for integrator in integrators {
            *integrator = simd.plus(*integrator, carried);
            carried = *integrator;
        }
    }

    /// The carriers of a block of a whole period, made at its first time, where there are few
    /// different ones; `None` elsewhere.
    #[inline(always)]
    fn known_carriers<S: SampleLanes>(&mut self, walk: Walk, samples: usize) -> Option<usize> {
        let known = &mut self.known;
        if known.step != walk.step || known.samples != samples {
            // Only what has just been seen is likely to come again: a loop moves the step.
            *known = Known {
                step: walk.step,
                samples,
                blocks: Vec::new(),
            };
            return None;
        }
        let place = known
            .blocks
            .iter()
            .position(|(phase, _)| *phase == walk.phase);
        if place.is_some() {
            return place;
        }
        let advance = walk.step.wrapping_mul(self.ratio as u64);
        let different = 1u64
            .checked_shl(64 - advance.trailing_zeros())
            .unwrap_or(u64::MAX);
        let whole = samples + self.left_over(self.ratio) == self.ratio;
        if !whole || different.saturating_mul(samples as u64) > KNOWN_SAMPLES {
            return None;
        }
        self.learn(walk, samples, samples / S::PARTS);
        None
    }

    /// Keeps the carriers of a block whose parts have `length` samples.
    #[cold]
    #[inline(never)]
    fn learn(&mut self, walk: Walk, samples: usize, length: usize) {
        let at = |k: usize| {
            let phase = walk.phase.wrapping_add(walk.step.wrapping_mul(k as u64));
            &self.carriers[(phase >> self.address_shift) as usize & (self.carriers.len() - 1)]
        };
        let second = samples - length;
        let carriers = (1..=length).map(|k| by_channel([at(k), at(k + second)]));
        let carriers = carriers.collect();
        self.known.blocks.push((walk.phase, carriers));
    }

    /// Makes A for parts of `length` samples.
    fn grow_over(&mut self, length: usize) {
        if self.growth.0 != length {
            let mut number = 1i128;
            for (k, to) in self.growth.1.iter_mut().enumerate() {
                // C(length + k - 1, k): each is the one before times an integer, divided exactly.
                if k > 0 {
                    number = number * (length + k - 1) as i128 / k as i128;
                }
                *to = number as i64;
            }
            self.growth.0 = length;
        }
    }
}

/// Where the phase is before a block, and what it advances by, at the top of 64 bits.
#[derive(Debug, Clone, Copy)]
struct Walk {
    phase: u64,
    step: u64,
}

/// Codes of a part of a block, in fours.
#[derive(Clone, Copy)]
struct Part<'a> {
    drive: &'a [[i32; 4]],
    sense: &'a [[i32; 4]],
}

impl<'a> Part<'a> {
    #[inline(always)]
    fn new(drive: &'a [i32], sense: &'a [i32], range: std::ops::Range<usize>) -> Self {
        let fours = |codes: &'a [i32]| codes.get(range.clone()).unwrap_or(&[]).as_chunks().0;
        Part {
            drive: fours(drive),
            sense: fours(sense),
        }
    }
}

/// The product's cast.
impl Kernel<i64> {
    /// As [`Kernel::apply`], in every lane.
    #[inline(always)]
    fn in_lanes<S: SampleLanes, const FORM: u8>(&self, simd: S, v: S::Words) -> S::Words {
        if FORM == form::IDLE {
            return v;
        }
        let mut v = v;
        if FORM == form::ANY {
            v = simd.shl(v, self.left);
            let sign = simd.shr(v, 63);
            let odd = simd.and(simd.splat(self.odd), simd.shr(v, self.right));
            v = simd.plus(v, simd.and(simd.splat(self.negative), sign));
            v = simd.plus(v, odd);
        }
        v = simd.shr(simd.plus(v, simd.splat(self.base)), self.right);
        if FORM == form::ROUNDED {
            return v;
        }
        match self.end {
            End::WrapSigned => {
                let spare = 64 - self.bits;
                simd.shr(simd.shl(v, spare), spare)
            }
            End::WrapUnsigned => simd.and(v, simd.splat(self.high)),
            End::Clamp => simd.clamp(v, simd.splat(self.low), simd.splat(self.high)),
            End::Exact | End::Report => v,
        }
    }
}

/// A run of a block in given lanes: an object, because closures are not inlined into functions that
/// are compiled for wider SIMD.
#[cfg(target_arch = "x86_64")]
struct InLanes<'a, S, const N: usize>(
    S,
    &'a mut BlockKernel<N>,
    &'a mut FastState<i64, N>,
    &'a [i32],
    &'a [i32],
);

#[cfg(target_arch = "x86_64")]
impl<S: SampleLanes, const N: usize> pulp::NullaryFnOnce for InLanes<'_, S, N> {
    type Output = ();

    #[inline(always)]
    fn call(self) {
        self.1.in_lanes(self.0, self.2, self.3, self.4);
    }
}
