//! Two names that explain together what neither explains alone.
//!
//! Beside a slow cause that is not in yet, every other slow cause looks like a part of a walk of the rate, and beside a walk
//! none is beyond chance: with both in, the noise is seen to be fast, and each is beyond chance beside the other, or both
//! are as a pair ([`super::pairs`]).

use super::judge::{Judged, PRICE, price};
use super::reported::WANDER;
use super::{LEVEL, Model, Search, Term, declared};
use crate::statistics::Unusable;
use crate::statistics::linear::{Basis, dot};
use crate::thermal::effects::{Candidate, Point};
use std::sync::Arc;

/// Log-likelihood, less the price, by which two names have to be better than slow noise in their place: the best of
/// some two hundred pairs (Wilks 1938: four coefficients and a time constant rarely gain ten); and by which they have to be if
/// they are beyond chance as a pair.
pub(super) const WORTH: f64 = 15.0;
const AS_A_PAIR: f64 = 10.0;

/// The same that the best of all sets has to be worth at least before its shapes are found again side by side: beside names that are in, and
/// beside none.
pub(super) const HOPE: f64 = 5.0;
const HOPE_ALONE: f64 = 0.0;

/// The same by which two names have to be better than one.
const MORE: f64 = 6.0;

/// Probability, under the slow noise that it replaces, up to which one name more is beyond chance that is worth as much as a pair and
/// ends the wander which others leave: that noise was found with the name out, and has it in.
const NEARLY: f64 = 0.05;

/// Pairs of which the noise is sought, and names alone; and how many times over.
const TRIED: usize = 3;
const TIMES: usize = 2;

/// A candidate beside a model: its columns over the fitted rows without what the model's span has of them.
struct Beside<'a> {
    judged: &'a Judged,
    columns: Vec<Vec<f64>>,
    paid: f64,
}

impl Search<'_> {
    /// The terms of a model and one, two or more names, if these are worth more than the slow noise that the model has in
    /// their place, and each is beyond chance beside the others.
    ///
    /// # Errors
    /// Too few rows.
    pub(super) fn together(&self, model: &Model) -> Result<Option<Vec<Term>>, Unusable> {
        match self.worthier(model, &|_, _| true)? {
            Some(with) => self.beyond_chance(model, with),
            None => Ok(None),
        }
    }

    /// A model with one, two or more names more, if these are worth more: of all sets of names, those first that `may` be, by what
    /// they are worth in the shapes in which each was found alone.
    ///
    /// # Errors
    /// Too few rows.
    pub(super) fn worthier(
        &self,
        model: &Model,
        may: &dyn Fn(&[String], f64) -> bool,
    ) -> Result<Option<Model>, Unusable> {
        let Some(mut with) = self.with_more(model, may)? else {
            return Ok(None);
        };
        for _ in 1..TIMES {
            if self.wander(&with) <= WANDER {
                break;
            }
            match self.with_more(&with, &|_, _| true)? {
                Some(more) => with = more,
                None => break,
            }
        }
        Ok(Some(with))
    }

    /// The terms of a model with names more than another one, if each of these is beyond chance beside the others, or they are
    /// as a pair.
    ///
    /// # Errors
    /// Too few rows.
    pub(super) fn beyond_chance(
        &self,
        model: &Model,
        with: Model,
    ) -> Result<Option<Vec<Term>>, Unusable> {
        let known = model.terms.len();
        if self.net(&with) < self.net(model) + WORTH {
            return Ok(self.as_a_pair(model, with));
        }
        let ends = known > 0 && with.terms.len() == known + 1 && self.wander(&with) <= WANDER;
        let level = if ends { NEARLY } else { LEVEL };
        let mut terms = with.terms.clone();
        for (k, term) in terms.iter_mut().enumerate().skip(known) {
            let mut others = with.terms.clone();
            let own = others.remove(k);
            let round = match self.keeping(&others, &with)? {
                Some(beside) => Arc::new(self.judge(&beside, self.effort.surrogates)),
                None => self.round(&self.model(&others)?, self.effort.surrogates),
            };
            let mut judged = round.judged.iter();
            let again = judged.find(|j| j.candidate.id() == own.id() && j.p_value <= level);
            let Some(again) = again else {
                return Ok(self.as_a_pair(model, with));
            };
            *term = Term {
                point: own.point,
                beside: others.iter().map(Term::id).collect(),
                ..Term::of(again, round.rivals(again))
            };
        }
        Ok(Some(terms))
    }

    /// The model with the one or two names more that are worth most, if they are worth enough; two where they are worth
    /// clearly more than one.
    fn with_more(
        &self,
        model: &Model,
        may: &dyn Fn(&[String], f64) -> bool,
    ) -> Result<Option<Model>, Unusable> {
        let known = self.net(model);
        let mut sets = Vec::new();
        for added in self.sets(model) {
            let names: Vec<String> = added.iter().map(|j| j.candidate.id()).collect();
            let mut terms = model.terms.clone();
            terms.extend(added.iter().map(|j| Term::of(j, Vec::new())));
            let worth = self.net(&self.model(&terms)?) - known;
            sets.push((added.len(), terms, worth, may(&names, worth)));
        }
        let hope = if model.terms.is_empty() {
            HOPE_ALONE
        } else {
            HOPE
        };
        if sets.iter().all(|(_, _, worth, _)| *worth < hope) {
            return Ok(None);
        }
        let mut of_one: Option<(Model, f64)> = None;
        let mut of_two: Option<(Model, f64)> = None;
        for (added, terms, ..) in sets.into_iter().filter(|(_, _, _, may)| *may) {
            let with = self.tried(&terms, 0)?;
            let worth = self.net(&with) - known;
            let best = match added {
                1 => &mut of_one,
                _ => &mut of_two,
            };
            if best.as_ref().is_none_or(|b| worth > b.1) {
                *best = Some((with, worth));
            }
        }
        let one = of_one.as_ref().map_or(0.0, |b| b.1);
        let two = of_two.filter(|(_, worth)| *worth > AS_A_PAIR && *worth > one + MORE);
        Ok(two.or(of_one.filter(|_| one > WORTH)).map(|b| b.0))
    }

    /// The names and pairs of names that leave least of the fitted rows.
    fn sets(&self, model: &Model) -> Vec<Vec<Judged>> {
        let round = self.round(model, 0);
        let spanned = declared(self.channels);
        let spanned = spanned.iter().chain(&model.columns);
        let spanned: Vec<Vec<f64>> = spanned.map(|c| self.weighed(model, c)).collect();
        let span = Basis::new(&spanned);
        let mut left = self.weighed(model, &model.residual(self.channels));
        span.project_off(&mut left);
        let slow = round.judged.iter().filter(|j| is_slow(j));
        let each: Vec<Beside<'_>> = slow.map(|j| self.beside(model, &span, j)).collect();
        let rows = self.used.iter().filter(|u| **u).count() as f64;
        let net = |set: &[&Beside<'_>]| {
            let columns: Vec<Vec<f64>> = set.iter().flat_map(|b| b.columns.clone()).collect();
            let mut unexplained = left.clone();
            Basis::new(&columns).project_off(&mut unexplained);
            let square = dot(&unexplained, &unexplained).max(f64::MIN_POSITIVE);
            let paid: f64 = set.iter().map(|b| b.paid).sum();
            -0.5 * rows * square.ln() - paid
        };
        let mut pairs = Vec::new();
        for (k, one) in each.iter().enumerate() {
            pairs.extend(each[..k].iter().map(|other| vec![one, other]));
        }
        let ones = each.iter().map(|one| vec![one]).collect();
        [pairs, ones]
            .into_iter()
            .flat_map(|sets: Vec<Vec<&Beside<'_>>>| {
                let mut ranked: Vec<(f64, _)> = sets.into_iter().map(|s| (net(&s), s)).collect();
                ranked.sort_by(|a, b| b.0.total_cmp(&a.0));
                ranked.into_iter().take(TRIED)
            })
            .map(|(_, set)| set.into_iter().map(|b| b.judged.clone()).collect())
            .collect()
    }

    fn beside<'a>(&self, model: &Model, span: &Basis, judged: &'a Judged) -> Beside<'a> {
        let c = self.channels;
        let candidate = judged.candidate.as_ref();
        let mut columns = Vec::new();
        for column in candidate.columns(c, &model.bias, &judged.point) {
            let mut column = self.weighed(model, &column);
            span.project_off(&mut column);
            columns.push(column);
        }
        let paid = PRICE * columns.len() as f64 + price(candidate, c, &judged.point);
        Beside {
            judged,
            columns,
            paid,
        }
    }

    /// A column over the rows of the fit, those that stand out at their weight.
    fn weighed(&self, model: &Model, column: &[f64]) -> Vec<f64> {
        let weights = model.free_weights();
        let rows = column.iter().zip(&weights).zip(&self.used);
        let weighed = rows.map(|((v, w), used)| if *used && *w > 0.0 { v * w.sqrt() } else { 0.0 });
        weighed.collect()
    }
}

/// A name with coefficients of its own over the whole record, as slow as noise may be.
fn is_slow(judged: &Judged) -> bool {
    may_be_slow(judged.candidate.as_ref(), &judged.point)
}

/// The same of a candidate at a point.
pub(super) fn may_be_slow(candidate: &dyn Candidate, point: &Point) -> bool {
    let fast = candidate.id() == "periodic_pickup";
    let threshold = candidate.is_local() || candidate.is_whole();
    candidate.named() && !fast && !threshold && !candidate.is_sized(point)
}

#[cfg(test)]
#[path = "together_tests.rs"]
mod tests;
