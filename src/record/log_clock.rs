//! The clock of one topic of a log: which times are damage, and whether it began anew.
//!
//! A message waits until four more of its topic have come. A time that these do not agree with is damage, and only that
//! message is lost; a clock from whose new time they go on has restarted.

use std::collections::VecDeque;

/// Messages that a time is compared with.
const LATER: usize = 4;

/// A step of a clock that is no pause between two messages: us, and times the step before it.
const LEAP_US: u64 = 60_000_000;
const LEAP: u64 = 1000;

/// One sample of a message: a channel of the averager, its value in the column's unit, and how long before the message it
/// was taken, us.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Sample {
    pub channel: usize,
    pub value: f64,
    pub back_us: u64,
}

/// The samples of a message.
#[derive(Debug, Clone, Default, PartialEq)]
pub(super) struct Message {
    /// us since power-on, as the message says.
    pub time_us: u64,
    /// Byte of the log at which it begins.
    pub at: u64,
    pub samples: Vec<Sample>,
}

/// What a message turned out to be.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Judged {
    /// In order.
    Sound(Message),
    /// Its time is damage.
    Wrong(Message),
    /// In order, while the messages after this time, us, were not.
    Back(u64, Message),
    /// The clock goes on from an earlier time: from and to, us.
    Restarted(u64, u64, Message),
}

/// The clock of one topic.
#[derive(Debug, Default)]
pub(super) struct TopicClock {
    waiting: VecDeque<Message>,
    latest_us: Option<u64>,
    step_us: u64,
    /// Where it was before it leapt.
    before_leap_us: Option<u64>,
}

impl TopicClock {
    /// Takes a message, and gives the one that can be judged by now. Disorder within `row_us` is none.
    pub(super) fn push(&mut self, message: Message, row_us: u64) -> Option<Judged> {
        self.waiting.push_back(message);
        match self.waiting.len() > LATER {
            true => self.next(row_us),
            false => None,
        }
    }

    /// The next message, judged by those behind it; `None` when all were given.
    pub(super) fn next(&mut self, row_us: u64) -> Option<Judged> {
        let front = self.waiting.pop_front()?;
        let time = front.time_us;
        let not_before = |limit: u64| {
            let later = self.waiting.iter();
            later
                .filter(|m| m.time_us.saturating_add(row_us) >= limit)
                .count()
        };
        let count = self.waiting.len();
        let agree = not_before(time);
        let limit_us = LEAP_US.max(self.step_us.saturating_mul(LEAP));
        if let Some(latest) = self.latest_us
            && time.saturating_add(row_us) < latest
        {
            let from_there = self
                .waiting
                .iter()
                .filter(|m| m.time_us.saturating_add(row_us) < latest)
                .filter(|m| m.time_us.saturating_add(row_us) >= time)
                .count();
            if count < 2 || 2 * from_there <= count {
                return Some(Judged::Wrong(front));
            }
            if let Some(before) = self.before_leap_us
                && time.saturating_add(row_us) >= before
                && time.saturating_sub(before) <= limit_us.max(10 * self.step_us)
            {
                self.accept(time, before, limit_us);
                self.before_leap_us = None;
                return Some(Judged::Back(before, front));
            }
            return Some(Judged::Restarted(latest, time, front));
        }
        let sound = match (self.latest_us, self.waiting.front()) {
            (Some(latest), None) => time.saturating_sub(latest) <= limit_us,
            (None, None) => true,
            // At the end of a log few are left to agree.
            (Some(latest), Some(_)) => {
                let usual = time.saturating_sub(latest) <= limit_us && count < LATER;
                2 * agree >= count || usual
            }
            (None, Some(_)) => {
                let mut later: Vec<u64> = self.waiting.iter().map(|m| m.time_us).collect();
                later.sort_unstable();
                let steps = later.windows(2).map(|w| w[1].abs_diff(w[0]));
                let step = steps.min().unwrap_or(LEAP_US);
                let gaps = later.iter().map(|t| t.abs_diff(time));
                let gap = gaps.min().unwrap_or(0);
                2 * agree >= count && (gap <= row_us || gap <= 100 * step.min(LEAP_US))
            }
        };
        if !sound {
            return Some(Judged::Wrong(front));
        }
        let latest = self.latest_us.unwrap_or(time);
        self.accept(time, latest, limit_us);
        Some(Judged::Sound(front))
    }

    fn accept(&mut self, time: u64, latest: u64, limit_us: u64) {
        let step = time.saturating_sub(latest);
        if step > limit_us {
            self.before_leap_us = Some(latest);
        } else if step > 0 {
            self.step_us = step;
        }
        self.latest_us = Some(latest.max(time));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Times that are taken in the end, and how many were left out; `None` for a clock that restarted.
    fn taken(times: &[u64]) -> Option<(Vec<u64>, usize)> {
        let mut clock = TopicClock::default();
        let (mut kept, mut wrong) = (Vec::new(), 0);
        let mut see = |judged: Judged| match judged {
            Judged::Sound(m) => {
                kept.push(m.time_us);
                true
            }
            Judged::Wrong(_) => {
                wrong += 1;
                true
            }
            Judged::Back(after, m) => {
                let before = kept.len();
                kept.retain(|t| *t <= after);
                wrong += before - kept.len();
                kept.push(m.time_us);
                true
            }
            Judged::Restarted(..) => false,
        };
        for time_us in times {
            let message = Message {
                time_us: *time_us,
                ..Message::default()
            };
            if let Some(judged) = clock.push(message, 1_000_000)
                && !see(judged)
            {
                return None;
            }
        }
        while let Some(judged) = clock.next(1_000_000) {
            if !see(judged) {
                return None;
            }
        }
        Some((kept, wrong))
    }

    fn regular() -> Vec<u64> {
        (0..400).map(|k| 10_000_000 + 50_000 * k).collect()
    }

    #[test]
    fn a_time_that_later_ones_do_not_agree_with_is_left_out() {
        assert_eq!(taken(&regular()), Some((regular(), 0)));
        for at in [0, 1, 2, 3, 57, 200, 397, 398, 399] {
            for bad in [0, 17, 4_200_000_000_000_000_000, u64::MAX, 2_000_000_000] {
                for more in [None, Some(at + 2), Some(at + 4)] {
                    let mut times = regular();
                    times[at] = bad;
                    let more = more.filter(|i| *i < 395 && at > 3);
                    if let Some(i) = more {
                        times[i] = bad ^ 5;
                    }
                    let mut expected = regular();
                    expected.retain(|t| times.contains(t));
                    let wrong = 400 - expected.len();
                    assert_eq!(
                        taken(&times),
                        Some((expected, wrong)),
                        "{at} {bad} {more:?}"
                    );
                }
            }
        }
    }

    #[test]
    fn a_burst_of_wrong_times_is_left_out() {
        let mut times = regular();
        for (k, time) in times[100..120].iter_mut().enumerate() {
            *time = 4_200_000_000_000_000_000 + k as u64;
        }
        let (kept, wrong) = taken(&times).unwrap();
        assert_eq!((kept.len(), wrong), (380, 20));
    }

    #[test]
    fn a_pause_is_one_and_a_restart_is_one() {
        let mut times = regular();
        times[150..].iter_mut().for_each(|t| *t += 7_200_000_000);
        assert_eq!(taken(&times), Some((times.clone(), 0)));
        let again: Vec<u64> = regular().into_iter().chain(regular()).collect();
        assert_eq!(taken(&again), None);
    }
}
