//! A polynomial's coefficients: from the search, with the bit-accurate evaluation in its loop.

use super::form::polynomial::Monomials;
use super::form::{Codes, Form, Settled};
use super::form::measure::Reference;
use super::job::{self, Request, Weight};
use super::minimax::{self, Basis, Budget, CoefficientFormat, Problem, Samples};
use super::outcome::{Compared, Search};
use super::reference::Function;
use crate::error::Result;
use crate::numeric::format::Format;
use crate::numeric::trace::ir::Interval;

/// Fraction bits beyond the output's that are tried for coefficients.
const GUARD_BITS: [u32; 4] = [0, 2, 4, 8];

/// Coefficients with how they were found.
#[derive(Debug, Clone)]
pub struct Chosen {
    /// From order 0 to the degree.
    pub raw: Vec<i128>,
    /// For the report.
    pub search: Search,
}

fn basis(kind: Monomials, degree: usize) -> Result<Basis> {
    let kind = match kind {
        Monomials::All => minimax::Monomials::All,
        Monomials::Odd => minimax::Monomials::Odd,
        Monomials::Even => minimax::Monomials::Even,
    };
    Basis::new(kind, degree as u32)
}

fn weight(request: &Request) -> minimax::Weight {
    match request.weight {
        Weight::Absolute => minimax::Weight::Absolute,
        Weight::Relative => minimax::Weight::Relative,
    }
}

/// From one a monomial to one an order.
fn spread(raw: &[i128], kind: Monomials, degree: usize) -> Vec<i128> {
    let mut all = vec![0; degree + 1];
    for (value, order) in raw.iter().zip(kind.exponents(degree)) {
        all[order] = *value;
    }
    all
}

/// The best coefficients in the format for the whole evaluation.
///
/// # Errors
/// A coefficient that the format does not hold; a basis that cannot follow the function.
pub fn choose(
    function: &Function,
    codes: Codes,
    request: &Request,
    kind: Monomials,
    degree: usize,
    format: Format,
) -> Result<Chosen> {
    let basis = basis(kind, degree)?;
    let (low, high) = function.domain();
    let samples = Samples::new(function, &basis, low, high, weight(request))?;
    let best_real = minimax::minimax(&samples)?;
    let problem = Problem::new(&samples, &best_real, &[CoefficientFormat::from(format)])?;
    let best = problem.best(Budget::default())?;
    let total = |raw: &[i128]| {
        let all = spread(raw, kind, degree);
        let form = job::compiled(codes, request, kind, format, all).ok()?;
        let settled = Form::Polynomial(form).settle().ok()?;
        Some(worst(&settled, function))
    };
    let compared = |name, raw: &[i128], ideal| Compared {
        name,
        raw: raw.to_vec(),
        ideal_max_abs: ideal,
        total_max_abs: total(raw),
    };
    let all = vec![
        compared("rounded minimax", &best.rounded.raw, best.rounded.error),
        compared("nearest plane (as fpminimax)", &best.babai.raw, best.babai.error),
        compared("best under ideal evaluation", &best.raw, best.error),
    ];
    Ok(Chosen {
        raw: spread(&best.raw, kind, degree),
        search: Search {
            minimax_error: best.minimax_error,
            proved_best: best.proved,
            compared: all,
        },
    })
}

/// The greatest error over a dense subset of the codes.
fn worst(settled: &Settled, function: &Function) -> f64 {
    let codes = settled.form.codes();
    let lsb = settled.form.output().lsb();
    let stride = (codes.count() as i128 >> 16).max(1);
    let mut code = codes.low;
    let mut worst = 0.0f64;
    while code <= codes.high {
        let value = function.at(codes.real(code)).0;
        worst = worst.max((settled.run(code) as f64 * lsb - value).abs());
        code += stride;
    }
    worst
}

/// Coefficients whose ideal error leaves some of `room`, in the request's format or in the shortest that does.
/// `None` if there are none.
pub fn within(
    function: &Function,
    request: &Request,
    kind: Monomials,
    degree: usize,
    room: f64,
) -> Option<(Format, Vec<i128>)> {
    let basis = basis(kind, degree).ok()?;
    let (low, high) = function.domain();
    let samples = Samples::new(function, &basis, low, high, weight(request)).ok()?;
    let best_real = minimax::minimax(&samples).ok()?;
    if best_real.error >= room {
        return None;
    }
    let tried: Vec<u32> = match request.coefficients {
        Some(format) => vec![format.fraction_bits],
        None => GUARD_BITS.map(|g| request.output.fraction_bits + g).to_vec(),
    };
    tried.into_iter().find_map(|fraction_bits| {
        let format = match request.coefficients {
            Some(format) => CoefficientFormat::from(format),
            None => CoefficientFormat::unlimited(fraction_bits as i32),
        };
        let problem = Problem::new(&samples, &best_real, &[format]).ok()?;
        let best = problem.best(Budget { nodes: 200_000 }).ok()?;
        if best.error >= room {
            return None;
        }
        let range = best.raw.iter().map(|raw| Interval::point(*raw)).reduce(Interval::join)?;
        let integer_bits = (range.bits() as i32 - fraction_bits as i32).max(1) as u32;
        let format = request.coefficients.unwrap_or(Format::q(integer_bits, fraction_bits));
        (format.bits() <= 64).then(|| (format, spread(&best.raw, kind, degree)))
    })
}
