//! What is reported has to stand by itself: shapes without a name, beside which names were found, are not in it.

use super::validate::UNSTEADY;
use super::{Found, LEVEL, MOST_RIVALS, Model, Search, Term};
use crate::statistics::Unusable;

/// Most that the steps may leave of the held-out error without them; the same where more is left than they
/// explain: what stands beside something larger and unknown may be a part of that. And where a clip is seen without a fit:
/// held-out rows that it does not hold say nothing of it, but the declared bias beside it is another one.
const ABOVE: f64 = 1.015;
const BESIDE: f64 = 0.87;
const EVIDENT: f64 = 1.0195;

/// Slow noise, rms in units of the white, from which on a name needs more than the usual probability, and the powers of
/// ten that each further unit asks for: what was not recorded wanders as slow noise does, but probabilities are reckoned
/// with noise that is Gaussian and everywhere the same.
pub(super) const WANDER: f64 = 1.0;
const DECADES: f64 = 4.0;

/// A probability that is enough beside anything, and a held-out error without the name that is, times the one with it.
const SURELY: f64 = 1e-20;
const THREEFOLD: f64 = 3.0;

/// What a name needs where more is left than the names explain. A probability: that record's noise is not the one that
/// it is reckoned with; or, in its place, a held-out error without the name, times the one with it: slow noise that takes a name's
/// course by chance does not keep to it that closely. A selection frequency (Meinshausen & Buhlmann 2010: 0.6 to 0.9). A share of
/// its square that gains of its own in parts of the record add at most.
pub(super) const BEYOND: f64 = 1e-5;
const TENFOLD: f64 = 10.0;
const STABLE: f64 = 0.6;
const SHARE: f64 = 0.2;

/// Most that a sinusoid may leave of the held-out error without it where more is left.
const RULES: f64 = 0.6;

impl Search<'_> {
    /// Drops names that do not stand without the shapes that are not reported.
    ///
    /// # Errors
    /// Too few rows.
    pub(super) fn kept_alone(&self, found: &mut Found) -> Result<(), Unusable> {
        self.kept_decided(found);
        self.kept_above_rounding(found)?;
        self.kept_from_noise(found)?;
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

    /// Drops names that slow noise as strong as what all of them leave may have made.
    fn kept_from_noise(&self, found: &mut Found) -> Result<(), Unusable> {
        let model = self.model(&found.terms)?;
        // Of few rows nobody can say how little of the noise is white: no less than what they differ by from one to the next.
        let slow = self.wander(&model).min(self.roughly(&model));
        let asked = LEVEL * 10f64.powf(-DECADES * (slow - WANDER).max(0.0));
        for k in (0..found.terms.len()).rev() {
            if found.terms[k].p_value <= asked.max(SURELY) || found.terms[k].evident {
                continue;
            }
            if self.lessens(&model, k)? <= THREEFOLD {
                self.drop(found, k);
            }
        }
        Ok(())
    }

    /// The held-out error without one of a model's terms, times the one with it.
    fn lessens(&self, model: &Model, own: usize) -> Result<f64, Unusable> {
        let mut others = model.terms.clone();
        others.remove(own);
        let [without, with] = self.heldout_squares([&self.model(&others)?, model]);
        Ok((without / with.max(f64::MIN_POSITIVE)).sqrt())
    }

    /// Drops names until the held-out error is not above that of the declared model, or clearly below it where
    /// more is left.
    fn kept_below(&self, found: &mut Found) -> Result<(), Unusable> {
        let before = self.model(&[])?;
        while !found.terms.is_empty() {
            let evident = found.terms.iter().any(|t| t.evident);
            let sure = found.terms.iter().any(|t| t.p_value <= SURELY);
            let model = self.model(&found.terms)?;
            let most = if evident { EVIDENT } else { ABOVE };
            let [of_before, of_after] = self.heldout_squares([&before, &model]);
            let above = of_after > most.powi(2) * of_before;
            let beside = found.left.is_some() && !sure && !evident && !outweigh(found);
            let little = beside && of_after > BESIDE.powi(2) * of_before;
            if !above && !little {
                break;
            }
            let mut least: Option<(usize, f64)> = None;
            for k in 0..found.terms.len() {
                let mut others = found.terms.clone();
                others.remove(k);
                let [_, square] = self.heldout_squares([&before, &self.model(&others)?]);
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
    pub(super) fn kept_stable(&self, found: &mut Found) -> Result<(), Unusable> {
        if found.left.is_none() {
            return Ok(());
        }
        let model = self.model(&found.terms)?;
        let mut stable = Vec::new();
        for (k, term) in found.terms.iter().enumerate() {
            let steady = self.constancy(&model, term);
            let steady = steady.is_none_or(|c| c.p_value > UNSTEADY || c.share < SHARE);
            let often = || self.selected_beside(&model, k, &term.rivals);
            let far = term.p_value <= BEYOND || self.lessens(&model, k)? > TENFOLD;
            let stands = far && steady && self.rules(&model, k)?;
            stable.push(term.evident || stands && often()? >= STABLE);
        }
        let mut stable = stable.into_iter();
        found.terms.retain(|_| stable.next() == Some(true));
        Ok(())
    }

    /// Whether a sinusoid is most of what there is without it: beside something that is not known it is a part of that,
    /// for whatever comes and goes has one that fits it best. Any other name needs not be.
    fn rules(&self, model: &Model, own: usize) -> Result<bool, Unusable> {
        if model.terms[own].id() != "periodic_pickup" {
            return Ok(true);
        }
        Ok(self.lessens(model, own)? >= 1.0 / RULES)
    }

    /// Takes a name back.
    pub(super) fn drop(&self, found: &mut Found, k: usize) -> Term {
        let term = found.terms.remove(k);
        found.left = found.left.take().or_else(|| self.channel(&term));
        term
    }
}

/// Whether each of the names explains more than all that is known of what is left.
fn outweigh(found: &Found) -> bool {
    let strange: f64 = found.strangers.iter().map(|t| t.gain).sum();
    strange > 0.0 && found.terms.iter().all(|t| t.gain > strange)
}

#[cfg(test)]
#[path = "reported_tests.rs"]
mod tests;
