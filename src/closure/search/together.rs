//! Two names that explain together what neither explains alone.
//!
//! Beside a slow cause that is not in yet, every other slow cause looks like a part of a walk of the rate, and beside a walk
//! none is beyond chance: with both in, the noise is seen to be fast, and each is beyond chance beside the other.

use super::judge::{Judged, PRICE, price};
use super::{LEVEL, Model, Search, Term, declared};
use crate::closure::likelihood::Unusable;
use crate::closure::likelihood::linear::{Basis, dot};

/// Log-likelihood, less the price, by which two names have to be better than slow noise in their place: the best of
/// some two hundred pairs (Wilks 1938: four coefficients and a time constant rarely gain ten).
const WORTH: f64 = 15.0;

/// Pairs of which the noise is sought.
const TRIED: usize = 3;

/// A candidate beside a model: its columns over the fitted rows without what the model's span has of them.
struct Beside<'a> {
    judged: &'a Judged,
    columns: Vec<Vec<f64>>,
    paid: f64,
}

impl Search<'_> {
    /// The terms of a model and two names more, if these are worth more than the slow noise that the model has in their
    /// place, and each is beyond chance beside the other.
    ///
    /// # Errors
    /// Too few rows.
    pub(super) fn together(&self, model: &Model) -> Result<Option<Vec<Term>>, Unusable> {
        let mut best: Option<(Model, f64)> = None;
        for pair in self.pairs(model) {
            let mut terms = model.terms.clone();
            terms.extend(pair.map(|j| Term::of(&j, Vec::new())));
            let with = self.tried(&terms, model.terms.len())?;
            let net = self.net(&with);
            if best.as_ref().is_none_or(|b| net > b.1) {
                best = Some((with, net));
            }
        }
        let due = self.net(model) + WORTH;
        let Some((with, _)) = best.filter(|(_, net)| *net > due) else {
            return Ok(None);
        };
        let mut terms = with.terms.clone();
        for k in model.terms.len()..terms.len() {
            let mut others = with.terms.clone();
            let own = others.remove(k);
            let round = self.round(&self.model(&others)?, self.effort.surrogates);
            let mut judged = round.judged.iter();
            let again = judged.find(|j| j.candidate.id() == own.id() && j.p_value <= LEVEL);
            let Some(again) = again else { return Ok(None) };
            terms[k] = Term {
                point: own.point,
                beside: others.iter().map(Term::id).collect(),
                ..Term::of(again, round.rivals(again))
            };
        }
        Ok(Some(terms))
    }

    /// The pairs of names that leave least of the fitted rows, best first.
    fn pairs(&self, model: &Model) -> Vec<[Judged; 2]> {
        let round = self.round(model, 0);
        let rest = self.weighed(model, &model.residual(self.channels));
        let spanned = declared(self.channels);
        let spanned = spanned.iter().chain(&model.columns);
        let spanned: Vec<Vec<f64>> = spanned.map(|c| self.weighed(model, c)).collect();
        let span = Basis::new(&spanned);
        let mut left = rest.clone();
        span.project_off(&mut left);
        let each: Vec<Beside<'_>> = round
            .judged
            .iter()
            .filter(|j| is_slow(j))
            .map(|judged| self.beside(model, &span, judged))
            .collect();
        let rows = self.used.iter().filter(|u| **u).count() as f64;
        let mut pairs = Vec::new();
        for (k, one) in each.iter().enumerate() {
            for other in &each[..k] {
                let columns = [one.columns.as_slice(), other.columns.as_slice()].concat();
                let mut unexplained = left.clone();
                Basis::new(&columns).project_off(&mut unexplained);
                let square = dot(&unexplained, &unexplained).max(f64::MIN_POSITIVE);
                let net = -0.5 * rows * square.ln() - one.paid - other.paid;
                pairs.push((net, [one.judged, other.judged]));
            }
        }
        pairs.sort_by(|a, b| b.0.total_cmp(&a.0));
        let best = pairs.into_iter().take(TRIED);
        best.map(|(_, pair)| pair.map(Judged::clone)).collect()
    }

    fn beside<'a>(&self, model: &Model, span: &Basis, judged: &'a Judged) -> Beside<'a> {
        let c = self.channels;
        let candidate = judged.candidate.as_ref();
        let mut columns = Vec::new();
        for column in candidate.columns(c, &model.bias, &judged.point) {
            let mut column = self.weighed(model, &column);
            span.project_off(&mut column);
            columns.push(column);
        }
        let paid = PRICE * columns.len() as f64 + price(candidate, c, &judged.point);
        Beside {
            judged,
            columns,
            paid,
        }
    }

    /// A column over the rows of the fit, those that stand out at their weight.
    fn weighed(&self, model: &Model, column: &[f64]) -> Vec<f64> {
        let rows = column.iter().zip(&model.fit.row_weights).zip(&self.used);
        let weighed = rows.map(|((v, w), used)| if *used && *w > 0.0 { v * w.sqrt() } else { 0.0 });
        weighed.collect()
    }
}

/// A name with coefficients of its own over the whole record, as slow as noise may be.
fn is_slow(judged: &Judged) -> bool {
    let candidate = judged.candidate.as_ref();
    let fast = candidate.id() == "periodic_pickup";
    let threshold = candidate.is_local() || candidate.is_whole();
    candidate.named() && !fast && !threshold && !candidate.is_sized(&judged.point)
}
