//! A polynomial's coefficients: from the search, with the bit-accurate evaluation in its loop.

use super::datapath::Evaluation;
use super::outcome::{Compared, Search};
use super::request::{Request, Weight};
use super::selection::{self, Errors, Reason};
use crate::approx::form::coefficient_formats::CoefficientFormats;
use crate::approx::form::measure::Reference;
use crate::approx::form::polynomial;
use crate::approx::form::polynomial::{Monomials, Polynomial};
use crate::approx::form::{Codes, Form};
use crate::approx::minimax;
use crate::approx::minimax::search::{Effort, Found, Judged};
use crate::approx::minimax::{Basis, Budget, CoefficientFormat, Datapath, Problem, Samples};
use crate::approx::reference::Function;
use crate::error::Result;
use crate::numeric::cast::Target as Quantised;
use crate::numeric::format::Format;
use crate::numeric::trace::ir::Interval;

/// Most fraction bits of coefficients beyond the output's.
const GUARD_BITS: u32 = 8;

/// Fraction bits that the search's intermediate does without.
const SPARE_BITS: i32 = 4;

/// For the best coefficients under ideal evaluation.
const BEST: Budget = Budget { nodes: 2_000_000 };

/// What the best coefficients under ideal evaluation are called.
pub const BEST_NAME: &str = "best under ideal evaluation";

/// Coefficients with how they were found.
#[derive(Debug, Clone)]
pub struct Chosen {
    /// With its formats.
    pub form: Polynomial,
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

/// The best coefficients in the format for the whole evaluation. Without a format of the request's own for them, steps
/// are rounded to `fraction_bits` if that is given, else to so many that nothing is lost.
///
/// # Errors
/// A coefficient that the format does not hold; a basis that cannot follow the function.
pub fn choose(
    function: &Function,
    codes: Codes,
    request: &Request,
    kind: Monomials,
    degree: usize,
    coefficients: CoefficientFormats,
    fraction_bits: Option<i32>,
) -> Result<Chosen> {
    let basis = basis(kind, degree)?;
    let each = coefficients.each(kind, degree).into_iter();
    let each: Vec<CoefficientFormat> = each.map(CoefficientFormat::from).collect();
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
    let problem = Problem::new(&samples, &best_real, &each)?;
    let rounded = spread(&problem.rounded.raw, kind, degree);
    let first = compiled(codes, request, kind, coefficients, rounded.clone())?;
    let mut formats = first.formats;
    if request.intermediate.is_none() {
        // Words a little shorter than the widest, for coefficients a little larger.
        let widest = formats.intermediate.fraction_bits;
        let spared = widest - SPARE_BITS.min(widest.max(0));
        formats.intermediate.fraction_bits = fraction_bits.map_or(spared, |f| f.min(spared));
    }
    let pattern = Polynomial::new(formats, kind, rounded)?;
    let settled = Form::Polynomial(Box::new(pattern)).settle()?;
    let path = Evaluation::new(function, &settled, formats, kind, degree, request.weight);
    // The best for the whole interval, its ends and what lies between codes included.
    let whole = Samples::new(
        function,
        &basis,
        function.domain().0,
        function.domain().1,
        weight,
    )?;
    let whole_real = minimax::minimax(&whole)?;
    let whole = Problem::new(&whole, &whole_real, &each)?;
    let effort = Effort::default();
    let best = whole.best(BEST)?;
    let mut found = minimax::search_from(&problem, best, &path, effort)?;
    improve_ideal(&mut found, &whole, &path);
    let taken = Taken::of(&found, &whole, &path);
    let raw = spread(&taken.raw, kind, degree);
    if request.intermediate.is_none() {
        formats = polynomial::trimmed(formats, kind, &raw);
    }
    Ok(Chosen {
        form: Polynomial::new(formats, kind, raw)?,
        search: taken.report(&found),
    })
}

/// Where the search met coefficients with a smaller ideal error than the best that it began with (these
/// are not proved, then), they are the best.
fn improve_ideal(found: &mut Found, whole: &Problem, path: &Evaluation) {
    if found.best.proved {
        return;
    }
    let met = found.listed.iter().chain(found.near.iter().map(|(c, _)| c));
    let errors = met.map(|c| (whole.error(&c.raw), &c.raw));
    let Some((_, raw)) = errors.min_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(b.1))) else {
        return;
    };
    let (error, raw) = (whole.exact_error(raw), raw.clone());
    if error >= found.best.error {
        return;
    }
    if let Some(ideal) = found.baselines.iter_mut().find(|j| j.name == "ideal") {
        let total = path.max_error(&raw, f64::INFINITY);
        *ideal = Judged {
            raw: raw.clone(),
            ideal_error: error,
            total_error: total.unwrap_or(f64::INFINITY),
            ..ideal.clone()
        };
    }
    (found.best.error, found.best.raw) = (error, raw);
}

/// The coefficients that are taken.
struct Taken {
    raw: Vec<i128>,
    errors: Errors,
    reason: Reason,
    /// Evaluation and output rounding as a part of the whole error.
    rounding_part: f64,
}

impl Taken {
    fn of(found: &Found, whole: &Problem, path: &Evaluation) -> Taken {
        let errors = |j: &Judged| Errors {
            ideal: j.ideal_error,
            total: j.total_error,
        };
        let ideal = found.baselines.iter().find(|j| j.name == "ideal");
        let ideal = ideal.map_or(
            Errors {
                ideal: found.best.error,
                total: f64::INFINITY,
            },
            errors,
        );
        let others = found.baselines.iter().filter(|j| j.name != "ideal");
        let baselines: Vec<Errors> = others.map(errors).collect();
        let near: Vec<Errors> = found
            .near
            .iter()
            .map(|(c, total)| Errors {
                ideal: whole.exact_error(&c.raw),
                total: *total,
            })
            .collect();
        let rounding = path.evaluation_bound(&found.best.raw);
        let (which, reason) = selection::select(ideal, rounding, &baselines, &near);
        let one = which.and_then(|k| Some((found.near.get(k)?.0.raw.clone(), *near.get(k)?)));
        let (raw, errors) = one.unwrap_or((found.best.raw.clone(), ideal));
        Taken {
            raw,
            errors,
            reason,
            rounding_part: rounding / ideal.total,
        }
    }

    fn report(self, found: &Found) -> Search {
        let mut compared: Vec<Compared> = found.baselines.iter().map(shown).collect();
        for (one, judged) in compared.iter_mut().zip(&found.baselines) {
            one.proved = judged.name == "ideal" && found.best.proved;
        }
        compared.push(Compared {
            name: "taken",
            raw: self.raw,
            ideal_max_abs: self.errors.ideal,
            total_max_abs: self.errors.total.is_finite().then_some(self.errors.total),
            proved: found.proved && self.errors.total <= found.least,
        });
        let heuristic = found.baselines.iter().find(|j| j.name == "babai");
        let gain = heuristic.map(|j| 100.0 * (1.0 - self.errors.total / j.total_error));
        Search {
            minimax_error: found.best.minimax_error,
            reason: self.reason,
            rounding_part: self.rounding_part,
            least_total: found.least,
            proved_best: found.proved,
            coefficients_proved_best: found.best.proved,
            gain_over_nearest_plane_percent: gain.filter(|g| g.is_finite()),
            evaluations: found.evaluations,
            compared,
        }
    }
}

fn shown(judged: &Judged) -> Compared {
    Compared {
        name: match judged.name {
            "rounded" => "rounded minimax",
            "babai" => "lattice rounding (as fpminimax)",
            "ideal" => BEST_NAME,
            other => other,
        },
        raw: judged.raw.clone(),
        ideal_max_abs: judged.ideal_error,
        total_max_abs: judged.total_error.is_finite().then_some(judged.total_error),
        proved: false,
    }
}

/// Best coefficients under ideal evaluation on so many fraction bits.
#[derive(Debug, Clone)]
pub struct Ideal {
    /// With the integer bits that they need, or as given.
    pub format: Format,
    /// From order 0 to the degree.
    pub raw: Vec<i128>,
    /// Under ideal evaluation.
    pub error: f64,
}

/// Polynomials of one degree, for any number of fraction bits of their coefficients.
pub struct Degree<'a> {
    request: &'a Request,
    kind: Monomials,
    degree: usize,
    samples: Samples<'a>,
    best_real: minimax::Minimax,
}

impl<'a> Degree<'a> {
    /// `None` if such a polynomial cannot follow the function.
    pub fn new(
        function: &'a Function,
        request: &'a Request,
        kind: Monomials,
        degree: usize,
    ) -> Option<Self> {
        let basis = basis(kind, degree).ok()?;
        let (low, high) = function.domain();
        let samples = Samples::new(function, &basis, low, high, weight(request)).ok()?;
        let best_real = minimax::minimax(&samples).ok()?;
        Some(Degree {
            request,
            kind,
            degree,
            samples,
            best_real,
        })
    }

    /// What real coefficients leave.
    pub fn least_error(&self) -> f64 {
        self.best_real.error
    }

    /// The finest coefficients that are tried.
    pub fn most_fraction_bits(&self) -> u32 {
        let given = self.request.coefficients.first();
        given.map_or(self.request.output.fraction_bits + GUARD_BITS, |format| {
            format.fraction_bits
        })
    }

    /// The best coefficients on so many fraction bits, in the request's format if it has one.
    pub fn on(&self, fraction_bits: u32) -> Option<Ideal> {
        let given = self.request.coefficients.first().copied();
        let format = match given {
            Some(format) => CoefficientFormat::from(format),
            None => CoefficientFormat::unlimited(fraction_bits as i32),
        };
        let problem = Problem::new(&self.samples, &self.best_real, &[format]).ok()?;
        let best = problem.best(Budget { nodes: 200_000 }).ok()?;
        let points = best.raw.iter().map(|raw| Interval::point(*raw));
        let range = points.reduce(Interval::join)?;
        let integer_bits = (range.bits() as i32 - fraction_bits as i32).max(1) as u32;
        let format = given.unwrap_or(Format::q(integer_bits, fraction_bits));
        (format.bits() <= 64).then(|| Ideal {
            format,
            raw: spread(&best.raw, self.kind, self.degree),
            error: best.error,
        })
    }

    /// The same, but only what leaves some of `room`.
    pub fn within(&self, fraction_bits: u32, room: f64) -> Option<Ideal> {
        self.on(fraction_bits).filter(|ideal| ideal.error < room)
    }

    /// Its evaluation in the request's formats.
    pub(super) fn evaluation(&self, codes: Codes, ideal: Ideal) -> Option<Polynomial> {
        let format = ideal.format.into();
        compiled(codes, self.request, self.kind, format, ideal.raw).ok()
    }
}

/// The evaluation in the request's formats.
pub(super) fn compiled(
    codes: Codes,
    request: &Request,
    kind: Monomials,
    coefficients: CoefficientFormats,
    raw: Vec<i128>,
) -> Result<Polynomial> {
    let intermediate = match request.intermediate {
        Some(format) => format,
        None => {
            let to = (request.output, request.evaluation);
            polynomial::choose_intermediate(codes, coefficients, to, kind, &raw)?
        }
    };
    let formats = polynomial::Formats {
        codes,
        coefficients,
        intermediate: Quantised::from(intermediate),
        output: request.output,
        scheme: request.evaluation,
    };
    Polynomial::new(formats, kind, raw)
}

#[cfg(test)]
#[path = "coefficients_tests.rs"]
mod tests;
