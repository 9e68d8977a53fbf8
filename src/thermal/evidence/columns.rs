//! A record as regressors: its rows, the declared model, the candidates and their shapes.

use crate::statistics::linear::Basis;
use crate::statistics::noise::{Shape, Timeline};
use crate::statistics::whiten::Whitener;
use crate::statistics::{lattice, reml};
use crate::thermal::channels::Channels;
use crate::thermal::effects::{Bias, Candidate, Point};
use std::sync::{Arc, OnceLock};

/// A term of a set.
#[derive(Clone)]
pub struct Member {
    pub candidate: Arc<dyn Candidate>,
    pub point: Point,
    /// Logarithm of the Occam factor: the prior-weighted mean over the grid of exp(L - greatest L).
    pub occam: f64,
    /// The record shows it without a fit (a clip at its rails): it is in every set.
    pub evident: bool,
    /// [`Frame::fixed`] at its point.
    pub fixed: Option<Arc<Vec<Vec<f64>>>>,
}

impl Member {
    /// Whether it is a spectral line.
    pub fn is_line(&self) -> bool {
        let id = self.candidate.id();
        id == crate::thermal::effects::tone::NAMED || id == crate::thermal::effects::tone::FURTHER
    }
}

/// The shapes of a candidate.
pub struct Shapes {
    pub candidate: Arc<dyn Candidate>,
    pub points: Vec<Point>,
    /// For each point its columns as the fit sees them; none where they depend on the bias.
    pub columns: Vec<Vec<Vec<f64>>>,
    /// The same beyond the base.
    pub beyond: Vec<Vec<Vec<f64>>>,
}

/// Base and error, whitened by one noise.
pub struct Whitened {
    pub whitener: Whitener,
    pub base: Basis,
    pub error: Vec<f64>,
}

/// For each candidate, for each point, the columns: whitened, beyond the whitened base.
pub type White = Vec<Vec<Vec<Vec<f64>>>>;

/// A column beyond a span.
fn off(base: &Basis, column: &[f64]) -> Vec<f64> {
    let mut out = column.to_vec();
    base.project_off(&mut out);
    out
}

/// What all sets of a search have in common.
pub struct Frame<'a> {
    pub channels: &'a Channels,
    /// Named ones, the user's own among them, and nonparametric ones.
    pub candidates: &'a [Arc<dyn Candidate>],
    /// Regressors of every set, over all rows: the declared bias, then the thermometer's reading errors.
    pub base: Vec<Vec<f64>>,
    /// How many of them are the declared bias.
    pub declared: usize,
    /// Rows (or, of long records, means of blocks) with their weights: from the fit of a set.
    pub fit: reml::Fit,
    /// Noise shapes to compare (flicker and walk over the white variance), with their places on a grid.
    pub noises: Vec<Shape>,
    /// Neighbours of each noise on its grid.
    pub neighbours: Vec<Vec<usize>>,
    /// Shapes that do not depend on the bias, as the fit sees them.
    pub shapes: Vec<Shapes>,
    /// The base and the error as the fit sees them.
    pub plain_base: Vec<Vec<f64>>,
    pub plain_error: Vec<f64>,
    pub plain_basis: Basis,
    /// For each noise, the same whitened, and the shapes; made when first asked for.
    pub whitened: Vec<OnceLock<Whitened>>,
    pub white: Vec<OnceLock<White>>,
    /// Mean square that the declared model leaves, (deg/s)^2: variance of a term's contribution before the record is seen.
    pub declared_square: f64,
}

impl Frame<'_> {
    /// The timeline of the fit.
    pub fn line(&self) -> &Timeline {
        &self.fit.problem.line
    }

    /// The shapes of every candidate: worked out once a frame, unless they depend on the bias.
    pub fn shapes_of(&self) -> Vec<Shapes> {
        let base = Basis::new(&self.plain_base);
        let all = self.candidates.iter();
        let excited = all.filter(|c| c.channels(self.channels).is_ok());
        excited
            .map(|candidate| {
                let points = candidate.points(self.channels);
                let fixed = !candidate.acts_on_bias();
                let columns = points.iter().filter(|_| fixed).map(|point| {
                    let columns = self.of(candidate.as_ref(), &Bias::default(), point);
                    columns.iter().map(|c| self.reduced(c)).collect()
                });
                let columns: Vec<Vec<Vec<f64>>> = columns.collect();
                let beyond = columns
                    .iter()
                    .map(|all| all.iter().map(|c| off(&base, c)).collect());
                Shapes {
                    candidate: candidate.clone(),
                    beyond: beyond.collect(),
                    points,
                    columns,
                }
            })
            .collect()
    }

    /// Base and error whitened by a noise.
    pub fn whitened(&self, noise: usize) -> &Whitened {
        self.whitened[noise].get_or_init(|| {
            let whitener = Whitener::new(self.line(), self.noises[noise]);
            let base = Basis::new(&whitener.apply_all(&self.plain_base));
            let error = whitener.apply(&self.plain_error);
            Whitened {
                whitener,
                base,
                error,
            }
        })
    }

    /// A term's columns as the fit sees them, if they are the same beside any bias.
    pub fn fixed(&self, candidate: &dyn Candidate, point: &Point) -> Option<Arc<Vec<Vec<f64>>>> {
        if candidate.acts_on_bias() || candidate.is_last() {
            return None;
        }
        let columns = self.of(candidate, &Bias::default(), point);
        Some(Arc::new(columns.iter().map(|c| self.reduced(c)).collect()))
    }

    /// The shapes whitened by a noise, beyond the base.
    pub fn white(&self, noise: usize) -> &White {
        self.white[noise].get_or_init(|| {
            let Whitened { whitener, base, .. } = self.whitened(noise);
            let of = |columns: &Vec<Vec<f64>>| -> Vec<Vec<f64>> {
                let mut white = whitener.apply_all(columns);
                white.iter_mut().for_each(|w| drop(base.project_off(w)));
                white
            };
            let all = self.shapes.iter();
            all.map(|s| s.columns.iter().map(of).collect()).collect()
        })
    }

    /// A column over all rows as the fit sees it, 0 where it does not.
    pub fn reduced(&self, column: &[f64]) -> Vec<f64> {
        let mut out = self.fit.reduce(column);
        let factors = &self.line().white_factor;
        for (v, f) in out.iter_mut().zip(factors) {
            if !f.is_finite() || !v.is_finite() {
                *v = 0.0;
            }
        }
        out
    }

    /// Columns of a term beside a bias.
    pub fn of(&self, candidate: &dyn Candidate, bias: &Bias, point: &Point) -> Vec<Vec<f64>> {
        candidate.columns(self.channels, bias, point)
    }
}

/// About two dozen shapes of noise: every second level of the lattice in each direction, with each one's neighbours.
pub fn noises(line: &Timeline) -> (Vec<Shape>, Vec<Vec<usize>>) {
    let all = lattice::shapes(line);
    let mut flickers: Vec<f64> = all.iter().map(|s| s.flicker).collect();
    let mut walks: Vec<f64> = all.iter().map(|s| s.walk).collect();
    for levels in [&mut flickers, &mut walks] {
        levels.sort_by(f64::total_cmp);
        levels.dedup();
        // 0 stays, and of the others every second one from the greatest down.
        let last = levels.len() - 1;
        let kept = levels.iter().enumerate();
        *levels = kept
            .filter(|(k, _)| *k == 0 || (last - k).is_multiple_of(2))
            .map(|(_, v)| *v)
            .collect();
    }
    let (rows, wide) = (flickers.len(), walks.len());
    let mut shapes = Vec::new();
    let mut neighbours = Vec::new();
    for (i, flicker) in flickers.iter().enumerate() {
        for (j, walk) in walks.iter().enumerate() {
            shapes.push(Shape {
                flicker: *flicker,
                walk: *walk,
            });
            let mut near = Vec::new();
            for (a, b) in [(-1i64, 0i64), (1, 0), (0, -1), (0, 1), (-1, 1), (1, -1)] {
                let (x, y) = (i as i64 + a, j as i64 + b);
                if (0..rows as i64).contains(&x) && (0..wide as i64).contains(&y) {
                    near.push(x as usize * wide + y as usize);
                }
            }
            neighbours.push(near);
        }
    }
    (shapes, neighbours)
}
