//! The experiment's clock and chamber: fine grid, rows, power cycles, temperature program.

use super::dice::Dice;
use crate::rng::Rng;
use std::f64::consts::TAU;

/// Fine steps in one row period.
pub const PER_ROW: usize = 4;

/// Shape of the chamber's program.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Chamber {
    /// Steps with dwells, up and down again.
    Staircase,
    /// Ramps up and down, each pair at another rate.
    Triangles,
    /// Slow up, fast down, or the reverse, repeated.
    Sawtooth,
    /// Random set points, random rates, random dwells.
    Wander,
    /// Periodic, like day and night.
    Sine,
    /// Rises once and never falls.
    HeatOnly,
    /// Falls once and never rises.
    CoolOnly,
    /// Constant; the room moves it by a few tenths of a kelvin.
    Static,
    /// One staircase, but at three ramp rates and with one long dwell.
    MixedRates,
}

/// Programs that go up and down.
pub const CYCLING: [Chamber; 6] = [
    Chamber::Staircase,
    Chamber::Triangles,
    Chamber::Sawtooth,
    Chamber::Wander,
    Chamber::Sine,
    Chamber::MixedRates,
];

/// The run in time. The fine grid has `PER_ROW` steps a row period.
pub struct Clock {
    pub row_s: f64,
    pub fine_s: f64,
    /// Set point smoothed by the air, degC, on the fine grid.
    pub chamber_degc: Vec<f64>,
    /// Time since power-on on the fine grid, s; NaN while off.
    pub on_s: Vec<f64>,
    /// For each fine step, how long the gyro was off before this power-on, s.
    pub off_before_s: Vec<f64>,
    /// Fine index of each regular row.
    pub rows: Vec<usize>,
}

/// (duration, target) legs of a program over the unit range; a leg is a straight line.
fn legs(kind: Chamber, rng: &mut Rng) -> Vec<(f64, f64)> {
    let mut out = vec![(rng.between(0.0, 0.3), 0.0)];
    match kind {
        Chamber::Staircase => {
            let steps = rng.range(3, 14) as usize;
            let dwell = rng.between(0.3, 6.0);
            for _ in 0..rng.range(1, 2) {
                for k in (1..=steps).chain((0..steps).rev()) {
                    out.push((1.0, k as f64 / steps as f64));
                    out.push((dwell, k as f64 / steps as f64));
                }
            }
        }
        Chamber::Triangles => {
            for _ in 0..rng.range(2, 4) {
                let d = rng.spread(1.0, 6.0);
                out.extend([(d, 1.0), (rng.between(0.0, 0.5), 1.0)]);
                out.extend([
                    (d * rng.between(0.7, 1.4), 0.0),
                    (rng.between(0.0, 0.5), 0.0),
                ]);
            }
        }
        Chamber::Sawtooth => {
            let (up, down) = rng.pick(&[(4.0, 1.0), (1.0, 4.0), (6.0, 0.6)]);
            for _ in 0..rng.range(2, 6) {
                out.extend([(up, 1.0), (down, 0.0)]);
            }
        }
        Chamber::Wander => {
            for _ in 0..rng.range(7, 16) {
                let to = rng.unit();
                out.push((rng.between(0.5, 3.0), to));
                out.push((rng.between(0.0, 2.0), to));
            }
        }
        Chamber::Sine => {
            let (turns, pieces) = (rng.range(2, 5), 40);
            for k in 1..=turns * pieces {
                let turn = k as f64 / pieces as f64;
                out.push((1.0 / pieces as f64, 0.5 - 0.5 * (TAU * turn).cos()));
            }
        }
        Chamber::HeatOnly | Chamber::CoolOnly => {
            let bend = rng.between(0.0, 2.5);
            for k in 1..=40 {
                let x = f64::from(k) / 40.0;
                let to = if bend < 0.3 {
                    x
                } else {
                    (1.0 - (-bend * x).exp()) / (1.0 - (-bend).exp())
                };
                out.push((1.0, to));
            }
        }
        Chamber::Static => {
            for _ in 0..12 {
                out.push((1.0, rng.unit()));
            }
        }
        Chamber::MixedRates => {
            for d in [4.0, 2.0, 1.0] {
                let d = d * rng.between(0.7, 1.3);
                out.extend([(d, 0.5), (1.0, 0.5), (d, 1.0), (1.5, 1.0), (1.5 * d, 0.0)]);
                out.push((rng.between(0.5, 2.0), 0.0));
            }
        }
    }
    out
}

/// Draws a clock of `n` rows, `row_s` apart, with the chamber's program; `cycles` power cycles in all.
pub fn clock(kind: Chamber, n: usize, row_s: f64, cycles: usize, rng: &mut Rng) -> Clock {
    let fine = n * PER_ROW;
    let fine_s = row_s / PER_ROW as f64;
    let program = legs(kind, rng);
    let length: f64 = program.iter().map(|l| l.0).sum();
    let unit = sampled(&program, length, fine);
    let steepest = unit
        .windows(2)
        .map(|w| (w[1] - w[0]).abs())
        .fold(0.0, f64::max)
        / fine_s;
    // Chambers manage 10 K/min; small boxes with a Peltier element somewhat more.
    let wanted = if kind == Chamber::Static {
        rng.between(0.2, 1.5)
    } else {
        rng.between(25.0, 95.0)
    };
    let span = wanted
        .min(rng.between(5.0, 12.0) / 60.0 / steepest)
        .max(if kind == Chamber::Static { 0.1 } else { 10.0 });
    let low = rng.between(-40.0, 85.0 - span.min(100.0));
    let falls = kind == Chamber::CoolOnly || (CYCLING.contains(&kind) && rng.odds(0.3));
    let set: Vec<f64> = unit
        .iter()
        .map(|u| low + span * if falls { 1.0 - u } else { *u })
        .collect();
    let air_s = rng.between(1.0, 4.0) * fine_s;
    let (on_s, off_before_s) = power(fine, fine_s, cycles, rng);
    let uneven = rng.odds(0.2);
    let rows = (0..n)
        .map(|k| k * PER_ROW + if uneven { rng.range(0, 2) as usize } else { 0 })
        .collect();
    Clock {
        row_s,
        fine_s,
        chamber_degc: super::heat::lag_stepwise(&set, fine_s, air_s),
        on_s,
        off_before_s,
        rows,
    }
}

/// The program at `n` equal steps.
fn sampled(program: &[(f64, f64)], length: f64, n: usize) -> Vec<f64> {
    let (mut leg, mut start, mut from) = (0, 0.0, 0.0);
    (0..n)
        .map(|k| {
            let t = length * k as f64 / n as f64;
            while leg + 1 < program.len() && t >= start + program[leg].0 {
                start += program[leg].0;
                from = program[leg].1;
                leg += 1;
            }
            let (duration, to) = program[leg];
            let x = if duration > 0.0 {
                ((t - start) / duration).clamp(0.0, 1.0)
            } else {
                1.0
            };
            from + (to - from) * x
        })
        .collect()
}

/// Time since power-on, and how long it was off before. The first power-on is at time 0 after a long rest.
fn power(n: usize, step_s: f64, cycles: usize, rng: &mut Rng) -> (Vec<f64>, Vec<f64>) {
    let mut on = vec![0.0; n];
    let mut before = vec![1e9; n];
    let mut starts: Vec<(usize, usize)> = (1..cycles)
        .map(|k| {
            let at = (k as f64 + rng.between(-0.2, 0.2)) * n as f64 / cycles as f64;
            let off = rng.between(0.03, 0.10) * n as f64 / cycles as f64 * 2.0;
            (at as usize, off as usize)
        })
        .collect();
    starts.push((usize::MAX, 0));
    let (mut next, mut origin, mut rested) = (0, 0, 1e9);
    for k in 0..n {
        let (off_at, off) = starts[next];
        if off_at != usize::MAX && k == off_at + off {
            next += 1;
            origin = k;
            rested = off as f64 * step_s;
        }
        let off_now = off_at != usize::MAX && k >= off_at && k < off_at + off;
        on[k] = if off_now {
            f64::NAN
        } else {
            (k - origin) as f64 * step_s
        };
        before[k] = rested;
    }
    (on, before)
}
