//! Scores of all groups of a dictionary, and how often the best of the whole dictionary is as good by
//! chance.
//!
//! The probability is that of the **greatest** score of the dictionary, so that looking at many
//! candidates costs nothing in honesty (Westfall & Young 1993): profiled scores ([`super::candidates`]) against those
//! of surrogate records drawn from the null hypothesis, each with its noise estimated anew. The shapes of
//! the surrogates' noise are drawn from its posterior under the null hypothesis: what the record does not decide about its
//! noise is not taken as known.

use super::candidates::{AtShape, Grid, Group, profiled_surprise};
use super::noise::Shape;
use super::random::Stream;
use super::reml::Fit;
use super::tail::Tail;
use super::whiten::Whitener;

/// How much to compute.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Options {
    /// Surrogate records; 0 = no bootstrap. 200 resolve p = 0.01.
    pub surrogates: usize,
    /// A third of the shapes: enough for the best point of each group, which is the same for neighbouring shapes, not for
    /// probabilities (a whiter noise may be the likeliest beside a candidate).
    pub is_thin: bool,
    /// Key of all draws.
    pub seed: u64,
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
    /// The likeliest shape of the noise if the candidate is true.
    pub shape: Shape,
    /// Probability that the best of the dictionary does as well by chance, by surrogates.
    pub p_bootstrap: Option<f64>,
}

/// The scores of a dictionary.
#[derive(Clone)]
pub struct Scores {
    /// One per group, in order.
    pub groups: Vec<GroupScore>,
    /// Shapes that were looked at.
    pub grid: Grid,
    /// How great the greatest surprise is by chance, if that was asked.
    pub by_chance: Option<Tail>,
}

impl Scores {
    /// The same with probabilities by surrogates of another null hypothesis.
    pub fn judged_by(mut self, tail: &Tail) -> Self {
        for group in &mut self.groups {
            group.p_bootstrap = Some(tail.survival(group.profiled));
        }
        self
    }

    /// Whether the leader's probability, or there being none, lies outside an interval.
    pub fn is_clear(&self, doubt: (f64, f64)) -> bool {
        self.leading_p().is_none_or(|p| p < doubt.0 || p > doubt.1)
    }

    /// Whether there is a leader whose probability is smaller.
    pub fn is_below(&self, p: f64) -> bool {
        self.leading_p().is_some_and(|own| own < p)
    }

    fn leading_p(&self) -> Option<f64> {
        self.leader().and_then(|g| self.groups[g].p_bootstrap)
    }

    /// The group with the greatest gain.
    pub fn greatest(&self) -> Option<usize> {
        let gain = |g: &usize| self.groups[*g].gain;
        (0..self.groups.len()).max_by(|a, b| gain(a).total_cmp(&gain(b)))
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
#[derive(Default)]
struct Profile {
    /// Best log-likelihood with each point, [point * signals + signal], and for the record itself
    /// the shape it was reached at.
    with: Vec<f64>,
    shapes: Vec<Shape>,
    /// Best under the null, by signal.
    null: Vec<f64>,
    /// Columns of each point that are excited, at the likeliest shape.
    degrees: Vec<usize>,
    contrasts: usize,
}

/// Scores all groups. See the module.
pub fn score(fit: &Fit, groups: &[Group], options: &Options) -> Scores {
    let grid = Grid::new(fit);
    let mut signals = vec![fit.problem.y.clone()];
    signals.extend(surrogates(fit, &grid, options));
    let looked = match options.is_thin {
        true => grid.thinned(),
        false => grid.clone(),
    };
    let mut profile = Profile::default();
    for shape in &looked.shapes {
        profile.add(&AtShape::new(fit, groups, &signals, *shape), *shape);
    }
    let by_chance = profile.by_chance();
    Scores {
        groups: profile.scores(groups, by_chance.as_ref()),
        grid,
        by_chance,
    }
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
    fn add(&mut self, at: &AtShape, shape: Shape) {
        let signals = at.rss.len();
        if self.null.is_empty() {
            self.null = vec![f64::NEG_INFINITY; signals];
            self.with = vec![f64::NEG_INFINITY; at.gain.len()];
            self.shapes = vec![shape; at.degrees.len()];
            self.degrees.clone_from(&at.degrees);
            self.contrasts = at.contrasts;
        }
        let null: Vec<f64> = (0..signals).map(|s| at.null(s)).collect();
        for (best, now) in self.null.iter_mut().zip(&null) {
            *best = best.max(*now);
        }
        let half = 0.5 * at.contrasts as f64;
        let excited = (0..at.degrees.len()).filter(|p| at.degrees[*p] > 0);
        for point in excited {
            for (signal, null) in null.iter().enumerate() {
                let with = &mut self.with[point * signals + signal];
                let now = null + half * at.ratio(point, signal);
                if now > *with {
                    *with = now;
                    if signal == 0 {
                        self.shapes[point] = shape;
                    }
                }
            }
        }
    }

    /// Gain in log-likelihood of a point for a signal, and its surprise.
    fn gained(&self, point: usize, signal: usize) -> (f64, f64) {
        let gain = self.with[point * self.null.len() + signal] - self.null[signal];
        let surprise = profiled_surprise(gain, self.contrasts, self.degrees[point]);
        (gain, surprise)
    }

    /// The distribution of the greatest surprise, by the surrogates.
    fn by_chance(&self) -> Option<Tail> {
        let greatest = |signal: usize| {
            let each = (0..self.degrees.len()).map(|p| self.gained(p, signal).1);
            each.fold(0.0, f64::max)
        };
        let sample: Vec<f64> = (1..self.null.len()).map(greatest).collect();
        (!sample.is_empty()).then(|| Tail::new(sample))
    }

    fn scores(&self, groups: &[Group], by_chance: Option<&Tail>) -> Vec<GroupScore> {
        let mut next = 0;
        let each = groups.iter().map(|group| {
            let points = next..next + group.points.len();
            next = points.end;
            let excited = points.clone().filter(|p| self.degrees.get(*p) > Some(&0));
            let chosen = excited
                .map(|p| (p, self.gained(p, 0)))
                .reduce(|a, b| if b.1.1 > a.1.1 { b } else { a });
            let (gain, profiled) = chosen.map_or((0.0, 0.0), |c| c.1);
            GroupScore {
                point: chosen.map(|c| c.0 - points.start),
                degrees: chosen.map_or(0, |c| self.degrees[c.0]),
                gain,
                profiled,
                shape: chosen.map_or(Shape::default(), |c| self.shapes[c.0]),
                p_bootstrap: by_chance.map(|t| t.survival(profiled)),
            }
        });
        each.collect()
    }
}
