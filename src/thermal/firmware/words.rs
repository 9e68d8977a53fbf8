//! A law in the inputs that firmware reads, as terms of a correction.

use crate::correction::{Input, Term};
use crate::statistics::linear::{Basis, dot};
use crate::thermal::channels::{Channels, scaled};
use crate::thermal::effects::Bias;

/// Columns that firmware sees by itself.
const SEEN: [&str; 6] = [
    "phase_rad",
    "freq_hz",
    "die_degc",
    "agc",
    "quad_dps",
    "supply_v",
];

/// Whether firmware sees a column by itself.
pub fn sees(name: &str) -> bool {
    SEEN.contains(&name)
}

/// `count` equidistant numbers over -1 ..= 1.
pub fn knots(count: usize) -> impl Iterator<Item = f64> {
    let last = count.saturating_sub(1).max(1) as f64;
    (0..count).map(move |k| -1.0 + 2.0 * k as f64 / last)
}

/// The inputs of a correction while its terms are collected.
pub struct Words {
    /// The declared bias in u that effects act on ([`crate::thermal::search::Model::acting`]).
    pub bias: Bias,
    /// Of the firmware, s.
    pub period_s: f64,
    /// White noise of a reading, deg/s.
    noise_dps: f64,
    pub(super) inputs: Vec<Input>,
    pub(super) thermometer: Option<usize>,
    /// Columns that the design says firmware sees.
    allowed: Vec<String>,
}

/// Largest rms error with which terms of firmware stand for an effect, of the white noise of a reading (convention: it adds
/// half a percent to the rms of the output).
const NEAR: f64 = 0.1;

impl Words {
    pub(super) fn new(c: &Channels, bias: &Bias, noise_dps: f64) -> Self {
        let mut out = Words {
            noise_dps,
            period_s: super::clock::period_s(&c.on_s, c.period_s()),
            bias: bias.clone(),
            inputs: Vec::new(),
            thermometer: None,
            allowed: Vec::new(),
        };
        if SEEN.contains(&c.thermometer.as_str()) {
            out.thermometer = Some(0);
            out.inputs.push(Input {
                column: c.thermometer.clone(),
                offset: c.centre,
                scale: c.half,
            });
        }
        out
    }

    /// The input that is u, if firmware sees the thermometer.
    pub fn thermometer(&self) -> Option<usize> {
        self.thermometer
    }

    /// The design says that firmware sees this column.
    pub fn allow(&mut self, name: &str) {
        self.allowed.push(name.to_owned());
    }

    /// An input for a column that firmware sees, and the column as it reads it.
    pub fn input(&mut self, c: &Channels, name: &str) -> Option<(usize, Vec<f64>)> {
        if !sees(name) && !self.allowed.iter().any(|a| a == name) {
            return None;
        }
        let (x, middle, half) = scaled(c.column(name)?);
        let at = self.inputs.iter().position(|i| i.column == name);
        let at = at.unwrap_or_else(|| {
            self.inputs.push(Input {
                column: name.to_owned(),
                offset: middle,
                scale: if half > 0.0 { half } else { 1.0 },
            });
            self.inputs.len() - 1
        });
        Some((at, x))
    }

    /// Whether what terms leave of an effect, the sum of its squares over so many rows, is far below the noise.
    pub fn is_near(&self, left_dps2: f64, rows: usize) -> bool {
        left_dps2 <= (NEAR * self.noise_dps).powi(2) * rows as f64
    }

    /// Terms for the sum of `columns` times `beta`, a smooth function of a column and of u: the
    /// polynomial in both that fits it over the record's rows; `None` if none does well enough.
    pub fn surface(
        &mut self,
        c: &Channels,
        name: &str,
        columns: &[Vec<f64>],
        beta: &[f64],
    ) -> Option<Vec<Term>> {
        let (input, x) = self.input(c, name)?;
        let mut target = vec![0.0; c.len()];
        for (column, b) in columns.iter().zip(beta) {
            crate::statistics::linear::add_scaled(&mut target, *b, column);
        }
        for (of_x, of_u) in [(1, 0), (1, 1), (2, 2), (2, 4), (3, 6)] {
            let of_u = if self.thermometer.is_some() { of_u } else { 0 };
            let powers: Vec<(u32, u32)> = (0..=of_x)
                .flat_map(|a| (0..=of_u).map(move |b| (a, b)))
                .collect();
            let shapes: Vec<Vec<f64>> = powers
                .iter()
                .map(|(a, b)| {
                    let pairs = x.iter().zip(&c.u);
                    pairs
                        .map(|(x, u)| x.powi(*a as i32) * u.powi(*b as i32))
                        .collect()
                })
                .collect();
            let basis = Basis::new(&shapes);
            let mut rest = target.clone();
            let z = basis.project_off(&mut rest);
            if !self.is_near(dot(&rest, &rest), c.len()) {
                continue;
            }
            let terms = powers
                .iter()
                .zip(basis.solve(&z))
                .map(|((a, b), gain_dps)| {
                    let mut factors = Vec::new();
                    if *a > 0 {
                        factors.push((input, *a));
                    }
                    if let (Some(u), true) = (self.thermometer, *b > 0) {
                        factors.push((u, *b));
                    }
                    Term::Product { gain_dps, factors }
                });
            return Some(terms.collect());
        }
        None
    }
}
