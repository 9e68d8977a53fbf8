//! A search for sinusoids of its own: thousands of frequencies would drown every other candidate in
//! multiplicity, and their null distribution is known without surrogates.

use super::refine::Bench;
use super::{Model, Search};
use crate::statistics::Unusable;
use crate::statistics::candidates::{Grid, bartlett};
use crate::statistics::linear::{Basis, dot};
use crate::statistics::partial::Partial;
use crate::statistics::reml::Fit;
use crate::statistics::smooth::slope;
use crate::statistics::tail::chi_square_surprise;
use crate::statistics::whiten::Whitener;
use crate::thermal::channels::Channels;
use crate::thermal::effects::tone;
use crate::thermal::effects::tone::Pickup;
use crate::thermal::effects::{Point, map};
use std::f64::consts::TAU;
use std::sync::Arc;

/// The strongest sinusoid.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Tone {
    /// Hz.
    pub frequency_hz: f64,
    /// Chance that the strongest of all frequencies is as strong in noise.
    pub p_value: f64,
}

/// Fewest periods over the record: below them a tone is a drift.
const LEAST_PERIODS: f64 = 3.0;

/// Frequencies per independent one.
const OVERSAMPLING: f64 = 2.0;

/// Most frequencies for one of a record without gaps.
const GAPS: f64 = 3.0;

/// A noise of less posterior weight is not looked at.
const LIGHT: f64 = 0.1;

/// Frequencies that are whitened side by side.
const BATCH: usize = 16;

/// Sine and cosine of one frequency at the rows' times, turned from one frequency to the next by a constant
/// step.
struct Turning {
    pair: [Vec<f64>; 2],
    step: [Vec<f64>; 2],
}

impl Turning {
    fn new(times: &[f64], first: f64, step: f64) -> Self {
        let angles = |w: f64| {
            [
                times.iter().map(|t| (w * t).sin()).collect(),
                times.iter().map(|t| (w * t).cos()).collect(),
            ]
        };
        Turning {
            pair: angles(first),
            step: angles(step),
        }
    }

    /// The next `count` pairs, one after the other.
    fn next(&mut self, count: usize) -> Vec<Vec<f64>> {
        let mut out = Vec::with_capacity(2 * count);
        for _ in 0..count {
            out.extend(self.pair.iter().cloned());
            let [sines, cosines] = &mut self.pair;
            let steps = self.step[0].iter().zip(&self.step[1]);
            for ((s, c), (ds, dc)) in sines.iter_mut().zip(cosines).zip(steps) {
                (*s, *c) = (*s * dc + *c * ds, *c * dc - *s * ds);
            }
        }
        out
    }
}

/// Half the rate of a fit's rows, where they do not pause, in periods over the record: rows with gaps are fewer than their
/// distance says. No more than [`GAPS`] times what the rows' number says.
fn nyquist_periods(c: &Channels, fit: &Fit) -> f64 {
    let rows = 0.5 * fit.problem.y.len() as f64;
    (0.5 * c.span_s() / fit.problem.line.period_s).clamp(rows, GAPS * rows)
}

/// Scans frequencies from three periods over the record to the rows' Nyquist frequency, under the
/// likeliest noises of the grid.
pub fn strongest(c: &Channels, fit: &Fit, grid: &Grid) -> Option<Tone> {
    let rows = fit.problem.y.len();
    let times = fit.reduce(&c.time_s);
    let span = c.span_s();
    if rows < 16 || span <= 0.0 {
        return None;
    }
    let highest = nyquist_periods(c, fit);
    let count = ((highest - LEAST_PERIODS) * OVERSAMPLING) as usize;
    let frequency = |k: usize| (LEAST_PERIODS + k as f64 / OVERSAMPLING) / span;
    let mut p_value = 0.0;
    let mut best: Option<(f64, f64)> = None;
    for (shape, weight) in grid.shapes.iter().zip(&grid.weights).take(4) {
        if *weight < LIGHT {
            continue;
        }
        let whitener = Whitener::new(&fit.problem.line, *shape);
        let (mut y, declared) = fit.problem.whiten(&whitener);
        declared.project_off(&mut y);
        let contrasts = whitener.used.saturating_sub(declared.rank());
        let rss = dot(&y, &y).max(f64::MIN_POSITIVE);
        let mut greatest = 0.0f64;
        let mut turning = Turning::new(&times, TAU * frequency(0), TAU / (OVERSAMPLING * span));
        let signals = [y];
        let partial = Partial::new(&declared, &signals);
        for start in (0..count).step_by(BATCH) {
            let pairs = turning.next(BATCH.min(count - start));
            let white = whitener.apply_all(&pairs);
            let products = partial.products(&white);
            for k in 0..white.len() / 2 {
                let mut explained = [0.0];
                products.explained(2 * k..2 * k + 2, &mut explained);
                let ratio = -(-(explained[0] / rss).clamp(0.0, 1.0 - 1e-12)).ln_1p();
                let surprise = chi_square_surprise(2, bartlett(contrasts, 2) * ratio);
                if surprise > greatest {
                    greatest = surprise;
                    if best.is_none_or(|b| surprise > b.1) {
                        best = Some((frequency(start + k), surprise));
                    }
                }
            }
        }
        // Half the frequencies are independent, and a little more by the finer grid.
        let independent = 1.4 * count as f64 / OVERSAMPLING;
        let one = (-greatest).exp();
        let any = 1.0 - (independent * (-one).ln_1p()).exp();
        p_value += weight * any.max(independent * one * 0.5);
    }
    let weights: f64 = grid.weights.iter().take(4).filter(|w| **w >= LIGHT).sum();
    best.map(|(frequency_hz, _)| Tone {
        frequency_hz,
        p_value: (p_value / weights.max(f64::MIN_POSITIVE)).min(1.0),
    })
}

/// Places around a frequency at which the rows are looked at, within one over the record's length to each side.
const AROUND: i32 = 4;

/// The tone that the rows have, where the fit sees the means of blocks of rows: a faster one looks slower there. `rest`:
/// what the model leaves, deg/s, every row.
pub fn unaliased(c: &Channels, fit: &Fit, rest: &[f64], tone: Tone) -> Tone {
    let Some(blocks) = &fit.decimated else {
        return tone;
    };
    let block_hz = 1.0 / (blocks.rows as f64 * c.period_s());
    let fastest_hz = 0.5 / c.period_s();
    let near = |hz: f64| {
        (-AROUND..=AROUND).map(move |k| hz + f64::from(k) / f64::from(AROUND) / c.span_s())
    };
    let order = (blocks.rows / 2 + 1) as i32;
    let each = (-order..=order).map(|k| (tone.frequency_hz + f64::from(k) * block_hz).abs());
    let lowest_hz = LEAST_PERIODS / c.span_s();
    let within = each
        .flat_map(near)
        .filter(|hz| (lowest_hz..=fastest_hz).contains(hz));
    let with_power = within.map(|hz| (power(&c.time_s, rest, &blocks.weights, hz), hz));
    match with_power.max_by(|a, b| a.0.total_cmp(&b.0)) {
        Some((_, frequency_hz)) => Tone {
            frequency_hz,
            ..tone
        },
        None => tone,
    }
}

/// Square of a signal's product with a unit phasor, over the rows of a weight (Schuster's periodogram).
pub(super) fn power(time_s: &[f64], y: &[f64], weights: &[f64], hz: f64) -> f64 {
    let rows = time_s.iter().zip(y).zip(weights);
    let used = rows.filter(|((_, y), w)| **w > 0.0 && y.is_finite());
    let (s, c) = used.fold((0.0, 0.0), |(s, c), ((t, y), _)| {
        let (sine, cosine) = (TAU * hz * t).sin_cos();
        (s + y * sine, c + y * cosine)
    });
    s * s + c * c
}

/// Share of the square about its mean of a channel, or of its square, from which on a tone of that frequency is the
/// channel's.
const WAVING: f64 = 0.5;

/// Share of the square of what such a channel has beyond the sinusoid that its effect keeps at least (two lags far slower than it
/// leave a ninth of the third harmonic's amplitude, and of the second a quarter), and log-likelihood at which it is seen.
const SMOOTHED: f64 = 0.01;
const SEEN: f64 = 10.0;

/// Share of the square of the temperature's squared rate that a line has which is its pace.
const PACE: f64 = 0.1;

/// Rows over which the slopes of a temperature have this share of the square of those from row to row, if no rate passes
/// between its rows.
const RESOLVED_ROWS: usize = 4;
const RESOLVED: f64 = 0.9;

/// Most harmonics that are looked at, and the probability that the strongest of them is noise's up to which what repeats is
/// no sinusoid.
const HARMONICS: i32 = 9;
const OVERTONES: f64 = 1e-3;

impl Search<'_> {
    /// Whose a tone is that is no pickup: time's, where it has too few periods, or that of a channel which is a sinusoid of
    /// that frequency for the most part, or whose square is (what follows the rate late, where the rate is a sinusoid,
    /// is one as well).
    pub(super) fn another_channels(&self, frequency_hz: f64) -> Option<String> {
        let c = self.channels;
        let few = (!tone::returns(c, frequency_hz)).then(|| "time_s".to_owned());
        few.or_else(|| Some(waving(c, frequency_hz)?.name))
    }

    /// Whether a tone in a model, with nothing left beside it, is no answer to a channel that swings with it for the most part: what
    /// that channel has beyond the sinusoid, smoothed by far, would be seen.
    pub(super) fn is_apart(&self, model: &Model, own: usize) -> bool {
        let c = self.channels;
        let frequency_hz = model.terms[own].point.theta.first().copied();
        let Some(frequency_hz) = frequency_hz.filter(|hz| tone::returns(c, *hz)) else {
            return false;
        };
        let Some(wave) = waving(c, frequency_hz) else {
            return false;
        };
        let all = model.contributions(c);
        let square: f64 = self.of_used(&all[own]).iter().map(|v| v * v).sum();
        let beyond = square * (1.0 - wave.share) / wave.share * wave.kept;
        let white = model.fit.noise.white_rms_dps.max(f64::MIN_POSITIVE);
        0.5 * beyond > SEEN * white * white && self.is_clean(model)
    }

    /// Whether a shape is such a tone.
    pub(super) fn is_another_channels(&self, id: &str, point: &Point) -> bool {
        let of_tone = point.theta.first().filter(|_| id == tone::NAMED);
        of_tone.is_some_and(|hz| self.another_channels(*hz).is_some())
    }

    /// Whether what a model with a tone leaves repeats with it: a cause that comes and goes by a schedule (positions, loads) has
    /// a fundamental too.
    pub(super) fn has_overtones(&self, model: &Model, frequency_hz: f64) -> bool {
        let c = self.channels;
        let bench = Bench::new(model, model.fit.at.shape);
        let fastest_hz = nyquist_periods(c, &model.fit) / c.span_s();
        let orders = (2..=HARMONICS).map(|k| frequency_hz * f64::from(k));
        let within: Vec<f64> = orders.filter(|hz| *hz < fastest_hz).collect();
        let further = model.terms.iter().filter(|t| t.id() == tone::FURTHER);
        let mut further = further.map(|t| t.point.theta[0]);
        let is_one = |of_hz: f64| {
            within
                .iter()
                .any(|hz| (hz - of_hz).abs() < 0.5 / c.span_s())
        };
        if further.any(is_one) {
            return true;
        }
        let gains = within.iter().map(|hz| {
            let wave = |f: fn(f64) -> f64| map(&c.time_s, |t| f(TAU * hz * t));
            bench.gain(&[wave(f64::sin), wave(f64::cos)])
        });
        // Half of a chi square of two degrees of freedom.
        let due = (within.len() as f64 / OVERTONES).ln();
        gains.into_iter().any(|gain| gain > due)
    }

    /// A further tone, which has no name, has that of a first one where that is no longer in: the first may have been a
    /// mixture of this one and causes that came later.
    ///
    /// # Errors
    /// Too few rows.
    pub fn one_tone_named(&self, model: Model) -> Result<Model, Unusable> {
        let barred = &self.beginning.borrow().barred;
        let of = |id: &str| model.terms.iter().position(|t| t.id() == id);
        let (None, Some(k)) = (of(tone::NAMED), of(tone::FURTHER)) else {
            return Ok(model);
        };
        let frequency_hz = model.terms[k].point.theta[0];
        let barred = barred.iter().any(|id| id == tone::NAMED);
        if barred || self.another_channels(frequency_hz).is_some() {
            return Ok(model);
        }
        let mut terms = model.terms.clone();
        terms[k].candidate = Arc::new(Pickup {
            frequency_hz,
            further: false,
        });
        self.model(&terms)
    }
}

/// A channel that swings.
struct Wave {
    name: String,
    /// Share of its square, of the square of its square or of that of its squared rate that is the sinusoid's.
    share: f64,
    /// Share of the square of the rest that an effect of it keeps at least.
    kept: f64,
}

/// Sine and cosine of a frequency at the rows.
fn pair(c: &Channels, frequency_hz: f64) -> Vec<Vec<f64>> {
    let wave = |f: fn(f64) -> f64| map(&c.time_s, |t| f(TAU * frequency_hz * t));
    vec![wave(f64::sin), wave(f64::cos)]
}

/// Share of a column's square about its mean that is a sinusoid's.
fn share(both: &Basis, column: &[f64]) -> f64 {
    let mean = column.iter().sum::<f64>() / column.len().max(1) as f64;
    let about = map(column, |v| v - mean);
    let mut rest = about.clone();
    both.project_off(&mut rest);
    let whole = dot(&about, &about);
    if whole > 0.0 {
        1.0 - dot(&rest, &rest) / whole
    } else {
        0.0
    }
}

/// The channel that is a sinusoid of a frequency for the most part, or whose square is, more than any other; or the temperature,
/// where it changes at that pace.
fn waving(c: &Channels, frequency_hz: f64) -> Option<Wave> {
    let both = Basis::new(&[vec![vec![1.0; c.len()]], pair(c, frequency_hz)].concat());
    // What answers to both signs alike swings twice as often.
    let square = |column: &[f64]| {
        let mean = column.iter().sum::<f64>() / column.len().max(1) as f64;
        map(column, |v| (v - mean).powi(2))
    };
    let of = |name: &str, column: &[f64]| Wave {
        name: name.to_owned(),
        share: share(&both, column).max(share(&both, &square(column))),
        kept: SMOOTHED,
    };
    let names = c.columns.keys().filter(|name| *name != "time_s");
    let others = names.filter_map(|name| Some(of(name, c.moving(name)?)));
    let all = [of(&c.thermometer, &c.u)].into_iter().chain(others);
    let waves = all.filter(|wave| wave.share > WAVING);
    let pace = Wave {
        name: c.thermometer.clone(),
        share: pace(c, frequency_hz),
        // Of rates between rows the readings' slopes over rows show no more than the pace.
        kept: if is_resolved(c) {
            SMOOTHED
        } else {
            SMOOTHED.powi(2)
        },
    };
    waves
        .chain((pace.share > PACE).then_some(pace))
        .max_by(|a, b| a.share.total_cmp(&b.share))
}

/// Whether the temperature's rate does not change much from row to row: slopes over some rows have almost all of it.
fn is_resolved(c: &Channels) -> bool {
    let square = |rows: usize| {
        let slopes = slope(&c.time_s, &c.u, rows);
        dot(&slopes, &slopes)
    };
    square(RESOLVED_ROWS) > RESOLVED * square(1)
}

/// Share of the temperature's squared rate that a line at a frequency has, or next to it: that of a staircase of temperatures has
/// one at its pace.
fn pace(c: &Channels, frequency_hz: f64) -> f64 {
    let span_s = c.span_s();
    if span_s <= 0.0 {
        return 0.0;
    }
    let squared = map(&slope(&c.time_s, &c.u, 1), |v| v * v);
    let near = (-AROUND..=AROUND).map(|k| 0.5 * f64::from(k) / f64::from(AROUND) / span_s);
    let line = |by_hz: f64| {
        let both = [vec![vec![1.0; c.len()]], pair(c, frequency_hz + by_hz)].concat();
        share(&Basis::new(&both), &squared)
    };
    near.map(line).fold(0.0, f64::max)
}

#[cfg(test)]
#[path = "tones_tests.rs"]
mod tests;
