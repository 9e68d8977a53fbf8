//! What is in the corpus: 200 records a split, fifteen of each of thirteen groups (singles: twenty).

use crate::blind::catalogue::CATALOGUE;
use crate::blind::sensor::SensorNoise;
use crate::blind::{Class, Scenario, Setting};
use std::sync::Arc;

/// Which third of the corpus.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Split {
    /// For development: look at anything.
    Tune,
    /// For decisions: figures and comparisons.
    Validate,
    /// Once a release: figures of groups only.
    Locked,
}

impl Split {
    /// The split of a name.
    pub fn of(name: &str) -> Result<Self, String> {
        match name {
            "tune" => Ok(Self::Tune),
            "validate" => Ok(Self::Validate),
            "locked" => Ok(Self::Locked),
            other => Err(format!("no split {other}: tune, validate or locked")),
        }
    }

    /// First seed: no seed is used twice, nor by the repository's other tests.
    fn first_seed(self) -> u64 {
        match self {
            Self::Tune => 4_700_000,
            Self::Validate => 4_710_000,
            Self::Locked => 4_720_000,
        }
    }

    /// Where the round through the catalogue starts, so that faint effects differ between splits.
    fn turn(self) -> usize {
        match self {
            Self::Tune => 0,
            Self::Validate => 7,
            Self::Locked => 14,
        }
    }
}

/// Groups in the order of the table.
pub const GROUPS: [&str; 13] = [
    "single",
    "faint",
    "pair",
    "triple",
    "four",
    "none",
    "noise_only",
    "hidden_channel",
    "unrecorded",
    "outside",
    "in_time",
    "short",
    "lines",
];

/// A record to be made.
pub struct Entry {
    pub name: String,
    pub group: &'static str,
    pub scenario: Scenario,
}

/// The scenario of record `k` of a group.
fn scenario(group: &str, k: usize, turn: usize, seed: u64) -> Scenario {
    let drawn = |class| Scenario::drawn(class, seed);
    let id = CATALOGUE[(k + turn) % CATALOGUE.len()].id;
    let with = |class, setting| Scenario {
        setting,
        ..Scenario::drawn(class, seed)
    };
    match group {
        "single" => Scenario::single(id, seed),
        "faint" => Scenario {
            effects: vec![id],
            ..drawn(Class::Faint)
        },
        "pair" => drawn(Class::Pair),
        "triple" => drawn(Class::Triple),
        "four" => with(
            Class::Triple,
            Setting {
                effects: Some(4),
                ..Setting::default()
            },
        ),
        "none" => drawn(Class::None),
        "noise_only" => drawn(Class::NoiseOnly),
        "hidden_channel" => drawn(Class::HiddenChannel),
        "unrecorded" => with(
            Class::HiddenChannel,
            Setting {
                effects: Some(0),
                unrecorded: true,
                ..Setting::default()
            },
        ),
        "outside" => drawn(Class::Outside),
        "in_time" => with(
            Class::Outside,
            Setting {
                outsider: Some(["outside:chirp", "outside:level_jumps"][k % 2]),
                ..Setting::default()
            },
        ),
        "short" => with(
            [Class::Single, Class::Pair, Class::None][k % 5 % 3],
            Setting {
                rows: Some((60, 200)),
                ..Setting::default()
            },
        ),
        "lines" => with(
            [Class::Single, Class::None, Class::Single][k % 3],
            Setting {
                lines: 2 + k % 3,
                ..Setting::default()
            },
        ),
        other => unreachable!("no group {other}"),
    }
}

/// The records of a split; every third has the noise of one of the `donors`, in turn.
pub fn records(split: Split, donors: &[Arc<SensorNoise>]) -> Vec<Entry> {
    let mut out = Vec::new();
    for (g, group) in GROUPS.iter().enumerate() {
        for k in 0..if *group == "single" { 20 } else { 15 } {
            let seed = split.first_seed() + 100 * g as u64 + k as u64;
            let mut s = scenario(group, k, split.turn(), seed);
            // What is drawn as noise alone keeps its own, or it would be the same as none.
            let sensor = (k + g) % 3 == 2 && *group != "noise_only";
            if sensor {
                s.setting.noise = Some(donors[(k / 3 + 4 * g) % donors.len()].clone());
            }
            out.push(Entry {
                name: format!("{group}_{k:02}{}", if sensor { "_sensor" } else { "" }),
                group,
                scenario: s,
            });
        }
    }
    let only = std::env::var("GYROGEN_CORPUS_ONLY").unwrap_or_default();
    out.retain(|e| e.name.contains(&only));
    out
}
