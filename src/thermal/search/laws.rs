//! Laws that are not quite the catalogue's.
//!
//! A device follows a catalogue's law to a few per cent: a gain bends a little, a step is a few small ones, the zero of an
//! accelerometer is off. Beside a large effect that is much in units of the noise. A shape without a name of the same channel, which
//! has the law in it, then explains more than the law does, and a second name of the channel mends what the first one
//! leaves. Neither is another cause: the law is named, and the channel is one in which something is left.

use super::forward::STRANGER;
use super::judge::Judged;
use super::{Model, Search, Term};
use crate::statistics::Unusable;
use crate::thermal::effects::MOST_BENT;

/// Share of what a shape without a name explains, in squares, that a law of its channel may be short of; the same of what a law
/// explains, up to which it is the law's own bend. A second name may be a cause of its own: a smaller share.
const BEND: f64 = MOST_BENT * MOST_BENT;
const NAMED: f64 = 0.006;

/// Names of a channel that are asked.
const ASKED: usize = 3;

/// The channel that a shape is of; the times since the record's beginning and since power-on are one.
fn channel(search: &Search<'_>, term: &Term) -> Option<String> {
    let name = search.channel(term)?;
    Some(match name.as_str() {
        "time_since_power_on_s" => "time_s".to_owned(),
        _ => name,
    })
}

impl Search<'_> {
    fn of(&self, judged: &Judged) -> Option<String> {
        channel(self, &Term::of(judged, Vec::new()))
    }

    fn with(&self, model: &Model, judged: &Judged) -> Result<Model, Unusable> {
        let mut terms = model.terms.clone();
        terms.push(Term::of(judged, Vec::new()));
        self.model_with(&terms, &self.near(model))
    }

    /// Where a shape without a name leads, or an unusual one: a usual name of its channel that explains all but a bend of what the
    /// shape does.
    ///
    /// # Errors
    /// Too few rows.
    pub(super) fn law_of<'j>(
        &self,
        model: &Model,
        called: &[&'j Judged],
        leader: &Judged,
    ) -> Result<Option<&'j Judged>, Unusable> {
        let own = self.of(leader);
        let names = called
            .iter()
            .filter(|j| j.is_named() && j.odds_against <= 0.0 && self.of(j) == own)
            .take(ASKED);
        let names: Vec<&Judged> = names.copied().collect();
        if names.is_empty() {
            return Ok(None);
        }
        let all = self.with(model, leader)?;
        let weights = all.free_weights();
        let explained = self.square(model, &weights) - self.square(&all, &weights);
        let c = self.channels;
        for name in names {
            let forms = name.candidate.beside(c, &name.point);
            for point in std::iter::once(name.point.clone()).chain(forms) {
                let other = Judged {
                    point,
                    ..name.clone()
                };
                let with = self.with(model, &other)?;
                let short = self.square(&with, &weights) - self.square(&all, &weights);
                // In slow noise squares say little: a shape that has the law in it explains no less than the law.
                if short.abs() <= BEND * explained && with.admits(c, model.terms.len()) {
                    return Ok(Some(name));
                }
            }
        }
        Ok(None)
    }

    /// The shape that mends a law of a model, where what leads a round is no more than that: a shape without a name of the law's channel
    /// that does as much, or the leader itself.
    ///
    /// # Errors
    /// Too few rows.
    pub(super) fn mending<'j>(
        &self,
        model: &Model,
        leader: &'j Judged,
        judged: &'j [Judged],
    ) -> Result<Option<&'j Judged>, Unusable> {
        let own = self.of(leader);
        let reaches = |j: &&Judged| j.net > leader.net - STRANGER && self.of(j) == own;
        let shape = judged.iter().filter(|j| !j.is_named()).find(reaches);
        let mending = shape.unwrap_or(leader);
        Ok(self.mends(model, mending)?.then_some(mending))
    }

    /// Whether one of the names mends a law that is another one of them.
    ///
    /// # Errors
    /// Too few rows.
    pub(super) fn has_mend(&self, terms: &[Term]) -> Result<bool, Unusable> {
        for (k, own) in terms.iter().enumerate() {
            let mut others = terms.to_vec();
            others.remove(k);
            if others.iter().any(|t| self.are_kin(t, own))
                && self.is_little(&self.model(&others)?, own, &self.model(terms)?)?
            {
                return Ok(true);
            }
        }
        Ok(false)
    }

    /// Whether what a candidate explains beside a model is no more than a law of its channel in it may be bent.
    fn mends(&self, model: &Model, judged: &Judged) -> Result<bool, Unusable> {
        let own = Term::of(judged, Vec::new());
        self.is_little(model, &own, &self.with(model, judged)?)
    }

    /// Whether a term that is in `with` beside a model's is little beside a law of its channel.
    fn is_little(&self, model: &Model, own: &Term, with: &Model) -> Result<bool, Unusable> {
        let named = own.candidate.named();
        let (share, weights) = (if named { NAMED } else { BEND }, with.free_weights());
        let reached = self.square(model, &weights);
        let gained = reached - self.square(with, &weights);
        for k in 0..model.terms.len() {
            if !self.are_kin(&model.terms[k], own) {
                continue;
            }
            let mut others = model.terms.clone();
            others.remove(k);
            let without = self.model_with(&others, &self.near(model))?;
            if gained <= share * (self.square(&without, &weights) - reached) {
                return Ok(true);
            }
        }
        Ok(false)
    }

    /// Whether a named law and another shape are of one channel: two names, of all the same channels. A sharp name is one of
    /// its own, and names that act on the bias are each most of what the other one is.
    fn are_kin(&self, law: &Term, other: &Term) -> bool {
        let channels = |t: &Term| t.candidate.channels_at(self.channels, &t.point);
        let apart = |t: &Term| t.candidate.is_local() || t.candidate.acts_on_bias();
        law.candidate.named()
            && match other.candidate.named() {
                false => channel(self, law) == channel(self, other),
                true => !apart(law) && !apart(other) && channels(law) == channels(other),
            }
    }

    /// Sum of a model's squares over rows of these weights, (deg/s)^2.
    fn square(&self, model: &Model, weights: &[f64]) -> f64 {
        let rest = model.residual(self.channels);
        let rows = rest.iter().zip(weights).filter(|(_, w)| **w > 0.0);
        rows.map(|(r, w)| w * r * r).sum()
    }
}

#[cfg(test)]
#[path = "laws_tests.rs"]
mod tests;
