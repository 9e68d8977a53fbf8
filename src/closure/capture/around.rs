//! What is around a model: residuals of a fit with every freedom, the noise they show, lines in them.

use super::candidates::{Known, base_ridge};
use super::columns::{
    ALL, COS, HARMONICS, LINES, Model, ONE, Rows, SIN, TRUNCATED, chunks, harmonic, line,
};
use super::fit::LEAST_VARIANCE;
use super::gram::{Combo, Detail, Gram, Solved, solve};
use super::input::{Capture, Part};
use super::quantiser::{LEAST_LINE_CODES, is_undithered};
use super::spectrum::{self, Spectrum};
use super::wander::{self, Series};
use super::{mains, nonlinearity};

/// Residuals at coefficients, 0 where limited; of all rows, or of the training rows alone.
pub fn residuals(
    capture: &Capture,
    model: &Model,
    coefficients: &[Vec<f64>; 2],
    all: bool,
) -> [Vec<f64>; 2] {
    let n = capture.rows();
    let mut out = [vec![0.0; n], vec![0.0; n]];
    let mut rows = Rows::new();
    let wanted = |p: Part| all || p != Part::HeldOut;
    for segment in capture.segments.iter().filter(|s| wanted(s.part)) {
        for chunk in chunks(segment.rows.clone()) {
            let start = chunk.start;
            let count = chunk.len();
            rows.fill(capture, model, chunk);
            for (channel, out) in out.iter_mut().enumerate() {
                for (i, out) in out.iter_mut().skip(start).take(count).enumerate() {
                    if rows.weight[channel][i] > 0.0 {
                        let value = rows.value(channel, i, &coefficients[channel]);
                        *out = rows.target[channel][i] - value;
                    }
                }
            }
        }
    }
    out
}

/// Coefficients by channel and column out of combos.
pub fn spread(combos: &[&Combo], solved: &Solved) -> [Vec<f64>; 2] {
    let mut out = [vec![0.0; ALL], vec![0.0; ALL]];
    for (combo, value) in combos.iter().zip(&solved.coefficients) {
        for (channel, column, factor) in &combo.parts {
            if let Some(v) = out[*channel].get_mut(*column) {
                *v += factor * value;
            }
        }
    }
    out
}

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
    /// Residuals of all rows.
    pub residuals: [Vec<f64>; 2],
    /// The same, 0 at held-out rows.
    pub training: [Vec<f64>; 2],
    /// Sine and cosine of both tones as they are in the codes.
    pub free: [[f64; 2]; 2],
    /// White variances of both channels, from the spectrum.
    pub noise: [f64; 2],
}

pub fn around(capture: &Capture, model: &mut Model, base: &[Combo], neutral: bool) -> Around {
    let gram = Gram::of(capture, model);
    let combos = generous(base, model);
    let combos: Vec<&Combo> = combos.iter().collect();
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
    let spectrum = spectrum_of(capture, &training);
    let noise = [0, 1].map(|c: usize| spectrum.variance(c).max(LEAST_VARIANCE));
    Around {
        residuals,
        training,
        free,
        noise,
    }
}

pub fn spectrum_of(capture: &Capture, training: &[Vec<f64>; 2]) -> Spectrum {
    let [drive, sense] = training;
    Spectrum::of([drive, sense], capture.training_rows())
}

/// Looks for new lines; true if any was added. Besides the strongest, those are taken that are no sidelobe
/// of a stronger one.
pub fn add_lines(capture: &Capture, model: &mut Model, around: &Around) -> bool {
    let rows = capture.rows() as f64;
    let spectrum = spectrum_of(capture, &around.training);
    let [drive, sense] = &around.training;
    let before = model.lines.len();
    let mut stronger: Vec<spectrum::Line> = Vec::new();
    for line in spectrum.lines(&model.tone, 12, 3.0, [LEAST_VARIANCE; 2]) {
        if model.lines.len() >= LINES {
            break;
        }
        // A line that is known is not found again: its rest is the frequency's error.
        let known = model
            .lines
            .iter()
            .any(|t| (t - line.turns).abs() * rows < 1.0);
        let sidelobe = stronger.iter().any(|s| {
            let apart = (s.turns - line.turns) * rows;
            apart.abs() < 8.0 || line.surprise * apart * apart < 4.0 * s.surprise
        });
        let tiny = is_undithered(model, line.channel) && line.amplitude < LEAST_LINE_CODES;
        if !known && !sidelobe && !tiny {
            let turns = spectrum::refine([drive, sense], around.noise, line.turns);
            model.lines.push(turns);
            stronger.push(line);
        }
    }
    model.lines.len() > before
}

/// Adds the mains' own frequencies where they are too slow for the spectrum.
pub fn add_slow_mains(
    capture: &Capture,
    known: &Known,
    model: &mut Model,
    series: &[Option<Series>; 2],
) {
    let Some(fs) = known.fs_hz else { return };
    let rows = capture.rows();
    let mut best: Option<(f64, f64)> = None;
    for hz in mains::MAINS_HZ {
        let turns = hz / fs;
        let periods = turns * rows as f64;
        let is_new = model
            .lines
            .iter()
            .all(|t| (t - turns).abs() * rows as f64 > 0.7);
        if (0.1..4.0).contains(&periods) && is_new {
            let gain = wander::slow_line_gain(series, rows, turns);
            if gain > 15.0 && best.is_none_or(|b| gain > b.0) {
                best = Some((gain, turns));
            }
        }
    }
    if let Some((_, turns)) = best
        && model.lines.len() < LINES
    {
        model.lines.push(turns);
    }
}
