//! What is known of a capture around a model, whatever effects it has: a fit with every freedom that goes with
//! the phase or the code, its residuals and their noise, the tones as they are; and the lines in these residuals.

use super::candidates::{Known, base_ridge};
use super::columns::{COS, HARMONICS, LINES, Model, ONE, SIN, TRUNCATED, harmonic, line};
use super::errors::residuals;
use super::gram::{Combo, Detail, Gram, Summed, solve, spread};
use super::input::{Capture, Part};
use super::spectrum::{self, Spectrum};
use super::wander::{self, Series};
use super::{mains, nonlinearity};
use crate::statistics::tail::chi_square_surprise;

/// Least variance of a channel's noise, codes squared: nearly that of an ideal quantiser's error, whose
/// pattern is not white without noise.
pub const LEAST_VARIANCE: f64 = 0.07;

/// A generous description of all that goes with the phase, and of the lines known so far; tables of both
/// channels come last, [`TABLES`] columns.
pub fn generous(base: &[Combo], model: &Model) -> Vec<Combo> {
    let mut out = base.to_vec();
    for channel in 0..2 {
        let mut one = |k: usize| out.push(Combo::one("", channel, k));
        [ONE, SIN, COS].into_iter().for_each(&mut one);
        for k in 2..=HARMONICS {
            let (sin, cos) = harmonic(k);
            one(sin);
            one(cos);
        }
        for i in 0..model.lines.len() {
            let (sin, cos) = line(i);
            one(sin);
            one(cos);
        }
        if model.truncation.is_some() {
            one(TRUNCATED);
            one(TRUNCATED + 1);
        }
    }
    for channel in 0..2 {
        out.extend(nonlinearity::table(model, 4, &[channel]));
    }
    out
}

/// Columns of the tables in a generous description.
pub const TABLES: usize = 66;

/// What is known of the noise and of the tones, around a model.
pub struct Around {
    /// Of the generous fit, all rows.
    pub residuals: [Vec<f64>; 2],
    /// The same, 0 in held-out rows.
    pub training: [Vec<f64>; 2],
    /// Sine and cosine of both tones as they are in the codes.
    pub free: [[f64; 2]; 2],
    /// Variances of both channels' white noise, codes squared.
    pub noise: [f64; 2],
    /// Sine and cosine of each line in both channels, codes.
    pub lines: [Vec<[f64; 2]>; 2],
}

impl Around {
    /// Of the training rows' residuals.
    pub fn spectrum(&self, capture: &Capture) -> Spectrum {
        let [drive, sense] = &self.training;
        Spectrum::of([drive, sense], capture.training_rows())
    }
}

/// Fits the generous description; with `neutral` the quantiser's steps go to where it puts the signal.
pub fn around(capture: &Capture, model: &mut Model, base: &[Combo], neutral: bool) -> Around {
    let combos = generous(base, model);
    let combos: Vec<&Combo> = combos.iter().collect();
    let gram = Gram::over(capture, model, &Summed::of(&combos, 1));
    let mut ridge = base_ridge(base);
    ridge.resize(combos.len(), 0.0);
    let solved = solve(gram.all(), &combos, &ridge, Detail::All);
    let coefficients = spread(&combos, &solved);
    // Tables contain the tone: what it is comes from the fit without them.
    let few = combos.len().saturating_sub(TABLES);
    let (fewer, less) = (combos.get(..few), ridge.get(..few));
    let fewer = fewer.unwrap_or_default();
    let without = solve(gram.all(), fewer, less.unwrap_or_default(), Detail::All);
    let plain = spread(fewer, &without);
    let mut free = model.declared;
    for (free, coefficients) in free.iter_mut().zip(&plain) {
        for (value, column) in free.iter_mut().zip([SIN, COS]) {
            *value += coefficients.get(column).copied().unwrap_or(0.0);
        }
    }
    let lines = [0, 1].map(|c: usize| {
        let at = |k: usize| coefficients[c].get(k).copied().unwrap_or(0.0);
        let of = |(sin, cos): (usize, usize)| [at(sin), at(cos)];
        (0..model.lines.len()).map(|i| of(line(i))).collect()
    });
    let residuals = residuals(capture, model, &coefficients, true);
    if neutral {
        // Without the tables, unless they are needed: where the codes are is then known better.
        let needed = solved.gain - without.gain > 2.0 * TABLES as f64;
        model.neutral = if needed { coefficients } else { plain };
    }
    let mut training = residuals.clone();
    for segment in capture.segments.iter().filter(|s| s.part == Part::HeldOut) {
        for channel in &mut training {
            if let Some(rows) = channel.get_mut(segment.rows.clone()) {
                rows.fill(0.0);
            }
        }
    }
    let mut seen = Around {
        residuals,
        training,
        free,
        noise: [0.0; 2],
        lines,
    };
    let spectrum = seen.spectrum(capture);
    seen.noise = [0, 1].map(|c: usize| spectrum.variance(c).max(LEAST_VARIANCE));
    seen
}

/// The lines, without the slow ones that a wander makes as well as the others do.
pub fn without_wander(
    model: &Model,
    around: &Around,
    lines: Vec<spectrum::Line>,
) -> Vec<spectrum::Line> {
    let rows = around.residuals[0].len();
    let series = block_series(model, around);
    let slowest = slowest(&series);
    let is_slow = |line: &&spectrum::Line| line.turns * (rows as f64) < slowest;
    // Together, or each would be part of the wander that the others are looked for in; not more than can be solved.
    let slow: Vec<f64> = lines
        .iter()
        .filter(is_slow)
        .map(|l| l.turns)
        .take(LINES)
        .collect();
    if slow.is_empty() {
        return lines;
    }
    let all = wander::slow_line_gain(&series, rows, &slow);
    let stands_out = |line: &spectrum::Line| {
        let others: Vec<f64> = slow.iter().copied().filter(|t| *t != line.turns).collect();
        let gain = match others.is_empty() {
            true => all,
            false => all - wander::slow_line_gain(&series, rows, &others),
        };
        let places = (2.0 * slowest).max(1.0).ln();
        others.len() < slow.len() && chi_square_surprise(4, 2.0 * gain) > 1000f64.ln() + places
    };
    let is_kept = |line: &spectrum::Line| !is_slow(&line) || stands_out(line);
    lines.into_iter().filter(is_kept).collect()
}

/// Constant and tone of what is left, block by block.
pub fn block_series(model: &Model, around: &Around) -> [Option<Series>; 2] {
    [0, 1].map(|c: usize| {
        let residual = around.residuals.get(c)?;
        wander::series(residual, around.noise[c], &model.tone, &model.phases)
    })
}

/// Periods in the record up to which a line is slow, by blocks of the series.
fn slowest(series: &[Option<Series>; 2]) -> f64 {
    let blocks = series.iter().flatten().map(|s| s.values[0].len()).max();
    SLOW_PERIODS_OF_A_BLOCK * blocks.unwrap_or(0) as f64
}

/// Periods a block of the series up to which a line is slow: the spectrum's floor there is made of its own skirts, and
/// the blocks' means leave four fifths of it.
const SLOW_PERIODS_OF_A_BLOCK: f64 = 0.375;

/// Multiples of the mains that are looked for together where they are slow: the mains alone or with the strongest
/// overtones of a power line, or one of these alone, so that a line at 100 Hz does not come with one at 50 Hz. An overtone
/// that is left is as steep a wander as there is.
const SLOW_MULTIPLES: [&[f64]; 6] = [
    &[1.0],
    &[2.0],
    &[3.0],
    &[1.0, 2.0],
    &[1.0, 3.0],
    &[1.0, 3.0, 5.0],
];

/// Sine and cosine in both channels of some lines, of several sets of them: less than one in a thousand by chance.
fn surplus(lines: usize, gain: f64) -> f64 {
    let sets = (mains::MAINS_HZ.len() * SLOW_MULTIPLES.len()) as f64;
    chi_square_surprise(4 * lines, 2.0 * gain) - 1000f64.ln() - sets.ln()
}

/// Adds the mains' own frequencies where they are too slow for the spectrum; true if any was added.
pub fn add_slow_mains(
    capture: &Capture,
    known: &Known,
    model: &mut Model,
    series: &[Option<Series>; 2],
) -> bool {
    let Some(fs) = known.fs_hz else { return false };
    let rows = capture.rows();
    let slowest = slowest(series);
    let mut best: Option<(f64, Vec<f64>)> = None;
    for hz in mains::MAINS_HZ {
        for multiples in SLOW_MULTIPLES {
            let turns: Vec<f64> = multiples.iter().map(|k| k * hz / fs).collect();
            let is_slow = |t: &f64| (0.1..slowest).contains(&(t * rows as f64));
            let is_new = |t: &f64| {
                let apart = |line: &f64| (line - t).abs() * rows as f64 > 0.7;
                model.lines.iter().all(apart)
            };
            if !turns.iter().all(|t| is_slow(t) && is_new(t)) {
                continue;
            }
            let gain = wander::slow_line_gain(series, rows, &turns);
            let surplus = surplus(turns.len(), gain);
            if surplus > 0.0 && best.as_ref().is_none_or(|b| surplus > b.0) {
                best = Some((surplus, turns));
            }
        }
    }
    let Some((_, turns)) = best else { return false };
    let room = LINES.saturating_sub(model.lines.len());
    model.lines.extend(turns.iter().take(room));
    room > 0
}
