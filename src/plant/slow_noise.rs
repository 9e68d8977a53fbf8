//! Flicker noise (bias instability) and rate random walk, as functions of (seed, stream, index) alone.
//!
//! Both are made on a grid of equal steps. Any value can be had without those before it, in at most
//! some fifty normal numbers, so neither threads nor the order of the calls can change one.

use super::noise::Noise;

/// The stream of [`SlowNoise`]'s flicker noise; the readings of a run count their streams from 0.
pub const FLICKER_STREAM: u64 = u64::MAX;

/// The stream of [`SlowNoise`]'s random walk.
pub const RANDOM_WALK_STREAM: u64 = u64::MAX - 1;

/// Bias instability in deg/s of one in deg/h.
pub fn dps_of_dph(dph: f64) -> f64 {
    dph / 3600.0
}

/// Rate random walk in deg/s/sqrt(s) of one in deg/h/sqrt(h).
pub fn dps_rts_of_dph_rth(dph_rth: f64) -> f64 {
    dph_rth / (3600.0 * 60.0)
}

/// How many standard deviations of an octave a flicker noise with B = 1 has: sqrt(ln 2 / pi).
const OCTAVE_PER_INSTABILITY: f64 = 0.469_718_639_349_825_66;

/// The variance, in octaves, of the white part that stands for the octaves shorter than a step. Their sum
/// would be 1 below the grid's band; 0.6 is the best compromise with what aliases at its upper end.
const BELOW_STEP_VARIANCE: f64 = 0.6;

/// Beyond the horizon, octaves that are still made: the lowest frequency of interest, 1 / horizon, lacks
/// less than 0.1 dB of those that are not.
const OCTAVES_BEYOND: u32 = 2;

/// Noise with a power spectral density proportional to 1/f.
///
/// Voss's sum (Gardner, Scientific American, April 1978): octave k holds a normal value for 2^k
/// steps. Its PSD, one-sided, is 2 s^2 T sinc^2(f T) with T = 2^k steps; as the octaves are 2 apart, their
/// sum is s^2 / (ln 2 f) but for a ripple of -0.5 and +0.3 dB. Each octave's grid starts at a place of its own,
/// so no instant has many changes at once. IEEE Std 952 defines the bias instability B by the
/// one-sided PSD B^2 / (pi f) (B^2 / (2 pi f) two-sided), whose Allan deviation is flat:
/// sqrt(2 ln 2 / pi) B = 0.664 B. Hence s = sqrt(ln 2 / pi) B.
///
/// The PSD is within 1 dB of B^2 / (pi f) from 1 / horizon to half the rate of the grid (measured from
/// 3 / horizon on: -0.7 to +0.8 dB, the extremes in the upper two octaves). The slowest
/// octaves are an offset over the horizon: the turn-on to turn-on part of the same noise.
#[derive(Debug, Clone, PartialEq)]
pub struct Flicker {
    /// Of each octave, deg/s.
    octave_dps: f64,
    /// The white part below one step, deg/s, and its noise.
    below: (f64, Noise),
    octaves: Vec<Octave>,
}

/// One octave: its noise, and where its grid starts before index 0, steps.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Octave {
    noise: Noise,
    start: u64,
}

impl Flicker {
    /// Flicker noise of bias instability B = `flicker_dps` (deg/s) for the indices 0 .. `horizon_steps`.
    /// Another horizon is another noise if its power of two is another.
    pub fn new(flicker_dps: f64, horizon_steps: u64, seed: u64, stream: u64) -> Self {
        let root = Noise::new(seed, stream);
        let noise = |k: u32| {
            let at = 3 * u64::from(k);
            (
                Noise::new(root.bits(at), root.bits(at + 1)),
                root.bits(at + 2),
            )
        };
        let last = horizon_steps.saturating_sub(1);
        let to_horizon = last.checked_ilog2().map_or(0, |bits| bits + 1);
        let octaves = (0..=(to_horizon + OCTAVES_BEYOND).min(62)).map(|k| {
            let (noise, start) = noise(k + 1);
            let start = start & ((1u64 << k) - 1);
            Octave { noise, start }
        });
        let octave_dps = OCTAVE_PER_INSTABILITY * flicker_dps;
        Flicker {
            octave_dps,
            below: (BELOW_STEP_VARIANCE.sqrt(), noise(0).0),
            octaves: octaves.collect(),
        }
    }

    /// The value at a step, deg/s.
    pub fn at(&self, index: u64) -> f64 {
        let held = self
            .octaves
            .iter()
            .zip(0u32..)
            .map(|(octave, k)| octave.noise.normal(index.wrapping_add(octave.start) >> k));
        let (rms, noise) = &self.below;
        let sum = held.fold(rms * noise.normal(index), |sum, x| sum + x);
        self.octave_dps * sum
    }

    /// The values of `count` steps from `first` on, deg/s: those of [`at`](Self::at), bit for bit,
    /// each held value drawn once.
    pub fn series(&self, first: u64, count: usize) -> Vec<f64> {
        let mut held = vec![(None, 0.0); self.octaves.len()];
        let (rms, noise) = &self.below;
        let value = |index: u64| {
            let mut sum = rms * noise.normal(index);
            for ((octave, k), (block, x)) in self.octaves.iter().zip(0u32..).zip(&mut held) {
                let now = index.wrapping_add(octave.start) >> k;
                if *block != Some(now) {
                    (*block, *x) = (Some(now), octave.noise.normal(now));
                }
                sum += *x;
            }
            self.octave_dps * sum
        };
        (0..count as u64)
            .map(|i| first.wrapping_add(i))
            .map(value)
            .collect()
    }
}

/// Integrated white noise, from 0 at index 0.
///
/// Levy's construction: W at a power of two is that at the one before plus an independent increment
/// of its variance; between, the middle of a dyadic interval of L steps is the mean of its ends plus a
/// normal value of variance L/4, which is the distribution of a Brownian motion there given its
/// ends. So the increments are exactly normal, independent, and of variance K^2 times their
/// time, and every index has a normal number of its own. The Allan deviation is
/// K sqrt(tau / 3) (IEEE Std 952). The horizon does not matter.
#[derive(Debug, Clone, PartialEq)]
pub struct RandomWalk {
    /// K sqrt(step), deg/s.
    step_dps: f64,
    noise: Noise,
    /// W at 2^j steps in units of `step_dps`, for j of 0 to 63.
    anchors: [f64; 64],
}

impl RandomWalk {
    /// Random walk of K = `random_walk_dps_rts` (deg/s/sqrt(s)) on steps of `step_s` seconds.
    pub fn new(random_walk_dps_rts: f64, step_s: f64, seed: u64, stream: u64) -> Self {
        let noise = Noise::new(seed, stream);
        let mut last = 0.0;
        let anchors = std::array::from_fn(|j| {
            // From 2^(j-1) to 2^j; from 0 to 1.
            let steps = 1u64 << (j as u32).saturating_sub(1);
            last += (steps as f64).sqrt() * noise.normal(1 << j);
            last
        });
        RandomWalk {
            step_dps: random_walk_dps_rts * step_s.sqrt(),
            noise,
            anchors,
        }
    }

    /// The value at a step, deg/s.
    pub fn at(&self, index: u64) -> f64 {
        self.step_dps * self.unit(index)
    }

    /// The values of `count` steps from `first` on, deg/s: those of [`at`](Self::at).
    pub fn series(&self, first: u64, count: usize) -> Vec<f64> {
        let indices = (0..count as u64).map(|i| first.wrapping_add(i));
        indices.map(|i| self.at(i)).collect()
    }

    /// In steps of unit variance.
    fn unit(&self, index: u64) -> f64 {
        let Some(exponent) = index.checked_ilog2() else {
            return 0.0;
        };
        let anchor = |j: u32| self.anchors.get(j as usize).copied().unwrap_or(f64::NAN);
        let (mut low, mut low_value) = (1u64 << exponent, anchor(exponent));
        if low == index {
            return low_value;
        }
        // Beyond 2^63 there is no anchor, and no run of 10^19 steps.
        let mut high_value = anchor(exponent + 1);
        let mut length = low;
        loop {
            let half = length / 2;
            let middle = low + half;
            let spread = (length as f64 / 4.0).sqrt();
            let middle_value = (low_value + high_value) / 2.0 + spread * self.noise.normal(middle);
            if middle == index {
                return middle_value;
            }
            if index < middle {
                high_value = middle_value;
            } else {
                (low, low_value) = (middle, middle_value);
            }
            length = half;
        }
    }
}

/// Flicker noise and rate random walk of one device on one grid.
#[derive(Debug, Clone, PartialEq)]
pub struct SlowNoise {
    flicker: Option<Flicker>,
    random_walk: Option<RandomWalk>,
}

impl SlowNoise {
    /// Bias instability `flicker_dph` (deg/h) and rate random walk `random_walk_dph_rth`
    /// (deg/h/sqrt(h)) on steps of `step_s` for `horizon_s`, both in seconds; 0 is off.
    pub fn new(
        flicker_dph: f64,
        random_walk_dph_rth: f64,
        step_s: f64,
        horizon_s: f64,
        seed: u64,
    ) -> Self {
        let steps = (horizon_s / step_s).ceil() as u64;
        let flicker = || Flicker::new(dps_of_dph(flicker_dph), steps, seed, FLICKER_STREAM);
        let k_dps_rts = dps_rts_of_dph_rth(random_walk_dph_rth);
        let walk = || RandomWalk::new(k_dps_rts, step_s, seed, RANDOM_WALK_STREAM);
        SlowNoise {
            flicker: (flicker_dph != 0.0).then(flicker),
            random_walk: (random_walk_dph_rth != 0.0).then(walk),
        }
    }

    /// What both add to the rate at a step, deg/s; exactly 0 if both are off.
    pub fn at(&self, index: u64) -> f64 {
        self.flicker.as_ref().map_or(0.0, |f| f.at(index))
            + self.random_walk.as_ref().map_or(0.0, |w| w.at(index))
    }

    /// The values of `count` steps from `first` on, deg/s: those of [`at`](Self::at).
    pub fn series(&self, first: u64, count: usize) -> Vec<f64> {
        let mut sum = match &self.flicker {
            Some(flicker) => flicker.series(first, count),
            None => vec![0.0; count],
        };
        if let Some(walk) = &self.random_walk {
            let steps = walk.series(first, count);
            sum.iter_mut().zip(steps).for_each(|(s, w)| *s += w);
        }
        sum
    }
}

#[cfg(test)]
#[path = "slow_noise_tests.rs"]
mod tests;
