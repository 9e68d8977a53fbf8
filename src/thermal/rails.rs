//! Rails: levels at which the output stands still.
//!
//! A converter or an output word that clips gives one and the same reading for whatever lies beyond, noise included.
//! Readings of a noisy output that agree to the last digit at an end of its range show that directly: no model is
//! asked. A clip before the noise (an amplifier's) leaves no such mark; it is a candidate like all others.

use super::channels::Channels;
use crate::statistics::stats;

/// Fewest readings at a rail where no other reading (but the opposite rail's) comes twice, and how many more for each
/// time that one does.
const FEWEST: usize = 3;
const OFTENER: usize = 4;

/// Share of the rows that may lie beyond a rail: what was added to the output later.
const BEYOND: f64 = 0.02;

/// Readings within a rail that tell how many would agree with it by chance.
const NEIGHBOURS: usize = 20;

/// Two readings that differ by less than this share of the range are one.
const SAME: f64 = 1e-9;

/// Noise that comes between two clips keeps half of the clipped readings off the rail: those within so many deviations of
/// it are clipped too if they are so many times as many as those in a band as wide next to them.
const NEAR: f64 = 3.5;
const PILED: usize = 4;

/// So are those that near to it that have a row that stands at it within so many rows before them, and after them: of a
/// stretch that is clipped one row in two stands, and the bias that the output rises with may go anywhere there.
const BESIDE: usize = 6;

/// Share of the range that such noise may be.
const SMALL: f64 = 0.05;

/// Steps beyond a rail within which an output in steps has no readings.
const JUST_BEYOND: f64 = 10.0;

/// Probability of as many equal readings by chance up to which they are a rail.
const LEVEL: f64 = 1e-4;

/// The rails of a record.
#[derive(Debug, Clone, PartialEq)]
pub struct Rails {
    /// deg/s.
    pub upper_dps: Option<f64>,
    /// deg/s.
    pub lower_dps: Option<f64>,
    /// Rows that stand at one, or are held at one but for noise that came after the clip: they pile up there, or between rows that
    /// stand, or the applied rate is far beyond it.
    pub rows: Vec<bool>,
    /// Probability that chance makes so many readings agree at the less certain of them.
    pub p_value: f64,
    /// Least distance of two readings, deg/s: what a level is known to.
    pub resolution_dps: f64,
}

impl Rails {
    /// Whether a clip that adds so much, deg/s, is at a rail.
    pub fn is_at(&self, by_dps: f64) -> bool {
        by_dps < 0.0 && self.upper_dps.is_some() || by_dps > 0.0 && self.lower_dps.is_some()
    }
}

/// A reading and how many rows have it.
type Reading = (f64, usize);

/// The rails that given rows show; `None`: none.
pub fn of(c: &Channels, rows: &[bool]) -> Option<Rails> {
    let output = c.output_dps();
    let pairs = output.iter().zip(rows);
    let mut sorted: Vec<f64> = pairs.filter(|(_, row)| **row).map(|(v, _)| *v).collect();
    sorted.retain(|v| v.is_finite());
    sorted.sort_by(f64::total_cmp);
    let same = SAME * (sorted.last()? - sorted.first()?);
    let mut readings: Vec<Reading> = Vec::new();
    for v in sorted {
        match readings.last_mut() {
            Some((last, count)) if v - *last <= same => *count += 1,
            _ => readings.push((v, 1)),
        }
    }
    let gaps: Vec<f64> = readings.windows(2).map(|w| w[1].0 - w[0].0).collect();
    let resolution = gaps.iter().copied().reduce(f64::min)?;
    let steps = in_steps(&gaps, resolution);
    let lower = rail(&readings, resolution, steps);
    readings.reverse();
    let upper = rail(&readings, resolution, steps);
    let p_value = [lower, upper]
        .iter()
        .flatten()
        .map(|r| r.1)
        .reduce(f64::max)?;
    let level = |rail: Option<(f64, f64)>| rail.map(|r| r.0);
    let (upper_dps, lower_dps) = (level(upper), level(lower));
    if let (Some(upper), Some(lower)) = (upper_dps, lower_dps)
        && upper <= lower
    {
        return None;
    }
    let at = |level: Option<f64>, v: f64| level.is_some_and(|l| (v - l).abs() <= same);
    let stands = |v: &f64| at(upper_dps, *v) || at(lower_dps, *v);
    let stand: Vec<bool> = output.iter().map(stands).collect();
    // Readings of an output that is coarser than its noise agree wherever it rests.
    let not_at_one = |values: &[f64]| -> Vec<f64> {
        let pairs = values.iter().zip(rows).zip(&stand);
        let free = pairs.filter(|((_, row), stands)| **row && !**stands);
        free.map(|((v, _), _)| *v).collect()
    };
    let free = not_at_one(&c.error_dps);
    let coarse = steps && stats::difference_noise(&free) < resolution;
    let short = not_at_one(&output);
    // The bias may go far from row to row.
    let width = NEAR * stats::curvature_noise(&free);
    // Else the rate is not that of this output.
    let small = width <= SMALL * (readings[0].0 - readings[readings.len() - 1].0);
    let upper_pile = upper_dps.filter(|l| small && is_piled(short.iter().map(|v| l - v), width));
    let lower_pile = lower_dps.filter(|l| small && is_piled(short.iter().map(|v| v - l), width));
    let above = |level: Option<f64>, v: f64| level.is_some_and(|l| v > l - width);
    let below = |level: Option<f64>, v: f64| level.is_some_and(|l| v < l + width);
    let piled = |v: f64| above(upper_pile, v) || below(lower_pile, v);
    // What the output would be without a clip, to within how far the error goes.
    let (usual, far) = (stats::median(&free), NEAR * stats::robust_std(&free));
    let rate = c.column("rate_dps");
    let driven = |row: usize, v: f64| {
        let due = rate.map_or(0.0, |r| r[row]) + usual;
        small
            && (above(upper_dps, v) && above(upper_dps, due - far - 2.0 * width)
                || below(lower_dps, v) && below(lower_dps, due + far + 2.0 * width))
    };
    let beside = |row: usize, v: f64| {
        let before = &output[row.saturating_sub(BESIDE)..row];
        let after = &output[row + 1..(row + 1 + BESIDE).min(output.len())];
        let stands = |level: Option<f64>| {
            let stands = |rows: &[f64]| rows.iter().any(|v| at(level, *v));
            stands(before) && stands(after)
        };
        small
            && (above(upper_dps, v) && stands(upper_dps)
                || below(lower_dps, v) && stands(lower_dps))
    };
    let pairs = output.iter().zip(&stand).enumerate();
    let held = pairs
        .map(|(row, (v, stands))| *stands || piled(*v) || driven(row, *v) || beside(row, *v))
        .collect();
    (!coarse).then_some(Rails {
        upper_dps,
        lower_dps,
        rows: held,
        p_value,
        resolution_dps: resolution,
    })
}

/// Whether readings pile up so near to a rail, given how far each is short of it.
fn is_piled(short_by: impl Iterator<Item = f64>, width: f64) -> bool {
    let (mut near, mut next) = (0, 0);
    for by in short_by {
        near += usize::from((0.0..width).contains(&by));
        next += usize::from((width..2.0 * width).contains(&by));
    }
    near >= PILED * (1 + next)
}

/// Whether most readings lie whole steps apart; of continuous ones a fifth does.
fn in_steps(gaps: &[f64], step: f64) -> bool {
    let off = |gap: &f64| (gap / step - (gap / step).round()).abs();
    let whole = gaps.iter().filter(|gap| off(gap) < 0.1).count();
    2 * whole > gaps.len()
}

/// The level of a rail at the beginning of readings in order, and its probability.
fn rail(readings: &[Reading], resolution: f64, in_steps: bool) -> Option<(f64, f64)> {
    let rows: usize = readings.iter().map(|r| r.1).sum();
    let mut counts: Vec<usize> = readings.iter().map(|r| r.1).collect();
    counts.sort_unstable_by(|a, b| b.cmp(a));
    // The largest is the rail's, the second may be the opposite one's.
    let usual = *counts.get(2)?;
    let most = (BEYOND * rows as f64).max(2.0) as usize;
    let mut beyond = 0;
    let mut places = 0;
    let mut best: Option<(usize, Reading)> = None;
    for (k, reading) in readings.iter().enumerate() {
        if beyond > most {
            break;
        }
        places += 1;
        beyond += reading.1;
        if best.is_none_or(|(_, b)| reading.1 > b.1) {
            best = Some((k, *reading));
        }
    }
    let (k, (level, count)) = best?;
    if count < FEWEST + OFTENER * (usual - 1) {
        return None;
    }
    // What noise that came later puts beyond is spread as that noise is: a reading a few steps beyond, of an output in steps, is
    // one of this output.
    let steps = |r: &Reading| (r.0 - level).abs() / resolution;
    if in_steps && readings[..k].iter().any(|r| steps(r) < JUST_BEYOND) {
        return None;
    }
    let mut within = 0;
    let neighbour = readings[k + 1..].iter().find(|r| {
        within += r.1;
        within >= NEIGHBOURS
    });
    let width = (neighbour.or(readings.last())?.0 - level).abs();
    if width <= 0.0 {
        // Nothing lies within.
        return None;
    }
    let expected = within as f64 * resolution / width;
    let p_value = (2.0 * places as f64 * at_least(count - 1, expected)).min(1.0);
    (p_value <= LEVEL).then_some((level, p_value))
}

/// Probability of `count` or more where `expected` are (Poisson).
fn at_least(count: usize, expected: f64) -> f64 {
    if count as f64 <= expected {
        return 1.0;
    }
    let mut term = (-expected).exp();
    for k in 1..=count {
        term *= expected / k as f64;
    }
    let mut sum = 0.0;
    let mut k = count;
    while term > 1e-3 * sum {
        sum += term;
        k += 1;
        term *= expected / k as f64;
    }
    sum.min(1.0)
}

#[cfg(test)]
#[path = "rails_tests.rs"]
mod tests;
