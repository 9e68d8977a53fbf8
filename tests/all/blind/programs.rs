//! What is done to the gyro besides temperature: rate table, supply, acceleration, drive gain,
//! quadrature. All on the regular rows.

use super::dice::Dice;
use super::noise::walk;
use crate::rng::Rng;
use std::f64::consts::TAU;

/// Rate table.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RateProgram {
    /// At rest throughout.
    Rest,
    /// 0, r1, -r1, r2, -r2, ... again and again, so at several temperatures.
    Sequence,
    /// Random levels, held for some rows.
    Random,
    /// Slow sine.
    Sine,
    /// Slow triangle through zero at small rates, where a dead band shows.
    Creep,
    /// Rest and one rate of one sign: separates no two laws of the rate.
    TwoLevels,
}

/// Supply voltage.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SupplyProgram {
    Constant,
    Steps,
    Sweep,
    Wander,
    /// A battery that only goes down.
    Decline,
}

/// Acceleration along the sensitive axis.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum AccelProgram {
    /// +1 g or 0 g throughout.
    Level,
    /// Positions of a tumble: +1, 0, -1 g and what lies between.
    Tumble,
    /// A shaker: levels up to some g, both signs.
    Shaker,
    /// 0 and +1 g only: linear and quadratic are the same.
    TwoLevels,
    /// Slow tilt through the full turn.
    Tilt,
}

/// A quantity inside the gyro (drive amplitude, damping, quadrature), relative to its spread.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Inner {
    Constant,
    Steps,
    Wander,
    /// Leaks away exponentially (cavity pressure) or comes and goes like humidity.
    Slow,
    /// A function of temperature alone.
    OfTemperature,
}

/// `levels` in turn, each held for `hold` rows, from a random place in the round.
fn held(levels: &[f64], hold: usize, n: usize, rng: &mut Rng) -> Vec<f64> {
    let start = rng.range(0, 1000) as usize;
    (0..n)
        .map(|k| levels[((k + start) / hold.max(1)) % levels.len()])
        .collect()
}

/// Random levels of `draw`, held for a random number of rows each.
fn random_levels(n: usize, rng: &mut Rng, mut draw: impl FnMut(&mut Rng) -> f64) -> Vec<f64> {
    let longest = (n as i64 / 8).max(4);
    let mut out = Vec::with_capacity(n);
    while out.len() < n {
        let (hold, level) = (rng.range(2, longest), draw(rng));
        out.extend((0..hold).map(|_| level));
    }
    out.truncate(n);
    out
}

/// A random walk through a low-pass, scaled to -1..1.
fn wander(n: usize, rng: &mut Rng) -> Vec<f64> {
    let raw = walk(n, rng);
    let smooth = super::heat::lag_stepwise(&raw, 1.0, rng.between(2.0, 15.0));
    super::linear::centred(&smooth)
}

/// deg/s on `n` rows, and the largest rate of the program.
pub fn rate(program: RateProgram, n: usize, rng: &mut Rng) -> Vec<f64> {
    let top = rng.pick(&[25.0, 50.0, 100.0, 150.0, 200.0, 300.0, 400.0]);
    match program {
        RateProgram::Rest => vec![0.0; n],
        RateProgram::Sequence => {
            let m = rng.range(2, 6);
            let mut levels = vec![0.0];
            for k in 1..=m {
                let r = top * k as f64 / m as f64;
                levels.extend([r, -r]);
            }
            if rng.odds(0.3) {
                levels.extend([0.01 * top, -0.01 * top, 0.03 * top, -0.03 * top]);
            }
            if rng.odds(0.4) {
                rng.shuffle(&mut levels);
            }
            let rounds = rng.range(3, 12) as usize;
            held(&levels, (n / (rounds * levels.len())).clamp(1, 12), n, rng)
        }
        RateProgram::Random => random_levels(n, rng, |r| {
            // Many small rates: a dead band shows only there.
            if r.odds(0.2) {
                0.0
            } else {
                top * r.signed_unit().powi(3)
            }
        }),
        RateProgram::Sine => {
            let (turns, lead) = (rng.between(5.3, 20.0), rng.unit());
            (0..n)
                .map(|k| top * (TAU * (turns * k as f64 / n as f64 + lead)).sin())
                .collect()
        }
        RateProgram::Creep => {
            let (turns, lead) = (rng.between(4.3, 15.0), rng.unit());
            let triangle =
                |k: usize| 4.0 * ((turns * k as f64 / n as f64 + lead).fract() - 0.5).abs() - 1.0;
            (0..n).map(|k| 0.1 * top * triangle(k)).collect()
        }
        RateProgram::TwoLevels => held(&[0.0, top * rng.sign()], n.div_ceil(9), n, rng),
    }
}

/// V on `n` rows.
pub fn supply(program: SupplyProgram, n: usize, rng: &mut Rng) -> Vec<f64> {
    let nominal = rng.pick(&[3.0, 3.3, 5.0]);
    let swing = nominal * rng.between(0.02, 0.1);
    let unit: Vec<f64> = match program {
        SupplyProgram::Constant => vec![0.0; n],
        SupplyProgram::Steps => {
            let levels = rng.pick(&[
                &[-1.0, 0.0, 1.0][..],
                &[0.0, 1.0][..],
                &[-1.0, -0.5, 0.0, 0.5, 1.0, 0.0][..],
            ]);
            let rounds = rng.range(2, 6) as usize;
            held(levels, n / (rounds * levels.len()), n, rng)
        }
        SupplyProgram::Sweep => {
            let turns = rng.between(1.7, 7.0);
            (0..n)
                .map(|k| (turns * k as f64 / n as f64).fract() * 2.0 - 1.0)
                .collect()
        }
        SupplyProgram::Wander => wander(n, rng),
        SupplyProgram::Decline => (0..n).map(|k| 1.0 - 2.0 * k as f64 / n as f64).collect(),
    };
    unit.iter().map(|u| nominal + swing * u).collect()
}

/// g on `n` rows.
pub fn accel(program: AccelProgram, n: usize, rng: &mut Rng) -> Vec<f64> {
    match program {
        AccelProgram::Level => vec![rng.pick(&[1.0, 0.0, -1.0]); n],
        AccelProgram::Tumble => {
            let levels = rng.pick(&[
                &[1.0, 0.0, -1.0, 0.0][..],
                &[
                    0.0, 0.5, 0.866, 1.0, 0.866, 0.5, 0.0, -0.5, -0.866, -1.0, -0.866, -0.5,
                ][..],
                &[1.0, -1.0, 0.0][..],
            ]);
            let rounds = rng.range(2, 8) as usize;
            held(levels, n / (rounds * levels.len()), n, rng)
        }
        AccelProgram::Shaker => {
            let top = rng.between(1.5, 12.0);
            random_levels(n, rng, |r| {
                if r.odds(0.3) {
                    0.0
                } else {
                    top * r.signed_unit()
                }
            })
        }
        AccelProgram::TwoLevels => held(&[0.0, 1.0], n.div_ceil(9), n, rng),
        AccelProgram::Tilt => {
            let turns = rng.between(1.6, 9.0);
            (0..n)
                .map(|k| (TAU * turns * k as f64 / n as f64).sin())
                .collect()
        }
    }
}

/// A quantity of the gyro's inside on `n` rows, about -1..1; `warmth` is the temperature in -1..1.
pub fn inner(program: Inner, n: usize, warmth: &[f64], rng: &mut Rng) -> Vec<f64> {
    match program {
        Inner::Constant => vec![0.0; n],
        Inner::Steps => {
            let m = rng.range(2, 5) as usize;
            let levels: Vec<f64> = (0..m)
                .map(|k| 2.0 * k as f64 / (m - 1) as f64 - 1.0)
                .collect();
            let rounds = rng.range(2, 7) as usize;
            held(&levels, n / (rounds * m), n, rng)
        }
        Inner::Wander => wander(n, rng),
        Inner::Slow => {
            let (turns, lead) = (rng.between(0.7, 3.0), rng.unit());
            (0..n)
                .map(|k| (TAU * (turns * k as f64 / n as f64 + lead)).sin())
                .collect()
        }
        Inner::OfTemperature => {
            let (a, b, c) = (rng.signed_unit(), rng.signed_unit(), rng.signed_unit());
            warmth
                .iter()
                .map(|w| (a * w + 0.5 * b * w * w + 0.3 * c * w.powi(3)) / 1.5)
                .collect()
        }
    }
}
