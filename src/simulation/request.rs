//! What a simulation is asked, and what it took.

use crate::cosim::readings::Taken;
use std::path::PathBuf;

/// What is simulated.
#[derive(Debug, Clone, PartialEq)]
pub enum Course {
    /// The design's own thermal run, each reading warm-started.
    ThermalRun,
    /// The chamber (and table, supply, acceleration) of a profile, each reading warm-started.
    Profile(PathBuf),
    /// The first so many seconds of the design's own run, every ADC sample.
    Continuous(f64),
}

/// How it is simulated.
#[derive(Debug, Clone, PartialEq)]
pub struct Request {
    /// What.
    pub course: Course,
    /// Readings along a profile.
    pub profile_readings: u64,
    /// Threads; the result does not depend on it.
    pub threads: usize,
    /// Which words of the power-on are kept.
    pub trace: super::trace::Wanted,
    /// The command, for the results.
    pub command: String,
}

/// Told of progress: a step, how much of it is done and how much there is.
pub type Progress<'a> = &'a (dyn Fn(&str, u64, u64) + Sync);

/// The readings of a run, and what they were taken along.
#[derive(Debug, Clone, PartialEq)]
pub struct Run {
    /// Uncompensated, float and fixed.
    pub taken: Vec<Taken>,
    /// Which of rate, supply and acceleration are worth a column.
    pub has: [bool; 3],
    /// The profile's file, if there is one.
    pub profile: Option<PathBuf>,
    /// Every sample was simulated.
    pub continuous: bool,
}
