//! From outputs to the figures of a gyro's data sheet: those of the whole instrument, and what the word lengths
//! add to it (the bit-accurate circuit less its float twin on the same analogue input).

use super::measure::Output;
use super::scenario::{Plan, Role};
use crate::design::LimitName;
use rustfft::FftPlanner;
use rustfft::num_complex::Complex;
use serde::Serialize;

/// Figures of one design, or what its words add to them.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, schemars::JsonSchema)]
pub struct Figures {
    /// Mean output at rest over the thermal run, deg/s, with its sign.
    pub bias_dps: f64,
    /// Largest less smallest mean output at rest over the thermal run, deg/s.
    pub drift_dps: f64,
    /// One-sided density of the output at rest up to [`NOISE_BAND_HZ`], deg/s/sqrt(Hz).
    pub noise_dps_rthz: f64,
    /// Angle random walk, deg/sqrt(h): 60 / sqrt(2) times the one-sided density.
    pub arw_deg_rth: f64,
    /// Of a word length: the largest error of the scale factor over temperature and rates. Of the instrument: its change. ppm.
    pub scale_factor_ppm: f64,
    /// Amplitude of the largest line that stands out of the noise, deg/s; 0 if none does.
    pub spur_dps: f64,
    /// Its frequency at the output, Hz.
    pub spur_hz: f64,
    /// It is in the run with the detuned oscillator.
    pub spur_detuned: bool,
    /// A smaller line would not have been told from the noise, deg/s.
    pub spur_floor_dps: f64,
}

impl Figures {
    /// A figure that can be limited, with its sign; `None` of what is none of these.
    pub fn of(&self, name: LimitName) -> Option<f64> {
        match name {
            LimitName::Bias => Some(self.bias_dps),
            LimitName::Drift => Some(self.drift_dps),
            LimitName::Noise => Some(self.noise_dps_rthz),
            LimitName::Arw => Some(self.arw_deg_rth),
            LimitName::ScaleFactor => Some(self.scale_factor_ppm),
            LimitName::Spur => Some(self.spur_dps),
            LimitName::Bandwidth | LimitName::RomBytes | LimitName::CyclesPerRow => None,
        }
    }
}

/// The density is that up to here, Hz.
pub const NOISE_BAND_HZ: f64 = 100.0;

/// Chance that noise alone is taken for a line anywhere in a plan.
const FALSE_LINE: f64 = 0.01;

/// deg/sqrt(h) for a one-sided density in deg/s/sqrt(Hz): 60 s^(1/2)/h^(1/2) of the two-sided one.
pub fn arw_deg_rth(noise_dps_rthz: f64) -> f64 {
    60.0 / 2f64.sqrt() * noise_dps_rthz
}

/// What words add: a design's output less its twin's.
pub fn added(plan: &Plan, fixed: &Output, twin: &Output) -> Figures {
    let errors = errors(fixed, twin);
    let mut figures = of_series(plan, &errors);
    let mut worst: f64 = 0.0;
    for (error, _) in scale_errors(plan, &errors, &twin.rates_dps) {
        if error.abs() > worst.abs() {
            worst = error;
        }
    }
    figures.scale_factor_ppm = 1e6 * worst;
    figures
}

/// What words add to every row, by stretch, deg/s.
pub(super) fn errors(fixed: &Output, twin: &Output) -> Vec<Vec<f64>> {
    let differ = |(a, b): (&Vec<f64>, &Vec<f64>)| a.iter().zip(b).map(|(a, b)| a - b).collect();
    let pairs = fixed.rates_dps.iter().zip(&twin.rates_dps);
    pairs.map(differ).collect()
}

/// Those of the instrument itself.
pub fn whole(plan: &Plan, output: &Output) -> Figures {
    let mut figures = of_series(plan, &output.rates_dps);
    let scales: Vec<f64> = scale_errors(plan, &output.rates_dps, &output.rates_dps)
        .iter()
        .map(|(_, per_dps)| *per_dps)
        .collect();
    let (low, high) = ends(&scales);
    figures.scale_factor_ppm = if scales.is_empty() {
        0.0
    } else {
        1e6 * (high - low)
    };
    figures
}

fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len().max(1) as f64
}

fn ends(values: &[f64]) -> (f64, f64) {
    let low = values.iter().copied().fold(f64::INFINITY, f64::min);
    let high = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    (low, high)
}

/// By pair of turning stretches: where the first is, and the twin's difference between the two, deg/s.
pub(super) fn scale_pairs(plan: &Plan, twin: &[Vec<f64>]) -> Vec<(usize, f64)> {
    let mut out = Vec::new();
    let mut k = 0;
    while k + 1 < plan.nominal.len() {
        let Role::Rate(rate_dps) = plan.nominal[k].role else {
            k += 1;
            continue;
        };
        let truth = mean(&twin[k]) - mean(&twin[k + 1]);
        if rate_dps > 0.0 && truth != 0.0 {
            out.push((k, truth));
        }
        k += 2;
    }
    out
}

/// By pair of turning stretches: the relative error of the slope, and the twin's slope per applied deg/s.
fn scale_errors(plan: &Plan, errors: &[Vec<f64>], twin: &[Vec<f64>]) -> Vec<(f64, f64)> {
    let of = |(k, truth): (usize, f64)| {
        let across = mean(&errors[k]) - mean(&errors[k + 1]);
        let rate_dps = match plan.nominal[k].role {
            Role::Rate(rate_dps) => rate_dps,
            _ => 0.0,
        };
        (across / truth, truth / (2.0 * rate_dps))
    };
    scale_pairs(plan, twin).into_iter().map(of).collect()
}

/// The series of the stretches at rest.
fn at_rest<'s>(plan: &Plan, series: &'s [Vec<f64>]) -> Vec<&'s Vec<f64>> {
    let pairs = plan.nominal.iter().zip(series);
    let rest = pairs.filter(|(s, _)| s.role == Role::Rest);
    rest.map(|(_, v)| v).collect()
}

/// By stretch at rest: the sum of its densities up to [`NOISE_BAND_HZ`], (deg/s)^2/Hz, and of how many bins.
pub(super) fn rest_powers(plan: &Plan, series: &[Vec<f64>]) -> Vec<(f64, f64)> {
    let of = |v: &Vec<f64>| {
        let spectrum = Spectrum::new(v, plan.row_hz);
        let bins = spectrum.in_band();
        let sum: f64 = bins.iter().map(|square| square * spectrum.per_hz).sum();
        (sum, bins.len().max(1) as f64)
    };
    at_rest(plan, series).into_iter().map(of).collect()
}

/// A bin stands out of noise of mean power P where it has more than this times P: noise does that with the
/// probability [`FALSE_LINE`] in any of the plan's bins.
pub(super) fn line_factor(series: &[Vec<f64>], plan: &Plan) -> f64 {
    let detuned = plan.detuned.is_some().then(|| series.last()).flatten();
    let looked_at = at_rest(plan, series).into_iter().chain(detuned);
    let bins: usize = looked_at
        .map(|v| v.len().div_ceil(2).saturating_sub(1))
        .sum();
    factor(bins)
}

fn factor(bins: usize) -> f64 {
    (bins.max(1) as f64 / FALSE_LINE).ln()
}

fn of_series(plan: &Plan, series: &[Vec<f64>]) -> Figures {
    let rest = at_rest(plan, series);
    let means: Vec<f64> = rest.iter().map(|v| mean(v)).collect();
    let (low, high) = ends(&means);
    let mut spectra: Vec<(Spectrum, bool)> = rest
        .iter()
        .map(|v| (Spectrum::new(v, plan.row_hz), false))
        .collect();
    if plan.detuned.is_some()
        && let Some(last) = series.last()
    {
        spectra.push((Spectrum::new(last, plan.row_hz), true));
    }
    let noise = density(&spectra);
    let mut figures = Figures {
        bias_dps: mean(&means),
        drift_dps: high - low,
        noise_dps_rthz: noise,
        arw_deg_rth: arw_deg_rth(noise),
        ..Figures::default()
    };
    spurs(&spectra, &mut figures);
    figures
}

/// Powers of the bins of a series less its mean, Hann's window.
struct Spectrum {
    /// Amplitude squared of a sine in each bin from 1 on, (deg/s)^2.
    squares: Vec<f64>,
    /// From such a square to a density, 1/Hz.
    per_hz: f64,
    bin_hz: f64,
}

impl Spectrum {
    fn new(values: &[f64], row_hz: f64) -> Self {
        let n = values.len();
        let middle = mean(values);
        let window = |k: usize| {
            let turn = std::f64::consts::TAU * (k as f64 + 0.5) / n as f64;
            0.5 - 0.5 * turn.cos()
        };
        let (mut sum, mut square) = (0.0, 0.0);
        let mut buffer: Vec<Complex<f64>> = Vec::with_capacity(n);
        for (k, v) in values.iter().enumerate() {
            let w = window(k);
            sum += w;
            square += w * w;
            buffer.push(Complex::new((v - middle) * w, 0.0));
        }
        if n > 0 {
            FftPlanner::new().plan_fft_forward(n).process(&mut buffer);
        }
        let amplitude = 4.0 / (sum * sum).max(f64::MIN_POSITIVE);
        let bins = buffer.iter().take(n.div_ceil(2)).skip(1);
        Spectrum {
            squares: bins.map(|x| x.norm_sqr() * amplitude).collect(),
            per_hz: sum * sum / (2.0 * row_hz * square.max(f64::MIN_POSITIVE)),
            bin_hz: row_hz / n.max(1) as f64,
        }
    }

    /// The bins up to [`NOISE_BAND_HZ`], four at least.
    fn in_band(&self) -> &[f64] {
        let bins = ((NOISE_BAND_HZ / self.bin_hz) as usize).max(4);
        &self.squares[..bins.min(self.squares.len())]
    }

    fn hz(&self, bin: usize) -> f64 {
        (bin + 1) as f64 * self.bin_hz
    }
}

/// Root of the mean density at rest up to [`NOISE_BAND_HZ`], of four bins at least.
fn density(spectra: &[(Spectrum, bool)]) -> f64 {
    let (mut sum, mut count) = (0.0, 0.0);
    for (s, _) in spectra.iter().filter(|(_, detuned)| !detuned) {
        for square in s.in_band() {
            sum += square * s.per_hz;
            count += 1.0;
        }
    }
    if count > 0.0 {
        f64::sqrt(sum / count)
    } else {
        0.0
    }
}

/// The largest line: a bin's power that noise of the mean power of its stretch would reach with little chance.
fn spurs(spectra: &[(Spectrum, bool)], figures: &mut Figures) {
    let bins: usize = spectra.iter().map(|(s, _)| s.squares.len()).sum();
    let factor = factor(bins);
    for (s, detuned) in spectra {
        let total: f64 = s.squares.iter().sum();
        for (k, square) in s.squares.iter().enumerate() {
            // Hann's window puts a line into three bins.
            let near = s
                .squares
                .get(k.saturating_sub(1)..(k + 2).min(s.squares.len()));
            let own: f64 = near.unwrap_or_default().iter().sum();
            let others = s.squares.len().saturating_sub(3).max(1) as f64;
            let floor = (total - own).max(0.0) / others;
            let amplitude = (square - floor).max(0.0).sqrt();
            if *square > factor * floor && amplitude > figures.spur_dps {
                figures.spur_dps = amplitude;
                figures.spur_hz = s.hz(k);
                figures.spur_detuned = *detuned;
            }
        }
        let mean = total / s.squares.len().max(1) as f64;
        figures.spur_floor_dps = figures.spur_floor_dps.max((factor * mean).sqrt());
    }
}
