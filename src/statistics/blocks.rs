//! Which rows of a record are fitted, which choose between models and which judge the answer: whole stretches of time, fixed by
//! the times and the inputs. The output has no say.
//!
//! The rule:
//! 1. The record is cut into segments. If the thermometer makes at least [`RAMPS`] runs up or down
//!    (turning points by more than a tenth of its range), segments are those runs; else [`SPANS`] spans of
//!    equal numbers of rows, or twice as many where that halves the gaps of rule 3 and these are wide.
//! 2. Of every 15 segments four are not fitted, about 27 % of the rows, at least three segments apart; never the
//!    first nor the last of the record (a transient at power-on and a slow drift could then only be
//!    extrapolated).
//! 3. Of the 35 ways to do that, the one is taken whose other rows leave the narrowest gaps in the
//!    thermometer's range, taken as a whole and on the way up and down, and of which no more than a third of the highest and
//!    of the lowest readings of any other input are taken (the applied rate among them: a clip shows in few rows); the first
//!    among equals: the error is about interpolation.
//! 4. Of these four the first rows choose and the last quarter judges, about 7 % of the rows; of a stretch of less than
//!    twelve rows three, or half, so that the error is of eight rows at least, of twelve from 90 rows on.
//! 5. In a record of fewer than [`JUDGED`] rows, or where none of those that would judge has an output, the rows that choose judge
//!    too.
//!
//! Rows that choose are used in no fit, and predictions for them are those of the
//! regressors alone: the noise's memory never carries a fitted row's noise across the border.
//! Random rows would leak under 1/f noise (Racine 2000; Roberts et al. 2017). Rows that judge steer nothing.

use super::Unusable;

/// Runs of the thermometer from which on whole runs are taken.
pub const RAMPS: usize = 15;

/// Spans of equal length otherwise.
pub const SPANS: usize = 15;

/// Fewest rows.
pub const LEAST: usize = 15;

/// Gaps, in bins' squares, from which on shorter spans are tried, and the fewest rows of such a span.
const WIDE: f64 = 4.0;
const FINEST: usize = 5;

/// Fewest rows of a record some of which do nothing but judge.
pub const JUDGED: usize = 60;

/// Segments of every 15 that are not fitted, and how far apart they are at least.
const TAKEN: usize = 4;
const APART: usize = 3;

/// Of each of these segments the last rows judge: one in so many, and as many at least, but half at most (convention: an rms of
/// twelve rows of white noise has a standard error of a fifth).
const JUDGE_ONE_IN: usize = 4;
const JUDGE_ROWS: usize = 3;

/// What a row is for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Role {
    /// Every estimate is of such rows.
    Fit,
    /// Models that were fitted to other rows are compared on it.
    Choose,
    /// Nothing but the error of the answer is of it.
    Judge,
}

impl Role {
    /// Its name in files.
    pub fn word(self) -> &'static str {
        match self {
            Role::Fit => "fit",
            Role::Choose => "choose",
            Role::Judge => "judge",
        }
    }
}

/// What each row of a record is for.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Split {
    /// One a row.
    pub roles: Vec<Role>,
    /// The segment of each row, ascending in time.
    pub segment: Vec<usize>,
}

/// The split of a record; `cared`: inputs whose outermost rows are cared for (every channel that may be a cause).
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
    let gaps = Gaps {
        direction: directions(thermometer),
        outermost: cared.iter().flat_map(|column| outermost(column)).collect(),
        thermometer,
    };
    let (_, taken, segment) = if count >= RAMPS && evenly_long(&ramps, count) {
        gaps.best(ramps)
    } else {
        let coarse = gaps.best(of_rows(SPANS.min(n / 3)));
        let fine = (coarse.0 > WIDE && n >= 2 * SPANS * FINEST)
            .then(|| gaps.best(of_rows(2 * SPANS)))
            .filter(|fine| 2.0 * fine.0 <= coarse.0);
        fine.unwrap_or(coarse)
    };
    let mut roles = vec![Role::Fit; n];
    let mut from = 0;
    for stretch in segment.chunk_by(|a, b| a == b) {
        let to = from + stretch.len();
        let number = stretch[0];
        if taken.contains(&(number % SPANS)) && !is_an_end(number, &segment) {
            let length = stretch.len();
            let judging = (length / JUDGE_ONE_IN).max(JUDGE_ROWS).min(length / 2);
            let judging = if n >= JUDGED { judging } else { 0 };
            roles[from..to - judging].fill(Role::Choose);
            roles[to - judging..to].fill(Role::Judge);
        }
        from = to;
    }
    Ok(Split { roles, segment })
}

/// What a way to take segments is judged by: the gaps that the other rows leave.
struct Gaps<'a> {
    thermometer: &'a [f64],
    direction: Vec<bool>,
    outermost: Vec<Vec<usize>>,
}

impl Gaps<'_> {
    /// The best pattern: what it leaves open, the segments that it takes of every 15, and all segments.
    fn best(&self, segment: Vec<usize>) -> (f64, Vec<usize>, Vec<usize>) {
        let mut best = (f64::INFINITY, Vec::new());
        for pattern in patterns() {
            let open = self.open(&pattern, &segment);
            if open < best.0 {
                best = (open, pattern);
            }
        }
        (best.0, best.1, segment)
    }

    /// What is left open if so many of every 15 segments are taken.
    fn open(&self, pattern: &[usize], segment: &[usize]) -> f64 {
        let is_taken = |s: &usize| pattern.contains(&(s % SPANS)) && !is_an_end(*s, segment);
        let taken: Vec<bool> = segment.iter().map(is_taken).collect();
        let lost = self.outermost.iter().map(|rows| lost(rows, &taken));
        left_open(self.thermometer, &self.direction, &taken) + lost.sum::<f64>()
    }
}

/// Whether a segment is the first or the last.
fn is_an_end(s: usize, segment: &[usize]) -> bool {
    s == 0 || Some(&s) == segment.last()
}

impl Split {
    /// Which rows have a role.
    pub fn rows(&self, role: Role) -> Vec<bool> {
        self.roles.iter().map(|r| *r == role).collect()
    }

    /// The same without rows that do nothing but judge: they are fitted.
    pub fn without_judges(mut self) -> Self {
        let judging = self.roles.iter_mut().filter(|r| **r == Role::Judge);
        judging.for_each(|r| *r = Role::Fit);
        self
    }

    /// Which rows the error of the answer is of: those that judge or, where there are none, those that choose.
    pub fn judging(&self) -> Vec<bool> {
        match self.roles.contains(&Role::Judge) {
            true => self.rows(Role::Judge),
            false => self.rows(Role::Choose),
        }
    }
}

/// At uneven distances, so that what repeats does not always lose the same part.
const UNEVEN: [usize; TAKEN] = [1, 4, 8, 11];

/// All ways to choose by four of 15 segments, neither the first nor the last: an uneven one, which is taken where the
/// temperature has no say, then all in lexicographic order.
fn patterns() -> Vec<Vec<usize>> {
    let mut all: Vec<Vec<usize>> = vec![Vec::new()];
    for _ in 0..TAKEN {
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

/// Squares of the widths of the gaps that rows leave in the thermometer's range which are not taken, in bins.
fn left_open(thermometer: &[f64], rising: &[bool], taken: &[bool]) -> f64 {
    let finite = || thermometer.iter().copied().filter(|v| v.is_finite());
    let low = finite().fold(f64::INFINITY, f64::min);
    let width = (finite().fold(f64::NEG_INFINITY, f64::max) - low) / BINS as f64;
    let bin = |t: f64| match width > 0.0 {
        // A cast of a float saturates and turns NaN into 0.
        true => (((t - low) / width) as usize).min(BINS - 1),
        false => 0,
    };
    // Down, up, either way.
    let (mut all, mut rest) = ([[false; BINS]; 3], [[false; BINS]; 3]);
    for ((t, is_taken), rises) in thermometer.iter().zip(taken).zip(rising) {
        for way in [usize::from(*rises), 2] {
            all[way][bin(*t)] = true;
            rest[way][bin(*t)] |= !is_taken;
        }
    }
    let gaps = |way: usize| gaps(&all[way], &rest[way]);
    gaps(2) + ONE_WAY * (gaps(0) + gaps(1))
}

/// Of one way: bins that are reached, and that rows reach which are not taken.
fn gaps(all: &[bool], rest: &[bool]) -> f64 {
    let open: Vec<bool> = all.iter().zip(rest).map(|(a, r)| *a && !r).collect();
    let runs = open.chunk_by(|a, b| a == b);
    let mut from = 0;
    let mut sum = 0.0;
    for run in runs {
        let to = from + run.len();
        if run.first() == Some(&true) {
            let outer = !rest[..from].contains(&true) || !rest[to..].contains(&true);
            let weight = if outer { AT_AN_END } else { 1.0 };
            sum += weight * (run.len() as f64).powi(2);
        }
        from = to;
    }
    sum
}

/// Outermost readings at each end: this share of the rows, and how many at least; which share of them may be taken,
/// and what it counts, in bins' squares, if all of them are.
const OUTERMOST: f64 = 0.01;
const FEW: usize = 4;
const FAIR: f64 = 1.0 / 3.0;
const ALL_LOST: f64 = 30.0;

/// The rows of the lowest and of the highest readings.
fn outermost(input: &[f64]) -> Vec<Vec<usize>> {
    let mut sorted: Vec<f64> = input.iter().copied().filter(|v| v.is_finite()).collect();
    sorted.sort_by(f64::total_cmp);
    let count = FEW.max((OUTERMOST * sorted.len() as f64) as usize);
    if sorted.len() < 2 * count {
        return Vec::new();
    }
    let (low, high) = (sorted[count - 1], sorted[sorted.len() - count]);
    let of = |is: &dyn Fn(f64) -> bool| -> Vec<usize> {
        let rows = input.iter().enumerate();
        rows.filter(|(_, v)| is(**v)).map(|(i, _)| i).collect()
    };
    vec![of(&|v| v <= low), of(&|v| v >= high)]
}

/// What it costs to take more than their fair share.
fn lost(rows: &[usize], taken: &[bool]) -> f64 {
    let count = rows.iter().filter(|i| taken[**i]).count();
    let share = count as f64 / rows.len().max(1) as f64;
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
#[path = "blocks_tests.rs"]
mod tests;
