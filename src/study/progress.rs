//! How far a study is, and how long it still takes.

/// What is being done.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Step {
    /// Designs run for the fronts.
    Searching,
    /// Points run again.
    Verifying,
    /// Single words of the designs that answer are changed. How many runs that takes is not counted.
    Answering,
}

impl Step {
    /// What is being done, in words.
    pub fn name(self) -> &'static str {
        match self {
            Step::Searching => "searching",
            Step::Verifying => "verifying",
            Step::Answering => "weighing single words of the chosen designs",
        }
    }
}

/// How far a step is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Progress {
    /// What is being done.
    pub step: Step,
    /// Designs that have run.
    pub done: usize,
    /// Of which so many were not known before this run.
    pub new: usize,
    /// Designs in all.
    pub of: usize,
    /// They may be fewer: a search ends when its fronts do not change.
    pub at_most: bool,
}

/// Before it the speed so far says little, s (convention): the first designs are the fastest.
const TOLD_AFTER_S: f64 = 2.0;

impl Progress {
    /// A line for a terminal; `seconds` since the step began. The time left is that of the step's designs that are left, at the speed
    /// so far, and is not told before some have run. How long the steps after it take is not known.
    pub fn line(&self, seconds: f64) -> String {
        let name = self.step.name();
        let most = if self.at_most { "at most " } else { "" };
        let mut line = format!(
            "{name}: {} of {most}{} designs, {seconds:.0} s",
            self.done, self.of
        );
        if self.new > 0 && seconds >= TOLD_AFTER_S {
            let left = self.of.saturating_sub(self.done) as f64 * seconds / self.new as f64;
            line += &format!(", about {left:.0} s left of this step");
        }
        line
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_time_left_is_that_of_the_designs_left_at_the_speed_of_this_run() {
        let mut progress = Progress {
            step: Step::Searching,
            done: 300,
            new: 100,
            of: 6500,
            at_most: true,
        };
        // 200 were known from a run that was killed: 100 in 2 s, 6200 to go.
        let line = progress.line(2.0);
        assert_eq!(
            line,
            "searching: 300 of at most 6500 designs, 2 s, about 124 s left of this step"
        );
        assert!(!progress.line(1.9).contains("left"));
        progress = Progress {
            step: Step::Verifying,
            done: 0,
            new: 0,
            of: 40,
            at_most: false,
        };
        assert_eq!(progress.line(1.0), "verifying: 0 of 40 designs, 1 s");
    }
}
