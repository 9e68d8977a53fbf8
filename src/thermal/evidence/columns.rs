//! A record as regressors: its rows, the declared model, the candidates and their shapes.

use super::{NAMELESS, PRIOR_ODDS};
use crate::statistics::linear::Basis;
use crate::statistics::noise::{Shape, Timeline};
use crate::statistics::whiten::Whitener;
use crate::statistics::{lattice, reml};
use crate::thermal::channels::Channels;
use crate::thermal::effects::{Bias, Candidate, Point};
use std::f64::consts::TAU;
use std::sync::{Arc, OnceLock};

/// Highest frequency, in turns a row, at which a smooth walk meets the white noise: what is faster is no slow noise (convention: ten
/// rows a turn).
const FASTEST: f64 = 0.1;

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
    /// Whether it is part of the noise rather than a cause: a line, an event.
    pub fn is_noise(&self) -> bool {
        self.is_line() || self.candidate.repeats()
    }

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
    /// Noise shapes to compare.
    pub noises: Vec<Noise>,
    /// The white one.
    pub plain_noise: usize,
    /// Logarithm of the prior odds of each noise.
    pub noise_odds: Vec<f64>,
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
            let Noise { shape, smooth } = self.noises[noise];
            let whitener = Whitener::with_smooth(self.line(), shape, smooth);
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

/// A shape of noise.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Noise {
    /// Strengths of 1/f noise and random walk over the white variance.
    pub shape: Shape,
    /// Strength of the smooth walk ([`Timeline::smooth_states`]).
    pub smooth: f64,
}

impl Noise {
    /// Whether it is more than white and 1/f.
    pub fn walks(&self) -> bool {
        self.shape.walk > 0.0 || self.smooth > 0.0
    }
}

/// Every second of some levels from the greatest down, and 0 in front.
fn thinned(mut levels: Vec<f64>) -> Vec<f64> {
    levels.sort_by(f64::total_cmp);
    levels.dedup();
    let last = levels.len() - 1;
    let kept = levels.iter().enumerate();
    kept.filter(|(k, _)| *k == 0 || (last - k).is_multiple_of(2))
        .map(|(_, v)| *v)
        .collect()
}

/// Strengths of a smooth walk: its spectrum, s / (2 pi f)^4 in rows, meets the white one at frequencies from two turns in the record to
/// [`FASTEST`], an octave apart.
fn smooth_levels(line: &Timeline) -> Vec<f64> {
    let rows = line.used().max(8) as f64;
    let octaves = (FASTEST * rows / 2.0).log2().max(0.0) as i32;
    let strength = |k: i32| (TAU * FASTEST * 0.5f64.powi(k)).powi(4);
    (0..=octaves).rev().map(strength).collect()
}

/// A few dozen shapes of noise: every second level of the lattice in 1/f noise, with nothing, a random walk or a smooth walk; and the
/// neighbours of each, those of a walk and a smooth walk that meet the white noise at the same frequency among them.
pub fn noises(line: &Timeline) -> (Vec<Noise>, Vec<Vec<usize>>) {
    let all = lattice::shapes(line);
    let flickers = thinned(all.iter().map(|s| s.flicker).collect());
    let walks = thinned(all.iter().map(|s| s.walk).collect());
    let smooths = smooth_levels(line);
    // The second axis: smooth walks from the strongest down, none, random walks.
    let mut slow: Vec<(f64, f64)> = smooths.iter().rev().map(|s| (0.0, *s)).collect();
    slow.extend(walks.iter().map(|walk| (*walk, 0.0)));
    let meets = |slow: &(f64, f64)| match *slow {
        (_, smooth) if smooth > 0.0 => smooth.powf(0.25),
        (walk, _) => walk.sqrt(),
    };
    let wide = slow.len();
    let mut shapes = Vec::new();
    let mut neighbours = Vec::new();
    for (i, flicker) in flickers.iter().enumerate() {
        for (j, (walk, smooth)) in slow.iter().enumerate() {
            shapes.push(Noise {
                shape: Shape {
                    flicker: *flicker,
                    walk: *walk,
                },
                smooth: *smooth,
            });
            let mut near = Vec::new();
            for (a, b) in [(-1i64, 0i64), (1, 0), (0, -1), (0, 1), (-1, 1), (1, -1)] {
                let (x, y) = (i as i64 + a, j as i64 + b);
                if (0..flickers.len() as i64).contains(&x) && (0..wide as i64).contains(&y) {
                    near.push(x as usize * wide + y as usize);
                }
            }
            let others = slow.iter().enumerate();
            let others = others.filter(|(_, s)| (s.1 > 0.0) != (*smooth > 0.0) && meets(s) > 0.0);
            let apart = |s: &(f64, f64)| (meets(s) / meets(&slow[j])).ln().abs();
            let like = others.min_by(|a, b| apart(a.1).total_cmp(&apart(b.1)));
            if let Some((k, _)) = like.filter(|_| meets(&slow[j]) > 0.0) {
                near.push(i * wide + k);
            }
            neighbours.push(near);
        }
    }
    (shapes, neighbours)
}

/// Logarithms of the prior odds of noises: a smooth walk is what nobody recorded, and costs what every hypothesis does, its strength being
/// one of so many.
pub fn odds(noises: &[Noise]) -> Vec<f64> {
    let mut levels: Vec<f64> = noises
        .iter()
        .map(|n| n.smooth)
        .filter(|s| *s > 0.0)
        .collect();
    levels.sort_by(f64::total_cmp);
    levels.dedup();
    let price = (PRIOR_ODDS * NAMELESS).ln() - (levels.len().max(1) as f64).ln();
    let of = |n: &Noise| if n.smooth > 0.0 { price } else { 0.0 };
    noises.iter().map(of).collect()
}

/// Where white and no other noise is among those of [`noises`].
pub fn white(noises: &[Noise]) -> usize {
    noises
        .iter()
        .position(|n| *n == Noise::default())
        .unwrap_or(0)
}
