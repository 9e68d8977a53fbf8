//! After the forward steps: every term again, with the others in.

use super::judge::{EQUAL, Judged, PRICE, Round};
use super::{MOST_RIVALS, Model, Search, Term};
use crate::statistics::Unusable;
use crate::statistics::linear::dot;

/// Net gain by which another candidate takes a term's place.
pub(super) const BETTER: f64 = 1.5;

/// Cosine of what two local shapes contribute from which on they are of one place, and the net gain that the second has to
/// bring there: noise of the thermometer, where the first is steep, makes some.
const ALIKE: f64 = 0.5;
const LIKENESS: f64 = 20.0;

/// Passes over all terms.
const SWEEPS: usize = 2;

impl Search<'_> {
    /// Every term against all other candidates, the other terms being in: it is replaced by a better
    /// one, dropped where it is not needed, and its rivals are those of the whole model.
    ///
    /// # Errors
    /// Too few rows.
    pub fn swept(&self, mut model: Model) -> Result<Model, Unusable> {
        if model.terms.len() < 2 {
            return Ok(model);
        }
        for _ in 0..SWEEPS {
            let mut changed = false;
            let mut k = 0;
            while k < model.terms.len() {
                if model.terms[k].evident {
                    k += 1;
                    continue;
                }
                let mut others = model.terms.clone();
                let own = others.remove(k);
                match self.again((&others, k), &own, &model)? {
                    Some(term) => {
                        changed |= term.id() != own.id();
                        others.insert(k, term);
                        k += 1;
                    }
                    None => changed = true,
                }
                model = self.model(&others)?;
            }
            if !changed {
                break;
            }
            model = self.polished(model)?;
        }
        Ok(model)
    }

    /// Without names that the others, in the shapes that suit them best, do as well without: such a name mended
    /// what another one's shape was off when it came.
    ///
    /// # Errors
    /// Too few rows.
    pub fn spared(&self, mut model: Model) -> Result<Model, Unusable> {
        let mut k = 0;
        while k < model.terms.len() && model.terms.len() > 1 {
            let own = &model.terms[k];
            let mut others = model.terms.clone();
            others.remove(k);
            let doubted = own.candidate.named() && !own.evident;
            if doubted && others.iter().any(|t| t.candidate.named()) {
                let due = self.net(&model) - EQUAL;
                if let Some(without) = self.polished_to(self.model(&others)?, due)? {
                    model = without;
                    k = 0;
                    continue;
                }
            }
            k += 1;
        }
        Ok(model)
    }

    /// Two names that the same third one would do for, each beside the other, give their place to it where it is worth as much
    /// as both: a shape that is not quite the one that is there needs a second one for what it is off. So do two local shapes
    /// of one place to either of them in another size.
    ///
    /// # Errors
    /// Too few rows.
    pub fn united(&self, model: Model) -> Result<Model, Unusable> {
        let named = |k: &usize| model.terms[*k].candidate.named() && !model.terms[*k].evident;
        let names: Vec<usize> = (0..model.terms.len()).filter(named).collect();
        for (i, first) in names.iter().enumerate() {
            for second in &names[i + 1..] {
                let (a, b) = (&model.terms[*first], &model.terms[*second]);
                let common = a.rivals.iter().filter(|r| b.rivals.contains(r));
                let common = common.map(|id| (id.clone(), 0.0));
                let one_place = self.are_of_one_place(&model, *first, *second);
                let either = [a.id(), b.id()].into_iter().filter(|_| one_place);
                for (id, less) in common.chain(either.map(|id| (id, LIKENESS))) {
                    let mut terms = model.terms.clone();
                    terms.remove(*second);
                    terms.remove(*first);
                    if let Some(united) = self.with_instead(terms, &id)?
                        && self.net(&united) >= self.net(&model) - less
                    {
                        return Ok(united);
                    }
                }
            }
        }
        Ok(model)
    }

    /// Whether two local shapes say the same of the same rows, or take each other back there.
    fn are_of_one_place(&self, model: &Model, first: usize, second: usize) -> bool {
        let is_local = |k: usize| model.terms[k].candidate.is_local();
        if !is_local(first) || !is_local(second) {
            return false;
        }
        let parts = self.contributions(model);
        let (a, b) = (&parts[first], &parts[second]);
        dot(a, b).powi(2) > ALIKE.powi(2) * dot(a, a) * dot(b, b)
    }

    /// The model with a name more, if it is called for.
    fn with_instead(&self, mut terms: Vec<Term>, id: &str) -> Result<Option<Model>, Unusable> {
        let others = self.model(&terms)?;
        let round = self.round(&others, self.effort.surrogates);
        let same = round.judged.iter().find(|j| j.candidate.id() == *id);
        let Some(name) = same.filter(|j| j.is_found()) else {
            return Ok(None);
        };
        let mut term = Term::of(name, round.rivals(name));
        term.beside = terms.iter().map(Term::id).collect();
        terms.push(term);
        Ok(Some(self.polished(self.model(&terms)?)?))
    }

    /// What takes a term's place beside the others in a model; `None`: nothing is needed.
    fn again(
        &self,
        (others, k): (&[Term], usize),
        own: &Term,
        with: &Model,
    ) -> Result<Option<Term>, Unusable> {
        let without = self.model(others)?;
        let explains_spikes = self.spikes(&without.fit) > self.spikes(&with.fit) + 1;
        let place = (others, k);
        let round = self.round(&without, 0);
        let again = self.again_in(place, own, &round, explains_spikes)?;
        let stays = again.as_ref().is_some_and(|t| t.id() == own.id());
        // A threshold is of few rows itself.
        if stays || own.candidate.is_whole() || own.candidate.is_local() {
            return Ok(again);
        }
        // It may lead where the rows that contradict it are out.
        let Some(keeping) = self.keeping(others, with)? else {
            return Ok(again);
        };
        let there = self.again_in(place, own, &self.judge(&keeping, 0), false)?;
        Ok(there.filter(|t| t.id() == own.id()).or(again))
    }

    /// The same by a round beside the others.
    fn again_in(
        &self,
        (others, k): (&[Term], usize),
        own: &Term,
        round: &Round,
        explains_spikes: bool,
    ) -> Result<Option<Term>, Unusable> {
        let same = round.judged.iter().find(|j| j.candidate.id() == own.id());
        let kept = |j: &Judged| {
            let mut term = Term::of(j, round.rivals(j));
            term.p_value = own.p_value;
            term.beside.clone_from(&own.beside);
            term.paired = own.paired;
            if term.id() == own.id() {
                term.found_at.clone_from(&own.found_at);
            } else {
                // The probability is that of another name.
                term.beside.push(own.id());
            }
            if term.rivals.len() > MOST_RIVALS {
                term.rivals.truncate(MOST_RIVALS);
            }
            term
        };
        let needed = |j: &Judged| j.net > PRICE;
        // A tone that is another channel's will have no name: it takes no name's place.
        let stays = |j: &&Judged| {
            j.candidate.named() && !self.is_another_channels(&j.candidate.id(), &j.point)
        };
        let best_name = round.judged.iter().find(stays);
        let Some(same) = same else {
            if explains_spikes {
                // All that it explains is out: there is nothing to judge it by but those rows.
                return Ok(Some(own.clone()));
            }
            return Ok(best_name.filter(|j| needed(j)).map(kept));
        };
        if let Some(name) = best_name
            && name.candidate.id() != own.id()
            && name.net > same.net + BETTER
            && needed(name)
            && !explains_spikes
        {
            return Ok(Some(kept(name)));
        }
        if needed(same) || explains_spikes {
            let mut term = kept(same);
            // Judged with the rows out that only it explains, it may have lost its shape.
            if term.point != own.point
                && self.value_of((others, k), own)? > self.value_of((others, k), &term)?
            {
                term.point = own.point.clone();
            }
            if explains_spikes {
                term.rivals = own.rivals.clone();
            }
            return Ok(Some(term));
        }
        Ok(None)
    }

    /// Log-likelihood with one term more, at its place among the others: that model is known, or needed next.
    fn value_of(&self, (others, k): (&[Term], usize), term: &Term) -> Result<f64, Unusable> {
        let mut terms = others.to_vec();
        terms.insert(k, term.clone());
        Ok(self.model(&terms)?.value)
    }
}

#[cfg(test)]
#[path = "sweep_tests.rs"]
mod tests;
