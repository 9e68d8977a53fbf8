//! `mains_pickup`: a sin(2 pi f t + phase) is added, f the mains frequency, a multiple or an alias of it,
//! or any other that is neither a harmonic of the tone nor a spur of the oscillator.

use super::candidates::{Effect, Known, Variant};
use super::columns::{Model, line};
use super::gram::Combo;
use super::spur;

/// Frequencies of power lines, Hz.
pub const MAINS_HZ: [f64; 2] = [50.0, 60.0];
/// Multiples that are looked at.
pub const MULTIPLES: usize = 6;

/// Standard deviation of the mains' frequency, relative: within 1 % in 99.5 % of a year (EN 50160:2010, 4.2.1).
pub const RELATIVE_STD: f64 = 0.0036;

/// The frequency of mains or of a low multiple that is nearest to another one, within `within`; turns a sample.
pub fn nearest(known: &Known, turns: f64, within: f64) -> Option<f64> {
    let fs = known.fs_hz?;
    let all = MAINS_HZ
        .iter()
        .flat_map(|hz| (1..=MULTIPLES).map(move |k| hz * k as f64 / fs));
    all.filter(|place| (place - turns).abs() < within)
        .min_by(|a, b| (a - turns).abs().total_cmp(&(b - turns).abs()))
}

/// Whether a frequency (turns a sample) is mains or a low multiple, within `within` turns.
pub fn is_mains(known: &Known, turns: f64, within: f64) -> bool {
    nearest(known, turns, within).is_some()
}

/// Columns of a line.
pub fn columns(i: usize, channels: &[usize]) -> Vec<Combo> {
    let (sin, cos) = line(i);
    let mut out = Vec::new();
    for channel in channels {
        let name = if *channel == 0 { "drive" } else { "sense" };
        out.push(Combo::one(
            &format!("line{}_{name}_sin_codes", i + 1),
            *channel,
            sin,
        ));
        out.push(Combo::one(
            &format!("line{}_{name}_cos_codes", i + 1),
            *channel,
            cos,
        ));
    }
    out
}

/// What the search for a line's frequency costs.
pub fn search_cost(known: &Known, turns: f64, rows: usize) -> f64 {
    if is_mains(known, turns, 0.5 / rows as f64) {
        3.0
    } else {
        (rows as f64 / 2.0).ln()
    }
}

/// The first line, the first two and so on, in both channels or one.
pub fn variants(known: &Known, model: &Model, rows: usize) -> Vec<Variant> {
    let own: Vec<usize> = (0..model.lines.len())
        .filter(|i| !spur::is_spur(known, model, *i, rows))
        .collect();
    groups(model, &own, Effect::Mains, &|turns| {
        search_cost(known, turns, rows)
    })
}

/// Leading groups of lines as variants of an effect; `cost` is that of the search for a line's frequency.
pub fn groups(
    model: &Model,
    lines: &[usize],
    effect: Effect,
    cost: &dyn Fn(f64) -> f64,
) -> Vec<Variant> {
    let mut out = Vec::new();
    for count in 1..=lines.len() {
        let taken = lines.get(..count).unwrap_or_default();
        let turns = |i: &usize| model.lines.get(*i).copied().unwrap_or(0.0);
        let search: f64 = taken.iter().map(|i| cost(turns(i))).sum();
        for channels in [&[0usize, 1][..], &[0], &[1]] {
            let combos = taken.iter().flat_map(|i| columns(*i, channels)).collect();
            out.push(Variant::new(effect, combos, search));
        }
    }
    out
}
