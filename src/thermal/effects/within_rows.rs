//! The applied rate within a row: a reading is a mean over its row, in which the rate may move.

use super::map;
use crate::thermal::channels::Channels;

/// Distance of two rows, in the record's periods, beyond which nobody knows how the rate came from one to the other.
const APART: f64 = 1.5;

/// Share of the rows in which a rate has to move for means to be another thing than readings, and the share of its range by
/// which.
const OFTEN: f64 = 0.5;
const MUCH: f64 = 1e-3;

/// Share of the rates by which they may differ for the mean of a function over them to be its value.
const STILL: f64 = 1e-9;

/// The applied rate, deg/s, of each row at its beginning, its middle and its end: half way to its neighbours.
pub(super) struct Within(Vec<[f64; 3]>);

impl Within {
    /// Of a record; at rest without the channel.
    pub(super) fn of(c: &Channels) -> Self {
        let rate = match c.column("rate_dps") {
            Some(rate) => rate.to_vec(),
            None => map(&c.time_s, |_| 0.0),
        };
        let longest_s = APART * c.period_s();
        let half_way = |k: usize, other: Option<usize>| -> f64 {
            let near = other.filter(|o| (c.time_s[*o] - c.time_s[k]).abs() <= longest_s);
            near.map_or(rate[k], |o| 0.5 * (rate[k] + rate[o]))
        };
        let after = |k: usize| Some(k + 1).filter(|next| *next < rate.len());
        let rows = 0..rate.len();
        let each = rows.map(|k| {
            [
                half_way(k, k.checked_sub(1)),
                rate[k],
                half_way(k, after(k)),
            ]
        });
        Within(each.collect())
    }

    /// Whether the rate moves in most rows, as a table's does that swings.
    pub(super) fn moves(c: &Channels) -> bool {
        let rows = Within::of(c).0;
        let top = rows.iter().fold(0.0, |m: f64, r| m.max(r[1].abs()));
        let moved = |r: &&[f64; 3]| (r[2] - r[0]).abs() > MUCH * top;
        let count = rows.iter().filter(moved).count();
        count as f64 > OFTEN * rows.len() as f64
    }

    /// Means over each row of a function of the rate, given with its integral from 0: the rate goes straight from the row's beginning
    /// to its middle and from there to its end.
    pub(super) fn means(
        &self,
        value: impl Fn(f64) -> f64,
        integral: impl Fn(f64) -> f64,
    ) -> Vec<f64> {
        let over = |from: f64, to: f64| match (to - from).abs() <= STILL * from.abs().max(to.abs())
        {
            true => value(0.5 * (from + to)),
            false => (integral(to) - integral(from)) / (to - from),
        };
        let rows = self.0.iter();
        rows.map(|[from, at, to]| 0.5 * (over(*from, *at) + over(*at, *to)))
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeMap;

    fn swinging(time_s: &[f64], rate: impl Fn(f64) -> f64) -> Channels {
        let column = |f: &dyn Fn(f64) -> f64| time_s.iter().map(|t| f(*t)).collect::<Vec<f64>>();
        let columns = BTreeMap::from([
            ("rate_out_dps".to_owned(), column(&|t| rate(t) + 0.1)),
            ("rate_dps".to_owned(), column(&rate)),
            ("die_degc".to_owned(), column(&|t| 20.0 + t)),
        ]);
        Channels::new(time_s, &columns, "die_degc", |t| t).unwrap()
    }

    #[test]
    fn means_are_those_of_the_function_over_the_row() {
        let time_s: Vec<f64> = (0..40).map(f64::from).collect();
        let c = swinging(&time_s, |t| (0.7 * t).sin());
        assert!(Within::moves(&c));
        let clip = |o: f64| o.clamp(-0.3, 0.3);
        let integral = |o: f64| {
            let within = o.abs().min(0.3);
            0.5 * within * within + 0.3 * (o.abs() - within)
        };
        let means = Within::of(&c).means(clip, integral);
        for (k, mean) in means.iter().enumerate().take(39).skip(1) {
            let at = |t: f64| (0.7 * t).sin();
            let (before, own, after) = (at(k as f64 - 1.0), at(k as f64), at(k as f64 + 1.0));
            let steps = 2000;
            let sum: f64 = (0..steps)
                .map(|i| {
                    // From half way before the row to half way behind it.
                    let t = (f64::from(i) + 0.5) / f64::from(steps) - 0.5;
                    clip(own + t.abs() * if t < 0.0 { before - own } else { after - own })
                })
                .sum();
            assert!((mean - sum / f64::from(steps)).abs() < 1e-6, "{k}");
        }
    }

    #[test]
    fn a_rate_that_stands_still_has_its_value_and_gaps_are_not_crossed() {
        let mut time_s: Vec<f64> = (0..40).map(f64::from).collect();
        for t in &mut time_s[20..] {
            *t += 100.0;
        }
        let c = swinging(&time_s, |t| if t < 50.0 { 3.0 } else { -5.0 });
        assert!(!Within::moves(&c));
        let own = Within::of(&c).means(|o| o, |o| 0.5 * o * o);
        assert_eq!(own, c.column("rate_dps").unwrap());
    }
}
