//! Sums of products of the columns over the training rows, and least squares in them.

use super::columns::{ALL, HAT, LINE, Model, Rows, SEGMENT, TRUNCATED, chunks};
use super::input::{Capture, GROUPS, Part};
use crate::statistics::linear::dot;

/// A column of the joint fit: a fixed sum of columns of both channels.
#[derive(Debug, Clone, PartialEq)]
pub struct Combo {
    /// Channel, column, factor.
    pub parts: Vec<(usize, usize, f64)>,
    /// The parameter's name; its value is coefficient times `unit`.
    pub name: String,
    /// See `name`.
    pub unit: f64,
}

impl Combo {
    /// A sum of columns under a parameter's name.
    pub fn new(name: &str, unit: f64, parts: &[(usize, usize, f64)]) -> Self {
        Combo {
            parts: parts.to_vec(),
            name: name.to_owned(),
            unit,
        }
    }

    /// One column of one channel.
    pub fn one(name: &str, channel: usize, column: usize) -> Self {
        Combo::new(name, 1.0, &[(channel, column, 1.0)])
    }
}

/// Weighted sums of products, by group of training segments.
#[derive(Debug, Clone)]
pub struct Gram {
    /// By group, channel: (ALL + 1)^2, the target last.
    sums: Vec<[Vec<f64>; 2]>,
    /// Of all groups.
    total: [Vec<f64>; 2],
}

const SIDE: usize = ALL + 1;

/// What is summed: all columns or some, of all training rows or of every `stride`-th chunk.
#[derive(Debug, Clone)]
pub struct Summed {
    /// By channel, ascending; the hat functions and the segments are not among them.
    columns: [Vec<usize>; 2],
    hats: bool,
    segments: bool,
    stride: usize,
}

impl Summed {
    /// All columns that are not identically zero.
    pub fn all(model: &Model, stride: usize) -> Self {
        Summed {
            columns: [active(model, 0), active(model, 1)],
            hats: true,
            segments: true,
            stride,
        }
    }

    /// Those of these combos.
    pub fn of(combos: &[&Combo], stride: usize) -> Self {
        let parts = || combos.iter().flat_map(|c| &c.parts);
        let columns = [0, 1].map(|channel: usize| {
            let own = parts().filter(|p| p.0 == channel && p.1 < HAT);
            let columns: std::collections::BTreeSet<usize> = own.map(|p| p.1).collect();
            columns.into_iter().collect()
        });
        Summed {
            columns,
            hats: parts().any(|p| (HAT..SEGMENT).contains(&p.1)),
            segments: parts().any(|p| p.1 >= SEGMENT),
            stride,
        }
    }
}

/// The columns that are not identically zero.
fn active(model: &Model, channel: usize) -> Vec<usize> {
    (0..HAT)
        .filter(|k| match *k {
            super::columns::OTHER => channel == 1,
            k if k >= TRUNCATED => model.truncation.is_some(),
            k if k >= LINE => k < LINE + 2 * model.lines.len(),
            _ => true,
        })
        .collect()
}

impl Gram {
    /// One pass over the training rows.
    pub fn of(capture: &Capture, model: &Model) -> Gram {
        Gram::over(capture, model, &Summed::all(model, 1))
    }

    /// The same of some columns or rows.
    pub fn over(capture: &Capture, model: &Model, summed: &Summed) -> Gram {
        let zero = || [vec![0.0; SIDE * SIDE], vec![0.0; SIDE * SIDE]];
        // One thread a group, each with its own sums: the bits do not depend on their number.
        let mut sums: Vec<[Vec<f64>; 2]> = (0..GROUPS).map(|_| zero()).collect();
        std::thread::scope(|scope| {
            for (group, sums) in sums.iter_mut().enumerate() {
                scope.spawn(move || add_group(capture, model, group, summed, sums));
            }
        });
        let mut total = zero();
        for group in &mut sums {
            for (channel, sum) in group.iter_mut().enumerate() {
                mirror(sum);
                for (t, s) in total[channel].iter_mut().zip(sum.iter()) {
                    *t += s;
                }
            }
        }
        Gram { sums, total }
    }

    /// The sums of all training rows.
    pub fn all(&self) -> &[Vec<f64>; 2] {
        &self.total
    }

    /// The sums of some groups.
    pub fn half(&self, groups: &[usize]) -> [Vec<f64>; 2] {
        let mut out = [vec![0.0; SIDE * SIDE], vec![0.0; SIDE * SIDE]];
        for group in groups.iter().filter_map(|g| self.sums.get(*g)) {
            for (o, s) in out.iter_mut().zip(group) {
                for (o, s) in o.iter_mut().zip(s) {
                    *o += s;
                }
            }
        }
        out
    }
}

fn add_group(
    capture: &Capture,
    model: &Model,
    group: usize,
    summed: &Summed,
    sums: &mut [Vec<f64>; 2],
) {
    let mut rows = Rows::new();
    let mut weighted = vec![0.0; super::columns::CHUNK];
    for segment in capture
        .segments
        .iter()
        .filter(|s| s.part == Part::Train(group))
    {
        for chunk in chunks(segment.rows.clone()).step_by(summed.stride) {
            let n = chunk.len();
            rows.fill(capture, model, chunk);
            for (channel, sum) in sums.iter_mut().enumerate() {
                add_chunk(&rows, channel, summed, n, &mut weighted, sum);
            }
        }
    }
}

fn add_chunk(
    rows: &Rows,
    channel: usize,
    summed: &Summed,
    n: usize,
    weighted: &mut [f64],
    sum: &mut [f64],
) {
    let used = &summed.columns[channel];
    let dense = &rows.dense[channel];
    let weight = &rows.weight[channel][..n];
    let target = &rows.target[channel][..n];
    let hats = &rows.hats[channel][..n];
    let segments = &rows.segments[channel][..n];
    for (position, a) in used.iter().enumerate() {
        let column = &dense[*a][..n];
        for ((out, c), w) in weighted.iter_mut().zip(column).zip(weight) {
            *out = c * w;
        }
        let weighted = &weighted[..n];
        for b in &used[position..] {
            sum[a * SIDE + b] += dot(weighted, &dense[*b][..n]);
        }
        sum[a * SIDE + ALL] += dot(weighted, target);
        if summed.hats {
            for (value, (k, part)) in weighted.iter().zip(hats) {
                let at = a * SIDE + HAT + k;
                sum[at] += value * (1.0 - part);
                sum[at + 1] += value * part;
            }
        }
        if summed.segments {
            for (value, k) in weighted.iter().zip(segments) {
                sum[a * SIDE + SEGMENT + k] += value;
            }
        }
    }
    let sparse = hats.iter().zip(segments);
    for ((w, y), ((k, part), segment)) in weight.iter().zip(target).zip(sparse) {
        sum[ALL * SIDE + ALL] += w * y * y;
        let segment = SEGMENT + segment;
        if summed.segments {
            sum[segment * SIDE + segment] += w;
            sum[segment * SIDE + ALL] += w * y;
        }
        if !summed.hats {
            continue;
        }
        let (k, first) = (HAT + k, 1.0 - part);
        sum[k * SIDE + k] += w * first * first;
        sum[k * SIDE + k + 1] += w * first * part;
        sum[(k + 1) * SIDE + k + 1] += w * part * part;
        sum[k * SIDE + ALL] += w * first * y;
        sum[(k + 1) * SIDE + ALL] += w * part * y;
        if summed.segments {
            sum[k * SIDE + segment] += w * first;
            sum[(k + 1) * SIDE + segment] += w * part;
        }
    }
}

fn mirror(sum: &mut [f64]) {
    for a in 0..SIDE {
        for b in 0..a {
            sum[a * SIDE + b] = sum[b * SIDE + a];
        }
    }
}

/// How much of the solution is wanted.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Detail {
    /// Gain and rank.
    Gain,
    /// Coefficients and their standard deviations too.
    All,
}

/// What least squares found.
#[derive(Debug, Clone, Default)]
pub struct Solved {
    /// Half the reduction of chi-square: the gain in log-likelihood.
    pub gain: f64,
    /// Coefficients of the combos; 0 where one depends on those before it.
    pub coefficients: Vec<f64>,
    /// Their standard deviations.
    pub stds: Vec<f64>,
    /// Number of independent combos.
    pub rank: usize,
}

/// Sum of products of two combos.
fn product(sums: &[Vec<f64>; 2], a: &Combo, b: &Combo) -> f64 {
    let mut out = 0.0;
    for (ca, ka, fa) in &a.parts {
        for (_, kb, fb) in b.parts.iter().filter(|p| p.0 == *ca) {
            out += fa * fb * sums[*ca][ka * SIDE + kb];
        }
    }
    out
}

/// Weighted least squares of the target on combos; `ridge` is one over the prior variance of each
/// (0: free). Combos that lie in the span of those before them are left out.
pub fn solve(sums: &[Vec<f64>; 2], combos: &[&Combo], ridge: &[f64], detail: Detail) -> Solved {
    let target = |a: &&Combo| -> f64 {
        let parts = a.parts.iter();
        parts.map(|(c, k, f)| f * sums[*c][k * SIDE + ALL]).sum()
    };
    let right: Vec<f64> = combos.iter().map(target).collect();
    let (lower, used) = factor(sums, combos, ridge);
    back(&lower, &right, &used, detail)
}

/// Coefficients by channel and column out of combos.
pub fn spread(combos: &[&Combo], solved: &Solved) -> [Vec<f64>; 2] {
    let mut out = [vec![0.0; ALL], vec![0.0; ALL]];
    for (combo, value) in combos.iter().zip(&solved.coefficients) {
        for (channel, column, factor) in &combo.parts {
            if let Some(v) = out[*channel].get_mut(*column) {
                *v += factor * value;
            }
        }
    }
    out
}

/// Standard deviations of weighted sums of the coefficients that [`solve`] finds; `weights` are by combo.
pub fn deviations(
    sums: &[Vec<f64>; 2],
    combos: &[&Combo],
    ridge: &[f64],
    weights: &[Vec<f64>],
) -> Vec<f64> {
    let (lower, used) = factor(sums, combos, ridge);
    // w' (L L')^-1 w is the square of L^-1 w.
    let deviation = |w: &Vec<f64>| (2.0 * back(&lower, w, &used, Detail::Gain).gain).sqrt();
    weights.iter().map(deviation).collect()
}

/// The lower Cholesky factor of the combos' sums of products, and which of them are independent.
fn factor(sums: &[Vec<f64>; 2], combos: &[&Combo], ridge: &[f64]) -> (Vec<f64>, Vec<bool>) {
    let n = combos.len();
    let mut matrix = vec![0.0; n * n];
    for (i, a) in combos.iter().enumerate() {
        for (j, b) in combos.iter().enumerate().take(i + 1) {
            matrix[i * n + j] = product(sums, a, b);
        }
    }
    let diagonal: Vec<f64> = (0..n).map(|i| matrix[i * n + i]).collect();
    for (i, r) in ridge.iter().enumerate().take(n) {
        matrix[i * n + i] += r;
    }
    // Cholesky in the given order; a pivot below 1e-9 of its diagonal is a dependent column.
    let mut used = vec![true; n];
    for i in 0..n {
        for j in 0..=i {
            if !used[j] {
                continue;
            }
            let (row_i, row_j) = (&matrix[i * n..i * n + j], &matrix[j * n..j * n + j]);
            let rest = matrix[i * n + j] - dot(row_i, row_j);
            if i == j {
                let least = 1e-9 * diagonal[i];
                used[i] = rest > least && rest > 0.0 && rest.is_finite();
                matrix[i * n + i] = if used[i] { rest.sqrt() } else { 0.0 };
            } else {
                matrix[i * n + j] = rest / matrix[j * n + j];
            }
        }
        if !used[i] {
            matrix[i * n..(i + 1) * n].fill(0.0);
            for k in i + 1..n {
                matrix[k * n + i] = 0.0;
            }
        }
    }
    (matrix, used)
}

/// Forward and backward substitution, and the inverse's diagonal.
fn back(lower: &[f64], right: &[f64], used: &[bool], detail: Detail) -> Solved {
    let n = right.len();
    let mut forward = vec![0.0; n];
    for i in (0..n).filter(|i| used[*i]) {
        let known = dot(&lower[i * n..i * n + i], &forward[..i]);
        forward[i] = (right[i] - known) / lower[i * n + i];
    }
    let gain = 0.5 * dot(&forward, &forward);
    let rank = used.iter().filter(|u| **u).count();
    if detail == Detail::Gain {
        return Solved {
            gain,
            rank,
            ..Solved::default()
        };
    }
    let mut coefficients = vec![0.0; n];
    for i in (0..n).rev().filter(|i| used[*i]) {
        let known: f64 = (i + 1..n).map(|k| lower[k * n + i] * coefficients[k]).sum();
        coefficients[i] = (forward[i] - known) / lower[i * n + i];
    }
    // Columns of the inverse of the factor; variance i = sum over k of (L^-1)_ki^2.
    let mut stds = vec![0.0; n];
    for i in (0..n).filter(|i| used[*i]) {
        let mut column = vec![0.0; n];
        let mut variance = 0.0;
        for k in (i..n).filter(|k| used[*k]) {
            let unit = if k == i { 1.0 } else { 0.0 };
            column[k] =
                (unit - dot(&lower[k * n + i..k * n + k], &column[i..k])) / lower[k * n + k];
            variance += column[k] * column[k];
        }
        stds[i] = variance.sqrt();
    }
    Solved {
        gain,
        coefficients,
        stds,
        rank,
    }
}
