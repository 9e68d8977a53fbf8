//! The best coefficients under ideal evaluation, beside those that are emitted.
//!
//! Where rounding is a large part of the error the emitted coefficients are those whose whole evaluation is best, and
//! others may be better by themselves. Nobody is to take the emitted ones' own error for the least that the formats allow.

use super::coefficients::BEST_NAME;
use super::outcome::{Search, Word};
use crate::approx::form::Form;
use crate::approx::form::measure;
use crate::approx::form::measure::Reference;
use crate::approx::form::polynomial::Polynomial;
use serde::Serialize;

/// Coefficients with the least error under ideal evaluation, in the formats of the emitted ones.
#[derive(Debug, Clone, PartialEq, Serialize, schemars::JsonSchema)]
pub struct Ideal {
    /// From order 0 to the degree; zeros where the monomials have none.
    pub coefficients: Vec<Word>,
    /// sup |f - p| over the real domain, proved; the emitted ones' is `error.coefficients_only_max_abs`.
    pub coefficients_only_max_abs: f64,
    /// Error of the whole evaluation with them, over the codes of the search; null if the datapath cannot take them.
    pub total_max_abs: Option<f64>,
    /// No coefficients in these formats have a smaller error under ideal evaluation.
    pub proved_best: bool,
    /// They are the emitted ones.
    pub emitted: bool,
}

/// The ideal coefficients of a search whose result was emitted as `polynomial`; `None` if they are not known.
/// `emitted_only` is the proved error of the emitted coefficients alone.
pub(super) fn ideal(
    search: &Search,
    polynomial: &Polynomial,
    emitted_only: f64,
    reference: &dyn Reference,
) -> Option<Ideal> {
    let best = search.compared.iter().find(|c| c.name == BEST_NAME)?;
    let degree = polynomial.coefficients.len().checked_sub(1)?;
    let orders = polynomial.monomials.exponents(degree);
    let mut raw = vec![0; degree + 1];
    for (order, value) in orders.iter().zip(&best.raw) {
        *raw.get_mut(*order)? = *value;
    }
    let emitted = raw == polynomial.coefficients;
    let coefficients = raw.iter().enumerate().map(|(order, raw)| Word {
        raw: *raw,
        value: *raw as f64 * polynomial.formats.coefficients.of(order).lsb(),
    });
    let coefficients = coefficients.collect();
    let alone = match emitted {
        true => emitted_only,
        false => {
            let form = Polynomial::new(polynomial.formats, polynomial.monomials, raw).ok()?;
            measure::data_only(&Form::Polynomial(Box::new(form)), reference)
        }
    };
    Some(Ideal {
        coefficients,
        coefficients_only_max_abs: alone,
        total_max_abs: best.total_max_abs,
        proved_best: best.proved,
        emitted,
    })
}
