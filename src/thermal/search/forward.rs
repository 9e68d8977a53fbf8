//! Forward steps.

use super::judge::{Judged, PRICE, Round};
use super::memo::Memo;
use super::otherwise::Due;
use super::{Found, LEVEL, MOST_RIVALS, Model, Search, Term};
use crate::statistics::robust::ACCIDENT;
use crate::statistics::{Unusable, reml};
use crate::thermal::effects::Candidate;
use std::sync::Arc;

/// By how much net gain a shape without a name has to be better than the best name.
pub(super) const STRANGER: f64 = 6.0;

/// Most shapes without a name.
const STRANGERS: usize = 3;

/// Fewest spikes that are looked into.
const FEW: usize = 2;

/// Log-likelihood by which an explanation of spikes has to be better than none: two accidents near
/// to each other are soon explained by a shape with a few parameters, less so by a threshold
/// without a free coefficient.
pub(super) const WORTH: f64 = 20.0;
const WORTH_WHOLE: f64 = 5.0;

/// Log-likelihood above its worth from which on a threshold without a free coefficient needs no surrogates: among noise that
/// has all spikes in it many of them are nothing.
const SURELY: f64 = 30.0;

/// Names that are looked at for spikes; what a quick look may be short of a thorough one.
const LOOKED: usize = 5;
const MARGIN: f64 = 4.0;

/// Names that are asked whether they are enough where a shape without a name explains more.
const ENOUGH: usize = 2;

/// Log-likelihood that a step after the first may cost: it is judged with the rows that stand out at the weights that they have without it, and
/// where very many do, others do so with it, and explain nothing.
const LOST: f64 = 10.0;

/// Most rounds of forward steps and sweeps.
const ROUNDS: usize = 3;

/// What comes next.
pub enum Next {
    /// A term, named or not.
    Add(Term),
    /// Too many names for one thing.
    Undecided(Term),
    /// Nothing.
    Stop,
}

impl Search<'_> {
    /// One run of the search, and its model before names were dropped. One to which something is `due` ends, with something
    /// left, where it will not come to that.
    ///
    /// # Errors
    /// Too few rows to fit anything.
    pub(super) fn run_once(&self, due: Option<&Due>) -> Result<(Found, Model), Unusable> {
        let mut found = Found::default();
        let mut model = self.beginning()?;
        for _ in 0..ROUNDS {
            model = self.forward(model, &mut found, due)?;
            if due.is_some() && found.left.is_some() {
                return Ok((found, model));
            }
            let before: Vec<String> = model.terms.iter().map(Term::id).collect();
            model = self.united(self.spared(self.swept(model)?)?)?;
            model = self.without_undone(model)?;
            model = self.one_tone_named(model)?;
            model = self.proven(model)?;
            if model.terms.iter().map(Term::id).eq(before) {
                break;
            }
        }
        let reached = model.clone();
        let model = self.validated(model, &mut found)?;
        if found.left.is_none() && self.coloured(&model) {
            found.left = Some("time_s".to_owned());
        }
        for term in model.terms {
            if term.candidate.named() {
                found.terms.push(term);
            } else {
                found.strangers.push(term);
            }
        }
        if let Some(stranger) = found.strangers.first() {
            found.left = found.left.or_else(|| self.channel(stranger));
        }
        self.kept_alone(&mut found)?;
        Ok((found, reached))
    }

    /// Steps until nothing is called for, or, where something is due, until that is out of reach.
    fn forward(
        &self,
        mut model: Model,
        found: &mut Found,
        due: Option<&Due>,
    ) -> Result<Model, Unusable> {
        loop {
            let named = model.terms.iter().filter(|t| t.candidate.named()).count();
            let strangers = model.terms.len() - named;
            if named >= self.effort.steps || strangers >= STRANGERS {
                return Ok(model);
            }
            let here = self.visited(&model);
            if due.is_some_and(|due| self.was_there(&here, due)) {
                found.left = Some("time_s".to_owned());
                return Ok(model);
            }
            found.visited.push(here);
            let round = self.round(&model, self.effort.surrogates);
            if due.is_some_and(|due| self.falls_short(&model, &round, due)) {
                found.left = Some("time_s".to_owned());
                return Ok(model);
            }
            if found.first.is_empty() {
                found.first = round.judged.clone();
            }
            let next = self.next(&model, &round, found)?;
            if found.missing.is_empty() {
                found.missing.clone_from(&round.missing);
            }
            match next {
                Next::Stop => return Ok(model),
                Next::Undecided(term) => {
                    found.left = self.channel(&term);
                    found.undecided.push(term.id());
                    found.undecided.extend(term.rivals);
                    return Ok(model);
                }
                Next::Add(mut term) => {
                    term.beside = model.terms.iter().map(Term::id).collect();
                    let names: Vec<String> = [term.beside.as_slice(), &[term.id()]].concat();
                    let in_vain = |due| !term.candidate.named() || self.is_back(&names, due);
                    if due.is_some_and(in_vain) {
                        found.left = self.channel(&term);
                        return Ok(model);
                    }
                    let mut terms = model.terms.clone();
                    terms.push(term);
                    let with = self.polished(self.model(&terms)?)?;
                    if !model.terms.is_empty() && self.net(&with) < self.net(&model) - LOST {
                        found.left = with.terms.last().and_then(|t| self.channel(t));
                        return Ok(model);
                    }
                    model = with;
                }
            }
        }
    }

    /// The next step from a round.
    fn next(&self, model: &Model, round: &Round, found: &mut Found) -> Result<Next, Unusable> {
        // A name that gains no more than it costs is no better than none, however rare that is by chance.
        let called_for = |j: &&Judged| j.p_value <= LEVEL && (j.net > PRICE || !j.is_named());
        let significant: Vec<&Judged> = round.judged.iter().filter(called_for).collect();
        let leader = significant.first();
        if let Some(leader) = leader
            && let Some(mending) = self.mending(model, leader, &round.judged)?
        {
            // What else there is shows beside it.
            let mending = Term::of(mending, Vec::new());
            found.bent = found.bent.take().or_else(|| self.channel(&mending));
            let mended = self.model(&[model.terms.as_slice(), &[mending]].concat())?;
            let round = self.round(&mended, self.effort.surrogates);
            return self.next(&mended, &round, found);
        }
        let begins = model.terms.iter().all(|t| t.evident);
        if let Some(opening) = self.beginning.borrow().opening.as_ref().filter(|_| begins)
            && let Some(name) = significant.iter().find(|j| j.candidate.id() == *opening)
        {
            return Ok(decided(Term::of(name, round.rivals(name))));
        }
        if let Some(term) = self.of_spikes(model, round, &significant)? {
            return Ok(Next::Add(term));
        }
        let Some(leader) = leader else {
            return Ok(Next::Stop);
        };
        // A tone that is another channel's will have no name: it is one to the other names.
        let near = |j: &&&Judged| j.candidate.named() && j.net > leader.net - STRANGER;
        let own = |j: &&&Judged| near(j) && !self.is_another_channels(&j.candidate.id(), &j.point);
        let mut names = significant.iter();
        let name = names.clone().find(own).or_else(|| names.find(near));
        // A law that is bent before an unusual shape of another name, or one that has none.
        let usual = name.filter(|n| n.odds_against <= 0.0);
        if usual.is_none()
            && let Some(law) = self.law_of(model, &significant, name.unwrap_or(leader))?
        {
            return Ok(decided(Term::of(law, round.rivals(law))));
        }
        if let Some(name) = name {
            return Ok(decided(Term::of(name, round.rivals(name))));
        }
        if let Some(first) = self.name_instead(model, &significant, leader)? {
            return Ok(Next::Add(Term::of(first, round.rivals(first))));
        }
        Ok(Next::Add(Term::of(leader, Vec::new())))
    }

    /// A name that explains rows which would else be spikes, if it explains the record better than all
    /// that this round found. Judged with every row at full weight: a clipped peak or a short
    /// transient is rare, but no accident.
    fn of_spikes(
        &self,
        model: &Model,
        round: &Round,
        found: &[&Judged],
    ) -> Result<Option<Term>, Unusable> {
        let spikes = self.spikes(&model.fit);
        if spikes < FEW {
            return Ok(None);
        }
        let may = may_be(round, found.first().copied(), spikes);
        let leads = |candidate: &dyn Candidate| {
            let leader = found.first().map(|f| f.candidate.id());
            !candidate.is_whole() && leader == Some(candidate.id())
        };
        let judged = round.judged.iter().map(|j| &j.candidate);
        let mut all = self.candidates.iter().chain(judged);
        if !all.any(|k| k.named() && may(k.as_ref()) && !leads(k.as_ref())) {
            return Ok(None);
        }
        let plainly = reml::Options {
            robust: false,
            ..self.options()
        };
        let plain = self.model_with(&model.terms, &plainly)?;
        // The thorough look meets the names of the quick one again.
        let known = Memo::default();
        let with = |j: &Judged| -> Result<Arc<Model>, Unusable> {
            let mut terms = model.terms.clone();
            terms.push(Term::of(j, Vec::new()));
            if let Some(with) = known.get(&terms) {
                return Ok(with);
            }
            let mut with = self.model_with(&terms, &self.near(model))?;
            let least = worth(j.candidate.as_ref());
            let above = with.value - j.gain + j.net - model.value;
            // A clip's level in the plain fit, which holds every spike, is not where the rows are that it holds.
            if j.candidate.is_last() && j.net > least && above <= least {
                with = self.tried(&terms, model.terms.len())?;
            }
            let with = Arc::new(with);
            known.keep(&terms, with.clone());
            Ok(with)
        };
        let value = |j: &Judged| Ok(with(j)?.value - j.gain + j.net);
        // First without surrogates, which cost most and decide nothing where no name is worth it, or the best
        // one leads without the spikes.
        let quick = self.plain_round(&plain, 0);
        let mut worthy: Option<(&Judged, f64)> = None;
        let mut sure: Vec<String> = Vec::new();
        let could = |j: &Judged| j.is_named() && may(j.candidate.as_ref());
        for j in looked(&quick.judged, could) {
            let above = value(j)? - model.value - worth(j.candidate.as_ref()) + MARGIN;
            if j.candidate.is_whole() && above > SURELY {
                sure.push(j.candidate.id());
            }
            if above >= worthy.map_or(0.0, |w| w.1) {
                worthy = Some((j, above));
            }
        }
        if worthy.is_none_or(|(j, _)| leads(j.candidate.as_ref())) {
            return Ok(None);
        }
        let all = self.plain_round(&plain, self.effort.surrogates);
        let mut best: Option<(&Judged, f64)> = None;
        let mut others = Vec::new();
        let is_sure = |j: &Judged| sure.contains(&j.candidate.id());
        for j in looked(&all.judged, |j| j.is_found() || is_sure(j)) {
            let value = value(j)?;
            others.push((j.candidate.id(), value));
            if best.is_none_or(|b| value > b.1) {
                best = Some((j, value));
            }
        }
        let Some((best, reached)) = best else {
            return Ok(None);
        };
        // Which rows are spikes and how the noise is coloured depend on each other: without the name there may be as good a
        // fit next to the one with it.
        let next_to = self.model_with(&model.terms, &self.near(&*with(best)?))?;
        let without = model.value.max(next_to.value);
        if reached < without + worth(best.candidate.as_ref()) {
            return Ok(None);
        }
        for j in found.iter().take(2) {
            if j.candidate.id() != best.candidate.id() && value(j)? >= reached {
                return Ok(None);
            }
        }
        others.retain(|(id, value)| *id != best.candidate.id() && *value > reached - all.equal);
        let rivals = others.into_iter().map(|(id, _)| id).collect();
        let mut term = Term::of(best, rivals);
        if is_sure(best) {
            term.p_value = term
                .p_value
                .min((without + worth(best.candidate.as_ref()) - reached).exp());
        }
        Ok(Some(term))
    }

    /// A quick fit beside a model: the noise is looked for near its own.
    pub fn near(&self, model: &Model) -> reml::Options<'static> {
        reml::Options {
            near: Some(model.fit.at.shape),
            ..self.options()
        }
    }

    /// Where a shape without a name leads: a name that explains as much, fitted with its own noise (a gain is found at
    /// one noise for all points of a candidate), or with another name. Two causes together often look like neither.
    fn name_instead<'j>(
        &self,
        model: &Model,
        significant: &[&'j Judged],
        leader: &Judged,
    ) -> Result<Option<&'j Judged>, Unusable> {
        let near = self.near(model);
        let value = |added: &[&Judged]| -> Result<f64, Unusable> {
            let mut terms = model.terms.clone();
            terms.extend(added.iter().map(|j| Term::of(j, Vec::new())));
            let price: f64 = added.iter().map(|j| j.gain - j.net).sum();
            Ok(self.model_with(&terms, &near)?.value - price)
        };
        // Levels, widths and forms lie between those that were tried: as good as they get.
        let as_good = |added: &[&Judged]| -> Result<f64, Unusable> {
            let sharp = |j: &&Judged| j.candidate.is_whole() || j.candidate.is_local();
            if !added.iter().any(sharp) {
                return value(added);
            }
            let mut terms = model.terms.clone();
            terms.extend(added.iter().map(|j| Term::of(j, Vec::new())));
            let price: f64 = added.iter().map(|j| j.gain - j.net).sum();
            Ok(self.tried(&terms, model.terms.len())?.value - price)
        };
        let alone = value(&[leader])?;
        let mut best: Option<(&Judged, f64)> = None;
        let names = || significant.iter().filter(|j| j.candidate.named()).take(4);
        for j in names() {
            let one = as_good(&[j])?;
            if one > alone - STRANGER && best.is_none_or(|b| one > b.1) {
                best = Some((j, one));
            }
        }
        if let Some((j, _)) = best {
            return Ok(Some(j));
        }
        for j in names() {
            let mut terms = model.terms.clone();
            terms.push(Term::of(j, Vec::new()));
            let names = |candidate: &dyn Candidate| candidate.named();
            let second = self.gains_of(&self.model_with(&terms, &near)?, &names);
            let Some(second) = second.judged.iter().find(|j| j.candidate.named()) else {
                continue;
            };
            let both = as_good(&[j, second])?;
            if both > alone - STRANGER && best.is_none_or(|b| both > b.1) {
                best = Some((j, both));
            }
        }
        if let Some((j, _)) = best {
            return Ok(Some(j));
        }
        // A shape with more coefficients follows the noise as well: a name beside which nothing is beyond chance is enough.
        for j in names().take(ENOUGH) {
            let mut terms = model.terms.clone();
            terms.push(Term::of(j, Vec::new()));
            let with = self.tried(&terms, model.terms.len())?;
            let left = self.round(&with, self.effort.surrogates);
            if left.judged.iter().all(|j| j.p_value > LEVEL) && !self.coloured(&with) {
                return Ok(Some(j));
            }
        }
        Ok(None)
    }
}

/// Log-likelihood by which a name has to be better than spikes.
fn worth(candidate: &dyn Candidate) -> f64 {
    match candidate.is_whole() {
        true => WORTH_WHOLE,
        false => WORTH,
    }
}

/// Which candidates could be the best if they explained every spike, and all other rows as well as they do without these.
fn may_be(
    round: &Round,
    leader: Option<&Judged>,
    spikes: usize,
) -> impl Fn(&dyn Candidate) -> bool {
    let most = ACCIDENT * spikes as f64 + MARGIN;
    move |candidate| {
        let id = candidate.id();
        let own = round.judged.iter().find(|j| j.candidate.id() == id);
        let others = leader.filter(|l| l.candidate.id() != id);
        let due = others.map_or(0.0, |l| l.net).max(worth(candidate));
        round.at_most(own) + most >= due
    }
}

/// The best names and every clip, of those that `are`: the noise of the plain fit, which holds all spikes, hides
/// those that only a few of them explain.
fn looked(judged: &[Judged], are: impl Fn(&Judged) -> bool) -> impl Iterator<Item = &Judged> {
    let each = judged.iter().filter(move |j| are(j)).enumerate();
    each.filter(|(k, j)| *k < LOOKED || j.candidate.is_last() || j.candidate.is_whole())
        .map(|(_, j)| j)
}

/// A named term, unless too many others do as well.
fn decided(term: Term) -> Next {
    if term.rivals.len() > MOST_RIVALS {
        Next::Undecided(term)
    } else {
        Next::Add(term)
    }
}

#[cfg(test)]
#[path = "forward_tests.rs"]
mod tests;
