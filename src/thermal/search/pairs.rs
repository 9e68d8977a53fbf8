//! Two names that are beyond chance as a pair.
//!
//! Where the temperature goes one way, a third order in it and an ageing are each most of what the other one leaves, and beside
//! either the noise is as slow as what is missing. What is tested then is the pair, against all pairs of slow names, the noise
//! being the one that is there without both.

use super::together::may_be_slow;
use super::{LEVEL, Model, Search, Term};
use crate::statistics::Unusable;
use crate::statistics::candidates::Group;
use crate::statistics::score;
use crate::thermal::effects::Candidate;
use std::sync::Arc;

/// Places of a name's parameters that pairs are made of.
const PLACES: usize = 6;

/// Key of the surrogates.
const SEED: u64 = 2;

/// A candidate's id and the columns of its places in the rows of the fit.
type Places = (String, Vec<Vec<Vec<f64>>>);

impl Term {
    /// The term at place `own` among others has the probability of a pair.
    fn pair_up(&mut self, p_value: f64, ids: &[String], own: usize) {
        self.p_value = p_value;
        self.paired = true;
        self.beside = ids.to_vec();
        self.beside.remove(own);
        self.found_at.clone_from(&self.point);
    }
}

impl Search<'_> {
    /// The terms of `with`, which has two names more than `model`, if no pair of slow names is as good by chance.
    pub(super) fn as_a_pair(&self, model: &Model, mut with: Model) -> Option<Vec<Term>> {
        let known = model.terms.len();
        let ids: Vec<String> = with.terms.iter().map(Term::id).collect();
        let [one, other] = &ids[known..] else {
            return None;
        };
        let p_value = self.pair_by_chance(model, (one, other))?;
        if p_value > LEVEL {
            return None;
        }
        for (k, term) in with.terms.iter_mut().enumerate().skip(known) {
            term.pair_up(p_value, &ids, k);
        }
        Some(with.terms)
    }

    /// The model with a term's probability, and that of the one that it is paired with, as those of the pair that they are now; `None`
    /// if they are none, or chance makes as good ones.
    ///
    /// # Errors
    /// Too few rows.
    pub(super) fn still_a_pair(&self, model: &Model, k: usize) -> Result<Option<Model>, Unusable> {
        let paired = |i: &usize| *i != k && model.terms[*i].paired;
        let Some(other) = (0..model.terms.len()).find(paired) else {
            return Ok(None);
        };
        if !model.terms[k].paired {
            return Ok(None);
        }
        let ids: Vec<String> = model.terms.iter().map(Term::id).collect();
        let mut rest = model.terms.clone();
        rest.remove(k.max(other));
        rest.remove(k.min(other));
        let p_value = self.pair_by_chance(&self.model(&rest)?, (&ids[k], &ids[other]));
        let Some(p_value) = p_value.filter(|p| *p <= LEVEL) else {
            return Ok(None);
        };
        let mut model = model.clone();
        for i in [k, other] {
            model.terms[i].pair_up(p_value, &ids, i);
        }
        Ok(Some(model))
    }

    /// Probability that the best of all pairs of slow names explains as much beside a model by chance as a pair does; each name
    /// at a few places of its parameters, in the record and in the surrogates. `None`: the pair is none of those.
    fn pair_by_chance(&self, model: &Model, pair: (&str, &str)) -> Option<f64> {
        let c = self.channels;
        let is_free = |k: &&Arc<dyn Candidate>| {
            let taken = model.terms.iter().any(|t| t.id() == k.id());
            let at = k.points(c);
            let slow = at.first().is_some_and(|p| may_be_slow(k.as_ref(), p));
            !taken && k.channels(c).is_ok() && slow
        };
        let free = self.candidates.iter().filter(is_free);
        let each: Vec<Places> = free.map(|k| self.places(model, k.as_ref())).collect();
        let mut groups = Vec::new();
        let mut own = None;
        for (k, (id, one)) in each.iter().enumerate() {
            for (other_id, other) in &each[..k] {
                if [(id.as_str(), other_id.as_str()), (other_id, id)].contains(&pair) {
                    own = Some(groups.len());
                }
                let both = |a: &Vec<Vec<f64>>, b: &Vec<Vec<f64>>| [&a[..], &b[..]].concat();
                let points = one
                    .iter()
                    .flat_map(|a| other.iter().map(move |b| both(a, b)));
                groups.push(Group {
                    points: points.collect(),
                });
            }
        }
        let options = score::Options {
            surrogates: self.effort.surrogates,
            is_thin: false,
            seed: SEED,
        };
        let scores = score::score(&model.fit, &groups, &options);
        scores.groups[own?].p_bootstrap
    }

    fn places(&self, model: &Model, candidate: &dyn Candidate) -> Places {
        let c = self.channels;
        let points = candidate.points(c);
        let every = points.len().div_ceil(PLACES).max(1);
        let columns = points.iter().step_by(every).map(|point| {
            let columns = model.shown(candidate.columns(c, &model.bias, point));
            columns.iter().map(|c| model.fit.reduce(c)).collect()
        });
        (candidate.id(), columns.collect())
    }
}
