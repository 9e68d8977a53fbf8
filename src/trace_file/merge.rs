//! Signals of several rates in the order of their samples.

use super::Trace;

/// Goes through the samples at which any signal has a value.
pub(super) struct Merge<'a> {
    trace: &'a Trace,
    /// By signal: how many of its values have been passed.
    passed: Vec<usize>,
    /// By signal: the index of its value at the sample that was returned last.
    here: Vec<Option<usize>>,
}

impl<'a> Merge<'a> {
    pub(super) fn new(trace: &'a Trace) -> Self {
        Merge {
            trace,
            passed: vec![0; trace.signals.len()],
            here: vec![None; trace.signals.len()],
        }
    }

    /// The next sample at which a signal has a value, and by signal the index of that value.
    pub(super) fn next(&mut self) -> Option<(u64, &[Option<usize>])> {
        let first = self.trace.first_sample;
        let due = |(signal, &passed): (&super::Signal, &usize)| {
            // Cannot overflow: `Trace::check` has seen the last one.
            (passed < signal.values.len())
                .then(|| first + (passed as u64 + 1) * u64::from(signal.every) - 1)
        };
        let signals = || self.trace.signals.iter().zip(&self.passed);
        let sample = signals().filter_map(due).min()?;
        let is_here: Vec<bool> = signals().map(|s| due(s) == Some(sample)).collect();
        for ((here, passed), is_here) in self.here.iter_mut().zip(&mut self.passed).zip(is_here) {
            *here = is_here.then_some(*passed);
            *passed += usize::from(is_here);
        }
        Some((sample, &self.here))
    }
}
