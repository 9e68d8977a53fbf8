//! The stages of a command: their clock, and on a terminal a bar of the one that runs.

use super::terminal::{Loudness, is_said};
use crate::error::Result;
use crate::output::Results;
use crate::timing::Stopwatch;
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use std::io::IsTerminal;
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

/// What runs shorter than this is not shown, s (convention).
const SHOWN_AFTER: Duration = Duration::from_millis(700);

/// The bar that is drawn, if one is: lines are printed above it.
static DRAWN: Mutex<Option<ProgressBar>> = Mutex::new(None);

/// Prints with the bar out of the way.
pub fn aside(print: impl FnOnce()) {
    let drawn = DRAWN.lock().unwrap_or_else(PoisonError::into_inner);
    match &*drawn {
        Some(bar) => bar.suspend(print),
        None => print(),
    }
}

/// The stages of a command. Where stderr is a terminal, the stage that runs is shown with the time that it takes, and
/// with rate and time left where its size is known; gone when the work is over.
pub struct Stages {
    watch: Stopwatch,
    state: Mutex<State>,
}

struct State {
    stage: String,
    began: Instant,
}

impl Stages {
    /// Starts the clock and the first stage.
    pub fn start(stage: &str) -> Self {
        let stages = Stages {
            watch: Stopwatch::start(stage),
            state: Mutex::new(State {
                stage: stage.to_owned(),
                began: Instant::now(),
            }),
        };
        stages.draw(stage);
        stages
    }

    /// Ends the stage that runs and begins another, or goes on with the one that runs if it has this name.
    pub fn stage(&self, stage: &str) {
        {
            let mut state = self.state.lock().unwrap_or_else(PoisonError::into_inner);
            if state.stage == stage {
                return;
            }
            if is_said(Loudness::Verbose) {
                talk!(
                    "{}: {:.2} s",
                    state.stage,
                    state.began.elapsed().as_secs_f64()
                );
            }
            state.stage = stage.to_owned();
            state.began = Instant::now();
        }
        self.watch.stage(stage);
        self.draw(stage);
    }

    /// How much of the stage that runs is done, `of` in all where that is known.
    pub fn at(&self, done: u64, of: Option<u64>) {
        let drawn = DRAWN.lock().unwrap_or_else(PoisonError::into_inner);
        let Some(bar) = &*drawn else { return };
        if let (Some(of), None) = (of, bar.length()) {
            bar.set_style(style(
                "{msg} {bar:24} {human_pos} of {human_len}, {per_sec}, {eta} left",
            ));
            bar.set_length(of);
        }
        bar.set_position(done);
    }

    /// What the stage that runs is at, in words that say the time too.
    pub fn says(&self, words: &str) {
        let drawn = DRAWN.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(bar) = &*drawn {
            bar.set_style(style("{spinner} {msg}"));
            bar.set_message(words.to_owned());
        }
    }

    /// Adds `timing.json` to the results; what is left to do is not shown any more.
    ///
    /// # Errors
    /// A failed write.
    pub fn write(&self, results: &mut Results, design_sha256: &str, command: &str) -> Result<()> {
        self.watch.write(results, design_sha256, command)?;
        self.over();
        Ok(())
    }

    /// Nothing is shown any more.
    pub fn over(&self) {
        let drawn = DRAWN.lock().unwrap_or_else(PoisonError::into_inner).take();
        if let Some(bar) = drawn {
            bar.finish_and_clear();
        }
    }

    fn draw(&self, stage: &str) {
        self.over();
        if !std::io::stderr().is_terminal() || !is_said(Loudness::Usual) {
            return;
        }
        let bar = ProgressBar::with_draw_target(None, ProgressDrawTarget::hidden());
        bar.set_style(style("{spinner} {msg}, {elapsed}"));
        bar.set_message(stage.to_owned());
        let shown = bar.clone();
        *DRAWN.lock().unwrap_or_else(PoisonError::into_inner) = Some(bar);
        std::thread::spawn(move || {
            std::thread::sleep(SHOWN_AFTER);
            let drawn = DRAWN.lock().unwrap_or_else(PoisonError::into_inner);
            if drawn.is_some() && !shown.is_finished() {
                shown.set_draw_target(ProgressDrawTarget::stderr());
                shown.enable_steady_tick(Duration::from_millis(100));
            }
        });
    }
}

impl Drop for Stages {
    fn drop(&mut self) {
        self.over();
    }
}

fn style(template: &str) -> ProgressStyle {
    // The templates stand in this file.
    ProgressStyle::with_template(template).unwrap_or_else(|_| ProgressStyle::default_bar())
}
