//! What is in a record before anything is fitted: a clip at its rails.

use super::judge::PRICE;
use super::{Model, Search, Term};
use crate::statistics::Unusable;
use crate::thermal::effects::{Candidate, Point};
use std::sync::Arc;

/// Log-likelihood that a level opposite to a rail has to bring: other effects are not in yet.
const WORTH: f64 = 20.0;

/// The same of a level that explains so many rows which are spikes without it: accidents do not agree on a level.
const WORTH_OF_SPIKES: f64 = 10.0;
const SPIKES: usize = 3;

/// Steps of a level towards the mean of its rows.
const STEPS: usize = 3;

impl Search<'_> {
    /// The model at the beginning: the declared one, with a clip if the record has rails; or what this run is given.
    ///
    /// # Errors
    /// Too few rows.
    pub fn beginning(&self) -> Result<Model, Unusable> {
        let given = self.beginning.borrow().given.clone();
        if !given.is_empty() {
            return self.polished(self.model(&given)?);
        }
        let Some(clip) = self.clip() else {
            return self.model(&[]);
        };
        let one = self.model(std::slice::from_ref(&clip))?;
        let opposite = match clip.point.theta.as_slice() {
            [_] => self.opposite(&clip, &one)?,
            _ => None,
        };
        Ok(opposite.unwrap_or(one))
    }

    /// The clip at the rails.
    fn clip(&self) -> Option<Term> {
        let rails = self.rails.as_ref()?;
        let candidate = self.candidates.iter().find(|c| c.is_last())?;
        let point = candidate.at_levels(rails.lower_dps, rails.upper_dps)?;
        Some(Term {
            p_value: rails.p_value,
            evident: true,
            ..Term::new(candidate.clone(), point)
        })
    }

    /// With a level on the side that has no rail, where the output clips there as well (before its noise, or in a few
    /// readings only).
    fn opposite(&self, clip: &Term, one: &Model) -> Result<Option<Model>, Unusable> {
        let mut best: Option<Model> = None;
        for level_dps in self.levels(&clip.candidate) {
            let Some(point) = self.with_level(&clip.candidate, level_dps) else {
                continue;
            };
            let term = Term {
                point,
                ..clip.clone()
            };
            let model = self.model_with(&[term], &self.near(one))?;
            if best.as_ref().is_none_or(|b| model.value > b.value) {
                best = Some(model);
            }
        }
        let worth = |b: &Model| match self.spikes(&one.fit) >= self.spikes(&b.fit) + SPIKES {
            true => WORTH_OF_SPIKES,
            false => WORTH,
        };
        let Some(mut best) = best.filter(|b| b.value > one.value + worth(b) + PRICE) else {
            return Ok(None);
        };
        for _ in 0..STEPS {
            let off_dps = self.off_level(&best);
            let term = &best.terms[0];
            let Some(point) = self.with_level(&term.candidate, self.free_level(term) + off_dps)
            else {
                break;
            };
            let term = Term {
                point,
                ..term.clone()
            };
            let next = self.model(&[term])?;
            if self.off_level(&next).abs() >= off_dps.abs() {
                break;
            }
            best = next;
        }
        Ok(Some(self.model(&best.terms)?))
    }

    /// The rails, and a level on the side that has none.
    fn with_level(&self, candidate: &Arc<dyn Candidate>, level_dps: f64) -> Option<Point> {
        let rails = self.rails.as_ref()?;
        let lower = rails.lower_dps.unwrap_or(level_dps);
        let upper = rails.upper_dps.unwrap_or(level_dps);
        (lower < upper).then_some(())?;
        candidate.at_levels(Some(lower), Some(upper))
    }

    /// The level of a clip on the side without a rail; as [`Candidate::at_levels`] has them: upper, lower.
    fn free_level(&self, term: &Term) -> f64 {
        let is_upper = self.rails.as_ref().is_some_and(|r| r.upper_dps.is_none());
        let level = term.point.theta.get(usize::from(!is_upper));
        level.copied().unwrap_or(0.0)
    }

    /// How far the rows that a clip holds on the side without a rail lie from its level on average, deg/s: what they have in
    /// common beside slow noise says less of it, for a clip holds back what wanders before it.
    fn off_level(&self, model: &Model) -> f64 {
        let [upper, lower] = self.off_levels(model, &model.terms[0]);
        let is_upper = self.rails.as_ref().is_some_and(|r| r.upper_dps.is_none());
        let off_dps = if is_upper { upper } else { lower };
        off_dps.unwrap_or(0.0)
    }

    /// Levels to try on the side without a rail.
    fn levels(&self, candidate: &Arc<dyn Candidate>) -> Vec<f64> {
        let form = match self.rails.as_ref().map(|r| r.upper_dps.is_none()) {
            Some(true) => 1,
            _ => 2,
        };
        let points = candidate.points(self.channels);
        let one_sided = points.iter().filter(|p| p.form == form);
        one_sided.filter_map(|p| p.theta.first().copied()).collect()
    }
}
