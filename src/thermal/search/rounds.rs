//! Rounds that are known: a search comes back to the same terms when it sweeps, when it reports, and from another beginning.
//!
//! A beginning that does without some candidates finds of the others what was found with them, except where one of those it
//! does without led: what is near the leader is looked at finely, the rest is not, so that the finer looks are taken anew.
//! The probabilities are then those of the best of all candidates, those that are out among them: never too small.

use super::judge::{Round, Scored};
use super::memo::Memo;
use super::{Model, Search, Term};
use std::sync::Arc;

/// A round as it was judged.
#[derive(Clone)]
pub(super) struct Known {
    /// Candidates that were out.
    barred: Vec<String>,
    surrogates: usize,
    scored: Arc<Scored>,
    round: Arc<Round>,
}

/// What is known of a round with other candidates out.
enum Rest {
    Round(Arc<Round>),
    /// Not how the rest looks finely: what led is out.
    Scored(Scored),
}

impl Known {
    /// What is known of the round for other candidates out and so many surrogates.
    fn with(&self, barred: &[String], surrogates: usize) -> Option<Rest> {
        let further: Vec<&String> = barred
            .iter()
            .filter(|id| !self.barred.contains(id))
            .collect();
        let all = self.barred.iter().all(|id| barred.contains(id));
        if !all || self.surrogates < surrogates {
            return None;
        }
        if further.is_empty() {
            return Some(Rest::Round(self.round.clone()));
        }
        let is_out = |id: String| further.contains(&&id);
        if self.round.leads.clone().is_some_and(is_out) {
            let rest = self.scored.without(&|candidate| is_out(candidate.id()))?;
            return Some(Rest::Scored(rest));
        }
        let mut round = (*self.round).clone();
        round.judged.retain(|j| !is_out(j.candidate.id()));
        let missing = &mut round.missing;
        missing.retain(|(candidate, _)| !is_out(candidate.id()));
        Some(Rest::Round(Arc::new(round)))
    }
}

/// Terms whatever order they came in.
fn in_order(terms: &[Term]) -> Vec<Term> {
    let mut out = terms.to_vec();
    out.sort_by_key(Term::id);
    out
}

impl Search<'_> {
    /// Everything judged beside a [`Search::model`]; `surrogates` = 0: gains alone, which an earlier round
    /// beside the same terms has as well.
    pub fn round(&self, model: &Model, surrogates: usize) -> Arc<Round> {
        self.known_round(&self.rounds, model, surrogates)
    }

    /// The same beside a model with every row at full weight.
    pub(super) fn plain_round(&self, plain: &Model, surrogates: usize) -> Arc<Round> {
        self.known_round(&self.plain_rounds, plain, surrogates)
    }

    /// A round beside a model that its terms tell, from those of its kind that are known.
    fn known_round(&self, rounds: &Memo<Known>, model: &Model, surrogates: usize) -> Arc<Round> {
        let terms = in_order(&model.terms);
        let barred = self.beginning.borrow().barred.clone();
        let known = rounds.get(&terms);
        let scored = match known.and_then(|known| known.with(&barred, surrogates)) {
            Some(Rest::Round(round)) => return round,
            Some(Rest::Scored(scored)) => scored,
            None => self.scored(model, surrogates),
        };
        let round = Arc::new(self.judged(model, &scored));
        let known = Known {
            barred,
            surrogates,
            scored: Arc::new(scored),
            round: round.clone(),
        };
        rounds.keep(&terms, known);
        round
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::thermal::channels::Channels;
    use crate::thermal::search::Effort;
    use crate::thermal::synthetic::Random;
    use std::collections::BTreeMap;

    #[test]
    fn a_round_is_judged_again_only_where_what_is_barred_led() {
        let mut random = Random::new(5);
        let degc: Vec<f64> = (0..200).map(|k| 20.0 + 0.2 * f64::from(k)).collect();
        let cubic = |t: f64| ((t - 40.0) / 20.0).powi(3);
        let output = degc
            .iter()
            .map(|t| 0.1 * cubic(*t) + 0.01 * random.normal());
        let columns = BTreeMap::from([
            ("rate_out_dps".to_owned(), output.collect()),
            ("die_degc".to_owned(), degc.clone()),
        ]);
        let time_s: Vec<f64> = (0..200).map(|k| 10.0 * f64::from(k)).collect();
        let c = Channels::new(&time_s, &columns, "die_degc", |t| t).unwrap();
        let search = Search::new(&c, &c.split().unwrap(), Effort::default(), Vec::new());
        let model = search.model(&[]).unwrap();
        let ids = |round: &Round| -> Vec<String> {
            round.judged.iter().map(|j| j.candidate.id()).collect()
        };
        let first = search.round(&model, 20);
        let leads = first.leads.clone().unwrap();
        assert!(Arc::ptr_eq(&first, &search.round(&model, 0)), "known");
        let other = ids(&first).into_iter().find(|id| *id != leads).unwrap();
        search.bar(other.clone());
        let filtered = search.round(&model, 20);
        let due: Vec<String> = ids(&first).into_iter().filter(|id| *id != other).collect();
        assert_eq!(ids(&filtered), due);
        assert_eq!(filtered.leads.as_ref(), Some(&leads));
        search.bar(leads.clone());
        let anew = search.round(&model, 20);
        assert!(!ids(&anew).contains(&leads) && anew.leads.as_ref() != Some(&leads));
        // More surrogates than are known of.
        assert!(!Arc::ptr_eq(&anew, &search.round(&model, 40)));
    }
}
