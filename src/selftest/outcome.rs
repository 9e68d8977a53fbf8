//! What a self-test says (`gyrogen.selftest/1`).

use super::statistics::Limit;
use serde::Serialize;

/// Name of the form.
pub const SCHEMA: &str = "gyrogen.selftest/1";

/// Noise of a row and slow noise, as in the records.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, schemars::JsonSchema)]
pub struct NoiseOf {
    /// deg/s rms: the unit of all sizes.
    pub white_rms_dps: f64,
    /// 1/f noise, deg/s rms in an e-fold of frequency.
    pub flicker_dps: f64,
    /// Rate random walk, deg/s per sqrt(s).
    pub walk_dps_rts: f64,
}

/// One size of an effect.
#[derive(Debug, Clone, PartialEq, Serialize, schemars::JsonSchema)]
pub struct BySize {
    /// Error that the effect leaves beyond the declared model, rms, in noises of a row.
    pub times_noise: f64,
    /// The same in the effect's own unit, the mean (geometric) of the records; `None` without records.
    pub in_own_unit: Option<f64>,
    /// Records; fewer than asked for where the experiment cannot show so much.
    pub records: usize,
    /// In how many the effect is a step's name or listed by one as indistinguishable.
    pub detected: usize,
    /// In how many of these it is only listed.
    pub only_listed: usize,
    /// Records with a name that neither is the effect nor lists it.
    pub wrong: usize,
}

/// How an effect is found.
#[derive(Debug, Clone, PartialEq, Serialize, schemars::JsonSchema)]
pub struct EffectScore {
    /// Its id.
    pub effect: String,
    /// The experiment.
    pub experiment: String,
    /// Why nothing could be planted, or what is to be known; empty: nothing.
    pub remark: String,
    /// What its size is, with the unit.
    pub own_unit: String,
    /// Ascending.
    pub by_size: Vec<BySize>,
    /// The size that nine of ten records show; `None` where nothing was planted.
    pub minimum_detectable: Option<Minimum>,
    /// Wrong names, with how often.
    pub wrong_names: Vec<(String, usize)>,
}

/// The least size that is found in nine records of ten.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, schemars::JsonSchema)]
pub struct Minimum {
    /// `at`, or `below` the smallest or `above` the largest size that was tried.
    pub relation: &'static str,
    /// In noises of a row.
    pub times_noise: f64,
    /// In the effect's own unit.
    pub in_own_unit: f64,
}

impl Minimum {
    /// Of a limit; sizes in the own unit are interpolated.
    pub fn of(limit: Limit, sizes: &[(f64, f64)]) -> Option<Minimum> {
        let (relation, times_noise) = match limit {
            Limit::At(size) => ("at", size),
            Limit::Below(size) => ("below", size),
            Limit::Above(size) => ("above", size),
        };
        let after = sizes.partition_point(|s| s.0 < times_noise);
        let at = after.clamp(1, sizes.len().saturating_sub(1).max(1));
        let (a, b) = (sizes.get(at - 1)?, sizes.get(at).or(sizes.last())?);
        let share = if b.0 > a.0 {
            (times_noise / a.0).ln() / (b.0 / a.0).ln()
        } else {
            0.0
        };
        Some(Minimum {
            relation,
            times_noise,
            in_own_unit: a.1 * (b.1 / a.1).powf(share),
        })
    }
}

/// Records without an effect.
#[derive(Debug, Clone, PartialEq, Serialize, schemars::JsonSchema)]
pub struct Clean {
    /// Their noise.
    pub noise: String,
    /// How many.
    pub records: usize,
    /// How many got a name.
    pub alarms: usize,
}

/// All of them.
#[derive(Debug, Clone, PartialEq, Serialize, schemars::JsonSchema)]
pub struct FalseAlarms {
    /// How many.
    pub records: usize,
    /// How many got a name.
    pub alarms: usize,
    /// The probability of a name is below this with 95 % confidence.
    pub upper_limit_95: f64,
    /// By noise.
    pub by_noise: Vec<Clean>,
    /// The names, with how often.
    pub names: Vec<(String, usize)>,
}

/// The result of a self-test.
#[derive(Debug, Clone, PartialEq, Serialize, schemars::JsonSchema)]
pub struct Outcome {
    /// [`SCHEMA`].
    pub schema: &'static str,
    /// Of the tool.
    pub version: &'static str,
    /// Of the design's text.
    pub design_sha256: String,
    /// As it was called.
    pub command: String,
    /// The record whose experiment was used; `None`: simulated ones.
    pub record: Option<String>,
    /// Names of the record's own steps, which were taken off.
    pub own_steps: Vec<String>,
    /// Rows of a record.
    pub rows: usize,
    /// Of all random numbers.
    pub seed: u64,
    /// Noise of the records.
    pub noise: NoiseOf,
    /// By effect.
    pub effects: Vec<EffectScore>,
    /// Names where nothing was planted.
    pub false_alarms: FalseAlarms,
    /// What does not hold: effects of ten times the noise that are not found, too many false alarms.
    pub failures: Vec<String>,
    /// Whether nothing is among them.
    pub holds: bool,
}
