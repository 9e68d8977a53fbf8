//! Wall times, which stand in `timing.json` alone: every other file has the same bytes for the same input.

use crate::error::Result;
use crate::output::Results;
use serde::Serialize;
use std::sync::Mutex;
use std::time::Instant;

/// The file's name.
pub const NAME: &str = "timing.json";

/// The clock of a command, from its start, stage by stage.
#[derive(Debug)]
pub struct Stopwatch {
    started: Instant,
    /// Stages in the order in which they began first, and the beginning of the one that runs.
    stages: Mutex<(Vec<Stage>, Instant)>,
}

/// What a part of the work took.
#[derive(Debug, Clone, PartialEq, Serialize, schemars::JsonSchema)]
pub struct Stage {
    /// What was done.
    pub stage: String,
    /// Wall time, s.
    pub seconds: f64,
}

/// `timing.json` (`gyrogen.timing/1`).
#[derive(Debug, Clone, PartialEq, Serialize, schemars::JsonSchema)]
pub struct Timing {
    /// `gyrogen.timing/1`.
    pub schema: &'static str,
    /// Of the tool.
    pub version: &'static str,
    /// Of the design, or of the request that stands in its place.
    pub design_sha256: String,
    /// The command.
    pub command: String,
    /// Wall time in all up to the writing of this file, s.
    pub seconds: f64,
    /// By stage.
    pub stages: Vec<Stage>,
}

impl Stopwatch {
    /// Starts the clock and its first stage.
    pub fn start(stage: &str) -> Self {
        let now = Instant::now();
        let first = Stage {
            stage: stage.to_owned(),
            seconds: 0.0,
        };
        Stopwatch {
            started: now,
            stages: Mutex::new((vec![first], now)),
        }
    }

    /// Ends the stage that runs and begins another, or goes on with the one that runs if it has this name.
    pub fn stage(&self, stage: &str) {
        // A poisoned lock means that another thread panics already.
        let Ok(mut stages) = self.stages.lock() else {
            return;
        };
        let (seen, began) = &mut *stages;
        if seen.last().is_some_and(|last| last.stage == stage) {
            return;
        }
        let now = Instant::now();
        close(seen, *began, now);
        *began = now;
        seen.push(Stage {
            stage: stage.to_owned(),
            seconds: 0.0,
        });
    }

    /// What has been measured up to now, for files of this design and command.
    pub fn timing(&self, design_sha256: &str, command: &str) -> Timing {
        let now = Instant::now();
        let mut stages = Vec::new();
        if let Ok(seen) = self.stages.lock() {
            stages.clone_from(&seen.0);
            close(&mut stages, seen.1, now);
        }
        Timing {
            schema: "gyrogen.timing/1",
            version: env!("CARGO_PKG_VERSION"),
            design_sha256: design_sha256.to_owned(),
            command: command.to_owned(),
            seconds: (now - self.started).as_secs_f64(),
            stages,
        }
    }

    /// Adds `timing.json` to the results.
    ///
    /// # Errors
    /// A failed write.
    pub fn write(&self, results: &mut Results, design_sha256: &str, command: &str) -> Result<()> {
        // A structure of strings and finite numbers always has a JSON form.
        let timing = self.timing(design_sha256, command);
        let text = serde_json::to_string_pretty(&timing).unwrap_or_default() + "\n";
        results.write(NAME, text.as_bytes())
    }
}

/// Adds what the last stage took.
fn close(stages: &mut [Stage], began: Instant, now: Instant) {
    if let Some(last) = stages.last_mut() {
        last.seconds += (now - began).as_secs_f64();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_stages_add_up_to_the_whole() {
        let watch = Stopwatch::start("read");
        watch.stage("work");
        watch.stage("work");
        std::thread::sleep(std::time::Duration::from_millis(3));
        watch.stage("write");
        let t = watch.timing("00", "gyrogen run");
        let names: Vec<&str> = t.stages.iter().map(|s| s.stage.as_str()).collect();
        assert_eq!(names, ["read", "work", "write"]);
        assert!(t.stages[1].seconds >= 0.003);
        let sum: f64 = t.stages.iter().map(|s| s.seconds).sum();
        assert!((sum - t.seconds).abs() < 1e-9, "{sum} {}", t.seconds);
    }
}
