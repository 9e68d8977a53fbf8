//! The job of `gyrogen approx`: from a request to a form, its proved error and its bundles.

use super::choice::{self, Candidate, Wanted};
use super::coefficients::{self, Chosen};
use super::cost::{Cost, Target};
use super::form::measure::{Effort, Measured, Reference, measure};
use super::form::polynomial::{self, Monomials, Polynomial};
use super::form::split::Spacing;
use super::form::{Codes, Form, Settled, overflow};
use super::outcome::{ErrorBounds, Formats, Outcome, TableData, Word};
use super::reference::Function;
use super::real::{Domain, Expression};
use crate::emit::manifest::sha256;
use crate::error::{Error, InputError, Result};
use crate::numeric::cast::Target as Quantised;
use crate::numeric::format::{Format, pow2};
use std::collections::BTreeMap;

/// Codes that are all run if nobody says `--exhaustive`.
pub const EXHAUSTIVE_CODES: u128 = 1 << 24;
/// Codes that are all run if somebody does.
pub const MOST_CODES: u128 = 1 << 32;
/// The widest input and output: their codes are exact doubles.
const WIDEST_BITS: u32 = 48;

/// Which form is asked for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, clap::ValueEnum)]
pub enum Asked {
    /// One polynomial.
    #[default]
    Polynomial,
    /// A table.
    Table,
    /// A polynomial for each segment.
    Piecewise,
    /// The cheapest that meets the bound.
    Auto,
}

/// What the error is weighed with when coefficients are chosen.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, clap::ValueEnum)]
pub enum Weight {
    /// The function's own unit.
    #[default]
    Absolute,
    /// Parts of the function's magnitude.
    Relative,
}

/// A request.
#[derive(Debug, Clone)]
pub struct Request {
    /// The expression.
    pub function: String,
    /// Named values in it.
    pub parameters: BTreeMap<String, f64>,
    /// Both ends, constant expressions.
    pub domain: [String; 2],
    /// Highest order.
    pub degree: Option<usize>,
    /// Which monomials; all, or with a bound whatever is cheapest, if not given.
    pub monomials: Option<Monomials>,
    /// Of the input.
    pub input: Format,
    /// Of the output.
    pub output: Format,
    /// Of coefficients or entries.
    pub coefficients: Option<Format>,
    /// Of the cast after each step.
    pub intermediate: Option<Format>,
    /// Which form.
    pub form: Asked,
    /// The most that the certified error may be.
    pub bound: Option<f64>,
    /// For the choice of coefficients.
    pub weight: Weight,
    /// Run up to 2^32 codes.
    pub exhaustive: bool,
    /// For the estimate of cycles.
    pub target: Target,
    /// Prefix of the emitted names.
    pub name: String,
}

impl Request {
    /// One line for each thing asked, in a fixed order: what the result depends on.
    pub fn canonical(&self) -> String {
        let mut text = format!("function = {}\n", self.function);
        for (name, value) in &self.parameters {
            text += &format!("parameter {name} = {value:e}\n");
        }
        let some = |f: Option<Format>| f.map_or("chosen".to_owned(), |f| f.to_string());
        text += &format!(
            "domain = {}, {}\ndegree = {:?}\nmonomials = {:?}\ninput = {}\noutput = {}\n",
            self.domain[0], self.domain[1], self.degree, self.monomials, self.input, self.output
        );
        text += &format!(
            "coefficients = {}\nintermediate = {}\nform = {:?}\nbound = {:?}\nweight = {:?}\ntarget = {:?}\nname = {}\n",
            some(self.coefficients),
            some(self.intermediate),
            self.form,
            self.bound,
            self.weight,
            self.target,
            self.name
        );
        text
    }
}

/// The result: what is reported, and what is emitted.
#[derive(Debug, Clone)]
pub struct Approximation {
    /// For `approx.json`.
    pub outcome: Outcome,
    /// The form with its program.
    pub settled: Settled,
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
    check(request)?;
    let function = function(request)?;
    let codes = codes(request, &function)?;
    check_output(request, &function)?;
    let (form, search, candidates) = choose(request, &function, codes)?;
    let most_codes = if request.exhaustive { MOST_CODES } else { EXHAUSTIVE_CODES };
    let settled = form.settle()?;
    overflow::refuse(&settled, most_codes)?;
    let total = codes.count();
    let effort = Effort {
        most_codes,
        threads,
        progress: &|count| progress(total, count),
    };
    let measured = measure(&settled, &function, &effort)?;
    let alternatives = candidates.map(|(all, chosen)| choice::alternatives(&all, chosen));
    let (coefficients, table) = data(&settled.form);
    let outcome = Outcome {
        schema: "gyrogen.approx/1",
        version: env!("CARGO_PKG_VERSION"),
        design_sha256: sha256(request.canonical().as_bytes()),
        command: command.to_owned(),
        function: request.function.clone(),
        domain: request.domain.join(","),
        input_codes: [codes.low, codes.high],
        form: settled.form.name(),
        detail: detail(&settled.form),
        monomials: match &settled.form {
            Form::Polynomial(p) => Some(p.monomials),
            _ => None,
        },
        formats: formats(&settled.form, request),
        coefficients,
        table,
        error: bounds(&measured),
        inputs_checked: measured.inputs_checked,
        exhaustive: measured.exhaustive,
        cost: Cost::of(&settled, request.target),
        target: request.target,
        search,
        alternatives,
        bound: request.bound,
        holds: request.bound.is_none_or(|bound| measured.certified <= bound),
    };
    Ok(Approximation { outcome, settled })
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

fn check(request: &Request) -> Result<()> {
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
            format!("degree {degree} is too high: the highest is {}", polynomial::HIGHEST_DEGREE),
            "use `--form piecewise`: segments of a low degree reach the same error",
        );
    }
    if request.degree.is_some_and(|d| d > super::form::piecewise::HIGHEST_DEGREE || d == 0)
        && request.form == Asked::Piecewise
    {
        return refuse(
            format!("segments have degree 1 to {}", super::form::piecewise::HIGHEST_DEGREE),
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
                format!("the {what} format {format} has {} bits; {WIDEST_BITS} is the most", format.bits()),
                "give it fewer bits",
            );
        }
    }
    if request.coefficients.is_none()
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
    let letters = name.chars().all(|c| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '_');
    let starts = name.starts_with(|c: char| c.is_ascii_lowercase());
    if letters && starts && name.len() <= 40 && !name.ends_with('_') {
        return Ok(());
    }
    Err(InputError::new(format!("`{name}` is no name for the emitted code"))
        .help("use lower-case letters, digits and underscores, such as `sine_table`")
        .into())
}

fn function(request: &Request) -> Result<Function> {
    let expression = Expression::parse_with(&request.function, &request.parameters)?;
    let end = |text: &String| Expression::parse_with(text, &request.parameters);
    let domain = Domain::new(&end(&request.domain[0])?, &end(&request.domain[1])?)?;
    let tolerance = request.output.lsb() * pow2(-24);
    Function::new(&request.function, expression, domain, tolerance)
}

/// The codes of the input in the domain.
fn codes(request: &Request, function: &Function) -> Result<Codes> {
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
    format!("it takes {bits} integer bits: {u}Q{bits}.{}", format.fraction_bits)
}

fn check_output(request: &Request, function: &Function) -> Result<()> {
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
        "the function's values, {least:.6} to {greatest:.6}, do not fit the output format {format}, which holds {low} to {high}"
    ))
    .help(integer_bits(least.min(0.0), greatest.max(0.0), format))
    .into())
}

type Choice = (Form, Option<super::outcome::Search>, Option<(Vec<Candidate>, usize)>);

fn choose(request: &Request, function: &Function, codes: Codes) -> Result<Choice> {
    if let (Some(degree), Asked::Polynomial | Asked::Auto, None) =
        (request.degree, request.form, request.bound)
    {
        let kind = request.monomials.unwrap_or_default();
        let (form, search) = polynomial_as_asked(function, codes, request, kind, degree)?;
        return Ok((form, Some(search), None));
    }
    let wanted = Wanted {
        polynomial: matches!(request.form, Asked::Polynomial | Asked::Auto),
        table: matches!(request.form, Asked::Table | Asked::Auto),
        piecewise: matches!(request.form, Asked::Piecewise | Asked::Auto),
    };
    // A degree alone for segments: as many as keep the error within one LSB.
    let bound = request.bound.unwrap_or(request.output.lsb());
    let candidates = choice::candidates(function, codes, request, bound, wanted)?;
    let Some(chosen) = choice::cheapest(&candidates) else {
        return Err(unmet(request, bound));
    };
    let mut form = candidates[chosen].settled.form.clone();
    let mut search = None;
    if let Form::Polynomial(p) = &form {
        let degree = p.coefficients.len() - 1;
        let asked = Request {
            coefficients: Some(p.formats.coefficients),
            ..request.clone()
        };
        let (better, found) = polynomial_as_asked(function, codes, &asked, p.monomials, degree)?;
        // The search is for the least error: the same degree, the same formats.
        (form, search) = (better, Some(found));
    }
    let listed = request.bound.map(|_| (candidates, chosen));
    Ok((form, search, listed))
}

fn unmet(request: &Request, bound: f64) -> Error {
    let half = request.output.lsb() / 2.0;
    let help = if bound <= half {
        format!(
            "rounding to {} alone costs half an LSB, {half:e}: give the output more fraction bits",
            request.output
        )
    } else {
        "give a wider bound, or output, coefficients or degree more room".into()
    };
    InputError::new(format!("no form of the kind that was asked for has a certified error of at most {bound:e}"))
        .help(help)
        .into()
}

/// The polynomial of the request, with the best coefficients that the search finds.
fn polynomial_as_asked(
    function: &Function,
    codes: Codes,
    request: &Request,
    kind: Monomials,
    degree: usize,
) -> Result<(Form, super::outcome::Search)> {
    let format = request.coefficients.unwrap_or(Format::q(2, request.output.fraction_bits));
    let chosen = coefficients::choose(function, codes, request, kind, degree, format)?;
    let Chosen { raw, search } = chosen;
    let form = compiled(codes, request, kind, format, raw)?;
    Ok((Form::Polynomial(form), search))
}

/// A polynomial for a bound: the best coefficients under ideal evaluation, in the format that is given or
/// in the shortest that meets the bound.
pub(super) fn polynomial_within(
    function: &Function,
    codes: Codes,
    request: &Request,
    kind: Monomials,
    degree: usize,
    bound: f64,
) -> Option<Form> {
    let room = bound - 0.5 * request.output.lsb();
    let (format, raw) = coefficients::within(function, request, kind, degree, room)?;
    Some(Form::Polynomial(compiled(codes, request, kind, format, raw).ok()?))
}

/// The evaluation in the request's formats.
pub(super) fn compiled(
    codes: Codes,
    request: &Request,
    kind: Monomials,
    coefficients: Format,
    raw: Vec<i128>,
) -> Result<Polynomial> {
    let intermediate = match request.intermediate {
        Some(format) => format,
        None => polynomial::choose_intermediate(codes, coefficients, request.output, kind, &raw)?,
    };
    let formats = polynomial::Formats {
        codes,
        coefficients,
        intermediate: Quantised::from(intermediate),
        output: request.output,
    };
    Polynomial::new(formats, kind, raw)
}

/// A form in words.
pub fn detail(form: &Form) -> String {
    let segments = |split: &super::form::split::Split| {
        let symmetry = match split.symmetry {
            Some(s) => format!(", {} about code {}", if s.odd { "odd" } else { "even" }, s.about_raw),
            None => String::new(),
        };
        match split.spacing {
            Spacing::Uniform { bits } => {
                format!("{} segments of 2^{bits} codes{symmetry}", split.count)
            }
            Spacing::PowerOfTwo { .. } => {
                format!("{} segments, each half as long as the one above it{symmetry}", split.count)
            }
        }
    };
    match form {
        Form::Polynomial(p) => {
            let degree = p.coefficients.len() - 1;
            let kind = match p.monomials {
                Monomials::All => "",
                Monomials::Odd => "odd ",
                Monomials::Even => "even ",
            };
            format!("{kind}polynomial of degree {degree}, coefficients {}", p.formats.coefficients)
        }
        Form::Piecewise(p) => {
            format!("degree {} on {}", p.degree(), segments(&p.split))
        }
        Form::Table(t) => {
            let kind = format!("{:?}", t.kind).to_lowercase();
            format!("{kind} table of {} entries, {}", t.entries.entries.len(), segments(&t.split))
        }
        Form::Bipartite(b) => format!(
            "bipartite tables of {} and {} entries, {}",
            b.values.entries.len(),
            b.corrections.entries.len(),
            segments(&b.split)
        ),
    }
}

fn formats(form: &Form, request: &Request) -> Formats {
    let signed = |t: Quantised| {
        let u = if t.signed { "" } else { "U" };
        format!("{u}Q{}.{}", t.bits as i32 - t.fraction_bits, t.fraction_bits)
    };
    let (coefficients, intermediate) = match form {
        Form::Polynomial(p) => (
            p.formats.coefficients.to_string(),
            Some(signed(p.formats.intermediate)),
        ),
        Form::Piecewise(p) => {
            let f = p.fraction_bits;
            (format!("2^-{f}"), (p.degree() > 1).then(|| format!("2^-{f}")))
        }
        Form::Table(t) => (format!("2^-{}", t.entries.fraction_bits), None),
        Form::Bipartite(b) => (format!("2^-{}", b.values.fraction_bits), None),
    };
    Formats {
        input: request.input.to_string(),
        output: request.output.to_string(),
        coefficients,
        intermediate,
    }
}

fn data(form: &Form) -> (Option<Vec<Word>>, Option<TableData>) {
    let table = |kind, split: &super::form::split::Split, tables: &[&crate::numeric::arithmetic::Table]| TableData {
        kind,
        spacing: split.spacing,
        segments: split.count,
        middle_bits: None,
        symmetry: split.symmetry,
        fraction_bits: tables.first().map_or(0, |t| t.fraction_bits),
        entries: tables.iter().map(|t| (t.name, t.entries.to_vec())).collect(),
    };
    match form {
        Form::Polynomial(p) => {
            let lsb = p.formats.coefficients.lsb();
            let word = |raw: &i128| Word {
                raw: *raw,
                value: *raw as f64 * lsb,
            };
            (Some(p.coefficients.iter().map(word).collect()), None)
        }
        Form::Piecewise(p) => {
            let tables: Vec<_> = p.tables.iter().collect();
            (None, Some(table("piecewise", &p.split, &tables)))
        }
        Form::Table(t) => {
            let kind = match t.kind {
                super::form::table::Kind::Plain => "plain",
                super::form::table::Kind::Linear => "linear",
                super::form::table::Kind::Quadratic => "quadratic",
            };
            (None, Some(table(kind, &t.split, &[&t.entries])))
        }
        Form::Bipartite(b) => {
            let tables = [&b.values, &b.corrections];
            let data = TableData {
                middle_bits: Some(b.middle_bits),
                ..table("bipartite", &b.split, &tables)
            };
            (None, Some(data))
        }
    }
}
