//! How large the best of a dictionary is by chance, the noise being known but for its strength.
//!
//! Under the null hypothesis the products of a whitened residual with the dictionary's orthonormal
//! directions are normal with the directions' Gram matrix as covariance. Its pivoted Cholesky factor
//! (of the rank that the dictionary has, not of its size) turns a few independent normal numbers
//! into a draw of all products at once; what the factor leaves of a direction's variance is added as
//! independent noise, which keeps every direction's own distribution exact and errs towards a larger
//! maximum. The sum of squares that the statistics are relative to is drawn along.

use super::candidates::Directions;
use super::linear::{add_scaled, dot, dots};
use super::random::{Stream, chi_square};
use super::tail::{Tail, chi_square_surprise};

/// Share of a direction's variance that the factor may leave.
const LEFT: f64 = 0.02;

/// See `sparse_factor`.
const SMALL: f64 = 1e-4;

/// Multiplier of -ln(1 - R^2), R^2 being the share that `degrees` columns explain of `contrasts`,
/// that makes it chi-square with `degrees` degrees of freedom on average (Bartlett 1937).
pub fn bartlett(contrasts: usize, degrees: usize) -> f64 {
    (contrasts as f64 - 0.5 * degrees as f64 - 1.0).max(1.0)
}

/// The surprise (minus ln of the pointwise probability) of the best of several likelihood ratios,
/// `best[k]` being the greatest -ln(1 - R^2) among those with k degrees of freedom.
pub fn surprise(best: &[f64], contrasts: usize) -> f64 {
    best.iter()
        .enumerate()
        .skip(1)
        .filter(|(_, v)| **v > 0.0)
        .map(|(k, v)| chi_square_surprise(k, bartlett(contrasts, k) * v))
        .fold(0.0, f64::max)
}

/// The distribution of the dictionary's greatest surprise.
pub fn greatest(
    directions: &Directions,
    contrasts: usize,
    draws: usize,
    stream: impl Fn(u64) -> Stream,
) -> Tail {
    Tail::new(sampled(directions, contrasts, draws, stream, LEFT))
}

/// The draws of [`greatest`], the factor leaving at most `leave` of each direction's variance.
fn sampled(
    directions: &Directions,
    contrasts: usize,
    draws: usize,
    stream: impl Fn(u64) -> Stream,
    leave: f64,
) -> Vec<f64> {
    if draws == 0 {
        return Vec::new();
    }
    let Factor { rank, rows, left } = sparse_factor(&directions.columns, leave);
    let width = directions.points.iter().map(|p| p.range.len()).max();
    let mut best = vec![0.0; width.unwrap_or(0) + 1];
    let noisy = left.iter().filter(|l| **l > 1e-4).count();
    let mut sample = Vec::with_capacity(draws);
    let mut products = vec![0.0; rows.len()];
    for draw in 0..draws {
        let normals = stream(draw as u64).normals(rank + noisy + 1);
        let (common, own) = normals.split_at(rank);
        let mut own = own.iter();
        let last = own.next().copied().unwrap_or(0.0);
        let total = dot(common, common) + chi_square(contrasts.saturating_sub(rank) as f64, last);
        for ((product, row), left) in products.iter_mut().zip(&rows).zip(&left) {
            *product = row.iter().map(|(k, f)| f * common[*k as usize]).sum();
            if *left > 1e-4 {
                *product += left.sqrt() * own.next().copied().unwrap_or(0.0);
            }
        }
        best.fill(0.0);
        for point in &directions.points {
            let z = &products[point.range.clone()];
            let share = (dot(z, z) / total.max(f64::MIN_POSITIVE)).min(1.0 - 1e-12);
            if let Some(best) = best.get_mut(z.len()) {
                *best = f64::max(*best, share);
            }
        }
        for b in &mut best {
            *b = -(-*b).ln_1p();
        }
        sample.push(surprise(&best, contrasts));
    }
    sample
}

/// A factor of the Gram matrix, by directions.
struct Factor {
    /// Its columns.
    rank: usize,
    /// The entries of each direction's row: (column, value).
    rows: Vec<Vec<(u32, f64)>>,
    /// The variance that each row lacks.
    left: Vec<f64>,
}

/// The factor without entries that add less than [`SMALL`] to a direction's variance: those count
/// as lacking.
fn sparse_factor(columns: &[Vec<f64>], leave: f64) -> Factor {
    let (factor, mut left) = factor(columns, leave);
    let mut rows: Vec<Vec<(u32, f64)>> = vec![Vec::new(); columns.len()];
    for (k, column) in (0u32..).zip(&factor) {
        for ((row, left), f) in rows.iter_mut().zip(&mut left).zip(column) {
            if f * f < SMALL {
                *left += f * f;
            } else {
                row.push((k, *f));
            }
        }
    }
    Factor {
        rank: factor.len(),
        rows,
        left,
    }
}

/// Pivoted Cholesky factor of the Gram matrix of unit columns, column by column, and what it
/// leaves of the diagonal.
fn factor(columns: &[Vec<f64>], leave: f64) -> (Vec<Vec<f64>>, Vec<f64>) {
    let gram = gram(columns);
    let mut left = vec![1.0; columns.len()];
    let mut out: Vec<Vec<f64>> = Vec::new();
    while out.len() < columns.len() {
        let worst = (0..left.len()).fold(0, |a, b| if left[b] > left[a] { b } else { a });
        if left[worst] <= leave {
            break;
        }
        let pivot = left[worst].sqrt();
        let mut next = gram[worst].clone();
        for earlier in &out {
            add_scaled(&mut next, -earlier[worst], earlier);
        }
        for (n, l) in next.iter_mut().zip(&mut left) {
            *n /= pivot;
            *l = (*l - *n * *n).max(0.0);
        }
        left[worst] = 0.0;
        out.push(next);
    }
    (out, left)
}

/// All dot products of the columns, the symmetric half computed once.
fn gram(columns: &[Vec<f64>]) -> Vec<Vec<f64>> {
    const BLOCK: usize = 32;
    let mut out = vec![vec![0.0; columns.len()]; columns.len()];
    for start in (0..columns.len()).step_by(BLOCK) {
        let later = &columns[start..];
        let block = &later[..later.len().min(BLOCK)];
        for (i, row) in dots(block, later).chunks(later.len()).enumerate() {
            for (j, v) in row.iter().enumerate() {
                out[start + i][start + j] = *v;
                out[start + j][start + i] = *v;
            }
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::super::candidates::Point;
    use super::*;

    /// Directions of one column each.
    fn directions(columns: Vec<Vec<f64>>) -> Directions {
        let points = (0..columns.len())
            .map(|i| Point {
                range: i..i + 1,
                excitation: vec![1.0],
                kept: vec![0],
            })
            .collect();
        Directions { columns, points }
    }

    #[test]
    fn independent_and_identical_directions_have_the_known_maxima() {
        let unit =
            |k: usize| -> Vec<f64> { (0..400).map(|i| f64::from(u8::from(i == k))).collect() };
        let stream = |k| Stream::new(11, k);
        // 50 independent ones: p = 1 - (1 - q)^50; 50 equal ones: p = q.
        let many = greatest(&directions((0..50).map(unit).collect()), 397, 4000, stream);
        let one = greatest(&directions(vec![unit(3); 50]), 397, 4000, stream);
        for q in [0.02f64, 0.002, 0.0002] {
            let sidak = 1.0 - (1.0 - q).powi(50);
            let found = many.survival(-q.ln());
            assert!(
                (found / sidak - 1.0).abs() < 0.25,
                "{q}: {found} for {sidak}"
            );
        }
        for q in [0.2f64, 0.02, 0.004] {
            let found = one.survival(-q.ln());
            assert!((found / q - 1.0).abs() < 0.25, "{q}: {found}");
        }
    }

    #[test]
    fn what_the_factor_leaves_is_drawn_independently() {
        let unit = |k: usize| -> Vec<f64> {
            let near = |i: usize| match i {
                0 => 0.6,
                i if i == k + 1 => 0.8,
                _ => 0.0,
            };
            (0..60).map(near).collect()
        };
        let directions = directions((0..50).map(unit).collect());
        let stream = |k| Stream::new(12, k);
        let mean = |leave: f64| {
            let all = sampled(&directions, 5000, 4000, stream, leave);
            all.iter().sum::<f64>() / 4000.0
        };
        // All of it in the factor, and one pivot with 0.64^2 .. 1 left of the others.
        let (full, coarse) = (mean(1e-6), mean(0.9));
        assert!((full - 4.2).abs() < 0.4, "{full}");
        assert!((0.0..0.7).contains(&(coarse - full)), "{full} {coarse}");
    }

    #[test]
    fn the_factor_reproduces_the_gram_matrix() {
        let mut columns: Vec<Vec<f64>> = (0..6).map(|k| Stream::new(13, k).normals(50)).collect();
        for k in 0..30usize {
            let mut mixed = Stream::new(14, k as u64).normals(50);
            add_scaled(&mut mixed, 3.0, &columns[k % 6]);
            columns.push(mixed);
        }
        for column in &mut columns {
            let norm = dot(column, column).sqrt();
            column.iter_mut().for_each(|v| *v /= norm);
        }
        let Factor { rank, rows, left } = sparse_factor(&columns, LEFT);
        assert!(rank < 36, "{rank}");
        for (i, a) in columns.iter().enumerate() {
            for (j, b) in columns.iter().enumerate() {
                let dense = |row: &[(u32, f64)]| {
                    let mut out = vec![0.0; rank];
                    row.iter().for_each(|(k, f)| out[*k as usize] = *f);
                    out
                };
                let mut product = dot(&dense(&rows[i]), &dense(&rows[j]));
                if i == j {
                    product += left[i];
                    assert!((product - 1.0).abs() < 1e-9);
                }
                assert!((product - dot(a, b)).abs() < 2.0 * LEFT, "{i} {j}");
            }
        }
    }
}
