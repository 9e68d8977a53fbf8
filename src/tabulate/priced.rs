//! What a form costs on a target.

use crate::approx::form::{Form, Settled};
use crate::cost::function::FunctionCost;
use crate::design::target::Target;
use crate::numeric::format::Format;

/// Of a form with its program.
pub fn cost(settled: &Settled, target: Target) -> FunctionCost {
    FunctionCost::of_program(&settled.program, &constants(&settled.form), target)
}

/// The formats of a form's coefficients that are no table.
pub fn constants(form: &Form) -> Vec<Format> {
    match form {
        Form::Polynomial(p) => {
            let degree = p.coefficients.len().saturating_sub(1);
            p.formats.coefficients.each(p.monomials, degree)
        }
        _ => Vec::new(),
    }
}
