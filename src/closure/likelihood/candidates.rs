//! Scores of candidate effects: a dictionary of groups, each one effect on a grid of its non-linear
//! parameters, each point of the grid one or a few columns.
//!
//! Everything happens among the error contrasts of the declared regressors (what is left of a
//! whitened record after projecting them off), so that the declared model costs the candidates
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
use super::linear::{Basis, dot, dots};
use super::noise::Shape;
use super::null::bartlett;
use super::reml::Fit;
use super::tail::chi_square_surprise;
use super::whiten::Whitener;
use std::ops::Range;

/// A column of which less than this share survives the projection lies in the declared model: it is
/// not excited.
pub const SURVIVAL: f64 = 1e-4;

/// One candidate effect: its points, each the columns of the effect at one value of its non-linear
/// parameters, in the rows of [`Fit::problem`] ([`Fit::reduce`]).
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Group {
    /// point, column, row.
    pub points: Vec<Vec<Vec<f64>>>,
}

/// The directions of a point.
#[derive(Debug, Clone, PartialEq)]
pub struct Point {
    /// Its orthonormal columns among [`Directions::columns`]; empty if it is not excited.
    pub range: Range<usize>,
    /// Norm of each given column after the projection, per unit of its parameter, in units of the
    /// white standard deviation: one over it (times the white rms) is the parameter's standard
    /// deviation if it is the only one. 0 if not excited.
    pub excitation: Vec<f64>,
    /// The given columns that are among the directions.
    pub kept: Vec<usize>,
}

/// A dictionary at one shape of the noise: orthonormal directions of every point.
#[derive(Debug, Clone, PartialEq)]
pub struct Directions {
    /// The directions of all points, one after the other.
    pub columns: Vec<Vec<f64>>,
    /// All points of all groups in order.
    pub points: Vec<Point>,
}

impl Directions {
    /// Whitens and projects the dictionary.
    pub fn new(groups: &[Group], whitener: &Whitener, declared: &Basis) -> Self {
        let points: Vec<&Vec<Vec<f64>>> = groups.iter().flat_map(|g| &g.points).collect();
        let all: Vec<&[f64]> = points
            .iter()
            .flat_map(|p| p.iter().map(Vec::as_slice))
            .collect();
        let mut white = whitener.apply_all(&all).into_iter();
        let mut out = Directions {
            columns: Vec::with_capacity(all.len()),
            points: Vec::with_capacity(points.len()),
        };
        for point in points {
            let start = out.columns.len();
            let mut own = Basis::default();
            let (mut excitation, mut kept) = (Vec::new(), Vec::new());
            for (index, mut column) in white.by_ref().take(point.len()).enumerate() {
                let before = dot(&column, &column).sqrt();
                // A direction keeps at least [`SURVIVAL`]: one pass leaves 1e-12 of the declared model.
                declared.project_off_once(&mut column);
                let after = dot(&column, &column).sqrt();
                let excited = after > SURVIVAL * before && after.is_finite();
                excitation.push(if excited { after } else { 0.0 });
                if excited && own.push(&column) {
                    kept.push(index);
                }
            }
            out.columns.append(&mut own.q);
            out.points.push(Point {
                range: start..out.columns.len(),
                excitation,
                kept,
            });
        }
        out
    }

    /// The largest canonical correlation of two points: 1 = one explains whatever the other does.
    pub fn correlation(&self, a: usize, b: usize) -> f64 {
        let columns = |i: usize| -> &[Vec<f64>] {
            let range = self.points.get(i).map_or(0..0, |p| p.range.clone());
            self.columns.get(range).unwrap_or(&[])
        };
        let (a, b) = (columns(a), columns(b));
        if a.is_empty() || b.is_empty() {
            return 0.0;
        }
        let products = dots(a, b);
        let matrix = nalgebra::DMatrix::from_row_slice(a.len(), b.len(), &products);
        matrix
            .singular_values()
            .iter()
            .fold(0.0, |m: f64, s| m.max(*s))
            .min(1.0)
    }
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
    /// The dictionary at this shape.
    pub directions: Directions,
}

impl AtShape {
    /// Scores `signals` (rows of the problem) against the dictionary at a shape.
    pub fn new(fit: &Fit, groups: &[Group], signals: &[Vec<f64>], shape: Shape) -> Self {
        let whitener = Whitener::new(&fit.problem.line, shape);
        let declared = Basis::new(&whitener.apply_all(&fit.problem.columns));
        let directions = Directions::new(groups, &whitener, &declared);
        let mut white = whitener.apply_all(signals);
        for column in &mut white {
            declared.project_off(column);
        }
        let products = dots(&directions.columns, &white);
        let count = signals.len();
        let mut gain = vec![0.0; directions.points.len() * count];
        for (point, gain) in directions.points.iter().zip(gain.chunks_mut(count.max(1))) {
            for direction in point.range.clone() {
                let row = &products[direction * count..(direction + 1) * count];
                for (g, z) in gain.iter_mut().zip(row) {
                    *g += z * z;
                }
            }
        }
        AtShape {
            log_det: whitener.log_det + declared.log_det_gram(),
            contrasts: whitener.used.saturating_sub(declared.rank()),
            rss: white.iter().map(|c| dot(c, c)).collect(),
            gain,
            directions,
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

/// The surprise of a profiled gain in log-likelihood.
pub fn profiled_surprise(gain: f64, contrasts: usize, degrees: usize) -> f64 {
    if degrees == 0 {
        return 0.0;
    }
    let scale = bartlett(contrasts, degrees) / contrasts.max(1) as f64;
    chi_square_surprise(degrees, 2.0 * gain * scale)
}
