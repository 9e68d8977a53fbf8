//! Records made for the tests, from seeds.

use crate::design::{FitOptions, FitOrder};
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
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        z ^ (z >> 31)
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
