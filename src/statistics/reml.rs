//! Restricted maximum likelihood of a record's noise, and generalised least squares under it.
//!
//! Strengths of white noise, 1/f noise and walk are estimated together from what the regressors
//! leave (Patterson & Thompson 1971; Harville 1977): unlike maximum likelihood this does not count
//! the regressors' degrees of freedom as noise-free. Strengths may be 0. Spikes lose weight
//! ([`super::robust`]); records of more than [`Options::rows`] rows are fitted in block means
//! ([`super::decimate`]).

use super::decimate::{self, Decimated};
use super::lattice::{Evaluated, Problem};
use super::linear::{Basis, dot};
use super::noise::{NoiseModel, Shape, Timeline};
use super::whiten::Whitener;
use super::{Unusable, robust};
use nalgebra::DMatrix;

/// How to fit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Options<'a> {
    /// Beyond this many used rows the fit works on block means.
    pub rows: usize,
    /// Whether spikes lose weight.
    pub robust: bool,
    /// Evaluations of the likelihood after the lattice.
    pub evaluations: usize,
    /// Where the shape of the noise is known to lie: only lattice points near it are tried. For
    /// comparisons of models; [`Fit::lattice`] is then no posterior.
    pub near: Option<Shape>,
    /// Rows that are spikes, whatever this fit says of them; empty: none is.
    pub out: &'a [bool],
}

impl Default for Options<'_> {
    fn default() -> Self {
        Options {
            rows: 3000,
            robust: true,
            evaluations: 40,
            near: None,
            out: &[],
        }
    }
}

/// A fitted record.
#[derive(Debug, Clone, PartialEq)]
pub struct Fit {
    /// The noise of a row.
    pub noise: NoiseModel,
    /// The most likely shape on [`Fit::problem`]'s timeline, and its likelihood.
    pub at: Evaluated,
    /// The whole lattice, for what must not rest on one estimate.
    pub lattice: Vec<Evaluated>,
    /// Coefficients of the regressors; 0 for one in the span of those before it.
    pub beta: Vec<f64>,
    /// Their covariance under the fitted noise, without the uncertainty of the noise itself.
    pub covariance: DMatrix<f64>,
    /// Restricted log-likelihood, white variance profiled out.
    pub loglik_reml: f64,
    /// Log-likelihood at the same shape, white variance by maximum likelihood.
    pub loglik_ml: f64,
    /// Whitened residual of each row of the problem, in units of its standard deviation; 0 where
    /// not used.
    pub residual_whitened: Vec<f64>,
    /// Weight of each row of the record; 0 where not used.
    pub row_weights: Vec<f64>,
    /// What the noise was estimated on: the rows, or block means.
    pub problem: Problem,
    /// The blocks, if the record was too long.
    pub decimated: Option<decimate::Blocks>,
}

impl Fit {
    /// A further column of the record in the form of [`Fit::problem`]'s columns.
    pub fn reduce(&self, column: &[f64]) -> Vec<f64> {
        match &self.decimated {
            Some(blocks) => blocks.means(column),
            None => column.to_vec(),
        }
    }

    /// The same record and noise with every row of `used` at full weight, nothing fitted again: only
    /// [`Fit::problem`]'s timeline, [`Fit::row_weights`] and [`Fit::reduce`] are those of the new weights.
    ///
    /// # Errors
    /// Times that do not advance.
    pub fn unspiked(&self, times_s: &[f64], used: &[bool]) -> Result<Fit, Unusable> {
        let weights: Vec<f64> = used.iter().map(|u| f64::from(u8::from(*u))).collect();
        let mut out = self.clone();
        match &self.decimated {
            Some(blocks) => {
                let (blocks, line) = blocks.reweighted(times_s, weights.clone())?;
                out.problem.line = line;
                out.decimated = Some(blocks);
            }
            None => {
                let full = |u: &bool| if *u { 1.0 } else { f64::INFINITY };
                let factors = used.iter().map(full).collect();
                out.problem.line = self.problem.line.with_white_factor(factors);
            }
        }
        out.row_weights = weights;
        Ok(out)
    }

    /// The same record, weights and blocks with further regressors (already reduced): noise
    /// estimated again from the lattice on.
    pub fn with_columns(&self, further: &[Vec<f64>], options: &Options<'_>) -> Evaluated {
        let mut problem = self.problem.clone();
        problem.columns.extend_from_slice(further);
        problem.refine(&problem.lattice(), options.evaluations)
    }
}

/// Fits `y` (deg/s) at `times_s` by `columns` over the rows that `used` marks. The columns must span a
/// constant.
///
/// # Errors
/// Too few rows, values that are not finite, times that decrease, no constant among the columns.
pub fn fit(
    times_s: &[f64],
    y: &[f64],
    columns: &[Vec<f64>],
    used: &[bool],
    options: &Options<'_>,
) -> Result<Fit, Unusable> {
    let kept: Vec<bool>;
    let used = match options.out {
        [] => used,
        out => {
            kept = used.iter().zip(out).map(|(u, out)| *u && !out).collect();
            &kept
        }
    };
    check(times_s, y, columns, used)?;
    let factor = used
        .iter()
        .map(|u| if *u { 1.0 } else { f64::INFINITY })
        .collect();
    let plain = Problem {
        line: Timeline::new(times_s, factor)?,
        y: y.to_vec(),
        columns: columns.to_vec(),
    };
    let rows = plain.line.used();
    if rows > options.rows.max(16) {
        let size = rows.div_ceil(options.rows.max(16));
        let decimated = decimate::decimate(times_s, &plain, used, size, options.robust)?;
        return Ok(fit_long(&plain.line, decimated, options));
    }
    let Rows {
        problem,
        lattice,
        at,
        weights: row_weights,
    } = fit_rows(&plain, options);
    let noise = NoiseModel::of_shape(at.shape, at.white_variance().sqrt(), plain.line.period_s);
    let row_weights = row_weights
        .iter()
        .zip(used)
        .map(|(w, u)| if *u { *w } else { 0.0 })
        .collect();
    Ok(finish(problem, lattice, at, noise, row_weights, None))
}

fn check(times_s: &[f64], y: &[f64], columns: &[Vec<f64>], used: &[bool]) -> Result<(), Unusable> {
    let n = times_s.len();
    let finite = |c: &[f64]| c.len() == n && c.iter().zip(used).all(|(v, u)| !u || v.is_finite());
    if used.len() != n || !finite(y) {
        return Err(Unusable::NotFinite("the signal"));
    }
    if !columns.iter().all(|c| finite(c)) {
        return Err(Unusable::NotFinite("a regressor"));
    }
    let rows = used.iter().filter(|u| **u).count();
    let least = columns.len() + 4;
    if rows < least {
        return Err(Unusable::TooFewRows { rows, least });
    }
    let chosen = |c: &[f64]| -> Vec<f64> {
        let pairs = c.iter().zip(used);
        pairs.filter(|(_, u)| **u).map(|(v, _)| *v).collect()
    };
    let basis = Basis::new(&columns.iter().map(|c| chosen(c)).collect::<Vec<_>>());
    let mut constant = vec![1.0; rows];
    basis.project_off(&mut constant);
    if dot(&constant, &constant) > 1e-10 * rows as f64 {
        return Err(Unusable::NoConstant);
    }
    Ok(())
}

/// A fit of rows: the problem with its weights, the lattice, the likeliest shape, the weights.
struct Rows {
    problem: Problem,
    lattice: Vec<Evaluated>,
    at: Evaluated,
    weights: Vec<f64>,
}

impl Rows {
    /// Log-density of all rows, spikes as [`robust::ACCIDENT`] says.
    fn density(&self) -> f64 {
        let deviation = self.at.white_variance().sqrt().max(f64::MIN_POSITIVE);
        // Rows that are not used have their full weight.
        let spikes = self.weights.iter().filter(|w| **w < 0.5).count();
        self.at.loglik - spikes as f64 * (robust::ACCIDENT + deviation.ln())
    }
}

/// Weights and noise, and where rows stand out from white noise that do not from the noise that was found, the same from
/// there: a few spikes may pass for the steps of a walk, whose coefficients follow them.
fn fit_rows(plain: &Problem, options: &Options<'_>) -> Rows {
    let found = by_turns(plain, options, None);
    if !options.robust || found.at.shape == Shape::default() {
        return found;
    }
    let Some(weights) = robust::beside_white(plain) else {
        return found;
    };
    let same = |(a, b): (&f64, &f64)| (*a < 0.5) == (*b < 0.5);
    if weights.iter().zip(&found.weights).all(same) {
        return found;
    }
    let other = by_turns(plain, options, Some(weights));
    match other.density() > found.density() {
        true => other,
        false => found,
    }
}

/// Weights and noise, by turns: each pass tests all rows again, at full weight.
fn by_turns(plain: &Problem, options: &Options<'_>, start: Option<Vec<f64>>) -> Rows {
    let mut problem = plain.clone();
    let near = options.near.filter(|_| start.is_none());
    let mut weighed = start.is_some();
    let mut weights = start.unwrap_or_else(|| vec![1.0; plain.y.len()]);
    if weighed {
        let factors = robust::factors(&plain.line.white_factor, &weights);
        problem.line = plain.line.with_white_factor(factors);
    }
    let mut lattice = problem.lattice_near(near);
    let mut at = problem.refine(&lattice, options.evaluations);
    for _ in 0..if options.robust { 3 } else { 0 } {
        let next = robust::weights(plain, &problem, &at);
        let moved = next.iter().zip(&weights).map(|(a, b)| (a - b).abs());
        if moved.fold(0.0, f64::max) < 0.05 {
            break;
        }
        weights = next;
        weighed = true;
        let factors = robust::factors(&plain.line.white_factor, &weights);
        problem.line = plain.line.with_white_factor(factors);
        // The whole lattice was tried with every row at full weight; spikes look like white noise
        // then, so that whiter shapes are far, and redder ones must be tried again at the end.
        lattice = problem.lattice_near(Some(at.shape));
        at = problem.refine(&lattice, options.evaluations / 2);
    }
    if weighed && options.near.is_none() {
        lattice = problem.lattice();
        at = problem.refine(&lattice, options.evaluations);
    }
    Rows {
        problem,
        lattice,
        at,
        weights,
    }
}

fn fit_long(line: &Timeline, decimated: Decimated, options: &Options<'_>) -> Fit {
    let problem = decimated.problem.clone();
    let lattice = problem.lattice_near(options.near);
    let at = problem.refine(&lattice, options.evaluations);
    let noise = decimate::row_noise(&decimated, at.shape, at.white_variance(), line);
    let weights = decimated.blocks.weights.clone();
    finish(problem, lattice, at, noise, weights, Some(decimated.blocks))
}

/// Coefficients and residuals at the chosen shape.
fn finish(
    problem: Problem,
    lattice: Vec<Evaluated>,
    at: Evaluated,
    noise: NoiseModel,
    row_weights: Vec<f64>,
    decimated: Option<decimate::Blocks>,
) -> Fit {
    let whitener = Whitener::new(&problem.line, at.shape);
    let (mut y, basis) = problem.whiten(&whitener);
    let z = basis.project_off(&mut y);
    let variance = at.white_variance();
    let deviation = variance.sqrt().max(f64::MIN_POSITIVE);
    let n = whitener.used.max(1) as f64;
    let constant = 1.0 + std::f64::consts::TAU.ln() + (at.rss / n).max(f64::MIN_POSITIVE).ln();
    Fit {
        noise,
        loglik_reml: at.loglik,
        loglik_ml: -0.5 * (n * constant + whitener.log_det),
        beta: basis.solve(&z),
        covariance: basis.inverse_gram() * variance,
        residual_whitened: y.iter().map(|r| r / deviation).collect(),
        row_weights,
        at,
        lattice,
        problem,
        decimated,
    }
}

/// The whitener of a noise on a timeline, and the white rms that its output is in units of. A noise
/// without a white part gets a hundredth of its other parts' rms per row as one.
pub fn whitener_of(noise: &NoiseModel, line: &Timeline) -> (Whitener, f64) {
    let h = noise.flicker_dps.powi(2);
    let walk = noise.walk_dps_rts.powi(2) * line.period_s;
    let white = noise.white_rms_dps.powi(2).max(1e-4 * (h + walk));
    let white = if white > 0.0 { white } else { 1.0 };
    let shape = Shape {
        flicker: h / white,
        walk: walk / white,
    };
    (Whitener::new(line, shape), white.sqrt())
}
