//! The chance of each code at a signal, with noise before and behind the quantiser and with a limit.

use crate::statistics::normal;
use std::collections::BTreeMap;

/// Rows that tell the noise, at least.
const LEAST_FREE: usize = 200;
/// Cells of the signal in a deviation of the noise.
const CELLS: f64 = 12.0;
/// Narrowest cell of the signal, codes.
const NARROWEST: f64 = 0.02;
/// Least noise before the quantiser, codes: no fit knows the signal better.
const LEAST_NOISE: f64 = 0.04;
/// Least chance of a code: what is neither tone nor noise.
const LEAST_CHANCE: f64 = 1e-5;
/// Shares of the noise's variance that may be added behind the quantiser.
const SHARES: [f64; 5] = [0.0, 0.25, 0.5, 0.75, 1.0];
/// Noise from which on it hides where it is added, codes.
const HIDING: f64 = 1.5;

/// Where the noise comes from, seen from the limit.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Limiter {
    /// It is added behind the limit: all of it is in the codes.
    Front,
    /// It is limited with the signal.
    Whole,
}

/// Rows of nearly one signal (the middle of the cell) and one code, and their number.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Cell {
    /// Codes.
    pub signal: f64,
    /// The code.
    pub code: f64,
    /// Rows.
    pub count: f64,
}

/// Width of a cell of the signal beside noise of `sigma`, codes.
pub fn width(sigma: f64) -> f64 {
    (sigma / CELLS).max(NARROWEST)
}

/// The cells of signals and codes.
pub fn cells(rows: impl Iterator<Item = (f64, f64)>, width: f64) -> Vec<Cell> {
    let mut counts: BTreeMap<(i64, i64), f64> = BTreeMap::new();
    for (signal, code) in rows {
        let place = (signal / width).floor() as i64;
        *counts.entry((place, code as i64)).or_default() += 1.0;
    }
    let cells = counts.into_iter().map(|((place, code), count)| Cell {
        signal: (place as f64 + 0.5) * width,
        code: code as f64,
        count,
    });
    cells.collect()
}

/// The noise of the rows of a channel.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Noise {
    /// Without the rounding's own, codes.
    pub sigma: f64,
    /// Share of its variance that is added behind the quantiser, as whole numbers.
    pub share: f64,
}

impl Noise {
    /// The likeliest of rows (signal, code) that no limit touches; `sigma` is about what it is with the rounding's own.
    /// Each signal less its nearest code tells it, so that all rows count.
    ///
    /// The variance of the residuals does not: noise that is small beside a code leaves less of the rounding's error
    /// than a twelfth of a code squared, and what it leaves depends on what the model has of that error.
    pub fn of(rows: impl Iterator<Item = (f64, f64)>, sigma: f64, undithered: bool) -> Self {
        let apart = |(signal, code): (f64, f64)| (signal - signal.round(), code - signal.round());
        let cells = cells(rows.map(apart), width(sigma));
        let without = (sigma * sigma - 1.0 / 12.0).max(0.0).sqrt();
        let start = Noise {
            sigma: without.max(LEAST_NOISE),
            share: 0.0,
        };
        if cells.iter().map(|c| c.count).sum::<f64>() < LEAST_FREE as f64 {
            return start;
        }
        let shares = match (sigma > HIDING, undithered) {
            (false, _) => SHARES.as_slice(),
            // Noise this wide hides the steps before them, and not behind them.
            (true, false) => &SHARES[..1],
            (true, true) => &SHARES[SHARES.len() - 1..],
        };
        let all = shares.iter().map(|share| {
            let share = *share;
            Noise { share, ..start }.likeliest(&cells)
        });
        let best = all.max_by(|a, b| a.1.total_cmp(&b.1));
        best.map_or(start, |(noise, _)| noise)
    }

    /// The likeliest with this share, and its log-likelihood.
    fn likeliest(self, cells: &[Cell]) -> (Self, f64) {
        let of = |noise: &Noise| Chances::of(noise, None).likelihood(cells, |signal| signal);
        let mut best = (self, of(&self));
        let mut step = 0.4f64;
        while step > 0.003 {
            for by in [step, -step] {
                let sigma = (best.0.sigma * by.exp()).max(LEAST_NOISE);
                let noise = Noise { sigma, ..self };
                let value = of(&noise);
                if value > best.1 {
                    best = (noise, value);
                }
            }
            step *= 0.7;
        }
        best
    }
}

/// The chances of codes, all positive outward.
pub struct Chances {
    limit: Option<(Limiter, f64)>,
    /// Noise before the quantiser, codes.
    before: f64,
    /// Chances of the whole numbers that rounded noise behind it is, from the lowest up.
    behind: Vec<f64>,
}

impl Chances {
    /// With a noise and a limit (its level in codes).
    pub fn of(noise: &Noise, limit: Option<(Limiter, f64)>) -> Self {
        Chances {
            limit,
            before: ((1.0 - noise.share).sqrt() * noise.sigma).max(LEAST_NOISE),
            behind: whole_numbers(noise.share.sqrt() * noise.sigma),
        }
    }

    /// Log-likelihood of cells, their signals moved.
    pub fn likelihood(&self, cells: &[Cell], moved: impl Fn(f64) -> f64) -> f64 {
        let of = |cell: &Cell| {
            let chance = self.of_code(cell.code, moved(cell.signal));
            cell.count * chance.max(LEAST_CHANCE).ln()
        };
        cells.iter().map(of).sum()
    }

    /// The chance of a code at a signal.
    fn of_code(&self, code: f64, signal: f64) -> f64 {
        let (signal, last) = match self.limit {
            Some((Limiter::Front, level)) => (signal.min(level), f64::INFINITY),
            Some((Limiter::Whole, level)) => (signal, (level + 0.5).floor()),
            None => (signal, f64::INFINITY),
        };
        let below = |edge: f64| match (edge - signal) / self.before {
            z if z < -8.0 => 0.0,
            z if z > 8.0 => 1.0,
            z => normal::below(z),
        };
        let converted = |code: f64| match code {
            c if c > last => 0.0,
            c if c == last => 1.0 - below(c - 0.5),
            c => below(c + 0.5) - below(c - 0.5),
        };
        // Codes that the converter may have made, with what noise behind it added.
        let reach = (self.behind.len() / 2) as i32;
        let near = 8.0 * self.before + 1.0;
        let made = signal.min(last);
        let from = ((code - made - near).floor() as i32).max(-reach);
        let to = ((code - made + near).ceil() as i32).min(reach);
        let of = |j: i32| {
            let share = self.behind.get((j + reach) as usize);
            share.copied().unwrap_or(0.0) * converted(code - f64::from(j))
        };
        (from..=to).map(of).sum()
    }
}

/// Chances of the whole numbers that rounded noise of `sigma` codes is, from the lowest up.
fn whole_numbers(sigma: f64) -> Vec<f64> {
    if sigma < LEAST_NOISE {
        return vec![1.0];
    }
    let reach = (4.0 * sigma).ceil() as i32 + 1;
    let below = |x: f64| normal::below(x / sigma);
    let of = |j: i32| below(f64::from(j) + 0.5) - below(f64::from(j) - 0.5);
    (-reach..=reach).map(of).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::thermal::synthetic::Random;

    #[test]
    fn rows_tell_the_noise_before_and_behind_the_quantiser() {
        for (sigma, share) in [(0.12, 0.0), (0.3, 0.0), (0.6, 1.0), (0.8, 0.5)] {
            let mut random = Random::new(3);
            let parts = [f64::sqrt(1.0 - share), f64::sqrt(share)].map(|part| sigma * part);
            let rows: Vec<(f64, f64)> = (0..20_000)
                .map(|_| {
                    let signal = 40.0 * random.uniform();
                    let code = (signal + parts[0] * random.normal()).round();
                    (signal, code + (parts[1] * random.normal()).round())
                })
                .collect();
            let about = f64::sqrt(sigma * sigma + 1.0 / 12.0);
            let found = Noise::of(rows.into_iter(), about, share == 1.0);
            assert!((found.sigma / sigma - 1.0).abs() < 0.05, "{found:?}");
            assert!((found.share - share).abs() < 0.3, "{found:?}");
        }
    }

    #[test]
    fn chances_are_those_of_all_codes() {
        for share in [0.0, 0.5, 1.0] {
            for limit in [
                None,
                Some((Limiter::Front, 0.3)),
                Some((Limiter::Whole, 0.3)),
            ] {
                let chances = Chances::of(&Noise { sigma: 0.7, share }, limit);
                let sum: f64 = (-20..20).map(|c| chances.of_code(f64::from(c), 0.8)).sum();
                assert!((sum - 1.0).abs() < 1e-4, "{share} {limit:?} {sum}");
            }
        }
    }
}
