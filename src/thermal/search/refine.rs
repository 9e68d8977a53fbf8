//! Non-linear parameters, and likelihoods of a few shapes under every noise of the grid.

use super::Model;
use crate::statistics::candidates::{AtShape, Grid, Group};
use crate::statistics::lattice::Problem;
use crate::statistics::linear::{Basis, dot};
use crate::statistics::noise::Shape;
use crate::statistics::partial::Partial;
use crate::statistics::reml::Fit;
use crate::statistics::whiten::Whitener;
use crate::thermal::channels::Channels;
use crate::thermal::effects::{Bias, Candidate, Point};

/// One noise, ready for many columns.
pub struct Bench<'a> {
    fit: &'a Fit,
    /// Beside which candidates are judged; `None`: columns show in all rows.
    model: Option<&'a Model>,
    whitener: Whitener,
    declared: Basis,
    /// The whitened signal without the declared regressors, and its sum of squares.
    y: Vec<f64>,
    square: f64,
}

impl<'a> Bench<'a> {
    /// For what comes beside a model, and a shape of its noise.
    pub fn new(model: &'a Model, shape: Shape) -> Self {
        Bench {
            model: Some(model),
            ..Self::of_problem(&model.fit, &model.fit.problem, shape)
        }
    }

    /// For other regressors than the fit's own, on the fit's rows.
    pub fn of_problem(fit: &'a Fit, problem: &Problem, shape: Shape) -> Self {
        let whitener = Whitener::new(&problem.line, shape);
        let (mut y, declared) = problem.whiten(&whitener);
        declared.project_off(&mut y);
        Bench {
            fit,
            model: None,
            whitener,
            declared,
            square: dot(&y, &y),
            y,
        }
    }

    /// -ln(1 - R^2) of columns over the record's rows, times half the contrasts: a gain in
    /// log-likelihood at this noise.
    pub fn gain(&self, columns: &[Vec<f64>]) -> f64 {
        self.gained(columns, false)
    }

    /// The same with the sum of the columns taken as it is, its coefficient being 1.
    pub fn gain_whole(&self, columns: &[Vec<f64>]) -> f64 {
        self.gained(columns, true)
    }

    fn gained(&self, columns: &[Vec<f64>], whole: bool) -> f64 {
        let each = [(columns.len(), whole)];
        self.gains(columns, &each).first().copied().unwrap_or(0.0)
    }

    /// Gains of several shapes, by their number of columns and whether these are whole. Side by side they
    /// are whitened in the time of one.
    fn gains(&self, columns: &[Vec<f64>], each: &[(usize, bool)]) -> Vec<f64> {
        let reduced: Vec<Vec<f64>> = columns.iter().map(|c| self.fit.reduce(c)).collect();
        let white = self.whitener.apply_all(&reduced);
        let partial = Partial::new(&self.declared, std::slice::from_ref(&self.y));
        let products = partial.products(&white);
        let contrasts = self.whitener.used.saturating_sub(self.declared.rank());
        let before = self.square.max(f64::MIN_POSITIVE);
        let mut next = 0;
        let gain = |(count, whole): &(usize, bool)| {
            let own = next..next + count;
            next = own.end;
            let after = if *whole {
                products.without_whole(own, self.square)
            } else {
                let mut explained = [0.0];
                products.explained(own, &mut explained);
                self.square - explained[0]
            };
            0.5 * contrasts as f64 * (before / after.max(1e-12 * before)).ln()
        };
        each.iter().map(gain).collect()
    }
}

/// Halvings of the step.
const HALVINGS: usize = 6;

/// The likeliest point near `start` (the first steps are `reach` times the points' distance) at one noise, by a pattern search along the coordinates (Hooke &
/// Jeeves 1961): thresholds make the likelihood a staircase, so no derivatives.
pub fn refined(
    bench: &Bench<'_>,
    candidate: &dyn Candidate,
    c: &Channels,
    bias: &Bias,
    start: &Point,
    reach: f64,
) -> Point {
    let steps = candidate.spacing(c, start);
    let steps = steps.iter().map(|s| reach * s).collect();
    climbed(start, steps, |p| gain(bench, candidate, c, bias, p))
}

/// The top of a gain near a start: coordinate steps, halved where none of them rises.
pub fn climbed(start: &Point, mut steps: Vec<f64>, gain: impl Fn(&Point) -> f64) -> Point {
    let mut best = start.clone();
    if best.theta.is_empty() {
        return best;
    }
    let mut reached = gain(&best);
    for _ in 0..HALVINGS {
        let mut moved = true;
        let mut turns = 0;
        while moved && turns < 10 {
            moved = false;
            turns += 1;
            for (k, step) in steps.iter().enumerate() {
                for direction in [1.0, -1.0] {
                    let mut next = best.clone();
                    next.theta[k] += direction * step;
                    let there = gain(&next);
                    if there > reached + 1e-9 {
                        (best, reached, moved) = (next, there, true);
                        break;
                    }
                }
            }
        }
        for s in &mut steps {
            *s *= 0.5;
        }
    }
    best
}

/// Gain in log-likelihood of a shape at one noise, its coefficient being 1 where physics says so.
pub fn gain(
    bench: &Bench<'_>,
    candidate: &dyn Candidate,
    c: &Channels,
    bias: &Bias,
    point: &Point,
) -> f64 {
    let columns = candidate.columns(c, bias, point);
    let gains = gains(bench, [(columns, candidate.is_sized(point))]);
    gains.first().copied().unwrap_or(0.0)
}

/// Shapes whose columns are made, whitened and multiplied side by side.
const BATCH: usize = 16;

/// Gains of many shapes, by their columns and whether their coefficient is 1.
pub fn gains(
    bench: &Bench<'_>,
    shapes: impl IntoIterator<Item = (Vec<Vec<f64>>, bool)>,
) -> Vec<f64> {
    let mut shapes = shapes.into_iter().peekable();
    let mut out = Vec::new();
    while shapes.peek().is_some() {
        let (mut all, mut each) = (Vec::new(), Vec::with_capacity(BATCH));
        for (mut columns, is_sized) in shapes.by_ref().take(BATCH) {
            if let Some(model) = bench.model {
                columns = model.shown(columns);
            }
            each.push((columns.len(), is_sized));
            all.append(&mut columns);
        }
        out.append(&mut bench.gains(&all, &each));
    }
    out
}

/// What a set of shapes comes to over all noises of the grid.
#[derive(Debug, Clone, PartialEq)]
pub struct Profiled {
    /// Gain in log-likelihood over the null hypothesis, noise free on both sides.
    pub gain: f64,
    /// The noise at which it is reached.
    pub shape: Shape,
    /// Columns that are excited.
    pub columns: usize,
}

/// Profiled gains of single points.
pub fn profiled(fit: &Fit, grid: &Grid, points: &[Vec<Vec<f64>>]) -> Vec<Profiled> {
    let groups: Vec<Group> = points
        .iter()
        .map(|columns| Group {
            points: vec![columns.iter().map(|c| fit.reduce(c)).collect()],
        })
        .collect();
    let mut null = f64::NEG_INFINITY;
    let mut out = vec![
        Profiled {
            gain: f64::NEG_INFINITY,
            shape: Shape::default(),
            columns: 0,
        };
        points.len()
    ];
    let signals = [fit.problem.y.clone()];
    for shape in &grid.shapes {
        let at = AtShape::new(fit, &groups, &signals, *shape);
        null = null.max(at.null(0));
        for (k, p) in out.iter_mut().enumerate() {
            let with = at.with_point(k, 0);
            if with > p.gain {
                p.gain = with;
                p.shape = *shape;
                p.columns = at.degrees.get(k).copied().unwrap_or(0);
            }
        }
    }
    for p in &mut out {
        p.gain -= null;
    }
    out
}
