//! Samples of an autopilot's log, averaged into the rows of a thermal record while they are read:
//! what is kept grows with the rows, not with the samples.

use super::error_values::{self, Kind};
use super::log_bytes::Damage;
use super::log_clock::{Judged, Message, TopicClock};
use super::log_rows::{self, Choice};
use super::thermal::ThermalRecord;
use super::warning::Warning;
use crate::design::RecordMapping;
use crate::error::Result;
use std::collections::BTreeMap;
use std::path::Path;

/// s of samples in a row of a log, where the design does not say.
pub(super) const AVERAGE_S: f64 = 1.0;

/// m/s^2 in one g, exact (CGPM 1901).
pub(super) const STANDARD_GRAVITY: f64 = 9.806_65;

/// Kinds of samples that one row can hold apart; more are added to the last.
const MOST_KINDS: usize = 6;

/// A quantity of the log that can become a column of the record.
#[derive(Debug, Clone)]
pub(super) struct Channel {
    /// The contract's column.
    pub column: &'static str,
    /// What the log calls it, such as `sensor_gyro.z`.
    pub source: String,
    /// The topic that it is from, as [`Averager::topic`] numbered it.
    pub topic: usize,
    /// At most three different samples: fewer are no measurement.
    seen: Vec<f64>,
    /// Samples that were taken.
    pub samples: u64,
}

impl Channel {
    /// Whether its samples are all alike, or take two values in turn.
    pub(super) fn is_dead(&self) -> bool {
        self.samples > 0 && self.seen.len() < 3
    }

    /// The different samples, at most three.
    pub(super) fn seen(&self) -> &[f64] {
        &self.seen
    }
}

/// The sum of the samples of one channel in one row.
#[derive(Debug, Clone, Default)]
pub(super) struct Sum {
    pub count: u32,
    pub value: f64,
    /// us since the row's start.
    pub time: f64,
    first: f64,
    /// Whether one of its samples differs from the first.
    differ: bool,
    /// Samples of another size, which one second of a die does not make.
    others: Vec<Sum>,
}

impl Sum {
    fn add(&mut self, value: f64, time: f64) {
        if self.count == 0 {
            self.first = value;
        }
        self.differ |= value != self.first;
        self.count += 1;
        self.value += value;
        self.time += time;
    }

    /// The same, apart from samples that are further off than `within`.
    fn add_near(&mut self, value: f64, time: f64, within: f64) {
        let near = |s: &Sum| s.count == 0 || (value - s.mean()).abs() <= within;
        if near(self) {
            return self.add(value, time);
        }
        let full = self.others.len() >= MOST_KINDS;
        let found = self.others.iter().position(near);
        let found = found.or(full.then(|| self.others.len() - 1));
        match found.and_then(|i| self.others.get_mut(i)) {
            Some(other) => other.add(value, time),
            None => {
                let mut other = Sum::default();
                other.add(value, time);
                self.others.push(other);
            }
        }
    }

    /// The mean; the value itself where all samples are the same.
    pub(super) fn mean(&self) -> f64 {
        match self.differ {
            true => self.value / f64::from(self.count),
            false => self.first,
        }
    }
}

/// How far apart two samples of one row can be, and be readings.
fn within(column: &str) -> Option<f64> {
    match column {
        "die_degc" => Some(5.0),
        "supply_v" => Some(1.0),
        _ => None,
    }
}

/// What became of a topic's clock.
#[derive(Debug, Default)]
pub(super) struct Topic {
    pub name: String,
    clock: TopicClock,
    /// Messages with a wrong time, the first of them: s, byte.
    pub wrong: u64,
    pub first_wrong: Option<(f64, u64)>,
    /// A clock that began anew, and was read no further: from, to, s, byte.
    pub restarted: Option<(f64, f64, u64)>,
}

/// Averages samples into rows. Channels of one column are alternatives.
pub(super) struct Averager {
    pub channels: Vec<Channel>,
    pub topics: Vec<Topic>,
    pub period_us: u64,
    /// By number of the row, counted from power-on.
    pub rows: BTreeMap<u64, Vec<Sum>>,
    /// The row that samples go to at the moment.
    number: u64,
    row: Vec<Sum>,
    /// The time of the message that was taken last, us.
    pub now_us: u64,
}

impl Averager {
    /// From the first to the last sample of a channel, s, as evenly spaced samples have it; `rows` are those with any.
    pub(super) fn span_s(&self, channel: usize, rows: &[u64]) -> f64 {
        let period_us = self.period_us as f64;
        let at = |number: &u64| -> Option<(f64, f64)> {
            let sum = self.rows.get(number)?.get(channel)?;
            Some((*number as f64 * period_us, sum.time / f64::from(sum.count)))
        };
        let (Some((first_us, mean_us)), Some(last)) = (rows.first().and_then(at), rows.last())
        else {
            return 0.0;
        };
        let end_us = (self.now_us as f64).min((*last + 1) as f64 * period_us);
        // Even samples lie on both sides of their mean alike: that says where in its row the log began.
        let began_us = (2.0 * mean_us - period_us.min(end_us - first_us)).max(0.0);
        (end_us - first_us - began_us) * 1e-6
    }

    /// For the design's `average_s`.
    pub(super) fn new(mapping: &RecordMapping) -> Self {
        let period = mapping.average_s.unwrap_or(AVERAGE_S) * 1e6;
        Averager {
            channels: Vec::new(),
            topics: Vec::new(),
            period_us: (period.round() as u64).max(1),
            rows: BTreeMap::new(),
            number: 0,
            row: Vec::new(),
            now_us: 0,
        }
    }

    /// A topic with a clock of its own.
    pub(super) fn topic(&mut self, name: String) -> usize {
        self.topics.push(Topic {
            name,
            ..Topic::default()
        });
        self.topics.len() - 1
    }

    /// A channel of a topic.
    pub(super) fn channel(&mut self, topic: usize, column: &'static str, source: String) -> usize {
        self.channels.push(Channel {
            column,
            source,
            topic,
            seen: Vec::new(),
            samples: 0,
        });
        self.channels.len() - 1
    }

    /// Takes a message of a topic.
    pub(super) fn take(&mut self, topic: usize, message: Message) {
        let period_us = self.period_us;
        let Some(of) = self.topics.get_mut(topic) else {
            return;
        };
        if of.restarted.is_none()
            && let Some(judged) = of.clock.push(message, period_us)
        {
            self.judged(topic, judged);
        }
    }

    /// Takes what still waits; nothing is added afterwards.
    pub(super) fn seal(&mut self) {
        for topic in 0..self.topics.len() {
            while let Some(judged) = self.next(topic) {
                self.judged(topic, judged);
            }
        }
        self.turn_to(u64::MAX);
    }

    fn next(&mut self, topic: usize) -> Option<Judged> {
        let of = self.topics.get_mut(topic)?;
        match of.restarted {
            Some(_) => None,
            None => of.clock.next(self.period_us),
        }
    }

    fn judged(&mut self, topic: usize, judged: Judged) {
        match judged {
            Judged::Sound(message) => self.add(&message),
            Judged::Wrong(message) => self.wrong(topic, 1, &message),
            Judged::Back(after_us, message) => {
                let lost = self.forget(topic, after_us);
                self.wrong(topic, lost, &message);
                self.add(&message);
            }
            Judged::Restarted(from, to, message) => {
                if let Some(of) = self.topics.get_mut(topic) {
                    of.restarted = Some((from as f64 * 1e-6, to as f64 * 1e-6, message.at));
                }
            }
        }
    }

    fn wrong(&mut self, topic: usize, count: u64, message: &Message) {
        if let Some(of) = self.topics.get_mut(topic) {
            of.wrong += count;
            let first = (message.time_us as f64 * 1e-6, message.at);
            of.first_wrong.get_or_insert(first);
        }
    }

    /// Takes the samples of a topic after a time out again: how many.
    fn forget(&mut self, topic: usize, after_us: u64) -> u64 {
        self.turn_to(0);
        let mut lost = 0;
        let first = after_us / self.period_us + 1;
        for row in self.rows.range_mut(first..).map(|r| r.1) {
            for (sum, channel) in row.iter_mut().zip(&mut self.channels) {
                if channel.topic == topic {
                    lost += u64::from(sum.count);
                    channel.samples -= u64::from(sum.count).min(channel.samples);
                    *sum = Sum::default();
                }
            }
        }
        self.rows.retain(|_, row| row.iter().any(|s| s.count > 0));
        lost
    }

    fn add(&mut self, message: &Message) {
        self.now_us = message.time_us;
        for sample in &message.samples {
            if !sample.value.is_finite() {
                continue;
            }
            let time_us = message.time_us.saturating_sub(sample.back_us);
            let number = time_us / self.period_us;
            if number != self.number {
                self.turn_to(number);
            }
            if self.row.len() < self.channels.len() {
                self.row.resize_with(self.channels.len(), Sum::default);
            }
            let place = self.row.get_mut(sample.channel);
            let Some((sum, channel)) = place.zip(self.channels.get_mut(sample.channel)) else {
                continue;
            };
            channel.samples += 1;
            if channel.seen.len() < 3 && !channel.seen.contains(&sample.value) {
                channel.seen.push(sample.value);
            }
            let inside = (time_us % self.period_us) as f64;
            match within(channel.column) {
                Some(limit) => sum.add_near(sample.value, inside, limit),
                None => sum.add(sample.value, inside),
            }
        }
    }

    /// Puts the present row away and takes the one of that number up.
    fn turn_to(&mut self, number: u64) {
        let next = self.rows.remove(&number).unwrap_or_default();
        let done = std::mem::replace(&mut self.row, next);
        if done.iter().any(|s| s.count > 0) {
            match self.rows.entry(self.number) {
                std::collections::btree_map::Entry::Vacant(e) => {
                    e.insert(done);
                }
                std::collections::btree_map::Entry::Occupied(_) => {}
            }
        }
        self.number = number;
    }

    /// The rows in which a channel has samples.
    pub(super) fn rows_of(&self, channel: usize) -> impl Iterator<Item = (u64, &Sum)> {
        self.rows.iter().filter_map(move |(number, row)| {
            let sum = row.get(channel)?;
            (sum.count > 0).then_some((*number, sum))
        })
    }

    /// Takes error values out of the samples of a column.
    pub(super) fn without_error_values(&mut self, channel: usize) -> Option<Warning> {
        let column = self.channels.get(channel)?.column;
        let kind = error_values::kind_of(column)?;
        within(column)?;
        let (mut rows, mut time_s, mut values) = (Vec::new(), Vec::new(), Vec::new());
        for (number, sum) in self.rows_of(channel) {
            let mut all: Vec<(f64, f64, usize)> = std::iter::once(sum)
                .chain(&sum.others)
                .enumerate()
                .map(|(i, s)| (s.time / f64::from(s.count), s.mean(), i))
                .collect();
            all.sort_by(|a, b| a.0.total_cmp(&b.0));
            for (inside, value, i) in all {
                rows.push((number, i));
                time_s.push(((number * self.period_us) as f64 + inside) * 1e-6);
                values.push(value);
            }
        }
        let marks = error_values::marks(&time_s, &values, kind);
        // Of samples and rows as the log has them; what is left is less.
        let all = self.rows_of(channel).count();
        let of_part = |number: u64, part: usize| -> Option<u32> {
            let sum = self.rows.get(&number)?.get(channel)?;
            let part = match part.checked_sub(1) {
                None => sum,
                Some(i) => sum.others.get(i)?,
            };
            Some(part.count)
        };
        let counts: Vec<usize> = rows
            .iter()
            .map(|(number, part)| of_part(*number, *part).unwrap_or(1) as usize)
            .collect();
        self.leave_out(channel, &rows, &values, &marks, kind);
        let marked = || marks.iter().zip(&time_s).filter(|(m, _)| **m).map(|m| *m.1);
        let (first, last) = (marked().next()?, marked().next_back()?);
        let parts = || (0..marks.len()).filter(|i| marks[*i]);
        let samples: usize = parts().map(|i| counts[i]).sum();
        let mut hit: Vec<u64> = parts().map(|i| rows[i].0).collect();
        hit.dedup();
        let cells = parts().flat_map(|i| std::iter::repeat_n(values[i], counts[i]));
        let (source, unit) = (
            &self.channels.get(channel)?.source,
            super::columns::unit_of(column),
        );
        Some(Warning::on(
            "error_values",
            column,
            format!(
                "{source} holds {} in {samples} {} of {} of {all} rows ({first:.1} to {last:.1} s since power-on), out of reach \
                 of the readings before and after: error values, no readings. They were left out",
                error_values::values_of(cells, unit),
                if samples == 1 { "sample" } else { "samples" },
                hit.len(),
            ),
        ))
    }

    /// Makes each row's sum that of its parts without a mark.
    fn leave_out(
        &mut self,
        channel: usize,
        parts: &[(u64, usize)],
        values: &[f64],
        marks: &[bool],
        kind: Kind,
    ) {
        let mut at = 0;
        while let Some((number, _)) = parts.get(at) {
            let end = at + parts[at..].iter().take_while(|p| p.0 == *number).count();
            let sum = self.rows.get_mut(number).and_then(|r| r.get_mut(channel));
            if let Some(sum) = sum {
                let whole = std::mem::take(sum);
                let mut all = vec![whole.clone()];
                all.extend(whole.others);
                let possible = |v: f64| (kind.possible.0..=kind.possible.1).contains(&v);
                for k in at..end {
                    let part = parts.get(k).and_then(|p| all.get(p.1));
                    if let (Some(part), false, true) = (part, marks[k], possible(values[k])) {
                        sum.differ |= part.differ || sum.count > 0;
                        sum.first = part.first;
                        sum.count += part.count;
                        sum.value += part.value;
                        sum.time += part.time;
                    }
                }
            }
            at = end;
        }
    }

    /// The record, checked like any other.
    ///
    /// # Errors
    /// Too few rows; a gyro that does not move; a clock of the gyro's that begins anew.
    pub(super) fn finish(
        mut self,
        path: &Path,
        mapping: &RecordMapping,
        damage: Damage,
        choice: Choice,
    ) -> Result<(ThermalRecord, Vec<Warning>)> {
        log_rows::record(&mut self, path, mapping, damage, choice)
    }
}
