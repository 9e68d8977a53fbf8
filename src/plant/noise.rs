//! Noise that is a function of (seed, stream, index) alone: neither threads nor the order of the
//! calls can change it, and any sample can be made without those before it.
//!
//! The generator is counter-based: the finaliser of splitmix64 (Steele, Lea, Flood 2014; a
//! bijection of 64 bits with full avalanche) is applied to the counter times the golden ratio under a
//! key, and to the result under a second key. Both keys come from seed and stream. The second round keeps two
//! streams apart even where their counters meet. Only integers and IEEE basic operations are used
//! ([`turn`]), so the values are the same on every machine.

use crate::numeric::splitmix::{GOLDEN, mix};
use crate::numeric::turn;
use std::cell::RefCell;
use std::sync::{Arc, Mutex, PoisonError};

/// One stream of noise.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Noise {
    inner: u64,
    outer: u64,
}

impl Noise {
    /// The stream `stream` of the noise of `seed`.
    pub const fn new(seed: u64, stream: u64) -> Self {
        let inner = mix(mix(seed.wrapping_add(GOLDEN)).wrapping_add(stream.wrapping_mul(GOLDEN)));
        Noise {
            inner,
            outer: mix(inner ^ GOLDEN),
        }
    }

    /// 64 random bits.
    #[inline(always)]
    pub const fn bits(&self, index: u64) -> u64 {
        mix(mix(index.wrapping_mul(GOLDEN).wrapping_add(self.inner)) ^ self.outer)
    }

    /// Uniform in (0, 1): (k + 1/2) / 2^52 with k of 52 bits; neither end is taken.
    #[inline(always)]
    pub const fn uniform(&self, index: u64) -> f64 {
        ((self.bits(index) >> 12) as f64 + 0.5) / (1u64 << 52) as f64
    }

    /// Two independent standard normal numbers, by Box and Muller: sqrt(-2 ln u) * (cos, sin)(2 pi v).
    ///
    /// Of the 64 bits, 40 make u = (k + 1/2) / 2^40 and 24 make v = j / 2^24, so no value is
    /// beyond sqrt(2 * 41 * ln 2) = 7.54; a true normal is so in one of 2e13.
    #[inline(always)]
    pub fn gaussian_pair(&self, index: u64) -> (f64, f64) {
        let bits = self.bits(index);
        let u = ((bits >> 24) as f64 + 0.5) / (1u64 << 40) as f64;
        let radius = (-2.0 * turn::ln(u)).sqrt();
        let (sine, cosine) = turn::sin_cos(bits << 40);
        (radius * cosine, radius * sine)
    }

    /// Two independent standard normal numbers for an ADC sample, as [`gaussian_pair`](Self::gaussian_pair) but in
    /// single precision: half of the bits make u = (k + 1/2) / 2^31, the others v = j / 2^32.
    ///
    /// No value is beyond sqrt(2 * 32 * ln 2) = 6.66; a true normal is so in one of 4e10. The smallest radius above zero
    /// is 3.5e-4.
    #[inline(always)]
    pub fn sample_pair(&self, index: u64) -> (f32, f32) {
        let (radius, turn) = halves(self.bits(index));
        polar_pair(radius, turn)
    }

    /// [`sample_pair`](Self::sample_pair) of the indices from `first` on: the firsts and the seconds. In the widest SIMD
    /// that the processor has; no sum is made in another order, so the values are the same.
    pub fn sample_pairs(&self, first: u64, pairs: [&mut [f32]; 2]) {
        let noise = *self;
        pulp::Arch::new().dispatch(Fill {
            noise,
            first,
            pairs,
        });
    }

    /// One standard normal number: the quantile of [`uniform`](Self::uniform), correct to 1e-6 and mostly to
    /// 1e-7, so that no value is beyond 8.21. A third of the cost of a pair.
    #[inline(always)]
    pub fn normal(&self, index: u64) -> f64 {
        quantile(self.uniform(index))
    }
}

/// Random bits of the radius, 31 of them, and of the angle.
#[inline(always)]
fn halves(bits: u64) -> (i32, u32) {
    ((bits >> 33) as i32, bits as u32)
}

/// The pair of a radius and an angle, both as random bits.
#[inline(always)]
fn polar_pair(radius: i32, angle: u32) -> (f32, f32) {
    let u = (radius as f32 + 0.5) * (1.0 / (1u32 << 31) as f32);
    let radius = (-2.0 * turn::single::ln(u)).sqrt();
    let (sine, cosine) = turn::single::sin_cos(angle);
    (radius * cosine, radius * sine)
}

/// A run of pairs: an object, because closures are not compiled for the caller's SIMD.
struct Fill<'a> {
    noise: Noise,
    first: u64,
    pairs: [&'a mut [f32]; 2],
}

/// Pairs whose bits are made before their values, so that a compiler takes as many lanes as each has (convention).
const AT_ONCE: usize = 64;

impl pulp::WithSimd for Fill<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _simd: S) {
        let [firsts, seconds] = self.pairs;
        let (mut radii, mut angles) = ([0; AT_ONCE], [0; AT_ONCE]);
        let mut first = self.first;
        let runs = firsts.chunks_mut(AT_ONCE);
        for (firsts, seconds) in runs.zip(seconds.chunks_mut(AT_ONCE)) {
            for k in 0..AT_ONCE {
                let index = first.wrapping_add(k as u64);
                (radii[k], angles[k]) = halves(self.noise.bits(index));
            }
            first = first.wrapping_add(AT_ONCE as u64);
            let count = firsts.len().min(seconds.len()).min(AT_ONCE);
            let (firsts, seconds) = (&mut firsts[..count], &mut seconds[..count]);
            for k in 0..count {
                (firsts[k], seconds[k]) = polar_pair(radii[k], angles[k]);
            }
        }
    }
}

/// Pairs of independent standard normal numbers by the index of the ADC sample that they belong to.
pub trait Pairs {
    /// Those of the samples from `first` on: the firsts and the seconds.
    fn fill(&self, first: u64, pairs: [&mut [f32]; 2]);
}

impl Pairs for Noise {
    fn fill(&self, first: u64, pairs: [&mut [f32]; 2]) {
        self.sample_pairs(first, pairs);
    }
}

/// Pairs drawn beforehand, for many circuits that are to see the same noise; none beyond their end.
#[derive(Debug, Clone)]
pub struct Drawn {
    pairs: [Vec<f32>; 2],
    first: u64,
}

impl Drawn {
    /// The first `count` pairs of a stream, for the samples from `first` on.
    pub fn new(noise: &Noise, first: u64, count: usize) -> Self {
        let mut pairs = [vec![0.0; count], vec![0.0; count]];
        noise.sample_pairs(0, pairs.each_mut().map(|p| &mut p[..]));
        Drawn { pairs, first }
    }
}

impl Pairs for Drawn {
    fn fill(&self, first: u64, pairs: [&mut [f32]; 2]) {
        for (to, from) in pairs.into_iter().zip(&self.pairs) {
            for (index, to) in (first..).zip(to) {
                let at = index.wrapping_sub(self.first) as usize;
                *to = from.get(at).copied().unwrap_or_default();
            }
        }
    }
}

/// Pairs in a chunk of a [`Shared`] stream (convention: 8 KiB, within a first cache).
const CHUNK: u64 = 1024;

/// Chunks that a [`Shared`] stream keeps: who walks along it further apart than these draws for himself.
const KEPT: u64 = 512;

/// Pairs of consecutive indices from a multiple of [`CHUNK`] on: the firsts and the seconds.
type Chunk = Arc<[[f32; CHUNK as usize]; 2]>;

/// A chunk and its number, once there is one.
type Slot = Option<(u64, Chunk)>;

/// A stream that several circuits walk along at about the same pace, perhaps on threads of their own: its pairs
/// are drawn once, in chunks, and kept for a while. They are a function of the index alone, so who draws
/// them changes nothing.
#[derive(Debug)]
pub struct Shared {
    noise: Noise,
    /// A chunk and its number, at the number modulo [`KEPT`].
    chunks: Box<[Mutex<Slot>]>,
}

impl Shared {
    /// Of a stream; nothing is drawn yet.
    pub fn new(noise: Noise) -> Self {
        Shared {
            noise,
            chunks: (0..KEPT).map(|_| Mutex::default()).collect(),
        }
    }

    /// Somebody who walks along it.
    pub fn walk(&self) -> Walk<'_> {
        Walk {
            shared: self,
            at_hand: RefCell::new(None),
        }
    }

    fn chunk(&self, number: u64) -> Chunk {
        let slot = &self.chunks[(number % KEPT) as usize];
        // A panic elsewhere leaves a chunk that is whole or none.
        let mut slot = slot.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some((kept, chunk)) = &*slot
            && *kept == number
        {
            return chunk.clone();
        }
        // Who reads the old chunk still keeps it; else its memory serves again.
        let old = slot.take().map(|(_, chunk)| chunk);
        let mut chunk = old.unwrap_or_else(|| Arc::new([[0.0; CHUNK as usize]; 2]));
        let [firsts, seconds] = Arc::make_mut(&mut chunk);
        let first = number.wrapping_mul(CHUNK);
        self.noise.sample_pairs(first, [firsts, seconds]);
        *slot = Some((number, chunk.clone()));
        chunk
    }
}

/// One who walks along a [`Shared`] stream.
#[derive(Debug)]
pub struct Walk<'a> {
    shared: &'a Shared,
    /// The last chunk that was read, and its number.
    at_hand: RefCell<Slot>,
}

impl Pairs for Walk<'_> {
    fn fill(&self, first: u64, [firsts, seconds]: [&mut [f32]; 2]) {
        let mut at_hand = self.at_hand.borrow_mut();
        let count = firsts.len().min(seconds.len());
        let mut done = 0;
        while done < count {
            let index = first.wrapping_add(done as u64);
            let (number, from) = (index / CHUNK, (index % CHUNK) as usize);
            if at_hand.as_ref().is_none_or(|(n, _)| *n != number) {
                *at_hand = Some((number, self.shared.chunk(number)));
            }
            let Some((_, chunk)) = &*at_hand else { return };
            let length = (count - done).min(CHUNK as usize - from);
            for (to, chunk) in [&mut *firsts, &mut *seconds].into_iter().zip(chunk.iter()) {
                to[done..done + length].copy_from_slice(&chunk[from..from + length]);
            }
            done += length;
        }
    }
}

/// The quantile of the standard normal distribution at `p` in (0, 1): Wichura's PPND7, algorithm
/// AS 241, Applied Statistics 37 (1988) 477. Rational functions for the middle 85 % and for two parts of the tails.
#[inline(always)]
fn quantile(p: f64) -> f64 {
    let q = p - 0.5;
    if q.abs() <= 0.425 {
        let r = 0.180_625 - q * q;
        let numerator =
            ((59.109_374_720 * r + 159.291_132_02) * r + 50.434_271_938) * r + 3.387_132_717_9;
        let denominator = ((67.187_563_600 * r + 78.757_757_664) * r + 17.895_169_469) * r + 1.0;
        return q * numerator / denominator;
    }
    let r = (-turn::ln(p.min(1.0 - p))).sqrt();
    let x = if r <= 5.0 {
        let r = r - 1.6;
        (((0.170_238_211_03 * r + 1.306_728_481_6) * r + 2.756_815_390_0) * r + 1.423_437_277_7)
            / ((0.120_211_329_75 * r + 0.737_001_642_50) * r + 1.0)
    } else {
        let r = r - 5.0;
        (((0.017_337_203_997 * r + 0.428_682_943_37) * r + 3.081_226_386_0) * r + 6.657_905_115_0)
            / ((0.012_258_202_635 * r + 0.241_978_942_25) * r + 1.0)
    };
    if q < 0.0 { -x } else { x }
}

#[cfg(test)]
mod tests {
    use super::*;

    const COUNT: u64 = 1_000_000;

    #[test]
    fn many_pairs_are_those_one_by_one() {
        let noise = Noise::new(20_040_024, 3);
        for (first, count) in [(0, 1), (5, 31), (1 << 40, 1000), (u64::MAX - 3, 9)] {
            let (mut a, mut b) = (vec![0.0; count], vec![0.0; count]);
            noise.sample_pairs(first, [&mut a, &mut b]);
            for k in 0..count {
                let pair = noise.sample_pair(first.wrapping_add(k as u64));
                assert_eq!((a[k], b[k]), pair, "{first} + {k}");
            }
        }
    }

    #[test]
    fn who_walks_along_a_shared_stream_sees_its_pairs() {
        let noise = Noise::new(20_040_024, 4);
        let shared = Shared::new(noise);
        // One ahead of the other by more than is kept, and back.
        let starts = [0u64, 5, 1000, CHUNK * (KEPT + 3) - 7, 1000, u64::MAX - 40];
        let (one, other) = (shared.walk(), shared.walk());
        for (k, first) in starts.into_iter().enumerate() {
            let count = 33 + 1500 * (k % 2);
            for walk in [&one, &other] {
                let (mut a, mut b) = (vec![0.0; count], vec![0.0; count]);
                walk.fill(first, [&mut a, &mut b]);
                let (mut c, mut d) = (vec![1.0; count], vec![1.0; count]);
                noise.fill(first, [&mut c, &mut d]);
                assert_eq!((a, b), (c, d), "{first}");
            }
        }
    }

    /// The means of x, x^2, x^3, x^4 and how many are beyond 3.
    fn moments(values: impl Iterator<Item = f64>) -> ([f64; 4], f64, u64) {
        let (mut sums, mut beyond, mut count) = ([0.0; 4], 0u64, 0u64);
        for x in values {
            let mut power = 1.0;
            for sum in &mut sums {
                power *= x;
                *sum += power;
            }
            beyond += u64::from(x.abs() > 3.0);
            count += 1;
        }
        (sums.map(|s| s / count as f64), count as f64, beyond)
    }

    #[test]
    fn the_moments_are_those_of_a_normal() {
        let noise = Noise::new(20_040_024, 7);
        let pairs = || (0..COUNT).map(|i| noise.gaussian_pair(i));
        let single = || {
            let pair = |i| noise.sample_pair(COUNT + i);
            (0..COUNT)
                .map(pair)
                .map(|(a, b)| (f64::from(a), f64::from(b)))
        };
        for ([m1, m2, m3, m4], n, beyond) in [
            moments(pairs().map(|p| p.0)),
            moments(pairs().map(|p| p.1)),
            moments(single().map(|p| p.0)),
            moments(single().map(|p| p.1)),
        ] {
            // Five standard errors: variances of the powers are 1, 2, 15, 96.
            let within = |value: f64, expected: f64, variance: f64| {
                assert!(
                    (value - expected).abs() < 5.0 * (variance / n).sqrt(),
                    "{value} {expected}"
                );
            };
            within(m1, 0.0, 1.0);
            within(m2, 1.0, 2.0);
            within(m3, 0.0, 15.0);
            within(m4, 3.0, 96.0);
            within(beyond as f64 / n, 0.002_699_8, 0.002_7);
        }
        let ([m1, m2, m3, m4], n, beyond) = moments((0..COUNT).map(|i| noise.normal(i)));
        let root = n.sqrt();
        assert!(m1.abs() < 5.0 / root && (m2 - 1.0).abs() < 7.1 / root);
        assert!(m3.abs() < 19.4 / root && (m4 - 3.0).abs() < 49.0 / root);
        assert!((beyond as f64 / n - 0.002_699_8).abs() < 0.26 / root);
        let apart = |pairs: &[(f64, f64)]| {
            let mean = |f: fn(f64) -> f64| {
                pairs.iter().map(|(a, b)| f(*a) * f(*b)).sum::<f64>() / COUNT as f64
            };
            assert!(mean(|x| x).abs() < 5e-3 && mean(|x| x * x - 1.0).abs() < 1e-2);
        };
        apart(&pairs().collect::<Vec<_>>());
        apart(&single().collect::<Vec<_>>());
    }

    /// The distribution function less 1/2, by the series of odd powers.
    fn above_half(x: f64) -> f64 {
        let (mut term, mut sum) = (x, x);
        for k in 1..400 {
            term *= x * x / f64::from(2 * k + 1);
            sum += term;
        }
        sum * (-x * x / 2.0).exp() / std::f64::consts::TAU.sqrt()
    }

    #[test]
    fn the_quantile_inverts_the_distribution() {
        for i in 1..8000 {
            let p = f64::from(i) / 8000.0;
            let x = quantile(p);
            let density = (-x * x / 2.0).exp() / std::f64::consts::TAU.sqrt();
            let error = (above_half(x) + 0.5 - p) / density;
            assert!(error.abs() < 1e-6, "{p}: {x} {error:e}");
        }
        // Tabulated: 1e-6, 1e-12 (the last part of the tail).
        for (p, x) in [(1e-6, -4.753_424_309), (1e-12, -7.034_483_825)] {
            assert!((quantile(p) - x).abs() < 1e-6, "{p}");
        }
        for k in 2..52 {
            let p = 0.5f64.powi(k);
            assert_eq!(quantile(p), -quantile(1.0 - p));
        }
        assert!((quantile(0.5f64.powi(53)) + 8.21).abs() < 0.01);
    }

    #[test]
    fn it_is_white_and_its_streams_are_independent() {
        let correlate = |a: &dyn Fn(u64) -> f64, b: &dyn Fn(u64) -> f64| {
            (0..200_000).map(|i| a(i) * b(i)).sum::<f64>() / 200_000.0
        };
        let stream = |seed, number| move |i| Noise::new(seed, number).gaussian_pair(i).0;
        let first = stream(1, 0);
        for lag in [1, 2, 3, 32, 1000] {
            assert!(correlate(&first, &|i| first(i + lag)).abs() < 5.0 / 200_000f64.sqrt());
        }
        for other in [
            stream(1, 1),
            stream(2, 0),
            stream(1, u64::MAX),
            stream(0, 1),
        ] {
            assert!(correlate(&first, &other).abs() < 5.0 / 200_000f64.sqrt());
        }
    }

    #[test]
    fn uniforms_fill_the_interval_evenly() {
        let noise = Noise::new(3, 3);
        let mut bins = [0u32; 64];
        for i in 0..640_000 {
            bins[(noise.uniform(i) * 64.0) as usize] += 1;
        }
        let chi: f64 = bins
            .iter()
            .map(|&b| (f64::from(b) - 1e4).powi(2) / 1e4)
            .sum();
        // 63 degrees of freedom: mean 63, standard deviation 11.
        assert!((20.0..120.0).contains(&chi), "{chi}");
    }

    #[test]
    fn every_bit_of_seed_stream_and_index_matters() {
        let base = Noise::new(0, 0).bits(0);
        for bit in 0..64 {
            let flips = [
                Noise::new(1 << bit, 0).bits(0),
                Noise::new(0, 1 << bit).bits(0),
                Noise::new(0, 0).bits(1 << bit),
            ];
            for flipped in flips {
                assert!((8..=56).contains(&(base ^ flipped).count_ones()));
            }
        }
    }
}
