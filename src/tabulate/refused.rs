//! A bound that no form keeps: how near the request came, and what is in the way.

use super::choice::{
    self, Candidate, GUARD_BITS, HIGHEST_DEGREE, Search, Wanted, has_degree, kinds,
};
use super::coefficients::Degree;
use super::describe;
use super::request::{Asked, Request};
use crate::approx::form::generate;
use crate::approx::form::split::{Spacing, Split};
use crate::approx::form::{Codes, Form};
use crate::approx::reference::Function;
use crate::error::{Error, InputError};
use crate::numeric::format::Format;
use crate::text::{at_most, number};

/// Segments of a table that comes as near as it can.
const LARGE_SEGMENTS: usize = 1 << 12;
/// More fraction bits of the output that are tried.
const MORE_BITS: [u32; 3] = [1, 3, 6];

/// The request is refused: with the best certified error of its forms, and with the first of its limits that has to go.
pub(super) fn unmet(
    function: &Function,
    codes: Codes,
    request: &Request,
    bound: f64,
    wanted: Wanted,
) -> Error {
    if let Some(refusal) = output_too_coarse(request, bound) {
        return refusal.into();
    }
    let nearest = nearest(function, codes, request, wanted);
    let reached = nearest.map_or_else(String::new, |c| {
        format!(
            "; the nearest reaches {}: {}",
            at_most(c.measured.certified, 3),
            named(&c, request)
        )
    });
    InputError::new(format!(
        "no form of the kind that was asked for has a certified error of at most {bound:e}{reached}"
    ))
    .help(in_the_way(function, codes, request, bound))
    .into()
}

/// The refusal of a bound that the rounding to the output's LSB alone forbids: what comes nearest to it does not matter then.
fn output_too_coarse(request: &Request, bound: f64) -> Option<InputError> {
    let half = request.output.lsb() / 2.0;
    if bound > half {
        return None;
    }
    let bits = (-(2.0 * bound).log2()).floor() as i64 + 1;
    let refusal = InputError::new(format!(
        "no form has a certified error of at most {bound:e} with `--output` {}: rounding to it alone costs up to half an LSB, {}",
        request.output,
        number(half, 3)
    ));
    Some(refusal.help(format!(
        "give `--output` at least {bits} fraction bits, or a wider bound"
    )))
}

/// A form with its formats.
fn named(candidate: &Candidate, request: &Request) -> String {
    let form = &candidate.settled.form;
    let formats = describe::formats(form, request);
    let detail = &candidate.detail;
    let words = match detail.contains("coefficients") {
        true => String::new(),
        false => format!(", entries on {}", formats.coefficients),
    };
    let steps = formats.intermediate.filter(|_| words.is_empty());
    let steps = steps.map_or_else(String::new, |f| format!(", intermediate {f}"));
    format!("{detail}{words}{steps}")
}

/// What the request could do without, and what would be certified then.
fn in_the_way(function: &Function, codes: Codes, request: &Request, bound: f64) -> String {
    let found = |asked: &Request| {
        let wanted = wanted(asked.form);
        let all = choice::candidates(function, codes, asked, bound, wanted).ok()?;
        let chosen = choice::cheapest(&all)?;
        let one = all.get(chosen)?;
        Some(format!(
            "{} is certified at {}",
            named(one, asked),
            at_most(one.measured.certified, 3)
        ))
    };
    let limits = limits(request).into_iter();
    let mut tried = limits.filter_map(|(name, without)| Some((name, found(&without)?)));
    if let Some((name, then)) = tried.next() {
        // The polynomial is also the form of a request that names none.
        return match name.starts_with("--form") {
            true => format!("give `--form auto`: {then}"),
            false => format!("`{name}` is in the way: without it, {then}"),
        };
    }
    let finer = |more: u32| {
        let output = Format {
            fraction_bits: request.output.fraction_bits + more,
            ..request.output
        };
        let asked = Request {
            output,
            ..request.clone()
        };
        Some((output, found(&asked)?))
    };
    match MORE_BITS.into_iter().find_map(finer) {
        Some((output, then)) => {
            format!("`--output` is in the way: with {output}, {then}")
        }
        None => "give a wider bound; no single format or degree of the request is in the way alone"
            .to_owned(),
    }
}

/// The request's limits, each with the request that does without it.
fn limits(request: &Request) -> Vec<(String, Request)> {
    let mut all = Vec::new();
    let mut without = |name: String, asked: Request| all.push((name, asked));
    if let Some(format) = request.coefficients.first() {
        let coefficients = Vec::new();
        let asked = Request {
            coefficients,
            ..request.clone()
        };
        without(format!("--coefficients {format}"), asked);
    }
    if let Some(format) = request.intermediate {
        let asked = Request {
            intermediate: None,
            ..request.clone()
        };
        without(format!("--intermediate {format}"), asked);
    }
    if let Some(degree) = request.degree {
        let asked = Request {
            degree: None,
            ..request.clone()
        };
        without(format!("--degree {degree}"), asked);
    }
    if request.monomials.is_some() {
        let asked = Request {
            monomials: None,
            ..request.clone()
        };
        without("--monomials".to_owned(), asked);
    }
    if request.form != Asked::Auto {
        let form = Asked::Auto;
        let asked = Request {
            form,
            ..request.clone()
        };
        let name = format!("{:?}", request.form).to_lowercase();
        without(format!("--form {name}"), asked);
    }
    all
}

/// The forms that are meant.
pub(super) fn wanted(form: Asked) -> Wanted {
    Wanted {
        polynomial: matches!(form, Asked::Polynomial | Asked::Auto),
        table: matches!(form, Asked::Table | Asked::Auto),
        piecewise: matches!(form, Asked::Piecewise | Asked::Auto),
    }
}

/// What comes nearest to the function with the finest words that the request allows, however large.
fn nearest(
    function: &Function,
    codes: Codes,
    request: &Request,
    wanted: Wanted,
) -> Option<Candidate> {
    let search = Search::new(function, codes, request, f64::INFINITY);
    let mut found = Vec::new();
    if wanted.polynomial {
        let kind = request.monomials.unwrap_or_default();
        let degrees = request.degree.map_or(0..=HIGHEST_DEGREE, |d| d..=d);
        let degrees = degrees.filter(|d| has_degree(kind, *d));
        found.extend(degrees.filter_map(|degree| {
            let degree = Degree::new(function, request, kind, degree)?;
            let ideal = degree.on(degree.most_fraction_bits())?;
            let form = degree.evaluation(codes, ideal)?;
            search.meets(Some(Form::Polynomial(Box::new(form))))
        }));
    }
    let bits = search.width().saturating_sub(LARGE_SEGMENTS.ilog2());
    let split = Split::new(codes, search.symmetry, Spacing::Uniform { bits });
    let (output, most) = (request.output, search.most(GUARD_BITS));
    if wanted.table {
        let kinds = kinds(request.degree).into_iter();
        found.extend(kinds.filter_map(|kind| {
            search.meets(generate::table(function, split.clone(), kind, output, most))
        }));
    }
    if wanted.piecewise {
        let degree = request.degree.unwrap_or(2);
        let form = generate::piecewise(function, split, degree, output, most);
        found.extend(search.meets(form));
    }
    let certified = |c: &Candidate| c.measured.certified;
    { found.into_iter() }.min_by(|a, b| certified(a).total_cmp(&certified(b)))
}
