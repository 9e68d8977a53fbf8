//! Forms that can stand for a compensation's polynomial within a bound, with what each costs as firmware.

use super::Evaluation;
use super::certainty::Bounds;
use crate::approx::form::Codes;
use crate::approx::form::polynomial::Scheme;
use crate::approx::form::stored::{Stored, WIDEST_BITS};
use crate::approx::reference::Function;
use crate::cost::function::FunctionCost;
use crate::design::target::Target;
use crate::design::{Compensation, Design};
use crate::error::Result;
use crate::numeric::format::Format;
use crate::tabulate::choice;
use crate::tabulate::choice::{Candidate, Wanted};
use crate::tabulate::job::{Asked, Request, Weight};
use crate::tabulate::outcome::Alternative;
use crate::tabulate::priced;
use std::collections::BTreeMap;

/// A way to evaluate the bias.
#[derive(Debug, Clone)]
pub struct Way {
    /// For the list; not yet judged among the others.
    pub listed: Alternative,
    /// The form's data; `None` = the polynomial in the design's formats.
    pub form: Option<Stored>,
}

/// The polynomial of the fit as a function of the variable over the calibrated range.
///
/// # Errors
/// A polynomial that cannot be enclosed.
pub fn function(evaluation: &Evaluation) -> Result<Function> {
    let (low, high) = evaluation.calibrated();
    let ends = (evaluation.variable(low), evaluation.variable(high));
    Function::of_polynomial(&evaluation.wanted(), ends)
}

/// The compensation's own evaluation as a line of the list.
pub fn horner(design: &Design, c: &Compensation, bounds: &Bounds, target: Target) -> Way {
    let own = Compensation {
        form: None,
        ..c.clone()
    };
    let formats = vec![c.coefficient_format; c.coefficients_raw.len()];
    Way {
        listed: Alternative {
            form: "polynomial",
            detail: format!(
                "polynomial of degree {} by Horner's rule, coefficients {}, accumulator {}",
                c.coefficients_raw.len().saturating_sub(1),
                c.coefficient_format,
                c.accumulator.format
            ),
            cost: whole_cost(design, &own, &formats, target),
            certified_max_abs: bounds.certified_max_dps,
            undominated: false,
            chosen: false,
        },
        form: None,
    }
}

/// One form of each kind whose certified error is at most `room_dps`: the smallest of its kind, as `gyrogen approx
/// --bound` finds them. None where the calibrated range has more words than forms can take.
///
/// # Errors
/// A polynomial that cannot be enclosed.
pub fn forms(design: &Design, c: &Compensation, room_dps: f64, target: Target) -> Result<Vec<Way>> {
    let codes = c.codes(&design.circuit);
    if (codes.high - codes.low) >> WIDEST_BITS != 0 || codes.format.bits() > 63 {
        return Ok(Vec::new());
    }
    let function = function(&Evaluation::new(&design.circuit, c))?;
    let wanted = Wanted {
        polynomial: true,
        table: true,
        piecewise: true,
    };
    let request = request(codes, c.output.format, room_dps, target);
    let found = choice::candidates(&function, codes, &request, room_dps, wanted)?;
    let way = |candidate: Candidate| {
        let stored = Stored::of(&candidate.settled.form);
        let with = Compensation {
            form: Some(stored.clone()),
            ..c.clone()
        };
        let constants = priced::constants(&candidate.settled.form);
        let mut listed = candidate.listed();
        listed.cost = whole_cost(design, &with, &constants, target);
        Way {
            listed,
            form: Some(stored),
        }
    };
    Ok(found.into_iter().map(way).collect())
}

/// Of the whole emitted bias function: limit, offset and evaluation.
fn whole_cost(
    design: &Design,
    c: &Compensation,
    constants: &[Format],
    target: Target,
) -> FunctionCost {
    let program = Evaluation::new(&design.circuit, c).program();
    FunctionCost::of_program(&program, constants, target)
}

fn request(codes: Codes, output: Format, bound: f64, target: Target) -> Request {
    let value = |code| codes.real(code).to_string();
    Request {
        function: "the fitted polynomial".to_owned(),
        parameters: BTreeMap::new(),
        domain: [value(codes.low), value(codes.high)],
        degree: None,
        monomials: None,
        input: codes.format,
        output,
        coefficients: Vec::new(),
        evaluation: Scheme::Horner,
        intermediate: None,
        form: Asked::Auto,
        bound: Some(bound),
        weight: Weight::Absolute,
        exhaustive: false,
        target,
        name: "bias".to_owned(),
    }
}
