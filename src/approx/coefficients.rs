//! A polynomial's coefficients: from the search, with the bit-accurate evaluation in its loop.

use super::datapath::Evaluation;
use super::form::measure::Reference;
use super::form::polynomial::{Monomials, Polynomial};
use super::form::{Codes, Form};
use super::job::{self, Request, Weight};
use super::minimax::search::{Effort, Judged};
use super::minimax::{self, Basis, Budget, CoefficientFormat, Problem, Samples};
use super::outcome::{Compared, Search};
use super::reference::Function;
use crate::error::Result;
use crate::numeric::format::Format;
use crate::numeric::trace::ir::Interval;

/// Fraction bits beyond the output's that are tried for coefficients.
const GUARD_BITS: [u32; 4] = [0, 2, 4, 8];

/// Fraction bits that the search's intermediate does without.
const SPARE_BITS: i32 = 4;

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
    let (low, high) = (codes.real(codes.low), codes.real(codes.high));
    let lsb = codes.format.lsb();
    let nearest = |x: f64| (x / lsb).round().clamp(codes.low as f64, codes.high as f64) * lsb;
    let weight = weight(request);
    let few = codes.count() <= 4 * (degree as u128 + 2);
    let samples = match few {
        // Fewer codes than a search could use: the interval decides.
        true => Samples::new(
            function,
            &basis,
            function.domain().0,
            function.domain().1,
            weight,
        )?,
        false => Samples::on_codes(function, &basis, low, high, weight, &nearest)?,
    };
    let best_real = minimax::minimax(&samples)?;
    let problem = Problem::new(&samples, &best_real, &[CoefficientFormat::from(format)])?;
    let rounded = spread(&problem.rounded.raw, kind, degree);
    let first = job::compiled(codes, request, kind, format, rounded.clone())?;
    let mut formats = first.formats;
    if request.intermediate.is_none() {
        // Words a little shorter than the widest, for coefficients a little larger.
        let spare = SPARE_BITS.min(formats.intermediate.fraction_bits.max(0));
        formats.intermediate.fraction_bits -= spare;
    }
    let pattern = Polynomial::new(formats, kind, rounded)?;
    let settled = Form::Polynomial(Box::new(pattern)).settle()?;
    let path = Evaluation::new(function, &settled, formats, kind, degree, request.weight);
    let found = minimax::search(&problem, &path, Effort::default())?;
    let mut compared: Vec<Compared> = found.baselines.iter().map(shown).collect();
    compared.push(Compared {
        name: "chosen with the evaluation in the loop",
        raw: found.raw.clone(),
        ideal_max_abs: found.ideal_error,
        total_max_abs: found.total_error.is_finite().then_some(found.total_error),
    });
    Ok(Chosen {
        raw: spread(&found.raw, kind, degree),
        search: Search {
            minimax_error: found.best.minimax_error,
            proved_best: found.proved,
            coefficients_proved_best: found.best.proved,
            evaluations: found.evaluations,
            compared,
        },
    })
}

fn shown(judged: &Judged) -> Compared {
    Compared {
        name: match judged.name {
            "rounded" => "rounded minimax",
            "babai" => "nearest plane of the lattice (as fpminimax)",
            "ideal" => "best under ideal evaluation",
            other => other,
        },
        raw: judged.raw.clone(),
        ideal_max_abs: judged.ideal_error,
        total_max_abs: judged.total_error.is_finite().then_some(judged.total_error),
    }
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
        None => GUARD_BITS
            .map(|g| request.output.fraction_bits + g)
            .to_vec(),
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
        let range = best
            .raw
            .iter()
            .map(|raw| Interval::point(*raw))
            .reduce(Interval::join)?;
        let integer_bits = (range.bits() as i32 - fraction_bits as i32).max(1) as u32;
        let format = request
            .coefficients
            .unwrap_or(Format::q(integer_bits, fraction_bits));
        (format.bits() <= 64).then(|| (format, spread(&best.raw, kind, degree)))
    })
}
