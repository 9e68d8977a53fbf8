//! What is reported has to stand by itself: shapes without a name, beside which names were found, are not in it.

use super::validate::UNSTEADY;
use super::{Found, MOST_RIVALS, Search, Term};
use crate::closure::likelihood::Unusable;

/// How far the held-out error with the steps may lie above the one without.
const ABOVE: f64 = 1.015;

/// What a name needs where more is left than the names explain. A probability: that record's noise is not the one that
/// it is reckoned with. A selection frequency (Meinshausen & Buhlmann 2010: 0.6 to 0.9). A share of its square
/// that gains of its own in parts of the record add at most.
pub(super) const BEYOND: f64 = 1e-5;
const STABLE: f64 = 0.6;
const SHARE: f64 = 0.2;

impl Search<'_> {
    /// Drops names that do not stand without the shapes that are not reported.
    ///
    /// # Errors
    /// Too few rows.
    pub(super) fn kept_alone(&self, found: &mut Found) -> Result<(), Unusable> {
        self.kept_decided(found);
        self.kept_above_rounding(found)?;
        loop {
            self.kept_stable(found)?;
            let stable = found.terms.len();
            self.kept_below(found)?;
            if found.terms.len() == stable {
                return Ok(());
            }
        }
    }

    /// Names with too many rivals become undecided.
    fn kept_decided(&self, found: &mut Found) {
        let (kept, many): (Vec<Term>, Vec<Term>) = std::mem::take(&mut found.terms)
            .into_iter()
            .partition(|t| t.rivals.len() <= MOST_RIVALS);
        found.terms = kept;
        for term in many {
            found.left = found.left.take().or_else(|| self.channel(&term));
            found.undecided.push(term.id());
            found.undecided.extend(term.rivals);
        }
    }

    /// Drops names until the held-out error is not above that of the declared model.
    fn kept_below(&self, found: &mut Found) -> Result<(), Unusable> {
        let before = self.model(&[])?;
        let square = |terms: &[Term]| -> Result<f64, Unusable> {
            let model = self.model(terms)?;
            Ok(self.heldout_error(&model, &before).square)
        };
        let limit = self.heldout_error(&before, &before).square * ABOVE.powi(2);
        while !found.terms.is_empty() && square(&found.terms)? > limit {
            let mut least: Option<(usize, f64)> = None;
            for k in 0..found.terms.len() {
                let mut others = found.terms.clone();
                others.remove(k);
                let square = square(&others)?;
                if least.is_none_or(|l| square < l.1) {
                    least = Some((k, square));
                }
            }
            let Some((k, _)) = least else { break };
            self.drop(found, k);
        }
        Ok(())
    }

    /// Where something is left, drops the names that are not far beyond chance, not as stable as a local shape has to
    /// be or not of one gain: a cause that was not recorded looks a little like many things, each in a part of
    /// the record. What is as good and listed does not count against a name.
    fn kept_stable(&self, found: &mut Found) -> Result<(), Unusable> {
        if found.left.is_none() {
            return Ok(());
        }
        let model = self.model(&found.terms)?;
        let mut stable = Vec::new();
        for (k, term) in found.terms.iter().enumerate() {
            let steady = self.constancy(&model, term);
            let steady = steady.is_none_or(|c| c.p_value > UNSTEADY || c.share < SHARE);
            let often = || self.selected_beside(&model, k, &term.rivals);
            stable.push(term.p_value <= BEYOND && steady && often()? >= STABLE);
        }
        let mut stable = stable.into_iter();
        found.terms.retain(|_| stable.next() == Some(true));
        Ok(())
    }

    /// Takes a name back.
    pub(super) fn drop(&self, found: &mut Found, k: usize) -> Term {
        let term = found.terms.remove(k);
        found.left = found.left.take().or_else(|| self.channel(&term));
        term
    }
}

#[cfg(test)]
#[path = "reported_tests.rs"]
mod tests;
