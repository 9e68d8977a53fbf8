//! Blind records: thermal records whose hidden cause is known here and nowhere else.
//!
//! Nothing below this folder uses the simulated gyro (`gyrogen::plant`) or the closure's candidates: it has
//! its own resonator, thermal network, noise and random numbers, written from the record contract
//! (`docs/manual.md`) and the literature, and where the contract leaves the form open it plants several.
//!
//! Read in this order: `chamber` and `programs` (what is done to the gyro), `world` (what is then true of it),
//! `heat_effects`, `loop_effects`, `rate_effects`, `field_effects`, `covariates`, `outside` (one function an
//! effect), `form` (how large it is made), `catalogue` (id, needs, channel), `rivals` (what else would explain it), `judge`, `build`
//! (the classes), `sensor` (noise like a real sensor's), `sheet` (the CSV), `score` and `tally` (what an answer is worth).

pub mod build;
pub mod catalogue;
pub mod chamber;
pub mod covariates;
pub mod dice;
pub mod dump;
pub mod field_effects;
pub mod form;
pub mod heat;
pub mod heat_effects;
pub mod judge;
pub mod linear;
pub mod loop_effects;
pub mod noise;
pub mod outside;
pub mod programs;
pub mod rate_effects;
pub mod rivals;
pub mod score;
#[allow(dead_code)] // What makes a `SensorNoise` is used by `examples/corpus` alone.
pub mod sensor;
pub mod sheet;
pub mod tally;
pub mod traps;
pub mod world;

use form::Planted;
use sensor::SensorNoise;
use std::sync::Arc;

/// Correlation after projection above which two causes count as one.
pub const INSEPARABLE: f64 = 0.97;

/// A cause that leaves less than this sum of squares, in units of the short-term variance, is no worse than the truth (5 sigma).
pub const EVIDENCE: f64 = 25.0;

/// What kind of record.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Class {
    /// One effect, 1.5 to 20 times the short-term noise, separable from all others.
    Single,
    /// The same at 0.5 to 1.5 times.
    Faint,
    Pair,
    Triple,
    /// White noise, or white with some 1/f.
    None,
    /// Strong 1/f, or rate random walk.
    NoiseOnly,
    /// An auxiliary column is the cause, others are decoys.
    Covariate,
    /// A cause that the catalogue does not have.
    Outside,
    /// An effect of the catalogue, its channel not recorded.
    HiddenChannel,
    /// An effect that this experiment cannot tell from another.
    Confounded,
    /// An effect that this experiment does not show.
    Unexcited,
}

/// All classes.
pub const CLASSES: [Class; 11] = [
    Class::Single,
    Class::Faint,
    Class::Pair,
    Class::Triple,
    Class::None,
    Class::NoiseOnly,
    Class::Covariate,
    Class::Outside,
    Class::HiddenChannel,
    Class::Confounded,
    Class::Unexcited,
];

/// A record to be made; equal scenarios give equal bytes.
#[derive(Clone, Debug)]
pub struct Scenario {
    pub seed: u64,
    pub class: Class,
    /// Ids to plant; empty = drawn.
    pub effects: Vec<&'static str>,
    /// Size of each effect over the short-term noise; None = drawn.
    pub ratio: Option<f64>,
    pub setting: Setting,
}

/// What a scenario asks for beyond its class; the default changes nothing.
#[derive(Clone, Debug, Default)]
pub struct Setting {
    /// Number of rows, from and to.
    pub rows: Option<(i64, i64)>,
    /// Number of effects to draw, in place of the class's.
    pub effects: Option<usize>,
    /// The cause outside the catalogue.
    pub outsider: Option<&'static str>,
    /// `HiddenChannel` only: the cause is an auxiliary column that is not in the record.
    pub unrecorded: bool,
    /// Spectral lines in the noise, 0.5 to 4 times the short-term noise each.
    pub lines: usize,
    /// Noise in place of the class's; each effect then has a whitened t of 6 at least.
    pub noise: Option<Arc<SensorNoise>>,
}

impl Scenario {
    /// Effects and sizes as the seed will have it.
    pub fn drawn(class: Class, seed: u64) -> Self {
        Self {
            seed,
            class,
            effects: Vec::new(),
            ratio: None,
            setting: Setting::default(),
        }
    }

    /// One given effect.
    pub fn single(id: &'static str, seed: u64) -> Self {
        Self {
            seed,
            class: Class::Single,
            effects: vec![id],
            ratio: None,
            setting: Setting::default(),
        }
    }
}

/// A record and what is true of it.
#[derive(Clone, Debug)]
pub struct BlindRecord {
    pub csv: String,
    pub truth: Truth,
}

/// What is true of a record; all vectors have one value a row of the CSV.
#[derive(Clone, Debug)]
pub struct Truth {
    pub class: Class,
    /// Ids of the contract that a right answer names; empty where none is to be named.
    pub effects: Vec<String>,
    /// What was planted, unexcited, hidden and outside causes included.
    pub planted: Vec<Planted>,
    /// (planted, other id, correlation) above `INSEPARABLE`, or with less than `EVIDENCE` against the other.
    pub alternatives: Vec<(String, String, f64)>,
    /// (planted, closest other id, correlation), whatever it is.
    pub closest: Vec<(String, String, f64)>,
    /// Noiseless contributions, one column an effect: with {1, p, p^2} the oracle's regressors.
    pub oracle: Vec<Vec<f64>>,
    /// The thermometer without read noise.
    pub reading: Vec<f64>,
    pub thermometer: &'static str,
    /// Noiseless error: bias and contributions, deg/s.
    pub clean_dps: Vec<f64>,
    /// What was added, outliers included, deg/s.
    pub noise_dps: Vec<f64>,
    pub outlier: Vec<bool>,
    /// rms of the noise without outliers, deg/s.
    pub noise_rms: f64,
    /// rms of its first differences over the square root of 2, deg/s.
    pub short_term: f64,
    /// For each planted effect: orthogonal rms over `short_term`.
    pub ratios: Vec<f64>,
    /// Amplitudes of the noise's lines over `short_term`, where the scenario asks for lines.
    #[allow(dead_code)] // `examples/corpus` prints them.
    pub lines: Vec<f64>,
    /// Columns besides time, output and auxiliaries.
    pub channels: Vec<&'static str>,
    /// Channel of the effect that was left out of the record.
    pub hidden: Option<&'static str>,
    /// For outside causes: the channel in which what is left shows, and ids that come near.
    pub outside_channel: Option<&'static str>,
    pub nearest: Vec<&'static str>,
    /// Auxiliary columns that cause nothing.
    pub decoys: Vec<&'static str>,
    /// What a plain search through all shapes of all ids names (one cause of the catalogue only).
    pub dictionary: Option<String>,
    /// Draws that were thrown away before this one.
    pub attempts: u64,
    /// For the eye: chamber, rate program, noise.
    pub protocol: String,
}

/// Makes a record.
///
/// # Panics
/// If a thousand draws give no world that suits the scenario: the scenario is at fault.
pub fn make(scenario: &Scenario) -> BlindRecord {
    (0..1000)
        .find_map(|attempt| build::attempt(scenario, attempt))
        .unwrap_or_else(|| panic!("no world suits {scenario:?}"))
}
