//! What the rounding of each word does to the rate, in deg/s: its own error, by theory and as it was in the run,
//! times the way from the word to the rate.

use crate::design::{CompensationInput, Design};
use crate::equivalence::predicted::Prediction;
use crate::nodes::node::Node;
use crate::nodes::probe::Seen;
use crate::nodes::quantisation::cic_noise_gain;
use crate::numeric::format::pow2;
use serde::Serialize;
use std::f64::consts::TAU;

/// A word's line.
#[derive(Debug, Clone, PartialEq, Serialize, schemars::JsonSchema)]
pub struct Line {
    /// Of the word's own rounding, LSB rms, by theory; null where its conditions do not hold (see `flags`).
    pub predicted_rms_lsb: Option<f64>,
    /// The same as it was in the run; null where no bits were dropped.
    pub measured_rms_lsb: Option<f64>,
    /// What that does to the rate, deg/s rms a row: by theory, or else as measured. Null where the word does not
    /// reach the rate.
    pub rate_rms_dps: Option<f64>,
    /// Mean of the rounding, carried to the rate, deg/s: a bias.
    pub rate_mean_dps: Option<f64>,
    /// `predicted` or `measured`: which of the two `rate_rms_dps` is.
    pub source: &'static str,
    /// Conditions of the theory that do not hold; as in `equiv.json`.
    pub flags: Vec<&'static str>,
}

/// The run behind the lines.
#[derive(Debug)]
pub struct Budget<'a> {
    seen: &'a Seen,
    predictions: &'a [Prediction],
    /// Of a rounding that is white: rms of a decimated word over that of a product.
    noise_gain: f64,
    /// Of a rounding's mean.
    mean_gain: f64,
    /// deg/s for a turn of the drive phase.
    slope_dps_per_turn: f64,
    /// Length of the drive vector.
    radius: f64,
    /// deg/s of sense I at 1.
    full_scale_dps: f64,
    on_phase: bool,
}

impl<'a> Budget<'a> {
    /// Of a run.
    pub fn new(design: &Design, seen: &'a Seen, predictions: &'a [Prediction]) -> Self {
        let d = &design.circuit.decimator;
        let width = d.ratio as usize * d.differential_delay as usize;
        let gain = (width as f64).powi(d.stages as i32) * pow2(-(d.gain_bits() as i32));
        let phase = seen.nodes.get(seen.places.phase);
        let turns = phase.map_or(0.0, |n| {
            let raw = (n.min_raw as f64 + n.max_raw as f64) / 2.0;
            if n.count > 0 {
                raw * pow2(-n.identity.fraction_bits)
            } else {
                0.0
            }
        });
        let magnitude = seen.nodes.get(seen.places.phase + 1);
        let compensation = design.compensation.as_ref();
        let on_phase = compensation.is_some_and(|c| c.input == CompensationInput::Phase);
        let slope = compensation.filter(|_| on_phase).map_or(0.0, |c| {
            // The variable is the phase in half turns.
            let p = 2.0 * turns;
            let lsb = c.coefficient_format.lsb();
            let powers = c.coefficients_raw.iter().enumerate().skip(1);
            let terms = powers.map(|(k, raw)| k as f64 * *raw as f64 * lsb * p.powi(k as i32 - 1));
            2.0 * terms.sum::<f64>()
        });
        Budget {
            seen,
            predictions,
            noise_gain: (cic_noise_gain(d.stages, width)).sqrt() * gain,
            mean_gain: gain,
            slope_dps_per_turn: slope,
            radius: magnitude.map_or(0.0, |n| n.mean_square_value().sqrt()),
            full_scale_dps: compensation
                .filter(|c| c.input.is_of_chain())
                .map_or(0.0, |c| c.rate_full_scale_dps),
            on_phase,
        }
    }

    /// The nodes of a word: itself, or the steps of a polynomial.
    pub fn nodes<'n>(&'n self, name: &'n str) -> impl Iterator<Item = &'n Node> + use<'n, 'a> {
        self.places(name).map(|k| &self.seen.nodes[k])
    }

    fn places<'n>(&'n self, name: &'n str) -> impl Iterator<Item = usize> + use<'n, 'a> {
        // The vector's width overflows in the node of the phase.
        let name = match name {
            "circuit.cordic.width" => "circuit.cordic phase",
            other => other,
        };
        let own = move |node: &Node| {
            let rest = node.identity.name.strip_prefix(name);
            rest.is_some_and(|r| r.is_empty() || r.starts_with(' '))
        };
        let nodes = self.seen.nodes.iter().enumerate();
        nodes.filter(move |(_, n)| own(n)).map(|(k, _)| k)
    }

    /// The line of a word that drops bits.
    pub fn line(&self, name: &str) -> Option<Line> {
        let mut square = (0.0, 0.0);
        let mut rate_square = 0.0;
        let mut rate_mean = 0.0;
        let mut reaches = false;
        let mut predicted_all = true;
        let mut count = 0u32;
        let mut flags: Vec<&'static str> = Vec::new();
        if name == "circuit.cordic.width" {
            return None;
        }
        for k in self.places(name) {
            let (node, prediction) = (&self.seen.nodes[k], self.predictions.get(k)?);
            let Some(measured) = node.local_rms_lsb() else {
                continue;
            };
            count += 1;
            let used = prediction.local_rms_lsb.unwrap_or(measured);
            predicted_all &= prediction.local_rms_lsb.is_some();
            square.0 += prediction.local_rms_lsb.unwrap_or(0.0).powi(2);
            square.1 += measured * measured;
            for flag in &prediction.flags {
                if !flags.contains(flag) {
                    flags.push(flag);
                }
            }
            if let Some((gain, mean_gain)) = self.gains(&node.identity.name) {
                let lsb = pow2(-node.identity.fraction_bits);
                let mean = node.local.0 / node.local_count.max(1) as f64;
                rate_square += (used * lsb * gain).powi(2);
                rate_mean += mean * lsb * mean_gain;
                reaches = true;
            }
        }
        if count == 0 {
            return None;
        }
        let rms = |sum: f64| (sum / f64::from(count)).sqrt();
        Some(Line {
            predicted_rms_lsb: predicted_all.then(|| rms(square.0)),
            measured_rms_lsb: Some(rms(square.1)),
            rate_rms_dps: reaches.then(|| rate_square.sqrt()),
            rate_mean_dps: reaches.then_some(rate_mean),
            source: if predicted_all {
                "predicted"
            } else {
                "measured"
            },
            flags,
        })
    }

    /// From a word to the rate, deg/s for a unit of the word: of what is white, and of a mean.
    fn gains(&self, name: &str) -> Option<(f64, f64)> {
        let (key, part) = name.split_once(' ').unwrap_or((name, ""));
        if key.starts_with("compensation.") {
            return Some((1.0, 1.0));
        }
        let decimated = match part {
            "sense_i" if self.full_scale_dps > 0.0 => self.full_scale_dps,
            "drive_i" | "drive_q" if self.on_phase && self.radius > 0.0 => {
                // Across the vector a length is an angle; I and Q share it.
                self.slope_dps_per_turn.abs() / (TAU * self.radius)
                    * std::f64::consts::FRAC_1_SQRT_2
            }
            _ => return None,
        };
        match key {
            "circuit.demodulator.product" => {
                Some((decimated * self.noise_gain, decimated * self.mean_gain))
            }
            "circuit.decimator.output" => Some((decimated, decimated)),
            _ => None,
        }
    }

    fn rate(&self) -> Option<usize> {
        self.seen.places.bias.map(|at| at + 2)
    }

    /// Fixed less float in the rate, rms over the run, deg/s.
    pub fn rate_rms_dps(&self) -> Option<f64> {
        self.seen.nodes.get(self.rate()?).map(Node::rms_error)
    }

    /// The same by theory.
    pub fn predicted_rate_rms_dps(&self) -> Option<f64> {
        self.predictions.get(self.rate()?)?.rms
    }

    /// Flags of a node.
    pub fn flags(&self, name: &str) -> Vec<&'static str> {
        let of = |k: usize| {
            self.predictions
                .get(k)
                .map_or(Vec::new(), |p| p.flags.clone())
        };
        self.places(name).flat_map(of).collect()
    }
}
