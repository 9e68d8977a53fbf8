//! The bench: a drive tone and a sense tone, noise, two converters.

use super::faults::{Fault, Faults};
use std::f64::consts::TAU;

/// Splitmix64 and what is drawn with it.
#[derive(Clone)]
pub struct Dice(u64);

impl Dice {
    pub fn new(seed: u64) -> Self {
        Dice(seed ^ 0x5851_f42d_4c95_7f2d)
    }

    pub fn word(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    pub fn unit(&mut self) -> f64 {
        (self.word() >> 11) as f64 / (1u64 << 53) as f64
    }

    pub fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.unit()
    }

    pub fn spread(&mut self, low: f64, high: f64) -> f64 {
        self.between(low.ln(), high.ln()).exp()
    }

    pub fn below(&mut self, n: usize) -> usize {
        (self.word() % n as u64) as usize
    }

    pub fn odds(&mut self, p: f64) -> bool {
        self.unit() < p
    }

    pub fn gauss(&mut self) -> f64 {
        let radius = (-2.0 * (1.0 - self.unit()).ln()).sqrt();
        radius * (TAU * self.unit()).cos()
    }
}

/// What a capture is made of, its faults aside.
#[derive(Debug, Clone)]
pub struct Bench {
    pub seed: u64,
    pub rows: usize,
    pub fs_hz: f64,
    pub ftw: u32,
    pub bits: u32,
    pub amplitude: f64,
    pub in_phase: f64,
    pub quadrature: f64,
    pub sense_phase: f64,
    pub codes_per_dps: f64,
    pub rate_known: bool,
    /// Noise of each channel, codes rms.
    pub noise: [f64; 2],
    /// Noise is added to the rounded code, as a whole number.
    pub noise_after: bool,
    /// Relative 1/f wander of both amplitudes, rms.
    pub wander: f64,
}

/// Codes and the keys of the side-car.
#[derive(Debug, Clone)]
pub struct Made {
    pub codes: [Vec<i32>; 2],
}

impl Bench {
    pub fn draw(seed: u64) -> Bench {
        let mut d = Dice::new(seed);
        let rows = d.spread(2000.0, 200_000.0) as usize;
        let fs_hz = d.spread(2e4, 1e6).round();
        let least = (40.0 / rows as f64).max(0.004);
        let turns = if d.odds(0.3) {
            d.between(0.2, 0.46)
        } else {
            d.spread(least, 0.3)
        };
        let mut ftw = (turns * 4_294_967_296.0) as u32;
        if d.odds(0.3) {
            let bits = 18 + d.below(8);
            ftw = ((ftw >> bits) << bits)
                .max(1 << bits)
                .max((least * 4_294_967_296.0) as u32 >> bits << bits);
        }
        let bits = 8 + d.below(9) as u32;
        let full = f64::powi(2.0, bits as i32 - 1);
        let amplitude = full * d.between(0.25, 0.88);
        let sense = full * d.spread(0.01, 0.5);
        let angle = d.between(0.0, TAU);
        let loudest = (full / 150.0).max(0.6);
        let sigma = d.spread(0.15, loudest.min(30.0));
        let second = sigma * d.between(0.7, 1.4);
        let codes_per_dps = d.between(0.5, 50.0);
        Bench {
            seed,
            rows,
            fs_hz,
            ftw,
            bits,
            amplitude,
            in_phase: sense * angle.cos(),
            quadrature: sense * angle.sin(),
            sense_phase: d.between(-1.0, 1.0),
            codes_per_dps,
            rate_known: d.odds(0.5),
            noise: [sigma, second],
            noise_after: d.odds(0.35),
            wander: 0.0,
        }
    }

    pub fn full_scale(&self) -> f64 {
        f64::powi(2.0, self.bits as i32 - 1)
    }

    /// Turns of the oscillator at a row, with its word of 32 bits.
    pub fn turns(&self, row: usize) -> f64 {
        let steps = (u128::from(self.ftw) * row as u128) & 0xffff_ffff;
        steps as f64 / 4_294_967_296.0
    }

    /// Both ideal signals at a phase in turns.
    pub fn ideal(&self, turns: f64) -> [f64; 2] {
        let drive = self.amplitude * (TAU * turns - TAU / 4.0).sin();
        let sense = TAU * turns + self.sense_phase;
        [
            drive,
            self.in_phase * sense.sin() + self.quadrature * sense.cos(),
        ]
    }

    /// Signals with faults, no noise, no rounding.
    pub fn signals(&self, faults: &Faults) -> [Vec<f64>; 2] {
        let mut out = [Vec::with_capacity(self.rows), Vec::with_capacity(self.rows)];
        for row in 0..self.rows {
            let [drive, sense] = faults.signal(self, row);
            out[0].push(drive);
            out[1].push(sense);
        }
        out
    }

    /// Variance of code noise about the signal: noise and rounding.
    pub fn variance(&self, channel: usize) -> f64 {
        self.noise[channel].powi(2) + 1.0 / 12.0
    }

    /// The codes.
    pub fn codes(&self, faults: &Faults) -> Made {
        let mut d = Dice::new(self.seed ^ 0xabcd_ef01);
        let signals = self.signals(faults);
        let wander = [self.wandering(&mut d), self.wandering(&mut d)];
        let angle = TAU * self.ftw as f64 / 4_294_967_296.0;
        let full = self.full_scale();
        let mut codes = [Vec::with_capacity(self.rows), Vec::with_capacity(self.rows)];
        let pairs: Vec<[f64; 2]> = signals[0]
            .iter()
            .zip(&signals[1])
            .map(|(a, b)| [*a, *b])
            .collect();
        for (row, pair) in pairs.iter().enumerate().take(self.rows) {
            let common = d.gauss();
            let mut noise = [d.gauss() * self.noise[0], d.gauss() * self.noise[1]];
            for channel in 0..2 {
                let mut x = pair[channel];
                let jitter = faults.jitter();
                if jitter > 0.0 {
                    let late = jitter
                        * if faults.is_common() {
                            common
                        } else {
                            d.gauss()
                        };
                    x = faults.signal_late(self, row, late / (angle / TAU))[channel];
                }
                x *= 1.0 + wander[channel].get(row).copied().unwrap_or(0.0);
                if channel == 1 {
                    noise[1] += faults.noise_coupling() * noise[0];
                }
                let code = if self.noise_after {
                    faults.convert(channel, x, full) + noise[channel].round() as i64
                } else {
                    faults.convert(channel, x + noise[channel], full)
                };
                codes[channel].push(code.clamp(-(full as i64), full as i64 - 1) as i32);
            }
        }
        Made { codes }
    }

    /// 1/f noise by sums of first-order processes an octave apart.
    fn wandering(&self, d: &mut Dice) -> Vec<f64> {
        if self.wander == 0.0 {
            return Vec::new();
        }
        let octaves = (self.rows as f64).log2() as usize + 2;
        let mut states: Vec<f64> = (0..octaves).map(|_| d.gauss()).collect();
        let scale = self.wander / (octaves as f64).sqrt();
        (0..self.rows)
            .map(|_| {
                let mut sum = 0.0;
                for (k, s) in states.iter_mut().enumerate() {
                    let keep = (-1.0 / f64::powi(2.0, k as i32 + 1)).exp();
                    *s = keep * *s + (1.0 - keep * keep).sqrt() * d.gauss();
                    sum += *s;
                }
                scale * sum
            })
            .collect()
    }

    /// What a matched filter sees of the faults: standard deviations, after what is free (the sense
    /// tone; its quadrature alone where the rate is known) is taken off.
    pub fn visible(&self, faults: &Faults) -> f64 {
        if let Some(jitter) = faults.only_jitter() {
            return self.visible_jitter(jitter);
        }
        let (with, without) = (self.signals(faults), self.signals(&Faults::none()));
        let full = self.full_scale();
        let mut chi = [0.0f64; 2];
        for channel in 0..2 {
            let bend = |x: &f64| faults.bend(channel, *x, full);
            let pairs = with[channel].iter().zip(&without[channel]);
            let change: Vec<f64> = pairs.clone().map(|(a, b)| bend(a) - b).collect();
            let free = self.free(channel, faults.is_bend_alone());
            chi[0] += rest(&change, &free) / self.variance(channel);
            if self.noise_after {
                // Noise added to the rounded code does not dither: where no code changes nothing is seen.
                let code = |x: f64| (x + 0.5).floor();
                let change: Vec<f64> = pairs.map(|(a, b)| code(bend(a)) - code(*b)).collect();
                chi[1] += rest(&change, &free) / self.variance(channel);
            } else if let Some(levels) = faults.levels() {
                // A limit between two codes changes the codes beyond it alone.
                let of = |x: &f64| self.codes_lost(channel, *x, levels.map(|l| l * full));
                let change: Vec<f64> = without[channel].iter().map(of).collect();
                chi[1] += rest(&change, &free) / self.variance(channel);
            } else {
                chi[1] = f64::INFINITY;
            }
        }
        chi[0].min(chi[1]).sqrt()
    }

    /// What limits, low and high, change of the mean code of a signal with noise before rounding.
    fn codes_lost(&self, channel: usize, x: f64, [low, high]: [f64; 2]) -> f64 {
        let noise = self.noise[channel];
        // Mean number of codes beyond one that is the last.
        let beyond = |inside: f64| -> f64 {
            let steps = (0..).map(|k| (inside + 0.5 + f64::from(k)) / noise);
            steps.take_while(|z| *z < 6.0).map(upper_tail).sum()
        };
        let last = |level: f64| (level + 0.5).floor();
        beyond(x - last(low)) - beyond(last(high) - x)
    }

    /// What the fit of a channel is free to take, so that a fault does not show in it: of the sense channel the
    /// tone, its quadrature alone where the rate is known. Integral nonlinearity is what is left of a
    /// converter's curve after the best straight line (IEEE Std 1241): offset and gain are no part of it, and a bow
    /// that is only a constant over the codes in use is an offset.
    fn free(&self, channel: usize, is_bend: bool) -> Vec<Vec<f64>> {
        let part = |quarter: f64| -> Vec<f64> {
            let at = |r| TAU * self.turns(r) + self.sense_phase + quarter;
            (0..self.rows).map(|r| at(r).sin()).collect()
        };
        let mut free: Vec<Vec<f64>> = Vec::new();
        if channel == 1 || is_bend {
            free.push(part(TAU / 4.0));
        }
        if is_bend || channel == 1 && !self.rate_known {
            free.push(part(0.0));
        }
        if is_bend {
            free.push(vec![1.0; self.rows]);
        }
        free
    }

    fn visible_jitter(&self, jitter: f64) -> f64 {
        let mut chi = 0.0;
        for channel in 0..2 {
            let h = 1e-6;
            let slope = |row: usize| {
                let t = self.turns(row);
                (self.ideal(t + h)[channel] - self.ideal(t - h)[channel]) / (2.0 * h)
            };
            let turns_late = jitter;
            let part: Vec<f64> = (0..self.rows)
                .map(|r| (slope(r) * turns_late).powi(2))
                .collect();
            let mean = part.iter().sum::<f64>() / part.len() as f64;
            let all = self.variance(channel) + mean;
            chi += part.iter().map(|p| (p - mean).powi(2)).sum::<f64>() / (2.0 * all * all);
        }
        chi.sqrt()
    }

    /// Scales a fault so that a matched filter sees it at `z`.
    pub fn sized(&self, fault: &Fault, z: f64) -> Fault {
        let (mut low, mut high) = (-14.0f64, 3.0f64);
        for _ in 0..24 {
            let middle = 0.5 * (low + high);
            let faults = Faults::of(vec![fault.scaled(middle.exp())]);
            if self.visible(&faults) > z {
                high = middle;
            } else {
                low = middle;
            }
        }
        fault.scaled((0.5 * (low + high)).exp())
    }
}

/// Probability above z standard deviations (Abramowitz and Stegun 7.1.26, to 1e-7).
fn upper_tail(z: f64) -> f64 {
    let x = z.abs() / std::f64::consts::SQRT_2;
    let t = 1.0 / (1.0 + 0.327_591_1 * x);
    let series = [
        0.254_829_592,
        -0.284_496_736,
        1.421_413_741,
        -1.453_152_027,
        1.061_405_429,
    ];
    let sum = series.iter().rev().fold(0.0, |sum, c| (sum + c) * t);
    let tail = 0.5 * sum * (-x * x).exp();
    if z < 0.0 { 1.0 - tail } else { tail }
}

/// Sum of squares after a least squares fit of one or two columns.
fn rest(y: &[f64], columns: &[Vec<f64>]) -> f64 {
    let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
    let mut y = y.to_vec();
    let mut done: Vec<Vec<f64>> = Vec::new();
    for column in columns {
        let mut c = column.clone();
        for d in &done {
            let f = dot(&c, d) / dot(d, d);
            c.iter_mut().zip(d).for_each(|(c, d)| *c -= f * d);
        }
        let f = dot(&y, &c) / dot(&c, &c);
        y.iter_mut().zip(&c).for_each(|(y, c)| *y -= f * c);
        done.push(c);
    }
    dot(&y, &y)
}
