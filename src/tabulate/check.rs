//! What a request of `gyrogen approx` must be like.

use super::request::{Asked, Request};
use crate::approx::form::coefficient_formats::CoefficientFormats;
use crate::approx::form::measure::Reference;
use crate::approx::form::polynomial;
use crate::approx::form::polynomial::{Monomials, Scheme};
use crate::approx::form::{Codes, piecewise};
use crate::approx::real::{Domain, Expression};
use crate::approx::reference::Function;
use crate::error::{Error, InputError, Result};
use crate::numeric::format::{Format, pow2};
use crate::text::number;

/// The widest input and output: their codes are exact doubles.
const WIDEST_BITS: u32 = 48;

/// Refuses what cannot be used whatever the function.
///
/// # Errors
/// What is missing or out of range.
pub(super) fn request(request: &Request) -> Result<()> {
    let refuse = |message: String, help: &str| Err(InputError::new(message).help(help).into());
    if request.degree.is_none() && request.bound.is_none() {
        return refuse(
            "neither a degree nor a bound is given".into(),
            "say `--degree N`, or `--bound X` for the cheapest form whose certified error is at most X",
        );
    }
    if let Some(degree) = request.degree
        && degree > polynomial::HIGHEST_DEGREE
    {
        return refuse(
            format!(
                "degree {degree} is too high: the highest is {}",
                polynomial::HIGHEST_DEGREE
            ),
            "use `--form piecewise`: segments of a low degree reach the same error",
        );
    }
    if request
        .degree
        .is_some_and(|d| d > piecewise::HIGHEST_DEGREE || d == 0)
        && request.form == Asked::Piecewise
    {
        return refuse(
            format!("segments have degree 1 to {}", piecewise::HIGHEST_DEGREE),
            "shorter segments need no higher degree",
        );
    }
    if request.degree.is_some_and(|d| d > 2) && request.form == Asked::Table {
        return refuse(
            "tables are plain (degree 0), linear (1) or quadratic (2)".into(),
            "use `--form piecewise` for higher degrees",
        );
    }
    if request.monomials == Some(Monomials::Odd) && request.degree == Some(0) {
        return refuse(
            "an odd polynomial of degree 0 has no monomial".into(),
            "give a degree of at least 1",
        );
    }
    if let Some(bound) = request.bound
        && !(bound.is_finite() && bound > 0.0)
    {
        return refuse(
            format!("the bound {bound} is not a positive number"),
            "give the largest error that is acceptable, in the function's unit",
        );
    }
    for (what, format) in [("input", request.input), ("output", request.output)] {
        if format.bits() > WIDEST_BITS {
            return refuse(
                format!(
                    "the {what} format {format} has {} bits; {WIDEST_BITS} is the most",
                    format.bits()
                ),
                "give it fewer bits",
            );
        }
    }
    if request.coefficients.len() > 1 {
        let polynomial = matches!(request.form, Asked::Polynomial | Asked::Auto);
        if !polynomial || request.bound.is_some() {
            return refuse(
                format!(
                    "{} formats are given for the coefficients, and only a polynomial of a given degree, without \
                     `--bound`, has a format for each of them",
                    request.coefficients.len()
                ),
                "give one format: the entries of a table or of segments share it, and forms for a bound are tried with it",
            );
        }
    }
    if request.evaluation == Scheme::Estrin
        && !matches!(request.form, Asked::Polynomial | Asked::Auto)
    {
        return refuse(
            "Estrin's scheme is for one polynomial; tables and segments have their own evaluation"
                .into(),
            "leave `--evaluation` out, or use `--form polynomial`",
        );
    }
    if request.coefficients.is_empty()
        && request.bound.is_none()
        && matches!(request.form, Asked::Polynomial | Asked::Auto)
    {
        return refuse(
            "no format for the coefficients is given".into(),
            "say `--coefficients Qm.n`, or `--bound X` to have it chosen",
        );
    }
    check_name(&request.name)
}

fn check_name(name: &str) -> Result<()> {
    let letters = name
        .chars()
        .all(|c| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '_');
    let starts = name.starts_with(|c: char| c.is_ascii_lowercase());
    if letters && starts && name.len() <= 40 && !name.ends_with('_') {
        return Ok(());
    }
    Err(
        InputError::new(format!("`{name}` is no name for the emitted code"))
            .help("use lower-case letters, digits and underscores, such as `sine_table`")
            .into(),
    )
}

/// The function on its domain.
///
/// # Errors
/// What the expression or the domain lacks.
pub(super) fn function(request: &Request) -> Result<Function> {
    let of = |option: &'static str| {
        move |e: Error| match e {
            Error::Input(e) => Error::Input(Box::new(e.in_file(option))),
            other => other,
        }
    };
    let parse =
        |text: &str, option| Expression::parse_with(text, &request.parameters).map_err(of(option));
    let expression = parse(&request.function, "--function")?;
    let end = |text: &String| parse(text, "--domain");
    let domain = Domain::new(&end(&request.domain[0])?, &end(&request.domain[1])?)?;
    let tolerance = request.output.lsb() * pow2(-34);
    Function::new(&request.function, expression, domain, tolerance).map_err(of("--function"))
}

/// The codes of the input in the domain.
///
/// # Errors
/// A domain outside the input's format, or with less than two codes.
pub(super) fn codes(request: &Request, function: &Function) -> Result<Codes> {
    let (a, b) = function.domain();
    let format = request.input;
    let lsb = format.lsb();
    let (least, greatest) = (format.min_raw() as f64 * lsb, format.max_raw() as f64 * lsb);
    // A domain up to 1 is what a format of values below 1 is used for: one LSB more is allowed.
    if a < least || b > greatest + lsb {
        let needed = integer_bits(a.min(0.0), b.max(0.0), format);
        return Err(InputError::new(format!(
            "the domain {}, {} is outside the input format {format}, which holds {least} to {greatest}",
            request.domain[0], request.domain[1]
        ))
        .help(needed)
        .into());
    }
    let low = (a / lsb).ceil() as i128;
    let high = ((b / lsb).floor() as i128).min(format.max_raw());
    if high <= low {
        return Err(InputError::new(format!(
            "the domain {}, {} holds {} of the input's codes (one LSB of {format} is {lsb:e})",
            request.domain[0],
            request.domain[1],
            (high - low + 1).max(0)
        ))
        .help("give the input more fraction bits, or widen the domain")
        .into());
    }
    Ok(Codes { format, low, high })
}

/// The formats of so many fraction bits that hold values between two.
fn integer_bits(low: f64, high: f64, format: Format) -> String {
    let signed = low < -1e-9 * high;
    let mut bits = u32::from(signed);
    while bits < 200 {
        let magnitude = pow2(bits as i32 - i32::from(signed));
        let lsb = format.lsb();
        if high <= magnitude - lsb && low >= -magnitude {
            break;
        }
        bits += 1;
    }
    let bits = bits.max(1);
    let u = if signed || format.signed { "" } else { "U" };
    let bits = bits + u32::from(format.signed && !signed);
    format!(
        "it takes {bits} integer bits: {u}Q{bits}.{}",
        format.fraction_bits
    )
}

/// Refuses an output format that does not hold the function's values.
///
/// # Errors
/// The integer bits that it takes.
pub(super) fn output(request: &Request, function: &Function) -> Result<()> {
    let (a, b) = function.domain();
    let (least, greatest) = function.range(a, b);
    let format = request.output;
    let (low, high) = (
        format.min_raw() as f64 * format.lsb(),
        format.max_raw() as f64 * format.lsb(),
    );
    // One LSB beyond the end is limited, and counted as error; the rest is what the range is known to.
    let lsb = format.lsb() * 1.001 + 1e-8 * least.abs().max(greatest.abs());
    if least >= low - lsb && greatest <= high + lsb {
        return Ok(());
    }
    Err(InputError::new(format!(
        "the function's values, {} to {}, do not fit the output format {format}, which holds {low} to {high}",
        readable(least),
        readable(greatest)
    ))
    .help(integer_bits(least.min(0.0), greatest.max(0.0), format))
    .into())
}

/// A value that is known to a few digits.
fn readable(value: f64) -> String {
    match value.abs() {
        v if v < 1e-7 => "0".to_owned(),
        v if (1e-3..1e7).contains(&v) => format!("{value:.6}"),
        _ => number(value, 5),
    }
}

/// Refuses polynomials that have more coefficients than there are codes, or that are 0 where the function is not.
///
/// # Errors
/// Which of the two.
pub(super) fn polynomial(request: &Request, function: &Function, codes: Codes) -> Result<()> {
    let (Some(degree), Asked::Polynomial | Asked::Auto) = (request.degree, request.form) else {
        return Ok(());
    };
    let kind = request.monomials.unwrap_or_default();
    let unknowns = kind.exponents(degree).len();
    if unknowns as u128 > codes.count() {
        return Err(InputError::new(format!(
            "a polynomial of degree {degree} has {unknowns} coefficients, but the domain holds only {} codes of the input",
            codes.count()
        ))
        .help("use a lower degree, or a plain table: `--form table --degree 0`")
        .into());
    }
    if !request.coefficients.is_empty() {
        CoefficientFormats::new(&request.coefficients, kind, degree)?;
    }
    let (a, b) = function.domain();
    if kind == Monomials::Odd && a <= 0.0 && b >= 0.0 {
        let (value, radius) = function.at(0.0);
        if value.abs() - radius > 0.5 * request.output.lsb() {
            return Err(InputError::new(format!(
                "an odd polynomial is 0 at x = 0, where the function is {}",
                readable(value)
            ))
            .help("use `--monomials all` or `even`, or a domain without 0")
            .into());
        }
    }
    Ok(())
}
