//! How much each row of a record counts in a fit.
//!
//! Two reasons to count less than 1: a **spike** (a reading apart from its neighbours in time)
//! and a **dwell** (many readings at one temperature, which share the model's error there and so
//! are not as many witnesses). On a record with neither, the fit is ordinary least squares.

use crate::numeric::polynomial;
use crate::statistics::stats;

/// Number of thermometer bins in which a dwell, a drift or a loop is looked at.
pub const BINS: usize = 20;

/// A bin of the thermometer may carry at most this many times the median bin's weight.
///
/// Equal weight for every temperature would be right if the model's error were all that there
/// is, and equal weight for every row if the noise were. A bound between the two: on records that
/// ramp evenly (up to five times denser in one place than in the middle) it does nothing, and an
/// hour of soaking at the hot end (PX4-Autopilot #14091) no longer outvotes the ramp.
pub const DWELL_LIMIT: f64 = 5.0;

/// Deviations, in robust standard deviations, from which a spike's weight falls, and at which it
/// reaches 0. Below the first the weight is 1: clean rows are left as they are.
const SPIKE: (f64, f64) = (4.0, 8.0);

/// Neighbours on each side that a row is compared with. A run of rows as long as that is
/// structure, not a spike, and keeps its weight.
const NEIGHBOURS: usize = 5;

/// Equal bins of a thermometer's range.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Bins {
    low: f64,
    width: f64,
}

impl Bins {
    /// [`BINS`] bins over `range`, in the thermometer's unit.
    pub fn new(range: (f64, f64)) -> Self {
        Bins {
            low: range.0,
            width: (range.1 - range.0) / BINS as f64,
        }
    }

    /// The bin of a reading; readings outside belong to the end bins.
    pub fn index(&self, t: f64) -> usize {
        if self.width > 0.0 {
            // A float cast saturates, and turns NaN into 0.
            (((t - self.low) / self.width) as usize).min(BINS - 1)
        } else {
            0
        }
    }
}

/// The weight of a reading by the occupancy of its bin: 1, or less where the bin holds more
/// than [`DWELL_LIMIT`] times the rows of the median occupied bin. `t` are all readings.
pub fn dwell(t: impl Iterator<Item = f64>, bins: Bins) -> impl Fn(f64) -> f64 {
    let mut count = [0.0f64; BINS];
    for t in t {
        count[bins.index(t)] += 1.0;
    }
    let occupied: Vec<f64> = count.iter().copied().filter(|c| *c > 0.0).collect();
    let limit = DWELL_LIMIT * stats::median(&occupied);
    move |t| (limit / count[bins.index(t)]).min(1.0)
}

/// The weight of each row as a possible spike: 1 for rows like their neighbours, 0 for rows far
/// off. `x` is the scaled thermometer, `e` the error signal, both in order of time.
///
/// A pilot cubic (Huber, iteratively reweighted with a MAD scale) takes the bias away; then each
/// row is compared with the median residual of its five neighbours before and of those after, and
/// its deviation is the lesser of the two if both have one sign, else 0: the edge of a step is
/// like one of its sides. The scale is the MAD of the one-sided deviations (the larger of the
/// whole record's and its surroundings', and at least one step of a coarse output). What a row and
/// its neighbours have in common, such as an effect that the model lacks, therefore never makes
/// an outlier.
pub fn spike(x: &[f64], e: &[f64]) -> Vec<f64> {
    let n = e.len();
    let mut pilot = vec![1.0; n];
    let mut residual = e.to_vec();
    let mut last: Vec<f64> = Vec::new();
    for _ in 0..20 {
        let c = polynomial::least_squares(x, e, &pilot, 3);
        for ((r, e), x) in residual.iter_mut().zip(e).zip(x) {
            *r = e - polynomial::evaluate(&c, *x);
        }
        let limit = 1.345 * stats::robust_std(&residual);
        let moved = c.iter().zip(&last).map(|(a, b)| (a - b).abs());
        if last.len() == c.len() && moved.fold(0.0, f64::max) <= 0.02 * limit {
            break;
        }
        last = c;
        for (w, r) in pilot.iter_mut().zip(&residual) {
            *w = if r.abs() <= limit {
                1.0
            } else {
                limit / r.abs()
            };
        }
    }
    let mut near = Vec::with_capacity(NEIGHBOURS);
    let mut from = |rows: std::ops::Range<usize>, i: usize| -> Option<f64> {
        near.clear();
        near.extend_from_slice(&residual[rows]);
        near.sort_unstable_by(f64::total_cmp);
        (!near.is_empty()).then(|| residual[i] - stats::quantile_sorted(&near, 0.5))
    };
    let (mut apart, mut one_sided) = (Vec::with_capacity(n), Vec::with_capacity(n));
    for i in 0..n {
        let before = from(i.saturating_sub(NEIGHBOURS)..i, i);
        let after = from(i + 1..(i + 1 + NEIGHBOURS).min(n), i);
        one_sided.push(before.or(after).unwrap_or(0.0));
        apart.push(match (before, after) {
            (Some(b), Some(a)) if b * a > 0.0 => b.abs().min(a.abs()),
            (Some(_), Some(_)) => 0.0,
            (Some(d), None) | (None, Some(d)) => d.abs(),
            (None, None) => 0.0,
        });
    }
    let step = stats::lattice_step(e).unwrap_or(0.0);
    let overall = stats::robust_std(&one_sided).max(step);
    let mut weights = Vec::with_capacity(n);
    for start in (0..n).step_by(50) {
        let end = (start + 50).min(n);
        let around = &one_sided[start.saturating_sub(25)..(end + 25).min(n)];
        let scale = overall.max(stats::mad_std(around));
        weights.extend(apart[start..end].iter().map(|d| {
            if scale > 0.0 {
                ((SPIKE.1 - d / scale) / (SPIKE.1 - SPIKE.0)).clamp(0.0, 1.0)
            } else {
                1.0
            }
        }));
    }
    weights
}

/// Marks readings of a thermometer that are glitches: further from the median of their neighbours
/// than half of the whole range, and at most one row in a hundred. Such a reading would set the
/// range, and with it the polynomial's scale.
pub fn thermometer_glitches(t: &[f64]) -> Vec<bool> {
    let mut glitch = vec![false; t.len()];
    let most = (t.len() / 100).max(1);
    let mut found = 0;
    let mut near = Vec::with_capacity(2 * NEIGHBOURS);
    while found < most {
        let kept: Vec<usize> = (0..t.len()).filter(|i| !glitch[*i]).collect();
        let values: Vec<f64> = kept.iter().map(|i| t[*i]).collect();
        let Some((low, high)) = stats::extremes(&values) else {
            break;
        };
        // A glitch is an end of the range: only those need be looked at.
        let worst = (0..values.len())
            .filter(|k| values[*k] == low || values[*k] == high)
            .map(|k| {
                near.clear();
                let rows = k.saturating_sub(NEIGHBOURS)..(k + NEIGHBOURS + 1).min(values.len());
                near.extend(rows.filter(|j| *j != k).map(|j| values[j]));
                near.sort_unstable_by(f64::total_cmp);
                (k, (values[k] - stats::quantile_sorted(&near, 0.5)).abs())
            })
            .fold((0, 0.0), |a, b| if b.1 > a.1 { b } else { a });
        if worst.1 <= 0.5 * (high - low) {
            break;
        }
        glitch[kept[worst.0]] = true;
        found += 1;
    }
    // Where the range stays as it was they were no glitches, but how the record is: set points in
    // random order, or noise alone.
    let values: Vec<f64> = (0..t.len()).filter(|i| !glitch[*i]).map(|i| t[i]).collect();
    let again = stats::extremes(&values).zip(stats::extremes(t));
    match again {
        Some(((a, b), (low, high))) if b - a < 0.75 * (high - low) => glitch,
        _ => vec![false; t.len()],
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_even_ramp_is_not_reweighted_and_a_soak_is() {
        let ramp: Vec<f64> = (0..200).map(f64::from).collect();
        let bins = Bins::new((0.0, 199.0));
        let dwell = |t: &[f64], bins| -> Vec<f64> {
            let share = dwell(t.iter().copied(), bins);
            t.iter().map(|t| share(*t)).collect()
        };
        assert!(dwell(&ramp, bins).iter().all(|w| *w == 1.0));
        let mut soak = ramp.clone();
        soak.extend(std::iter::repeat_n(199.0, 5000));
        let w = dwell(&soak, bins);
        let hot: f64 = w[200..].iter().sum();
        assert!(w[0] == 1.0 && (45.0..=50.0).contains(&hot), "{hot}");
        // A thermometer that does not move has one bin.
        assert!(
            dwell(&[5.0; 9], Bins::new((5.0, 5.0)))
                .iter()
                .all(|w| *w == 1.0)
        );
    }

    #[test]
    fn spikes_fall_and_steps_stay() {
        let x: Vec<f64> = (0..300).map(|k| f64::from(k) / 150.0 - 1.0).collect();
        let mut e: Vec<f64> = (0..300)
            .map(|k| (f64::from(k) * 12.9898).sin() * 0.01 + x[k as usize].powi(2))
            .collect();
        for v in &mut e[150..] {
            *v += 0.3;
        }
        assert!(
            spike(&x, &e).iter().all(|w| *w > 0.5),
            "a step made outliers"
        );
        e[77] += 0.5;
        e[200] -= 0.5;
        e[201] -= 0.5;
        let w = spike(&x, &e);
        assert_eq!((w[77], w[200], w[201]), (0.0, 0.0, 0.0));
        assert_eq!(w.iter().filter(|w| **w < 0.5).count(), 3);
        // A coarse output that seldom changes has no spikes of one step.
        let coarse: Vec<f64> = (0..300).map(|k| f64::from(u8::from(k % 29 == 0))).collect();
        assert!(spike(&x, &coarse).iter().all(|w| *w == 1.0));
    }

    #[test]
    fn a_thermometer_glitch_is_found_and_set_points_are_not() {
        let mut t: Vec<f64> = (0..100).map(|k| 20.0 + f64::from(k) * 0.4).collect();
        assert!(thermometer_glitches(&t).iter().all(|g| !g));
        t[40] = -40_000.0;
        let g = thermometer_glitches(&t);
        assert_eq!(g.iter().position(|g| *g), Some(40));
        assert_eq!(g.iter().filter(|g| **g).count(), 1);
        let random = [0.0, 70.0, 5.0, 65.0, 0.0, 70.0, 10.0, 60.0, 0.0, 70.0, 35.0];
        assert!(thermometer_glitches(&random).iter().all(|g| !g));
    }
}
