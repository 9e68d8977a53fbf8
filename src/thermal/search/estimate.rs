//! Parameters of the terms with their standard deviations.

use super::{Model, Search, Term, declared};
use crate::statistics::linear::{Basis, add_scaled};
use crate::statistics::whiten::Whitener;
use crate::thermal::channels::Channels;
use crate::thermal::effects::Estimate;
use nalgebra::DMatrix;
use std::ops::Range;

/// Rows up to which a threshold may lie far between two readings.
const FEW_ROWS: usize = 50_000;

/// Smallest move of a threshold that is looked at, as a share of the points' distance; how often it is doubled, and halved again.
const SMALLEST: f64 = 1e-4;
const DOUBLED: usize = 20;
const HALVED: usize = 8;

/// Step of a derivative, as a share of the points' distance in that parameter.
const STEP: f64 = 0.05;

/// A term of a model, linearised in all that is estimated of it.
#[derive(Debug, Clone)]
pub struct Tangent {
    /// Places of its coefficients in [`Model::beta`].
    pub own: Range<usize>,
    /// Derivatives of the output by its coefficients, one value a row: its columns, or none where physics gives
    /// the coefficients.
    pub by_beta: Vec<Vec<f64>>,
    /// Derivatives of the output by its non-linear parameters, deg/s per unit of each, one value a row.
    pub by_theta: Vec<Vec<f64>>,
    /// The steps that they were taken with.
    pub steps: Vec<f64>,
}

impl Tangent {
    /// All derivatives: by the coefficients, then by the non-linear parameters.
    pub fn columns(&self) -> impl Iterator<Item = &Vec<f64>> {
        self.by_beta.iter().chain(&self.by_theta)
    }

    fn of(c: &Channels, model: &Model, term: &Term, first: usize) -> Self {
        let columns = term.candidate.columns(c, &model.acting, &term.point);
        let own = first..first + columns.len();
        let beta = model.beta.get(own.clone()).unwrap_or(&[]);
        let moved = |parameter: usize, by: f64| moved(c, model, (term, beta), (parameter, by));
        let spacing = term.candidate.spacing(c, &term.point);
        let steps: Vec<f64> = spacing.iter().map(|s| STEP * s).collect();
        let slope = |(k, step): (usize, &f64)| {
            let pairs = moved(k, *step).into_iter().zip(moved(k, -step));
            pairs.map(|(a, b)| (a - b) / (2.0 * step)).collect()
        };
        let by_theta = steps.iter().enumerate().map(slope).collect();
        let whole = term.candidate.is_sized(&term.point);
        Tangent {
            own,
            by_beta: if whole { Vec::new() } else { columns },
            by_theta,
            steps,
        }
    }
}

/// What a term with its coefficients contributes, deg/s, every row, where one of its non-linear parameters is moved.
fn moved(
    c: &Channels,
    model: &Model,
    (term, beta): (&Term, &[f64]),
    (parameter, by): (usize, f64),
) -> Vec<f64> {
    let mut point = term.point.clone();
    if let Some(theta) = point.theta.get_mut(parameter) {
        *theta += by;
    }
    let mut sum = vec![0.0; c.len()];
    let columns = term.candidate.columns(c, &model.acting, &point);
    for (column, b) in columns.iter().zip(beta) {
        add_scaled(&mut sum, *b, column);
    }
    sum
}

/// The tangents of a model's terms, in their order.
pub fn tangents(c: &Channels, model: &Model) -> Vec<Tangent> {
    let mut first = declared(c).len();
    let one = |term: &Term| {
        let tangent = Tangent::of(c, model, term, first);
        first = tangent.own.end;
        tangent
    };
    model.terms.iter().map(one).collect()
}

/// Covariance by generalised least squares of the declared coefficients and, in the order of
/// [`Tangent::columns`], of all that is estimated of each term.
pub struct Covariance {
    /// Over `white_variance`; 0 for what lies in the span of those before it.
    pub inverse: DMatrix<f64>,
    /// Variance of white noise of one row, (deg/s)^2.
    pub white_variance: f64,
    /// Where each term's part begins.
    pub first: Vec<usize>,
}

impl Covariance {
    /// Of a model with its [`tangents`].
    pub fn new(c: &Channels, model: &Model, tangents: &[Tangent]) -> Self {
        let free = model.columns.iter().take(declared(c).len());
        let mut columns: Vec<Vec<f64>> = free.map(|c| model.fit.reduce(c)).collect();
        let mut first = Vec::new();
        for tangent in tangents {
            first.push(columns.len());
            columns.extend(tangent.columns().map(|c| model.fit.reduce(c)));
        }
        let whitener = Whitener::new(&model.fit.problem.line, model.fit.at.shape);
        let basis = Basis::new(&whitener.apply_all(&columns));
        Covariance {
            inverse: basis.inverse_gram(),
            white_variance: model.fit.at.white_variance(),
            first,
        }
    }

    /// Standard deviation of what stands at a place; 0 in the span of others, which has none of its own.
    fn std(&self, place: usize) -> f64 {
        let inverse = self.inverse.get((place, place)).copied().unwrap_or(0.0);
        (self.white_variance * inverse).max(0.0).sqrt()
    }
}

impl Search<'_> {
    /// An estimate for each term. Standard deviations are those of generalised least squares with the
    /// declared coefficients, all terms' coefficients and, linearised, all non-linear parameters in one
    /// covariance; a threshold lies anywhere between the readings next to it.
    pub fn estimates(&self, model: &Model) -> Vec<Estimate> {
        let tangents = tangents(self.channels, model);
        let covariance = Covariance::new(self.channels, model, &tangents);
        let terms = model.terms.iter().zip(tangents).zip(&covariance.first);
        terms
            .map(|((term, tangent), first)| {
                let of_theta = first + tangent.by_beta.len();
                let own = |k: usize| match tangent.by_beta.is_empty() {
                    true => 0.0,
                    false => covariance.std(first + k),
                };
                let steps = tangent.steps.iter().enumerate();
                let between = |k: usize| self.between_readings(model, term, &tangent.own, k);
                Estimate {
                    point: term.point.clone(),
                    beta_std: (0..tangent.own.len()).map(own).collect(),
                    theta_std: steps
                        .map(|(k, step)| match self.rail_std(term, k) {
                            Some(std) => std,
                            None => match covariance.std(of_theta + k) {
                                s if s > 0.0 => s.max(between(k)),
                                _ => step.max(between(k)),
                            },
                        })
                        .collect(),
                    beta: model.beta.get(tangent.own).unwrap_or(&[]).to_vec(),
                }
            })
            .collect()
    }

    /// Standard deviation of a level at which readings stand: that of a rounding to what tells two readings apart.
    fn rail_std(&self, term: &Term, k: usize) -> Option<f64> {
        let rails = self.rails.as_ref().filter(|_| term.evident)?;
        let level = *term.point.theta.get(k)?;
        let stands = [rails.lower_dps, rails.upper_dps].contains(&Some(level));
        stands.then(|| rails.resolution_dps / 12f64.sqrt())
    }

    /// Standard deviation of a threshold that may lie anywhere where no row of the fit tells: it moves there without moving the
    /// rows by more than the noise of one. 0 for a shape without sharp ends.
    fn between_readings(&self, model: &Model, term: &Term, own: &Range<usize>, k: usize) -> f64 {
        let c = self.channels;
        let sharp = term.candidate.is_local() || term.candidate.is_whole();
        let spacing = term.candidate.spacing(c, &term.point);
        let (Some(spacing), true) = (spacing.get(k), sharp && c.len() <= FEW_ROWS) else {
            return 0.0;
        };
        let beta = model.beta.get(own.clone()).unwrap_or(&[]);
        let at = |by: f64| moved(c, model, (term, beta), (k, by));
        let here = at(0.0);
        let is_seen = |by: f64| {
            let there = at(by);
            let rows = here.iter().zip(&there).zip(&self.used);
            let used = rows.filter(|(_, used)| **used);
            let square: f64 = used.map(|((a, b), _)| (a - b).powi(2)).sum();
            square > model.fit.at.white_variance()
        };
        let reach = |sign: f64| {
            let mut to = SMALLEST * spacing;
            let mut doubled = 0;
            while doubled < DOUBLED && !is_seen(sign * to) {
                to *= 2.0;
                doubled += 1;
            }
            let mut from = if doubled == 0 { 0.0 } else { 0.5 * to };
            for _ in 0..HALVED {
                let middle = 0.5 * (from + to);
                if is_seen(sign * middle) {
                    to = middle;
                } else {
                    from = middle;
                }
            }
            from
        };
        // Evenly likely over the whole width.
        (reach(1.0) + reach(-1.0)) / 12f64.sqrt()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::thermal::effects::Point;
    use crate::thermal::search::Effort;
    use crate::thermal::synthetic::{Random, triangle};
    use std::collections::BTreeMap;

    #[test]
    fn the_tangent_of_a_transient_is_its_derivative_and_a_clip_has_no_gain() {
        let (rows, tau_s) = (300, 400.0);
        let mut random = Random::new(4);
        let time_s: Vec<f64> = (0..rows).map(|k| 10.0 * k as f64).collect();
        let output = time_s
            .iter()
            .map(|t| 0.4 * (-t / tau_s).exp() + 0.01 * random.normal());
        let columns = BTreeMap::from([
            ("rate_out_dps".to_owned(), output.collect()),
            ("die_degc".to_owned(), triangle(rows)),
        ]);
        let c = Channels::new(&time_s, &columns, "die_degc", |t| t).unwrap();
        let split = c.split().unwrap();
        let search = Search::new(&c, &split, Effort::default(), Vec::new());
        let term = |id: &str, point: Point| {
            let candidate = search.candidates().iter().find(|c| c.id() == id);
            Term::new(candidate.unwrap().clone(), point)
        };
        let terms = [
            term("output_saturation", Point::at(1, &[10.0])),
            term("warmup_transient", Point::at(0, &[f64::ln(tau_s)])),
        ];
        let model = search.model(&terms).unwrap();
        let found = tangents(&c, &model);
        assert_eq!((found[0].own.clone(), found[1].own.clone()), (3..4, 4..5));
        assert!(found[0].by_beta.is_empty());
        let amplitude_dps = model.beta[4];
        assert!((amplitude_dps - 0.4).abs() < 0.02, "{amplitude_dps}");
        for (i, t) in time_s.iter().enumerate() {
            let decay = (-t / tau_s).exp();
            assert!((found[1].by_beta[0][i] - decay).abs() < 1e-12);
            // By the logarithm of the time constant; at most 0.37 of the amplitude.
            let slope = amplitude_dps * t / tau_s * decay;
            assert!(
                (found[1].by_theta[0][i] - slope).abs() < 2e-3 * amplitude_dps,
                "{i}"
            );
        }
    }

    /// A step at a temperature that the record leaps over is only known to be there.
    #[test]
    fn a_threshold_lies_anywhere_between_two_readings() {
        let rows = 240;
        let mut random = Random::new(5);
        let time_s: Vec<f64> = (0..rows).map(|k| 10.0 * k as f64).collect();
        // Two dwells of a slow ramp each, 9 K apart.
        let degc: Vec<f64> = (0..rows)
            .map(|k| {
                let ramp = 0.05 * (k % 30) as f64;
                ramp + if k / 30 % 2 == 0 { 20.0 } else { 30.5 }
            })
            .collect();
        let output = degc
            .iter()
            .map(|t| f64::from(u8::from(*t > 28.0)) * 0.4 + 0.01 * random.normal());
        let columns = BTreeMap::from([
            ("rate_out_dps".to_owned(), output.collect()),
            ("die_degc".to_owned(), degc.clone()),
        ]);
        let c = Channels::new(&time_s, &columns, "die_degc", |t| t).unwrap();
        let search = Search::new(&c, &c.split().unwrap(), Effort::default(), Vec::new());
        let candidate = search.candidates().iter();
        let step = candidate.clone().find(|c| c.id() == "stress_jump").unwrap();
        let middle = (26.0 - c.middle_degc) / c.kelvin_per_u;
        let model = search.model(&[Term::new(step.clone(), Point::at(0, &[middle]))]);
        let estimates = search.estimates(&model.unwrap());
        let std_k = estimates[0].theta_std[0] * c.kelvin_per_u;
        // Nine kelvins without a reading, evenly likely.
        assert!((2.0..3.2).contains(&std_k), "{std_k}");
    }
}
