//! What is known of a capture around a model, whatever effects it has: a fit with every freedom that goes with
//! the phase or the code, its residuals and their noise, the tones as they are; and the lines in these residuals.

use super::candidates::{Known, base_ridge};
use super::columns::{COS, HARMONICS, LINES, Model, ONE, SIN, TRUNCATED, harmonic, line};
use super::errors::residuals;
use super::gram::{Combo, Detail, Gram, Summed, solve, spread};
use super::input::{Capture, Part};
use super::spectrum::{self, Spectrum};
use super::wander::{self, Series};
use super::{harmonics, mains, nonlinearity, rounding, spur, steps};
use crate::closure::likelihood::tail::chi_square_surprise;

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

/// Looks for new lines; true if any was added. Besides the strongest, those are taken that are no sidelobe
/// of a stronger one; where the quantiser's steps show, those only that are none of its own, unless they are the mains'.
/// Where a harmonic stands out at a place that no truncation has, the tone is bent, and all its harmonics are the bend's.
pub fn add_lines(capture: &Capture, known: &Known, model: &mut Model, around: &Around) -> bool {
    let rows = capture.rows() as f64;
    let spectrum = around.spectrum(capture);
    let [drive, sense] = &around.training;
    let before = model.lines.len();
    let tones = around.free.map(|[sin, cos]| sin.hypot(cos));
    let sharp = steps::is_sharp(&model.neutral, model);
    let resolution = 1.0 / rows;
    let is_rounding = |line: &spectrum::Line| {
        sharp
            && !mains::is_mains(known, line.turns, 0.5 * resolution)
            && rounding::explains(&model.tone, tones, line.turns, resolution, line.amplitudes)
    };
    let lines = spectrum.lines(&model.tone, 12, 3.0, [LEAST_VARIANCE; 2]);
    let lines = without_wander(model, around, lines);
    let refined =
        |line: &spectrum::Line| spectrum::refine([drive, sense], around.noise, line.turns);
    // A bin tells the frequency to half a resolution, its surroundings to a tenth of one where it stands out at all.
    let order = |turns: f64, within: f64| {
        let is_mains = mains::is_mains(known, turns, 0.5 * resolution);
        harmonics::order(&model.tone, turns, within * resolution).filter(|_| !is_mains)
    };
    let is_low = |order: Option<usize>| order.is_some_and(|k| k <= harmonics::TELLING);
    let is_told =
        |turns: f64| is_low(order(turns, 0.3)) && !spur::is_place(&model.tone, turns, resolution);
    let mut low = lines.iter().filter(|line| is_low(order(line.turns, 0.7)));
    let telling = low.find(|line| is_told(refined(line)) && !is_rounding(line));
    // Harmonics fall with their order: a line of a high one that is stronger than what tells is not of them.
    let is_own = |line: &spectrum::Line| {
        let order = order(line.turns, 0.7);
        telling.is_some_and(|t| is_low(order) || order.is_some() && line.surprise < t.surprise)
    };
    let mut stronger: Vec<spectrum::Line> = Vec::new();
    for line in lines.iter().copied() {
        if model.lines.len() >= LINES {
            break;
        }
        // A line that is known is not found again: its rest is the frequency's error.
        let is_known = model
            .lines
            .iter()
            .any(|t| (t - line.turns).abs() * rows < 1.0);
        let sidelobe = stronger.iter().any(|s| {
            let apart = (s.turns - line.turns) * rows;
            apart.abs() < 8.0 || line.surprise * apart * apart < 4.0 * s.surprise
        });
        if is_known || sidelobe {
            continue;
        }
        if is_own(&line) {
            // What is beside it may be its sidelobe.
            stronger.push(line);
        } else if !is_rounding(&line) {
            model.lines.push(refined(&line));
            stronger.push(line);
        }
    }
    model.lines.len() > before
}

/// The lines, without the slow ones that a wander makes as well as the others do.
fn without_wander(
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
