//! Names that the record cannot tell from a step's.
//!
//! A round compares names by what they explain at one noise. Two things more make equals of them: a cause that was measured with
//! noise explains less than it does, and of two forms that are both off a little one is better in one part of the record, the other
//! in the next.

use super::judge::{EQUAL, Judged, price};
use super::reading::reads_temperature;
use super::sweep::BETTER;
use super::{Found, LEVEL, MOST_RIVALS, Model, Search, Term};
use crate::statistics::Unusable;
use crate::statistics::linear::{Basis, dot};
use crate::statistics::smooth::reading_noise;
use crate::thermal::declared_bias::declared;
use crate::thermal::effects::{Candidate, tone};
use std::sync::Arc;

/// Net gain behind a step's within which names are looked at, and how many of them.
const BEHIND: f64 = 50.0;
const LOOKED: usize = 3;

/// Share of the record's halves in which an equal name is better.
const OFTEN: f64 = 0.3;

/// Most log-likelihood that the noise of a channel accounts for.
const MOST_BLUR: f64 = 12.0;

/// The same of a channel that is the step's shape and noise, in deviations of what the noise takes away.
const CHANCE: f64 = 3.0;

/// Deviations of a channel's course beside the declared model, in those of its noise, from which on it has a course at all.
const MOSTLY_COURSE: f64 = 3.0;

/// What a channel's noise may be of its white part, by third differences, in variance: a noise has slow parts too.
const SLOW_TOO: f64 = 1.5;

/// A step that another name is tried in the place of.
struct Place<'a> {
    /// The model of all steps, and of all but this one.
    model: &'a Model,
    without: &'a Model,
    /// The step as it is judged beside the others.
    same: &'a Judged,
    /// Its place among the terms.
    k: usize,
}

impl Search<'_> {
    /// Adds to the rivals of each step what does as well in its place, and names the best of them.
    ///
    /// # Errors
    /// Too few rows.
    pub(super) fn with_ties(&self, found: &mut Found) -> Result<(), Unusable> {
        for k in 0..found.terms.len() {
            let model = self.model(&found.terms)?;
            let own = found.terms[k].clone();
            if own.evident || own.candidate.is_whole() {
                continue;
            }
            let mut others = found.terms.clone();
            others.remove(k);
            let without = self.model(&others)?;
            let round = self.round(&without, 0);
            let Some(same) = round.judged.iter().find(|j| j.candidate.id() == own.id()) else {
                continue;
            };
            let place = Place {
                model: &model,
                without: &without,
                same,
                k,
            };
            let mut rivals = own.rivals.clone();
            let mut better: Option<(Term, f64)> = None;
            for rival in self.near_ones(&round.judged, same, &own) {
                let mut terms = others.clone();
                terms.insert(k, Term::of(rival, Vec::new()));
                let with = self.tried(&terms, k)?;
                let id = rival.candidate.id();
                // A bend may follow what the noise makes of the course: then the course itself is asked as well.
                let bent = with.terms[k].point.form != rival.point.form;
                let tie = self.is_tie(&place, &with, rival)
                    || bent && self.is_tie(&place, &self.model(&terms)?, rival);
                if tie && !rivals.contains(&id) {
                    rivals.push(id.clone());
                }
                let net = self.net(&with);
                // What a clip is of was judged with the rows out that it holds.
                if rivals.contains(&id)
                    && !rival.candidate.is_whole()
                    && net > better.as_ref().map_or(self.net(&model) + BETTER, |b| b.1)
                {
                    better = Some((with.terms[k].clone(), net));
                }
            }
            if let Some((mut term, _)) = better
                && let Some(p_value) = self.chance(&without, &term)
            {
                term.p_value = p_value;
                rivals.retain(|id| *id != term.id());
                rivals.insert(0, own.id());
                term.beside = others.iter().map(Term::id).collect();
                found.terms[k] = term;
            }
            rivals.truncate(MOST_RIVALS);
            found.terms[k].rivals = rivals;
        }
        Ok(())
    }

    /// Adds to the rivals of each step the other effects of a channel of its that reads the temperature as well as the
    /// thermometer does: whatever is a function of it is one of the temperature, and what the thermometer errs by looks like either.
    pub(super) fn with_thermometers(&self, found: &mut Found) {
        let c = self.channels;
        let named: Vec<String> = found.terms.iter().map(Term::id).collect();
        let of = |candidate: &dyn Candidate| candidate.channels(c).unwrap_or_default();
        for term in &mut found.terms {
            let mut channels = of(term.candidate.as_ref());
            channels.retain(|name| reads_temperature(c, name));
            let shares = |k: &&Arc<dyn Candidate>| {
                k.named() && of(k.as_ref()).iter().any(|name| channels.contains(name))
            };
            for id in self.candidates.iter().filter(shares).map(|k| k.id()) {
                let known = named.contains(&id) || term.rivals.contains(&id);
                if !known && term.rivals.len() < MOST_RIVALS {
                    term.rivals.push(id);
                }
            }
        }
    }

    /// The probability of a name beside a model, if it is beyond chance.
    fn chance(&self, without: &Model, term: &Term) -> Option<f64> {
        let round = self.round(without, self.effort.surrogates);
        let same = round.judged.iter().find(|j| j.candidate.id() == term.id());
        same.map(|j| j.p_value).filter(|p| *p <= LEVEL)
    }

    /// Whether a model with another name in a step's place is as good.
    fn is_tie(&self, of: &Place<'_>, with: &Model, rival: &Judged) -> bool {
        let unlikely = match self.is_of_own_channel(rival, &of.model.terms[of.k]) {
            // That it has just the channel's frequency speaks against it, but nothing in the record does.
            true => price(rival.candidate.as_ref(), self.channels, &rival.point),
            false => rival.odds_against,
        };
        let behind = self.net(of.model) - self.net(with) - unlikely;
        let blur = (self.blur_of(with, of.k) - self.blur_of(of.model, of.k)).max(0.0);
        // What the noise takes away is itself by chance: its variance is twice its mean.
        let allowed = match self.is_shape_and_noise(of, with) {
            true => blur + CHANCE * (2.0 * blur).sqrt(),
            false => blur.min(MOST_BLUR),
        };
        behind < EQUAL + allowed
            || self.selection_frequency(with, of.k, of.without, [of.same]) >= OFTEN
    }

    /// Whether a rival's contribution is, beside the declared model, that of the step and the noise of its reading: no part of it
    /// that could speak for or against it is left.
    fn is_shape_and_noise(&self, of: &Place<'_>, with: &Model) -> bool {
        let c = self.channels;
        let of_used = |column: &Vec<f64>| self.of_used(column);
        let rival = &with.contributions(c)[of.k];
        let step = &of.model.contributions(c)[of.k];
        let noise_dps = reading_noise(&c.time_s, rival);
        let mut basis = Basis::new(&declared(c).iter().map(of_used).collect::<Vec<_>>());
        let mut rest = of_used(rival);
        let rows = rest.len() as f64;
        let mut off = |basis: &Basis| {
            basis.project_off(&mut rest);
            dot(&rest, &rest) / rows
        };
        let course = off(&basis);
        basis.push(&of_used(step));
        let left = off(&basis);
        course > (MOSTLY_COURSE * noise_dps).powi(2) && left < SLOW_TOO * noise_dps.powi(2)
    }

    /// Names next to a step's, best first.
    fn near_ones<'j>(
        &'j self,
        judged: &'j [Judged],
        same: &'j Judged,
        own: &'j Term,
    ) -> impl Iterator<Item = &'j Judged> {
        let names = judged.iter().filter(|j| j.candidate.named());
        let others = names.filter(|j| j.candidate.id() != own.id());
        let near = others.filter(|j| j.net + j.odds_against > same.net - BEHIND);
        near.filter(|j| {
            !self.is_another_channels(&j.candidate.id(), &j.point) || self.is_of_own_channel(j, own)
        })
        .take(LOOKED)
    }

    /// Whether a rival is a sinusoid that a channel of the step is as well.
    fn is_of_own_channel(&self, rival: &Judged, step: &Term) -> bool {
        let frequency_hz = rival.point.theta.first();
        let frequency_hz = frequency_hz.filter(|_| rival.candidate.id() == tone::NAMED);
        let channel = frequency_hz.and_then(|hz| self.another_channels(*hz));
        let own = step.candidate.channels_at(self.channels, &step.point);
        channel.is_some_and(|name| own.contains(&name) && name != "time_s")
    }

    /// Log-likelihood that the noise of what a term is a function of takes away.
    fn blur_of(&self, model: &Model, k: usize) -> f64 {
        let c = self.channels;
        let all = model.contributions(c);
        let noise_dps = reading_noise(&c.time_s, &all[k]);
        let white_dps = model.fit.noise.white_rms_dps.max(f64::MIN_POSITIVE);
        let rows = self.used.iter().filter(|u| **u).count() as f64;
        0.5 * rows * (noise_dps / white_dps).powi(2).ln_1p()
    }
}

#[cfg(test)]
#[path = "ties_tests.rs"]
mod tests;
