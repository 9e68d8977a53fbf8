//! A scale factor that is off by the same everywhere: it is in the columns of one that goes with temperature and of one that
//! bends with the rate, and is neither.

use super::{Found, Search, Term};
use crate::statistics::Unusable;
use crate::thermal::effects::{Candidate, Point, outside};
use std::sync::Arc;

/// Net log-likelihood that a name has to bring beside the shape without a name that it has in it.
const OWN: f64 = 5.0;

impl Search<'_> {
    /// A constant error of the scale factor, parts per million with its standard deviation, where a name is no more than that,
    /// or where it is what has no name.
    ///
    /// # Errors
    /// Too few rows.
    pub(super) fn bare_scale(&self, found: &Found) -> Result<Option<(f64, f64)>, Unusable> {
        let is_scale = |c: &&Arc<dyn Candidate>| c.id() == outside::SCALE;
        let Some(scale) = self.candidates.iter().find(is_scale) else {
            return Ok(None);
        };
        let bare = Term::new(scale.clone(), Point::form(0));
        let mut terms = found.terms.clone();
        let contains = |t: &Term| t.candidate.contains(&t.point) == Some(outside::SCALE);
        match terms.iter().position(contains) {
            Some(own) => terms[own] = bare,
            None if found.strangers.iter().any(|t| is_scale(&&t.candidate)) => terms.push(bare),
            None => return Ok(None),
        }
        let without = self.model(&terms)?;
        let model = self.model(&found.terms)?;
        if self.net(&model) > self.net(&without) + OWN {
            return Ok(None);
        }
        let estimates = without.terms.iter().zip(self.estimates(&without));
        let reported = estimates.filter(|(t, _)| is_scale(&&t.candidate));
        let mut reported = reported.map(|(t, e)| t.candidate.report(self.channels, &e));
        Ok(reported.find_map(|mut r| r.remove("linear_ppm")))
    }
}

#[cfg(test)]
#[path = "bare_scale_tests.rs"]
mod tests;
