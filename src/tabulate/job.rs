//! The job of `gyrogen approx`: from a request to a form, its proved error and its bundles.

use super::check;
use super::choice::{self, Candidate};
use super::coefficients::{self, Chosen};
use super::describe;
use super::ideal;
use super::outcome::{ErrorBounds, Outcome};
use super::priced;
use super::refused;
pub use super::request::{Asked, EXHAUSTIVE_CODES, MOST_CODES, Request, Weight};
use crate::approx::form::coefficient_formats::CoefficientFormats;
use crate::approx::form::measure::{Effort, Measured, SAMPLE, measure};
use crate::approx::form::polynomial::Monomials;
use crate::approx::form::{Codes, Form, Settled, overflow};
use crate::approx::reference::Function;
use crate::digest::sha256;
use crate::error::Result;
use crate::numeric::format::Format;

/// The result: what is reported, and what is emitted.
#[derive(Debug, Clone)]
pub struct Approximation {
    /// For `approx.json`.
    pub outcome: Outcome,
    /// The form with its program.
    pub settled: Settled,
    /// What it stands for.
    pub function: Function,
}

/// Does what the request asks. `progress` is told the number of codes to run, then of codes that were run.
///
/// # Errors
/// Anything in the request that cannot be used.
pub fn approximate(
    request: &Request,
    command: &str,
    threads: usize,
    progress: &(dyn Fn(u128, u64) + Sync),
) -> Result<Approximation> {
    // The function and its domain first: what is wrong there is what the user looks at.
    let function = check::function(request)?;
    check::request(request)?;
    let codes = check::codes(request, &function)?;
    check::output(request, &function)?;
    check::polynomial(request, &function, codes)?;
    let (form, mut search, candidates) = choose(request, &function, codes)?;
    let most_codes = if request.exhaustive {
        MOST_CODES
    } else {
        EXHAUSTIVE_CODES
    };
    let mut settled = form.settle()?;
    overflow::refuse(&settled, most_codes)?;
    let total = codes.count();
    let effort = Effort {
        most_codes,
        sample: SAMPLE,
        threads,
        progress: &|count| progress(total, count),
    };
    let mut measured = measure(&settled, &function, &effort)?;
    if let (Some(bound), Some((all, chosen))) = (request.bound, &candidates)
        && measured.certified > bound
    {
        // The search has the least error that runs; what is proved of it may still be more than what is
        // proved of the coefficients that were listed.
        settled = all[*chosen].settled.clone();
        search = None;
        measured = measure(&settled, &function, &effort)?;
    }
    let alternatives = candidates.map(|(all, chosen)| choice::alternatives(&all, chosen));
    let (coefficients, table) = describe::data(&settled.form);
    let ideal = match (&settled.form, &search) {
        (Form::Polynomial(p), Some(search)) => {
            ideal::ideal(search, p, measured.data_only, &function)
        }
        _ => None,
    };
    let outcome = Outcome {
        schema: "gyrogen.approx/1",
        version: env!("CARGO_PKG_VERSION"),
        design_sha256: sha256(request.canonical().as_bytes()),
        command: command.to_owned(),
        function: request.function.clone(),
        domain: request.domain.join(","),
        input_codes: [codes.low, codes.high],
        form: settled.form.name(),
        detail: describe::detail(&settled.form),
        monomials: match &settled.form {
            Form::Polynomial(p) => Some(p.monomials),
            _ => None,
        },
        evaluation: match &settled.form {
            Form::Polynomial(p) => Some(p.formats.scheme),
            _ => None,
        },
        formats: describe::formats(&settled.form, request),
        coefficients,
        table,
        error: bounds(&measured),
        inputs_checked: measured.inputs_checked,
        exhaustive: measured.exhaustive,
        cost: priced::cost(&settled, request.target),
        target: request.target,
        search,
        ideal,
        alternatives,
        bound: request.bound,
        holds: request
            .bound
            .is_none_or(|bound| measured.certified <= bound),
    };
    Ok(Approximation {
        outcome,
        settled,
        function,
    })
}

fn bounds(m: &Measured) -> ErrorBounds {
    ErrorBounds {
        certified_max_abs: m.certified,
        exhaustive_max_abs: m.exhaustive.then_some(m.observed),
        sampled_max_abs: (!m.exhaustive).then_some(m.observed),
        coefficients_only_max_abs: m.data_only,
        rounding_max_abs: m.rounding,
        at_input_raw: m.at_input_raw,
    }
}

type Choice = (
    Form,
    Option<super::outcome::Search>,
    Option<(Vec<Candidate>, usize)>,
);

fn choose(request: &Request, function: &Function, codes: Codes) -> Result<Choice> {
    if let (Some(degree), Asked::Polynomial | Asked::Auto, None) =
        (request.degree, request.form, request.bound)
    {
        let kind = request.monomials.unwrap_or_default();
        let (form, search) = polynomial_as_asked(function, codes, request, kind, degree, None)?;
        return Ok((form, Some(search), None));
    }
    let wanted = refused::wanted(request.form);
    // A degree alone for segments: as many as keep the error within one LSB.
    let bound = request.bound.unwrap_or(request.output.lsb());
    let candidates = choice::candidates(function, codes, request, bound, wanted)?;
    let Some(chosen) = choice::cheapest(&candidates) else {
        return Err(refused::unmet(function, codes, request, bound, wanted));
    };
    let mut form = candidates[chosen].settled.form.clone();
    let mut search = None;
    if let Form::Polynomial(p) = &form {
        let degree = p.coefficients.len() - 1;
        let asked = Request {
            coefficients: p.formats.coefficients.each(p.monomials, degree),
            ..request.clone()
        };
        let steps = Some(p.formats.intermediate.fraction_bits);
        let (better, found) =
            polynomial_as_asked(function, codes, &asked, p.monomials, degree, steps)?;
        // The search is for the least error: the same degree, the same formats.
        (form, search) = (better, Some(found));
    }
    let listed = request.bound.map(|_| (candidates, chosen));
    Ok((form, search, listed))
}

/// The polynomial of the request, with the best coefficients that the search finds. `steps`: fraction bits that its steps
/// are rounded to if the request has no format for them.
fn polynomial_as_asked(
    function: &Function,
    codes: Codes,
    request: &Request,
    kind: Monomials,
    degree: usize,
    steps: Option<i32>,
) -> Result<(Form, super::outcome::Search)> {
    let formats = match request.coefficients.as_slice() {
        [] => Format::q(2, request.output.fraction_bits).into(),
        some => CoefficientFormats::new(some, kind, degree)?,
    };
    let chosen = coefficients::choose(function, codes, request, kind, degree, formats, steps)?;
    let Chosen { form, search } = chosen;
    Ok((Form::Polynomial(Box::new(form)), search))
}
