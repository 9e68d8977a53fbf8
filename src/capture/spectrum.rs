//! The residual's spectrum: the noise's level, and lines that stand out of what is around them.

use super::tone::Tone;
use crate::statistics::normal;
use rustfft::FftPlanner;
use rustfft::num_complex::Complex;

/// Resolutions around a line that was taken off within which little of the noise is left.
const TAKEN_OFF: f64 = 1.2;

/// Periodograms of both channels.
pub struct Spectrum {
    /// |sum of residual e^(-i w t)|^2 / rows, by channel and bin: the mean is the variance.
    power: [Vec<f64>; 2],
    /// Bins of a whole turn.
    bins: usize,
    /// Rows that were summed.
    rows: f64,
}

/// A line.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Line {
    /// Turns a sample.
    pub turns: f64,
    /// Minus the logarithm of the probability that noise makes it at this place.
    pub surprise: f64,
    /// Channel in which it is stronger.
    pub channel: usize,
    /// Amplitude in each channel as far as it stands out of the noise around it, codes.
    pub amplitudes: [f64; 2],
}

impl Spectrum {
    /// Of residuals that are zero where rows are left out; `rows` are those that are not.
    pub fn of(residuals: [&[f64]; 2], rows: usize) -> Spectrum {
        let [drive, sense] = residuals;
        let bins = drive.len().next_power_of_two().max(2);
        let mut buffer: Vec<Complex<f64>> = Vec::with_capacity(bins);
        buffer.extend(drive.iter().zip(sense).map(|(d, s)| Complex::new(*d, *s)));
        buffer.resize(bins, Complex::new(0.0, 0.0));
        FftPlanner::new()
            .plan_fft_forward(bins)
            .process(&mut buffer);
        let rows = rows.max(1) as f64;
        let mut power = [
            Vec::with_capacity(bins / 2 + 1),
            Vec::with_capacity(bins / 2 + 1),
        ];
        for k in 0..=bins / 2 {
            // Two real sequences in one transform.
            let (Some(a), Some(b)) = (buffer.get(k), buffer.get((bins - k) % bins)) else {
                break;
            };
            power[0].push((a + b.conj()).norm_sqr() / (4.0 * rows));
            power[1].push((a - b.conj()).norm_sqr() / (4.0 * rows));
        }
        Spectrum { power, bins, rows }
    }

    /// The white noise's variance in a channel: the median bin over that of an exponential distribution.
    pub fn variance(&self, channel: usize) -> f64 {
        let mut sorted: Vec<f64> = self.power[channel].iter().skip(1).copied().collect();
        normal::median(&mut sorted).unwrap_or(0.0) / std::f64::consts::LN_2
    }

    /// The noise around each bin: medians of blocks that widen with the distance from zero frequency and from
    /// the tone, where noise of the amplitude piles up. Bins `aside` (frequencies, turns a sample) are none of the noise:
    /// there lines were taken off.
    fn floor(&self, channel: usize, tone: &Tone, least: f64, aside: &[f64]) -> Vec<f64> {
        let power = &self.power[channel];
        let n = power.len();
        let all = self.variance(channel).max(least);
        let centre = (tone.folded() * self.bins as f64).round() as usize;
        let mut out = vec![all; n];
        let width = TAKEN_OFF * self.bins as f64 / self.rows;
        let is_aside = |k: usize| {
            let near = |turns: &f64| (turns * self.bins as f64 - k as f64).abs() < width;
            aside.iter().any(near)
        };
        for (start, sign) in [(0usize, 1i64), (centre, 1), (centre, -1)] {
            let mut from = 1i64;
            while from < 3 * n as i64 {
                let to = (from + (from / 2).clamp(16, 256)).min(3 * n as i64);
                let index = |d: i64| {
                    usize::try_from(start as i64 + sign * d)
                        .ok()
                        .filter(|k| *k < n)
                };
                let inside = || (from..to).filter_map(index);
                let all_inside = inside().count();
                let mut block: Vec<f64> = inside()
                    .filter(|k| !is_aside(*k))
                    .filter_map(|k| power.get(k))
                    .copied()
                    .collect();
                let count = block.len();
                if all_inside == 0 {
                    break;
                }
                let middle = normal::median(&mut block).unwrap_or(0.0) / std::f64::consts::LN_2;
                // A short block is uncertain, and lines are in it.
                if all_inside >= 12 && middle > all * (1.0 + 3.0 / (count as f64).sqrt()) {
                    let centre = 0.5 * (from + to) as f64;
                    for d in from..to {
                        if let Some(v) = index(d).and_then(|k| out.get_mut(k)) {
                            let steeper = (centre / d as f64).powf(1.5).max(1.0);
                            *v = v.max(all + (middle - all) * steeper);
                        }
                    }
                }
                from = to;
            }
        }
        out
    }

    /// Surprise of what is at a frequency (turns a sample), the two nearest bins together.
    pub fn surprise_at(&self, turns: f64, tone: &Tone, least: [f64; 2]) -> f64 {
        let floors = self.floors(tone, least, &[]);
        let at = |c: usize| {
            let bin = (turns * self.bins as f64) as usize;
            let of = |k: usize| Some(self.power[c].get(k)? / floors[c].get(k)?);
            of(bin).unwrap_or(0.0).max(of(bin + 1).unwrap_or(0.0))
        };
        at(0).max(at(1))
    }

    /// The noise around a frequency (turns a sample) in a channel over the white noise, 1 or more.
    pub fn excess(&self, channel: usize, turns: f64, tone: &Tone, least: f64) -> f64 {
        let floor = self.floor(channel, tone, least, &[]);
        let bin = (super::tone::fold(turns) * self.bins as f64).round() as usize;
        let here = floor.get(bin.min(floor.len().saturating_sub(1)));
        here.copied().unwrap_or(least) / self.variance(channel).max(least)
    }

    /// The amplitude that a line at a bin has beyond three deviations of the noise, codes.
    fn amplitude(&self, channel: usize, bin: usize, floor: &[f64]) -> f64 {
        let of = |power: Option<&f64>| 2.0 * (power.copied().unwrap_or(0.0) / self.rows).sqrt();
        (of(self.power[channel].get(bin)) - 3.0 * of(floor.get(bin))).max(0.0)
    }

    /// The largest amplitude at any bin below a frequency (turns a sample), codes.
    pub fn largest_below(&self, turns: f64) -> [f64; 2] {
        let bins = (turns * self.bins as f64) as usize;
        [0, 1].map(|c: usize| {
            let below = self.power[c].iter().take(bins);
            2.0 * (below.fold(0.0, |a: f64, b| a.max(*b)) / self.rows).sqrt()
        })
    }

    /// Lines above their surroundings, strongest first, with less than one in a thousand by chance. Harmonics
    /// of the tone up to `harmonics`, zero frequency, and what is within `apart` resolutions of
    /// either are none.
    pub fn lines(&self, tone: &Tone, harmonics: usize, apart: f64, least: [f64; 2]) -> Vec<Line> {
        self.lines_over(&self.floors(tone, least, &[]), tone, harmonics, apart)
    }

    /// The noise around each bin of both channels, lines having been taken off at the frequencies `aside`.
    pub fn floors(&self, tone: &Tone, least: [f64; 2], aside: &[f64]) -> [Vec<f64>; 2] {
        [0, 1].map(|c: usize| self.floor(c, tone, least[c], aside))
    }

    /// The white noise at each bin of both channels.
    pub fn white(&self, least: [f64; 2]) -> [Vec<f64>; 2] {
        [0, 1].map(|c: usize| vec![self.variance(c).max(least[c]); self.power[c].len()])
    }

    /// The same lines above floors that are known.
    pub fn lines_over(
        &self,
        floors: &[Vec<f64>; 2],
        tone: &Tone,
        harmonics: usize,
        apart: f64,
    ) -> Vec<Line> {
        let stretch = self.bins as f64 / self.rows;
        let excluded: Vec<f64> = (0..=harmonics)
            .map(|k| super::tone::fold(k as f64 * tone.turns) * self.bins as f64)
            .collect();
        let score = |k: usize| -> (f64, usize) {
            let of = |c: usize| Some(self.power[c].get(k)? / floors[c].get(k)?);
            let (d, s) = (of(0).unwrap_or(0.0), of(1).unwrap_or(0.0));
            let both = d + s - (1.0 + d + s).ln();
            (both.max(d).max(s), usize::from(s > d))
        };
        let threshold = (self.bins as f64).ln() + 7.0;
        let mut found = Vec::new();
        for k in 2..self.bins / 2 {
            let here = score(k);
            let is_peak = here.0 > threshold && here.0 >= score(k - 1).0 && here.0 > score(k + 1).0;
            let away = |e: &f64| (e - k as f64).abs() > apart * stretch;
            if is_peak && excluded.iter().all(away) {
                found.push(Line {
                    turns: k as f64 / self.bins as f64,
                    surprise: here.0,
                    channel: here.1,
                    amplitudes: [0, 1].map(|c: usize| self.amplitude(c, k, &floors[c])),
                });
            }
        }
        found.sort_by(|a, b| b.surprise.total_cmp(&a.surprise));
        found
    }
}

/// |sum of residual e^(-i w t)|^2 at a frequency, turns a sample.
pub fn power(residual: &[f64], turns: f64) -> f64 {
    let step = Complex::from_polar(1.0, -std::f64::consts::TAU * turns);
    let mut sum = Complex::new(0.0, 0.0);
    for (block, rows) in residual.chunks(512).enumerate() {
        let angle = -std::f64::consts::TAU * (turns * (block * 512) as f64).fract();
        let mut turn = Complex::from_polar(1.0, angle);
        for r in rows {
            sum += turn * *r;
            turn *= step;
        }
    }
    sum.norm_sqr()
}

/// The frequency near `turns` at which both residuals together have most power (weights one over their
/// variances), by parabolas on the exact sums.
pub fn refine(residuals: [&[f64]; 2], variances: [f64; 2], turns: f64) -> f64 {
    let n = residuals[0].len().max(1);
    let power = |turns: f64| -> f64 {
        let each = residuals.iter().zip(variances);
        each.map(|(r, v)| power(r, turns) / v).sum()
    };
    let mut centre = turns;
    let mut width = 0.5 / n as f64;
    for _ in 0..9 {
        let (a, b, c) = (power(centre - width), power(centre), power(centre + width));
        if b >= a && b >= c {
            let bend = a - 2.0 * b + c;
            if bend < 0.0 {
                centre += 0.5 * width * (a - c) / bend;
            }
            width *= 0.3;
        } else {
            centre += if a > c { -width } else { width };
        }
    }
    centre
}
