//! Held-out blocks and cross-validation folds: whole stretches of time, fixed by the times and the
//! thermometer alone.
//!
//! The rule:
//! 1. The record is cut into segments. If the thermometer makes at least [`RAMPS`] runs up or down
//!    (turning points by more than a tenth of its range), segments are those runs; else [`SPANS`] spans of
//!    equal numbers of rows.
//! 2. Of the segments, four or more are held out, about 27 % of the rows: every fourth on the average,
//!    at uneven distances, so that a periodic temperature profile does not always lose the same
//!    part; never the first nor the last (a transient at power-on and a slow drift could then only be
//!    extrapolated).
//! 3. Of the three shifts of that pattern, the one is taken whose training rows cover most of the
//!    thermometer's range, the first among equals: held-out error is about interpolation.
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

/// Segments that are held out, of 15, before the shift.
const PATTERN: [usize; 4] = [1, 4, 8, 11];

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

/// The split of a record.
///
/// A record of less than three rows a span is cut into spans of three.
///
/// # Errors
/// Fewer than [`LEAST`] rows, lengths that differ.
pub fn split(times_s: &[f64], thermometer: &[f64]) -> Result<Split, Unusable> {
    let n = times_s.len();
    if thermometer.len() != n {
        return Err(Unusable::NotFinite("the thermometer"));
    }
    if n < LEAST {
        return Err(Unusable::TooFewRows {
            rows: n,
            columns: LEAST / 3,
        });
    }
    let spans = SPANS.min(n / 3);
    let ramps = runs(thermometer);
    let count = ramps.last().map_or(0, |last| last + 1);
    let segment = if count >= RAMPS && evenly_long(&ramps, count) {
        ramps
    } else {
        (0..n).map(|i| i * spans / n).collect()
    };
    let segments = segment.last().map_or(0, |last| last + 1);
    let mut best: Option<(f64, Vec<bool>)> = None;
    for shift in 0..3 {
        let held = held_segments(segments, shift);
        let heldout: Vec<bool> = segment.iter().map(|s| held[*s]).collect();
        let covered = coverage(thermometer, &heldout);
        if best.as_ref().is_none_or(|b| covered > b.0 + 0.005) {
            best = Some((covered, heldout));
        }
    }
    let heldout = best.map(|b| b.1).unwrap_or_default();
    Ok(Split {
        train: heldout.iter().map(|h| !h).collect(),
        heldout,
        segment,
    })
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

/// The pattern, repeated every 15 segments, shifted; never the first nor the last segment.
fn held_segments(segments: usize, shift: usize) -> Vec<bool> {
    (0..segments)
        .map(|s| {
            let inside = s > 0 && s + 1 < segments;
            inside && PATTERN.iter().any(|p| (p + shift) % SPANS == s % SPANS)
        })
        .collect()
}

/// Share of the thermometer's range (in fifty bins) that training rows reach, of what rows reach.
fn coverage(thermometer: &[f64], heldout: &[bool]) -> f64 {
    let finite = || thermometer.iter().copied().filter(|v| v.is_finite());
    let low = finite().fold(f64::INFINITY, f64::min);
    let width = (finite().fold(f64::NEG_INFINITY, f64::max) - low) / 50.0;
    let (mut all, mut train) = ([false; 50], [false; 50]);
    for (t, held) in thermometer.iter().zip(heldout) {
        // A cast of a float saturates and turns NaN into 0.
        let bin = if width > 0.0 {
            ((t - low) / width) as usize
        } else {
            0
        };
        let bin = bin.min(49);
        all[bin] = true;
        train[bin] |= !held;
    }
    let count = |of: &[bool]| of.iter().filter(|b| **b).count() as f64;
    let ends = [0, 49].iter().filter(|i| train[**i]).count() as f64;
    // An end that is lost is an extrapolation: it counts as five bins.
    (count(&train) + 5.0 * ends) / (count(&all) + 10.0)
}

/// The number of the monotone run of each row, turning points by a tenth of the range.
fn runs(thermometer: &[f64]) -> Vec<usize> {
    let finite = || thermometer.iter().copied().filter(|v| v.is_finite());
    let low = finite().fold(f64::INFINITY, f64::min);
    let threshold = 0.1 * (finite().fold(f64::NEG_INFINITY, f64::max) - low);
    let mut turns = vec![0];
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
            if up.is_some() {
                turns.push(at);
            }
            up = Some(*t > extreme);
            (extreme, at) = (*t, i);
        }
    }
    let mut run = 0;
    (0..thermometer.len())
        .map(|i| {
            while turns.get(run + 1).is_some_and(|turn| i >= *turn) {
                run += 1;
            }
            run
        })
        .collect()
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
        let split = split(&times, thermometer).unwrap();
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
                let least = if cycles < 1.0 { 0.7 } else { 0.85 };
                let covered = coverage(&t, &split.heldout);
                assert!(cycles == 0.0 || covered > least, "{what}: {covered}");
            }
        }
        assert!(super::split(&[0.0; 10], &[0.0; 10]).is_err());
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
