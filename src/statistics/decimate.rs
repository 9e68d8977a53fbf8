//! Long records: the noise is estimated on means of consecutive rows.
//!
//! 1/f noise has no scale, so the means of m rows have the same h; the walk keeps its K; white noise
//! falls to 1 / m. What the means have lost, the white variance of a row, comes from the scatter within
//! the blocks, less what 1/f noise and walk put there.

use super::lattice::Problem;
use super::linear::{Basis, add_scaled, dot};
use super::noise::{NoiseModel, Shape, Timeline};
use super::{Unusable, robust};

/// How rows were put together.
#[derive(Debug, Clone, PartialEq)]
pub struct Blocks {
    /// First row of each block, and the end of the last.
    pub starts: Vec<usize>,
    /// Weight of each row: 0 for rows that are not used.
    pub weights: Vec<f64>,
    /// Rows of a full block.
    pub rows: usize,
}

impl Blocks {
    /// The weighted mean of each block; 0 for a block without a used row.
    pub fn means(&self, column: &[f64]) -> Vec<f64> {
        self.each(|rows| {
            let (values, weights) = (&column[rows.clone()], &self.weights[rows]);
            let add = |(s, t): (f64, f64), (v, w): (&f64, &f64)| (s + v * w, t + w);
            let pairs = || values.iter().zip(weights);
            let (mut sum, weight) = pairs().fold((0.0, 0.0), add);
            if !sum.is_finite() {
                // Rows that are not used may hold anything.
                (sum, _) = pairs().filter(|(_, w)| **w > 0.0).fold((0.0, 0.0), add);
            }
            if weight > 0.0 { sum / weight } else { 0.0 }
        })
    }

    /// The same blocks with other weights, and their timeline.
    ///
    /// # Errors
    /// Times that do not advance from block to block.
    pub fn reweighted(
        &self,
        times_s: &[f64],
        weights: Vec<f64>,
    ) -> Result<(Self, Timeline), Unusable> {
        let blocks = Blocks {
            weights,
            ..self.clone()
        };
        let line = Timeline::new(&blocks_times(times_s, &blocks), blocks.white_factor())?;
        Ok((blocks, line))
    }

    /// Variance factor of each mean: 1 over the weight in it.
    fn white_factor(&self) -> Vec<f64> {
        self.each(|rows| 1.0 / self.weights[rows].iter().sum::<f64>())
    }

    fn each(&self, of: impl Fn(std::ops::Range<usize>) -> f64) -> Vec<f64> {
        let ends = self.starts.iter().zip(self.starts.iter().skip(1));
        ends.map(|(a, b)| of(*a..*b)).collect()
    }
}

/// A long problem, and what its block means are.
#[derive(Debug, Clone, PartialEq)]
pub struct Decimated {
    /// The blocks.
    pub blocks: Blocks,
    /// The problem in block means.
    pub problem: Problem,
    /// Mean square of rows about their block's mean, per degree of freedom, (deg/s)^2.
    pub within: f64,
}

/// Blocks of `rows` rows (fewer where used rows are), and spikes by their distance from their
/// block's median, or, where a block has none, from those of their neighbours; `robust`: whether spikes lose weight.
///
/// # Errors
/// Times that do not advance from block to block.
pub fn decimate(
    times_s: &[f64],
    plain: &Problem,
    used: &[bool],
    rows: usize,
    robust: bool,
) -> Result<Decimated, Unusable> {
    let n = times_s.len();
    let rows = rows.max(2);
    let mut starts: Vec<usize> = (0..n).step_by(rows).collect();
    starts.push(n);
    let mut blocks = Blocks {
        starts,
        weights: used.iter().map(|u| f64::from(u8::from(*u))).collect(),
        rows,
    };
    let residual = plain_residual(plain, &blocks.weights);
    // The median of a large block is not one of the rows of an accident.
    if robust && rows < WIDE {
        without_runs(&residual, &mut blocks.weights);
    }
    // What the scale is of, and what is far.
    let (usual, deviations) = match rows {
        0..FEWEST => from_neighbours(&residual, &blocks.weights, FEWEST),
        _ => {
            let neighbours = from_neighbours(&residual, &blocks.weights, FEWEST);
            from_block_medians(&residual, &blocks, neighbours)
        }
    };
    let marked = usual.iter().zip(used);
    let marked = marked.filter(|(d, u)| **u && d.is_finite());
    let unit = robust::scale(marked.map(|(d, _)| *d));
    if robust && unit > 0.0 {
        for (w, d) in blocks.weights.iter_mut().zip(&deviations) {
            *w *= robust::weight(d.abs() / unit);
        }
    }
    let line = Timeline::new(&blocks_times(times_s, &blocks), blocks.white_factor())?;
    let problem = Problem {
        line,
        y: blocks.means(&plain.y),
        columns: plain.columns.iter().map(|c| blocks.means(c)).collect(),
    };
    let within = within(&residual, &blocks);
    Ok(Decimated {
        blocks,
        problem,
        within,
    })
}

/// Means of the times of all rows of a block, used or not.
fn blocks_times(times_s: &[f64], blocks: &Blocks) -> Vec<f64> {
    blocks.each(|rows| {
        let start = times_s[rows.start];
        let sum: f64 = times_s[rows.clone()].iter().map(|t| t - start).sum();
        start + sum / rows.len() as f64
    })
}

/// Ordinary least-squares residual over the rows with weight.
fn plain_residual(plain: &Problem, weights: &[f64]) -> Vec<f64> {
    let masked = |c: &[f64]| -> Vec<f64> {
        let pairs = c.iter().zip(weights);
        pairs
            .map(|(v, w)| if *w > 0.0 { *v } else { 0.0 })
            .collect()
    };
    let columns: Vec<Vec<f64>> = plain.columns.iter().map(|c| masked(c)).collect();
    let basis = Basis::new(&columns);
    let mut residual = masked(&plain.y);
    let z: Vec<f64> = basis.q.iter().map(|q| dot(q, &residual)).collect();
    for (column, b) in columns.iter().zip(basis.solve(&z)) {
        add_scaled(&mut residual, -b, column);
    }
    residual
}

/// Fewest rows that have a median of which one may be far.
const FEWEST: usize = 3;

/// Rows of which one accident spoils less than half.
const WIDE: usize = 2 * robust::LONGEST + 1;

/// No weight for rows that are far from what is before and behind them, several in a row, where these are accidents.
fn without_runs(residual: &[f64], weights: &mut [f64]) {
    let used = |w: &f64| *w > 0.0;
    let (usual, apart) = from_neighbours(residual, weights, WIDE);
    let rows = usual.iter().zip(weights.iter()).filter(|(_, w)| used(w));
    let unit = robust::scale(rows.map(|(d, _)| *d));
    let far = |d: &f64| unit > 0.0 && robust::weight(d.abs() / unit) == 0.0;
    let rows = apart.iter().zip(weights.iter()).filter(|(_, w)| used(w));
    let marked: Vec<bool> = rows.map(|(d, _)| far(d)).collect();
    if robust::are_accidents(&marked) {
        for (w, d) in weights.iter_mut().zip(&apart) {
            *w *= f64::from(u8::from(!far(d)));
        }
    }
}

/// The middle value; the upper one of two.
fn median(values: &[f64]) -> Option<f64> {
    let mut near = values.to_vec();
    near.sort_by(f64::total_cmp);
    near.get(near.len() / 2).copied()
}

/// The median of every value and those before it, `few` together.
fn running_medians(values: &[f64], few: usize) -> Vec<f64> {
    let mut window: Vec<f64> = Vec::with_capacity(few + 1);
    let place = |window: &[f64], v: f64| window.partition_point(|w| w.total_cmp(&v).is_lt());
    let each = values.iter().enumerate().map(|(k, v)| {
        if k >= few {
            window.remove(place(&window, values[k - few]));
        }
        window.insert(place(&window, *v), *v);
        window[window.len() / 2]
    });
    each.collect()
}

/// How far each row is from the median of a few rows before it, and from that and the median of those after it: the
/// lesser of the two, or nothing where they are to both sides. The rows at a step are like those on one of its sides.
fn from_neighbours(residual: &[f64], weights: &[f64], few: usize) -> (Vec<f64>, Vec<f64>) {
    let used: Vec<usize> = (0..residual.len()).filter(|i| weights[*i] > 0.0).collect();
    let rest: Vec<f64> = used.iter().map(|i| residual[*i]).collect();
    let medians = running_medians(&rest, few);
    let (mut one_sided, mut apart) = (vec![0.0; residual.len()], vec![0.0; residual.len()]);
    for (k, row) in used.iter().enumerate() {
        let before = (k > 0).then(|| medians[k - 1]);
        let after = match (used.len() - k - 1).min(few) {
            0 => None,
            whole if whole == few => Some(medians[k + few]),
            _ => median(&rest[k + 1..]),
        };
        let (Some(before), Some(after)) = (before.or(after), after.or(before)) else {
            continue;
        };
        let (from, to) = (residual[*row] - before, residual[*row] - after);
        one_sided[*row] = from;
        if from * to > 0.0 {
            apart[*row] = if from.abs() < to.abs() { from } else { to };
        }
    }
    (one_sided, apart)
}

/// How far each row is from its block's median, without the row that is the median, which says nothing of the scale (NaN), and
/// with it; as `neighbours` have both where the block has too few rows left for a median.
fn from_block_medians(
    residual: &[f64],
    blocks: &Blocks,
    neighbours: (Vec<f64>, Vec<f64>),
) -> (Vec<f64>, Vec<f64>) {
    let (mut usual, mut deviations) = neighbours;
    for (a, b) in blocks.starts.iter().zip(blocks.starts.iter().skip(1)) {
        let mut near: Vec<usize> = (*a..*b).filter(|i| blocks.weights[*i] > 0.0).collect();
        if near.len() < FEWEST {
            continue;
        }
        let middle = near.len() / 2;
        let by_size = |i: &usize, k: &usize| residual[*i].total_cmp(&residual[*k]);
        let median = *near.select_nth_unstable_by(middle, by_size).1;
        for i in *a..*b {
            deviations[i] = residual[i] - residual[median];
            usual[i] = deviations[i];
        }
        usual[median] = f64::NAN;
    }
    (usual, deviations)
}

fn within(residual: &[f64], blocks: &Blocks) -> f64 {
    let means = blocks.means(residual);
    let (mut sum, mut degrees) = (0.0, 0.0);
    let ends = blocks.starts.iter().zip(blocks.starts.iter().skip(1));
    for ((a, b), mean) in ends.zip(&means) {
        let mut weight = 0.0;
        for (r, w) in residual[*a..*b].iter().zip(&blocks.weights[*a..*b]) {
            sum += w * (r - mean).powi(2);
            weight += w;
        }
        degrees += f64::max(weight - 1.0, 0.0);
    }
    if degrees > 0.0 { sum / degrees } else { 0.0 }
}

/// The noise of a row, from the shape and white variance of the block means and the scatter within
/// the blocks. `line` is the timeline of the rows.
pub fn row_noise(
    decimated: &Decimated,
    shape: Shape,
    white_variance: f64,
    line: &Timeline,
) -> NoiseModel {
    // `white_variance` is that of a row as the means see it.
    let h = shape.flicker * white_variance;
    let per_period = shape.walk * white_variance * line.period_s / decimated.problem.line.period_s;
    let m = decimated.blocks.rows;
    let unit = Shape {
        flicker: 1.0,
        walk: 0.0,
    };
    let mut flicker = line.floor(unit);
    for state in line.states(unit) {
        flicker += state.variance * (1.0 - mean_correlation(m, state.tau));
    }
    let walk = per_period * (m as f64 + 1.0) / 6.0;
    let white = decimated.within - h * flicker - walk;
    let white = white.max(1e-3 * decimated.within).max(0.0);
    NoiseModel {
        white_rms_dps: white.sqrt(),
        flicker_dps: h.sqrt(),
        walk_dps_rts: (per_period / line.period_s).sqrt(),
    }
}

/// Mean correlation of two different rows of a block of `m` for the time constant `tau` in rows.
fn mean_correlation(m: usize, tau: f64) -> f64 {
    let m = m as f64;
    let a = (-1.0 / tau).exp();
    // 2 sum_{k=1}^{m-1} (m - k) a^k / (m (m - 1)).
    let sum = a * (m * (1.0 - a) - (1.0 - a.powf(m))) / (1.0 - a).powi(2);
    2.0 * sum / (m * (m - 1.0))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::thermal::synthetic::Random;

    /// White noise of one unit in blocks of three, in some of which a row is not used and another one is a spike.
    #[test]
    fn a_spike_in_a_block_of_two_rows_is_seen() {
        let mut random = Random::new(4);
        let n = 1200;
        let (lost, spike) = (|k: &usize| k % 60 == 16, |k: &usize| k % 120 == 17);
        let y = |k| random.normal() + if spike(&k) { 100.0 } else { 0.0 };
        let times_s: Vec<f64> = (0..n).map(|k| k as f64).collect();
        let plain = Problem {
            line: Timeline::new(&times_s, vec![1.0; n]).unwrap(),
            y: (0..n).map(y).collect(),
            columns: vec![vec![1.0; n]],
        };
        let used: Vec<bool> = (0..n).map(|k| !lost(&k)).collect();
        let decimated = decimate(&times_s, &plain, &used, 3, true).unwrap();
        let out = |k: &usize| decimated.blocks.weights[*k] < 0.5;
        assert!((0..n).filter(|k| lost(k) || spike(k)).all(|k| out(&k)));
        let others = (0..n).filter(|k| !lost(k) && !spike(k) && out(k)).count();
        assert!(others <= 1, "{others}");
        assert!((decimated.within.sqrt() - 1.0).abs() < 0.1);
    }

    #[test]
    fn rows_of_white_noise_keep_their_weight_in_blocks_of_any_size() {
        let n = 12_000;
        for rows in [2, 3, 4, 5, 6, 7, 8, 12, 15, 30, 100] {
            let mut random = Random::new(rows as u64);
            let times_s: Vec<f64> = (0..n).map(|k| k as f64).collect();
            let plain = Problem {
                line: Timeline::new(&times_s, vec![1.0; n]).unwrap(),
                y: (0..n).map(|_| random.normal()).collect(),
                columns: vec![vec![1.0; n]],
            };
            let decimated = decimate(&times_s, &plain, &vec![true; n], rows, true).unwrap();
            let weights = &decimated.blocks.weights;
            let [less, half] = [1.0, 0.5].map(|w| weights.iter().filter(|v| **v < w).count());
            assert!(less <= n / 1000 && half <= 1, "{rows}: {less}, {half}");
        }
    }

    /// White noise of one unit in pairs of rows, with spikes of 30 in one row of forty and a step of 40 in the middle: the
    /// rows that lose their weight, and the noise of a row.
    #[test]
    fn spikes_in_pairs_of_rows_are_seen_and_a_step_is_not() {
        let mut random = Random::new(3);
        let n = 1200;
        let spike = |k: &usize| k % 40 == 17;
        let y: Vec<f64> = (0..n)
            .map(|k| {
                let step = if k < n / 2 { 0.0 } else { 40.0 };
                random.normal() + step + if spike(&k) { 30.0 } else { 0.0 }
            })
            .collect();
        let times_s: Vec<f64> = (0..n).map(|k| k as f64).collect();
        let plain = Problem {
            line: Timeline::new(&times_s, vec![1.0; n]).unwrap(),
            y,
            columns: vec![vec![1.0; n]],
        };
        let decimated = decimate(&times_s, &plain, &vec![true; n], 2, true).unwrap();
        let lost = |k: &usize| decimated.blocks.weights[*k] < 0.5;
        assert_eq!(
            (0..n).filter(lost).collect::<Vec<_>>(),
            (0..n).filter(spike).collect::<Vec<_>>()
        );
        assert!((decimated.within.sqrt() - 1.0).abs() < 0.1);
        // Not asked for, every row keeps its weight.
        let plainly = decimate(&times_s, &plain, &vec![true; n], 2, false).unwrap();
        assert!(plainly.blocks.weights.iter().all(|w| *w == 1.0));
    }
}
