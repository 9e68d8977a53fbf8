//! Thresholds: their likelihood is a staircase, flat between readings.

use super::judge::price;
use crate::thermal::channels::Channels;
use crate::thermal::effects::{Candidate, Point};

/// Gain within which points are as good as the best.
const FLAT: f64 = 0.2;

/// Turns over all thresholds.
const TURNS: usize = 3;

/// A point near `top`, with each threshold in the middle of the stair that gains most: it may lie anywhere
/// between two readings that were fitted, and the middle errs least on those that were not. Where
/// a candidate has no stairs: the middle of the plateau of `fine` around `top`.
pub fn settled(
    candidate: &dyn Candidate,
    c: &Channels,
    top: &Point,
    fine: &[(Point, f64)],
    gains: impl Fn(&[Point]) -> Vec<f64>,
) -> Point {
    let (axes, others) = candidate.stairs(c, top);
    if axes.is_empty() {
        return middle(top, fine, |p| one(&gains, p));
    }
    let (mut best, mut reached) = climbed(candidate, c, top, &gains);
    for other in others {
        let (point, there) = climbed(candidate, c, &other, &gains);
        // What costs less may gain less.
        if there - price(candidate, c, &point) > reached - price(candidate, c, &best) {
            (best, reached) = (point, there);
        }
    }
    best
}

fn one(gains: &impl Fn(&[Point]) -> Vec<f64>, point: &Point) -> f64 {
    let there = gains(std::slice::from_ref(point));
    there.first().copied().unwrap_or(f64::NEG_INFINITY)
}

/// Along each threshold in turn to the middle of its highest stair, and the gain there.
fn climbed(
    candidate: &dyn Candidate,
    c: &Channels,
    start: &Point,
    gains: &impl Fn(&[Point]) -> Vec<f64>,
) -> (Point, f64) {
    let mut best = start.clone();
    let mut reached = one(gains, &best);
    for _ in 0..TURNS {
        let before = best.clone();
        let axes = candidate.stairs(c, &best).0.len();
        for axis in 0..axes {
            let (stairs, _) = candidate.stairs(c, &best);
            let Some(along) = stairs.into_iter().nth(axis) else {
                continue;
            };
            let there = gains(&along);
            let highest = (0..there.len()).max_by(|a, b| there[*a].total_cmp(&there[*b]));
            let Some(top) = highest.filter(|k| there[*k] > reached - FLAT) else {
                continue;
            };
            let level = |k: &usize| there[*k] > there[top] - FLAT;
            let first = (0..=top).rev().take_while(level).last().unwrap_or(top);
            let last = (top..there.len()).take_while(level).last().unwrap_or(top);
            let mut point = along[first].clone();
            for (theta, end) in point.theta.iter_mut().zip(&along[last].theta) {
                *theta = 0.5 * (*theta + end);
            }
            let there = one(gains, &point);
            if there > reached - FLAT {
                (best, reached) = (point, there);
            }
        }
        if best == before {
            break;
        }
    }
    (best, reached)
}

/// The middle of the plateau of `fine` around a top.
fn middle(top: &Point, fine: &[(Point, f64)], gain: impl Fn(&Point) -> f64) -> Point {
    let reached = gain(top);
    let level: Vec<&Point> = fine
        .iter()
        .filter(|(p, there)| p.form == top.form && *there > reached - FLAT)
        .map(|(p, _)| p)
        .collect();
    if level.is_empty() {
        return top.clone();
    }
    let mut out = top.clone();
    for (k, theta) in out.theta.iter_mut().enumerate() {
        *theta = level.iter().map(|p| p.theta[k]).sum::<f64>() / level.len() as f64;
    }
    if gain(&out) > reached - FLAT {
        out
    } else {
        top.clone()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::thermal::effects::{Bias, Estimate, Missing, Reported, Sheet};
    use crate::thermal::search::judge::PRICE;
    use crate::thermal::synthetic::Random;
    use std::collections::BTreeMap;

    /// Thresholds on readings: form 0 has as many as there are parameters, form 1 one for all of them.
    struct Thresholds {
        readings: Vec<f64>,
        has_other: bool,
    }

    const SHEET: Sheet = Sheet {
        id: "thresholds",
        physics: "",
        equation: "",
        parameters: &[],
        compensable: false,
        confounders: &[],
        experiment: "",
        reference: "",
    };

    impl Thresholds {
        fn new(random: &mut Random, has_other: bool) -> Self {
            let mut readings: Vec<f64> = (0..40).map(|_| random.uniform()).collect();
            readings.sort_by(f64::total_cmp);
            Thresholds {
                readings,
                has_other,
            }
        }

        /// Readings below: the number of the stair.
        fn stair(&self, threshold: f64) -> usize {
            self.readings.partition_point(|r| *r < threshold)
        }

        /// Of every stair.
        fn middles(&self) -> impl Iterator<Item = f64> {
            self.readings.windows(2).map(|w| 0.5 * (w[0] + w[1]))
        }
    }

    impl Candidate for Thresholds {
        fn sheet(&self) -> &Sheet {
            &SHEET
        }
        fn channels(&self, _: &Channels) -> Result<Vec<String>, Missing> {
            Ok(Vec::new())
        }
        fn points(&self, _: &Channels) -> Vec<Point> {
            Vec::new()
        }
        fn columns(&self, _: &Channels, _: &Bias, _: &Point) -> Vec<Vec<f64>> {
            Vec::new()
        }
        fn report(&self, _: &Channels, _: &Estimate) -> Reported {
            Reported::new()
        }
        fn stairs(&self, _: &Channels, point: &Point) -> (Vec<Vec<Point>>, Vec<Point>) {
            let along = |axis: usize| {
                let moved = |threshold: f64| {
                    let mut point = point.clone();
                    point.theta[axis] = threshold;
                    point
                };
                self.middles().map(moved).collect()
            };
            let axes = (0..point.theta.len()).map(along).collect();
            let others = match self.has_other && point.form == 0 {
                true => vec![Point::at(1, &point.theta[..1])],
                false => Vec::new(),
            };
            (axes, others)
        }
    }

    fn all_of(gain: &dyn Fn(&Point) -> f64) -> impl Fn(&[Point]) -> Vec<f64> {
        move |points| points.iter().map(gain).collect()
    }

    fn no_channels() -> Channels {
        let columns = BTreeMap::from([
            ("rate_out_dps".to_owned(), vec![0.0; 2]),
            ("die_degc".to_owned(), vec![0.0, 1.0]),
        ]);
        Channels::new(&[0.0, 1.0], &columns, "die_degc", |t| t).unwrap()
    }

    #[test]
    fn thresholds_settle_in_the_middle_of_their_highest_stairs_wherever_they_start() {
        let (mut random, c) = (Random::new(1), no_channels());
        for case in 0..100 {
            let t = Thresholds::new(&mut random, false);
            let count = 1 + case % 3;
            // Highest stairs: anywhere but at the ends, one to three in a row that are equal but for less than counts.
            let stair = |random: &mut Random| 2 + (34.0 * random.uniform()) as usize;
            let lows: Vec<usize> = (0..count).map(|_| stair(&mut random)).collect();
            let highs: Vec<usize> = lows.iter().map(|low| low + case % 3).collect();
            let gain = |p: &Point| -> f64 {
                let of = |(k, theta): (usize, &f64)| {
                    let at = t.stair(*theta);
                    let off = lows[k].saturating_sub(at).max(at.saturating_sub(highs[k]));
                    -(off as f64) - 0.02 * (at % 2) as f64
                };
                p.theta.iter().enumerate().map(of).sum()
            };
            let start: Vec<f64> = (0..count).map(|_| random.uniform()).collect();
            let found = settled(&t, &c, &Point::at(0, &start), &[], all_of(&gain));
            for (k, theta) in found.theta.iter().enumerate() {
                let middle = |stair: usize| 0.5 * (t.readings[stair - 1] + t.readings[stair]);
                let expected = 0.5 * (middle(lows[k]) + middle(highs[k]));
                assert!(
                    (theta - expected).abs() < 1e-12,
                    "case {case}, threshold {k}"
                );
            }
        }
    }

    #[test]
    fn a_form_with_a_parameter_less_may_gain_less_by_its_price_alone() {
        let (mut random, c) = (Random::new(2), no_channels());
        let t = Thresholds::new(&mut random, true);
        let start = Point::at(0, &[t.readings[9], t.readings[20]]);
        for (less, form) in [(0.9 * PRICE, 1), (1.1 * PRICE, 0), (-1.0, 1)] {
            let gain = |p: &Point| -> f64 {
                let off = p.theta.iter().map(|v| t.stair(*v).abs_diff(12) as f64);
                -off.sum::<f64>() - if p.form == 1 { less } else { 0.0 }
            };
            assert_eq!(
                settled(&t, &c, &start, &[], all_of(&gain)).form,
                form,
                "{less}"
            );
        }
    }

    /// A shape without stairs.
    struct Smooth;

    impl Candidate for Smooth {
        fn sheet(&self) -> &Sheet {
            &SHEET
        }
        fn channels(&self, _: &Channels) -> Result<Vec<String>, Missing> {
            Ok(Vec::new())
        }
        fn points(&self, _: &Channels) -> Vec<Point> {
            Vec::new()
        }
        fn columns(&self, _: &Channels, _: &Bias, _: &Point) -> Vec<Vec<f64>> {
            Vec::new()
        }
        fn report(&self, _: &Channels, _: &Estimate) -> Reported {
            Reported::new()
        }
    }

    #[test]
    fn a_plateau_without_stairs_is_met_in_its_middle_unless_there_is_a_valley() {
        let c = no_channels();
        let points = |form: usize| (0..=100).map(move |k| Point::at(form, &[0.01 * f64::from(k)]));
        let all = |gain: &dyn Fn(&Point) -> f64| -> Vec<(Point, f64)> {
            let both = points(0).chain(points(1));
            both.map(|p| (p.clone(), gain(&p))).collect()
        };
        let flat = |p: &Point| -> f64 {
            let other = if p.form == 0 { 0.0 } else { 0.3 };
            let high = (0.205..0.605).contains(&(p.theta[0] - other));
            if high { 3.0 } else { 0.0 }
        };
        let top = Point::at(0, &[0.22]);
        // A plateau of another form does not count.
        let found = settled(&Smooth, &c, &top, &all(&flat), all_of(&flat));
        assert!(
            found.form == 0 && (found.theta[0] - 0.405).abs() < 1e-9,
            "{found:?}"
        );
        let twin = |p: &Point| -> f64 {
            let near = |at: f64| (p.theta[0] - at).abs() < 0.055;
            if near(0.2) || near(0.8) { 3.0 } else { 0.0 }
        };
        let found = settled(&Smooth, &c, &top, &all(&twin), all_of(&twin));
        assert_eq!(found, top);
        assert_eq!(settled(&Smooth, &c, &top, &[], all_of(&flat)), top);
    }
}
