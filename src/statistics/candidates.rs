//! Scores of candidate effects: a dictionary of groups, each one effect on a grid of its non-linear
//! parameters, each point of the grid one or a few columns.
//!
//! Everything happens among the error contrasts of the declared regressors (what is left of a
//! whitened record without them, [`super::partial`]), so that the declared model costs the candidates
//! nothing but degrees of freedom. A point's likelihood ratio with the noise's shape **held** is
//! -nu ln(1 - R^2), R^2 being the share of the contrasts' sum of squares that it explains. A
//! **profiled** ratio lets the null hypothesis and the candidate each choose the shape that suits
//! it best: a true effect that the null must explain as drift of the noise is not measured against
//! that drift. Shapes are those of a fixed grid ([`Grid`]): the posterior of the lattice under the null, and whiter
//! ones.
//!
//! Ratios of different degrees of freedom are compared by their surprise, minus the logarithm of
//! the pointwise chi-square probability.

use super::lattice::{Evaluated, profile};
use super::linear::{Basis, dot};
use super::noise::Shape;
use super::partial::Partial;
use super::reml::Fit;
use super::tail::chi_square_surprise;
use super::whiten::Whitener;

/// Points whose columns are whitened and multiplied side by side: they stay in the cache.
const BATCH: usize = 16;

/// One candidate effect: its points, each the columns of the effect at one value of its non-linear
/// parameters, in the rows of [`Fit::problem`] ([`Fit::reduce`]).
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Group {
    /// point, column, row.
    pub points: Vec<Vec<Vec<f64>>>,
}

/// The shapes of the noise that scores are taken over.
#[derive(Debug, Clone, PartialEq)]
pub struct Grid {
    /// The most likely shape first.
    pub shapes: Vec<Shape>,
    /// Posterior probability of each under the null hypothesis, all lattice points being equally
    /// likely a priori; 0 for those that are there for the candidates' sake.
    pub weights: Vec<f64>,
}

/// Posterior that the grid may leave out, and most of its points.
const LEFT_OUT: f64 = 0.04;
const POSTERIOR_POINTS: usize = 9;

/// Of the shapes every so many are enough to find best points.
const EVERY: usize = 3;

impl Grid {
    /// Every third shape, the most likely one among them.
    pub fn thinned(&self) -> Self {
        Grid {
            shapes: self.shapes.iter().copied().step_by(EVERY).collect(),
            weights: self.weights.iter().copied().step_by(EVERY).collect(),
        }
    }

    /// The grid of a fit: the likeliest lattice points, and shapes whiter than the best one.
    pub fn new(fit: &Fit) -> Self {
        let mut order: Vec<&Evaluated> = fit.lattice.iter().collect();
        order.sort_by(|a, b| b.loglik.total_cmp(&a.loglik));
        let best = order.first().map_or(0.0, |e| e.loglik);
        let weight = |e: &Evaluated| (e.loglik - best).exp();
        let total: f64 = order.iter().map(|e| weight(e)).sum();
        let mut out = Grid {
            shapes: Vec::new(),
            weights: Vec::new(),
        };
        let mut sum = 0.0;
        for e in order.iter().take(POSTERIOR_POINTS) {
            if sum > (1.0 - LEFT_OUT) * total {
                break;
            }
            sum += weight(e);
            out.shapes.push(e.shape);
            out.weights.push(weight(e));
        }
        for w in &mut out.weights {
            *w /= sum.max(f64::MIN_POSITIVE);
        }
        let mode = out.shapes.first().copied().unwrap_or_default();
        for flicker in [1.0, 0.1, 0.0] {
            for walk in [1.0, 0.05, 0.0] {
                let whiter = Shape {
                    flicker: mode.flicker * flicker,
                    walk: mode.walk * walk,
                };
                if !out.shapes.contains(&whiter) {
                    out.shapes.push(whiter);
                    out.weights.push(0.0);
                }
            }
        }
        out
    }
}

/// What one shape says of several signals and all points.
pub struct AtShape {
    /// ln det V + ln det X' V^-1 X.
    pub log_det: f64,
    /// Error contrasts.
    pub contrasts: usize,
    /// Sum of squares of the contrasts, by signal.
    pub rss: Vec<f64>,
    /// What each point explains of it: [point * signals + signal].
    pub gain: Vec<f64>,
    /// Columns of each point that are excited.
    pub degrees: Vec<usize>,
}

impl AtShape {
    /// Scores `signals` (rows of the problem) against the dictionary at a shape.
    pub fn new(fit: &Fit, groups: &[Group], signals: &[Vec<f64>], shape: Shape) -> Self {
        let whitener = Whitener::new(&fit.problem.line, shape);
        let declared = Basis::new(&whitener.apply_all(&fit.problem.columns));
        let mut white = whitener.apply_all(signals);
        for column in &mut white {
            declared.project_off(column);
        }
        let partial = Partial::new(&declared, &white);
        let points: Vec<&Vec<Vec<f64>>> = groups.iter().flat_map(|g| &g.points).collect();
        let count = signals.len();
        let mut gain = vec![0.0; points.len() * count];
        let mut degrees = Vec::with_capacity(points.len());
        let batches = gain.chunks_mut((BATCH * count).max(1));
        for (points, gain) in points.chunks(BATCH).zip(batches) {
            let columns: Vec<&[f64]> = points
                .iter()
                .flat_map(|p| p.iter().map(Vec::as_slice))
                .collect();
            let columns = whitener.apply_all(&columns);
            let products = partial.products(&columns);
            let mut next = 0;
            for (point, gain) in points.iter().zip(gain.chunks_mut(count.max(1))) {
                let own = next..next + point.len();
                next = own.end;
                degrees.push(products.explained(own, gain));
            }
        }
        AtShape {
            log_det: whitener.log_det + declared.log_det_gram(),
            contrasts: whitener.used.saturating_sub(declared.rank()),
            rss: white.iter().map(|c| dot(c, c)).collect(),
            gain,
            degrees,
        }
    }

    /// Restricted log-likelihood of the null hypothesis for a signal.
    pub fn null(&self, signal: usize) -> f64 {
        let rss = self.rss.get(signal).copied().unwrap_or(0.0);
        profile(self.contrasts, rss, self.log_det)
    }

    /// -ln(1 - R^2) of a point for a signal.
    pub fn ratio(&self, point: usize, signal: usize) -> f64 {
        let rss = self.rss.get(signal).copied().unwrap_or(0.0);
        let gain = self.gain.get(point * self.rss.len() + signal);
        let share = gain.copied().unwrap_or(0.0) / rss.max(f64::MIN_POSITIVE);
        -(-share.clamp(0.0, 1.0 - 1e-12)).ln_1p()
    }

    /// The same as a log-likelihood under the candidate.
    pub fn with_point(&self, point: usize, signal: usize) -> f64 {
        self.null(signal) + 0.5 * self.contrasts as f64 * self.ratio(point, signal)
    }
}

/// Multiplier of -ln(1 - R^2), R^2 being the share that `degrees` columns explain of `contrasts`,
/// that makes it chi-square with `degrees` degrees of freedom on average (Bartlett 1937).
pub fn bartlett(contrasts: usize, degrees: usize) -> f64 {
    (contrasts as f64 - 0.5 * degrees as f64 - 1.0).max(1.0)
}

/// The surprise of a profiled gain in log-likelihood.
pub fn profiled_surprise(gain: f64, contrasts: usize, degrees: usize) -> f64 {
    if degrees == 0 {
        return 0.0;
    }
    let scale = bartlett(contrasts, degrees) / contrasts.max(1) as f64;
    chi_square_surprise(degrees, 2.0 * gain * scale)
}
