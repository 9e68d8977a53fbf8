//! One polynomial over the whole domain, by Horner's rule or by Estrin's scheme ([`super::plan`]).
//!
//! With x the limited input, c_k the coefficients, `cast_i` and `cast_o` the quantisers to the intermediate and
//! the output format (half up, saturating):
//!
//! | monomials | evaluation |
//! |---|---|
//! | all | t = c_n; t = cast_i(t x + c_k) for k = n-1 .. 0; y = cast_o(t) |
//! | even | u = cast_i(x x); the same in u with c_n, c_(n-2), .. c_0 |
//! | odd | u = cast_i(x x); the same in u with c_n, c_(n-2), .. c_1; y = cast_o(t x) |
//!
//! One cast a step, after the multiplication and the addition, which are exact. With all monomials the last step's
//! cast and the output's both happen. Coefficients may have fraction bits of their own: product and coefficient are
//! aligned to the finer one by appending zeros.

use super::coefficient_formats::CoefficientFormats;
pub use super::monomials::{HIGHEST_DEGREE, Monomials};
use super::plan::{Plan, half};
use super::{Codes, Number, Piece, integer_bits_of};
use crate::error::{InputError, Result};
use crate::numeric::arithmetic::Arithmetic;
use crate::numeric::cast::{Cast, Label, Target};
use crate::numeric::format::{Format, Overflow, Quantizer, Rounding};
use crate::numeric::trace::ir::Interval;

pub use super::plan::Scheme;
/// Sub-intervals on which bounds are taken.
const PIECES: i128 = 128;
/// Covers the rounding of bounds that are computed in `f64`.
pub(super) const SLACK: f64 = 1.0 + 1e-9;

/// The formats of a polynomial's evaluation.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Formats {
    /// The input's codes.
    pub codes: Codes,
    /// Of the coefficients.
    pub coefficients: CoefficientFormats,
    /// Of the cast after each step.
    pub intermediate: Target,
    /// Of the result.
    pub output: Format,
    /// The order of the steps.
    pub scheme: Scheme,
}

/// The polynomial.
#[derive(Debug, Clone)]
pub struct Polynomial {
    /// The input's codes.
    pub codes: Codes,
    /// The output's format.
    pub output: Format,
    /// Formats, as given or chosen.
    pub formats: Formats,
    /// Which monomials.
    pub monomials: Monomials,
    /// Raw coefficients from order 0 to the degree; 0 where the monomials have none.
    pub coefficients: Vec<i128>,
    square: Option<Cast>,
    plan: Plan,
    last: Cast,
}

impl Polynomial {
    /// Compiles the evaluation. `coefficients` go from order 0 to the degree.
    ///
    /// # Errors
    /// A degree above [`HIGHEST_DEGREE`]; an alignment that needs more than 126 bits.
    pub fn new(formats: Formats, monomials: Monomials, coefficients: Vec<i128>) -> Result<Self> {
        let degree = coefficients.len().saturating_sub(1);
        if degree > HIGHEST_DEGREE {
            return Err(InputError::new(format!(
                "degree {degree} is above {HIGHEST_DEGREE}, the highest"
            ))
            .help("use `--form piecewise`: segments of a low degree reach the same error")
            .into());
        }
        let exponents = monomials.exponents(degree);
        let q = Quantizer::default_of(formats.output);
        let input = formats.codes.format.fraction_bits as i32;
        let inner = formats.intermediate.fraction_bits;
        let variable = if monomials == Monomials::All {
            input
        } else {
            inner
        };
        let number = |order: &usize| {
            let own = formats.coefficients.of(*order).fraction_bits as i32;
            (coefficients[*order], own)
        };
        let numbers = exponents.iter().map(number).collect();
        let (scheme, intermediate) = (formats.scheme, formats.intermediate);
        let plan = Plan::new(scheme, numbers, &exponents, variable, intermediate)?;
        let at = plan.fraction_bits;
        let squares = monomials != Monomials::All && exponents.len() > 1;
        let last = if monomials == Monomials::Odd {
            at + input
        } else {
            at
        };
        Ok(Polynomial {
            codes: formats.codes,
            output: formats.output,
            formats,
            monomials,
            square: squares.then(|| {
                let (half_up, saturate) = (Rounding::HalfUp, Some(Overflow::Saturate));
                let label = Label::of("square");
                Cast::new(label, 2 * input, 0, intermediate, half_up, saturate)
            }),
            plan,
            last: Cast::to(Label::of("output"), last, 0, q),
            coefficients,
        })
    }

    pub(super) fn output_cast(&self) -> &Cast {
        &self.last
    }

    pub(super) fn casts_mut(&mut self) -> Vec<&mut Cast> {
        let casts = self.square.iter_mut().chain(self.plan.casts_mut());
        casts.chain([&mut self.last]).collect()
    }

    /// The output for an input word.
    #[inline(always)]
    pub fn evaluate<A: Arithmetic>(&self, ar: &A, input: A::Word) -> A::Word {
        let x = self.codes.limit(ar, input);
        let variable = match &self.square {
            Some(cast) => ar.cast(ar.mul(x, x), cast, &[x, x]),
            None => x,
        };
        let t = self.plan.evaluate(ar, variable);
        let last = match self.monomials {
            Monomials::Odd => ar.mul(t, x),
            _ => t,
        };
        ar.cast(last, &self.last, &[last])
    }

    /// The polynomial over sub-intervals of the domain, with the bound of its evaluation on each.
    pub(super) fn pieces(&self) -> Vec<Piece> {
        let number = |(order, raw): (usize, &i128)| Number {
            raw: *raw,
            fraction_bits: self.formats.coefficients.of(order).fraction_bits as i32,
        };
        let terms: Vec<Number> = self.coefficients.iter().enumerate().map(number).collect();
        split(self.codes.low, self.codes.high, PIECES)
            .map(|(low, high)| Piece {
                low,
                high,
                centre: Number {
                    raw: 0,
                    fraction_bits: 0,
                },
                terms: terms.clone(),
                evaluation_bound: self.evaluation_bound(low, high),
            })
            .collect()
    }

    /// A bound on what the casts of the steps add between two codes: each cast's half LSB times what
    /// follows it.
    pub(crate) fn evaluation_bound(&self, low: i128, high: i128) -> f64 {
        let x = self.codes.real(low).abs().max(self.codes.real(high).abs());
        let (v, v_error) = match &self.square {
            Some(cast) => (x * x, half(cast)),
            None => (x, 0.0),
        };
        let error = self.plan.error_bound(v, v_error);
        let outer = if self.monomials == Monomials::Odd {
            x
        } else {
            1.0
        };
        error * outer * SLACK
    }

    /// Fraction bits with which no step rounds at all.
    pub fn exact_fraction_bits(formats: &Formats, monomials: Monomials, degree: usize) -> i32 {
        let input = formats.codes.format.fraction_bits as i32;
        let own = formats.coefficients.most_fraction_bits(monomials, degree) as i32;
        let factors = match monomials {
            Monomials::All => degree,
            _ => degree.saturating_sub(1),
        };
        (own + factors as i32 * input).max(2 * input)
    }
}

/// `low ..= high` in at most `count` parts of nearly equal length.
pub(super) fn split(low: i128, high: i128, count: i128) -> impl Iterator<Item = (i128, i128)> {
    let size = high - low + 1;
    let count = count.min(size);
    (0..count).map(move |k| (low + size * k / count, low + size * (k + 1) / count - 1))
}

/// The widest intermediate whose products fit 64-bit words; 128-bit words only if nothing narrower keeps the
/// evaluation's rounding below a thousandth of the output's LSB. Integer bits are those that the
/// ranges need.
///
/// # Errors
/// No intermediate of up to 64 bits does.
pub fn choose_intermediate(
    codes: Codes,
    coefficient_formats: CoefficientFormats,
    (output, scheme): (Format, Scheme),
    monomials: Monomials,
    coefficients: &[i128],
) -> Result<Format> {
    let with = |fraction_bits: i32| {
        let formats = Formats {
            codes,
            coefficients: coefficient_formats,
            intermediate: Target::signed(127, fraction_bits),
            output,
            scheme,
        };
        intermediate_with(formats, monomials, coefficients)
    };
    let formats = Formats {
        codes,
        coefficients: coefficient_formats,
        intermediate: Target::signed(127, 0),
        output,
        scheme,
    };
    let degree = coefficients.len().saturating_sub(1);
    let exact = Polynomial::exact_fraction_bits(&formats, monomials, degree).clamp(0, 63);
    let enough = |bound: f64| bound <= output.lsb() / 1000.0;
    let narrow = (0..=exact)
        .rev()
        .find_map(|n| with(n).filter(|(bits, ..)| *bits <= 64));
    if let Some((_, format, bound)) = narrow
        && enough(bound)
    {
        return Ok(format);
    }
    let wide = (0..=exact).find_map(|n| with(n).filter(|(.., bound)| enough(*bound)));
    let found = wide.or(narrow).map(|(_, format, _)| format);
    found.ok_or_else(|| {
        InputError::new("no intermediate format of up to 64 bits holds the evaluation's words")
            .help("give input or coefficients fewer bits, or say `--intermediate`")
            .into()
    })
}

/// The intermediate of these fraction bits, with the integer bits that ranges need: (widest word of the
/// evaluation, format, bound of what the steps round). None if it has over 64 bits.
fn intermediate_with(
    formats: Formats,
    monomials: Monomials,
    coefficients: &[i128],
) -> Option<(u32, Format, f64)> {
    let fraction_bits = formats.intermediate.fraction_bits;
    let form = Polynomial::new(formats, monomials, coefficients.to_vec()).ok()?;
    let bound = form
        .pieces()
        .iter()
        .map(|p| p.evaluation_bound)
        .fold(0.0, f64::max);
    let labels: Vec<bool> = { form.clone() }
        .casts_mut()
        .iter()
        .map(|c| c.overflow == Some(Overflow::Saturate) && c.label.key != "output")
        .collect();
    let settled = super::Form::Polynomial(Box::new(form)).settle().ok()?;
    let ranges = settled.program.cast_ranges.iter().zip(labels);
    let ranges = ranges.filter_map(|(range, counts)| range.filter(|_| counts));
    let range = ranges.reduce(Interval::join).unwrap_or(Interval::point(0));
    let integer_bits = integer_bits_of(range, fraction_bits).max(1) as u32;
    let format = Format::q(integer_bits, u32::try_from(fraction_bits).ok()?);
    (format.bits() <= 64).then_some((settled.bits, format, bound))
}

/// The same polynomial with steps that are rounded to so many fraction bits, and the integer bits that its words need.
/// `None` if that takes over 64 bits.
pub fn rounded_to(polynomial: &Polynomial, fraction_bits: i32) -> Option<Polynomial> {
    let with = |intermediate| Formats {
        intermediate,
        ..polynomial.formats
    };
    let (kind, raw) = (polynomial.monomials, &polynomial.coefficients);
    let wide = with(Target::signed(127, fraction_bits));
    let (_, format, _) = intermediate_with(wide, kind, raw)?;
    Polynomial::new(with(Target::from(format)), kind, raw.clone()).ok()
}

/// The same polynomial formats with only as many integer bits in the intermediate as these coefficients
/// need: the same results.
pub fn trimmed(formats: Formats, monomials: Monomials, coefficients: &[i128]) -> Formats {
    let wide = Formats {
        intermediate: Target::signed(127, formats.intermediate.fraction_bits),
        ..formats
    };
    match intermediate_with(wide, monomials, coefficients) {
        Some((_, format, _)) => Formats {
            intermediate: Target::from(format),
            ..formats
        },
        None => formats,
    }
}
