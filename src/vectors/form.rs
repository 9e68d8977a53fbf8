//! The model of an approximation's form, and copies of it that vectors have to tell from it.

use super::interpreter::Interpreter;
use super::model::Model;
use crate::approx::form::polynomial::Polynomial;
use crate::approx::form::{Form, Settled};
use crate::error::{Error, Result};

/// The bit-accurate model of a form, with copies in which a rounding constant or a coefficient is off by one.
///
/// # Errors
/// A program without the function: an error of this program.
pub fn model(settled: &Settled) -> Result<Model> {
    let function = settled.program.function("evaluate");
    let function = function.ok_or_else(|| Error::Check("internal: nothing was traced".into()))?;
    let narrow = settled.bits <= 64;
    let model = Model::new::<1, 1, Form>(function, settled.form.clone(), narrow);
    let model = model.with_recorded(&Interpreter::new(&settled.program));
    Ok(model.with_damage::<1, 1, Form>(damaged(&settled.form), narrow))
}

/// Copies in which a rounding constant or a coefficient is off by one; tables are compared entry by entry.
pub(crate) fn damaged(form: &Form) -> Vec<Form> {
    let mut all = form.with_nudged_casts();
    if let Form::Polynomial(p) = form {
        for order in p.monomials.exponents(p.coefficients.len() - 1) {
            for step in [-1, 1] {
                let mut raw = p.coefficients.clone();
                raw[order] += step;
                let moved = Polynomial::new(p.formats, p.monomials, raw);
                all.extend(moved.ok().map(|p| Form::Polynomial(Box::new(p))));
            }
        }
    }
    all
}
