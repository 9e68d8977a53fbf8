//! Names that the rest of a model takes back.
//!
//! Two regressors that are nearly the same, in opposite directions, make a third one of what little they differ
//! in: the noise of a column, say, which may well go with the output's noise. Both are then beyond chance, each
//! beside the other, and neither is in the record.

use super::{Model, Search};
use crate::statistics::Unusable;
use crate::statistics::linear::{Basis, add_scaled, dot};
use crate::statistics::whiten::Whitener;

/// Share of a name's sum of squares that has to be left when shapes without a name are added to it.
const STRANGERS: f64 = 0.5;

/// The same when all other terms are added. Two causes in one record may be opposed.
const ALL: f64 = 0.1;

impl Search<'_> {
    /// The model without names of which the other terms leave next to nothing; these are barred. Of two that take each other
    /// back the one goes that the other does better without.
    ///
    /// # Errors
    /// Too few rows.
    pub fn without_undone(&self, mut model: Model) -> Result<Model, Unusable> {
        loop {
            let mut best: Option<(Model, String)> = None;
            for k in self.undone(&model) {
                let mut terms = model.terms.clone();
                let own = terms.remove(k).id();
                let without = self.model(&terms)?;
                if best
                    .as_ref()
                    .is_none_or(|b| self.net(&without) > self.net(&b.0))
                {
                    best = Some((without, own));
                }
            }
            let Some((without, own)) = best else {
                return Ok(model);
            };
            self.bar(own);
            model = without;
        }
    }

    /// The names that are taken back.
    fn undone(&self, model: &Model) -> Vec<usize> {
        if model.terms.len() < 2 {
            return Vec::new();
        }
        let parts = self.contributions(model);
        let named: Vec<bool> = model.terms.iter().map(|t| t.candidate.named()).collect();
        let is_one = |k: &usize| {
            let others = |only_strangers: bool| -> Vec<&Vec<f64>> {
                let each = parts.iter().zip(&named).enumerate();
                each.filter(|(j, (_, named))| j != k && !(only_strangers && **named))
                    .map(|(_, (part, _))| part)
                    .collect()
            };
            named[*k]
                && !model.terms[*k].evident
                && (is_undone(&parts[*k], &others(true), STRANGERS)
                    || is_undone(&parts[*k], &others(false), ALL))
        };
        (0..parts.len()).filter(is_one).collect()
    }

    /// What each term contributes, whitened, without what the declared model could take up; rows of the fit.
    pub(super) fn contributions(&self, model: &Model) -> Vec<Vec<f64>> {
        let c = self.channels;
        let fit = &model.fit;
        let whitener = Whitener::new(&fit.problem.line, fit.at.shape);
        let declared = super::declared(c);
        let reduced: Vec<Vec<f64>> = declared.iter().map(|d| fit.reduce(d)).collect();
        let basis = Basis::new(&whitener.apply_all(&reduced));
        let part = |sum: Vec<f64>| {
            let mut white = whitener.apply(&fit.reduce(&sum));
            basis.project_off(&mut white);
            white
        };
        model.contributions(c).into_iter().map(part).collect()
    }
}

/// Whether others leave less than a share of a part's sum of squares.
fn is_undone(part: &[f64], others: &[&Vec<f64>], share: f64) -> bool {
    let mut sum = part.to_vec();
    for other in others {
        add_scaled(&mut sum, 1.0, other);
    }
    !others.is_empty() && dot(&sum, &sum) < share * dot(part, part)
}

#[cfg(test)]
mod tests {
    use super::super::Term;
    use super::*;
    use crate::statistics::random::Stream;

    /// A supply and a column that is the supply with a little of its own; the output has `own` of that and `supply` of
    /// the supply. Which of the two names the model with both takes back.
    fn taken_back(own: f64, supply_dps: f64) -> Option<String> {
        use crate::thermal::channels::Channels;
        use crate::thermal::effects::Candidate;
        use crate::thermal::search::Effort;
        use crate::thermal::synthetic::triangle;
        use std::collections::BTreeMap;
        let [noise, little] = [0, 1].map(|k| Stream::new(11, k).normals(300));
        let degc = [triangle(150), triangle(150)].concat();
        let supply: Vec<f64> = (0..300)
            .map(|k| f64::from(u8::from(k / 11 % 3 == 1)))
            .collect();
        let rate = |i: usize| {
            let bias = 5.0 + 0.1 * degc[i];
            bias + own * little[i] + supply_dps * supply[i] + 0.01 * noise[i]
        };
        let columns = BTreeMap::from([
            ("rate_out_dps".to_owned(), (0..300).map(rate).collect()),
            ("die_degc".to_owned(), degc.clone()),
            (
                "accel_g".to_owned(),
                (0..300).map(|i| supply[i] + 0.02 * little[i]).collect(),
            ),
            // A level of its own is nothing that the other term could take back.
            (
                "supply_v".to_owned(),
                supply.iter().map(|v| v + 5.0).collect(),
            ),
        ]);
        let time_s: Vec<f64> = (0..300).map(|k| 10.0 * f64::from(k)).collect();
        let c = Channels::new(&time_s, &columns, "die_degc", |t| t).unwrap();
        let split = c.split().unwrap();
        let search = Search::new(&c, &split, Effort::default(), Vec::new());
        let term = |id: &str| {
            let is_it = |c: &&std::sync::Arc<dyn Candidate>| c.id() == id;
            let candidate = search.candidates().iter().find(is_it).unwrap().clone();
            let point = candidate.points(&c).remove(0);
            Term::new(candidate, point)
        };
        let terms = [term("supply_sensitivity"), term("g_sensitivity")];
        let model = search.model(&terms).unwrap();
        let left = search.without_undone(model).unwrap();
        // It never comes back.
        let barred = search.beginning.borrow().barred.clone();
        assert_eq!(left.terms.len(), 2 - barred.len());
        barred.first().cloned()
    }

    #[test]
    fn two_names_that_cancel_are_not_both_kept() {
        let of = |own: f64, supply_dps: f64| taken_back(own, supply_dps).unwrap_or_default();
        // What the columns differ in, 2 per cent of each: fifty times that of both.
        assert_eq!(of(0.02, 0.0), "supply_sensitivity");
        // The supply alone beside nothing of the other.
        assert_eq!(of(0.0, 0.3), "");
        // Both, much of each.
        assert_eq!(of(0.02, 3.0), "");
        // Opposed: -0.75 and 1 leave 0.06 of the second's sum of squares, -0.6 and 1 leave 0.16.
        assert_eq!(of(0.02, 0.25), "g_sensitivity");
        assert_eq!(of(0.02, 0.4), "");
    }

    #[test]
    fn what_is_taken_back_is_undone_and_what_stands_beside_is_not() {
        let part = Stream::new(3, 0).normals(500);
        let beside = Stream::new(3, 1).normals(500);
        let back = |share: f64| -> Vec<f64> {
            let pairs = part.iter().zip(&beside);
            pairs.map(|(p, b)| -share * p + 0.1 * b).collect()
        };
        assert!(!is_undone(&part, &[], 0.5));
        assert!(!is_undone(&part, &[&beside], 0.5));
        assert!(!is_undone(&part, &[&back(-1.0)], 0.5));
        assert!(!is_undone(&part, &[&back(0.2)], 0.5));
        assert!(is_undone(&part, &[&back(0.9)], 0.5));
        assert!(is_undone(&part, &[&back(0.5), &back(0.5)], 0.1));
        assert!(!is_undone(&part, &[&back(0.5)], 0.1));
    }
}
