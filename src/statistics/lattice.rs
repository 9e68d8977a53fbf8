//! The restricted likelihood over the shapes of the noise: a lattice, and a search from its best
//! point.
//!
//! With the white variance s^2 profiled out, twice the restricted log-likelihood (Patterson & Thompson 1971;
//! Harville 1977) of nu = rows - rank(X) error contrasts is
//!
//! -nu (1 + ln 2 pi + ln s^2) - ln det V - ln det X' V^-1 X, s^2 = r' V^-1 r / nu
//!
//! up to ln det X' X, which does not depend on the noise.

use super::linear::{Basis, dot};
use super::noise::{Shape, Timeline};
use super::whiten::Whitener;

/// Steps of the lattice: decades of `flicker`, decades of `walk`.
const STEP: (f64, f64) = (0.5, 0.75);

/// A signal and its regressors on a timeline.
#[derive(Debug, Clone, PartialEq)]
pub struct Problem {
    /// Times and weights.
    pub line: Timeline,
    /// The signal, deg/s.
    pub y: Vec<f64>,
    /// The regressors, constant included.
    pub columns: Vec<Vec<f64>>,
}

/// The likelihood of one shape.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Evaluated {
    /// The shape.
    pub shape: Shape,
    /// Restricted log-likelihood, white variance profiled out.
    pub loglik: f64,
    /// ln det V + ln det X' V^-1 X, for a white variance of 1.
    pub log_det: f64,
    /// Sum of squares of the whitened residuals.
    pub rss: f64,
    /// Error contrasts: used rows less the rank of the regressors.
    pub contrasts: usize,
}

impl Evaluated {
    /// The white variance of a row of full weight, restricted estimate, (deg/s)^2.
    pub fn white_variance(&self) -> f64 {
        self.rss / self.contrasts.max(1) as f64
    }
}

/// Twice the restricted log-likelihood from its parts, halved.
pub fn profile(contrasts: usize, rss: f64, log_det: f64) -> f64 {
    let nu = contrasts.max(1) as f64;
    let variance = (rss / nu).max(f64::MIN_POSITIVE);
    -0.5 * (nu * (1.0 + std::f64::consts::TAU.ln() + variance.ln()) + log_det)
}

impl Problem {
    /// Whitened signal and the basis of the whitened regressors.
    pub fn whiten(&self, whitener: &Whitener) -> (Vec<f64>, Basis) {
        let mut all: Vec<&[f64]> = self.columns.iter().map(Vec::as_slice).collect();
        all.push(&self.y);
        let mut white = whitener.apply_all(&all);
        let y = white.pop().unwrap_or_default();
        (y, Basis::new(&white))
    }

    /// The likelihood of a shape.
    pub fn evaluate(&self, shape: Shape) -> Evaluated {
        let whitener = Whitener::new(&self.line, shape);
        let (mut y, basis) = self.whiten(&whitener);
        basis.project_off(&mut y);
        let rss = dot(&y, &y);
        let contrasts = whitener.used.saturating_sub(basis.rank());
        let log_det = whitener.log_det + basis.log_det_gram();
        Evaluated {
            shape,
            loglik: profile(contrasts, rss, log_det),
            log_det,
            rss,
            contrasts,
        }
    }

    /// All shapes of [`shapes`], evaluated.
    pub fn lattice(&self) -> Vec<Evaluated> {
        let all = shapes(&self.line);
        all.into_iter().map(|s| self.evaluate(s)).collect()
    }

    /// The lattice's points within a decade of a shape in flicker and a decade and a half in walk, and
    /// the white one; the whole lattice without a shape.
    pub fn lattice_near(&self, near: Option<Shape>) -> Vec<Evaluated> {
        let Some(near) = near else {
            return self.lattice();
        };
        let close = |a: f64, b: f64, decades: f64| match (a > 0.0, b > 0.0) {
            (true, true) => (a / b).log10().abs() <= decades,
            (a, b) => a == b,
        };
        let mut all = shapes(&self.line);
        all.retain(|s| {
            let is_white = s.flicker == 0.0 && s.walk == 0.0;
            is_white || (close(s.flicker, near.flicker, 1.0) && close(s.walk, near.walk, 1.5))
        });
        all.into_iter().map(|s| self.evaluate(s)).collect()
    }

    /// The most likely shape near the best of `start`, by Nelder and Mead's simplex (1965) in the
    /// logarithms of what is not 0; `evaluations` at most.
    pub fn refine(&self, start: &[Evaluated], evaluations: usize) -> Evaluated {
        let best = start
            .iter()
            .copied()
            .reduce(|a, b| if b.loglik > a.loglik { b } else { a });
        let best = best.unwrap_or_else(|| self.evaluate(Shape::default()));
        let active: Vec<bool> = vec![best.shape.flicker > 0.0, best.shape.walk > 0.0];
        let origin = [best.shape.flicker, best.shape.walk].map(|v| v.max(1e-300).log10());
        let free: Vec<usize> = (0..2).filter(|k| active[*k]).collect();
        if free.is_empty() {
            return best;
        }
        let (low, high) = limits(&self.line);
        let mut found = best;
        let mut cost = |offsets: &[f64]| {
            let mut logs = origin;
            for (k, o) in free.iter().zip(offsets) {
                logs[*k] = (logs[*k] + o).clamp(low[*k] - 0.5, high[*k] + 0.5);
            }
            let value = |k: usize| {
                if active[k] {
                    f64::powf(10.0, logs[k])
                } else {
                    0.0
                }
            };
            let at = self.evaluate(Shape {
                flicker: value(0),
                walk: value(1),
            });
            if at.loglik > found.loglik {
                found = at;
            }
            -at.loglik
        };
        let sizes: Vec<f64> = free.iter().map(|k| [0.25, 0.4][*k]).collect();
        simplex(&mut cost, &sizes, -best.loglik, evaluations);
        found
    }
}

/// Logarithms (base 10) of the least and greatest (flicker, walk) that a record can tell from 0
/// and from pure 1/f or pure walk: at the least the spectra meet the white one at 1 / record length.
fn limits(line: &Timeline) -> ([f64; 2], [f64; 2]) {
    let n = (line.used().max(8) as f64).log10();
    let span = line.span.log10();
    ([-n - 0.25, 1.2 - n - span], [1.5, 2.0])
}

/// The lattice: 0 and the levels between the limits, for both strengths.
pub fn shapes(line: &Timeline) -> Vec<Shape> {
    let (low, high) = limits(line);
    let levels = |k: usize, step: f64| -> Vec<f64> {
        let count = ((high[k] - low[k]) / step).ceil().clamp(1.0, 30.0) as usize;
        let mut out = vec![0.0];
        out.extend((0..=count).map(|i| f64::powf(10.0, high[k] - step * i as f64)));
        out
    };
    let walks = levels(1, STEP.1);
    let mut out = Vec::new();
    for flicker in levels(0, STEP.0) {
        out.extend(walks.iter().map(|walk| Shape {
            flicker,
            walk: *walk,
        }));
    }
    out
}

/// Nelder and Mead's simplex from the origin, where the cost is `first`.
fn simplex(cost: &mut impl FnMut(&[f64]) -> f64, sizes: &[f64], first: f64, evaluations: usize) {
    let n = sizes.len();
    let mut corners: Vec<(f64, Vec<f64>)> = vec![(first, vec![0.0; n])];
    for (k, size) in sizes.iter().enumerate() {
        let mut at = vec![0.0; n];
        at[k] = *size;
        corners.push((cost(&at), at));
    }
    let mut used = n;
    while used < evaluations {
        corners.sort_by(|a, b| a.0.total_cmp(&b.0));
        let (Some(worst), Some(best)) = (corners.pop(), corners.first().cloned()) else {
            return;
        };
        let spread = worst.1.iter().zip(&best.1).map(|(a, b)| (a - b).abs());
        if spread.fold(0.0, f64::max) < 0.01 && worst.0 - best.0 < 1e-3 {
            return;
        }
        let centre: Vec<f64> = (0..n)
            .map(|k| corners.iter().map(|c| c.1[k]).sum::<f64>() / corners.len() as f64)
            .collect();
        let along = |factor: f64| -> Vec<f64> {
            let pairs = centre.iter().zip(&worst.1);
            pairs.map(|(c, w)| c + factor * (c - w)).collect()
        };
        let second = corners.last().map_or(best.0, |c| c.0);
        let reflected = (cost(&along(1.0)), along(1.0));
        used += 1;
        let next = if reflected.0 < best.0 {
            used += 1;
            let expanded = (cost(&along(2.0)), along(2.0));
            if expanded.0 < reflected.0 {
                expanded
            } else {
                reflected
            }
        } else if reflected.0 < second {
            reflected
        } else {
            used += 1;
            let factor = if reflected.0 < worst.0 { 0.5 } else { -0.5 };
            (cost(&along(factor)), along(factor))
        };
        if next.0 < worst.0 {
            corners.push(next);
            continue;
        }
        corners.push(worst);
        for corner in corners.iter_mut().skip(1) {
            for (v, b) in corner.1.iter_mut().zip(&best.1) {
                *v = 0.5 * (*v + b);
            }
            corner.0 = cost(&corner.1);
            used += 1;
        }
    }
}
