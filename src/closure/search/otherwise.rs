//! Another beginning where the first one ends with something left.
//!
//! Steps are taken one by one. Beside causes that are not in yet, a narrow resonance may look like the step that is there
//! (both are sudden at one temperature, and slow noise hides the rest), and a curve without a name follows a little of
//! all causes; what comes after mends the wrong model. Without such a shape the steps may lead to names that
//! explain more: then it was not called for.

use super::judge::{PRICE, price};
use super::{Found, LEVEL, Model, Search, Term};
use crate::closure::likelihood::Unusable;

/// Most other beginnings.
const BEGINNINGS: usize = 3;

impl Search<'_> {
    /// Runs the search.
    ///
    /// # Errors
    /// Too few rows to fit anything.
    pub fn run(&self) -> Result<Found, Unusable> {
        let (first, reached) = self.run_once(false)?;
        if first.left.is_none() || !first.undecided.is_empty() {
            return Ok(first);
        }
        let due = self.net(&reached);
        let barred = self.begin_without(Vec::new());
        for without in beginnings(&reached.terms) {
            self.begin_without(without);
            let (other, _) = self.run_once(true)?;
            let own = self.begin_without(Vec::new());
            if let Some(found) = self.better(other, due)? {
                self.begin_without(own);
                return Ok(Found {
                    first: first.first,
                    missing: first.missing,
                    ..found
                });
            }
        }
        self.begin_without(barred);
        Ok(first)
    }

    /// What is judged next does without these; what was barred until now. The report's rounds do without what the
    /// accepted run did without: else a name that was taken without it competes with it again.
    fn begin_without(&self, ids: Vec<String>) -> Vec<String> {
        self.rounds.clear();
        self.barred.replace(ids)
    }

    /// A run's names, if they explained everything to it and are worth more than `due`, the model that the first run came
    /// to with all its shapes. What that run did without may have something to say beside them: then that is left.
    fn better(&self, mut found: Found, due: f64) -> Result<Option<Found>, Unusable> {
        if found.left.is_some() || found.terms.is_empty() || !found.undecided.is_empty() {
            return Ok(None);
        }
        let model = self.model(&found.terms)?;
        if self.net(&model) <= due {
            return Ok(None);
        }
        let round = self.round(&model, self.effort.surrogates);
        if let Some(more) = round.judged.iter().find(|j| j.p_value <= LEVEL) {
            found.left = self.channel(&Term::of(more, Vec::new()));
            self.kept_alone(&mut found)?;
        }
        Ok((!found.terms.is_empty()).then_some(found))
    }

    /// Log-likelihood less the price of the terms.
    fn net(&self, model: &Model) -> f64 {
        let c = self.channels;
        let terms = model.terms.iter();
        let paid = terms.map(|t| price(t.candidate.as_ref(), c, &t.point));
        model.value - paid.sum::<f64>() - PRICE * model.beta.len() as f64
    }
}

/// What to do without, one at a time: the shapes of a model without a name, and those at one temperature.
fn beginnings(terms: &[Term]) -> Vec<Vec<String>> {
    let doubted = |t: &&Term| !t.candidate.named() || t.candidate.is_local();
    let each = terms.iter().filter(doubted).map(|t| vec![t.id()]);
    each.take(BEGINNINGS).collect()
}
