//! A correction over the readings of a record, bit-accurately and without quantisation.

use super::block::{State, Step};
use super::bound;
use super::formats::Formats;
use super::plan::Plan;
use crate::error::{InputError, Result};
use crate::numeric::arithmetic::Block;
use crate::numeric::fixed::{Fixed, Words};
use crate::numeric::float::Float;
use crate::numeric::format::{Format, pow2};
use crate::numeric::rows::WordRows;
use crate::numeric::trace::Trace;
use crate::numeric::trace::ir::Program;
use crate::record::thermal::ThermalRecord;

/// Most steps that one reading takes, whatever the gap before it.
pub const MOST_STEPS: u64 = 1 << 16;

/// One reading.
#[derive(Debug, Clone, PartialEq)]
pub struct Reading {
    /// s; since power-on if there is no `time_since_power_on_s`.
    pub time_s: f64,
    /// s; falls at each power-on.
    pub time_since_power_on_s: Option<f64>,
    /// In the order of [`Plan::inputs`], in the columns' units; NaN: the word before is held (at first,
    /// x = 0).
    pub inputs: Vec<f64>,
    /// deg/s, before the correction; NaN = not measured.
    pub rate_out_dps: f64,
}

/// The readings of a record for a plan.
///
/// # Errors
/// An input that the record lacks.
pub fn readings(plan: &Plan, record: &ThermalRecord) -> Result<Vec<Reading>> {
    let column = |name: &str| -> Result<&[f64]> {
        let missing = || {
            let what = format!("the record has no column `{name}`, which the correction reads");
            InputError::new(what)
                .in_file(&record.source)
                .help("name the column in `[record.columns]`, or give a record that has it")
        };
        Ok(record.column(name).ok_or_else(missing)?)
    };
    let inputs: Result<Vec<&[f64]>> = plan.inputs.iter().map(|i| column(&i.column)).collect();
    let (inputs, rate) = (inputs?, column("rate_out_dps")?);
    let since = record.column("time_since_power_on_s");
    let at = |column: &[f64], row: usize| column.get(row).copied().unwrap_or(f64::NAN);
    let rows = record.time_s.iter().enumerate();
    Ok(rows
        .map(|(row, time)| Reading {
            time_s: *time,
            time_since_power_on_s: since.map(|s| at(s, row)).filter(|t| !t.is_nan()),
            inputs: inputs.iter().map(|c| at(c, row)).collect(),
            rate_out_dps: at(rate, row),
        })
        .collect())
}

/// Steps that a reading takes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Steps {
    /// Before the others, without a restart: for the time without power.
    pub unpowered: u64,
    /// The first of the `count` restarts.
    pub restart: bool,
    /// At least 1.
    pub count: u64,
}

impl Steps {
    /// Whether each of them restarts, in their order.
    pub fn restarts(self) -> impl Iterator<Item = bool> {
        let all = self.unpowered + self.count;
        (0..all).map(move |n| self.restart && n == self.unpowered)
    }
}

/// When the correction steps: so often that the number of steps since power-on is the time since then
/// in nominal periods, rounded; at least once and at most [`MOST_STEPS`] times a reading, which steps with
/// the same words each time. A reading at power-on takes one step, a first reading later than that
/// takes those that would have come before it. If a state outlives restarts ([`Plan::keeps`]), the time without power
/// is stepped through as well, as far as `time_s` tells it, the restart being the last of these steps.
pub fn schedule(plan: &Plan, readings: &[Reading]) -> Vec<Steps> {
    // Steps after the restart, and the clock they are counted by.
    let mut done = 0u64;
    let mut clock_at_restart_s = 0.0;
    let mut before: Option<(f64, f64)> = None;
    let periods = |time_s: f64| (time_s / plan.period_s).round().max(0.0) as u64;
    let one = |reading: &Reading| {
        let now = reading.time_since_power_on_s.unwrap_or(reading.time_s);
        // A clock that falls has restarted. A record without the second clock has one power-on.
        let restart = before.is_none_or(|(on_s, _)| now < on_s);
        let since = before.replace((now, reading.time_s));
        let mut unpowered = 0;
        if restart {
            done = 0;
            clock_at_restart_s = now.min(0.0);
            if let (Some((_, time_s)), true) = (since, plan.keeps()) {
                let without = reading.time_s - (now - clock_at_restart_s) - time_s;
                unpowered = periods(without).saturating_sub(1);
            }
        }
        let due = periods(now - clock_at_restart_s);
        let least = if restart { 0 } else { done + 1 };
        let target = due.max(least);
        let count = target - done + u64::from(restart);
        done = target;
        Steps {
            unpowered: unpowered.min(MOST_STEPS),
            restart,
            count: count.clamp(1, MOST_STEPS),
        }
    };
    readings.iter().map(one).collect()
}

/// A plan compiled to firmware's words, with its model.
#[derive(Debug, Clone)]
pub struct Correction {
    /// What was asked.
    pub plan: Plan,
    /// The words.
    pub formats: Formats,
    /// What it leaves, bit for bit, of readings that its coefficients have not seen, deg/s rms; `None` where nobody measured it.
    pub heldout_rms_dps: Option<f64>,
    step: Step,
    bound_dps: f64,
}

impl Correction {
    /// Compiles a plan.
    ///
    /// # Errors
    /// A plan that cannot become firmware, with the rule ([`Plan::check`]).
    pub fn new(plan: &Plan, formats: &Formats) -> Result<Self> {
        Ok(Correction {
            step: Step::new(plan, formats)?,
            bound_dps: bound::bound_dps(plan, formats),
            plan: plan.clone(),
            formats: formats.clone(),
            heldout_rms_dps: None,
        })
    }

    /// Compiles a plan with words for its default noise ([`Formats::auto`]).
    ///
    /// # Errors
    /// As [`Correction::new`] and [`Formats::choose`].
    pub fn auto(plan: &Plan) -> Result<Self> {
        plan.check()?;
        Correction::new(plan, &Formats::auto(plan)?)
    }

    /// At most so far is a fixed-point reading from the plan in real numbers, deg/s, if inputs and rate
    /// are within their words and no relay switches at another reading.
    pub fn bound_dps(&self) -> f64 {
        self.bound_dps
    }

    /// The step as a block.
    pub fn step(&self) -> &Step {
        &self.step
    }

    /// An input's word, raw: x rounded to nearest and held within its format; 0 for a NaN.
    pub fn input_raw(&self, input: usize, value: f64) -> i128 {
        let format = self.formats.inputs.get(input);
        format.map_or(0, |f| rounded(self.scaled(input, value), *f))
    }

    /// The rate's word, raw, rounded to nearest and saturated; 0 for a NaN.
    pub fn rate_raw(&self, rate_dps: f64) -> i128 {
        rounded(rate_dps, self.formats.rate)
    }

    fn scaled(&self, input: usize, value: f64) -> f64 {
        let i = self.plan.inputs.get(input);
        i.map_or(0.0, |i| (value - i.offset) / i.scale)
    }

    /// What the emitted function is called with for these readings: restart, inputs, rate; and for each
    /// reading the number of its last call.
    pub fn calls(&self, readings: &[Reading]) -> (WordRows, Vec<usize>) {
        let mut calls = WordRows::new(self.plan.inputs.len() + 2);
        let mut last = Vec::new();
        let mut held = vec![0; self.plan.inputs.len()];
        for (reading, steps) in readings.iter().zip(schedule(&self.plan, readings)) {
            for (k, (word, value)) in held.iter_mut().zip(&reading.inputs).enumerate() {
                if !value.is_nan() {
                    *word = self.input_raw(k, *value);
                }
            }
            for restart in steps.restarts() {
                let rate = self.rate_raw(reading.rate_out_dps);
                let restart = i128::from(restart);
                calls.push(
                    [restart]
                        .into_iter()
                        .chain(held.iter().copied())
                        .chain([rate]),
                );
            }
            last.push(calls.len().saturating_sub(1));
        }
        (calls, last)
    }

    /// The model's output word for each call, from the state before the first reading.
    pub fn run_words(&self, calls: &WordRows) -> Vec<i64> {
        let mut stepper = self.stepper();
        let mut words = Vec::new();
        let one = |row: &[i64]| {
            words.clear();
            words.extend(row.iter().map(|word| i128::from(*word)));
            stepper.corrected(&words) as i64
        };
        calls.iter().map(one).collect()
    }

    /// The bit-accurate model, call by call from the state before the first reading.
    pub fn stepper(&self) -> Stepper<'_> {
        Stepper {
            step: &self.step,
            ar: Fixed::new(),
            state: self.step.state(),
        }
    }

    /// The corrected rate of each reading as firmware computes it, deg/s; NaN where the rate is.
    pub fn run(&self, readings: &[Reading]) -> Vec<f64> {
        let (calls, last) = self.calls(readings);
        let words = self.run_words(&calls);
        let lsb = self.formats.rate.lsb();
        let of = |(reading, k): (&Reading, &usize)| match words.get(*k) {
            Some(word) if !reading.rate_out_dps.is_nan() => *word as f64 * lsb,
            _ => f64::NAN,
        };
        readings.iter().zip(&last).map(of).collect()
    }

    /// The same without quantisation: neither of inputs nor rate nor of any step; the constants are
    /// firmware's.
    pub fn run_float(&self, readings: &[Reading]) -> Vec<f64> {
        let mut state: State<Float> = self.step.state();
        let mut held = vec![0.0; self.plan.inputs.len()];
        let steps = schedule(&self.plan, readings);
        let mut results = Vec::with_capacity(readings.len());
        for (reading, steps) in readings.iter().zip(steps) {
            for (k, (x, value)) in held.iter_mut().zip(&reading.inputs).enumerate() {
                if !value.is_nan() {
                    let highest = self.formats.inputs.get(k).map_or(1.0, |f| 1.0 - f.lsb());
                    *x = self.scaled(k, *value).clamp(-1.0, highest);
                }
            }
            let mut result = f64::NAN;
            for restart in steps.restarts() {
                let restart = f64::from(u8::from(restart));
                let rate = reading.rate_out_dps;
                result = self.step.run(&Float, &mut state, restart, &held, rate);
            }
            results.push(result);
        }
        results
    }

    /// The step as a program of integer operations.
    pub fn trace(&self) -> Program {
        let trace = Trace::new();
        match self.plan.inputs.len() {
            0 => record::<2>(&self.step, &trace),
            1 => record::<3>(&self.step, &trace),
            2 => record::<4>(&self.step, &trace),
            3 => record::<5>(&self.step, &trace),
            4 => record::<6>(&self.step, &trace),
            5 => record::<7>(&self.step, &trace),
            6 => record::<8>(&self.step, &trace),
            7 => record::<9>(&self.step, &trace),
            _ => record::<10>(&self.step, &trace),
        }
        trace.finish()
    }
}

/// The model of a function with a state, called once a reading.
pub trait Calls {
    /// Appends the outputs of the next call.
    fn call(&mut self, words: &[i128], outputs: &mut Vec<i128>);
    /// The state, word by word in the order of its type.
    fn state(&mut self) -> Vec<i128>;
}

/// The bit-accurate model of a correction with its state.
#[derive(Debug)]
pub struct Stepper<'a> {
    step: &'a Step,
    ar: Fixed<i128, i128>,
    state: State<Fixed<i128, i128>>,
}

impl Stepper<'_> {
    /// The corrected rate of the next call.
    pub fn corrected(&mut self, words: &[i128]) -> i128 {
        match words {
            [restart, inputs @ .., rate] => {
                self.step
                    .run(&self.ar, &mut self.state, *restart, inputs, *rate)
            }
            _ => 0,
        }
    }
}

impl Calls for Stepper<'_> {
    fn call(&mut self, words: &[i128], outputs: &mut Vec<i128>) {
        outputs.push(self.corrected(words));
    }

    fn state(&mut self) -> Vec<i128> {
        let mut words = Words::default();
        Block::<_, 2, 1>::visit(self.step, &mut self.state, &mut words);
        words.0
    }
}

fn record<const I: usize>(step: &Step, trace: &Trace) {
    let ranges = step.ranges();
    if let Ok(ranges) = ranges.try_into() {
        let state: <Step as Block<Trace, I, 1>>::State = step.state::<Trace>();
        trace.record::<I, 1, Step>(step, &state, ranges);
    }
}

fn rounded(value: f64, format: Format) -> i128 {
    let word = (value * pow2(format.fraction_bits as i32)).round();
    // A NaN becomes 0.
    (word as i128).clamp(format.min_raw(), format.max_raw())
}

#[cfg(test)]
#[path = "schedule_tests.rs"]
mod tests;
