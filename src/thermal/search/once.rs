//! Names that a record cannot tell from what the catalogue does not have.
//!
//! A step that a record shows once is at a temperature and at a moment: that it is a law of the temperature is
//! likelier, but nothing in the record says so, and anything may happen once.

use super::{Found, Search, Term};
use crate::statistics::Unusable;

impl Search<'_> {
    /// The names of steps that may as well be changes at one moment.
    ///
    /// # Errors
    /// Too few rows.
    pub(super) fn once(&self, found: &Found) -> Result<Vec<String>, Unusable> {
        let model = self.model(&found.terms)?;
        let steps = found.terms.iter().filter(|t| t.id() == "stress_jump");
        let once = steps.filter(|t| self.switches(t, &model) < 2);
        Ok(once.map(Term::id).collect())
    }
}

#[cfg(test)]
#[path = "once_tests.rs"]
mod tests;
