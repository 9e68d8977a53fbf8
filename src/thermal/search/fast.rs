//! Sinusoids faster than the blocks of rows that a long record's noise is estimated on: the blocks' means hide them, the
//! rows about those means show them.

use super::tones::{Tone, power};
use crate::statistics::robust;
use crate::thermal::channels::Channels;
use rustfft::FftPlanner;
use rustfft::num_complex::Complex;
use std::f64::consts::{LN_2, TAU};

/// Places of the grid per row where rows come at uneven times, and how uneven they may be on a grid of one.
const UNEVEN: f64 = 4.0;
const EVEN: f64 = 0.02;

/// Longest transform, places: 256 MiB.
const LONGEST: usize = 1 << 24;

/// Bins of the periodogram that share a level.
const LEVELLED: usize = 128;

/// Places around a bin at which the rows are looked at, and how far to each side, bins.
const AROUND: i32 = 16;
const BINS: f64 = 1.5;

/// Most deviations that a row counts, in units of what is usual: here a spike is one row.
const MOST: f64 = 4.0;

/// Probability from which on a tone has a say in the size of the blocks, the share of its power in their means that is
/// enough, and how many rows more a block may have.
const CERTAIN: f64 = 1e-6;
const ENOUGH: f64 = 0.1;
const LONGER: usize = 3;

/// Rows less the mean of their block of `rows`, of the rows with weight.
fn about_means(y: &[f64], weights: &[f64], rows: usize) -> Vec<f64> {
    let mut out = vec![0.0; y.len()];
    let blocks = y.chunks(rows).zip(weights.chunks(rows));
    for ((y, w), out) in blocks.zip(out.chunks_mut(rows)) {
        let used = || y.iter().zip(w).filter(|(y, w)| **w > 0.0 && y.is_finite());
        let mean = used().map(|(y, _)| y).sum::<f64>() / used().count().max(1) as f64;
        for ((out, y), w) in out.iter_mut().zip(y).zip(w) {
            if *w > 0.0 && y.is_finite() {
                *out = y - mean;
            }
        }
    }
    let unit = robust::scale(out.iter().copied().filter(|d| *d != 0.0));
    if unit > 0.0 {
        for d in &mut out {
            *d = d.clamp(-MOST * unit, MOST * unit);
        }
    }
    out
}

/// The periodogram of rows on a grid in time, bin by bin, and the width of a bin, Hz.
fn periodogram(c: &Channels, y: &[f64]) -> Option<(Vec<f64>, f64)> {
    let first = *c.time_s.first()?;
    let period_s = c.period_s();
    let off = |t: &&f64| {
        let at = (**t - first) / period_s;
        (at - at.round()).abs() > EVEN
    };
    let uneven = c.time_s.iter().filter(off).count();
    let places = if 20 * uneven > y.len() { UNEVEN } else { 1.0 };
    let step_s = period_s / places;
    let length = (c.span_s() / step_s).ceil() + 1.0;
    if length > LONGEST as f64 / 2.0 {
        return None;
    }
    let size = (2 * length as usize).next_power_of_two();
    let mut buffer = vec![Complex::new(0.0, 0.0); size];
    for (t, y) in c.time_s.iter().zip(y) {
        let at = ((t - first) / step_s).round() as usize;
        if let Some(place) = buffer.get_mut(at) {
            place.re += y;
        }
    }
    FftPlanner::new()
        .plan_fft_forward(size)
        .process(&mut buffer);
    let bin_hz = 1.0 / (size as f64 * step_s);
    let bins = (0.5 / period_s / bin_hz) as usize;
    let power = buffer.iter().take(bins + 1).map(Complex::norm_sqr);
    Some((power.collect(), bin_hz))
}

/// The bin that is farthest above the bins around it, and how far, in units of their mean: exponentially distributed in
/// noise, whose median is ln 2.
fn highest(power: &[f64], from: usize) -> Option<(usize, f64)> {
    let mut best: Option<(usize, f64)> = None;
    for (k, part) in power.get(from..)?.chunks(LEVELLED).enumerate() {
        let mut sorted = part.to_vec();
        sorted.sort_by(f64::total_cmp);
        let level = sorted[sorted.len() / 2] / LN_2;
        if part.len() < LEVELLED / 2 || level <= 0.0 {
            continue;
        }
        for (i, p) in part.iter().enumerate() {
            if best.is_none_or(|b| p / level > b.1) {
                best = Some((from + k * LEVELLED + i, p / level));
            }
        }
    }
    best
}

/// The strongest sinusoid (or an image of it about the blocks' rate, [`super::tones::unaliased`]) in what rows have beside the means of their blocks, from a quarter of the blocks' rate to half of
/// the rows'. `rest`: deg/s, every row; rows of no weight do not count.
pub fn within_blocks(c: &Channels, rest: &[f64], weights: &[f64], rows: usize) -> Option<Tone> {
    let y = about_means(rest, weights, rows);
    let (powers, bin_hz) = periodogram(c, &y)?;
    let lowest_hz = 0.25 / (rows as f64 * c.period_s());
    let from = (lowest_hz / bin_hz).ceil() as usize;
    let (bin, above) = highest(&powers, from)?;
    let around = |k: i32| (bin as f64 + f64::from(k) / f64::from(AROUND) * BINS) * bin_hz;
    let each = (-AROUND..=AROUND).map(around);
    let with_power = each.map(|hz| (power(&c.time_s, &y, weights, hz), hz));
    let (_, frequency_hz) = with_power.max_by(|a, b| a.0.total_cmp(&b.0))?;
    let bins = (powers.len() - from) as f64;
    Some(Tone {
        frequency_hz,
        p_value: -(-bins * (-above).exp()).exp_m1(),
    })
}

/// How many rows a block has, where at least `rows` go into it: a few more, where the means of so many would lose a tone
/// that the rows show beyond doubt.
pub fn block_rows(c: &Channels, rest: &[f64], used: &[bool], rows: usize) -> usize {
    if rows < 2 {
        return rows;
    }
    let weights: Vec<f64> = used.iter().map(|u| f64::from(u8::from(*u))).collect();
    let tone = within_blocks(c, rest, &weights, rows);
    let Some(tone) = tone.filter(|t| t.p_value <= CERTAIN) else {
        return rows;
    };
    let kept = |rows: usize| {
        let blocks = c.time_s.chunks(rows).map(|times| {
            let phase = |t: &f64| Complex::cis(TAU * tone.frequency_hz * t);
            let sum: Complex<f64> = times.iter().map(phase).sum();
            sum.norm_sqr() / times.len() as f64
        });
        blocks.sum::<f64>() / c.len() as f64
    };
    if kept(rows) >= ENOUGH {
        return rows;
    }
    let sizes = rows..=rows + LONGER;
    let with_power = sizes.map(|rows| (kept(rows), rows));
    let best = with_power.max_by(|a, b| a.0.total_cmp(&b.0));
    best.map_or(rows, |(_, rows)| rows)
}
