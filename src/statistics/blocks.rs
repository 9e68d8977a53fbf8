//! Held-out blocks and cross-validation folds: whole stretches of time, fixed by the times, the
//! thermometer and where the other inputs lie outermost. The output has no say.
//!
//! The rule:
//! 1. The record is cut into segments. If the thermometer makes at least [`RAMPS`] runs up or down
//!    (turning points by more than a tenth of its range), segments are those runs; else [`SPANS`] spans of
//!    equal numbers of rows, or twice as many where that halves the gaps of rule 3 and these are wide.
//! 2. Of every 15 segments four are held out, about 27 % of the rows, at least three segments apart; never the
//!    first nor the last of the record (a transient at power-on and a slow drift could then only be
//!    extrapolated).
//! 3. Of the 35 ways to do that, the one is taken whose training rows leave the narrowest gaps in the
//!    thermometer's range, taken as a whole and on the way up and down, and hold out no more than a third of the
//!    highest and of the lowest readings of any other input; the first among equals: held-out error is about
//!    interpolation, and a clip shows in the few rows of the greatest applied rate.
//!
//! Held-out rows are not used in any estimate, and predictions for them are those of the
//! regressors alone: the noise's memory never carries a training row's noise across the border.
//! Random rows would leak under 1/f noise (Racine 2000; Roberts et al. 2017).

use super::Unusable;

/// Runs of the thermometer from which on whole runs are held out.
pub const RAMPS: usize = 15;

/// Spans of equal length otherwise.
pub const SPANS: usize = 15;

/// Fewest rows.
pub const LEAST: usize = 15;

/// Gaps, in bins' squares, from which on shorter spans are tried, and the fewest rows of such a span.
const WIDE: f64 = 4.0;
const FINEST: usize = 5;

/// Segments of every 15 that are held out, and how far apart they are at least.
const HELD: usize = 4;
const APART: usize = 3;

/// A cut into training and held-out rows.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Split {
    /// Rows to fit on.
    pub train: Vec<bool>,
    /// Rows to judge on: the others.
    pub heldout: Vec<bool>,
    /// The segment of each row, ascending in time.
    pub segment: Vec<usize>,
}

/// The split of a record; `cared`: inputs whose outermost rows are cared for (every channel that may be a cause, the applied
/// rate among them).
///
/// A record of less than three rows a span is cut into spans of three.
///
/// # Errors
/// Fewer than [`LEAST`] rows, lengths that differ.
pub fn split(times_s: &[f64], thermometer: &[f64], cared: &[&[f64]]) -> Result<Split, Unusable> {
    let n = times_s.len();
    if thermometer.len() != n {
        return Err(Unusable::NotFinite("the thermometer"));
    }
    if n < LEAST {
        return Err(Unusable::TooFewRows {
            rows: n,
            least: LEAST,
        });
    }
    let ramps = runs(thermometer);
    let count = ramps.last().map_or(0, |last| last + 1);
    let of_rows = |spans: usize| (0..n).map(|i| i * spans / n).collect();
    let judge = Judge {
        direction: directions(thermometer),
        outermost: cared.iter().flat_map(|column| outermost(column)).collect(),
        thermometer,
    };
    let (_, heldout, segment) = if count >= RAMPS && evenly_long(&ramps, count) {
        judge.best(ramps)
    } else {
        let coarse = judge.best(of_rows(SPANS.min(n / 3)));
        let fine = (coarse.0 > WIDE && n >= 2 * SPANS * FINEST)
            .then(|| judge.best(of_rows(2 * SPANS)))
            .filter(|fine| 2.0 * fine.0 <= coarse.0);
        fine.unwrap_or(coarse)
    };
    Ok(Split {
        train: heldout.iter().map(|h| !h).collect(),
        heldout,
        segment,
    })
}

/// What a way to hold out segments is judged by.
struct Judge<'a> {
    thermometer: &'a [f64],
    direction: Vec<bool>,
    outermost: Vec<Vec<usize>>,
}

impl Judge<'_> {
    /// The best pattern: what it leaves open, the rows that it holds out, and the segments.
    fn best(&self, segment: Vec<usize>) -> (f64, Vec<bool>, Vec<usize>) {
        let segments = segment.last().map_or(0, |last| last + 1);
        let mut best = (f64::INFINITY, Vec::new());
        for pattern in patterns() {
            let held = held_segments(segments, &pattern);
            let heldout: Vec<bool> = segment.iter().map(|s| held[*s]).collect();
            let mut open = left_open(self.thermometer, &self.direction, &heldout);
            open += self
                .outermost
                .iter()
                .map(|rows| lost(rows, &heldout))
                .sum::<f64>();
            if open < best.0 {
                best = (open, heldout);
            }
        }
        (best.0, best.1, segment)
    }
}

impl Split {
    /// Cross-validation on the training rows: for each of `folds` folds the rows that it leaves
    /// out. Neighbouring training segments are in different folds, and a segment is never cut.
    pub fn folds(&self, folds: usize) -> Vec<Vec<bool>> {
        let folds = folds.max(2);
        let mut training: Vec<usize> = self
            .segment
            .iter()
            .zip(&self.train)
            .filter(|(_, t)| **t)
            .map(|(s, _)| *s)
            .collect();
        training.dedup();
        (0..folds)
            .map(|fold| {
                self.segment
                    .iter()
                    .map(|s| training.binary_search(s).is_ok_and(|i| i % folds == fold))
                    .collect()
            })
            .collect()
    }
}

/// At uneven distances, so that what repeats does not always lose the same part.
const UNEVEN: [usize; HELD] = [1, 4, 8, 11];

/// All ways to hold out four of 15 segments, neither the first nor the last: an uneven one, which is taken where the
/// temperature has no say, then all in lexicographic order.
fn patterns() -> Vec<Vec<usize>> {
    let mut all: Vec<Vec<usize>> = vec![Vec::new()];
    for _ in 0..HELD {
        all = all
            .iter()
            .flat_map(|begun| {
                let next = begun.last().map_or(1, |last| last + APART);
                (next..SPANS - 1).map(move |s| [begun.as_slice(), &[s]].concat())
            })
            .collect();
    }
    all.insert(0, UNEVEN.to_vec());
    all
}

/// A pattern, repeated every 15 segments; never the first nor the last segment.
fn held_segments(segments: usize, pattern: &[usize]) -> Vec<bool> {
    (0..segments)
        .map(|s| s > 0 && s + 1 < segments && pattern.contains(&(s % SPANS)))
        .collect()
}

/// Bins of the thermometer's range.
const BINS: usize = 50;

/// What a gap on the way up or down alone counts, and one at an end of the range, where predictions are
/// extrapolated.
const ONE_WAY: f64 = 0.25;
const AT_AN_END: f64 = 4.0;

/// Share of the thermometer's range by which it turns before its direction does: more than its noise, so that a
/// plateau belongs to the way to it.
const TURNS: f64 = 0.04;

/// Whether the thermometer rises at each row: the way from the last turning point to the next.
fn directions(thermometer: &[f64]) -> Vec<bool> {
    let (turns, first) = turning_points(thermometer, TURNS);
    let run = numbered(&turns, thermometer.len());
    run.iter()
        .map(|run| first == run.is_multiple_of(2))
        .collect()
}

/// Squares of the widths of the gaps that training rows leave in the thermometer's range, in bins.
fn left_open(thermometer: &[f64], rising: &[bool], heldout: &[bool]) -> f64 {
    let finite = || thermometer.iter().copied().filter(|v| v.is_finite());
    let low = finite().fold(f64::INFINITY, f64::min);
    let width = (finite().fold(f64::NEG_INFINITY, f64::max) - low) / BINS as f64;
    let bin = |t: f64| match width > 0.0 {
        // A cast of a float saturates and turns NaN into 0.
        true => (((t - low) / width) as usize).min(BINS - 1),
        false => 0,
    };
    // Down, up, either way.
    let (mut all, mut train) = ([[false; BINS]; 3], [[false; BINS]; 3]);
    for ((t, held), rises) in thermometer.iter().zip(heldout).zip(rising) {
        for way in [usize::from(*rises), 2] {
            all[way][bin(*t)] = true;
            train[way][bin(*t)] |= !held;
        }
    }
    let gaps = |way: usize| gaps(&all[way], &train[way]);
    gaps(2) + ONE_WAY * (gaps(0) + gaps(1))
}

/// Of one way: bins that are reached, and that training rows reach.
fn gaps(all: &[bool], train: &[bool]) -> f64 {
    let open: Vec<bool> = all.iter().zip(train).map(|(a, t)| *a && !t).collect();
    let runs = open.chunk_by(|a, b| a == b);
    let mut from = 0;
    let mut sum = 0.0;
    for run in runs {
        let to = from + run.len();
        if run.first() == Some(&true) {
            let outer = !train[..from].contains(&true) || !train[to..].contains(&true);
            let weight = if outer { AT_AN_END } else { 1.0 };
            sum += weight * (run.len() as f64).powi(2);
        }
        from = to;
    }
    sum
}

/// Outermost readings at each end: this share of the rows, and how many at least; which share of them may be held out,
/// and what it counts, in bins' squares, if all of them are.
const OUTERMOST: f64 = 0.01;
const FEW: usize = 4;
const FAIR: f64 = 1.0 / 3.0;
const ALL_LOST: f64 = 30.0;

/// The rows of the lowest and of the highest readings.
fn outermost(output: &[f64]) -> Vec<Vec<usize>> {
    let mut sorted: Vec<f64> = output.iter().copied().filter(|v| v.is_finite()).collect();
    sorted.sort_by(f64::total_cmp);
    let count = FEW.max((OUTERMOST * sorted.len() as f64) as usize);
    if sorted.len() < 2 * count {
        return Vec::new();
    }
    let (low, high) = (sorted[count - 1], sorted[sorted.len() - count]);
    let of = |is: &dyn Fn(f64) -> bool| -> Vec<usize> {
        let rows = output.iter().enumerate();
        rows.filter(|(_, v)| is(**v)).map(|(i, _)| i).collect()
    };
    vec![of(&|v| v <= low), of(&|v| v >= high)]
}

/// What it costs to hold out more than their fair share.
fn lost(rows: &[usize], heldout: &[bool]) -> f64 {
    let held = rows.iter().filter(|i| heldout[**i]).count();
    let share = held as f64 / rows.len().max(1) as f64;
    ALL_LOST * ((share - FAIR).max(0.0) / (1.0 - FAIR)).powi(2)
}

/// The number of the monotone run of each row, turning points by a tenth of the range.
fn runs(thermometer: &[f64]) -> Vec<usize> {
    numbered(&turning_points(thermometer, 0.1).0, thermometer.len())
}

/// The number of the run that each of so many rows is in.
fn numbered(turns: &[usize], rows: usize) -> Vec<usize> {
    let mut run = 0;
    (0..rows)
        .map(|i| {
            while turns.get(run + 1).is_some_and(|turn| i >= *turn) {
                run += 1;
            }
            run
        })
        .collect()
}

/// Where the monotone runs begin, turning points by a share of the range, and whether the first one rises.
fn turning_points(thermometer: &[f64], share: f64) -> (Vec<usize>, bool) {
    let finite = || thermometer.iter().copied().filter(|v| v.is_finite());
    let low = finite().fold(f64::INFINITY, f64::min);
    let threshold = share * (finite().fold(f64::NEG_INFINITY, f64::max) - low);
    let mut turns = vec![0];
    let mut first = false;
    let (mut extreme, mut at, mut up) = (f64::NAN, 0, None);
    for (i, t) in thermometer
        .iter()
        .enumerate()
        .filter(|(_, t)| t.is_finite())
    {
        if extreme.is_nan() {
            (extreme, at) = (*t, i);
        }
        let further = match up {
            Some(true) => *t >= extreme,
            Some(false) => *t <= extreme,
            None => false,
        };
        if further {
            (extreme, at) = (*t, i);
        } else if (t - extreme).abs() > threshold && threshold > 0.0 {
            match up {
                Some(_) => turns.push(at),
                None => first = *t > extreme,
            }
            up = Some(*t > extreme);
            (extreme, at) = (*t, i);
        }
    }
    (turns, first)
}

/// Whether runs are of similar lengths: none beyond three times the mean, or the shares would be
/// far from what the pattern means.
fn evenly_long(segment: &[usize], count: usize) -> bool {
    let mut lengths = vec![0usize; count];
    for s in segment {
        lengths[*s] += 1;
    }
    let mean = segment.len() as f64 / count as f64;
    lengths.iter().all(|l| (*l as f64) < 3.0 * mean)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn shares(thermometer: &[f64]) -> (f64, usize, Split) {
        let times: Vec<f64> = (0..thermometer.len()).map(|i| i as f64).collect();
        let split = split(&times, thermometer, &[]).unwrap();
        let held = split.heldout.iter().filter(|h| **h).count();
        let starts = split.heldout.windows(2).filter(|w| !w[0] && w[1]).count();
        (held as f64 / thermometer.len() as f64, starts, split)
    }

    #[test]
    fn shares_blocks_ends_and_coverage() {
        for n in [45usize, 150, 301, 2000] {
            for cycles in [0.0, 0.5, 1.0, 3.0, 8.0, 20.0] {
                let t: Vec<f64> = (0..n)
                    .map(|i| -(std::f64::consts::TAU * cycles * i as f64 / n as f64).cos())
                    .collect();
                let (share, blocks, split) = shares(&t);
                let what = format!("{n} rows, {cycles} cycles: {share} in {blocks}");
                assert!((0.2..0.34).contains(&share), "{what}");
                assert!(blocks >= 4, "{what}");
                assert!(!split.heldout[0] && !split.heldout[n - 1], "{what}");
                // A single ramp passes each temperature once: there held-out rows are gaps.
                let open = left_open(&t, &directions(&t), &split.heldout);
                // Four segments of 50 / 15 bins, of 50 / 7.5 on one way of a single cycle, wider in its middle.
                let most = if cycles < 1.0 { 150.0 } else { 60.0 };
                assert!(open < most, "{what}: {open}");
            }
        }
        assert!(super::split(&[0.0; 10], &[0.0; 10], &[]).is_err());
    }

    #[test]
    fn what_is_passed_once_on_a_way_is_not_held_out_as_a_whole() {
        // One slow cycle with dwells; a thermometer with noise of a hundredth of its range.
        for (n, seed) in [(300usize, 1u64), (1000, 2), (4000, 3)] {
            let mut random = crate::thermal::synthetic::Random::new(seed);
            let course = |x: f64| (1.4 * (1.0 - (4.0 * x - 2.0).abs())).clamp(-1.0, 1.0);
            let clean: Vec<f64> = (0..n).map(|i| course(i as f64 / n as f64)).collect();
            let noisy: Vec<f64> = clean.iter().map(|t| t + 0.02 * random.normal()).collect();
            let (share, blocks, split) = shares(&noisy);
            assert!(
                (0.2..0.34).contains(&share) && blocks >= 7,
                "{n}: {share} in {blocks}"
            );
            let rising: Vec<bool> = (0..n).map(|i| 2 * i < n).collect();
            let open = left_open(&clean, &rising, &split.heldout);
            // Each of eight blocks is a thirtieth of the record, 3.6 bins on its way where it moves.
            assert!(open < 45.0, "{n}: {open}");
            let said = directions(&noisy);
            let wrong = said.iter().zip(&rising).filter(|(a, b)| a != b).count();
            assert!(wrong < n / 6, "{n}: {wrong}");
        }
    }

    #[test]
    fn a_rate_s_outermost_readings_are_not_held_out_together() {
        // Three slow cycles of temperature; the highest rate in one of the 15 spans alone.
        let n = 450;
        let times: Vec<f64> = (0..n).map(f64::from).collect();
        let t: Vec<f64> = times.iter().map(|t| (t / 24.0).sin()).collect();
        for highest in 0..15 {
            let output: Vec<f64> = (0..n)
                .map(|i| {
                    if i / 30 == highest {
                        100.0
                    } else {
                        f64::from(i % 7)
                    }
                })
                .collect();
            let lost = |output| {
                let split = super::split(&times, &t, &[output]).unwrap();
                split.heldout[30 * highest as usize]
            };
            assert!(!lost(output.as_slice()), "{highest}");
        }
        let blind = super::split(&times, &t, &[]).unwrap();
        assert!((0..15).any(|s| blind.heldout[30 * s]));
    }

    #[test]
    fn runs_are_cut_at_turning_points_and_folds_are_whole_segments() {
        // Sixteen ramps of 25 rows, with a ripple below the threshold.
        let t: Vec<f64> = (0..400)
            .map(|i| {
                let (run, at) = (i / 25, f64::from(i % 25));
                let ramp = if run % 2 == 0 { at } else { 24.0 - at };
                ramp + 0.5 * f64::from(i % 3)
            })
            .collect();
        let (_, _, split) = shares(&t);
        assert_eq!(split.segment.last(), Some(&15));
        for (i, s) in split.segment.iter().enumerate() {
            assert!(
                (i as i64 / 25 - *s as i64).abs() <= 1 && (i + 3) / 25 >= *s,
                "{i} {s}"
            );
        }
        let folds = split.folds(4);
        for i in 0..400 {
            let left_out = folds.iter().filter(|f| f[i]).count();
            assert_eq!(left_out, usize::from(split.train[i]));
            if i > 0 && split.segment[i] == split.segment[i - 1] {
                assert!(folds.iter().all(|f| f[i] == f[i - 1]));
            }
        }
    }
}
