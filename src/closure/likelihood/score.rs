//! Scores of all groups of a dictionary, and how often the best of the whole dictionary is as good by
//! chance.
//!
//! Two probabilities, both for the **greatest** score of the dictionary, so that looking at many
//! candidates costs nothing in honesty (Westfall & Young 1993):
//!
//! - [`GroupScore::p_fast`]: shape of the noise held, its strength not ([`super::null`]), averaged
//!   over the posterior of the shape under the null hypothesis (posterior predictive probability; Meng 1994): what the record does
//!   not decide about its noise is not taken as known.
//! - [`GroupScore::p_bootstrap`]: profiled scores ([`super::candidates`]) against those of surrogate
//!   records drawn from the null hypothesis, shapes from the same posterior, each surrogate with
//!   its noise estimated anew. [`GroupScore::p_fast_bootstrap`] puts `p_fast` itself to that test.

use super::candidates::{AtShape, Directions, Grid, Group, profiled_surprise};
use super::lattice::Problem;
use super::linear::add_scaled;
use super::noise::Shape;
use super::null::{bartlett, greatest, surprise};
use super::random::Stream;
use super::reml::Fit;
use super::tail::{Tail, chi_square_surprise};
use super::whiten::Whitener;

/// How much to compute.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Options {
    /// Draws of the dictionary's greatest score at known shape; 0 = no [`GroupScore::p_fast`] (it is 1).
    pub draws: usize,
    /// Surrogate records; 0 = no bootstrap. 200 resolve p = 0.01.
    pub surrogates: usize,
    /// Key of all draws.
    pub seed: u64,
}

impl Default for Options {
    fn default() -> Self {
        Options {
            draws: 2000,
            surrogates: 0,
            seed: 1,
        }
    }
}

/// What the record says of one group.
#[derive(Debug, Clone, PartialEq)]
pub struct GroupScore {
    /// The best point by the profiled likelihood; `None` if no point is excited.
    pub point: Option<usize>,
    /// Its degrees of freedom.
    pub degrees: usize,
    /// Its gain in log-likelihood over the null hypothesis, shape profiled on both sides.
    pub gain: f64,
    /// Surprise of that gain by itself (minus ln p, pointwise).
    pub profiled: f64,
    /// Surprise of the group's best point at the null's most likely shape.
    pub held: f64,
    /// The likeliest shape of the noise if the candidate is true.
    pub shape: Shape,
    /// Coefficients of the point's columns under that shape, beside the declared regressors.
    pub beta: Vec<f64>,
    /// Their standard deviations.
    pub beta_std: Vec<f64>,
    /// Norm of each column per unit of its parameter ([`super::candidates::Point::excitation`]),
    /// at the null's most likely shape.
    pub excitation: Vec<f64>,
    /// Probability that the best of the dictionary does as well by chance.
    pub p_fast: f64,
    /// The same for the profiled score, by surrogates.
    pub p_bootstrap: Option<f64>,
    /// The same for `p_fast`, by surrogates.
    pub p_fast_bootstrap: Option<f64>,
}

/// The scores of a dictionary.
pub struct Scores {
    /// One per group, in order.
    pub groups: Vec<GroupScore>,
    /// Shapes that were looked at.
    pub grid: Grid,
    /// The dictionary at the null's most likely shape: correlations.
    pub directions: Directions,
    /// Index among the directions' points of each group's best point.
    best: Vec<Option<usize>>,
}

impl Scores {
    /// Canonical correlation of the best points of two groups, after projection, whitened.
    pub fn correlation(&self, a: usize, b: usize) -> f64 {
        match (self.best.get(a), self.best.get(b)) {
            (Some(Some(a)), Some(Some(b))) => self.directions.correlation(*a, *b),
            _ => 0.0,
        }
    }

    /// The group with the greatest profiled surprise.
    pub fn leader(&self) -> Option<usize> {
        (0..self.groups.len())
            .filter(|g| self.groups[*g].point.is_some())
            .reduce(|a, b| {
                if self.groups[b].profiled > self.groups[a].profiled {
                    b
                } else {
                    a
                }
            })
    }
}

/// Running results over the shapes of the grid.
struct Profile {
    /// Best log-likelihood with each point: [point * signals + signal], and for the record itself
    /// the shape it was reached at.
    with: Vec<f64>,
    shapes: Vec<Shape>,
    /// Best under the null, by signal.
    null: Vec<f64>,
    /// By shape: log-likelihood under the null and greatest held surprise, by signal.
    by_shape: Vec<(Vec<f64>, Vec<f64>)>,
    /// By shape: held surprise of each group, for the record itself.
    held: Vec<Vec<f64>>,
}

/// Scores all groups. See the module.
pub fn score(fit: &Fit, groups: &[Group], options: &Options) -> Scores {
    let grid = Grid::new(fit);
    let mut signals = vec![fit.problem.y.clone()];
    signals.extend(surrogates(fit, &grid, options));
    let owner = owners(groups);
    let mut profile = Profile {
        with: vec![f64::NEG_INFINITY; owner.len() * signals.len()],
        shapes: vec![Shape::default(); owner.len()],
        null: vec![f64::NEG_INFINITY; signals.len()],
        by_shape: Vec::new(),
        held: Vec::new(),
    };
    let mut first: Option<(AtShape, Tail)> = None;
    // Without surrogates only the best point of each group is asked for, and it is the same for
    // neighbouring shapes.
    let looked = if options.surrogates == 0 && options.draws == 0 {
        grid.thinned()
    } else {
        grid.clone()
    };
    for shape in &looked.shapes {
        let at = AtShape::new(fit, groups, &signals, *shape);
        profile.add(&at, *shape, &owner, groups.len());
        if first.is_none() {
            let tail = greatest(&at.directions, at.contrasts, options.draws, |k| {
                Stream::new(options.seed, 1 + 2 * k)
            });
            first = Some((at, tail));
        }
    }
    let Some((at, tail)) = first else {
        return Scores {
            groups: Vec::new(),
            grid,
            directions: Directions {
                columns: Vec::new(),
                points: Vec::new(),
            },
            best: Vec::new(),
        };
    };
    let scores = finish(fit, groups, looked, at, &tail, &profile, &owner);
    Scores { grid, ..scores }
}

/// The group of each point.
fn owners(groups: &[Group]) -> Vec<usize> {
    let each = groups.iter().enumerate();
    each.flat_map(|(g, group)| std::iter::repeat_n(g, group.points.len()))
        .collect()
}

/// Records of the null hypothesis: noise of shapes in proportion to their posterior.
fn surrogates(fit: &Fit, grid: &Grid, options: &Options) -> Vec<Vec<f64>> {
    let whiteners: Vec<Whitener> = grid
        .shapes
        .iter()
        .zip(&grid.weights)
        .filter(|(_, w)| **w > 0.0)
        .map(|(s, _)| Whitener::new(&fit.problem.line, *s))
        .collect();
    let n = fit.problem.line.len();
    (0..options.surrogates)
        .filter_map(|k| {
            let mut rank = (k as f64 + 0.5) / options.surrogates as f64;
            let mut chosen = whiteners.first();
            for (whitener, w) in whiteners.iter().zip(&grid.weights) {
                chosen = Some(whitener);
                rank -= w;
                if rank < 0.0 {
                    break;
                }
            }
            let white = Stream::new(options.seed, 2 * k as u64).normals(n);
            chosen.map(|w| w.colour(&white))
        })
        .collect()
}

impl Profile {
    fn add(&mut self, at: &AtShape, shape: Shape, owner: &[usize], groups: usize) {
        let count = self.null.len();
        let widest = at.directions.points.iter().map(|p| p.range.len()).max();
        let width = widest.unwrap_or(0) + 1;
        let mut best = vec![0.0f64; width * count];
        let mut held = vec![0.0f64; groups];
        let half = 0.5 * at.contrasts as f64;
        let null: Vec<f64> = (0..count).map(|s| at.null(s)).collect();
        for (point, group) in owner.iter().enumerate() {
            let degrees = at.directions.points[point].range.len();
            if degrees == 0 {
                continue;
            }
            for signal in 0..count {
                let ratio = at.ratio(point, signal);
                let with = &mut self.with[point * count + signal];
                let now = null[signal] + half * ratio;
                if now > *with {
                    *with = now;
                    if signal == 0 {
                        self.shapes[point] = shape;
                    }
                }
                let best = &mut best[signal * width + degrees];
                *best = best.max(ratio);
                if signal == 0 {
                    let x = bartlett(at.contrasts, degrees) * ratio;
                    held[*group] = held[*group].max(chi_square_surprise(degrees, x));
                }
            }
        }
        for (total, now) in self.null.iter_mut().zip(&null) {
            *total = total.max(*now);
        }
        let greatest = best.chunks(width).map(|b| surprise(b, at.contrasts));
        self.by_shape.push((null, greatest.collect()));
        self.held.push(held);
    }

    /// Posterior weights of the grid's shapes under the null for a signal.
    fn weights(&self, grid: &Grid, signal: usize) -> Vec<f64> {
        let loglik = |g: usize| self.by_shape[g].0[signal];
        let eligible: Vec<usize> = (0..grid.weights.len())
            .filter(|g| grid.weights[*g] > 0.0)
            .collect();
        let best = eligible
            .iter()
            .map(|g| loglik(*g))
            .fold(f64::NEG_INFINITY, f64::max);
        let mut out = vec![0.0; grid.weights.len()];
        for g in &eligible {
            out[*g] = (loglik(*g) - best).exp();
        }
        let sum: f64 = out.iter().sum();
        for w in &mut out {
            *w /= sum.max(f64::MIN_POSITIVE);
        }
        out
    }

    /// The mixture of [`GroupScore::p_fast`] for surprises by shape.
    fn mixture(&self, weights: &[f64], tail: &Tail, of: impl Fn(usize) -> f64) -> f64 {
        let each = weights.iter().enumerate().filter(|(_, w)| **w > 0.0);
        each.map(|(g, w)| w * tail.survival(of(g))).sum()
    }
}

fn finish(
    fit: &Fit,
    groups: &[Group],
    grid: Grid,
    at: AtShape,
    tail: &Tail,
    profile: &Profile,
    owner: &[usize],
) -> Scores {
    let count = profile.null.len();
    let surprise_of = |point: usize, signal: usize| -> f64 {
        let gain = profile.with[point * count + signal] - profile.null[signal];
        let degrees = at.directions.points[point].range.len();
        profiled_surprise(gain, at.contrasts, degrees)
    };
    let mut greatest = vec![0.0f64; count];
    for (signal, greatest) in greatest.iter_mut().enumerate() {
        for point in 0..owner.len() {
            *greatest = greatest.max(surprise_of(point, signal));
        }
    }
    let bootstrap = (count > 1).then(|| {
        let fast = (1..count).map(|s| {
            let weights = profile.weights(&grid, s);
            -profile
                .mixture(&weights, tail, |g| profile.by_shape[g].1[s])
                .ln()
        });
        (Tail::new(greatest[1..].to_vec()), Tail::new(fast.collect()))
    });
    let weights = profile.weights(&grid, 0);
    let mut start = 0;
    let (mut out, mut best) = (Vec::new(), Vec::new());
    for (g, group) in groups.iter().enumerate() {
        let points = start..start + group.points.len();
        start = points.end;
        let chosen = points
            .clone()
            .filter(|p| !at.directions.points[*p].range.is_empty())
            .map(|p| (p, surprise_of(p, 0)))
            .reduce(|a, b| if b.1 > a.1 { b } else { a });
        best.push(chosen.map(|c| c.0));
        // Nothing excited is no evidence.
        let p_fast = chosen.map_or(1.0, |_| {
            profile.mixture(&weights, tail, |k| profile.held[k][g])
        });
        let mut score = GroupScore {
            point: chosen.map(|c| c.0 - points.start),
            degrees: 0,
            gain: 0.0,
            profiled: chosen.map_or(0.0, |c| c.1),
            held: profile.held.first().map_or(0.0, |h| h[g]),
            shape: Shape::default(),
            beta: Vec::new(),
            beta_std: Vec::new(),
            excitation: Vec::new(),
            p_fast,
            p_bootstrap: bootstrap
                .as_ref()
                .map(|(p, _)| p.survival(chosen.map_or(0.0, |c| c.1))),
            p_fast_bootstrap: bootstrap.as_ref().map(|(_, f)| f.survival(-p_fast.ln())),
        };
        if let Some((point, _)) = chosen {
            score.degrees = at.directions.points[point].range.len();
            score.gain = profile.with[point * count] - profile.null[0];
            score.shape = profile.shapes[point];
            score.excitation = at.directions.points[point].excitation.clone();
            let columns = &group.points[point - points.start];
            (score.beta, score.beta_std) = coefficients(&fit.problem, columns, score.shape);
        }
        out.push(score);
    }
    Scores {
        groups: out,
        grid,
        directions: at.directions,
        best,
    }
}

/// Coefficients of further columns, and their standard deviations, under a shape of the noise.
fn coefficients(problem: &Problem, columns: &[Vec<f64>], shape: Shape) -> (Vec<f64>, Vec<f64>) {
    let mut with = problem.clone();
    with.columns.extend_from_slice(columns);
    let (mut y, basis) = with.whiten(&Whitener::new(&with.line, shape));
    let z = basis.project_off(&mut y);
    let beta = basis.solve(&z);
    let degrees = with.line.used().saturating_sub(basis.rank()).max(1) as f64;
    let variance = super::linear::dot(&y, &y) / degrees;
    let inverse = basis.inverse_gram();
    let from = problem.columns.len();
    let std = (from..beta.len()).map(|i| (variance * inverse[(i, i)]).sqrt());
    (beta[from..].to_vec(), std.collect())
}

/// The signal less what given coefficients of the regressors explain, rows of the problem.
pub fn residual(problem: &Problem, beta: &[f64]) -> Vec<f64> {
    let mut out = problem.y.clone();
    for (column, b) in problem.columns.iter().zip(beta) {
        add_scaled(&mut out, -b, column);
    }
    out
}
