//! One record of a self-test: made, closed, marked.

use super::planted::{Draw, Kind};
use super::scene::{Plant, Scene};
use crate::error::Result;
use crate::plant::noise::Noise;
use crate::plant::slow_noise::SlowNoise;
use crate::record::ThermalRecord;
use crate::statistics::noise::NoiseModel;
use crate::thermal::close::Named;

/// What gives a record its names.
pub type Answer<'a> = &'a (dyn Fn(&ThermalRecord) -> Result<Vec<Named>> + Sync);

/// Noise of a clean record.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Colour {
    /// As the design's, or the record's own.
    Own,
    /// White alone.
    White,
    /// White, and 1/f noise of the same rms in an e-fold of frequency.
    Flicker,
    /// White, and a rate random walk that goes five times as far over the record.
    Walk,
}

impl Colour {
    /// All of them.
    pub const ALL: [Colour; 4] = [Colour::Own, Colour::White, Colour::Flicker, Colour::Walk];

    /// As reported.
    pub fn name(self) -> &'static str {
        match self {
            Colour::Own => "own",
            Colour::White => "white",
            Colour::Flicker => "1/f",
            Colour::Walk => "random walk",
        }
    }

    /// Its strengths in a scene.
    fn of(self, scene: &Scene) -> NoiseModel {
        let white_rms_dps = scene.noise.white_rms_dps;
        let white = NoiseModel {
            white_rms_dps,
            ..NoiseModel::default()
        };
        match self {
            Colour::Own => scene.noise,
            Colour::White => white,
            Colour::Flicker => NoiseModel {
                flicker_dps: white_rms_dps,
                ..white
            },
            Colour::Walk => NoiseModel {
                walk_dps_rts: 5.0 * white_rms_dps / scene.span_s().sqrt().max(1e-9),
                ..white
            },
        }
    }
}

/// A record to be made.
#[derive(Debug, Clone)]
pub struct Trial<'a> {
    /// The experiment.
    pub scene: &'a Scene,
    /// What is planted, and how large, in noises of a row; `None`: nothing.
    pub planted: Option<(&'a Kind, f64)>,
    /// Its noise.
    pub colour: Colour,
    /// Its own stream of random numbers.
    pub stream: u64,
}

/// What came of it.
#[derive(Debug, Clone, PartialEq)]
pub enum Mark {
    /// The experiment cannot show so much of the effect.
    NotShown,
    /// The record was closed.
    Closed {
        /// A step has the effect's name.
        is_named: bool,
        /// A step has another name, and lists the effect.
        is_listed: bool,
        /// Names that are neither the effect nor list it.
        wrong: Vec<String>,
        /// The size in the effect's own unit; 0 if nothing is planted.
        size: f64,
    },
}

impl Mark {
    /// Of the names that a record got in which `id` is planted with a size (`None`: nothing is).
    pub fn of(id: Option<String>, names: &[Named], size: f64) -> Mark {
        let is = |name: &String| id.as_ref() == Some(name);
        let lists = |n: &Named| n.rivals.iter().any(is);
        Mark::Closed {
            is_named: names.iter().any(|n| is(&n.effect)),
            is_listed: names.iter().any(lists),
            wrong: names
                .iter()
                .filter(|n| !is(&n.effect) && !lists(n))
                .map(|n| n.effect.clone())
                .collect(),
            size,
        }
    }
}

impl Trial<'_> {
    /// Makes the record and closes it.
    ///
    /// # Errors
    /// A record that cannot be closed.
    pub fn run(&self, seed: u64, answer: Answer<'_>) -> Result<Mark> {
        let white = self.scene.noise.white_rms_dps;
        let (plant, size) = match self.planted {
            None => (Plant::default(), 0.0),
            Some((kind, times)) => {
                let draw = Draw::new(seed, 2 * self.stream);
                match kind.sized(self.scene, &draw, times * white) {
                    Some(sized) => sized,
                    None => return Ok(Mark::NotShown),
                }
            }
        };
        let names = answer(&self.record(&plant, seed))?;
        Ok(Mark::of(self.planted.map(|p| p.0.id()), &names, size))
    }

    /// The rows with the plant and with noise.
    fn record(&self, plant: &Plant, seed: u64) -> ThermalRecord {
        let scene = self.scene;
        let strengths = self.colour.of(scene);
        let own = Noise::new(seed, 2 * self.stream + 1);
        let step_s = scene.span_s() / scene.len().saturating_sub(1).max(1) as f64;
        // Strengths per hour, as the plant takes them.
        let slow = SlowNoise::new(
            strengths.bias_instability_dps() * 3600.0,
            strengths.walk_dps_rts * 3600.0 * 60.0,
            step_s.max(1e-9),
            scene.span_s().max(1.0),
            own.bits(u64::MAX),
        );
        let taken = scene.take(plant);
        let mut columns = taken.columns;
        let rows = scene.len() as u64;
        let start = scene.time_s.first().copied().unwrap_or(0.0);
        let output = (0..rows).zip(taken.rate_out_dps).zip(&scene.time_s);
        let output = output
            .map(|((k, out), t)| {
                let at = ((t - start) / step_s.max(1e-9)).round() as u64;
                out + strengths.white_rms_dps * own.normal(k) + slow.at(at)
            })
            .collect();
        columns.insert("rate_out_dps".to_owned(), output);
        let mut record = scene.record(columns);
        if scene.reading_rms > 0.0
            && let Some(reading) = record.columns.get_mut(&scene.thermometer)
        {
            for (k, v) in (rows..).zip(reading) {
                *v += scene.reading_rms * own.normal(k);
            }
        }
        record
    }
}
