//! Records made for the tests, from seeds.

use super::channels::Channels;
use crate::design::{FitOptions, FitOrder};
use crate::numeric::splitmix::{GOLDEN, mix};
use crate::record::ThermalRecord;
use std::collections::BTreeMap;
use std::path::PathBuf;

/// SplitMix64 with Box-Muller.
pub(crate) struct Random(u64);

impl Random {
    pub(crate) fn new(seed: u64) -> Self {
        Random(seed)
    }

    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(GOLDEN);
        mix(self.0)
    }

    /// Within (0, 1).
    pub(crate) fn uniform(&mut self) -> f64 {
        ((self.next() >> 11) as f64 + 0.5) / (1u64 << 53) as f64
    }

    pub(crate) fn normal(&mut self) -> f64 {
        let radius = (-2.0 * self.uniform().ln()).sqrt();
        radius * (std::f64::consts::TAU * self.uniform()).cos()
    }

    /// AR(1) of unit variance.
    pub(crate) fn coloured(&mut self, n: usize, rho: f64) -> Vec<f64> {
        let mut value = self.normal();
        (0..n)
            .map(|_| {
                let now = value;
                value = rho * value + (1.0 - rho * rho).sqrt() * self.normal();
                now
            })
            .collect()
    }
}

/// 0 to 70 degC and back, `n` rows; an odd `n` meets 70 exactly.
pub(crate) fn triangle(n: usize) -> Vec<f64> {
    (0..n)
        .map(|k| 70.0 * (1.0 - (2.0 * k as f64 / (n - 1) as f64 - 1.0).abs()))
        .collect()
}

/// A record with one reading a second.
pub(crate) fn record(thermometer: &str, t: &[f64], rate: &[f64]) -> ThermalRecord {
    let mut columns = BTreeMap::new();
    columns.insert(thermometer.to_owned(), t.to_vec());
    columns.insert("rate_out_dps".to_owned(), rate.to_vec());
    ThermalRecord {
        source: PathBuf::from("synthetic.csv"),
        time_s: (0..t.len()).map(|k| k as f64).collect(),
        columns,
        lines: (2..t.len() + 2).collect(),
        renamed: BTreeMap::new(),
        units: BTreeMap::new(),
    }
}

pub(crate) fn options(order: FitOrder) -> FitOptions {
    FitOptions {
        order,
        heldout_blocks: 10,
    }
}

/// Two held-out blocks only: for tests that do not look at them, since they cost time.
pub(crate) fn few(order: FitOrder) -> FitOptions {
    FitOptions {
        order,
        heldout_blocks: 2,
    }
}

/// A gyro whose drive gain pulls the measured phase, its thermometer.
pub(crate) struct Pull {
    /// What the phase errs by per unit of the gain's power less one.
    pub(crate) pull_rad: f64,
    /// Of the gain: 1 or 2.
    pub(crate) power: i32,
    /// The error follows the bias curve's slope, as if every pull were small.
    pub(crate) along_slope: bool,
    /// Beside it.
    pub(crate) supply_dps: f64,
}

/// Its record.
pub(crate) struct Pulled {
    pub(crate) channels: Channels,
    /// The pull per unit of the gain's power less one, and the largest, in units of u.
    pub(crate) pull_u: f64,
    pub(crate) most_u: f64,
    /// In the output.
    pub(crate) noise_dps: Vec<f64>,
}

impl Default for Pull {
    fn default() -> Self {
        Pull {
            pull_rad: 0.3,
            power: 1,
            along_slope: false,
            supply_dps: 0.0,
        }
    }
}

impl Pull {
    /// The bias, deg/s, over powers of the reading scaled to -1 ..= 1.
    pub(crate) const BIAS_DPS: [f64; 3] = [8.0, -3.0, 1.0];

    /// Two unequal heatings, over which the phase goes through 0.12 rad, with set points of the amplitude in turn.
    pub(crate) fn made(&self) -> Pulled {
        const ROWS: usize = 400;
        let mut random = Random::new(4);
        let degc = [triangle(100), triangle(300)].concat();
        let agc: Vec<f64> = (0..ROWS)
            .map(|k| [1.0, 1.15, 0.85, 1.3][k / 17 % 4])
            .collect();
        let by: Vec<f64> = agc.iter().map(|g| g.powi(self.power) - 1.0).collect();
        let phase_rad: Vec<f64> = degc
            .iter()
            .zip(&by)
            .map(|(t, d)| {
                -std::f64::consts::FRAC_PI_2 - 0.06 * (t / 35.0 - 1.0) + self.pull_rad * d
            })
            .collect();
        let (u, _, half_rad) = super::channels::scaled(&phase_rad);
        let pull_u = self.pull_rad / half_rad;
        let [b0, b1, b2] = Self::BIAS_DPS;
        let bias = |u: f64| b0 + b1 * u + b2 * u * u;
        let slope = |u: f64| b1 + 2.0 * b2 * u;
        let supply: Vec<f64> = (0..ROWS)
            .map(|k| f64::from(u8::from(k % 90 < 40)))
            .collect();
        let noise_dps: Vec<f64> = (0..ROWS).map(|_| 0.01 * random.normal()).collect();
        let output = (0..ROWS).map(|k| {
            let moved = pull_u * by[k];
            let pulled = match self.along_slope {
                true => bias(u[k]) - slope(u[k]) * moved,
                false => bias(u[k] - moved),
            };
            pulled + self.supply_dps * supply[k] + noise_dps[k]
        });
        let columns = BTreeMap::from([
            ("rate_out_dps".to_owned(), output.collect()),
            ("phase_rad".to_owned(), phase_rad),
            ("agc".to_owned(), agc),
            ("supply_v".to_owned(), supply),
        ]);
        let time_s: Vec<f64> = (0..ROWS).map(|k| 10.0 * k as f64).collect();
        let degc_of = |rad: f64| 35.0 - (rad + std::f64::consts::FRAC_PI_2) * 35.0 / 0.06;
        let channels = Channels::new(&time_s, &columns, "phase_rad", degc_of).unwrap();
        let most = by.iter().fold(0.0, |m: f64, d| m.max(d.abs()));
        Pulled {
            channels,
            pull_u,
            most_u: pull_u * most,
            noise_dps,
        }
    }
}
